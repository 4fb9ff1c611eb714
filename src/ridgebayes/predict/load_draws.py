"""Draws of log loads and averages of their distributions over the draws.

Given a draw, the log load is normal, or exact (a point). The average over draws is the predictive
distribution of the load. If the columns belong to the counts 4, 6, ..., the average also gives the
distribution of Q.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.constants import golden
from scipy.interpolate import PchipInterpolator
from scipy.optimize import elementwise
from scipy.special import ndtr, ndtri

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError

NEGLIGIBLE_PROBABILITY = 1e-6  # larger counts are left out once P(Q >= n) is below it
MAX_Q = 20_000  # larger counts raise an error
# Number of standard deviations beyond which a normal distribution function rounds to 0 or 1.
_MAX_Z = -ndtri(np.finfo(float).epsneg)
# The interpolation error of 256 nodes is at most a tenth of the Monte Carlo error.
_N_NODE = 256
COUNTS_PER_BLOCK = 8  # counts computed together, until they are negligible
_MIN_BLOCKS = 8  # of draws with similar sd, see `_mean_cdf`
NUMBERS_AT_ONCE = 2**19  # draws times loads or places in one block: arrays of 4 MB
MAX_DRAWS_TIMES_ROWS = 32 * NUMBERS_AT_ONCE  # limits memory; more rows get fewer draws
_LOG_QUANTILE_TOL = 1e-10  # absolute

Columns = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class LoadDraws:
    """Draws of loads at a number of places; given a draw, the log load is normal or a point.

    Columns are computed when needed, because those of a million places do not fit into memory.

    Parameters
    ----------
    weight : ndarray of float, shape (n_draw,)
        Weights of the draws, with sum 1.
    columns : callable
        Function of column numbers, shape (n,), that returns mean and standard deviation of
        log(p/E), both of shape (n_draw, n). The methods take them as `mean` and `sd`. A standard
        deviation of 0 is a point.
    has_mean : bool, optional
        Whether the mean load is finite; under Student errors it is not.
    """

    weight: FloatArray
    columns: Callable[[IntArray], Columns]
    has_mean: bool = True

    @classmethod
    def uniform(cls, n: int, columns: Callable[[IntArray], Columns], has_mean: bool) -> "LoadDraws":
        """Return n draws of equal weight."""
        return cls(np.full(n, 1 / n), columns, has_mean)

    @classmethod
    def joined(cls, parts: Iterable[tuple["LoadDraws", float]]) -> "LoadDraws":
        """Concatenate draws at the same places, each part weighted by its share."""
        draws, shares = zip(*parts, strict=True)
        weight = np.concatenate([part.weight * w for part, w in zip(draws, shares, strict=True)])
        columns = partial(_joined, [part.columns for part in draws])
        return cls(weight, columns, all(part.has_mean for part in draws))

    def stored(self, n: int) -> "LoadDraws":
        """Return the draws with the first n columns computed and stored."""
        return replace(self, columns=partial(_stored, *self.columns(np.arange(n))))

    def placed(self, place: IntArray) -> "LoadDraws":
        """Return the draws with one column for each place, given the shared column of each."""
        return replace(self, columns=partial(_placed, self.columns, place))

    def shifted(self, log_factor: FloatArray) -> "LoadDraws":
        """Return the draws with all loads of a draw multiplied by its factor, shape (n_draw,)."""
        return replace(self, columns=partial(_shifted, self.columns, log_factor))

    def widened(self, rel_se: FloatArray) -> "LoadDraws":
        """Return the draws with the relative standard error of each column added in quadrature."""
        return replace(self, columns=partial(_widened, self.columns, rel_se))

    def cdf(self, y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return the probability of log loads up to y, shape (n,)."""
        return self._average(np.where(sd > 0, ndtr(_z(y, mean, sd)), mean <= y))

    def sf(self, y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return the probability of log loads above y, shape (n,), accurate in both tails."""
        return self._average(np.where(sd > 0, ndtr(-_z(y, mean, sd)), mean > y))

    def density(self, y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return the density of log loads at y, shape (n,); points contribute 0."""
        z = _z(y, mean, sd)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            normal = np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi)
            return self._average(np.where(sd > 0, normal / sd, 0.0))

    def moments(self, mean: FloatArray, sd: FloatArray) -> Columns:
        """Return mean and standard deviation of loads, both (n,); infinite if they do not exist."""
        if not self.has_mean:
            return np.full(mean.shape[1], np.inf), np.full(mean.shape[1], np.inf)
        with np.errstate(over="ignore", invalid="ignore"):
            means = np.exp(mean + 0.5 * sd**2)
            total = self._average(means)
            finite = np.isfinite(total)
            deviation = np.where(finite, means - total, 0.0)
            variance = self._average(means**2 * np.expm1(sd**2) + deviation**2)
        return total, np.where(finite, np.sqrt(variance), np.inf)

    def quantile(self, prob: float, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return load quantiles, shape (n,); infinite if too few draws reach the count."""
        if not sd.any():
            level = max(prob - 1e-12, 0.0)
            points = np.quantile(mean, level, axis=0, weights=self.weight, method="inverted_cdf")
            return np.exp(points)
        finite = np.isfinite(mean)
        share = self._average(finite.astype(float))
        reached = np.flatnonzero(prob < share * (1 - 5e-13))
        mean, sd, finite = mean[:, reached], sd[:, reached], finite[:, reached]
        # Up to rounding, the quantile of a mixture lies between the quantiles of its components.
        ends = mean + ndtri(prob / share[reached]) * sd
        slack = 1e-6 * sd + 4 * np.spacing(np.where(finite, np.abs(ends), 1.0))
        low = np.where(finite, ends - slack, np.inf).min(axis=0)
        high = np.where(finite, ends + slack, -np.inf).max(axis=0)

        def excess(y: FloatArray, i: IntArray) -> FloatArray:
            return self.cdf(y, mean[:, i], sd[:, i]) - prob

        places, tolerances = np.arange(len(reached)), {"xatol": _LOG_QUANTILE_TOL, "xrtol": 0.0}
        root = elementwise.find_root(excess, (low, high), args=(places,), tolerances=tolerances)
        value = np.full(len(share), np.inf)
        with np.errstate(over="ignore"):
            value[reached] = np.exp(root.x)
        return value

    def reaching(self, y: FloatArray, last: int = MAX_Q, where: str = "") -> FloatArray:
        """Return P(Q >= 2), P(Q >= 4), ... at log loads, given columns of the counts 4, 6, ...

        Parameters
        ----------
        y : ndarray of float, shape (n,)
            Log loads, or loads if the columns contain loads instead of log loads.
        last : int, optional
            Largest count that the body can have.
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
        survival = [np.ones(len(y))]
        for first in range(4, last + 2, 2 * COUNTS_PER_BLOCK):
            counts = np.arange(first, min(first + 2 * COUNTS_PER_BLOCK, last + 2), 2)
            mean, sd = self.columns(counts // 2 - 2)
            for j in range(len(counts)):
                # The probability of reaching a ridge cannot exceed that of the ridge before it.
                survival.append(np.minimum(self._cdf_of(y, mean[:, j], sd[:, j]), survival[-1]))
                if survival[-1].max() < NEGLIGIBLE_PROBABILITY:
                    return np.stack(survival, axis=-1)
        if last < MAX_Q:
            return np.stack(survival, axis=-1)
        raise InputError(f"p_over_E: expected counts up to {MAX_Q}, got more{where}")

    def _cdf_of(self, y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return the probability of log loads up to each y, shape (n,), for one column.

        Many loads are interpolated from a table.
        """
        finite = np.flatnonzero(np.isfinite(mean))
        if not sd[finite].any():
            order = finite[np.argsort(mean[finite])]
            total = np.append(0.0, np.cumsum(self.weight[order]))
            return total[np.searchsorted(mean[order], y, side="right")]
        order = finite[np.argsort(sd[finite])]
        mean, sd, weight = mean[order], sd[order], self.weight[order]
        low, high = (mean - _MAX_Z * sd).min(), (mean + _MAX_Z * sd).max()
        if np.count_nonzero((y > low) & (y < high)) <= 2 * _N_NODE:
            return _mean_cdf(y, mean, sd, weight)
        # Nodes are quantiles of evenly spread scores of all draws, so that they follow the cdf.
        i = np.arange(16 * _N_NODE)
        draw = i * len(mean) // len(i)
        close = np.sort(mean[draw] + _MAX_Z * (2 * (i / golden % 1) - 1) * sd[draw])
        nodes = np.unique([low, *close[:: len(i) // _N_NODE], high])
        table = PchipInterpolator(nodes, _mean_cdf(nodes, mean, sd, weight))
        return np.asarray(table(np.clip(y, nodes[0], nodes[-1])))

    def _average(self, values: FloatArray) -> FloatArray:
        return np.tensordot(self.weight, values, axes=1)


def _mean_cdf(y: FloatArray, mean: FloatArray, sd: FloatArray, weight: FloatArray) -> FloatArray:
    """Return the average of normal distribution functions at each y, shape (n,).

    Draws must be sorted by sd. Each block then spans a short range of loads, outside of which its
    distribution functions are 0 or 1 and need not be computed.
    """
    value = np.zeros(len(y))
    n_block = max(-(-len(y) * len(mean) // NUMBERS_AT_ONCE), _MIN_BLOCKS)
    for block in np.array_split(np.arange(len(mean)), min(n_block, len(mean))):
        m, s, w = mean[block], sd[block], weight[block]
        low, high = (m - _MAX_Z * s).min(), (m + _MAX_Z * s).max()
        value[y > high] += w.sum()
        here = np.flatnonzero((y >= low) & (y <= high))
        value[here] += (ndtr((y[here, None] - m) / s) * w).sum(axis=1)
    return value


def _z(y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore", invalid="ignore"):
        return (y - mean) / sd


def _stored(log_mean: FloatArray, sd: FloatArray, ids: IntArray) -> Columns:
    return log_mean[:, ids], sd[:, ids]


def _placed(columns: Callable[[IntArray], Columns], place: IntArray, ids: IntArray) -> Columns:
    return columns(place[ids])


def _shifted(
    columns: Callable[[IntArray], Columns], log_factor: FloatArray, ids: IntArray
) -> Columns:
    mean, sd = columns(ids)
    return mean + log_factor[:, None], sd


def _widened(columns: Callable[[IntArray], Columns], rel_se: FloatArray, ids: IntArray) -> Columns:
    mean, sd = columns(ids)
    return mean, np.hypot(sd, rel_se[ids])


def _joined(parts: Sequence[Callable[[IntArray], Columns]], ids: IntArray) -> Columns:
    """Return the concatenated columns of several sets of draws."""
    means, sds = zip(*(columns(ids) for columns in parts), strict=True)
    return np.concatenate(means), np.concatenate(sds)
