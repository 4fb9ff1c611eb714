import numpy as np
import pytest

from ridgebayes import HalfPlane, InputError
from ridgebayes.contact import halfplane, hertz
from ridgebayes.contact.loadtable import HalfPlaneLoads
from ridgebayes.model.forms import half_plane

FORM = HalfPlane()

# Reference: independent code with other unknowns, nu = 0.5; every printed digit holds.
REFERENCE = {
    (0.032, 0.01): (0.0009778101, 0.0037869602, 0.0084365009, 0.0149287912),
    (0.012, 0.01): (0.0002716017, 0.0010336853, 0.0022952272, 0.0040587552),
    (0.012, 0.03): (0.0009358497, 0.0035509515, 0.0079314125, 0.0141050501),
    (0.012, 0.09): (0.0048116545, 0.0186210147, 0.0423179351),
}


@pytest.mark.parametrize("texture", REFERENCE)
def test_load__is_the_reference_table(texture):
    expected = np.array(REFERENCE[texture])
    loads = FORM.load(4 + 2 * np.arange(len(expected)), *texture)
    np.testing.assert_allclose(loads, expected, rtol=0, atol=0.5001e-10)  # printed digits


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


@pytest.mark.parametrize("texture", [*REFERENCE, (0.5, 0.01), (0.001, 0.2)])
@pytest.mark.parametrize("nu", [0.2, 0.5])
def test_count__at_its_own_load_counts_that_pair_and_an_ulp_below_does_not(texture, nu):
    for Q in (4, 6, 10, 34):
        load = FORM.load(Q, *texture, nu=nu)
        assert FORM.count(load, *texture, nu=nu) == Q
        assert FORM.count(np.nextafter(load, 0), *texture, nu=nu) == Q - 2


def test_continuous_count__is_linear_in_s_between_transitions():
    a, b = 0.012, 0.03
    rungs = np.concatenate([[0.0], np.sqrt(REFERENCE[a, b])])
    for k in range(4):
        fraction = np.array([0.0, 0.25, 0.5, 0.99])
        s = rungs[k] + fraction * (rungs[k + 1] - rungs[k])
        # Reference: rungs from ten printed digits, 6 of which s near first touch can rely on.
        count = FORM.continuous_count(s**2, a, b)
        np.testing.assert_allclose(count, 2 + 2 * (k + fraction), atol=1e-6)


def test_continuous_count__reaches_rungs_beyond_the_first_guess():
    # Wide ridges with narrow grooves, a high load: the ladder has to be long enough. Of very
    # narrow ridges the rungs stand closer than smooth Hertz's, and the first guess is too short.
    Q = 2 + 2 * np.array([1, 7, 30, 100])
    for texture in ((0.3, 0.3), (0.01, 0.5), (1e-4, 5.0)):
        count = FORM.continuous_count(FORM.load(Q, *texture), *texture)
        np.testing.assert_allclose(count, Q, rtol=1e-12)  # algebra: root and interpolation


def test_pairs__passes_over_what_has_no_value_and_goes_on():
    a, b = np.array([[0.012, 0.032], [0.01, 0.01]])
    shape = np.array([np.nan, FORM.shape(6, 0.032, 0.01)])
    assert np.isnan(FORM.pairs(shape, a, b)[0])
    assert FORM.pairs(shape, a, b)[1] == pytest.approx(2, rel=1e-14)  # algebra


def test_slope__is_that_of_the_smooth_cylinder():
    expected = 2 * float(hertz.hertz_constant()) / 0.05 * 1.1
    assert float(FORM.slope(0.02, 0.03, [1.1])) == pytest.approx(expected, rel=1e-14)  # algebra


def test_load__refuses_more_pairs_than_the_solver_is_for():
    rule = r"a/R = 0.02, b/R = 0.015: expected at most 500 pairs, got 501"
    with pytest.raises(InputError, match=rule):
        FORM.load(2 + 2 * 501, 0.02, 0.015)


def test_load__is_there_up_to_the_last_pair_that_the_solver_is_for(monkeypatch):
    expected = FORM.load(8, 0.02, 0.015)
    monkeypatch.setattr(HalfPlane, "n_transition_max", 3)
    assert FORM.load(8, 0.02, 0.015) == expected
    with pytest.raises(InputError, match=r"expected at most 3 pairs, got 4"):
        FORM.load(10, 0.02, 0.015)


def test_load__refuses_what_the_solver_could_not_compute(monkeypatch):
    def failing(ridge_width, groove_width, n_transitions):
        return HalfPlaneLoads.not_computed(n_transitions, "too many unknowns")

    monkeypatch.setattr(half_plane, "transition_loads", failing)
    rule = "a/R = 0.02, b/R = 0.015: expected loads within .*, got not computed: too many unknowns"
    with pytest.raises(InputError, match=rule):
        FORM.load(4, 0.02, 0.015)
