r"""Normals that stand for rows of which an interval is known, given what all else says.

A row ``low < f + e <= high``, its own error e normal, is no normal in its offset f: a wide interval
is flat inside. Expectation propagation takes the normal that, beside what all else says of f (the
*cavity*), leaves f the mean and variance that the row itself would leave it. With Z the interval's
probability, g the gradient of log Z by the cavity's mean and H less its Hessian, the row leaves the
mean ``m + V g`` and the variance ``V - V H V``: Minka (2001), Expectation propagation for
approximate Bayesian inference, section 3.
"""

from typing import NamedTuple

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.model.tails import NormalTail

_NARROW = 1e-4  # widths in sds up to which an interval is its middle: off by the width's square
_LEAST = 1e-10  # least curvature, in units of the largest that there can be
_APART = 0.1  # least width in sds of an interval between ends that offsets move apart
_HALF_LOG_2PI = 0.5 * np.log(2 * np.pi)


class IntervalSites(NamedTuple):
    """Normals that stand for intervals, and what these say of the rows' own errors.

    Parameters
    ----------
    mean, precision : ndarray of float
        Of the normals.
    error_square : ndarray of float
        Square of the own error's mean given the interval.
    error_share : ndarray of float
        Its variance given the interval, over that before.
    """

    mean: FloatArray
    precision: FloatArray
    error_square: FloatArray
    error_share: FloatArray


def interval_sites(
    low: FloatArray, high: FloatArray, mean: FloatArray, variance: FloatArray, own: FloatArray
) -> IntervalSites:
    """Return the normals that stand for intervals.

    Parameters
    ----------
    low, high : ndarray of float
        Ends; one may be infinite.
    mean, variance : ndarray of float
        Of the offset by the cavity.
    own : ndarray of float
        Variance of the row's own error.
    """
    total = variance + own
    sd = np.sqrt(total)
    a, b = (low - mean) / sd, (high - mean) / sd
    narrow = b - a < _NARROW
    at_low, at_high = _densities(a, b)
    slope = np.where(narrow, 0.5 * (a + b), at_low - at_high)
    turn = np.where(at_high > 0, b, 0.0) * at_high - np.where(at_low > 0, a, 0.0) * at_low
    curvature = np.clip(np.where(narrow, 1.0, slope * slope + turn), _LEAST, 1.0)
    g, h = slope / sd, curvature / total
    return IntervalSites(mean + g / h, h / (1 - variance * h), (own * g) ** 2, 1 - own * h)


def count_sites(
    low: FloatArray,
    high: FloatArray,
    mean: FloatArray,
    covariance: FloatArray,
    own: FloatArray,
) -> IntervalSites:
    """Return the normals for rows ``low - f' < e <= high - f``, two for each: of f and of f'.

    Parameters
    ----------
    low, high : ndarray of float, shape (..., n)
        Finite ends.
    mean : ndarray of float, shape (2, ..., n)
        Of f and f' by the cavity.
    covariance : ndarray of float, shape (3, ..., n)
        Variances of f and f', and their covariance.
    own : ndarray of float, shape (..., n)
        Variance of the row's own error.

    Returns
    -------
    IntervalSites
        Mean and precision of shape (2, ..., n). The two are independent: what the row says of both
        at once is left out, which counts where its interval is narrow.

    Notes
    -----
    The expectation of a difference of two probabilities is that of each, whatever f and f' have in
    common. Where the means turn the ends round, the lower is put just below the upper.
    """
    v, w, c = covariance
    s, t = np.sqrt(v + own), np.sqrt(w + own)
    b, a = (high - mean[0]) / s, (low - mean[1]) / t
    a = np.minimum(a, b - _APART)
    at_low, at_high = _densities(a, b)
    g = np.stack([-at_high / s, at_low / t])
    h, k = g[0] ** 2 + b * at_high / s**2, g[1] ** 2 - a * at_low / t**2
    both = g[0] * g[1]
    h, k = np.clip(h, _LEAST / s**2, 1 / s**2), np.clip(k, _LEAST / t**2, 1 / t**2)
    vh, vk, wh, wk = v * h + c * both, v * both + c * k, c * h + w * both, c * both + w * k
    det = np.maximum((1 - vh) * (1 - wk) - vk * wh, _LEAST)
    precision = np.stack([h * (1 - wk) + both * wh, both * vk + k * (1 - vh)]) / det
    precision = np.maximum(precision, np.stack([_LEAST / s**2, _LEAST / t**2]))
    after = mean + covariance[:2] * g + c * g[::-1]
    share = np.clip(1 - own * (h + k + 2 * both), 0, 1)
    return IntervalSites(after + g / precision, precision, (own * g.sum(axis=0)) ** 2, share)


def _densities(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the standard normal's densities at both ends, over the probability between them."""
    log_z = NormalTail().log_probability(a, b, None)
    at_low, at_high = (np.exp(-0.5 * x * x - _HALF_LOG_2PI - log_z) for x in (a, b))
    return at_low, at_high
