import numpy as np
import pytest

from ridgebayes.evidence import quadrature_evidence
from ridgebayes.inference import importance_sampling as importance
from ridgebayes.inference.diagnostics import effective_sample_size
from ridgebayes.inference.importance_sampling import K_MAX, N_REPEAT, importance_posterior
from ridgebayes.inference.moves import Independence
from ridgebayes.model.forms import Hybrid
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations

QUICK = {"n_draw": 384, "n_round": 2, "n_per_round": 500}


@pytest.fixture(scope="module")
def model(paper):
    return Model(Observations.from_table(paper), Hybrid())


@pytest.fixture(scope="module")
def found(model):
    return importance_posterior(model, seed=1)


def test_importance_posterior__evidence_of_the_sweep_is_the_quadrature(model, found, laplaces):
    _, evidence = found
    exact = quadrature_evidence(model.log_density, laplaces["hybrid"]).value
    assert (evidence.method, evidence.ok) == ("importance", True)
    assert 0 < evidence.se < 0.03  # as its notes say
    assert abs(evidence.value - exact) < 4 * evidence.se  # Monte Carlo


def test_importance_posterior__draws_have_the_means_and_spreads_of_the_walk(model, found, fits):
    fit, _ = found
    assert fit.chains.convergence_failures == ()
    assert fit.chains.u.shape == (N_REPEAT, 20, 128, 3)
    ours, walked = (model.to_theta(each.chains.u) for each in (fit, fits["hybrid"]))
    centre = walked.mean(axis=(0, 1, 2))
    # Weighted draws are worth their effective number, the share that `acceptance` holds.
    n_ours = ours[..., 0].size * fit.chains.acceptance.mean()
    for power in (1, 2):
        a, b = (ours - centre) ** power, (walked - centre) ** power
        variance = a.var(axis=(0, 1, 2)) / n_ours
        variance = variance + b.var(axis=(0, 1, 2)) / effective_sample_size(b)
        z = (a.mean(axis=(0, 1, 2)) - b.mean(axis=(0, 1, 2))) / np.sqrt(variance)
        assert np.abs(z).max() < 4  # Monte Carlo: the largest of three


def test_importance_posterior__log_density_is_that_of_the_draws(model, found):
    chains = found[0].chains
    # Algebra: a Jacobian added and taken away.
    np.testing.assert_allclose(chains.log_density, model.log_density(chains.u), rtol=1e-11)


def test_importance_posterior__same_seed_same_bytes_other_seed_others(model):
    one, two, other = (importance_posterior(model, seed=seed, **QUICK) for seed in (3, 3, 4))
    assert one[0].chains.u.tobytes() == two[0].chains.u.tobytes()
    assert one[1] == two[1]
    assert not np.any(one[0].chains.u[:, 0, 0] == other[0].chains.u[:, 0, 0])


def test_importance_posterior__tells_where_weights_are_heavy(model, monkeypatch):
    def far_too_narrow(log_density, k, n_rest, rng, **_):
        unit = Independence.standard(k, n_rest)
        return Independence(unit.weights, unit.centres, 0.1 * unit.factors, unit.rest), None

    monkeypatch.setattr(importance, "adapted", far_too_narrow)
    fit, evidence = importance_posterior(model, seed=1, n_draw=1_280)
    text = fit.chains.convergence_failures[0]
    assert text.startswith("importance weights: Pareto k ")
    assert text.endswith(f", above {K_MAX}")
    assert text in fit.convergence_failures
    assert not evidence.ok
    assert evidence.status == text
    assert np.all(fit.chains.acceptance < 0.5)
