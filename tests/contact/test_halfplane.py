import math

import numpy as np
import pytest

from ridgebayes import InputError
from ridgebayes.contact import halfplane, hertz
from ridgebayes.contact.halfplane import transition_loads

# Loads of an independent solution of the same equation, nu = 0.5, rounded to 1e-10.
REFERENCE = {
    (0.032, 0.01): (0.0009778101, 0.0037869602, 0.0084365009, 0.0149287912),
    (0.012, 0.01): (0.0002716017, 0.0010336853, 0.0022952272, 0.0040587552),
    (0.012, 0.03): (0.0009358497, 0.0035509515, 0.0079314125, 0.0141050501),
    (0.012, 0.09): (0.0048116545, 0.0186210147, 0.0423179351),
}


@pytest.fixture
def empty_cache():
    halfplane._table.cache_clear()
    yield
    halfplane._table.cache_clear()


def load_by_collocation(a, b, k, n_coefficients=24, n_nodes=400):
    """The slow, obvious way to F_k: all 2k strips, no symmetry, one dense solve per transition.

    Other strips act through plain Gauss-Chebyshev quadrature of ln|x - xi|; only the strip's own
    potential uses that Chebyshev polynomials are eigenfunctions. Lengths in pitches.
    """
    pitch, half = 1.0, 0.5 * a / (a + b)
    centres = (np.arange(-k, k) + 0.5) * pitch
    m = np.arange(n_coefficients)
    nodes = np.cos((np.arange(n_nodes) + 0.5) * math.pi / n_nodes)
    weights = np.cos(m[:, None] * np.arccos(nodes)) * math.pi / n_nodes

    def potential(x, centre):
        return -weights @ np.log(np.abs(x - centre - half * nodes))

    def own(s):
        theta = math.acos(s)
        tail = math.pi / m[1:] * np.cos(m[1:] * theta)
        return np.concatenate(([math.pi * math.log(2.0 / half)], tail))

    rows, right = [], []
    for i, centre in enumerate(centres):
        for s in np.cos((m + 0.5) * math.pi / n_coefficients):
            x = centre + half * s
            cells = [own(s) if i == j else potential(x, c) for j, c in enumerate(centres)]
            rows.append(np.concatenate((*cells, [-1.0])))
            right.append(-0.5 * x**2)
    corner = k + 0.5 * b / (a + b)
    rows.append(np.concatenate((*(potential(corner, c) for c in centres), [-1.0])))
    right.append(-0.5 * corner**2)
    solution = np.linalg.solve(np.array(rows), np.array(right))
    return 0.25 * math.pi * math.pi * solution[:-1:n_coefficients].sum()


@pytest.mark.parametrize(("a", "b"), REFERENCE)
def test_loads_are_the_reference_ones_to_every_printed_digit(a, b):
    loads = transition_loads(a, b, len(REFERENCE[a, b]))
    assert loads.status == ("ok",) * len(REFERENCE[a, b])
    # Reference: ten decimals are printed, and each holds.
    assert tuple(np.round(loads.p_over_E(a + b), 10)) == REFERENCE[a, b]


@pytest.mark.parametrize("a_over_b", [0.05, 1.0, 5.0])
def test_loads_are_those_of_straight_collocation(a_over_b):
    loads = transition_loads(a_over_b, 1.0, 4, rel_tol=1e-11)
    slow = [load_by_collocation(a_over_b, 1.0, k) for k in range(1, 5)]
    # Discretisation: both are converged far beyond; algebra leaves 1e-11 of the dense solve.
    np.testing.assert_allclose(loads.F, slow, rtol=3e-11)


