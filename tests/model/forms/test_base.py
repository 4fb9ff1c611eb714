import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ridgebayes import Classic, HalfPlane, Hybrid, InputError, Modified, PowerLaw
from ridgebayes.model.forms import FORMS, as_form, form_named

# Algebra: a dozen roundings of condition 1.
ROUNDING = 1e-14
COUNTS = (4, 10, 1_000, 1_000_000)

width = st.floats(-4, 0).map(lambda exponent: 10**exponent)
coefficient = st.floats(0.3, 3)
poisson = st.floats(0, 0.5)
kind = st.sampled_from(("classic", "modified", "hybrid", "power-law"))


def form_and_theta(name, a, b, c):
    """A form of that name that knows the texture, with coefficients made from one number."""
    if name == "power-law":
        return PowerLaw().bind(((a, b),)), np.array([2 * c / (a + b)])
    form = form_named(name)
    return form, np.array([c, 0.01 * c])[: len(form.parameter_names)]


@pytest.mark.slow
@settings(max_examples=300)
@given(name=kind, a=width, b=width, c=coefficient, nu=poisson)
def test_count__at_a_forms_own_load_counts_that_pair_and_an_ulp_below_does_not(name, a, b, c, nu):
    form, theta = form_and_theta(name, a, b, c)
    for Q in COUNTS:
        load = form.load(Q, a, b, theta, nu)
        assert form.count(load, a, b, theta, nu) == Q
        assert form.count(np.nextafter(load, 0), a, b, theta, nu) == Q - 2


@given(name=kind, a=width, b=width, c=coefficient, data=st.data())
def test_count__never_falls_as_the_load_rises(name, a, b, c, data):
    form, theta = form_and_theta(name, a, b, c)
    loads = np.sort(data.draw(st.lists(st.floats(0, 1), min_size=2, max_size=20)))
    assert np.all(np.diff(form.count(loads, a, b, theta)) >= 0)
    assert np.all(np.diff(form.continuous_count(loads, a, b, theta)) >= 0)


@given(name=kind, a=width, b=width, c=coefficient)
def test_load__rises_with_every_pair(name, a, b, c):
    form, theta = form_and_theta(name, a, b, c)
    assert np.all(np.diff(form.load(np.arange(2, 100, 2), a, b, theta)) > 0)


@given(name=kind, a=width, b=width, c=coefficient, nu=poisson)
def test_continuous_count__inverts_load(name, a, b, c, nu):
    form, theta = form_and_theta(name, a, b, c)
    Q = np.array([4, 10, 1_000])
    back = form.continuous_count(form.load(Q, a, b, theta, nu), a, b, theta, nu)
    # Algebra: Classic subtracts its half groove, at b >> a from a number b/a times larger.
    np.testing.assert_allclose(back, Q, rtol=ROUNDING * (10 + b / a))


@given(name=kind, a=width, b=width, c=coefficient, nu=poisson)
def test_load__poissons_ratio_enters_by_the_plane_strain_modulus(name, a, b, c, nu):
    form, theta = form_and_theta(name, a, b, c)
    # p (1 - nu^2)/E is what half-plane theory keeps: 0.75 p/E at nu = 0.5.
    kept = form.load([4, 20], a, b, theta, nu) * (1 - nu**2)
    np.testing.assert_allclose(kept, 0.75 * form.load([4, 20], a, b, theta), rtol=ROUNDING)


@given(name=kind, a=width, b=width, c=coefficient)
def test_log_load_gradient__is_the_central_difference(name, a, b, c):
    form, theta = form_and_theta(name, a, b, c)
    gradient = form.log_load_gradient(theta, a, b)
    for i, value in enumerate(theta):
        step = np.zeros_like(theta)
        step[i] = 1e-5 * value
        up, down = (np.log(form.load(12, a, b, t)) for t in (theta + step, theta - step))
        # Discretisation: (1e-5)^2; rounding: eps times |log p| (20) over 1e-5.
        scale = max(abs(gradient[i] * value), 1e-3)
        assert gradient[i] * value == pytest.approx((up - down) / 2e-5, abs=1e-6 * scale + 1e-9)


@pytest.mark.parametrize("form", [Classic(), Modified(), Hybrid(), HalfPlane()])
def test_load_and_continuous_count__broadcast_draws_textures_and_loads(form):
    textures = np.array([(0.012, 0.03), (0.032, 0.01), (0.022, 0.02)])
    a, b = textures[:, :1], textures[:, 1:]
    draws = np.array(form.published) * np.linspace(0.9, 1.1, 5)[:, None]
    Q, p, nu = np.array([4, 6, 8, 10]), np.array([0.0, 1e-3, 4e-3, 0.01]), 0.3
    loads = form.load(Q, a, b, draws, nu)
    counts = form.continuous_count(p, a, b, draws, nu)
    assert loads.shape == counts.shape == (5, 3, 4)
    assert form.log_load_gradient(draws, *textures.T).shape == (5, 3, len(form.published))
    assert form.slope(*textures.T, draws).shape == (5, 3)
    for d, theta in enumerate(draws):
        for t, (one_a, one_b) in enumerate(textures):
            # Algebra: IEEE rounds +, *, / and sqrt alike in arrays of any size.
            assert loads[d, t].tolist() == [form.load(q, one_a, one_b, theta, nu) for q in Q]
            assert counts[d, t].tolist() == [
                form.continuous_count(x, one_a, one_b, theta, nu) for x in p
            ]


