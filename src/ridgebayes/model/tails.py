r"""Distributions of a row's error in units of its scale: normal, or Student's t.

Rows with a bracket or a count need the probability of an interval. Differences of distribution
functions cancel for narrow intervals and underflow far out. Therefore the density, relative to its
value at the middle, is integrated over narrow intervals by Gauss-Legendre quadrature. For wide
intervals the difference of two tail probabilities is computed relative to the larger tail; the
interval is reflected so that both are lower tails.
"""

import math
from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
from scipy import special

from ridgebayes._types import LOG_2PI, FloatArray

# Largest half-width of an interval times the slope of the log density for which quadrature has a
# relative error of 1e-13: with three Legendre nodes for normal errors, with sixteen for Student's.
_MAX_NARROW_NORMAL, _MAX_NARROW_STUDENT = 0.02, 2.5
_LEGENDRE = tuple(zip(*np.polynomial.legendre.leggauss(16), strict=True))
_LAGUERRE = tuple(zip(*np.polynomial.laguerre.laggauss(24), strict=True))
_ROOT_HALF = math.sqrt(0.5)


class Tail(ABC):
    """A distribution of errors with scale 1, symmetric about 0.

    Arguments are numbers or arrays and broadcast against each other. `df` is the parameter in
    `parameter_names`; a tail without parameters ignores it.
    """

    name: ClassVar[str]
    parameter_names: ClassVar[tuple[str, ...]]

    @abstractmethod
    def log_density(self, z: Any, df: Any) -> FloatArray:
        """Return the log density at `z`; -inf at either infinity."""

    @abstractmethod
    def log_probability(self, low: Any, high: Any, df: Any, width: Any = None) -> FloatArray:
        """Return log P(low < error <= high).

        Parameters
        ----------
        low, high : float or ndarray
            Ends of the interval, -inf <= low < high <= inf.
        df : float or ndarray or None
            Parameter of the tail.
        width : float or ndarray, optional
            high - low, if it is known more precisely than the difference of rounded ends.

        Returns
        -------
        ndarray of float
            Log probability in the broadcast shape; -inf if the logarithm overflows.

        Notes
        -----
        The relative error of P is at most 1e-12 + 1e-15 abs(log P): the first term is that of
        quadrature, the second is rounding of the logarithm and of ends far out. If `width` is not
        given, the rounding of the subtraction adds to it.
        """

    @abstractmethod
    def cdf(self, z: Any, df: Any) -> FloatArray:
        """Return P(error <= z), to the relative precision of the lower tail."""

    @abstractmethod
    def rvs(self, rng: np.random.Generator, df: Any, size: Any) -> FloatArray:
        """Return draws of shape `size`; `df` broadcasts to this shape."""

    @abstractmethod
    def weight(self, z: Any, df: Any) -> FloatArray:
        """Return -(d log density / dz) / z, which is 1 for normal errors."""


class NormalTail(Tail):
    """Standard normal errors; `df` is ignored.

    Examples
    --------
    >>> round(float(NormalTail().log_probability(40.0, 41.0, None)), 9)
    -804.608442014
    """

    name = "normal"
    parameter_names = ()

    def log_density(self, z: Any, df: Any) -> FloatArray:
        with np.errstate(over="ignore"):
            value: FloatArray = -0.5 * np.square(np.asarray(z, float)) - 0.5 * LOG_2PI
            return value

    def log_probability(self, low: Any, high: Any, df: Any, width: Any = None) -> FloatArray:
        with np.errstate(all="ignore"):
            width = np.subtract(high, low) if width is None else width
            middle = 0.5 * np.add(low, high)
            right, middle = middle > 0, np.abs(middle)
            # The tail of the end nearer to 0 is 0.5 erfcx(near / sqrt 2) exp(-near^2 / 2).
            near, far = (
                np.where(right, low, np.negative(high)),
                np.where(right, high, np.negative(low)),
            )
            peak = -0.5 * np.square(near)
            # `fmax` replaces NaN by 0: the middle is NaN if both ends are infinite.
            far_tail = np.fmax(special.erfcx(far * _ROOT_HALF) * np.exp(-width * middle), 0.0)
            near_tail = special.erfcx(np.abs(near) * _ROOT_HALF)
            one_side = peak + np.log(0.5 * (near_tail - far_tail))
            both_sides = np.log1p(-0.5 * np.exp(peak) * (near_tail + far_tail))
            value = np.where(near < 0, both_sides, one_side)
            narrow = 0.5 * width * np.maximum(middle, 1.0) <= _MAX_NARROW_NORMAL
            if np.any(narrow):
                # The three Legendre nodes are the middle and sqrt(0.15) widths on either side.
                outer = np.exp(-0.075 * np.square(width)) * np.cosh(
                    math.sqrt(0.15) * width * middle
                )
                by_nodes = np.log(width * (4 + 5 * outer) / 9) - 0.5 * (middle * middle + LOG_2PI)
                value = np.where(narrow, by_nodes, value)
        return np.asarray(value)

    def cdf(self, z: Any, df: Any) -> FloatArray:
        return np.asarray(special.ndtr(z))

    def rvs(self, rng: np.random.Generator, df: Any, size: Any) -> FloatArray:
        return np.asarray(rng.standard_normal(size))

    def weight(self, z: Any, df: Any) -> FloatArray:
        return np.ones(np.shape(z))


