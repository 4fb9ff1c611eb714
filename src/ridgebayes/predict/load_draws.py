"""Distributions of loads over draws, given arrays of the mean and sd of the log load of each draw.

Given a draw, the log load is normal, or a point where the sd is 0. The average over draws is the
predictive distribution of the load, and at the counts 4, 6, ... that of Q.
"""

from collections.abc import Callable

import numpy as np
from scipy.constants import golden
from scipy.interpolate import PchipInterpolator
from scipy.optimize import elementwise
from scipy.special import ndtr, ndtri

from ridgebayes._types import BATCH_SIZE, FloatArray, IntArray
from ridgebayes.errors import InputError

NEGLIGIBLE_PROBABILITY = 1e-6  # larger counts are left out once P(Q >= n) is below it
MAX_Q = 20_000  # larger counts raise an error
# Number of standard deviations beyond which a normal distribution function rounds to 0 or 1.
_MAX_Z = -ndtri(np.finfo(float).epsneg)
# The interpolation error of 256 nodes is at most a tenth of the Monte Carlo error.
_N_NODE = 256
MAX_DRAWS_TIMES_ROWS = 64 * BATCH_SIZE  # limits memory; more rows get fewer draws

Columns = tuple[FloatArray, FloatArray]  # mean and sd of the log load, both (n_draw, n)


