"""Exact draws of the power law: the moments of the walked posterior, and of closed forms."""

import re

import numpy as np
import pandas as pd
import pytest
from scipy import integrate, stats

from ridgebayes.distributions.bounded import Uniform
from ridgebayes.distributions.distribution import HalfNormal, Normal
from ridgebayes.errors import InputError
from ridgebayes.evidence import bridge_evidence, power_law_evidence, quadrature_evidence
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.power_law_exact import (
    conditional_log_k,
    log_evidence_given_sigma,
    sample_power_law,
)
from ridgebayes.model.forms import PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations
from ridgebayes.table.table import ContactTable


@pytest.fixture(scope="module")
def model():
    """Two textures whose rows have different known errors."""
    rng = np.random.default_rng(1)
    rows = [
        {
            "a_over_R": a,
            "b_over_R": b,
            "Q": Q,
            "p_over_E": (0.5 * (Q - 2) * (a + b) / 1.4) ** 2 * np.exp(0.04 * rng.standard_normal()),
            "rel_se": float(rng.choice([0.0, 0.02])),
        }
        for a, b in ((0.012, 0.03), (0.032, 0.01))
        for Q in (4, 6, 8, 10)
    ]
    table = ContactTable.from_frame(pd.DataFrame(rows))
    return Model(Observations.from_table(table), PowerLaw())


def brute(model, texture, sigma, power):
    """Integral over K of likelihood x prior x (log K)^power: adaptive quadrature, row by row."""
    data = model.data
    mine = data.texture == texture
    a, b = data.textures[texture]
    median = 2 * 1.382 / (a + b)
    prior = stats.lognorm(s=0.3, scale=median)
    sd = np.hypot(sigma, data.rel_se[mine])

    def density(K):
        rows = stats.norm.logpdf(data.log_load[mine], 2 * np.log((data.Q[mine] - 2) / K), sd)
        return prior.pdf(K) * np.exp(rows.sum()) * np.log(K) ** power

    best = (data.Q[mine] - 2) / np.exp(data.log_load[mine] / 2)
    low, high = 0.5 * best.min(), 2 * best.max()
    points = np.linspace(best.min(), best.max(), 5).tolist()
    return integrate.quad(density, low, high, points=points, epsrel=1e-10, limit=500)[0]


@pytest.mark.parametrize("sigma", [0.02, 0.05, 0.2])
def test_log_evidence_given_sigma__is_the_brute_force_integral_over_each_K(model, sigma):
    expected = sum(np.log(brute(model, j, sigma, 0)) for j in (0, 1))
    found = log_evidence_given_sigma(model, np.array([sigma, 1.0]))
    assert found.shape == (2,)
    # Discretisation: quad's 1e-10; at sigma = 0.2 the limits cut off 1e-9 or so.
    assert found[0] == pytest.approx(expected, abs=1e-7)


def test_conditional_log_k__has_the_brute_force_moments(model):
    mean, sd = conditional_log_k(model, np.array([0.05]))
    assert mean.shape == sd.shape == (1, 2)
    for j in (0, 1):
        zeroth, first, second = (brute(model, j, 0.05, power) for power in (0, 1, 2))
        # Discretisation: quad's 1e-10, times the condition of the variance, mean^2/sd^2 = 1e5.
        assert mean[0, j] == pytest.approx(first / zeroth, rel=1e-8)
        variance = second / zeroth - (first / zeroth) ** 2
        assert sd[0, j] == pytest.approx(np.sqrt(variance), rel=1e-4)


def test_power_law_evidence__integrates_sigma_as_scipy_does(model):
    prior = stats.halfnorm(scale=0.05)

    def density(sigma):
        return np.exp(float(log_evidence_given_sigma(model, np.array([sigma]))[0])) * prior.pdf(
            sigma
        )

    total = integrate.quad(density, 0, 0.6, points=[0.02, 0.05, 0.1], epsrel=1e-10, limit=500)[0]
    found = power_law_evidence(model)
    assert found.ok
    assert found.value == pytest.approx(np.log(total), abs=1e-6)  # discretisation: tol


def test_power_law_evidence__of_two_textures_is_the_three_dimensional_quadrature(
    fe_models, fe_laplaces
):
    model = fe_models["power-law"]
    assert model.n_parameter == 3
    grid = quadrature_evidence(model.log_density, fe_laplaces["power-law"])
    # Discretisation: both to 1e-6.
    assert power_law_evidence(model).value == pytest.approx(grid.value, abs=1e-5)


def test_power_law_evidence__of_nine_textures_is_the_bridge(fits, laplaces):
    fit = fits["power-law"]
    bridge = bridge_evidence(
        fit.model.log_density, fit.chains, laplaces["power-law"], rng=np.random.default_rng(1)
    )
    # Monte Carlo: four of the bridge's standard errors.
    assert power_law_evidence(fit.model).value == pytest.approx(bridge.value, abs=4 * bridge.se)


def test_power_law_evidence__says_so_where_sigma_does_not_settle(model):
    found = power_law_evidence(model, tol=0.0)
    assert not found.ok
    assert found.status == "not settled to 0"
    assert np.isnan(found.value)


