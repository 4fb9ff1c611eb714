"""`QDistribution`: the distribution of the even count Q at each of many textures and loads."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ridgebayes._types import BoolArray, FloatArray, IntArray, Rng
from ridgebayes.errors import InputError
from ridgebayes.runtime.randomness import seed_of


@dataclass(frozen=True, eq=False)
class QDistribution:
    """Distributions of Q on 2, 4, 6, ...

    Parameters
    ----------
    survival : ndarray of float, shape (..., n_step), dimensionless
        P(Q >= 2), P(Q >= 4), ...; the first is 1, and they never rise.
    outside : ndarray of bool, shape (...)
        Whether the texture or the load lies outside what was calibrated.
    q_calibrated_max : int
        Largest calibrated count.
    kind : str
        ``simulation`` or ``curve``.
    error : float, optional
        Largest error of a probability as weighted nodes tell it; NaN where draws were averaged.

    Notes
    -----
    *Validity.* Where `extrapolation` says so, texture, load or count lie beyond what was
    calibrated. The probability of counts beyond the last of `q` is under 1e-6 and set to 0.

    Examples
    --------
    >>> q = QDistribution(np.array([1.0, 0.75, 0.25]), np.array(False), 10, "simulation")
    >>> q.pmf.tolist(), float(q.mean()), int(q.median())
    ([0.25, 0.5, 0.25], 4.0, 4)
    """

    survival: FloatArray
    outside: BoolArray
    q_calibrated_max: int
    kind: str
    error: float = np.nan

    def __repr__(self) -> str:
        return f"QDistribution({self.kind}, shape {self.survival.shape[:-1]}, Q <= {self.q[-1]})"

    @property
    def q(self) -> IntArray:
        """The counts 2, 4, ..., shape (n_step,)."""
        return 2 + 2 * np.arange(self.survival.shape[-1])

    @property
    def pmf(self) -> FloatArray:
        """P(Q = q) for each of `q`, shape (..., n_step)."""
        after = np.concatenate([self.survival[..., 1:], np.zeros_like(self.survival[..., :1])], -1)
        return self.survival - after

    @property
    def cdf(self) -> FloatArray:
        """P(Q <= q) for each of `q`, shape (..., n_step)."""
        return 1 - self.survival + self.pmf

    def at_least(self, n: float) -> FloatArray:
        """Return P(Q >= n).

        Parameters
        ----------
        n : float, dimensionless
            Count.

        Returns
        -------
        ndarray of float, shape (...), dimensionless
            Probabilities.

        Raises
        ------
        InputError
            If `n` is NaN.
        """
        if math.isnan(n):
            raise InputError(f"n: expected a number, got {n!r}")
        step = max((n - 2) / 2, 0)
        if step > self.survival.shape[-1] - 1:
            return np.zeros(self.survival.shape[:-1])
        return self.survival[..., math.ceil(step)]

    def mean(self) -> FloatArray:
        """Return the mean of Q, shape (...)."""
        return 2 * self.survival.sum(axis=-1)

    def quantile(self, prob: float) -> IntArray:
        """Return the smallest q with P(Q <= q) >= prob.

        Parameters
        ----------
        prob : float, dimensionless
            Probability.

        Returns
        -------
        ndarray of int, shape (...), dimensionless
            Even counts.

        Raises
        ------
        InputError
            If `prob` is outside 0 to 1.
        """
        if not 0 <= prob <= 1:
            raise InputError(f"prob: expected 0 <= prob <= 1, got {prob!r}")
        # A rounding error of the sum must not push the quantile a step up.
        reached = self.cdf >= prob * (1 - 1e-12)
        return self.q[np.argmax(reached, axis=-1)]

    def median(self) -> IntArray:
        """Return the median, shape (...)."""
        return self.quantile(0.5)

    def interval(self, prob: float = 0.9) -> tuple[IntArray, IntArray]:
        """Return the equal-tailed interval that holds at least `prob`.

        Parameters
        ----------
        prob : float, dimensionless
            Probability.

        Returns
        -------
        lower, upper : ndarray of int, shape (...)
            Even counts.

        Raises
        ------
        InputError
            If `prob` is outside 0 to 1.
        """
        if not 0 <= prob <= 1:
            raise InputError(f"prob: expected 0 <= prob <= 1, got {prob!r}")
        return self.quantile(0.5 - prob / 2), self.quantile(0.5 + prob / 2)

    def extrapolation(self, prob: float = 0.9) -> BoolArray:
        """Return where texture, load or the upper end of the interval were not calibrated.

        Parameters
        ----------
        prob : float, dimensionless
            Probability of the interval.

        Returns
        -------
        ndarray of bool, shape (...)
            True outside.

        Raises
        ------
        InputError
            If `prob` is outside 0 to 1.
        """
        return self.outside | (self.interval(prob)[1] > self.q_calibrated_max)

    def rvs(self, rng: Rng, size: int = 1) -> IntArray:
        """Draw counts, shape (size, ...).

        Parameters
        ----------
        rng : int or numpy.random.Generator
            Source of randomness.
        size : int, optional
            Draws of each distribution.

        Returns
        -------
        ndarray of int, shape (size, ...)
            Even counts.
        """
        generator = seeded(rng)
        draws = np.empty((size, *self.survival.shape[:-1]), dtype=np.int64)
        for i in range(size):
            u = generator.random(self.survival.shape[:-1])
            draws[i] = 2 * np.sum(u[..., None] < self.survival, axis=-1)
        return draws


def mix_q(parts: Sequence[QDistribution], weights: Sequence[float]) -> QDistribution:
    """Return the average of distributions of Q, such as over forms by model probability.

    Parameters
    ----------
    parts : sequence of QDistribution
        Of one shape and kind.
    weights : sequence of float
        Non-negative; normalised here.

    Returns
    -------
    QDistribution
        Flagged as extrapolation wherever a part with weight above 1 % is.

    Raises
    ------
    InputError
        If a weight is negative or not finite, or none is above 0.
    """
    share = shares(weights)
    n_step = max(part.survival.shape[-1] for part in parts)
    survival = np.zeros((*parts[0].survival.shape[:-1], n_step))
    for part, weight in zip(parts, share, strict=True):
        survival[..., : part.survival.shape[-1]] += weight * part.survival
    heavy = [part for part, weight in zip(parts, share, strict=True) if weight > 0.01]
    outside = np.any([part.outside for part in heavy], axis=0)
    q_max = min(part.q_calibrated_max for part in heavy)
    error = float(np.dot(share, [part.error for part in parts]))
    return QDistribution(survival, outside, q_max, parts[0].kind, error)


def shares(weights: Sequence[float]) -> FloatArray:
    """Return weights that sum to 1, or raise InputError where that cannot be."""
    values = np.asarray(weights, dtype=float)
    if not (np.all(values >= 0) and 0 < values.sum() < math.inf):
        raise InputError(f"weights: expected finite, not negative, one above 0, got {weights!r}")
    return values / values.sum()


def seeded(rng: Rng) -> np.random.Generator:
    """Return a generator seeded by an integer, or the generator itself."""
    return rng if isinstance(rng, np.random.Generator) else np.random.default_rng(seed_of(rng))