def load_of_a_layered_smooth_body(half_width, a_over_pitch, n_coefficients=400):
    """F of a smooth flat whose body carries a layer: the averaged picture of very many ridges.

    -int q ln|x - xi| dxi + q ln(1/sin(pi a/(2 pitch))) = d - x^2/2, zero pressure at the ends;
    q = sqrt(1-t^2) sum of U_2n(t), collocated. Lengths in pitches.
    """
    compliance = -math.log(math.sin(0.5 * math.pi * a_over_pitch))
    n = 2 * np.arange(n_coefficients)
    theta = (np.arange(n_coefficients + 1) + 0.5) * 0.5 * math.pi / (n_coefficients + 1)
    angle = theta[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        first = np.where(n == 0, math.log(2.0 / half_width), np.cos(n * angle) / n)
    second = np.cos((n + 2) * angle) / (n + 2)
    # sqrt(1-t^2) U_n = (T_n - T_(n+2)) / (2 sqrt(1-t^2)), and t = cos(theta)
    matrix = 0.5 * math.pi * half_width * (first - second) + compliance * np.sin((n + 1) * angle)
    matrix = np.column_stack((matrix, -np.ones_like(theta)))
    q = np.linalg.solve(matrix, -0.5 * (half_width * np.cos(theta)) ** 2)
    return 0.25 * math.pi * (0.5 * math.pi * half_width * q[0])


@pytest.mark.parametrize(
    ("a_over_pitch", "beta"),
    [(0.02, 0.433), (0.12, 0.368), (0.286, 0.280), (0.5, 0.179), (0.76, 0.071)],
)
def test_many_ridges_are_a_smooth_contact_with_the_ridges_compliance(a_over_pitch, beta):
    """An independent, averaged theory: half-width (k + beta) pitches gives transition k."""
    F = transition_loads(a_over_pitch, 1.0 - a_over_pitch, 100).F
    for k in (10, 30, 100):
        low, high = (
            load_of_a_layered_smooth_body(k + beta + shift, a_over_pitch)
            for shift in (-0.0035, 0.0035)
        )
        # Reference: beta is printed to three decimals and constant to 0.003 from 10 to 100.
        assert low < F[k - 1] < high


def test_ridges_tend_to_the_smooth_cylinder_as_grooves_close():
    k = np.arange(1, 5)
    smooth = hertz.load_of_half_width(k, nu=0.0)
    errors = [
        np.abs(transition_loads(a_over_b, 1.0, 4).F / smooth - 1.0) for a_over_b in (10, 100, 1000)
    ]
    # Discretisation: first order in b/a, constant 1/3 measured at k = 1.
    assert np.all(errors[0] < 0.4 / 10.0)
    np.testing.assert_allclose(errors[1] / errors[2], 10.0, rtol=0.1)


@pytest.mark.parametrize("a_over_b", [0.01, 0.1, 1.0, 10.0, 100.0, 1000.0])
def test_default_tolerance_is_kept(a_over_b):
    usual = transition_loads(a_over_b, 1.0, 4)
    better = transition_loads(a_over_b, 1.0, 4, rel_tol=1e-11)
    assert set(usual.status) == set(better.status) == {"ok"}
    # Discretisation: the tolerance asked for.
    assert np.all(np.abs(usual.F / better.F - 1.0) <= 1e-8)


def test_loads_do_not_depend_on_how_many_were_asked_for(empty_cache):
    few = transition_loads(0.012, 0.03, 3)
    halfplane._table.cache_clear()
    many = transition_loads(0.012, 0.03, 70)
    assert np.array_equal(few.F, many.F[:3])
    assert many.F.shape == (70,)


def test_what_rounding_forbids_is_said():
    loads = transition_loads(1.0, 1.0, 3, rel_tol=1e-15)
    assert all(status.startswith("not converged: estimated") for status in loads.status)
    assert np.all(np.isfinite(loads.F))


def test_what_is_over_the_cap_is_said(empty_cache, monkeypatch):
    monkeypatch.setattr(halfplane, "MAX_UNKNOWNS", 42)  # six strips of seven coefficients
    loads = transition_loads(1.0, 1.0, 20)
    assert loads.status[:6] == ("ok",) * 6
    assert all(status.startswith("not computed: 7 coeff") for status in loads.status[6:])
    assert np.all(np.isnan(loads.F[6:]))


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ((0.0, 1.0, 3), "ridge_width"),
        ((1.0, -1.0, 3), "groove_width"),
        ((1.0, math.nan, 3), "groove_width"),
        ((math.inf, 1.0, 3), "ridge_width"),
        ((1.0, 1.0, 0), "n_transitions"),
    ],
)
def test_bad_arguments_are_named(arguments, named):
    with pytest.raises(InputError, match=named):
        transition_loads(*arguments)


@pytest.mark.parametrize("rel_tol", [0.0, -1e-8, 0.2, math.nan])
def test_bad_tolerances_are_refused(rel_tol):
    with pytest.raises(InputError, match="rel_tol"):
        transition_loads(1.0, 1.0, 3, rel_tol=rel_tol)
