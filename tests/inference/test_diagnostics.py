from pathlib import Path

import emcee
import numpy as np
import pandas as pd
import pytest
from scipy import optimize, signal, stats

from ridgebayes import PowerLaw, read_table
from ridgebayes.inference.diagnostics import (
    autocorrelation_time,
    effective_sample_size,
    failed_diagnostics,
    leave_one_out,
    rank_r_hat,
    stacking_weights,
    summarise,
)
from ridgebayes.inference.importance import Effort
from ridgebayes.inference.left_out import AllRows
from tests.drawn import drawn_posterior, importance_draws, model_of


def noise(shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def r_hat_by_hand(chains):
    """Vehtari et al. (2021): split, rank-normalise, and the larger of bulk and folded."""
    half = chains.shape[1] // 2
    split = np.concatenate([chains[:, :half], chains[:, -half:]])

    def plain(x):
        z = stats.norm.ppf((stats.rankdata(x).reshape(x.shape) - 0.375) / (x.size + 0.25))
        within = z.var(axis=1, ddof=1).mean()
        between = half * z.mean(axis=1).var(ddof=1)
        return np.sqrt(((half - 1) / half * within + between / half) / within)

    return max(plain(split), plain(np.abs(split - np.median(split))))


@pytest.mark.parametrize("shift", [0.0, 0.3, 3.0])
def test_rank_r_hat__is_the_published_formula_with_an_ensemble_as_a_chain(shift):
    draws = noise((4, 50, 6, 2))
    draws[0, ..., 1] = 2 * draws[0, ..., 1] + shift
    expected = [r_hat_by_hand(draws[..., i].reshape(4, 300)) for i in (0, 1)]
    np.testing.assert_allclose(rank_r_hat(draws), expected, rtol=1e-9)  # algebra


def test_summarise__gives_unrounded_numbers_of_all_draws():
    draws = 1 / 3 + 1e-7 * noise((4, 100, 8, 2))
    summary = summarise(draws, ("c", "sigma"), prob=0.8)
    assert summary["parameter"].tolist() == ["c", "sigma"]
    for i, row in enumerate(summary.to_dict("records")):
        x = draws[..., i].ravel()
        # Algebra: the spread is 3e-7 of the value, so that ten digits of sd are asked for.
        assert row["mean"] == pytest.approx(x.mean(), rel=1e-14)
        assert row["sd"] == pytest.approx(x.std(ddof=1), rel=1e-7)
        lower, upper = np.quantile(x, [0.1, 0.9])
        assert (row["eti_lower"], row["eti_upper"]) == pytest.approx((lower, upper), rel=1e-15)
        assert row["prob"] == 0.8


@pytest.mark.parametrize(("n_step", "n_walker"), [(1_000, 16), (20, 800)])
def test_summarise__effective_sizes_of_independent_draws_are_their_number(n_step, n_walker):
    x = noise((4, n_step, n_walker, 1))
    row = summarise(x, ("x",)).iloc[0]
    # Monte Carlo: tau from 16,000 values a window of 5: relative sd 4 % per ensemble, 2 % in all.
    for name in ("ess_bulk", "ess_tail"):
        assert row[name] == pytest.approx(64_000, rel=0.08)
    assert row["mcse_mean"] == pytest.approx(1 / np.sqrt(64_000), rel=0.05)


def test_summarise__bulk_size_is_of_blom_scores():
    # Vehtari et al. (2021) eq. 14: few draws, so that the constants 3/8 and 1/4 show.
    x = noise((4, 12, 4, 1), seed=8)
    order = x.ravel().argsort().argsort().reshape(x.shape[:3]) + 1
    scores = stats.norm.ppf((order - 3 / 8) / (x.size + 1 / 4))
    bulk = summarise(x, ("x",))["ess_bulk"].iloc[0]
    assert bulk == pytest.approx(float(effective_sample_size(scores)), rel=1e-10)  # algebra


def test_summarise__tail_size_sees_walkers_that_stay_in_the_tail():
    x = noise((4, 1_000, 16, 1))
    x[:, 300:600, 0] = 4.0
    row = summarise(x, ("x",)).iloc[0]
    assert row["ess_tail"] < 0.5 * row["ess_bulk"]


def test_shortcomings__names_each_rule_broken_and_nothing_else():
    summary = pd.DataFrame(
        {
            "parameter": ["c", "K[a]", "sigma", "tau"],
            "r_hat": [1.005, 1.0104, 1.0, np.nan],
            "ess_bulk": [400.0, 500.0, 399.0, np.nan],
            "ess_tail": [400.0, 500.0, 12.0, 500.0],
        }
    )
    missing = failed_diagnostics(summary)
    assert [text.split(",")[0].split(" is ")[0] for text in missing] == [
        "K[a]: R-hat 1.0104",
        "sigma: ess_bulk 399",
        "sigma: ess_tail 12",
        "tau: R-hat nan",
        "tau: ess_bulk nan",
    ]
    assert "under 1.01" in missing[0]
    assert "under 400" in missing[1]


def test_leave_one_out__of_a_normal_mean_is_the_exact_answer():
    # y_i ~ normal(mu, 1), mu ~ normal(0, 2): everything is a normal.
    y = 0.7 + noise(12, seed=3)

    def posterior(rows):
        precision = 1 / 4 + len(rows)
        return rows.sum() / precision, 1 / precision

    mean, variance = posterior(y)
    mu = mean + np.sqrt(variance) * noise((4, 10_000), seed=4)
    log_likelihood = stats.norm.logpdf(y, mu[..., None], 1)
    loo = leave_one_out(log_likelihood, reff=1.0)
    exact = []
    for i in range(len(y)):
        m, v = posterior(np.delete(y, i))
        exact.append(stats.norm.logpdf(y[i], m, np.sqrt(1 + v)))
    # Monte Carlo: sd of log importance ratios is 0.3 or less, of 40,000 draws: 0.002; five of it.
    np.testing.assert_allclose(loo.pointwise, exact, atol=0.01)
    assert loo.elpd == pytest.approx(np.sum(exact), abs=0.02)
    assert loo.elpd == pytest.approx(loo.pointwise.sum(), rel=1e-12)  # algebra
    se = np.sqrt(12 * np.var(loo.pointwise, ddof=1))
    assert loo.se == pytest.approx(se, rel=1e-12)  # algebra: n - 1
    # p is what leaving out costs: in-sample log score minus elpd.
    in_sample = stats.norm.logpdf(y, mean, np.sqrt(1 + variance)).sum()
    assert loo.p == pytest.approx(in_sample - np.sum(exact), abs=0.02)
    assert loo.n_bad_k == 0


@pytest.mark.slow
def test_leave_one_out__is_the_ratio_of_evidences_with_and_without_the_row(fe_fits):
    fit = fe_fits["hybrid"]
    loo = leave_one_out(fit.rows_log_likelihood().reshape(4, -1, len(fit.model.data)), reff=0.5)

    def evidence(data):
        return importance_draws(model_of(data, fit.form), n_draw=1_024).evidence.value

    data = fit.model.data
    whole, n = evidence(data), len(data)
    exact = [whole - evidence(data.take(np.arange(n) != i)) for i in range(n)]
    # Monte Carlo: 10,000 draws and few rows; importance sampling is rough where k is large.
    tolerance = np.where(loo.pareto_k < 0.5, 0.05, 0.4)
    assert np.all(np.abs(loo.pointwise - exact) < tolerance)
    assert np.mean(loo.pareto_k < 0.5) >= 0.5


def test_leave_one_out__of_a_row_that_alone_tells_of_a_slope_is_exact():
    """K of the last texture has one row: in closed form, sigma by quadrature, 21.369 in all."""
    path = Path(__file__).parents[1] / "data" / "engine" / "single-row.csv"
    posterior = drawn_posterior(model_of(read_table(path), PowerLaw()))
    loo = leave_one_out(posterior.rows_log_likelihood().reshape(4, -1, 13), reff=1.0)
    assert loo.pointwise[-1] == pytest.approx(-0.411, abs=0.02)  # Monte Carlo
    # One row is an outlier, which weights do not tell: it is scored without it.
    scores, everything = loo.pointwise.copy(), AllRows.of(posterior, Effort(), 2)
    for i in np.flatnonzero(loo.pareto_k > 0.7):
        scores[i] = everything.without(np.arange(13) == i, 3).log_score
    assert scores.sum() == pytest.approx(21.369, abs=0.1)


def test_leave_one_out__asks_for_rows_of_heavy_tails_and_no_others():
    y, sd = np.array([0.0, 0.1, -0.1, 12.0]), np.array([1.0, 0.8, 0.65, 0.7])
    mu = 0.5 * noise((4, 1_000), seed=5)
    log_likelihood, asked = stats.norm.logpdf(y, mu[..., None], sd), []
    alone = leave_one_out(log_likelihood, 1.0)
    found = leave_one_out(log_likelihood, 1.0, lambda i: asked.append(i) or -50.0)
    assert asked == [3, 2]  # the k of row 2 is 0.6: infinite variance
    assert found.pointwise[asked].tolist() == [-50.0] * len(asked)
    assert (found.n_bad_k, found.status) == (0, "ok")
    assert found.elpd == pytest.approx(found.pointwise.sum(), rel=1e-12)  # algebra
    failed = leave_one_out(log_likelihood, 1.0, lambda i: np.nan)
    assert failed.n_bad_k == alone.n_bad_k


@pytest.mark.parametrize("seed", range(5))
def test_stacking_weights__meet_the_conditions_of_the_optimum(seed):
    pointwise = 0.5 * noise((4, 40), seed=seed) + np.array([[0.0], [0.1], [-0.2], [-1.5]])
    weights = stacking_weights(pointwise)
    density = np.exp(pointwise)
    assert np.all(weights >= 0)
    assert weights.sum() == pytest.approx(1, rel=1e-12)  # algebra
    gain = (density / (weights @ density)).mean(axis=1)
    # Karush-Kuhn-Tucker: gain 1 where the weight is positive, at most 1 elsewhere.
    # Convergence of 2,000 fixed-point steps: 1e-3 in the gain.
    assert np.all(gain < 1 + 1e-3)
    np.testing.assert_allclose(gain[weights > 0.01], 1, atol=1e-3)

    def negative(w):
        return -np.log(w @ density).sum()

    best = optimize.minimize(
        negative,
        np.full(4, 0.25),
        method="SLSQP",
        bounds=[(0, 1)] * 4,
        constraints={"type": "eq", "fun": lambda w: w.sum() - 1},
        options={"ftol": 1e-12},
    )
    assert negative(weights) <= best.fun + 1e-3  # the score's own unit


def ar1(rho, shape, seed=0):
    """AR(1) along the first axis, stationary from the start, unit variance."""
    rng = np.random.default_rng(seed)
    noise = np.sqrt(1 - rho**2) * rng.standard_normal(shape)
    noise[0] /= np.sqrt(1 - rho**2)
    return signal.lfilter([1.0], [1.0, -rho], noise, axis=0)


@pytest.mark.parametrize("rho", [-0.3, 0.0, 0.5, 0.9])
def test_autocorrelation_time__of_ar1_is_the_closed_form(rho):
    x = ar1(rho, (20_000, 16))
    tau = (1 + rho) / (1 - rho)
    # Monte Carlo, Sokal (1997) eq. 3.19: relative variance 2 (2 M + 1)/n per walker, M = 5 tau;
    # four standard errors, and what the window leaves out: exp(-10) of tau.
    se = np.sqrt(2 * (2 * 5 * max(tau, 1) + 1) / x.size)
    assert float(autocorrelation_time(x)) == pytest.approx(tau, rel=4 * se + 1e-3)


@pytest.mark.parametrize("rho", [0.0, 0.8, 0.95])
def test_autocorrelation_time__of_one_walker_is_emcees(rho):
    x = ar1(rho, (5_000, 1, 3), seed=1)
    # Algebra: the same estimator; transforms of other lengths round differently.
    np.testing.assert_allclose(
        autocorrelation_time(x), emcee.autocorr.integrated_time(x, c=5, quiet=True), rtol=1e-9
    )


def test_autocorrelation_time__is_nan_where_nothing_varies():
    x = np.stack([np.ones((100, 4)), ar1(0.0, (100, 4))], axis=-1)
    assert np.isnan(autocorrelation_time(x)).tolist() == [True, False]


def test_effective_sample_size__sums_steps_times_walkers_over_tau():
    x = np.stack([ar1(0.9, (5_000, 4)), ar1(0.0, (5_000, 4), seed=1)])
    expected = sum(20_000 / float(autocorrelation_time(ensemble)) for ensemble in x)
    assert float(effective_sample_size(x)) == pytest.approx(expected, rel=1e-12)  # algebra
    # Monte Carlo: (20,000/19 + 20,000); five percent is 4 standard errors of the smaller tau.
    assert float(effective_sample_size(x)) == pytest.approx(20_000 / 19 + 20_000, rel=0.05)
