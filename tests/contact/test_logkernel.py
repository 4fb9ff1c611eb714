import math

import numpy as np
import pytest
from scipy.integrate import quad

from ridgebayes.contact.logkernel import (
    influence,
    log_ellipse,
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


def test_influence_keeps_its_digits_far_away_and_near():
    far = influence(np.array([1e12]), 2)[0, 1]
    assert far == pytest.approx(math.pi / 2e12, rel=1e-11)  # algebra: (pi) z, z -> 1/(2x)
    near = 1.0 - influence(np.array([1e-20]), 2)[0, 1] / math.pi
    assert near == pytest.approx(math.sqrt(2e-20), rel=1e-5)  # algebra: eps over 1e-10


def test_ellipse_reaches_the_neighbour():
    rho = math.exp(log_ellipse(0.6))
    assert 0.5 * (rho + 1.0 / rho) == pytest.approx(1.6, rel=1e-14)  # algebra
