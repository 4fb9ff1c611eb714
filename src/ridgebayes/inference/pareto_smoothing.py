"""Importance weights whose tail is smoothed, and whether they can be trusted."""

import math

import numpy as np
from scipy.special import logsumexp

from ridgebayes._types import FloatArray

MAX_FINITE_VARIANCE_K = 0.5  # the variance of weights with a larger one is infinite
MAX_PARETO_K = 0.7  # means of weights with a larger one are not trusted (Vehtari et al. 2024)


def pareto_k(log_weights: FloatArray) -> float:
    """Return the shape of the tail of importance weights; above 0.7 they are not to be trusted.

    Parameters
    ----------
    log_weights : ndarray of float, shape (n_draw,)
        Logarithms, up to a constant.

    References
    ----------
    Vehtari et al. (2024), Journal of Machine Learning Research 25(72).
    """
    return pareto_smoothed(log_weights)[1]


def pareto_smoothed(log_weights: FloatArray, reff: float = 1.0) -> tuple[FloatArray, float]:
    """Return importance weights whose tail is replaced by a fitted Pareto's, and its shape.

    Parameters
    ----------
    log_weights : ndarray of float, shape (n_draw,)
        Logarithms, up to a constant.
    reff : float, optional
        Effective over actual number of draws.

    Returns
    -------
    smoothed : ndarray of float, shape (n_draw,)
        Logarithms of smoothed weights, which sum to 1.
    shape : float
        As `pareto_k` returns it; infinite where all weights of the tail are alike, or where most of
        them are 0 beside the largest.

    References
    ----------
    Vehtari et al. (2024), Journal of Machine Learning Research 25(72), section 3.2.
    """
    from arviz_stats.base import array_stats  # loads scipy.signal

    weights = np.asarray(log_weights, dtype=float)
    with np.errstate(all="ignore"):  # weights that underflow have no shape, and say so
        try:
            # It takes log-likelihoods: what it weighs by is minus its argument.
            smoothed, shape = array_stats.psislw(-weights, r_eff=reff)
        except ValueError as error:
            if "tail" not in str(error):  # all alike, or under five
                raise
            return weights - logsumexp(weights), math.inf
        if np.isnan(shape) or np.isnan(smoothed).any():
            # Beside the largest weight the tail underflows. Its shape is NaN or came out as near 0.
            return weights - logsumexp(weights), math.inf
    return np.asarray(smoothed), float(shape)
