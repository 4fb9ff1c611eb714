"""Offsets without a closed-form integral: no walk, the same posterior by other ways."""

import numpy as np
import pytest

from ridgebayes.evidence import quadrature_evidence
from ridgebayes.evidence.tables import evidences
from ridgebayes.inference.chains import SampleSettings
from ridgebayes.inference.sampling import sample_posterior
from ridgebayes.model.forms import Modified
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise

OUTLIER = 1.3


def model(observed, structure):
    """Three textures at three steps, 2 % noise, an outlier, Student errors."""
    rng = np.random.default_rng(1)
    texture, Q = np.repeat([0, 1, 2], 3), np.tile([4, 6, 8], 3)
    load = 2 * np.log((Q / 2 - 1) * 0.042 / 1.36) + 0.02 * rng.standard_normal(9)
    load[4] += np.log(OUTLIER)
    return Model(observed(texture, Q, load), Modified(), Noise.named(f"{structure}:student"))


@pytest.fixture(scope="module")
def drawn(observed):
    return sample_posterior(model(observed, "texture"), seed=1)


@pytest.mark.slow
@pytest.mark.long
def test_sample_posterior__of_one_factor_has_the_evidence_of_quadrature(observed):
    data = model(observed, "texture").data
    bracketed = observed(data.texture, data.Q, data.log_load, log_lower=data.log_load - 0.02)
    drawn = sample_posterior(Model(bracketed, Modified(), Noise("texture")), seed=1)
    # Three parameters: the trapezoidal rule over them, offsets by nodes of their own.
    exact = quadrature_evidence(drawn.model.marginal_log_density, drawn.laplace, tol=1e-3)
    assert exact.ok
    assert drawn.evidence.ok
    assert 0 < drawn.evidence.se < 0.02
    assert abs(drawn.evidence.value - exact.value) < 4 * drawn.evidence.se  # Monte Carlo


def test_sample_posterior__of_a_latent_model_does_not_walk(drawn, monkeypatch):
    assert drawn.sampler == "importance"
    assert drawn.converged
    found = evidences(drawn)
    assert [one.method for one in found] == ["importance", "laplace"]
    assert found[0] == drawn.evidence
    chains = drawn.chains
    np.testing.assert_allclose(
        drawn.model.log_density(chains.u[0, 0]), chains.log_density[0, 0], atol=1e-8
    )  # rounding


def test_sample_posterior__of_others_walks(observed):
    data = model(observed, "texture").data
    settings = SampleSettings(n_walker=32, n_burn=20, n_step_max=100)
    walked = sample_posterior(Model(data, Modified()), seed=1, settings=settings)
    assert (walked.sampler, walked.evidence) == ("emcee", None)


def test_importance__of_two_factors_tends_to_one_where_the_other_vanishes(observed):
    one, both = model(observed, "texture"), model(observed, "texture+step")
    rng = np.random.default_rng(3)
    u = 0.5 * rng.standard_normal((300, both.n_parameter))
    theta = both.to_theta(u)
    step = both.parameter_names.index("tau_step")
    theta[:, step] = 1e-9
    rates, eta = both.log_rates(theta), theta[:, 1:]
    found = both.likelihood.estimated(rates, eta, rng, 64).log_density
    exact = one.likelihood.marginal(rates, np.delete(eta, step - 1, axis=1))
    weight = np.exp(found - exact)
    assert weight.std() < 1.5
    assert abs(weight.mean() - 1) < 4 * weight.std() / np.sqrt(300)  # Monte Carlo
