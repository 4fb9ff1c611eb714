import numpy as np
import pytest

from ridgebayes import HalfPlane, InputError
from ridgebayes.contact import halfplane

FORM = HalfPlane()


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.5])
def test_load__is_the_solvers_at_any_poissons_ratio(nu):
    a, b = 0.02, 0.015
    solved = halfplane.transition_loads(a, b, 12).p_over_E(a + b, nu=nu)
    loads = FORM.load(np.arange(4, 28, 2), a, b, nu=nu)
    np.testing.assert_allclose(loads, solved, rtol=1e-14)  # algebra: a square of a root


def test_load__scales_as_one_over_c_squared():
    c = np.array([[0.9], [1.0], [1.2]])
    loads = FORM.load([4, 8], 0.02, 0.015, c)
    np.testing.assert_allclose(loads * c**2, np.tile(loads[1], (3, 1)), rtol=1e-14)  # algebra


def test_continuous_count__is_linear_in_s_between_transitions():
    a, b = 0.012, 0.03
    rungs = np.concatenate([[0.0], np.sqrt(FORM.load([4, 6, 8, 10], a, b))])
    for k in range(4):
        fraction = np.array([0.0, 0.25, 0.5, 0.99])
        s = rungs[k] + fraction * (rungs[k + 1] - rungs[k])
        count = FORM.continuous_count(s**2, a, b)
        np.testing.assert_allclose(count, 2 + 2 * (k + fraction), rtol=1e-12)  # rounding


def test_continuous_count__reaches_rungs_beyond_the_first_guess():
    # Wide ridges with narrow grooves, a high load: the ladder has to be long enough. Of very
    # narrow ridges the rungs stand closer than smooth Hertz's, and the first guess is too short.
    Q = 2 + 2 * np.array([1, 7, 30, 100])
    for texture in ((0.3, 0.3), (0.01, 0.5), (1e-4, 5.0)):
        count = FORM.continuous_count(FORM.load(Q, *texture), *texture)
        np.testing.assert_allclose(count, Q, rtol=1e-12)  # algebra: root and interpolation


def test_load__refuses_more_pairs_than_the_solver_is_for():
    rule = r"a/R = 0.02, b/R = 0.015: expected at most 500 pairs, got 501"
    with pytest.raises(InputError, match=rule):
        FORM.load(2 + 2 * 501, 0.02, 0.015)
