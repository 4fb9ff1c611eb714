import tracemalloc

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from ridgebayes.distributions.distribution import HalfNormal, LogNormal, Normal
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.model.forms import Classic, HalfPlane, Hybrid, Modified, PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.table.table import ContactTable

TEXTURES = np.array([(0.012, 0.03), (0.032, 0.01), (0.022, 0.02)])
FORMS = [Classic(), Modified(), Hybrid(), PowerLaw(), HalfPlane()]


def made_up(rng, *, rel_se=False, nu=False):
    """Noisy rows of three textures, two curves each; nothing about them is regular."""
    rows = []
    for a, b in TEXTURES:
        for series in ("one", "two"):
            count = np.arange(4, 4 + 2 * rng.integers(2, 6), 2)
            load = ((count / 2 - 1) * (a + b) / 1.4) ** 2 * np.exp(0.03 * rng.standard_normal())
            rows += [
                {
                    "a_over_R": a,
                    "b_over_R": b,
                    "Q": q,
                    "p_over_E": p * np.exp(0.02 * rng.standard_normal()),
                    "series": series,
                    "rel_se": float(rng.choice([0.0, 0.01, 0.03])) if rel_se else 0.0,
                    "nu": (0.3 if series == "one" else 0.45) if nu else 0.5,
                }
                for q, p in zip(count, load, strict=True)
            ]
    return pd.DataFrame(rows)


def observations(frame):
    return Observations.from_table(ContactTable.from_frame(frame))


def draws_of(model, rng, n=7):
    start = model.to_theta(np.zeros(model.n_parameter))
    return start * np.exp(0.1 * rng.standard_normal((n, len(start)))) + np.where(
        start == 0, 0.02 * rng.standard_normal((n, len(start))), 0.0
    )


def row_by_row(model, frame, theta):
    """The slow oracle: one normal density of log load per row."""
    total = 0.0
    for row in frame.itertuples():
        load = model.form.load(row.Q, row.a_over_R, row.b_over_R, theta[:-1], row.nu)
        sd = np.hypot(theta[-1], row.rel_se)
        total += stats.norm.logpdf(np.log(row.p_over_E), np.log(load), sd)
    return total


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("columns", [{}, {"rel_se": True}, {"nu": True, "rel_se": True}])
def test_log_likelihood__of_grouped_rows_is_the_row_by_row_sum(form, columns):
    rng = np.random.default_rng(11)
    frame = made_up(rng, **columns)
    model = Model(observations(frame), form)
    u = model.to_unconstrained(draws_of(model, rng))
    theta = model.to_theta(u)
    expected = [row_by_row(model, frame, one) for one in theta]
    # Algebra: residuals of 1e-2 beside values of 10, squared and summed over 20 rows.
    np.testing.assert_allclose(model.log_likelihood(theta), expected, rtol=1e-11)
    np.testing.assert_allclose(model.pointwise_log_likelihood(u).sum(axis=-1), expected, rtol=1e-11)


def test_log_likelihood__is_equation_7_and_a_normal_density():
    # One row, typed out without the package: eq. (7) with c1 = 1.3, c2 = 0.02, sd 0.05.
    frame = pd.DataFrame({"a_over_R": [0.02], "b_over_R": 0.03, "Q": 8, "p_over_E": 0.01})
    model = Model(observations(frame), Hybrid())
    slope = 1.3 / 0.05 + 0.02 / 0.02
    residual = np.log(0.01) - 2 * np.log(3 / slope)
    expected = -0.5 * (residual / 0.05) ** 2 - np.log(0.05 * np.sqrt(2 * np.pi))
    value = model.log_likelihood(np.array([1.3, 0.02, 0.05]))
    assert float(value) == pytest.approx(expected, rel=1e-12)  # algebra


def test_log_likelihood__does_not_mind_the_order_of_rows():
    rng = np.random.default_rng(12)
    frame = made_up(rng, rel_se=True)
    model = Model(observations(frame), Hybrid())
    theta = draws_of(model, rng)
    shuffled = Model(observations(frame.sample(frac=1, random_state=1)), Hybrid())
    # Algebra: another order of summation.
    np.testing.assert_allclose(
        shuffled.log_likelihood(theta), model.log_likelihood(theta), rtol=1e-12
    )


@pytest.mark.parametrize("form", FORMS)
def test_log_likelihood__doubles_when_every_row_is_repeated(form):
    rng = np.random.default_rng(13)
    frame = made_up(rng, rel_se=True)
    twice = pd.concat([frame, frame.assign(series=frame["series"] + " again")])
    one, two = (Model(observations(rows), form) for rows in (frame, twice))
    theta = draws_of(one, rng)
    # Algebra: another order of summation.
    np.testing.assert_allclose(two.log_likelihood(theta), 2 * one.log_likelihood(theta), rtol=1e-12)


