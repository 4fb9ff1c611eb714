"""Edge cases of prediction: far from the data, and very many points."""

import functools
import math

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from scipy.special import ndtr

import ridgebayes as rb
from ridgebayes.inference.chains import Chains
from ridgebayes.inference.posterior import completed
from ridgebayes.model.default_priors import default_priors
from ridgebayes.model.forms import Form
from ridgebayes.predict.load_distribution import mix_loads
from ridgebayes.predict.q_distribution import mix_q
from tests.drawn import drawn_posterior, model_of
from tests.hard_cases.case import hard_case, refused


@functools.cache
def fitted(name: str, noise: str = "iid") -> rb.Fit:
    forms = {form.name: form for form in (rb.Classic(), rb.Modified(), rb.Hybrid(), rb.PowerLaw())}
    return rb.calibrate(rb.paper_sweep(), forms[name], noise=noise, rng=1)


def single_draw(form: Form, noise: str, theta: list[float]) -> rb.Fit:
    """A fit to the paper's sweep whose posterior is a single point, without sampling."""
    model = model_of(rb.paper_sweep(), form, noise)
    outer = model.to_scores(np.array([theta]))[:, model.outer]
    # With a draw of the offsets, where rows share some.
    u = completed(model, outer, np.empty((1, 0)), np.random.default_rng(1)).reshape(1, 1, 1, -1)
    chains = Chains(u, np.zeros(u.shape[:-1]), np.ones(1), np.ones(u.shape[-1] + 1), ())
    return rb.Fit(model, chains, pd.DataFrame(), (), 1)


def sum_of_normals(log_load, sd, p):
    """P(load <= p), averaged over draws one by one, from their log loads (n_draw,)."""
    return float(np.mean(ndtr((math.log(p) - log_load) / sd)))


@hard_case(
    "Loads of zero, 5e-324 and 1e-300",
    why="The logarithm of the load is -inf. In an average, inf times 0 is NaN.",
    expected="Q = 2 with probability 1 (exact), for every form and both kinds. No predicted load "
    "is 0 or below.",
)
def load_of_zero():
    for name in ("classic", "modified", "hybrid", "power-law"):
        for kind in ("simulation", "curve"):
            q = fitted(name).predict(0.022, 0.02, [0.0, 5e-324, 1e-300, 0.009], kind=kind)
            assert q.pmf[:3, 0].tolist() == [1.0, 1.0, 1.0]
            assert q.mean()[:3].tolist() == [2.0, 2.0, 2.0]
            assert q.at_least(4)[3] > 0.5
        load = fitted(name).predict_load(0.022, 0.02, 4)
        assert [float(load.cdf(p)) for p in (-1.0, 0.0, 1e-300)] == [0.0, 0.0, 0.0]
    refused(lambda: load.cdf(math.nan), rb.InputError, "p_over_E: expected numbers, got nan")
    return "Q = 2 with probability 1, for 4 forms"


@hard_case(
    "Loads so large that counts exceed 20,000 and 2^52",
    why="A list of probabilities up to that count fills the memory. Floats can no longer tell "
    "counts apart.",
    expected="Refused, with the limit. Loads of counts up to 2^53 are computed: that of 10^15 "
    "edges is within 5 standard errors of its closed form. Beyond: refused.",
)
def loads_beyond_counts():
    fit = fitted("modified")
    # All counts up to the limit are tried, so that a single draw has to do.
    single = single_draw(rb.Modified(), "iid", [1.38, 0.03])
    words = refused(lambda: single.predict(0.022, 0.02, 1e30), rb.InputError, "counts up to 20000")
    refused(lambda: fit.predict(0.022, 0.02, 1.7e308), rb.InputError, "p_over_E: ", "1.7e+308")
    refused(lambda: fit.predict(0.022, 0.02, math.inf), rb.InputError, "p_over_E: ", "got inf")
    for bad in (2**53 + 2.0, 1e300, math.inf, math.nan, 5, 2):
        refused(lambda q=bad: fit.predict_load(0.022, 0.02, q), rb.InputError, "Q:", "at least 4")
    median = float(fit.predict_load(0.022, 0.02, 10**15).median())
    c = fit.summary["mean"].iloc[0]
    expected = ((10**15 / 2 - 1) * 0.042 / c) ** 2
    se = fit.summary["sd"].iloc[0] / c * 2
    assert abs(math.log(median / expected)) < 5 * se
    return f"10^15 edges at p/E of {median:.2e}; {words}"


