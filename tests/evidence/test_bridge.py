"""Bridge sampling of draws whose density has a known integral."""

import numpy as np
import pytest
from scipy import stats

from ridgebayes.evidence.bridge import bridge_evidence
from ridgebayes.inference.chains import Chains
from ridgebayes.inference.emcee_sampling import Walked
from ridgebayes.inference.target import PlainTarget


def skewed(u):
    """Two independent skew-normals, log integral 2.5."""
    return 2.5 + stats.skewnorm.logpdf(u, 4.0).sum(axis=-1)


def normal(u):
    return 2.5 + stats.norm.logpdf(u).sum(axis=-1)


def skewed_draws(seed, shape=(4, 100, 16, 2)):
    return stats.skewnorm.rvs(4.0, size=shape, random_state=seed)


def bridged(log_density, draws, *, seed=1, **options):
    d = draws.shape[-1]
    log_p = log_density(draws.reshape(-1, d)).reshape(draws.shape[:-1])
    chains = Chains(draws, log_p, np.ones(len(draws)), np.ones(d + 1), ())
    walked = Walked(chains, draws, np.zeros(log_p.shape), np.empty((*log_p.shape, 0)))
    target = PlainTarget("density", tuple("abcdef"[:d]), log_density)
    return bridge_evidence(target, walked, rng=np.random.default_rng(seed), **options)


@pytest.mark.parametrize("repeats", [1, 10])
def test_bridge_evidence__of_exact_draws_errs_as_its_standard_error_says(repeats):
    # Repeated draws add steps and no information: the standard error must not fall for them.
    z = []
    for seed in range(30):
        found = bridged(skewed, skewed_draws(seed).repeat(repeats, axis=1), seed=1000 + seed)
        z.append((found.value - 2.5) / found.se)
    # Monte Carlo: the rms of 30 normal values is 1 +- 0.13, their mean 0 +- 0.18; four of each.
    assert 0.48 < np.sqrt(np.mean(np.square(z))) < 1.52
    assert abs(np.mean(z)) < 0.73


def test_bridge_evidence__of_a_normal_posterior_errs_as_its_standard_error_says():
    # Either half is off from the other's proposal by the same number.
    z = []
    for seed in range(600):
        draws = np.random.default_rng(seed).standard_normal((4, 10, 32, 6))
        found = bridged(normal, draws, seed=10_000 + seed)
        z.append((found.value - 2.5) / found.se)
    # Monte Carlo: the rms of 600 normal values is 1 +- 0.03; three of them. Halves taken as
    # independent have 1.22, and short chains taken for more draws than they are 1.2 or more.
    assert 0.91 < np.sqrt(np.mean(np.square(z))) < 1.09


@pytest.mark.parametrize("still", [0.0, 0.1, 1 / 3, 1e3])
def test_bridge_evidence__of_draws_that_do_not_move_has_no_value_on_any_machine(still):
    draws = skewed_draws(1)
    draws[..., 1] = still  # rounding gives it a variance of zero or of next to nothing
    found = bridged(skewed, draws)
    assert np.isnan(found.value)
    assert found.status == "the draws of half of the ensembles do not move in every direction"


def test_bridge_evidence__says_what_went_wrong():
    found = bridged(skewed, skewed_draws(1), iterations_max=1)
    assert not found.ok
    assert np.isnan(found.value)
    assert found.status.startswith("bridge iteration not settled after 1 steps")
    draws = skewed_draws(1)
    draws[2:] = 0.5 + 0.5 * draws[2:]  # the last two ensembles sampled something else
    found = bridged(skewed, draws)
    assert not found.ok
    assert found.status.startswith("halves of the ensembles disagree by ")
    draws[2:] = 3 + 0.1 * draws[2:]
    assert not bridged(skewed, draws).ok
