"""`LoadDistribution`: the distribution of the load that reaches a count."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import compress

import numpy as np
from scipy.special import ndtr, ndtri

from ridgebayes._types import BoolArray, FloatArray, IntArray, Rng
from ridgebayes.errors import InputError
from ridgebayes.model.tails import NormalTail, StudentTail
from ridgebayes.predict.extrapolation import LOAD, Flags, names_of
from ridgebayes.predict.q_distribution import heavy_parts, seeded, shares

_LARGEST_PROB = 1 - 1e-12
_LARGEST_LOG = 800.0
# Draws times columns worked on together, which bounds memory; but at least so many columns.
_AT_ONCE, _LEAST_COLUMNS = 65_536, 16

Columns = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class LoadDraws:
    """Draws of log loads, made column by column: those of a million places fit no memory.

    Parameters
    ----------
    weight : ndarray of float, shape (n_draw,)
        Weights, sum 1.
    df : ndarray of float, shape (n_draw,), or None
        Degrees of freedom of each draw's Student errors, infinite for normal ones; all are normal
        if not given.
    columns : callable
        From column numbers, shape (n,), to centre and scale of log(p/E), both (n_draw, n).
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


class LoadDistribution:
    """A mixture over posterior draws of loads whose logarithms are normal, Student, or points.

    Parameters
    ----------
    log_mean : ndarray of float, shape (n_draw, ...)
        Centre of log(p/E) given each draw.
    sd : ndarray of float, shape (n_draw,) or (n_draw, ...)
        Scale of log(p/E) given each draw; 0 for a point.
    weight : ndarray of float, shape (n_draw,)
        Weights, sum 1.
    flags : ndarray of uint8, shape (...)
        Which of texture and count lie outside what was calibrated, see `predict.extrapolation`.
    df : ndarray of float, shape (n_draw,), optional
        Degrees of freedom of each draw's Student errors, infinite for normal ones; all are normal
        if not given.

    Notes
    -----
    *Validity.* Where `extrapolation` says so, texture, count or load lie beyond what was
    calibrated; `extrapolation_of` says which.
    *Cost.* Distributions of `predict_load` make their draws when they are asked, a block of places
    at a time: a million places take some 100 MB.
    """

    def __init__(
        self,
        log_mean: FloatArray,
        sd: FloatArray,
        weight: FloatArray,
        flags: Flags,
        df: FloatArray | None = None,
    ) -> None:
        shape = log_mean.shape[1:]
        if sd.ndim < log_mean.ndim:
            sd = np.broadcast_to(sd.reshape((-1,) + (1,) * len(shape)), log_mean.shape)
        n = len(log_mean)
        self._draws = LoadDraws.stored(log_mean.reshape(n, -1), sd.reshape(n, -1), weight, df)
        self._place = np.arange(log_mean[0].size).reshape(shape)
        self._flags = np.broadcast_to(np.asarray(flags, dtype=np.uint8), shape)
        self._highest = np.full(shape, np.inf)

    @classmethod
    def of(
        cls, draws: LoadDraws, place: IntArray, flags: Flags, highest: FloatArray
    ) -> "LoadDistribution":
        """Make a distribution of draws that need not be there yet.

        Parameters
        ----------
        draws : LoadDraws
            Draws.
        place : ndarray of int, shape (...)
            Column of each place; places alike share theirs.
        flags : ndarray of uint8, shape (...)
            As above.
        highest : ndarray of float, shape (...), dimensionless
            Load p/E above which a median is an extrapolation.

        Returns
        -------
        LoadDistribution
            Of the shape of `place`.
        """
        self = cls.__new__(cls)
        self._draws, self._place, self._flags, self._highest = draws, place, flags, highest
        return self

    def __repr__(self) -> str:
        return f"LoadDistribution(shape {self._place.shape}, {len(self.weight)} draws)"

    @property
    def weight(self) -> FloatArray:
        """Weights of the draws, shape (n_draw,), sum 1."""
        return self._draws.weight

    @property
    def df(self) -> FloatArray | None:
        """Degrees of freedom of the draws' errors, shape (n_draw,); None where all are normal."""
        return self._draws.df

    @property
    def log_mean(self) -> FloatArray:
        """Centre of log(p/E) given each draw, shape (n_draw, ...), all of it in memory."""
        return self._all_columns[0]

    @property
    def sd(self) -> FloatArray:
        """Scale of log(p/E) given each draw, shape (n_draw, ...), all of it in memory."""
        return self._all_columns[1]

    @property
    def extrapolation(self) -> BoolArray:
        """Whether texture, count or median load were not calibrated, shape (...)."""
        return self._all_flags != 0

    @property
    def extrapolation_of(self) -> np.ndarray:
        """Names of what was not, of Q, load, a/pitch, a/R, b/R, texture, shape (...).

        Separated by commas; empty text where all was.
        """
        return names_of(self._all_flags)

    def cdf(self, p_over_E: float | FloatArray) -> FloatArray:
        """Return P(load <= p_over_E); no load is at or below 0.

        Parameters
        ----------
        p_over_E : array_like of float, broadcastable to (...), dimensionless
            Loads.

        Returns
        -------
        ndarray of float, shape (...), dimensionless
            Probabilities.

        Raises
        ------
        InputError
            If a load is NaN.
        """
        p = np.asarray(p_over_E, dtype=float)
        if np.any(np.isnan(p)):
            raise InputError(f"p_over_E: expected numbers, got {p_over_E!r}")
        with np.errstate(divide="ignore"):
            y = np.broadcast_to(np.log(np.maximum(p, 0)), self._place.shape).ravel()
        found = np.empty(len(y))
        for here, mean, sd in self._blocks(self._place.ravel()):
            found[here] = self._cdf(y[here], mean, sd)
        return found.reshape(self._place.shape)

    def mean(self) -> FloatArray:
        """Return the mean load p/E, shape (...); infinite under Student errors, whose tails are."""
        return self._by_column(self._mean)

    def quantile(self, prob: float) -> FloatArray:
        """Return the load under which a share `prob` lies.

        Parameters
        ----------
        prob : float, dimensionless
            Probability.

        Returns
        -------
        ndarray of float, shape (...), dimensionless
            p/E; infinite beyond floats.

        Raises
        ------
        InputError
            If `prob` is not between 0 and 1, or nearer to 1 than 1e-12, where sums over draws can
            no longer tell quantiles apart.
        """
        if not 0 < prob <= _LARGEST_PROB:
            raise InputError(f"prob: expected 0 < prob < 1, at most 1 - 1e-12, got {prob!r}")
        return self._by_column(partial(self._quantile, prob=prob))

    def median(self) -> FloatArray:
        """Return the median load p/E, shape (...)."""
        return self._median

    def interval(self, prob: float = 0.9) -> tuple[FloatArray, FloatArray]:
        """Return the equal-tailed interval of the load.

        Parameters
        ----------
        prob : float, dimensionless
            Probability.

        Returns
        -------
        lower, upper : ndarray of float, shape (...), dimensionless
            p/E.

        Raises
        ------
        InputError
            If `prob` is outside 0 to 1, or nearer to 1 than 2e-12.
        """
        if not 0 <= prob <= 2 * _LARGEST_PROB - 1:
            raise InputError(f"prob: expected 0 <= prob < 1, at most 1 - 2e-12, got {prob!r}")
        return self.quantile(0.5 - prob / 2), self.quantile(0.5 + prob / 2)

    def rvs(self, rng: Rng, size: int = 1) -> FloatArray:
        """Draw loads.

        Parameters
        ----------
        rng : int or numpy.random.Generator
            Source of randomness.
        size : int, optional
            Draws of each distribution.

        Returns
        -------
        ndarray of float, shape (size, ...), dimensionless
            p/E.
        """
        generator, shape = seeded(rng), self._place.shape
        pick = generator.choice(len(self.weight), size=size, p=self.weight)
        value = generator.standard_normal((size, *shape)).reshape(size, -1)
        if self.df is not None:
            df = self.df[pick]
            finite = np.where(np.isfinite(df), df, 1.0)
            wide = np.sqrt(finite / generator.chisquare(finite))
            value *= np.where(np.isfinite(df), wide, 1.0)[:, None]
        for here, mean, sd in self._blocks(self._place.ravel()):
            value[:, here] = np.exp(mean[pick] + sd[pick] * value[:, here])
        return value.reshape(size, *shape)

    def widened(self, rel_se: FloatArray) -> "LoadDistribution":
        """Return the distribution of loads as they would be observed.

        Parameters
        ----------
        rel_se : ndarray of float, shape (...), dimensionless
            Known relative standard error of each load, in quadrature beside the draws' scale.

        Returns
        -------
        LoadDistribution
            Of the same shape.
        """
        columns = partial(_widened, self._draws, self._place.ravel(), np.ravel(rel_se))
        draws = LoadDraws(self.weight, self.df, columns)
        place = np.arange(self._place.size).reshape(self._place.shape)
        return self.of(draws, place, self._flags, self._highest)

    @cached_property
    def _median(self) -> FloatArray:
        return self.quantile(0.5)

    @cached_property
    def _all_flags(self) -> Flags:
        if np.all(self._highest == np.inf):
            return self._flags
        return self._flags | np.where(self._median > self._highest, LOAD, 0).astype(np.uint8)

    @property
    def _all_columns(self) -> Columns:
        mean, sd = self._draws.columns(self._place.ravel())
        shape = (len(self.weight), *self._place.shape)
        return mean.reshape(shape), np.broadcast_to(sd, mean.shape).reshape(shape)

    def _blocks(self, columns: IntArray) -> Iterator[tuple[slice, FloatArray, FloatArray]]:
        """Yield some columns after others: where they stand, centre and scale (n_draw, n)."""
        step = max(_AT_ONCE // len(self.weight), _LEAST_COLUMNS)
        for first in range(0, len(columns), step):
            here = slice(first, first + step)
            ids, place = np.unique(columns[here], return_inverse=True)
            mean, sd = self._draws.columns(ids)
            if len(ids) < len(place):
                mean, sd = mean[:, place], sd[:, place]
            yield here, mean, sd

    def _by_column(self, function: Callable[[FloatArray, FloatArray], FloatArray]) -> FloatArray:
        """Return a function's value at each place; it is worked out once for places alike."""
        columns = np.arange(self._place.max(initial=-1) + 1)
        value = np.empty(len(columns))
        for here, mean, sd in self._blocks(columns):
            value[here] = function(mean, sd)
        return value[self._place]

    def _average(self, values: FloatArray) -> FloatArray:
        return np.tensordot(self.weight, values, axes=1)

    def _mean(self, mean: FloatArray, sd: FloatArray) -> FloatArray:
        means = np.exp(mean + 0.5 * sd**2)
        if self.df is not None:
            means = np.where(np.isfinite(self.df)[:, None] & (sd > 0), np.inf, means)
        return self._average(means)

    def _cdf(self, y: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            z = (y - mean) / sd
        return self._average(np.where(sd > 0, self._by_tail("cdf", z), mean <= y))

    def _by_tail(self, method: str, z: FloatArray) -> FloatArray:
        """Apply a method of `Tail` to standardised errors, to the draws of each tail its own."""
        if self.df is None:
            return ndtr(z) if method == "cdf" else NormalTail().log_density(z, None)
        value, student = np.empty(z.shape), np.isfinite(self.df)
        value[~student] = getattr(NormalTail(), method)(z[~student], None)
        value[student] = getattr(StudentTail(), method)(z[student], self.df[student, None])
        return value

    def _quantile(self, mean: FloatArray, sd: FloatArray, prob: float) -> FloatArray:
        if not sd.any():
            return np.exp(_weighted_quantile(mean, self.weight, prob))
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
            found = self._cdf(y, log_mean, sd)
            excess = found - prob
            low, high = np.where(excess < 0, y, low), np.where(excess >= 0, y, high)
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                z = (y - log_mean) / sd
                density = np.where(sd > 0, np.exp(self._by_tail("log_density", z)) / sd, 0.0)
                # In its lower tail a distribution function is nearly exponential.
                step = found * np.log(found / prob) if prob < 0.5 else excess
                newton = y - step / self._average(density)
            inside = (newton >= low) & (newton <= high)
            new = np.where(inside, newton, 0.5 * (low + high))
            settled = np.abs(new - y)[reached].max(initial=0.0) < 1e-10
            y = new
            if settled:
                break
        return np.where(reached, y, np.inf)


def mix_loads(parts: Iterable[LoadDistribution], weights: Sequence[float]) -> LoadDistribution:
    """Return the average of load distributions, such as over forms by model probability.

    Parameters
    ----------
    parts : iterable of LoadDistribution
        Of one shape.
    weights : sequence of float
        Non-negative; normalised here. Parts under 1e-9 are left out.

    Returns
    -------
    LoadDistribution
        Flagged as extrapolation wherever a part with weight above 1 % is, and where the median of
        the average lies above a load that such a part was calibrated to.

    Raises
    ------
    InputError
        If a weight is negative or not finite, or none is above 0.
    """
    share = shares(weights)
    pairs = [(part, w) for part, w in zip(parts, share, strict=True) if w > 1e-9]
    kept = [part for part, _ in pairs]
    place, columns = kept[0]._place, [part._draws.columns for part in kept]
    if not all(np.array_equal(part._place, place) for part in kept):
        place = np.arange(place.size).reshape(place.shape)
        columns = [partial(_placed, part._draws, part._place.ravel()) for part in kept]
    weight = np.concatenate([part.weight * w for part, w in pairs])
    draws = LoadDraws(weight, _joined_df(kept), partial(_joined, columns))
    heavy = list(compress(kept, heavy_parts(share[share > 1e-9])))
    flags = np.bitwise_or.reduce([part._flags for part in heavy])
    highest = np.minimum.reduce([part._highest for part in heavy])
    return LoadDistribution.of(draws, place, flags, highest)


def _stored(log_mean: FloatArray, sd: FloatArray, ids: IntArray) -> Columns:
    return log_mean[:, ids], sd[:, ids]


def _placed(draws: LoadDraws, place: IntArray, ids: IntArray) -> Columns:
    return draws.columns(place[ids])


def _widened(draws: LoadDraws, place: IntArray, rel_se: FloatArray, ids: IntArray) -> Columns:
    mean, sd = draws.columns(place[ids])
    return mean, np.hypot(sd, rel_se[ids])


def _joined(parts: Sequence[Callable[[IntArray], Columns]], ids: IntArray) -> Columns:
    """Return the columns of several draws below each other."""
    means, sds = zip(*(columns(ids) for columns in parts), strict=True)
    return np.concatenate(means), np.concatenate(sds)


def _joined_df(parts: Sequence[LoadDistribution]) -> FloatArray | None:
    if all(part.df is None for part in parts):
        return None
    return np.concatenate(
        [np.full(len(part.weight), np.inf) if part.df is None else part.df for part in parts]
    )


def _weighted_quantile(values: FloatArray, weight: FloatArray, prob: float) -> FloatArray:
    order = np.argsort(values, axis=0)
    total = np.cumsum(weight[order], axis=0)
    first = np.argmax(total >= prob - 1e-12, axis=0)
    return np.take_along_axis(np.take_along_axis(values, order, 0), first[None], 0)[0]
