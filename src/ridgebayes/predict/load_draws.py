"""Draws of log loads, made column by column, and the averages of distributions over them.

Given a draw, the log of a load is normal, or a point. An average over draws is a distribution of
the load at a place; if the columns are of the counts 4, 6, ..., it is one of Q, too.
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

NEGLIGIBLE = 1e-6  # P(Q >= n) at the highest load under which no further n is computed
LARGEST_Q = 20_000
# Standard deviations beyond which a normal distribution function is 0 or 1.
_SATURATED = -ndtri(np.finfo(float).epsneg)
_N_NODE = 256  # of a table: its error is a tenth of that of the number of draws at most
COUNTS_AT_ONCE = 8
_N_PART = 8  # of draws, by their sd
NUMBERS_AT_ONCE = 2**19  # draws times loads or places, which bounds memory: 4 MB
MAX_DRAWS_TIMES_ROWS = 32 * NUMBERS_AT_ONCE  # limits memory: with more rows there are fewer draws
_PRECISION = 1e-10  # of the log of a quantile

Columns = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class LoadDraws:
    """Draws of loads whose logarithms are normal, or points, at a number of places.

    They are made column by column: those of a million places fit no memory.

    Parameters
    ----------
    weight : ndarray of float, shape (n_draw,)
        Weights, sum 1.
    columns : callable
        From column numbers, shape (n,), to centre and standard deviation of log(p/E), both
        (n_draw, n), which the methods take as `mean` and `sd`; an sd of 0 is a point.
    has_mean : bool, optional
        Whether loads have a mean: under Student errors, whose scales vary from draw to draw, they
        have none.
    """

    weight: FloatArray
    columns: Callable[[IntArray], Columns]
    has_mean: bool = True

    @classmethod
    def alike(cls, n: int, columns: Callable[[IntArray], Columns], has_mean: bool) -> "LoadDraws":
        """Return n draws of equal weights."""
        return cls(np.full(n, 1 / n), columns, has_mean)

    @classmethod
    def joined(cls, parts: Iterable[tuple["LoadDraws", float]]) -> "LoadDraws":
        """Return the draws of several, of the same columns, below each other, with their shares."""
        draws, shares = zip(*parts, strict=True)
        weight = np.concatenate([some.weight * w for some, w in zip(draws, shares, strict=True)])
        columns = partial(_joined, [some.columns for some in draws])
        return cls(weight, columns, all(some.has_mean for some in draws))

    def stored(self, n: int) -> "LoadDraws":
        """Return the draws with the first n columns held in memory."""
        return replace(self, columns=partial(_stored, *self.columns(np.arange(n))))

    def placed(self, place: IntArray) -> "LoadDraws":
        """Return the draws with a column for each place instead of shared ones."""
        return replace(self, columns=partial(_placed, self.columns, place))

    def shifted(self, log_factor: FloatArray) -> "LoadDraws":
        """Return the draws of loads times a factor of each draw, whose log is shape (n_draw,)."""
        return replace(self, columns=partial(_shifted, self.columns, log_factor))

    def widened(self, rel_se: FloatArray) -> "LoadDraws":
        """Return the draws with a relative standard error of each column added in quadrature."""
        return replace(self, columns=partial(_widened, self.columns, rel_se))

    def cdf(self, y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return the probability of log loads up to y, shape (n,)."""
        return self._average(np.where(sd > 0, ndtr(_z(y, mean, sd)), mean <= y))

    def sf(self, y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return the probability of log loads above y, shape (n,), to rounding in both tails."""
        return self._average(np.where(sd > 0, ndtr(-_z(y, mean, sd)), mean > y))

    def density(self, y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return the density of log loads at y, shape (n,); points have none."""
        z = _z(y, mean, sd)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            normal = np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi)
            return self._average(np.where(sd > 0, normal / sd, 0.0))

    def moments(self, mean: FloatArray, sd: FloatArray) -> Columns:
        """Return mean and standard deviation of loads, both (n,), infinite where there is none."""
        if not self.has_mean:
            return np.full(mean.shape[1], np.inf), np.full(mean.shape[1], np.inf)
        with np.errstate(over="ignore", invalid="ignore"):
            means = np.exp(mean + 0.5 * sd**2)
            total = self._average(means)
            finite = np.isfinite(total)
            apart = np.where(finite, means - total, 0.0)
            spread = self._average(means**2 * np.expm1(sd**2) + apart**2)
        return total, np.where(finite, np.sqrt(spread), np.inf)

    def quantile(self, prob: float, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return the loads under which a share lies, shape (n,), infinite where none is reached."""
        if not sd.any():
            least = max(prob - 1e-12, 0.0)
            points = np.quantile(mean, least, axis=0, weights=self.weight, method="inverted_cdf")
            return np.exp(points)
        finite = np.isfinite(mean)
        share = self._average(finite.astype(float))
        reached = np.flatnonzero(prob < share * (1 - 5e-13))
        mean, sd, finite = mean[:, reached], sd[:, reached], finite[:, reached]
        # The quantile of a mixture lies between those of its parts, but for rounding.
        ends = mean + ndtri(prob / share[reached]) * sd
        slack = 1e-6 * sd + 4 * np.spacing(np.where(finite, np.abs(ends), 1.0))
        low = np.where(finite, ends - slack, np.inf).min(axis=0)
        high = np.where(finite, ends + slack, -np.inf).max(axis=0)

        def excess(y: FloatArray, i: IntArray) -> FloatArray:
            return self.cdf(y, mean[:, i], sd[:, i]) - prob

        places, tolerances = np.arange(len(reached)), {"xatol": _PRECISION, "xrtol": 0.0}
        root = elementwise.find_root(excess, (low, high), args=(places,), tolerances=tolerances)
        value = np.full(len(share), np.inf)
        with np.errstate(over="ignore"):
            value[reached] = np.exp(root.x)
        return value

    def reaching(self, y: FloatArray, last: int = LARGEST_Q, where: str = "") -> FloatArray:
        """Return P(Q >= 2), P(Q >= 4), ... at log loads, of columns of the counts 4, 6, ...

        Parameters
        ----------
        y : ndarray of float, shape (n,)
            Log loads; or the loads themselves, where columns are points at these.
        last : int, optional
            Last count that a body can have.
        where : str, optional
            Where that is, for an error.

        Returns
        -------
        ndarray of float, shape (n, n_step)
            Up to the first count that is negligible at all loads.

        Raises
        ------
        InputError
            If counts pass 20,000.
        """
        shares = [np.ones(len(y))]
        for first in range(4, last + 2, 2 * COUNTS_AT_ONCE):
            counts = np.arange(first, min(first + 2 * COUNTS_AT_ONCE, last + 2), 2)
            mean, sd = self.columns(counts // 2 - 2)
            for j in range(len(counts)):
                # One noise draw cannot reach a further ridge before a nearer one.
                shares.append(np.minimum(self._shares(y, mean[:, j], sd[:, j]), shares[-1]))
                if shares[-1].max() < NEGLIGIBLE:
                    return np.stack(shares, axis=-1)
        if last < LARGEST_Q:
            return np.stack(shares, axis=-1)
        raise InputError(f"p_over_E: expected counts up to {LARGEST_Q}, got more{where}")

    def _shares(self, y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return the probability of log loads up to each y, shape (n,), of a single column."""
        finite = np.flatnonzero(np.isfinite(mean))
        if not sd[finite].any():
            order = finite[np.argsort(mean[finite])]
            total = np.append(0.0, np.cumsum(self.weight[order]))
            return total[np.searchsorted(mean[order], y, side="right")]
        order = finite[np.argsort(sd[finite])]
        mean, sd, weight = mean[order], sd[order], self.weight[order]
        low, high = (mean - _SATURATED * sd).min(), (mean + _SATURATED * sd).max()
        if np.count_nonzero((y > low) & (y < high)) <= 2 * _N_NODE:
            return _averages(y, mean, sd, weight)
        # Nodes lie as close as quantiles of the draws do, at scores spread evenly over them.
        i = np.arange(16 * _N_NODE)
        draw = i * len(mean) // len(i)
        close = np.sort(mean[draw] + _SATURATED * (2 * (i / golden % 1) - 1) * sd[draw])
        nodes = np.unique([low, *close[:: len(i) // _N_NODE], high])
        table = PchipInterpolator(nodes, _averages(nodes, mean, sd, weight))
        return np.asarray(table(np.clip(y, nodes[0], nodes[-1])))

    def _average(self, values: FloatArray) -> FloatArray:
        return np.tensordot(self.weight, values, axes=1)


def _averages(y: FloatArray, mean: FloatArray, sd: FloatArray, weight: FloatArray) -> FloatArray:
    """Return the average of normal distribution functions at each y, shape (n,).

    Draws are in the order of their sd, so that most loads lie beyond the reach of most parts.
    """
    value = np.zeros(len(y))
    n_part = max(-(-len(y) * len(mean) // NUMBERS_AT_ONCE), _N_PART)
    for part in np.array_split(np.arange(len(mean)), min(n_part, len(mean))):
        m, s, w = mean[part], sd[part], weight[part]
        low, high = (m - _SATURATED * s).min(), (m + _SATURATED * s).max()
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
    """Return the columns of several draws below each other."""
    means, sds = zip(*(columns(ids) for columns in parts), strict=True)
    return np.concatenate(means), np.concatenate(sds)
