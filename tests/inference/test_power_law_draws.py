"""Exact draws of the power law: the moments of the walked posterior, and of closed forms."""

import numpy as np
import pytest

from ridgebayes.inference.power_law_draws import sample_power_law
from ridgebayes.inference.power_law_exact import conditional_log_k


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
