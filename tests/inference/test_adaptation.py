import math

import numpy as np
import pytest

from ridgebayes.inference.adaptation import Weighted, adapted, weighted
from ridgebayes.inference.moves import Independence


def normal(mean, sd, log_integral):
    """Log density of independent normals whose integral is not one."""
    mean, sd = np.asarray(mean), np.asarray(sd)
    peak = log_integral - np.log(sd * math.sqrt(2 * math.pi)).sum()
    return lambda z: peak - 0.5 * (((z - mean) / sd) ** 2).sum(axis=1)


def test_weighted__mean_weight_is_the_densitys_integral():
    target = normal([0.3, -0.2, 0.4], [0.8, 1.1, 0.9], 5.0)
    proposal = Independence.standard(2, 1)
    draws = weighted(target, proposal, np.random.default_rng(1), 5_100)  # no whole batches
    assert draws.z.shape == (5_100, 3)
    np.testing.assert_allclose(draws.log_density, target(draws.z), rtol=1e-13)  # rounding
    expected = target(draws.z) - proposal.log_pdf(draws.z)
    np.testing.assert_allclose(draws.log_weight, expected, rtol=1e-12, atol=1e-12)  # rounding
    assert draws.relative.mean() == pytest.approx(1, rel=1e-12)  # algebra
    se = draws.relative.std() / math.sqrt(5_100)
    assert se < 0.02
    assert abs(draws.log_mean - 5.0) < 4 * se  # Monte Carlo


def ladder(weights):
    with np.errstate(divide="ignore"):
        log_weight = np.log(weights) + 300.0
    return Weighted(np.arange(len(weights))[:, None], log_weight, log_weight)


def test_resampled__indices_follow_the_weights():
    weights = np.array([0.0, 0.5, 3.0, 1.25, 0.0, 0.25])
    for seed in range(20):
        index = ladder(weights).resampled(np.random.default_rng(seed), 1_001)
        expected = 1_001 * weights / weights.sum()
        # Evenly spaced: each is drawn its share of times, up to one.
        assert np.all(np.abs(np.bincount(index, minlength=6) - expected) < 1 + 1e-9)  # rounding
        assert set(index.tolist()) == {1, 2, 3, 5}
        assert np.any(np.diff(index) < 0)  # shuffled


def test_resampled__cuts_weights_above_the_largest():
    weights = np.array([90.0, 4.0, 3.0, 3.0])
    index = ladder(weights).resampled(np.random.default_rng(1), 1_000, largest=1.0)
    cut = np.array([1.0, 0.16, 0.12, 0.12])  # over their mean of 25
    expected = 1_000 * cut / cut.sum()
    assert np.all(np.abs(np.bincount(index) - expected) < 1 + 1e-9)  # rounding


def test_adapted__follows_a_shifted_narrow_target():
    mean, sd = np.array([3.0, -2.0, 0.5]), np.array([0.05, 0.2, 0.7])
    target = normal(mean, sd, -7.0)
    first = weighted(target, Independence.standard(2, 1), np.random.default_rng(2), 2_000)
    proposal, draws = adapted(target, 2, 1, np.random.default_rng(2))
    assert len(draws.z) == 2_000

    def effective(draws):
        return 1 / np.mean(draws.relative**2)

    assert effective(first) < 0.01
    assert effective(draws) > 0.5
    weight = draws.relative / 2_000
    se = np.sqrt(np.sum((weight[:, None] * (draws.z - mean)) ** 2, axis=0))
    assert np.all(np.abs(weight @ draws.z - mean) < 4 * se)  # Monte Carlo
    assert np.all(se < 0.05 * sd)
    assert abs(draws.log_mean + 7.0) < 4 * draws.relative.std() / math.sqrt(2_000)  # Monte Carlo
    # The last draws are the last proposal's.
    expected = target(draws.z) - proposal.log_pdf(draws.z)
    np.testing.assert_allclose(draws.log_weight, expected, rtol=1e-12, atol=1e-12)  # rounding
    # Means of components: within a few widths of what they were fitted to.
    assert np.all(np.abs(proposal.weights @ proposal.centres - mean[:2]) < 0.2 * sd[:2])


def test_adapted__same_stream_same_draws():
    target = normal([0.3, 0.1], [0.8, 1.1], 0.0)
    one, two = (
        adapted(target, 1, 1, np.random.default_rng(3), n_round=2, n=300)[1] for _ in range(2)
    )
    assert one.z.tobytes() == two.z.tobytes()
    assert one.log_weight.tobytes() == two.log_weight.tobytes()