@hard_case(
    "Some posterior draws have no positive rate at a new texture",
    why="A negative rate is squared and gives a load that looks right. An infinite load makes "
    "averages and quantiles NaN.",
    expected="P(Q >= 4) is the average over single draws, with 0 for draws without a positive "
    "rate (rounding). Quantiles above the share that reaches Q are infinite. Quantiles below it "
    "solve the distribution to 1e-8.",
)
def rates_below_zero():
    a, b = 1e-5, 0.05
    rng = np.random.default_rng(3)
    everything = np.array([(a, b) for a in (0.012, 0.022, 0.032) for b in (0.01, 0.02, 0.03)])
    A, B, Q = (x.ravel() for x in np.broadcast_arrays(*everything.T[:, :, None], [[4, 6, 8]]))
    p = rb.Hybrid().load(Q, A, B, [1.38, -0.006]) * np.exp(0.02 * rng.standard_normal(len(Q)))
    table = rb.read_table(pd.DataFrame({"a_over_R": A, "b_over_R": B, "Q": Q, "p_over_E": p}))
    fit = rb.calibrate(
        table, rb.Hybrid(), priors={"hybrid": {"c2": rb.Normal(0.0, 0.05)}}, rng=1, noise="iid"
    )
    c1, c2, sigma = fit.draws.T
    rate = c1 / (a + b) + c2 / a
    lost = float(np.mean(rate <= 0))
    assert 0.02 < lost < 0.98
    log_load = np.where(rate > 0, -2 * np.log(np.where(rate > 0, rate, 1.0)), np.inf)
    q = fit.predict(a, b, [1e-7, 1e-5, 1e-3])
    expected = [sum_of_normals(log_load, sigma, p) for p in (1e-7, 1e-5, 1e-3)]
    np.testing.assert_allclose(q.at_least(4), expected, rtol=1e-10, atol=1e-18)
    shares = fit.predict(a, b, [1e-7, 1e-5, 1e-3], kind="curve").at_least(4)
    assert shares.tolist() == [float(np.mean(log_load <= math.log(p))) for p in (1e-7, 1e-5, 1e-3)]
    load = fit.predict_load(a, b, 4)
    never = 1 - float(load.cdf(1e300))
    assert never == pytest.approx(lost, abs=0.03)  # every fourth draw
    assert load.quantile(1 - never / 2) == math.inf
    for prob in (0.01, 0.5 * (1 - never), 0.99 * (1 - never)):
        assert float(load.cdf(load.quantile(prob))) == pytest.approx(prob, rel=1e-7)
    assert bool(load.extrapolation)
    return f"{lost:.0%} of the draws never reach a further ridge; P(Q >= 4) tends to {1 - lost:.2f}"


@hard_case(
    "The power law at a texture without a K",
    why="The K of the nearest texture, or the mean of all, would look like an answer.",
    expected="The form refuses. A fit predicts from the prior of K and flags it: median and 90 % "
    "interval of the load are within 4 Monte Carlo standard errors of the prior's closed form.",
)
def power_law_without_a_k():
    fit, texture = fitted("power-law"), (0.02, 0.017)
    words = refused(
        lambda: fit.form.load(4, *texture, fit.draws[0, :9]), rb.InputError, "got one without a K"
    )
    load = fit.predict_load(*texture, 8, kind="curve")
    assert bool(load.extrapolation)
    assert bool(fit.predict(*texture, 0.005).extrapolation())
    form = rb.PowerLaw().bind((texture,))
    prior = default_priors(form)[form.parameter_names[0]]
    n = len(load.weight)
    for prob in (0.05, 0.5, 0.95):
        expected = 2 * math.log(6) - 2 * (
            math.log(prior.median) + prior.log_sd * stats.norm.ppf(1 - prob)
        )
        density = stats.norm.pdf(stats.norm.ppf(prob)) / (2 * prior.log_sd)
        se = math.sqrt(prob * (1 - prob) / n) / density
        assert abs(math.log(load.quantile(prob)) - expected) < 4 * se
    return f"from the prior, flagged; the form {words}"


