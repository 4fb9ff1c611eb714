r"""Normals that stand for rows of which an interval is known, given what all else says.

A row ``low < f + e <= high``, its own error e normal, is no normal in its offset f: a wide interval
is flat inside. Expectation propagation takes the normal that, beside what all else says of f (the
*cavity*), leaves f the mean and variance that the row itself would leave it.
"""

from typing import NamedTuple

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.model.tails import NormalTail

_NARROW = 1e-4  # widths in sds up to which an interval is its middle: off by the width's square
_LEAST = 1e-10  # least curvature, in units of the largest that there can be
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
    r"""Return the normals that stand for intervals.

    Parameters
    ----------
    low, high : ndarray of float
        Ends; one may be infinite.
    mean, variance : ndarray of float
        Of the offset by the cavity.
    own : ndarray of float
        Variance of the row's own error.

    Notes
    -----
    With Z the interval's probability, g the first and -h the second derivative of log Z by the
    cavity's mean, the normal has the mean ``mean + g / h`` and the precision
    ``h / (1 - variance h)``: Minka (2001), Expectation propagation for approximate Bayesian
    inference, section 3.
    """
    total = variance + own
    sd = np.sqrt(total)
    a, b = (low - mean) / sd, (high - mean) / sd
    narrow = b - a < _NARROW
    log_z = NormalTail().log_probability(a, b, None)
    at_low, at_high = (np.exp(-0.5 * x * x - _HALF_LOG_2PI - log_z) for x in (a, b))
    slope = np.where(narrow, 0.5 * (a + b), at_low - at_high)
    turn = np.where(at_high > 0, b, 0.0) * at_high - np.where(at_low > 0, a, 0.0) * at_low
    curvature = np.clip(np.where(narrow, 1.0, slope * slope + turn), _LEAST, 1.0)
    g, h = slope / sd, curvature / total
    return IntervalSites(mean + g / h, h / (1 - variance * h), (own * g) ** 2, 1 - own * h)
