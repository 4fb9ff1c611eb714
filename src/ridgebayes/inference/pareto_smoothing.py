"""Pareto smoothing of importance weights, and the diagnostic k of their reliability."""

import math

import numpy as np
from scipy.special import logsumexp

from ridgebayes._types import FloatArray

MAX_FINITE_VARIANCE_K = 0.5  # weights with a larger k have infinite variance
MAX_PARETO_K = 0.7  # means of weights with a larger k are not reliable (Vehtari et al. 2024)
# Largest weight, relative to the largest weight expected of a tail with Pareto k 0.7, up to which
# weights count as bounded. In 300 of 300 simulated heavy tails the largest weight was larger.
_MAX_BOUNDED_SHARE = 0.1


def pareto_k(log_weights: FloatArray) -> float:
    """Return the Pareto shape k of the tail of importance weights; above 0.7 is unreliable.

    Parameters
    ----------
    log_weights : ndarray of float, shape (n_draw,)
        Logarithms of the weights, up to a constant.

    References
    ----------
    Vehtari et al. (2024), Journal of Machine Learning Research 25(72).
    """
    return pareto_smoothed(log_weights)[1]


def are_bounded(log_weights: FloatArray) -> bool:
    """Return whether the largest weight has a far smaller share of the sum than in a heavy tail.

    The largest weight of a tail with shape k has about n^(k - 1) of the sum. Bounded weights can
    have a large fitted k too. Weights that are all 0 are not bounded.
    """
    with np.errstate(invalid="ignore"):  # the difference of infinities, if all weights are 0
        largest_share = math.exp(log_weights.max() - logsumexp(log_weights))
    most: float = _MAX_BOUNDED_SHARE * len(log_weights) ** (MAX_PARETO_K - 1)
    return largest_share < most


def have_finite_variance(log_weights: FloatArray) -> bool:
    """Return whether weights are bounded, or k is below 0.5 by its standard error or more.

    The standard error of k is (1 + k)/sqrt(m), with m = 3 sqrt(n) weights in the tail.
    """
    if are_bounded(log_weights):
        return True
    k, n_tail = pareto_k(log_weights), 3 * math.sqrt(len(log_weights))
    return k + (1 + k) / math.sqrt(n_tail) <= MAX_FINITE_VARIANCE_K


def pareto_smoothed(log_weights: FloatArray, reff: float = 1.0) -> tuple[FloatArray, float]:
    """Return importance weights with their tail replaced by a fitted Pareto tail, and its shape k.

    Parameters
    ----------
    log_weights : ndarray of float, shape (n_draw,)
        Logarithms of the weights, up to a constant.
    reff : float, optional
        Effective sample size over the number of draws.

    Returns
    -------
    smoothed : ndarray of float, shape (n_draw,)
        Logarithms of the smoothed weights, normalised to sum 1.
    shape : float
        Pareto k; infinite if all weights of the tail are equal, if there are too few weights, or if
        most of the tail underflows relative to the largest weight.

    References
    ----------
    Vehtari et al. (2024), Journal of Machine Learning Research 25(72), section 3.2.
    """
    from arviz_stats.base import array_stats  # loads scipy.signal

    weights = np.asarray(log_weights, dtype=float)
    with np.errstate(all="ignore"):  # underflow is handled below
        try:
            # psislw takes log-likelihoods and uses their negative as log weights.
            smoothed, shape = array_stats.psislw(-weights, r_eff=reff)
        except ValueError as error:
            if "tail" not in str(error):  # raised if all are equal, or if there are under five
                raise
            return weights - logsumexp(weights), math.inf
        if np.isnan(shape) or np.isnan(smoothed).any():
            # The tail underflows relative to the largest weight: the shape is NaN, or near 0 by
            # mistake.
            return weights - logsumexp(weights), math.inf
    return np.asarray(smoothed), float(shape)
