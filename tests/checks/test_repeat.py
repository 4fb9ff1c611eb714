"""A posterior drawn again, and held against its priors."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

import ridgebayes as rb
from ridgebayes.checks.repeat import against_priors, is_cheap, repeat_posterior
from tests.drawn import model_of


def test_repeat_posterior__draws_twice_as_many_and_finds_the_same(fits):
    fit = fits["modified"]
    found = repeat_posterior(fit)
    assert found.n_draw >= 2 * len(fit.draws)
    assert not found.failed
    # Monte Carlo: four standard errors of both means, in posterior sds.
    assert found.moved < 4 * (1 / fit.summary["ess_bulk"].min() + 1 / found.n_draw) ** 0.5


def test_repeat_posterior__sees_a_posterior_that_is_off(fits):
    fit = fits["modified"]
    moved = fit.summary.assign(mean=fit.summary["mean"] + [0.0, 1.0] * fit.summary["sd"])
    found = repeat_posterior(replace(fit, summary=moved))
    assert found.parameter == "sigma"
    assert found.moved == pytest.approx(1, abs=0.1)


def test_against_priors__is_where_means_lie_in_their_priors(fits):
    found = against_priors(fits["modified"]).set_index("parameter")
    mean = fits["modified"].summary.set_index("parameter")["mean"]
    # Log-normal, median 1.382, log-sd 0.1: rounding.
    assert found["prior_below"]["c"] == pytest.approx(norm.cdf(np.log(mean["c"] / 1.382) / 0.1))
    assert found["prior_median"]["c"] == pytest.approx(1.382)


def test_is_cheap__is_not_where_densities_are_estimates_or_parameters_many(fits, observed):
    assert is_cheap(fits["modified"])
    data = fits["modified"].model.data
    latent = model_of(data, rb.Modified(), "step:student")
    assert not is_cheap(SimpleNamespace(model=latent))
    textures = [(0.01 + 1e-4 * i, 0.03) for i in range(21)]
    many = observed(np.arange(21), np.full(21, 4), np.full(21, -6.0), textures=textures)
    assert not is_cheap(SimpleNamespace(model=model_of(many, rb.PowerLaw())))
