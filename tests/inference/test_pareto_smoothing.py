import numpy as np
import pytest

from ridgebayes.inference.pareto_smoothing import are_bounded, pareto_k, pareto_smoothed


@pytest.mark.parametrize("shape", [0.2, 0.5, 0.9])
def test_pareto_k__is_the_shape_of_the_weights_own_tail(shape):
    rng = np.random.default_rng(4)
    # Weights U^-k have a tail of shape k; their inverses have none.
    log_weights = -shape * np.log(rng.random(40_000))
    smoothed, k = pareto_smoothed(log_weights)
    assert k == pytest.approx(shape, abs=0.15)  # Monte Carlo of the tail's 600 weights
    assert pareto_k(-log_weights) < 0
    # What is below the tail is left as it was, up to a constant.
    body = log_weights < np.quantile(log_weights, 0.9)
    apart = smoothed[body] - log_weights[body]
    assert np.ptp(apart) < 1e-9  # rounding
    assert np.exp(smoothed).sum() == pytest.approx(1)


@pytest.mark.parametrize("log_weights", [np.zeros(50), np.arange(20.0)])
def test_pareto_smoothed__leaves_weights_without_a_tail_as_they_are(log_weights):
    smoothed, k = pareto_smoothed(log_weights)
    assert k == np.inf
    np.testing.assert_allclose(smoothed - smoothed[0], log_weights, atol=1e-12)  # rounding


def test_are_bounded__equal_weights_are_and_weights_of_nothing_are_not():
    assert are_bounded(np.zeros(64))
    assert not are_bounded(np.full(64, -np.inf))  # without a warning, which would be an error


def test_pareto_k__of_weights_that_are_not_numbers_is_not_to_be_trusted():
    assert not pareto_k(np.array([*range(99), np.nan], dtype=float)) <= 0.7


@pytest.mark.parametrize("apart", [720.0, 760.0, 2_000.0])
def test_pareto_k__of_one_weight_beside_which_all_others_are_nothing_is_infinite(apart):
    log_weights = np.append(np.random.default_rng(1).standard_normal(500), apart)
    smoothed, k = pareto_smoothed(log_weights)
    assert k == pareto_k(log_weights) == np.inf
    # Their differences stay, and the one that dominates has all the weight.
    np.testing.assert_allclose(np.diff(smoothed), np.diff(log_weights), atol=1e-12)  # rounding
    assert smoothed[-1] == 0


@pytest.mark.parametrize("sd", [10, 100, 200, 400, 800, 1e5])
@pytest.mark.parametrize("n", [30, 500, 4_096])
def test_pareto_k__of_weights_ever_further_apart_never_comes_out_as_harmless(n, sd):
    assert pareto_k(sd * np.random.default_rng(2).standard_normal(n)) > 1
