"""`QDistribution`: the distribution of the even count Q at each of many textures and loads."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ridgebayes._types import BoolArray, FloatArray, IntArray, Rng
from ridgebayes.errors import InputError
from ridgebayes.predict.extrapolation import Flags, Q, names_of
from ridgebayes.runtime.randomness import seed_of

_NO_LIMIT = 2**62


@dataclass(frozen=True, eq=False)
class QDistribution:
    """Distributions of Q on 2, 4, 6, ...

    Parameters
    ----------
    survival : ndarray of float, shape (..., n_step), dimensionless
        P(Q >= 2), P(Q >= 4), ...; the first is 1, and they never rise.
    flags : ndarray of uint8, shape (...)
        Which of texture and load lie outside what was calibrated, see `predict.extrapolation`.
    q_calibrated_max : int
        Largest calibrated count.
    kind : str
        ``simulation`` or ``curve``.
    error : float, optional
        Largest error of a probability as weighted nodes tell it; NaN where draws were averaged.

    Notes
    -----
    *Validity.* Where `extrapolation` says so, texture, load or count lie beyond what was
    calibrated; `extrapolation_of` says which. The probability of counts beyond the last of `q` is
    under 1e-6 and set to 0.

    Examples
    --------
    >>> q = QDistribution(np.array([1.0, 0.75, 0.25]), np.array(False), 10, "simulation")
    >>> q.pmf.tolist(), float(q.mean()), int(q.median())
    ([0.25, 0.5, 0.25], 4.0, 4)
    """

    survival: FloatArray
    flags: Flags
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
        return self._all_flags(prob) != 0

    def extrapolation_of(self, prob: float = 0.9) -> np.ndarray:
        """Return the names of what was not calibrated, separated by commas.

        Parameters
        ----------
        prob : float, dimensionless
            Probability of the interval.

        Returns
        -------
        ndarray of str, shape (...)
            Of Q, load, a/pitch, a/R, b/R, texture; empty text where all was calibrated.

        Raises
        ------
        InputError
            If `prob` is outside 0 to 1.
        """
        return names_of(self._all_flags(prob))

    def _all_flags(self, prob: float) -> Flags:
        beyond = self.interval(prob)[1] > self.q_calibrated_max
        return self.flags | np.where(beyond, Q, 0).astype(np.uint8)

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


def mix_q(parts: Iterable[QDistribution], weights: Sequence[float]) -> QDistribution:
    """Return the average of distributions of Q, such as over forms by model probability.

    Parameters
    ----------
    parts : iterable of QDistribution
        Of one shape and kind. None is kept, so that a generator of many takes the memory of few.
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
    survival, error, kind = np.zeros(1), 0.0, ""
    flags, q_max = np.zeros((), dtype=np.uint8), _NO_LIMIT
    for part, weight, is_heavy in zip(parts, share.tolist(), heavy_parts(share), strict=True):
        # In place: a new array, as long as the longer of both.
        new = sorted((weight * part.survival, survival), key=lambda x: -x.shape[-1])
        survival = new[0]
        survival[..., : new[1].shape[-1]] += new[1]
        error, kind = error + weight * part.error, part.kind
        if is_heavy:
            flags, q_max = flags | part.flags, min(q_max, part.q_calibrated_max)
    return QDistribution(survival, flags, q_max, kind, error)


def shares(weights: Sequence[float]) -> FloatArray:
    """Return weights that sum to 1, or raise InputError where that cannot be."""
    values = np.asarray(weights, dtype=float)
    if not (np.all(values >= 0) and 0 < values.sum() < math.inf):
        raise InputError(f"weights: expected finite, not negative, one above 0, got {weights!r}")
    return values / values.sum()


def heavy_parts(share: FloatArray) -> BoolArray:
    """Return which parts of a mixture weigh enough for their extrapolation to be the mixture's."""
    return (share > 0.01) | (share == share.max())


def seeded(rng: Rng) -> np.random.Generator:
    """Return a generator seeded by an integer, or the generator itself."""
    return rng if isinstance(rng, np.random.Generator) else np.random.default_rng(seed_of(rng))