class StudentTail(Tail):
    r"""Student's t errors with `df` >= 0.1 degrees of freedom and scale 1 (the variance differs).

    Notes
    -----
    With z = sqrt(df) sinh v the density is

    .. math:: f(z) = f(0) \cosh^{-(df + 1)} v, \qquad f(z)\,dz = f(0) \sqrt{df} \cosh^{-df} v\,dv.

    Probabilities of narrow intervals are integrated in v, because the singularities of the
    integrand are pi/2 away from the real axis for any df. Probabilities of wide intervals are
    differences of two tails.

    Examples
    --------
    >>> round(float(StudentTail().log_probability(-1.0, 1.0, df=1.0)), 12)
    -0.69314718056
    """

    name = "student"
    parameter_names = ("df",)

    def _df(self, df: Any) -> FloatArray:
        """Return the degrees of freedom; subclasses may compute or fix them."""
        return np.asarray(df, float)

    def log_density(self, z: Any, df: Any) -> FloatArray:
        df = self._df(df)
        with np.errstate(over="ignore"):
            bend = _log1p_square(z / np.sqrt(df))
            value: FloatArray = _log_density_at_zero(df) - 0.5 * (df + 1) * bend
            return value

    def log_probability(self, low: Any, high: Any, df: Any, width: Any = None) -> FloatArray:
        df = self._df(df)
        with np.errstate(all="ignore"):
            if width is None:
                width = np.subtract(high, low)
            root, log_peak = np.sqrt(df), _log_density_at_zero(df)
            middle = 0.5 * (np.arcsinh(low / root) + np.arcsinh(high / root))
            # sinh b - sinh a = 2 cosh((a + b) / 2) sinh((b - a) / 2) uses the exact width.
            half = np.arcsinh(0.5 * width / root / np.cosh(middle))
            slope = np.tanh(middle)
            # The minimum rate limits half-widths to 1, away from the singularities at pi/2.
            rate = np.maximum(np.maximum(root, _MAX_NARROW_STUDENT), df * np.abs(slope))
            # Infinite ends can give NaN, for which this comparison is False, that is, wide.
            narrow = half * rate <= _MAX_NARROW_STUDENT
            value = np.empty(narrow.shape)
            for here, method, arrays in (
                (narrow, self._quadrature, (middle, slope, half, df, log_peak)),
                (~narrow, self._difference, (low, high, df, log_peak)),
            ):
                if here.any():
                    value[here] = method(*(np.broadcast_to(x, here.shape)[here] for x in arrays))
        return value

    def _quadrature(
        self,
        middle: FloatArray,
        slope: FloatArray,
        half: FloatArray,
        df: FloatArray,
        log_peak: FloatArray,
    ) -> FloatArray:
        """Return the log probability of narrow intervals."""
        total = np.zeros(half.shape)
        # A loop over nodes is faster than an axis of nodes, which would take 16 times the memory.
        for node, weight in _LEGENDRE:
            growth = np.expm1(node * half)
            shrinkage = growth / (1 + growth)
            # cosh(v + s) / cosh v - 1 = cosh s - 1 + slope sinh s, computed from exp(s) - 1.
            growth = 0.5 * (growth * shrinkage + slope * (growth + shrinkage))
            total += weight * np.exp(-df * np.log1p(growth))
        at_middle = 0.5 * (np.log(df) - df * _log1p_square(np.sinh(middle)))
        return log_peak + at_middle + np.log(half * total)

    def _difference(
        self, low: FloatArray, high: FloatArray, df: FloatArray, log_peak: FloatArray
    ) -> FloatArray:
        """Return the log probability of wide intervals."""
        right = high > -low
        low, high = np.where(right, -high, low), np.where(right, -low, high)
        lower = self._log_lower(low, df, log_peak)
        upper = self._log_lower(-np.abs(high), df, log_peak)
        one_side = upper + np.log(-np.expm1(lower - upper))
        # With a lower tail of 0 nothing is subtracted; if both tails are 0 the difference is NaN.
        one_side = np.where(lower == -np.inf, upper, one_side)
        both_sides = np.log1p(-np.exp(lower) - np.exp(upper))
        return np.where(high > 0, both_sides, one_side)

    def cdf(self, z: Any, df: Any) -> FloatArray:
        df = self._df(df)
        with np.errstate(all="ignore"):
            z, df, log_peak = np.broadcast_arrays(z, df, _log_density_at_zero(df))
            tail = np.exp(self._log_lower(-np.abs(z), df, log_peak))
        return np.where(z > 0, 1 - tail, tail)

    def rvs(self, rng: np.random.Generator, df: Any, size: Any) -> FloatArray:
        return np.asarray(rng.standard_t(self._df(df), size))

    def weight(self, z: Any, df: Any) -> FloatArray:
        df = self._df(df)
        value: FloatArray = (df + 1) / (df + np.square(np.asarray(z, float)))
        return value

    def _log_lower(self, z: FloatArray, df: FloatArray, log_peak: FloatArray) -> FloatArray:
        r"""Return log P(error <= z) for z <= 0.

        Notes
        -----
        With l = log(1 + z^2 / df) = 2 log cosh v and A = df l / 2,

        .. math:: F(z) = \frac{f(0)}{\sqrt{df}} e^{-A} J, \qquad
                  J = \int_0^\infty e^{-s} (1 - e^{-l - 2 s / df})^{-1/2} ds.

        J is computed by Gauss-Laguerre quadrature if SciPy's distribution function, which is
        precise elsewhere, underflows.
        """
        probability = special.stdtr(df, z)
        value, far = np.asarray(np.log(probability)), probability < np.finfo(float).tiny
        df, log_kernel = df[far], _log1p_square(z[far] / np.sqrt(df[far]))
        integral = np.zeros(df.shape)
        for node, weight in _LAGUERRE:
            integral += weight / np.sqrt(-np.expm1(-log_kernel - 2 * node / df))
        value[far] = log_peak[far] + np.log(integral / np.sqrt(df)) - 0.5 * df * log_kernel
        return value


TAILS: dict[str, Tail] = {tail.name: tail for tail in (NormalTail(), StudentTail())}


def _log1p_square(u: FloatArray) -> FloatArray:
    """Return log(1 + u^2), even if the square overflows."""
    value = np.log1p(np.square(u))
    if np.any(far := np.isinf(value)):
        value = np.where(far, 2 * np.log(np.abs(np.where(far, u, 1.0))), value)
    return value


def _log_density_at_zero(df: FloatArray) -> FloatArray:
    """Return log f(0), by a series for df >= 30, where gamma functions cancel to eps df log df.

    SciPy's `poch` and `betaln` have errors of up to 7e-12 and 8e-10.
    """
    gammas = special.gammaln(0.5 * df + 0.5) - special.gammaln(0.5 * df)
    exact = gammas - 0.5 * np.log(math.pi * df)
    r = 1 / df
    q = r * r
    series = r * (-1 / 4 + q * (1 / 24 + q * (-1 / 20 + q * (17 / 112 - q * (31 / 36)))))
    return np.where(df < 30, exact, series - 0.5 * LOG_2PI)