def test_log_likelihood__costs_by_textures_not_rows():
    frame = made_up(np.random.default_rng(14))
    model = Model(observations(frame), Hybrid())
    assert len(model.likelihood.groups.n) == len(TEXTURES)
    assert model.likelihood.groups.n.sum() == len(frame)


@pytest.mark.parametrize("noise", Noise.every(), ids=lambda noise: noise.name)
def test_model__of_each_error_model_names_its_coordinates(noise):
    model = Model(observations(made_up(np.random.default_rng(27))), Hybrid(), noise)
    assert model.parameter_names == ("c1", "c2", *noise.parameter_names)
    sampled = noise.tail == "student" and noise.structure != "iid"
    assert model.is_latent == sampled
    n_level = model.offsets.n_level if sampled else 0
    assert model.n_coordinate == model.n_parameter + n_level
    assert model.is_iid_gaussian == (noise.name == "iid")
    u = 0.1 * np.random.default_rng(28).standard_normal((3, model.n_coordinate))
    assert np.isfinite(model.log_density(u)).all()
    assert model.pointwise_log_likelihood(u).shape == (3, len(model.data))


@pytest.mark.parametrize("noise", Noise.every(), ids=lambda noise: noise.name)
def test_log_density__of_each_error_model_does_not_mind_the_order_of_rows(noise):
    rng = np.random.default_rng(29)
    frame = made_up(rng, rel_se=True)
    shuffled = frame.sample(frac=1, random_state=1)
    # Whoever comes first names the textures' order: the first rows stay.
    first = frame.drop_duplicates(["a_over_R", "b_over_R"]).index
    order = [*first, *(i for i in shuffled.index if i not in first)]
    one, two = (Model(observations(rows), Hybrid(), noise) for rows in (frame, frame.loc[order]))
    u = 0.3 * rng.standard_normal((4, one.n_coordinate))
    # Rounding: another order of summation.
    np.testing.assert_allclose(two.log_density(u), one.log_density(u), rtol=1e-9)
    theta = one.to_theta(u)
    np.testing.assert_allclose(two.log_likelihood(theta), one.log_likelihood(theta), rtol=1e-9)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("rel_se", [False, True])
def test_gradient__is_the_central_difference(form, rel_se):
    rng = np.random.default_rng(15)
    model = Model(observations(made_up(rng, rel_se=rel_se)), form)
    for u in model.to_unconstrained(draws_of(model, rng, 4)):
        gradient = model.gradient(u)
        for i in range(len(u)):
            h = 1e-5
            step = h * np.eye(len(u))[i]
            difference = (model.log_density(u + step) - model.log_density(u - step)) / (2 * h)
            # Discretisation (1e-5)^2 times third derivatives of about 1e3 in such units.
            assert gradient[i] * h == pytest.approx(difference * h, rel=1e-5, abs=1e-10)


def test_log_density__adds_prior_and_jacobian_of_the_coordinates():
    rng = np.random.default_rng(16)
    model = Model(observations(made_up(rng)), Hybrid())
    theta = draws_of(model, rng)
    prior = (
        stats.lognorm(s=0.1, scale=1.382).logpdf(theta[:, 0])
        + stats.norm(0, 0.05).logpdf(theta[:, 1])
        + stats.halfnorm(scale=0.05).logpdf(theta[:, 2])
    )
    np.testing.assert_allclose(model.log_prior(theta), prior, rtol=1e-12)  # algebra
    u, h = model.to_unconstrained(theta), 1e-5
    jacobian = (model.to_theta(u + h) - model.to_theta(u - h)) / (2 * h)
    expected = prior + model.log_likelihood(theta) + np.log(jacobian).sum(axis=-1)
    np.testing.assert_allclose(model.log_density(u), expected, atol=1e-7)  # discretisation: h^2


def test_to_theta__and_to_unconstrained_invert_each_other():
    rng = np.random.default_rng(17)
    model = Model(observations(made_up(rng)), Hybrid())
    theta = draws_of(model, rng)
    back = model.to_theta(model.to_unconstrained(theta))
    np.testing.assert_allclose(back, theta, rtol=1e-11)  # algebra: quantiles, there and back


