"""A form, an error model and priors as one density of normal scores."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes import Classic, HalfPlane, Hybrid, InputError, Modified, Noise, PowerLaw
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.model.model import MAX_COEFFICIENTS, Model
from ridgebayes.model.observations import Observations
from tests.drawn import importance_draws, model_of

TEXTURES = np.array([(0.012, 0.03), (0.032, 0.01), (0.022, 0.02)])
FORMS = [Classic(), Modified(), Hybrid(), PowerLaw(), HalfPlane()]


def made_up(seed, *, rel_se=False, nu=False):
    """Noisy rows of three textures, two curves each; nothing about them is regular."""
    rng, rows = np.random.default_rng(seed), []
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
    return Observations.from_table(rb.ContactTable.from_frame(frame))


def log_density(model, u):
    return LatentIntegral(model).estimated(u, np.random.default_rng(0), 64).log_density


@pytest.mark.parametrize("form", [Classic(), Modified(), Hybrid(), HalfPlane()])
@pytest.mark.parametrize("columns", [{}, {"rel_se": True}, {"nu": True, "rel_se": True}])
def test_density__of_grouped_rows_is_the_row_by_row_sum(form, columns):
    """By the slow oracle: one normal density of log load a row, each at its Poisson's ratio."""
    frame = made_up(11, **columns)
    model = Model(observations(frame), form)
    u = 0.5 * np.random.default_rng(1).standard_normal((4, model.n_parameter))
    expected = stats.norm.logpdf(u).sum(axis=-1)
    for i, theta in enumerate(model.to_theta(u)):
        for row in frame.itertuples():
            load = form.load(row.Q, row.a_over_R, row.b_over_R, theta[:-1], row.nu)
            sd = np.hypot(theta[-1], row.rel_se)
            expected[i] += stats.norm.logpdf(np.log(row.p_over_E), np.log(load), sd)
    # Algebra: residuals of 1e-2 beside values of 10, squared and summed over 20 rows.
    np.testing.assert_allclose(log_density(model, u), expected, rtol=1e-11)


@pytest.mark.parametrize("noise", Noise.candidates(2), ids=lambda noise: noise.name)
def test_density__does_not_mind_the_order_of_rows_and_textures(noise):
    frame = made_up(29, rel_se=True)
    shuffled = frame.sample(frac=1, random_state=1)
    one, two = (Model(observations(rows), Hybrid(), noise) for rows in (frame, shuffled))
    assert one.data.textures != two.data.textures
    u = 0.3 * np.random.default_rng(2).standard_normal((4, one.n_parameter))
    assert one.parameter_names == ("c1", "c2", *noise.parameter_names)
    found = [log_density(model, u) for model in (one, two)]
    exact = noise.tail == "normal" or noise.structure == "iid"
    # Rounding: another order of summation; or Monte Carlo of 64 points.
    np.testing.assert_allclose(*found, rtol=1e-9 if exact else 0.05)


def test_priors__are_those_of_scipy():
    model = Model(observations(made_up(16)), Hybrid())
    u = np.random.default_rng(4).standard_normal((5, 3))
    theta = model.to_theta(u)
    expected = (
        stats.lognorm(s=0.1, scale=1.382).logpdf(theta[:, 0])
        + stats.norm(0, 0.05).logpdf(theta[:, 1])
        + stats.halfnorm(scale=0.05).logpdf(theta[:, 2])
    )
    np.testing.assert_allclose(model.log_prior(theta), expected, rtol=1e-12)  # algebra
    normal = stats.norm.logpdf(u).sum(axis=-1)
    np.testing.assert_allclose(model.log_outer_prior(u), normal, rtol=1e-12)


@pytest.mark.parametrize("noise", Noise.every(), ids=lambda noise: noise.name)
def test_density__is_zero_where_no_load_reaches_a_ridge_and_finite_at_the_priors_centre(noise):
    model = Model(observations(made_up(18)), Hybrid(), noise)
    u = np.zeros((2, model.n_parameter))
    # K = c1/L + c2/A is negative for the texture with A = 0.012 alone.
    u[0, 1] = -10.0
    assert np.isneginf(log_density(model, u)).tolist() == [True, False]


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("far", [-1e200, -800.0, -40.0, 40.0, 800.0, 1e200])
def test_density__is_very_low_and_not_nan_far_out(place, far):
    model = Model(observations(made_up(19)), Hybrid())
    assert log_density(model, far * np.eye(3)[[place]])[0] < -500


@pytest.mark.parametrize("undefined", [np.nan, np.inf])
def test_log_rates__refuse_a_form_that_has_none_at_ordinary_coefficients(undefined):
    class Broken(Modified):
        def rate(self, theta, a_over_R, b_over_R):
            rate = super().rate(theta, a_over_R, b_over_R)
            return np.where((rate > 1.5) & (np.asarray(a_over_R) > 0.03), undefined, rate)

    model = Model(observations(made_up(29)), Broken())
    theta = np.array([[1.4, 0.03], [1.6, 0.03], [1.7, 0.03]])
    rule = rf"rate of texture a/R = 0.032, b/R = 0.01 at c = 1.6: expected .*, got {undefined}"
    for asked in (theta, theta[1]):
        with pytest.raises(rb.ComputationError, match=rule):
            model.log_rates(asked)
    assert np.isfinite(model.log_rates(theta[0])).all()
    # At coefficients so large that a rate may overflow it is no fault of the form.
    assert not np.isfinite(model.log_rates(np.array([1e120, 0.03]))).all()


