"""Univariate distributions: priors of parameters, and uncertain values of a scene.

Each distribution is a frozen dataclass with a normalised log density. `stretched` multiplies its
scale, which shows the sensitivity of Bayes factors to the scale of each prior.

Sampling and integration use normal scores: u is the value at which a standard normal has the same
cumulative probability. In u every prior is a standard normal, a scale that tends to zero has normal
tails too, and nothing is cut off, because tails are computed from log probabilities.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from numbers import Real
from typing import ClassVar

import numpy as np
from scipy import special

from ridgebayes._types import LOG_2PI, FloatArray
from ridgebayes.errors import InputError, expect


@dataclass(frozen=True)
class Distribution(ABC):
    """Base class of univariate distributions.

    `scale_name` is the field that gives the width; it is empty if no single field does. If
    `is_stackable`, fields may be arrays inside the package, for many variables at once.

    Examples
    --------
    >>> prior = LogNormal(2.0, 0.1)
    >>> prior.support, prior.scale, prior.stretched(2.0).scale
    ((0.0, inf), 0.1, 0.2)
    >>> x = prior.value_at(1.0)  # one sd above the median: 2 exp(0.1)
    >>> [round(float(y), 9) for y in (x, prior.score(x), prior.slope_at(1.0, x) / x)]
    [2.210341836, 1.0, 0.1]
    >>> prior.rvs(np.random.default_rng(1), 3).shape, float(prior.log_pdf(np.array(-1.0)))
    ((3,), -inf)
    """

    kind: ClassVar[str]
    scale_name: ClassVar[str] = ""
    is_stackable: ClassVar[bool] = True

    def __post_init__(self) -> None:
        expect(Real, np.ndarray, **vars(self))
        for name, value in vars(self).items():
            positive = name != "mean"
            if not np.all(np.isfinite(value)) or (positive and not np.all(np.greater(value, 0))):
                got = f"finite{' and > 0' * positive}, got {name} = {value!r}"
                raise InputError(f"{self.kind} distribution: expected {got}")

    @property
    def support(self) -> tuple[float, float]:
        """Interval in which the density is above 0."""
        return 0.0, math.inf

    @abstractmethod
    def log_pdf(self, x: FloatArray) -> FloatArray:
        """Return the log density.

        Parameters
        ----------
        x : ndarray of float, any shape, unit of the parameter
            Values.

        Returns
        -------
        ndarray of float, shape of `x`
            Normalised natural log density; -inf outside the support.
        """

    @abstractmethod
    def value_at(self, u: FloatArray | float) -> FloatArray:
        """Return the values with given normal scores.

        Parameters
        ----------
        u : ndarray of float, any shape, dimensionless
            Normal scores.

        Returns
        -------
        ndarray of float, shape of `u`, unit of the parameter
            Values.
        """

    @abstractmethod
    def score(self, x: FloatArray | float) -> FloatArray:
        """Return the normal scores of values, the inverse of `value_at`.

        Parameters
        ----------
        x : ndarray of float, any shape, dimensionless
            Values inside the support.

        Returns
        -------
        ndarray of float, shape of `x`, dimensionless
            Normal scores.
        """

    def slope_at(self, u: FloatArray | float, x: FloatArray) -> FloatArray:
        """Return d value_at / du: the standard normal density over the density of the values.

        Parameters
        ----------
        u : ndarray of float, any shape, dimensionless
            Normal scores.
        x : ndarray of float, shape of `u`, unit of the parameter
            Values at `u`, from `value_at`.

        Returns
        -------
        ndarray of float, shape of `u`, unit of the parameter
            Slopes.
        """
        return np.exp(-0.5 * (np.square(u) + LOG_2PI) - self.log_pdf(x))

    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        """Draw values.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of randomness.
        size : int
            Number of draws.

        Returns
        -------
        ndarray of float, shape (size,), unit of the parameter
            Draws.
        """
        return self.value_at(rng.standard_normal(size))

    @property
    def words(self) -> str:
        """Kind and parameters as text for a report.

        >>> LogNormal(65.81, 0.3).words
        'log-normal, median 65.81, log-sd 0.3'
        """
        parts = [f"{name.replace('_', '-')} {value:.4g}" for name, value in vars(self).items()]
        return ", ".join([self.kind, *parts])

    @property
    def scale(self) -> float:
        """Width, in the unit of `scale_name`."""
        return float(getattr(self, self.scale_name))

    def stretched(self, factor: float) -> "Distribution":
        """Return the distribution with its scale multiplied by a factor.

        Parameters
        ----------
        factor : float, dimensionless
            Factor, above 0.

        Returns
        -------
        Distribution
            Distribution of the same kind.

        Raises
        ------
        InputError
            If the distribution has no scale, or the new scale is not finite and above 0.
        """
        if not self.scale_name:
            raise InputError(f"{self.kind}: expected a distribution with a scale, got {self}")
        return replace(self, **{self.scale_name: self.scale * factor})


@dataclass(frozen=True)
class LogNormal(Distribution):
    """Log-normal distribution: log x is normal with mean log(median) and sd log_sd.

    Parameters
    ----------
    median : float, unit of the parameter
        Median, above 0.
    log_sd : float, dimensionless
        Standard deviation of log x, above 0.

    Raises
    ------
    InputError
        If a parameter is not finite, or not above 0.

    Examples
    --------
    >>> round(float(LogNormal(1.0, 0.5).log_pdf(np.array(1.0))), 12)
    -0.225791352645
    """

    median: float
    log_sd: float
    kind: ClassVar[str] = "log-normal"
    scale_name: ClassVar[str] = "log_sd"

    def log_pdf(self, x: FloatArray) -> FloatArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            log_x = np.log(x)
            z = (log_x - np.log(self.median)) / self.log_sd
            value = -0.5 * z * z - log_x - np.log(self.log_sd) - 0.5 * LOG_2PI
        return np.where(np.greater(x, 0), value, -np.inf)

    def value_at(self, u: FloatArray | float) -> FloatArray:
        with np.errstate(over="ignore"):
            return self.median * np.exp(self.log_sd * u)

    def score(self, x: FloatArray | float) -> FloatArray:
        return np.log(x / self.median) / self.log_sd

    def slope_at(self, u: FloatArray | float, x: FloatArray) -> FloatArray:
        return self.log_sd * x


@dataclass(frozen=True)
class Normal(Distribution):
    """Normal distribution.

    Parameters
    ----------
    mean : float, unit of the parameter
        Mean.
    sd : float, unit of the parameter
        Standard deviation, above 0.

    Raises
    ------
    InputError
        If a parameter is not finite, or `sd` is not above 0.

    Examples
    --------
    >>> round(float(Normal(0.0, 1.0).log_pdf(np.array(0.0))), 12)
    -0.918938533205
    """

    mean: float
    sd: float
    kind: ClassVar[str] = "normal"
    scale_name: ClassVar[str] = "sd"

    @property
    def support(self) -> tuple[float, float]:
        return -math.inf, math.inf

    def log_pdf(self, x: FloatArray) -> FloatArray:
        z = self.score(x)
        return np.asarray(-0.5 * z * z - np.log(self.sd) - 0.5 * LOG_2PI)

    def value_at(self, u: FloatArray | float) -> FloatArray:
        return self.mean + self.sd * np.asarray(u)

    def score(self, x: FloatArray | float) -> FloatArray:
        return (np.asarray(x) - self.mean) / self.sd

    def slope_at(self, u: FloatArray | float, x: FloatArray) -> FloatArray:
        return np.full(np.shape(u), self.sd)


@dataclass(frozen=True)
class HalfNormal(Distribution):
    """Half-normal distribution on (0, inf): the absolute value of a normal with mean 0 and sd.

    Parameters
    ----------
    sd : float, unit of the parameter
        Standard deviation of the normal, above 0.

    Raises
    ------
    InputError
        If `sd` is not finite, or not above 0.

    Examples
    --------
    >>> round(float(HalfNormal(1.0).log_pdf(np.array(1e-300))), 12)
    -0.225791352645
    """

    sd: float
    kind: ClassVar[str] = "half-normal"
    scale_name: ClassVar[str] = "sd"

    def log_pdf(self, x: FloatArray) -> FloatArray:
        z = np.asarray(x) / self.sd
        value = -0.5 * z * z - np.log(self.sd) + 0.5 * math.log(2 / math.pi)
        return np.where(np.greater(x, 0), value, -np.inf)

    def value_at(self, u: FloatArray | float) -> FloatArray:
        u = np.asarray(u, dtype=float)
        # Use the smaller of P(X <= x) = erf(x / (sd sqrt 2)) and its complement against cancelling.
        z, low = np.asarray(special.ndtr(-np.abs(u))), u < 0
        special.erfinv(z, out=z, where=low)
        special.erfcinv(z, out=z, where=~low)
        z *= math.sqrt(2)
        if np.any(far := u > 35):  # the tail probability underflows, its logarithm does not
            log_half_tail = special.log_ndtr(-np.where(far, u, 0)) - math.log(2)
            z = np.where(far, -special.ndtri_exp(log_half_tail), z)
        return self.sd * z

    def score(self, x: FloatArray | float) -> FloatArray:
        z = np.asarray(x) / self.sd
        with np.errstate(divide="ignore"):
            low = special.ndtri_exp(np.log(special.erf(z / math.sqrt(2))))
        high = -special.ndtri_exp(np.minimum(special.log_ndtr(-z) + math.log(2), 0.0))
        return np.asarray(np.where(z < 0.67, low, high))

    def slope_at(self, u: FloatArray | float, x: FloatArray) -> FloatArray:
        z = np.asarray(x) / self.sd
        return 0.5 * self.sd * np.exp(0.5 * (z - u) * (z + u))  # standard normal over this density

    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        return np.abs(self.sd * rng.standard_normal(size))


@dataclass(frozen=True)
class Gamma(Distribution):
    """Gamma distribution on (0, inf) with mean shape/rate.

    Parameters
    ----------
    shape : float, dimensionless
        Shape, above 0.
    rate : float, one over the unit of the parameter
        Rate, above 0.

    Examples
    --------
    >>> round(float(Gamma(2.0, 0.1).log_pdf(np.array(10.0))), 12)
    -3.302585092994
    """

    shape: float
    rate: float
    kind: ClassVar[str] = "gamma"
    scale_name: ClassVar[str] = "rate"

    def log_pdf(self, x: FloatArray) -> FloatArray:
        shape, rate = self.shape, self.rate
        with np.errstate(divide="ignore", invalid="ignore"):
            value = shape * np.log(rate) + (shape - 1) * np.log(x) - rate * np.asarray(x)
        return np.where(np.greater(x, 0), value - special.gammaln(shape), -np.inf)

    def value_at(self, u: FloatArray | float) -> FloatArray:
        shape, u = self.shape, np.asarray(u, dtype=float)
        # The smaller of the two tail probabilities avoids cancellation.
        tail = special.ndtr(-np.abs(u))
        with np.errstate(under="ignore"):
            x = np.where(u < 0, special.gammaincinv(shape, tail), special.gammainccinv(shape, tail))
        if np.any(low := u < -37):  # P underflows; it equals x^shape / Gamma(shape + 1) there
            log_tail = special.log_ndtr(np.where(low, u, 0))
            x = np.where(low, np.exp((log_tail + special.gammaln(shape + 1)) / shape), x)
        return np.asarray(x / self.rate)

    def score(self, x: FloatArray | float) -> FloatArray:
        z = np.asarray(x) * self.rate
        low, high = special.gammainc(self.shape, z), special.gammaincc(self.shape, z)
        return np.asarray(np.where(low < high, special.ndtri(low), -special.ndtri(high)))

    def stretched(self, factor: float) -> "Gamma":
        """Return the distribution with its mean and width multiplied by a factor.

        Parameters
        ----------
        factor : float, dimensionless
            Factor, above 0.

        Returns
        -------
        Gamma
            Distribution of the same shape.
        """
        return replace(self, rate=self.rate / factor)

    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        return rng.gamma(self.shape, 1 / self.rate, size)