def test_log_likelihood__is_zero_probability_where_no_load_reaches_a_ridge():
    model = Model(observations(made_up(np.random.default_rng(18))), Hybrid())
    # K = c1/L + c2/A is negative for the texture with A = 0.012 alone.
    theta = np.array([[1.382, -0.5, 0.03], [1.382, 0.0, 0.03]])
    assert np.isneginf(model.log_likelihood(theta)).tolist() == [True, False]
    u = model.to_unconstrained(theta)
    assert np.isneginf(model.log_density(u)).tolist() == [True, False]
    rows = model.pointwise_log_likelihood(u)
    assert np.isneginf(rows).sum() == (model.data.texture == 0).sum()


@pytest.mark.parametrize("noise", Noise.every(), ids=lambda noise: noise.name)
def test_log_density__of_each_error_model_is_zero_probability_without_a_rate(noise):
    data = observations(made_up(np.random.default_rng(18)))
    model = Model(data, Hybrid(), noise)
    u = np.zeros((2, model.n_coordinate))
    u[:, :2] = model.to_unconstrained(
        np.append([1.382, -0.5], model.to_theta(np.zeros(model.n_parameter))[2:])
    )[:2]
    u[1, 1] = 0.0  # of the first K is negative for the texture with A = 0.012
    assert np.isneginf(model.log_density(u)).tolist() == [True, False]
    assert np.isneginf(model.marginal_log_density(u)).tolist() == [True, False]
    rows = model.pointwise_log_likelihood(u)
    assert np.isneginf(rows[0, data.texture == 0]).all()
    assert not np.isnan(rows).any()
    assert np.isfinite(rows[1]).all()


@pytest.mark.parametrize("undefined", [np.nan, np.inf])
def test_log_likelihood__refuses_a_form_that_has_no_rate_at_ordinary_coefficients(undefined):
    class Broken(Modified):
        def rate(self, theta, a_over_R, b_over_R):
            rate = super().rate(theta, a_over_R, b_over_R)
            return np.where((rate > 1.5) & (np.asarray(a_over_R) > 0.03), undefined, rate)

    model = Model(observations(made_up(np.random.default_rng(29))), Broken())
    theta = np.array([[1.4, 0.03], [1.6, 0.03], [1.7, 0.03]])
    rule = rf"rate of texture a/R = 0.032, b/R = 0.01 at c = 1.6: expected .*, got {undefined}"
    with pytest.raises(ComputationError, match=rule):
        model.log_likelihood(theta)
    with pytest.raises(ComputationError, match=rule):
        model.log_likelihood(theta[1])
    assert np.isfinite(model.log_likelihood(theta[0]))
    # At coefficients so large that a rate may overflow it is no fault of the form.
    assert np.isneginf(model.log_likelihood(np.array([1e120, 0.03])))


