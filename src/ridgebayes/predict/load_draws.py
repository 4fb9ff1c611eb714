"""Draws of log loads, made column by column, and the averages of distributions over them."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import ndtr, ndtri

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.model.tails import NormalTail, StudentTail

_LARGEST_LOG = 800.0

Columns = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class LoadDraws:
    """Draws of loads whose logarithms are normal, Student, or points, at a number of places.

    They are made column by column: those of a million places fit no memory.

    Parameters
    ----------
    weight : ndarray of float, shape (n_draw,)
        Weights, sum 1.
    df : ndarray of float, shape (n_draw,), or None
        Degrees of freedom of each draw's Student errors, infinite for normal ones; all are normal
        if not given.
    columns : callable
        From column numbers, shape (n,), to centre and scale of log(p/E), both (n_draw, n), which
        the methods take as `mean` and `sd`; a scale of 0 is a point.
    """

    weight: FloatArray
    df: FloatArray | None
    columns: Callable[[IntArray], Columns]

    @classmethod
    def stored(
        cls, log_mean: FloatArray, sd: FloatArray, weight: FloatArray, df: FloatArray | None
    ) -> "LoadDraws":
        """Return draws that are there as arrays, both (n_draw, n_column)."""
        return cls(weight, df, partial(_stored, log_mean, sd))

    @classmethod
    def joined(cls, parts: Iterable[tuple["LoadDraws", float]]) -> "LoadDraws":
        """Return the draws of several, of the same columns, below each other, with their shares."""
        draws, shares = zip(*parts, strict=True)
        weight = np.concatenate([one.weight * w for one, w in zip(draws, shares, strict=True)])
        df = None
        if any(one.df is not None for one in draws):
            normal = [np.full(len(one.weight), np.inf) for one in draws]
            df = np.concatenate(
                [no if d.df is None else d.df for d, no in zip(draws, normal, strict=True)]
            )
        return cls(weight, df, partial(_joined, [one.columns for one in draws]))

    def placed(self, place: IntArray) -> "LoadDraws":
        """Return the draws with a column for each place instead of shared ones."""
        return replace(self, columns=partial(_placed, self.columns, place))

    def widened(self, rel_se: FloatArray) -> "LoadDraws":
        """Return the draws with a relative standard error of each column added in quadrature."""
        return replace(self, columns=partial(_widened, self.columns, rel_se))

    def cdf(self, y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return the probability of log loads up to y, shape (n,)."""
        return self._average(np.where(sd > 0, self._by_tail("cdf", _z(y, mean, sd)), mean <= y))

    def sf(self, y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return the probability of log loads above y, shape (n,), to rounding in both tails."""
        return self._average(np.where(sd > 0, self._by_tail("cdf", -_z(y, mean, sd)), mean > y))

    def density(self, y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return the density of log loads at y, shape (n,); points have none."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            of_z = np.exp(self._by_tail("log_density", _z(y, mean, sd)))
            return self._average(np.where(sd > 0, of_z / sd, 0.0))

    def moments(self, mean: FloatArray, sd: FloatArray) -> Columns:
        """Return mean and standard deviation of loads, both (n,); infinite under Student errors."""
        with np.errstate(over="ignore", invalid="ignore"):
            means = np.exp(mean + 0.5 * sd**2)
            variances = means**2 * np.expm1(sd**2)
            if self.df is not None:
                wide = np.isfinite(self.df)[:, None] & (sd > 0)
                means, variances = (np.where(wide, np.inf, x) for x in (means, variances))
            total = self._average(means)
            finite = np.isfinite(total)
            spread = self._average(variances + np.where(finite, means - total, 0.0) ** 2)
        return total, np.where(finite, np.sqrt(spread), np.inf)

    def quantile(self, prob: float, mean: FloatArray, sd: FloatArray) -> FloatArray:
        """Return the loads under which a share lies, shape (n,)."""
        if not sd.any():
            least = max(prob - 1e-12, 0.0)
            return np.exp(
                np.quantile(mean, least, axis=0, weights=self.weight, method="inverted_cdf")
            )
        with np.errstate(over="ignore"):
            return np.exp(self._solve(mean, sd, prob))

    def _solve(self, log_mean: FloatArray, sd: FloatArray, prob: float) -> FloatArray:
        """Newton's method on the distribution function, kept inside a shrinking bracket."""
        # Infinite loads, of draws that reach no further ridge, have a share but no place.
        finite = np.isfinite(log_mean)
        mean = np.where(finite, log_mean, 0.0)
        share = np.maximum(self._average(finite.astype(float)), 1e-300)
        reached = prob / share < 1 - 5e-13
        # Beyond e^800 there are no floats: such loads are 0 or infinite.
        high = np.where(reached, _LARGEST_LOG, 0.0)
        low = -high
        centre = self._average(mean) / share
        variance = self._average(np.where(finite, (mean - centre) ** 2 + sd**2, 0.0)) / share
        y = np.clip(centre + ndtri(prob) * np.sqrt(variance), low, high)
        for _ in range(100):
            found = self.cdf(y, log_mean, sd)
            excess = found - prob
            low, high = np.where(excess < 0, y, low), np.where(excess >= 0, y, high)
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                # In its lower tail a distribution function is nearly exponential.
                step = found * np.log(found / prob) if prob < 0.5 else excess
                newton = y - step / self.density(y, log_mean, sd)
            inside = (newton >= low) & (newton <= high)
            new = np.where(inside, newton, 0.5 * (low + high))
            settled = np.abs(new - y)[reached].max(initial=0.0) < 1e-10
            y = new
            if settled:
                break
        return np.where(reached, y, np.inf)

    def _average(self, values: FloatArray) -> FloatArray:
        return np.tensordot(self.weight, values, axes=1)

    def _by_tail(self, method: str, z: FloatArray) -> FloatArray:
        """Apply a method of `Tail` to standardised errors, to the draws of each tail its own."""
        if self.df is None:
            return ndtr(z) if method == "cdf" else NormalTail().log_density(z, None)
        value, student = np.empty(z.shape), np.isfinite(self.df)
        value[~student] = getattr(NormalTail(), method)(z[~student], None)
        value[student] = getattr(StudentTail(), method)(z[student], self.df[student, None])
        return value


def _z(y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore", invalid="ignore"):
        return (y - mean) / sd


def _stored(log_mean: FloatArray, sd: FloatArray, ids: IntArray) -> Columns:
    return log_mean[:, ids], sd[:, ids]


def _placed(columns: Callable[[IntArray], Columns], place: IntArray, ids: IntArray) -> Columns:
    return columns(place[ids])


def _widened(columns: Callable[[IntArray], Columns], rel_se: FloatArray, ids: IntArray) -> Columns:
    mean, sd = columns(ids)
    return mean, np.hypot(sd, rel_se[ids])


def _joined(parts: Sequence[Callable[[IntArray], Columns]], ids: IntArray) -> Columns:
    """Return the columns of several draws below each other."""
    means, sds = zip(*(columns(ids) for columns in parts), strict=True)
    return np.concatenate(means), np.concatenate(sds)
