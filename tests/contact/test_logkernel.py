import math

import numpy as np
import pytest
from scipy.integrate import quad

from ridgebayes.contact.logkernel import (
    cross_blocks,
    influence,
    log_ellipse,
    self_energies,
)


def potential_by_quadrature(n, x):
    """-int T_n(t)/sqrt(1-t^2) ln|x-t| dt with t = cos(theta), straight from the definition."""
    points = [math.acos(x)] if abs(x) < 1.0 else None
    integral, _ = quad(
        lambda theta: -math.cos(n * theta) * math.log(abs(x - math.cos(theta))),
        0.0,
        math.pi,
        points=points,
        epsabs=1e-12,
        epsrel=1e-12,
        limit=400,
    )
    return integral


@pytest.mark.parametrize("x", [1.001, 1.3, 25.0])
def test_influence_is_the_integral_of_the_logarithm(x):
    expected = [potential_by_quadrature(n, x) for n in range(6)]
    # Discretisation: quad's own tolerance with room for its log end point.
    np.testing.assert_allclose(influence(np.array([x - 1.0]), 6)[0], expected, atol=1e-10)


def test_influence_on_the_strip_is_the_diagonal():
    """Inside, T_n is an eigenfunction: the potential is pi ln 2, then (pi/n) T_n."""
    for n, x in [(0, 0.3), (1, 0.3), (4, -0.7)]:
        eigen = self_energies(5)[n] / (math.pi if n == 0 else math.pi / 2.0)
        # Discretisation: quad's tolerance, log singularity inside.
        expected = eigen * math.cos(n * math.acos(x))
        assert potential_by_quadrature(n, x) == pytest.approx(expected, abs=1e-9)


def test_influence_keeps_its_digits_far_away_and_near():
    far = influence(np.array([1e12]), 2)[0, 1]
    assert far == pytest.approx(math.pi / 2e12, rel=1e-11)  # algebra: (pi) z, z -> 1/(2x)
    near = 1.0 - influence(np.array([1e-20]), 2)[0, 1] / math.pi
    assert near == pytest.approx(math.sqrt(2e-20), rel=1e-5)  # algebra: eps over 1e-10


def test_cross_blocks_do_not_depend_on_the_number_of_nodes():
    """More functions mean more nodes: the blocks of the first few stay what they were."""
    for gap_ratio in (0.01, 2.0, 200.0):
        few, many = cross_blocks(gap_ratio, 3, 5), cross_blocks(gap_ratio, 3, 60)
        # Algebra: rounding of a weighted mean of numbers up to pi^2 ln(distance).
        np.testing.assert_allclose(many[:, :5, :5], few, atol=1e-13 * np.abs(few).max())


def test_ellipse_reaches_the_neighbour():
    rho = math.exp(log_ellipse(0.6))
    assert 0.5 * (rho + 1.0 / rho) == pytest.approx(1.6, rel=1e-14)  # algebra
