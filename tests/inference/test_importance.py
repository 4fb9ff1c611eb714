"""Importance sampling of densities whose integrals are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

import ridgebayes as rb
from ridgebayes import ComputationError
from ridgebayes.inference.importance import (
    Effort,
    draw_from,
    importance_sample,
    log_weights,
)
from ridgebayes.inference.pareto_smoothing import pareto_k
from ridgebayes.inference.proposal import Mixture
from ridgebayes.inference.target import ModelTarget, PlainTarget
from tests.drawn import model_of

FACTOR = np.array([[0.05, 0, 0], [-0.3, 0.1, 0], [0.4, -0.3, 0.6]])
CENTRE = np.array([1.0, -1.5, 0.5])
NORMAL = stats.multivariate_normal(CENTRE, FACTOR @ FACTOR.T)
SMALL = Effort(n_round=3, n_per_round=384, n_draw=128, n_point=8)
TWO = [stats.multivariate_normal([-2.5, 0.0], 0.1), stats.multivariate_normal([2.0, 1.0], 0.3)]


def humps(u):
    return logsumexp([math.log(0.25) + TWO[0].logpdf(u), math.log(0.75) + TWO[1].logpdf(u)], axis=0)


def plain(log_density, d):
    return PlainTarget("density", tuple("xyz"[:d]), lambda u: np.atleast_1d(log_density(u)))


TARGETS = {"normal": plain(NORMAL.logpdf, 3), "humps": plain(humps, 2)}


@pytest.fixture(scope="module", params=TARGETS)
def runs(request):
    target = TARGETS[request.param]
    return request.param, [importance_sample(target, SMALL, seed) for seed in range(20)]


def test_evidence__errs_as_its_standard_error_says(runs):
    _, found = runs
    assert sum(one.evidence.ok for one in found) >= 18  # a mode found late is said, and tried again
    z = np.array([one.evidence.value / one.evidence.se for one in found])
    # Monte Carlo: the rms of 20 normal values is 1 +- 0.16. The larger of two estimates of the
    # error is quoted, which on average is too large by a fifth.
    assert 0.3 < np.sqrt((z**2).mean()) < 1.5
    assert abs(z.mean()) < 4 / math.sqrt(20)


def test_draws__have_the_moments_of_the_density(runs):
    name, found = runs
    u = np.concatenate([one.u.reshape(-1, one.u.shape[-1]) for one in found])
    n = len(u) * np.mean([one.share for one in found])
    if name == "normal":
        mean, covariance = CENTRE, FACTOR @ FACTOR.T
    else:
        mean, apart = np.array([0.875, 0.75]), np.array([4.5, 1.0])
        covariance = 0.25 * 0.75 * np.outer(apart, apart) + (0.025 + 0.225) * np.eye(2)
    centred = u - mean
    # Monte Carlo: draws are worth their effective number, resampling keeps all but a half of it.
    assert np.all(np.abs(centred.mean(axis=0)) < 4 * np.sqrt(np.diag(covariance) * 1.5 / n))
    products = centred[:, :, None] * centred[:, None, :]
    error = products.std(axis=0) * math.sqrt(1.5 / n)
    assert np.all(np.abs(products.mean(axis=0) - covariance) < 4 * error)
    target = TARGETS[name]
    again = target.evaluate(None, u, None, 0).log_density
    kept = np.concatenate([one.log_density.ravel() for one in found])
    np.testing.assert_array_equal(again, kept)


def test_heavy_tails__are_reported():
    def heavy(u):
        return stats.t(0.3).logpdf(u).sum(axis=-1)

    narrow = Mixture(np.ones(1), np.zeros(1, int), np.zeros((1, 2)), 0.2 * np.eye(2)[None])
    for seed in range(5):
        found = draw_from(plain(heavy, 2), narrow, SMALL, seed).evidence
        assert found.status.startswith("importance weights: Pareto k ")
        assert not found.ok
    assert found.kept().ok
    assert found.kept().status == f"first pass: {found.status}"


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_bounded_weights__are_ok_whatever_the_shape_of_their_tail(seed):
    """A thousandth of the draws weighs up to five times the mean, in a tail of any shape."""
    target = ModelTarget(model_of(rb.reference_fe(), rb.HalfPlane()), seed)
    proposal = importance_sample(target, SMALL, seed).proposal
    found = draw_from(target, proposal, replace(SMALL, n_draw=4_096), seed)
    rng = np.random.default_rng(seed)
    draws = target.evaluate(*proposal.draw(rng, 2**16), rng, 4)
    weights, _ = log_weights(draws, [proposal])
    assert pareto_k(weights) > 0.5
    assert np.exp(weights - weights.max()).mean() > 0.05
    assert found.evidence.ok
    assert found.evidence.se < 0.005


def test_importance_sample__refuses_a_density_that_is_nowhere_positive():
    nowhere = plain(lambda u: np.full(len(u), -np.inf), 2)
    with pytest.raises(ComputationError, match="density: expected starts of positive density, got"):
        importance_sample(nowhere, SMALL, 1)
    with pytest.raises(ComputationError, match="density: expected draws of positive density, got"):
        draw_from(nowhere, Mixture.prior(2), SMALL, 1)


# --- proposal -------------------------------------------------------------------------------------

MIXTURE = Mixture(
    np.array([0.3, 0.7]),
    np.zeros(2, int),
    np.array([[-1.0, 0.5], [1.5, 0.0]]),
    np.array([[[0.8, 0.0], [0.4, 0.5]], [[0.6, 0.0], [-0.3, 1.0]]]),
)


def density_of(mixture, x):
    return np.exp(mixture.log_density(x[None], np.zeros((1, len(x)))))


def test_mixture__is_a_density_that_its_draws_follow():
    x = np.sinh(np.linspace(-6, 6, 801))  # out to 200: tails of t5 have 1e-7 beyond
    weights = np.gradient(x)
    grid = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
    mass = density_of(MIXTURE, grid).reshape(801, 801) * weights[:, None] * weights
    assert mass.sum() == pytest.approx(1, abs=1e-4)  # discretisation
    charts, draws = MIXTURE.draw(np.random.default_rng(1), 20_000)
    assert not charts.any()
    for axis in (0, 1):
        cdf = np.cumsum(mass.sum(axis=1 - axis))
        # Monte Carlo: Kolmogorov-Smirnov; and the grid's own steps.
        distance = stats.ks_1samp(draws[:, axis], lambda z, cdf=cdf: np.interp(z, x, cdf)).statistic
        assert distance < 0.02