@pytest.mark.parametrize("form", [Classic(), Modified(), Hybrid(), HalfPlane()])
def test_slope__is_the_derivative_of_the_continuous_count(form):
    a, b = 0.022, 0.02
    # HalfPlane has this slope in the limit of many ridges only.
    Q = 402 if form.name == "half-plane" else 20
    loads = form.load([Q, Q + 2], a, b)
    slope = 2 / np.diff(np.sqrt(loads))[0]
    # Rounding for the closed forms; discretisation, falling with Q, for the half-plane.
    tolerance = 5e-4 if form.name == "half-plane" else 1e-12
    assert float(form.slope(a, b)) == pytest.approx(slope, rel=tolerance)


def test_load__is_nan_where_the_rate_is_not_positive():
    theta = [[1.0, -1.0], [1.0, 0.0]]  # K = 1/0.05 - 1/0.02 < 0 in the first
    load = Hybrid().load(4, 0.02, 0.03, theta)
    assert np.isnan(load).tolist() == [True, False]
    assert np.isnan(Hybrid().continuous_count(0.01, 0.02, 0.03, theta)).tolist() == [True, False]


def test_count__is_exact_up_to_two_to_the_52_and_refused_beyond():
    form = PowerLaw().bind(((0.01, 0.02),))
    # With K = 1 count Q is reached at (Q - 2)^2: powers of two, without rounding.
    largest = 2**52 - 2.0
    assert form.count(largest**2, 0.01, 0.02, [1.0]) == 2**52
    with pytest.raises(InputError, match=r"expected counts up to 2\^52"):
        form.count((largest + 1) ** 2, 0.01, 0.02, [1.0])


@settings(max_examples=300)
@given(name=kind, a=width, b=width, c=coefficient, nu=poisson, Q=st.integers(2, 2**51 - 4))
def test_count__is_that_of_the_load_as_far_as_counts_go(name, a, b, c, nu, Q):
    form, theta = form_and_theta(name, a, b, c)
    assert form.count(form.load(2 * Q, a, b, theta, nu), a, b, theta, nu) == 2 * Q


@pytest.mark.parametrize("bad", [-1e-9, np.nan, np.inf])
def test_continuous_count__refuses_loads_that_are_negative_or_not_finite(bad):
    with pytest.raises(InputError, match=rf"p_over_E: expected finite and >= 0, .*, got {bad}"):
        Hybrid().continuous_count(bad, 0.01, 0.01)


def test_load__refuses_a_wrong_number_of_coefficients():
    rule = r"hybrid: theta: expected 2 coefficients on its last axis \(c1, c2\), got 1"
    with pytest.raises(InputError, match=rule):
        Hybrid().load(4, 0.01, 0.01, [1.3])


def test_form_named__finds_every_form_and_names_them_for_a_wrong_name():
    assert [form_named(name).name for name in FORMS] == list(FORMS)
    rule = "form 'cubic': unknown; expected one of classic, power-law, modified, hybrid, half-plane"
    with pytest.raises(InputError, match=rule):
        form_named("cubic")


@pytest.mark.parametrize(
    ("ask", "shapes"),
    [
        (lambda f: f.load([4, 6], [0.01] * 3, 0.01), r"a_over_R \(3,\), Q \(2,\)"),
        (lambda f: f.load(4, [0.01] * 3, 0.01, nu=[0.5] * 2), r"a_over_R \(3,\), nu \(2,\)"),
        (lambda f: f.count([0.01] * 2, 0.01, [0.01] * 3), r"b_over_R \(3,\), p_over_E \(2,\)"),
        (lambda f: f.slope([0.01] * 2, [0.01] * 3), r"a_over_R \(2,\), b_over_R \(3,\)"),
        (lambda f: f.log_load_gradient([1, 0], [0.01] * 2, [0.01] * 3), r"a_over_R \(2,\), b_over"),
    ],
)
def test_forms__refuse_shapes_that_do_not_broadcast(ask, shapes):
    with pytest.raises(InputError, match=rf"expected arrays whose shapes broadcast, got {shapes}"):
        ask(Hybrid())


def test_as_form__takes_a_form_or_its_name():
    form = Hybrid()
    assert as_form(form) is form
    assert as_form("hybrid") == form
    with pytest.raises(InputError, match=r"form: expected a form, such as Hybrid\(\)"):
        as_form(Hybrid)
    for name in ("hybrid", "average", "noise", "a/b", "..", "", 3):
        with pytest.raises(InputError, match=f"form: expected a name of letters.*, got {name!r}"):
            as_form(type("Own", (Modified,), {"name": name})())
