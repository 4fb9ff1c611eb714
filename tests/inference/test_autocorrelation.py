import emcee
import numpy as np
import pytest
from scipy import signal

from ridgebayes.inference.autocorrelation import autocorrelation_time, effective_sample_size


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


def test_autocorrelation_time__of_many_walkers_is_close_to_emcees():
    x = ar1(0.8, (2_000, 32, 2), seed=2)
    # emcee averages each walker's normalised function, here the functions are averaged first:
    # a difference of order tau/n_step.
    np.testing.assert_allclose(
        autocorrelation_time(x), emcee.autocorr.integrated_time(x, c=5), rtol=0.02
    )


def test_autocorrelation_time__keeps_trailing_axes_apart():
    x = np.stack([ar1(rho, (4_000, 8), seed=3) for rho in (0.0, 0.9)], axis=-1)
    tau = autocorrelation_time(x)
    assert tau.shape == (2,)
    np.testing.assert_array_equal(tau, [autocorrelation_time(x[..., i]) for i in (0, 1)])
    assert tau[1] > 10 * tau[0]


def test_autocorrelation_time__does_not_mind_unit_and_origin():
    x = ar1(0.5, (1_000, 4))
    # Algebra: rounding of values a thousand times their spread.
    assert float(autocorrelation_time(5 * x + 1e3)) == pytest.approx(
        float(autocorrelation_time(x)), rel=1e-9
    )


def test_autocorrelation_time__is_positive_for_alternating_values():
    x = np.tile([1.0, -1.0], 50)[:, None] + 1e-3 * ar1(0.0, (100, 1))
    assert float(autocorrelation_time(x)) >= 1 / 100


def test_autocorrelation_time__is_nan_where_nothing_varies():
    x = np.stack([np.ones((100, 4)), ar1(0.0, (100, 4))], axis=-1)
    assert np.isnan(autocorrelation_time(x)).tolist() == [True, False]


def test_effective_sample_size__sums_steps_times_walkers_over_tau():
    x = np.stack([ar1(0.9, (5_000, 4)), ar1(0.0, (5_000, 4), seed=1)])
    expected = sum(20_000 / float(autocorrelation_time(ensemble)) for ensemble in x)
    assert float(effective_sample_size(x)) == pytest.approx(expected, rel=1e-12)  # algebra
    # Monte Carlo: (20,000/19 + 20,000); five percent is 4 standard errors of the smaller tau.
    assert float(effective_sample_size(x)) == pytest.approx(20_000 / 19 + 20_000, rel=0.05)


def test_effective_sample_size__says_how_far_a_mean_is_off():
    # 200 means of 1,000 correlated values each: their spread is 1/sqrt(ESS).
    x = ar1(0.7, (1_000, 200), seed=4)
    expected = np.sqrt(1 / (1_000 / float(autocorrelation_time(x))))
    # Monte Carlo: the sd of 200 means is known to 5 %; three standard errors.
    assert x.mean(axis=0).std() == pytest.approx(expected, rel=0.15)