def cdf(y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
    """Return the probability of log loads up to y, shape (n,), given each draw, (n_draw, n)."""
    return np.where(sd > 0, ndtr(_z(y, mean, sd)), mean <= y)


def sf(y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
    """Return the probability of log loads above y given each draw, accurate in both tails."""
    return np.where(sd > 0, ndtr(-_z(y, mean, sd)), mean > y)


def density(y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
    """Return the density of log loads at y given each draw, which is 0 for points."""
    z = _z(y, mean, sd)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.where(sd > 0, np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi) / sd, 0.0)


def average(values: FloatArray, weight: FloatArray) -> FloatArray:
    """Return the average over draws, shape (n,)."""
    return np.asarray(np.tensordot(weight, values, axes=1))


def moments(mean: FloatArray, sd: FloatArray, weight: FloatArray) -> Columns:
    """Return mean and standard deviation of loads, both (n,); infinite if they do not exist."""
    with np.errstate(over="ignore", invalid="ignore"):
        means = np.exp(mean + 0.5 * sd**2)
        total = average(means, weight)
        finite = np.isfinite(total)
        deviation = np.where(finite, means - total, 0.0)
        variance = average(means**2 * np.expm1(sd**2) + deviation**2, weight)
    return total, np.where(finite, np.sqrt(variance), np.inf)


def quantile(prob: FloatArray, mean: FloatArray, sd: FloatArray, weight: FloatArray) -> FloatArray:
    """Return load quantiles, shape (n,) as `prob`; infinite if too few draws reach the count."""
    if not sd.any():
        order = np.argsort(mean, axis=0)
        is_enough = np.cumsum(weight[order], axis=0) >= prob - 1e-12
        first = np.take_along_axis(order, is_enough.argmax(axis=0, keepdims=True), axis=0)
        return np.asarray(np.exp(np.take_along_axis(mean, first, axis=0)[0]))
    finite = np.isfinite(mean)
    share = average(finite.astype(float), weight)
    reached = np.flatnonzero(prob < share * (1 - 5e-13))
    mean, sd, finite, prob = mean[:, reached], sd[:, reached], finite[:, reached], prob[reached]
    # Up to rounding, the quantile of a mixture lies between the quantiles of its components.
    ends = mean + ndtri(prob / share[reached]) * sd
    slack = 1e-6 * sd + 4 * np.spacing(np.where(finite, np.abs(ends), 1.0))
    low = np.where(finite, ends - slack, np.inf).min(axis=0)
    high = np.where(finite, ends + slack, -np.inf).max(axis=0)

    def excess(y: FloatArray, i: IntArray) -> FloatArray:
        return average(cdf(y, mean[:, i], sd[:, i]), weight) - prob[i]

    root = elementwise.find_root(excess, (low, high), args=(np.arange(len(reached)),))
    value = np.full(len(share), np.inf)
    with np.errstate(over="ignore"):
        value[reached] = np.exp(root.x)
    return value


def survival(columns: Callable[[IntArray], Columns], y: FloatArray, where: str = "") -> FloatArray:
    """Return P(Q >= 2), P(Q >= 4), ... at log loads, averaged over draws of equal weight.

    Parameters
    ----------
    columns : callable
        Function of count numbers i, shape (n,), that returns mean and sd of the log load at which
        each draw reaches the count 4 + 2 i, both (n_draw, n).
    y : ndarray of float, shape (n,)
        Log loads, or loads if the columns contain loads instead of log loads.
    where : str, optional
        Description of the texture for the error message.

    Returns
    -------
    ndarray of float, shape (n, n_step)
        Probabilities up to the first count that is negligible at all loads.

    Raises
    ------
    InputError
        If counts exceed 20,000.
    """
    steps = [np.ones(len(y))]
    n = 0
    while (first := len(steps) - 1) < MAX_Q // 2:
        n += 1  # more counts in each call, as a call takes longer than the arithmetic of a count
        for mean, sd in zip(*(x.T for x in columns(np.arange(first, first + n))), strict=True):
            # The probability of reaching a ridge cannot exceed that of the ridge before it.
            steps.append(np.minimum(_interpolated_cdf(y, mean, sd), steps[-1]))
            if steps[-1].max(initial=0.0) < NEGLIGIBLE_PROBABILITY:
                return np.stack(steps, axis=-1)
    raise InputError(f"p_over_E: expected counts up to {MAX_Q}, got more{where}")


def _interpolated_cdf(y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
    """Return the mean probability of log loads up to each y, shape (n,); mean and sd are (n_draw,).

    Many loads are interpolated from a table.
    """
    n_draw, finite = len(mean), np.flatnonzero(np.isfinite(mean))
    if not sd[finite].any():
        return np.searchsorted(np.sort(mean[finite]), y, side="right") / n_draw
    mean, sd = mean[finite], sd[finite]
    low, high = (mean - _MAX_Z * sd).min(), (mean + _MAX_Z * sd).max()
    n_between = np.count_nonzero((y > low) & (y < high))
    if not n_between:  # as at loads far above those of a count, for thousands of counts
        return np.where(y < high, 0.0, len(mean) / n_draw)
    order = np.argsort(sd)
    mean, sd = mean[order], sd[order]
    if n_between <= 2 * _N_NODE:
        return _sum_of_cdfs(y, mean, sd) / n_draw
    # Nodes are quantiles of evenly spread scores of all draws, so that they follow the cdf.
    i = np.arange(16 * _N_NODE)
    draw = i * len(mean) // len(i)
    close = np.sort(mean[draw] + _MAX_Z * (2 * (i / golden % 1) - 1) * sd[draw])
    nodes = np.unique([low, *close[:: len(i) // _N_NODE], high])
    table = PchipInterpolator(nodes, _sum_of_cdfs(nodes, mean, sd) / n_draw)
    return np.asarray(table(np.clip(y, nodes[0], nodes[-1])))


def _sum_of_cdfs(y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
    """Return the sum of normal distribution functions at each y, shape (n,).

    Draws must be sorted by sd. Each block then spans a short range of loads, outside of which its
    distribution functions are 0 or 1 and need not be computed.
    """
    total = np.zeros(len(y))
    for block in np.array_split(np.arange(len(mean)), -(-len(mean) // _N_NODE)):
        m, s = mean[block], sd[block]
        total[y > (m + _MAX_Z * s).max()] += len(m)
        here = np.flatnonzero((y >= (m - _MAX_Z * s).min()) & (y <= (m + _MAX_Z * s).max()))
        total[here] += ndtr((y[here, None] - m) / s).sum(axis=1)
    return total


def _z(y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore", invalid="ignore"):
        return (y - mean) / sd