@hard_case(
    "One posterior draw, at its own loads and one ulp below",
    why="Predictions from loads and from counts round differently. With a single draw no average "
    "hides it.",
    expected="Kind curve: P(Q >= n) is 1 at the load of n and 0 one ulp below (exact). Kind "
    "simulation: 1/2 at the load, and the normal's quantiles of ln p (1e-9).",
)
def one_draw():
    fit = single_draw(rb.Hybrid(), "iid", [1.337, 0.018, 0.03])
    theta = fit.draws[0]
    Q = np.arange(4, 40, 2)
    loads = fit.form.load(Q, 0.022, 0.02, theta[:2])
    for p, wanted in ((loads, 1.0), (np.nextafter(loads, 0), 0.0)):
        q = fit.predict(0.022, 0.02, p, kind="curve")
        found = [float(q.at_least(n)[i]) for i, n in enumerate(Q)]
        assert found == [wanted] * len(Q)
        assert q.median().tolist() == fit.form.count(p, 0.022, 0.02, theta[:2]).tolist()
    q = fit.predict(0.022, 0.02, loads)
    half = [float(q.at_least(n)[i]) for i, n in enumerate(Q)]
    np.testing.assert_allclose(half, 0.5, atol=1e-12)
    load = fit.predict_load(0.022, 0.02, Q)
    for prob in (1e-9, 0.05, 0.5, 0.95, 1 - 1e-9):
        expected = loads * math.exp(theta[2] * stats.norm.ppf(prob))
        np.testing.assert_allclose(load.quantile(prob), expected, rtol=1e-8)
    curve = fit.predict_load(0.022, 0.02, Q, kind="curve")
    np.testing.assert_allclose(curve.quantile(0.3), loads, rtol=1e-14)
    return f"{len(Q)} loads exact; quantiles from 1e-9 to 1 - 1e-9 equal a log-normal's"


@hard_case(
    "A posterior so narrow that its loads differ in the ninth digit",
    why="A quantile search with steps or a bracket of fixed size is coarser than the distribution.",
    expected="The interval of the load is within 1e-9 of the closed form of one draw with an "
    "error of 1e-9. P(Q) rises from 0 to 1 within 1e-7 of the load.",
)
def a_posterior_too_narrow():
    fit = single_draw(rb.Modified(), "iid", [1.38, 1e-9])
    load = fit.predict_load(0.022, 0.02, 8)
    at = float(fit.form.load(8, 0.022, 0.02, fit.draws[0, :1]))
    lower, upper = load.interval(0.9)
    assert lower / at - 1 == pytest.approx(-1.645e-9, abs=2e-10)
    assert upper / at - 1 == pytest.approx(1.645e-9, abs=2e-10)
    q = fit.predict(0.022, 0.02, at * np.array([1 - 1e-7, 1.0, 1 + 1e-7]))
    np.testing.assert_allclose(q.at_least(8), [0, 0.5, 1], atol=1e-6)
    return f"interval from {lower / at - 1:+.1e} to {upper / at - 1:+.1e} of the load"


@hard_case(
    "Probabilities for the skewed posterior of a few rows",
    why="A few draws carry most of the weight of a heavy tail, and a quoted error that is too "
    "small misleads.",
    expected="The difference is within the quoted error of 0.005 plus four Monte Carlo standard "
    "errors of 65,536 importance draws.",
)
def skewed_posterior():
    frame = rb.paper_sweep().frame
    few = rb.read_table(frame[(frame["a_over_R"] == 0.022) & (frame["b_over_R"] == 0.02)].head(3))
    fit = rb.calibrate(few, rb.Hybrid(), rng=1, noise="iid")
    skew = float(stats.skew(fit.draws[:, 2]))
    loads = np.geomspace(5e-4, 0.02, 20)
    q = fit.predict(0.032, 0.01, loads)
    reference = drawn_posterior(model_of(few, rb.Hybrid()), seed=5, n_draw=4_096)
    theta = reference.model.to_theta(reference.chains.u.reshape(-1, 3))
    worst = 0.0
    for n in (4, 6, 8):
        log_load = np.log(rb.Hybrid().load(n, 0.032, 0.01, theta[:, :2]))
        each = ndtr((np.log(loads)[:, None] - log_load) / theta[:, 2])
        expected, se = each.mean(axis=1), each.std(axis=1) / math.sqrt(len(theta))
        assert np.all(np.abs(q.at_least(n) - expected) <= 0.005 + 4 * se)
        worst = max(worst, np.abs(q.at_least(n) - expected).max())
    assert skew > 1
    return f"skewness of sigma {skew:.0f}: errors within the quoted standard errors"