def test_power_law_evidence__refuses_other_forms_and_priors(fits, model):
    with pytest.raises(InputError, match="form: expected power-law, got 'hybrid'"):
        power_law_evidence(fits["hybrid"].model)
    # `with_priors` keeps the support, so a prior of another kind has to be put there by hand.
    for name in model.parameter_names[:-1]:
        other = model.with_priors({})
        other.priors[name] = Normal(60.0, 5.0)
        rule = (
            rf"prior of '{re.escape(name)}': expected log-normal, got Normal\(mean=60.0, sd=5.0\)"
        )
        with pytest.raises(InputError, match=rule):
            power_law_evidence(other)


def test_sample_power_law__has_the_moments_of_the_walk(fits):
    fit = fits["power-law"]
    chains = sample_power_law(fit.model, seed=4)
    theta = fit.model.to_theta(chains.u).reshape(-1, fit.model.n_parameter)
    walked = fit.summary
    # Monte Carlo: five standard errors of both means; sds of 10,240 draws to 5 x 0.7 %.
    se = np.hypot(walked["sd"] / np.sqrt(len(theta)), walked["mcse_mean"])
    assert np.all(np.abs(theta.mean(axis=0) - walked["mean"]) < 5 * se)
    np.testing.assert_allclose(theta.std(axis=0), walked["sd"], rtol=0.04)


def test_sample_power_law__given_sigma_each_log_k_is_normal_as_the_closed_form_says(fits):
    model = fits["power-law"].model
    theta = model.to_theta(sample_power_law(model, seed=5).u).reshape(-1, model.n_parameter)
    mean, sd = conditional_log_k(model, theta[:, -1])
    score = (np.log(theta[:, :-1]) - mean) / sd
    # Monte Carlo: five standard errors of mean and variance of standard normals.
    assert np.all(np.abs(score.mean(axis=0)) < 5 / np.sqrt(len(score)))
    assert np.all(np.abs(score.var(axis=0) - 1) < 5 * np.sqrt(2 / len(score)))


def test_sample_power_law__carries_the_density_of_its_draws(fits):
    model = fits["power-law"].model
    chains = sample_power_law(model, seed=6)
    np.testing.assert_array_equal(chains.log_density[2, 3], model.log_density(chains.u[2, 3]))


def test_sample_power_law__same_seed_same_draws_other_seed_others(fits):
    model = fits["power-law"].model
    first, again, other = (sample_power_law(model, seed=seed).u for seed in (7, 7, 8))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    assert first[0] != pytest.approx(first[1])  # ensembles have streams of their own


def test_log_evidence_given_sigma__is_the_same_however_many_are_worked_out_together(
    model, monkeypatch
):
    sigma = np.geomspace(1e-3, 1.0, 7)
    whole = log_evidence_given_sigma(model, sigma)
    monkeypatch.setattr("ridgebayes.inference.power_law_exact._AT_ONCE", 12)  # three of four groups
    np.testing.assert_array_equal(log_evidence_given_sigma(model, sigma), whole)


@pytest.mark.parametrize("sigma", [HalfNormal(0.05), Uniform(0.0, 0.1), Uniform(0.0300, 0.0304)])
def test_power_law_evidence__is_that_of_importance_sampling_under_priors_with_edges(
    observed, sigma
):
    # The only row of a texture without a known error leaves sigma free to fall to zero there alone.
    load, rel_se = [-5.1, -4.0, -1.8, -3.6, -1.5], [0.0, 0.1, 0.1, 0.02, 0.005]
    textures = [(0.05, 0.06), (0.07, 0.11), (0.11, 0.15), (0.14, 0.08), (0.16, 0.19)]
    rows = observed(np.arange(5), [4, 4, 6, 4, 6], load, rel_se=rel_se, textures=textures)
    model = Model(rows, PowerLaw(), priors={"sigma": sigma})
    found = power_law_evidence(model)
    _, sampled = importance_posterior(model, seed=1, n_draw=2_048)
    assert found.ok
    assert found.se < 1e-5
    assert sampled.se < 0.02
    assert abs(found.value - sampled.value) < 4 * sampled.se  # Monte Carlo
    # Each texture has a row of its own: sigma is known by the prior and by how far K is off.
    values = [brute(model, j, 0.03, 0) for j in range(5)]
    given = log_evidence_given_sigma(model, np.array([0.03]))[0]
    assert given == pytest.approx(np.log(values).sum(), rel=1e-9)  # of adaptive quadrature


@pytest.mark.parametrize("sigma", [HalfNormal(0.05), Uniform(0.0300, 0.0304)])
def test_sample_power_law__draws_sigma_from_its_own_distribution(model, sigma):
    narrow = model.with_priors({"sigma": sigma})
    chains = sample_power_law(narrow, seed=1)
    drawn = narrow.to_theta(chains.u)[..., -1].ravel()
    # Reference: its density on a grid of sigma itself.
    grid = sigma.value_at(np.linspace(-6, 6, 20_001))
    density = np.exp(log_evidence_given_sigma(narrow, grid)) * np.exp(sigma.log_pdf(grid))
    steps = 0.5 * (density[1:] + density[:-1]) * np.diff(grid)
    cdf = np.append(0, np.cumsum(steps)) / steps.sum()
    # Monte Carlo: 1.95 / sqrt(n) is passed by one sample in a thousand.
    assert (
        stats.kstest(drawn, lambda x: np.interp(x, grid, cdf)).statistic < 1.95 / len(drawn) ** 0.5
    )
