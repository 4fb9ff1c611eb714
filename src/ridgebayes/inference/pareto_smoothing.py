"""Importance weights whose tail is smoothed, and whether they can be trusted."""

import math

import numpy as np
from scipy.special import logsumexp

from ridgebayes._types import FloatArray

K_MAX = 0.7  # Pareto shape of weights above which their mean is not to be trusted
_LEAST_TAIL = 5  # weights that a Pareto's shape is told from
_SMALLEST = math.log(np.finfo(float).tiny)


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
        As `pareto_k` returns it; infinite where hardly a weight is larger than the others.

    References
    ----------
    Vehtari et al. (2024), Journal of Machine Learning Research 25(72), section 3.2.
    """
    x = np.asarray(log_weights, dtype=float) - np.max(log_weights)
    n_tail = math.ceil(min(len(x) / 5, 3 * math.sqrt(len(x) / reff)))
    threshold = max(float(np.sort(x)[-n_tail - 1]), _SMALLEST)
    tail = np.flatnonzero(x > threshold)
    if len(tail) < _LEAST_TAIL:
        return x - logsumexp(x), math.inf
    tail = tail[np.argsort(x[tail])]
    excess = np.exp(x[tail]) - math.exp(threshold)
    with np.errstate(all="ignore"):  # a tail of equal weights has no shape
        shape, scale = _fitted_pareto(excess)
    if math.isfinite(shape):
        log_beyond = np.log1p(-np.arange(0.5, len(tail)) / len(tail))
        near = abs(shape) < np.finfo(float).eps
        unit = -log_beyond if near else np.expm1(-shape * log_beyond) / shape
        x[tail] = np.minimum(np.log(scale * unit + math.exp(threshold)), 0.0)
    return x - logsumexp(x), shape


def _fitted_pareto(x: FloatArray) -> tuple[float, float]:
    """Return shape and scale of a generalised Pareto of sorted values.

    The posterior mean over a grid (Zhang & Stephens 2009, doi:10.1198/tech.2009.08017), and the
    shape drawn to 0.5 by a prior worth ten values (Vehtari et al., appendix G).
    """
    n = len(x)
    n_grid = 30 + int(math.sqrt(n))
    b = 1 - np.sqrt(n_grid / (np.arange(1, n_grid + 1) - 0.5))
    b = b / (3 * x[int(n / 4 + 0.5) - 1]) + 1 / x[-1]
    k = np.log1p(-b[:, None] * x).mean(axis=1)
    log_likelihood = n * (np.log(-b / k) - k - 1)
    weight = np.exp(log_likelihood - logsumexp(log_likelihood))
    mean = float(b @ weight)
    shape = float(np.log1p(-mean * x).mean())
    return (n * shape + 5) / (n + 10), -shape / mean