WRONG_METHODS = [
    ("rate", lambda _, theta, a, b: a, r"rate: expected shape \(1, 9\), got \(9,\)"),
    ("pairs", lambda _, shape, a, b: shape, r"pairs: expected the inverse of shape, 1 at Q = 4, g"),
    ("pairs", lambda *_: 1.0, r"pairs: expected shape \(41,\), got \(\)"),
    ("log_rate_gradient", lambda *_: np.ones(9), r"rate_gradient: expected shape \(9, 1\), got \("),
    ("parameter_names", ("c", "c"), "expected names that differ from each other and .*, got c, c"),
    ("parameter_names", ("df",), "expected names that differ .*, length_ratio, df, got df"),
]


@pytest.mark.parametrize(("method", "wrong", "said"), WRONG_METHODS)
def test_form__of_ones_own_is_refused_by_the_method_that_is_wrong(paper, method, wrong, said):
    own = type("Own", (Modified,), {"name": "own", method: wrong})
    with pytest.raises(InputError, match=f"own: .*{said}"):
        rb.calibrate(paper, own(), noise="iid", rng=1)


def test_model__refuses_a_prior_that_does_not_belong():
    own = r"prior of '{}': expected one of c, sigma, with the support of its default, got "
    log_normal = r"prior of 'K\[a0.012_b0.03\]': expected log-normal, since log K is integrated"
    for form, name, prior, rule in (
        (Modified(), "c1", rb.LogNormal(1.0, 0.1), own),
        (Modified(), "c", rb.Normal(1.0, 0.1), own),
        (PowerLaw(), "K", rb.Uniform(10.0, 200.0), log_normal),
    ):
        with pytest.raises(InputError, match=rule.format(name)):
            Model(observations(made_up(24)), form, priors={name: prior})


def test_model__refuses_what_it_cannot_serve(observed):
    rows = np.arange(2_001)
    data = observed(rows % 4, 4, -8.0)
    for noise in (Noise("texture"), Noise("iid", "student")):
        Model(data, Modified(), noise)
    with pytest.raises(rb.ComputationError, match=r"texture:student: 2001 rows; .* at most 2000"):
        Model(data, Modified(), Noise("texture", "student"))

    class Wide(Modified):
        parameter_names = tuple(f"c{i}" for i in range(MAX_COEFFICIENTS + 1))

    priors = dict.fromkeys(Wide.parameter_names, rb.LogNormal(1.0, 0.1))
    with pytest.raises(rb.ComputationError, match="modified: 21 coefficients; expected at most 20"):
        Model(data, Wide(), priors=priors)


# --- loads known between two steps, and counts seen at loads --------------------------------------

TRUTH = np.array([1.348, 0.01583, 0.03])


def moments(table):
    model = model_of(table, Hybrid())
    drawn = importance_draws(model, n_draw=1_024)
    assert drawn.evidence.ok
    theta = model.outer_theta(drawn.u.reshape(-1, 3))
    return theta.mean(axis=0), theta.std(axis=0)


@pytest.mark.slow
def test_brackets__have_no_bias_and_tend_to_the_exact_loads(paper):
    exact, sd = moments(paper)

    def stepped(increment, phase, *, bracket=True):
        """The sweep as a solver sees it that raises the load by `increment` at each step."""
        frame, step = paper.calibration.frame, np.log1p(increment)
        k = np.ceil(np.log(frame["p_over_E"]) / step - phase)
        lower = np.exp((k - 1 + phase) * step) if bracket else np.nan
        upper = np.exp((k + phase) * step)
        return moments(rb.read_table(frame.assign(p_over_E=upper, p_over_E_lower=lower)))[0]

    # Monte Carlo: 12,000 draws leave 0.01 of an sd.
    assert np.abs((stepped(1e-3, 0.3) - exact) / sd).max() < 0.06
    apart = np.mean([stepped(0.05, phase) - exact for phase in np.arange(8) / 8], axis=0) / sd
    assert np.abs(apart[:2]).max() < 0.15
    late = np.mean([stepped(0.05, phase, bracket=False) for phase in (0.0, 0.5)], axis=0)
    # Upper ends as loads are half a step too high, and c1 goes as one over the load's root.
    assert np.log(late[0] / exact[0]) == pytest.approx(-np.log(1.05) / 4, rel=0.3)


@pytest.mark.slow
def test_counts__alone_recover_the_coefficients(paper):
    rng, loads, apart = np.random.default_rng(0), np.geomspace(5e-4, 0.02, 24), []
    for _ in range(4):
        tables = []
        for a, b in paper.calibration.textures:
            noisy = loads * np.exp(-TRUTH[2] * rng.standard_normal(24))
            Q = Hybrid().count(noisy, a, b, theta=TRUTH[:2])
            tables.append(pd.DataFrame({"a_over_R": a, "b_over_R": b, "Q": Q, "p_over_E": loads}))
        table = rb.read_table(pd.concat(tables, ignore_index=True).assign(kind="count"))
        mean, sd = moments(table)
        apart.append((mean - TRUTH) / sd)
    # Monte Carlo: twelve standardised errors, rms 1 with a spread of 0.25 (c1 and c2 go together).
    assert 0.4 < np.sqrt(np.square(apart).mean()) < 1.6