@hard_case(
    "An error model with shared offsets, far outside the range",
    why="A new texture must not get the offsets inferred for calibrated ones. Nor may its own "
    "offset be left out.",
    expected="Texture offsets: P(Q >= n) with variance sigma^2 + tau^2, draw by draw (1e-10). "
    "step-smooth: far out an sd of sqrt(sigma^2 + 2 tau^2), as derived (1e-6), and a tenth of "
    "that at a calibrated texture.",
)
def offsets_far_outside():
    fit = fitted("modified", "texture")
    load = fit.predict_load(0.012, 0.2, 6)
    stride = len(fit.draws) // len(load.weight)
    c, sigma, tau = fit.draws[::stride].T
    log_load = 2 * np.log(2 * 0.212 / c)
    for p in (0.05, 0.095, 0.2):
        expected = sum_of_normals(log_load, np.hypot(sigma, tau), p)
        assert float(load.cdf(p)) == pytest.approx(expected, rel=1e-10)
    tau = 0.03
    smooth = single_draw(rb.Modified(), "step-smooth", [1.38, 0.003, tau, 1.0, 0.03])
    known = float(smooth.predict_load(0.022, 0.02, 6).sd[0])
    new = float(smooth.predict_load(1e-3, 1.0, 6).sd[0])
    assert known < 0.15 * tau
    assert new == pytest.approx(math.sqrt(0.003**2 + 2 * tau**2), rel=1e-6)
    assert smooth.predict_load(1e-3, 1.0, 6).extrapolation
    return f"step-smooth: sd of ln p {known:.4f} at a calibrated texture, {new:.4f} far out"


@hard_case(
    "Intervals of 0, 1, -0.1, 1.1 and NaN, and quantiles at 1e-300 and 1 - 1e-16",
    why="An interval of -0.1 came out with crossed ends. A quantile at 1e-300 came out as that at "
    "1e-19, the width of a bracket. One at 1 - 1e-16 was infinite.",
    expected="0 gives the median twice, 1 all of Q. Others are refused with their value; so are "
    "quantiles of loads at 1 or closer to 1 than 1e-12. The quantile at 1e-300 solves the sum of "
    "normals.",
)
def intervals_at_their_ends():
    fit = fitted("hybrid")
    q, load = fit.predict(0.022, 0.02, [0.002, 0.009]), fit.predict_load(0.022, 0.02, 8)
    assert [end.tolist() for end in q.interval(0)] == [q.median().tolist()] * 2
    assert [float(end) for end in load.interval(0)] == [float(load.median())] * 2
    assert q.interval(1)[0].tolist() == [2, 2]
    assert np.all(q.at_least(int(q.interval(1)[1].max()) + 2) < 1e-6)
    for bad in (-0.1, 1.1, math.nan, math.inf):
        for ask in (q.interval, q.quantile, q.extrapolation, load.interval, load.quantile):
            refused(lambda f=ask, x=bad: f(x), rb.InputError, "prob: ", f"got {bad}")
    for bad in (0, 1, 1 - 1e-16, 1 - 1e-13):
        refused(lambda x=bad: load.quantile(x), rb.InputError, "prob: ", f"got {bad}")
    refused(lambda: load.interval(1), rb.InputError, "prob: ", "got 1")
    refused(lambda: q.at_least(math.nan), rb.InputError, "n: ", "got nan")
    assert q.at_least(4.5).tolist() == q.at_least(6).tolist()
    assert q.at_least(math.inf).tolist() == [0.0, 0.0]
    stride = len(fit.draws) // len(load.weight)
    c1, c2, sigma = fit.draws[::stride].T
    log_load = 2 * np.log(3 / (c1 / 0.042 + c2 / 0.022))
    x = math.log(load.quantile(1e-300))
    found = stats.norm.logcdf((x - log_load) / sigma)
    log_mean = found.max() + math.log(np.exp(found - found.max()).mean())
    assert log_mean == pytest.approx(-300 * math.log(10), abs=1e-4)
    return f"refused as expected; log10 P at the quantile of 1e-300: {log_mean / math.log(10):.4f}"


@hard_case(
    "No loads at all, and invalid weights",
    why="A table without rows and an average without weight divide zero by zero.",
    expected="An empty distribution of the requested shape. Weights that are zero, negative or "
    "NaN are refused.",
)
def nothing_asked():
    fit = fitted("hybrid")
    q, load = fit.predict(0.022, 0.02, []), fit.predict_load(0.022, 0.02, np.zeros((3, 0)) + 4)
    assert q.median().shape == q.mean().shape == (0,)
    assert load.median().shape == (3, 0)
    one, two = fit.predict(0.022, 0.02, 0.009), fit.predict_load(0.022, 0.02, 4)
    for bad in ([0, 0], [1, -1], [1, math.nan], [1, math.inf]):
        refused(lambda w=bad: mix_q([one, one], w), rb.InputError, "weights:")
        refused(lambda w=bad: mix_loads([two, two], w), rb.InputError, "weights:")
    return "empty as expected; 4 pairs of weights refused"
