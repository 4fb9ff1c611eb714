"""Distributions between two bounds: uniform, and truncated distributions."""

import math
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import ClassVar

import numpy as np
from scipy import special

from ridgebayes._types import FloatArray
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.errors import InputError, expect


@dataclass(frozen=True)
class Uniform(Distribution):
    """Uniform distribution between two bounds.

    Parameters
    ----------
    low, high : float, unit of the parameter
        Bounds.

    Raises
    ------
    InputError
        If a bound is not finite, or `low` not below `high`.

    Examples
    --------
    >>> float(Uniform(0.0, 4.0).value_at(0.0))
    2.0
    """

    low: float
    high: float
    kind: ClassVar[str] = "uniform"

    def __post_init__(self) -> None:
        expect(Real, np.ndarray, **vars(self))
        width = np.subtract(self.high, self.low)
        if not (np.all(np.isfinite(width)) and np.all(width > 0)):
            raise InputError(
                f"uniform distribution: expected finite bounds, low < high, got low = {self.low!r},"
                f" high = {self.high!r}"
            )

    @property
    def support(self) -> tuple[float, float]:
        return self.low, self.high

    def log_pdf(self, x: FloatArray) -> FloatArray:
        inside = np.greater_equal(x, self.low) & np.less_equal(x, self.high)
        return np.where(inside, -np.log(self.high - self.low), -np.inf)

    def value_at(self, u: FloatArray | float) -> FloatArray:
        u, width = np.asarray(u, dtype=float), self.high - self.low
        tail = width * special.ndtr(-np.abs(u))
        return np.asarray(np.where(u < 0, self.low + tail, self.high - tail))

    def score(self, x: FloatArray | float) -> FloatArray:
        width = self.high - self.low
        below, above = (np.asarray(x) - self.low) / width, (self.high - np.asarray(x)) / width
        return np.asarray(np.where(below < above, special.ndtri(below), -special.ndtri(above)))


@dataclass(frozen=True)
class Truncated(Distribution):
    """Distribution truncated to the interval between two bounds.

    Parameters
    ----------
    base : Distribution
        Distribution to truncate; not itself truncated.
    low, high : float, unit of the parameter
        Bounds; -inf or inf for an open side.

    Raises
    ------
    InputError
        If `base` has no probability between the bounds.

    Examples
    --------
    >>> from ridgebayes.distributions.distribution import Normal
    >>> above = Truncated(Normal(0.0, 1.0), 0.0, math.inf)  # a half-normal
    >>> round(float(above.log_pdf(np.array(1e-300))), 12)
    -0.225791352645
    """

    base: Distribution
    low: float
    high: float
    kind: ClassVar[str] = "truncated"
    is_stackable: ClassVar[bool] = False

    def __post_init__(self) -> None:
        expect(Distribution, base=self.base)
        expect(Real, low=self.low, high=self.high)
        if isinstance(self.base, Truncated):
            raise InputError("truncated distribution: expected a base that is not truncated itself")
        least, most = self.base.support
        if not max(self.low, least) < min(self.high, most) or not math.isfinite(self._log_mass):
            raise InputError(
                f"truncated distribution: expected low < high with some probability between, got "
                f"low = {self.low!r}, high = {self.high!r}"
            )

    @property
    def support(self) -> tuple[float, float]:
        least, most = self.base.support
        return max(self.low, least), min(self.high, most)

    @property
    def words(self) -> str:
        return f"{self.base.words}, between {self.low:.4g} and {self.high:.4g}"

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """Normal scores of the bounds under the base."""
        least, most = self.base.support
        low = float(self.base.score(self.low)) if self.low > least else -math.inf
        high = float(self.base.score(self.high)) if self.high < most else math.inf
        return low, high

    @cached_property
    def _log_mass(self) -> float:
        return float(_log_between(*map(np.asarray, self._ends)))

    def log_pdf(self, x: FloatArray) -> FloatArray:
        inside = np.greater_equal(x, self.low) & np.less_equal(x, self.high)
        return np.where(inside, self.base.log_pdf(x) - self._log_mass, -np.inf)

    def value_at(self, u: FloatArray | float) -> FloatArray:
        u, (low, high) = np.asarray(u, dtype=float), self._ends
        # Computed from the tail with the smaller probabilities.
        from_below = u < 0 if low < 0 < high else np.full(u.shape, high <= 0)
        sign = np.where(from_below, 1.0, -1.0)
        beyond = np.where(from_below, special.log_ndtr(low), special.log_ndtr(-high))
        inside = self._log_mass + special.log_ndtr(sign * u)
        score = sign * special.ndtri_exp(np.logaddexp(beyond, inside))
        return np.clip(self.base.value_at(np.clip(score, low, high)), self.low, self.high)

    def score(self, x: FloatArray | float) -> FloatArray:
        low, high = self._ends
        base = np.clip(self.base.score(x), low, high)
        below = _log_between(np.asarray(low), base) - self._log_mass
        above = _log_between(base, np.asarray(high)) - self._log_mass
        smaller = np.minimum(np.minimum(below, above), 0.0)
        return np.asarray(np.where(below < above, 1.0, -1.0) * special.ndtri_exp(smaller))


def _log_between(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the log probability of a standard normal between two scores."""
    upper = low > 0  # the tail that contains both scores, so that nothing cancels
    near = special.log_ndtr(np.where(upper, -low, high))
    far = special.log_ndtr(np.where(upper, -high, low))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(near + np.log(-np.expm1(np.minimum(far - near, 0.0))))
