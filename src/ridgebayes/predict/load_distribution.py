"""`LoadDistribution`: the distribution of the load that reaches a count."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from ridgebayes._types import BoolArray, FloatArray, Rng
from ridgebayes.errors import InputError
from ridgebayes.model.tails import NormalTail, StudentTail
from ridgebayes.predict.q_distribution import seeded, shares

_LARGEST_PROB = 1 - 1e-12
_LARGEST_LOG = 800.0


@dataclass(frozen=True, eq=False)
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
    extrapolation : ndarray of bool, shape (...)
        Whether texture or count lies outside what was calibrated.
    df : ndarray of float, shape (n_draw,), optional
        Degrees of freedom of each draw's Student errors, infinite for normal ones; all are normal
        if not given.

    Notes
    -----
    *Validity.* Where `extrapolation` says so, texture or count lie beyond what was calibrated.
    """

    log_mean: FloatArray
    sd: FloatArray
    weight: FloatArray
    extrapolation: BoolArray
    df: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.sd.ndim < self.log_mean.ndim:
            spread = np.broadcast_to(self._spread(self.sd), self.log_mean.shape)
            object.__setattr__(self, "sd", spread)

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
            y = np.log(np.maximum(p, 0))
        return self._cdf(np.broadcast_to(y, self.log_mean.shape[1:]))

    def mean(self) -> FloatArray:
        """Return the mean load p/E, shape (...); infinite under Student errors, whose tails are."""
        means = np.exp(self.log_mean + 0.5 * self.sd**2)
        if self.df is not None:
            is_student = np.isfinite(self._spread(self.df)) & (self.sd > 0)
            means = np.where(is_student, np.inf, means)
        return self._average(means)

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
        if not self.sd.any():
            return np.exp(_weighted_quantile(self.log_mean, self.weight, prob))
        with np.errstate(over="ignore"):
            return np.exp(self._solve(prob))

    def median(self) -> FloatArray:
        """Return the median load p/E, shape (...)."""
        return self.quantile(0.5)

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
        generator = seeded(rng)
        pick = generator.choice(len(self.weight), size=size, p=self.weight)
        noise = generator.standard_normal((size, *self.log_mean.shape[1:]))
        if self.df is not None:
            df = self.df[pick]
            finite = np.where(np.isfinite(df), df, 1.0)
            wide = np.sqrt(finite / generator.chisquare(finite))
            noise = noise * self._spread(np.where(np.isfinite(df), wide, 1.0))
        return np.exp(self.log_mean[pick] + self.sd[pick] * noise)

    def _spread(self, per_draw: FloatArray) -> FloatArray:
        return per_draw.reshape((-1,) + (1,) * (self.log_mean.ndim - 1))

    def _average(self, values: FloatArray) -> FloatArray:
        return np.tensordot(self.weight, values, axes=1)

    def _cdf(self, y: FloatArray) -> FloatArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            z = (y - self.log_mean) / self.sd
        return self._average(np.where(self.sd > 0, self._by_tail("cdf", z), self.log_mean <= y))

    def _by_tail(self, method: str, z: FloatArray) -> FloatArray:
        """Apply a method of `Tail` to standardised errors, to the draws of each tail its own."""
        if self.df is None:
            return np.asarray(getattr(NormalTail(), method)(z, None))
        value, student = np.empty(z.shape), np.isfinite(self.df)
        value[~student] = getattr(NormalTail(), method)(z[~student], None)
        df = self._spread(self.df)[student]
        value[student] = getattr(StudentTail(), method)(z[student], df)
        return value

    def _solve(self, prob: float) -> FloatArray:
        """Newton's method on the distribution function, kept inside a shrinking bracket."""
        sd = self.sd
        # Infinite loads, of draws that reach no further ridge, have a share but no place.
        finite = np.isfinite(self.log_mean)
        mean = np.where(finite, self.log_mean, 0.0)
        share = np.maximum(self._average(finite.astype(float)), 1e-300)
        reached = prob / share < 1 - 5e-13
        # Beyond e^800 there are no floats: such loads are 0 or infinite.
        high = np.where(reached, _LARGEST_LOG, 0.0)
        low = -high
        centre = self._average(mean) / share
        variance = self._average(np.where(finite, (mean - centre) ** 2 + sd**2, 0.0)) / share
        y = np.clip(centre + ndtri(prob) * np.sqrt(variance), low, high)
        for _ in range(100):
            found = self._cdf(y)
            excess = found - prob
            low, high = np.where(excess < 0, y, low), np.where(excess >= 0, y, high)
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                z = (y - self.log_mean) / sd
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


def mix_loads(parts: Sequence[LoadDistribution], weights: Sequence[float]) -> LoadDistribution:
    """Return the average of load distributions, such as over forms by model probability.

    Parameters
    ----------
    parts : sequence of LoadDistribution
        Of one shape.
    weights : sequence of float
        Non-negative; normalised here. Parts under 1e-9 are left out.

    Returns
    -------
    LoadDistribution
        Flagged as extrapolation wherever a part with weight above 1 % is.

    Raises
    ------
    InputError
        If a weight is negative or not finite, or none is above 0.
    """
    share = shares(weights)
    kept = [(part, weight) for part, weight in zip(parts, share, strict=True) if weight > 1e-9]
    heavy = [part for part, weight in kept if weight > 0.01]
    return LoadDistribution(
        np.concatenate([part.log_mean for part, _ in kept]),
        np.concatenate([part.sd for part, _ in kept]),
        np.concatenate([part.weight * weight for part, weight in kept]),
        np.any([part.extrapolation for part in heavy], axis=0),
        _joined_df([part for part, _ in kept]),
    )


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