@pytest.mark.parametrize("form", FORMS)
def test_information__is_the_sum_of_squared_slopes_of_log_loads(form):
    rng = np.random.default_rng(26)
    frame = made_up(rng, rel_se=True)
    model = Model(observations(frame), form)
    k, h = model.n_coefficient, 1e-5
    u = model.to_unconstrained(draws_of(model, rng, 1)[0])

    def log_loads(u):
        theta = model.to_theta(u)[:k]
        rows = frame[["Q", "a_over_R", "b_over_R"]].itertuples(index=False)
        return np.array([np.log(model.form.load(*row, theta)) for row in rows])

    steps = h * np.eye(len(u))[:k]
    slopes = np.array([(log_loads(u + step) - log_loads(u - step)) / (2 * h) for step in steps])
    # Discretisation: h^2; rounding: eps over h.
    np.testing.assert_allclose(model.information(u), slopes @ slopes.T, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("noise", ["iid", "texture+step", "iid:student"])
def test_error_variance__is_sigmas_and_the_mean_of_the_known_ones(noise):
    frame = made_up(np.random.default_rng(27), rel_se=True)
    model = Model(observations(frame), Hybrid(), Noise.named(noise))
    u = np.random.default_rng(28).standard_normal((5, model.n_parameter - 2))
    sigma = stats.halfnorm(scale=0.05).ppf(stats.norm.cdf(u[:, 0]))
    expected = sigma**2 + np.mean(frame["rel_se"] ** 2)
    np.testing.assert_allclose(model.error_variance(u), expected, rtol=1e-12)  # quantiles


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("far", [-1e200, -1e4, -800.0, -40.0, 40.0, 800.0, 1e4, 1e200])
def test_log_density__is_very_low_and_not_nan_far_out(place, far):
    model = Model(observations(made_up(np.random.default_rng(19))), Hybrid())
    assert model.log_density(far * np.eye(3)[place]) < -500


def test_log_density__is_finite_at_the_priors_centre():
    data = observations(made_up(np.random.default_rng(20)))
    for form in FORMS:
        model = Model(data, form)
        assert np.isfinite(model.log_density(np.zeros(model.n_parameter)))


def test_model__names_parameters_and_counts_coefficients():
    data = observations(made_up(np.random.default_rng(21)))
    model = Model(data, PowerLaw())
    assert model.parameter_names[0] == "K[a0.012_b0.03]"
    assert model.parameter_names[-1] == "sigma"
    assert (model.n_parameter, model.n_coefficient) == (4, 3)


def test_model__refuses_a_prior_that_does_not_belong():
    data = observations(made_up(np.random.default_rng(24)))
    rule = r"prior of '{}': expected one of c, sigma, with the support of its default, got "
    with pytest.raises(InputError, match=rule.format("c1")):
        Model(data, Modified(), priors={"c1": LogNormal(1.0, 0.1)})
    with pytest.raises(InputError, match=rule.format("c")):
        Model(data, Modified(), priors={"c": Normal(1.0, 0.1)})


def test_with_priors__replaces_some_and_keeps_the_rest():
    data = observations(made_up(np.random.default_rng(25)))
    model = Model(data, Hybrid(), priors={"c2": Normal(0.0, 0.5)})
    other = model.with_priors({"sigma": HalfNormal(1.0)})
    assert list(other.priors) == ["c1", "c2", "sigma"]
    assert other.priors["c2"] == Normal(0.0, 0.5)
    assert other.priors["sigma"] == HalfNormal(1.0)
    assert model.priors["sigma"] == HalfNormal(0.05)


def test_model__refuses_a_row_that_the_form_reaches_without_load():
    data = Observations(
        ((0.02, 0.03),),
        np.zeros(1, int),
        np.array([2]),
        np.array([-5.0]),
        np.zeros(1),
        np.array([np.nan]),
        np.zeros(1, bool),
    )
    rule = "modified: expected Q >= 4, got a row whose load is zero by this form"
    with pytest.raises(InputError, match=rule):
        Model(data, Modified())


def test_log_likelihood__of_a_few_draws_at_a_time_is_that_of_all(paper, monkeypatch):
    model = Model(Observations.from_table(paper), Hybrid(), Noise.named("iid"))
    theta = np.column_stack([np.linspace(1.2, 1.5, 11), np.full(11, 0.02), np.full(11, 0.05)])
    whole = model.log_likelihood(theta)
    monkeypatch.setattr("ridgebayes.model.model._CACHED", 3 * len(paper.calibration.textures))
    assert model.log_likelihood(theta).tolist() == whole.tolist()
    assert model.log_likelihood(theta[:0]).shape == (0,)
    # One at a time where textures are more than fit.
    monkeypatch.setattr("ridgebayes.model.model._CACHED", 1)
    # Rounding: a product of a vector, not of a matrix, sums in another order.
    np.testing.assert_allclose(model.log_likelihood(theta), whole, rtol=1e-14)


def test_log_likelihood__of_rows_one_by_one_holds_a_few_draws_at_a_time(observed):
    n_draw, n_row = 16_384, 200
    rows = np.arange(n_row)
    data = observed(rows % 4, 4 + 2 * (rows // 4), np.full(n_row, -5.0), is_count=True)
    model = Model(data, Modified(), Noise())
    theta = np.tile([1.38, 0.03], (n_draw, 1))
    tracemalloc.start()
    try:
        model.log_likelihood(theta)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 8 * n_draw * n_row  # a single array of draws times rows


@pytest.mark.parametrize("noise", ["texture", "step", "iid:student"])
def test_model__of_very_many_coefficients_is_for_independent_normal_errors(observed, noise):
    texture = np.repeat(np.arange(101), 2)
    widths = tuple((0.01 + 1e-4 * j, 0.02) for j in range(101))
    data = observed(texture, np.tile([4, 6], 101), -8.0, textures=widths)
    assert Model(data, PowerLaw()).n_coefficient == 101
    assert Model(data, Modified(), Noise.named(noise)).n_coefficient == 1
    rule = f"power-law under {noise}: 101 coefficients; expected at most 100"
    with pytest.raises(ComputationError, match=rule):
        Model(data, PowerLaw(), Noise.named(noise))


def test_model__of_very_many_rows_has_no_offsets_to_be_drawn(observed):
    data = observed(np.arange(2_001) % 4, 4, -8.0)
    assert Model(data, Modified(), Noise("texture")).n_coordinate == 3
    assert Model(data, Modified(), Noise("iid", "student")).n_coordinate == 3
    student = Noise("texture", "student")
    assert Model(data.take(data.texture < 3), Modified(), student).is_latent
    with pytest.raises(ComputationError, match="texture:student: 2001 rows; expected at most 2000"):
        Model(data, Modified(), student)
