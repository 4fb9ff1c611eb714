r"""The distribution of one row's error in units of its scale: normal, or Student's t.

The probability of an interval is needed for rows that only bracket a load. Differences of
distribution functions lose it where the interval is narrow, and underflow far out, so two ways
share the work. Up to a width of about five standard deviations at the centre, less further out,
Gauss-Legendre quadrature of the density relative to its middle: nothing is subtracted. Beyond, the
difference of two lower tails as logarithms, the interval reflected so that they are the small ones;
there the two differ by a factor that leaves nothing to cancel.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy import special

from ridgebayes._types import LOG_2PI, FloatArray

_LEGENDRE = tuple(zip(*np.polynomial.legendre.leggauss(16), strict=True))
_FEW_LEGENDRE = tuple(zip(*np.polynomial.legendre.leggauss(7), strict=True))
_LAGUERRE = tuple(zip(*np.polynomial.laguerre.laggauss(24), strict=True))
# Half an interval times the rate its log density changes at: up to here the nodes give 1e-13 of P.
_MAX_PANEL_RATE = 2.5
# Student's tail, by z = sqrt(df) sinh v: beyond this v a binomial series in cosh^-2 v, the highest
# power first, gives it to rounding; before, Laguerre's nodes give 1e-13 from this df log cosh v on.
_MIN_SERIES_V = 2.0
_SERIES = tuple((k, math.comb(2 * k, k) / 4**k) for k in range(13, -1, -1))
_MAX_EXPONENT = 600.0  # the lower tail underflows beyond it


@dataclass(frozen=True)
class Tail(ABC):
    """The distribution of an error of scale 1, symmetric about 0.

    Arguments are numbers or arrays and broadcast against each other. `df` is what the tail names
    in `parameter_names`; a tail without parameters ignores it.
    """

    name: ClassVar[str]
    parameter_names: ClassVar[tuple[str, ...]]
    _widest_panel: ClassVar[float] = _MAX_PANEL_RATE
    _legendre: ClassVar[tuple[tuple[float, float], ...]] = _LEGENDRE

    @abstractmethod
    def log_density(self, z: Any, df: Any) -> FloatArray:
        """Return the log density at `z`; -inf at either infinity."""

    def log_probability(self, low: Any, high: Any, df: Any, width: Any = None) -> FloatArray:
        """Return log P(low < error <= high).

        Parameters
        ----------
        low, high : float or ndarray
            Ends, -inf <= low < high <= inf.
        df : float or ndarray or None
            Parameter of the tail.
        width : float or ndarray, optional
            high - low, where it is known better than by subtraction.

        Returns
        -------
        ndarray of float
            In the broadcast shape; -inf where even the logarithm is beyond a float.

        Notes
        -----
        The relative error of P is within 1e-12 + 1e-15 abs(log P): quadrature, then the rounding
        of the logarithm and of ends far out. A `width` that was not given adds the rounding of its
        subtraction.
        """
        with np.errstate(all="ignore"):
            if width is None:
                width = np.subtract(high, low)
            low, high, width, *fixed = np.broadcast_arrays(low, high, width, *self._fixed(df))
            log_peak, slope, half, rate = self._panel(low, high, width, *fixed)
            # Not the opposite comparison: infinite ends have no middle, and are not narrow.
            narrow = half * rate <= self._widest_panel
            value = np.empty(narrow.shape)
            for here, way, arrays in (
                (narrow, self._quadrature, (log_peak, slope, half, *fixed)),
                (~narrow, self._difference, (low, high, *fixed)),
            ):
                if here.any():
                    value[here] = way(*(array[here] for array in arrays))
        return value

    def cdf(self, z: Any, df: Any) -> FloatArray:
        """Return P(error <= z), to the relative precision of the lower tail."""
        with np.errstate(all="ignore"):
            z, *fixed = np.broadcast_arrays(z, *self._fixed(df))
            tail = np.exp(self._log_lower(-np.abs(z), *fixed))
        return np.where(z > 0, 1 - tail, tail)

    @abstractmethod
    def rvs(self, rng: np.random.Generator, df: Any, size: Any) -> FloatArray:
        """Return draws of the shape `size`, against which `df` broadcasts."""

    @abstractmethod
    def weight(self, z: Any, df: Any) -> FloatArray:
        """Return minus the derivative of the log density over `z`: 1 of normal errors."""

    @abstractmethod
    def _fixed(self, df: Any) -> tuple[FloatArray, ...]:
        """Return what depends on `df` alone, in its own shape: computed before broadcasting."""

    @abstractmethod
    def _panel(
        self, low: FloatArray, high: FloatArray, width: FloatArray, *fixed: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return what quadrature of an interval needs, and whether it may be used.

        Returns
        -------
        log_peak, slope, half, rate : ndarray of float
            Log integrand at the middle, what `_log_change` needs to know of the middle, half the
            width, and the rate the log integrand changes at, in the coordinate of the quadrature.
        """

    @abstractmethod
    def _log_change(self, step: FloatArray, slope: FloatArray, *fixed: FloatArray) -> FloatArray:
        """Return the log integrand a step away from the middle, less that at the middle."""

    @abstractmethod
    def _log_lower(self, z: FloatArray, *fixed: FloatArray) -> FloatArray:
        """Return log P(error <= z) for z <= 0."""

    def _quadrature(
        self, log_peak: FloatArray, slope: FloatArray, half: FloatArray, *fixed: FloatArray
    ) -> FloatArray:
        """Return the log probability of narrow intervals."""
        total = np.zeros(half.shape)
        # Node by node: an axis of nodes would take 16 times the memory and be slower for it.
        for node, weight in self._legendre:
            total += weight * np.exp(self._log_change(node * half, slope, *fixed))
        return log_peak + np.log(half * total)

    def _difference(self, low: FloatArray, high: FloatArray, *fixed: FloatArray) -> FloatArray:
        """Return the log probability of wide intervals."""
        right = high > -low
        low, high = np.where(right, -high, low), np.where(right, -low, high)
        lower = self._log_lower(low, *fixed)
        upper = self._log_lower(-np.abs(high), *fixed)
        beside = upper + np.log(-np.expm1(lower - upper))
        # Nothing to subtract; and where neither is within reach of a float, not nan.
        beside = np.where(lower == -np.inf, upper, beside)
        across = np.log1p(-np.exp(lower) - np.exp(upper))
        return np.where(high > 0, across, beside)


@dataclass(frozen=True)
class NormalTail(Tail):
    """Standard normal errors; `df` is ignored.

    Examples
    --------
    >>> round(float(NormalTail().log_probability(40.0, 41.0, None)), 9)
    -804.608442014
    """

    name: ClassVar[str] = "normal"
    parameter_names: ClassVar[tuple[str, ...]] = ()
    # The difference of two tails is cheap, and loses no digit from here on.
    _widest_panel: ClassVar[float] = 0.5
    _legendre: ClassVar[tuple[tuple[float, float], ...]] = _FEW_LEGENDRE

    def log_density(self, z: Any, df: Any) -> FloatArray:
        with np.errstate(over="ignore"):
            value: FloatArray = -0.5 * np.square(np.asarray(z, float)) - 0.5 * LOG_2PI
            return value

    def rvs(self, rng: np.random.Generator, df: Any, size: Any) -> FloatArray:
        return np.asarray(rng.standard_normal(size))

    def weight(self, z: Any, df: Any) -> FloatArray:
        return np.ones(np.shape(z))

    def _fixed(self, df: Any) -> tuple[FloatArray, ...]:
        return ()

    def _panel(
        self, low: FloatArray, high: FloatArray, width: FloatArray, *fixed: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        middle = 0.5 * low + 0.5 * high
        return self.log_density(middle, None), middle, 0.5 * width, np.maximum(1.0, np.abs(middle))

    def _log_change(self, step: FloatArray, slope: FloatArray, *fixed: FloatArray) -> FloatArray:
        return -step * (slope + 0.5 * step)

    def _log_lower(self, z: FloatArray, *fixed: FloatArray) -> FloatArray:
        value: FloatArray = special.log_ndtr(z)
        return value


@dataclass(frozen=True)
class StudentTail(Tail):
    r"""Student's t errors with `df` degrees of freedom, 0.1 <= df, of scale 1, not of variance 1.

    Notes
    -----
    With z = sqrt(df) sinh v the density is

    .. math:: f(z) = f(0) \cosh^{-(df + 1)} v, \qquad f(z)\,dz = f(0) \sqrt{df} \cosh^{-df} v\,dv.

    Interval probabilities are integrated in v: whatever df, the singularities of the integrand
    stay pi/2 away from the axis.

    Examples
    --------
    >>> round(float(StudentTail().log_probability(-1.0, 1.0, df=1.0)), 12)
    -0.69314718056
    """

    name: ClassVar[str] = "student"
    parameter_names: ClassVar[tuple[str, ...]] = ("df",)

    def log_density(self, z: Any, df: Any) -> FloatArray:
        df, log_peak = self._fixed(df)
        with np.errstate(over="ignore"):
            value: FloatArray = log_peak - 0.5 * (df + 1) * _log1p_square(z / np.sqrt(df))
            return value

    def rvs(self, rng: np.random.Generator, df: Any, size: Any) -> FloatArray:
        return np.asarray(rng.standard_t(df, size))

    def weight(self, z: Any, df: Any) -> FloatArray:
        value: FloatArray = (df + 1) / (df + np.square(np.asarray(z, float)))
        return value

    def _fixed(self, df: Any) -> tuple[FloatArray, ...]:
        df = np.asarray(df, float)
        return df, _log_density_at_zero(df)

    def _panel(
        self, low: FloatArray, high: FloatArray, width: FloatArray, *fixed: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        df, log_peak = fixed
        root = np.sqrt(df)
        middle = 0.5 * (np.arcsinh(low / root) + np.arcsinh(high / root))
        # sinh b - sinh a = 2 cosh((a + b) / 2) sinh((b - a) / 2): keeps a width known exactly.
        half = np.arcsinh(0.5 * width / root / np.cosh(middle))
        slope = np.tanh(middle)
        # At least _MAX_PANEL_RATE: no half-width above 1, for the singularities at pi/2.
        rate = np.maximum(np.maximum(root, _MAX_PANEL_RATE), df * np.abs(slope))
        log_peak = log_peak + 0.5 * (np.log(df) - df * _log1p_square(np.sinh(middle)))
        return log_peak, slope, half, rate

    def _log_change(self, step: FloatArray, slope: FloatArray, *fixed: FloatArray) -> FloatArray:
        df, _ = fixed
        growth = np.expm1(step)
        # cosh(v + s) / cosh v - 1 = cosh s - 1 + slope sinh s, by exp(s) - 1 alone.
        change = growth * (slope + 0.5 * growth * (1 + slope)) / (1 + growth)
        value: FloatArray = -df * np.log1p(change)
        return value

    def _log_lower(self, z: FloatArray, *fixed: FloatArray) -> FloatArray:
        r"""Return log P(error <= z) for z <= 0.

        Notes
        -----
        With l = log(1 + z^2 / df) = 2 log cosh v and A = df l / 2,

        .. math:: F(z) = \frac{f(0)}{\sqrt{df}} e^{-A} J, \qquad
                  J = \int_0^\infty e^{-s} (1 - e^{-l - 2 s / df})^{-1/2} ds.

        Far out in v, where the tail is a power law, expanding the root gives J as a sum of
        (1/2)_k / k! e^{-l k} / (1 + 2 k / df). Elsewhere J is by Gauss-Laguerre quadrature where F
        would underflow, and where it would not, SciPy's own has all digits.
        """
        df, log_peak = fixed
        u = z / np.sqrt(df)
        log_kernel = _log1p_square(u)
        exponent = 0.5 * df * log_kernel
        outer = u < -math.sinh(_MIN_SERIES_V)
        far = ~outer & (exponent > _MAX_EXPONENT)
        near = ~outer & ~far
        log_integral = np.empty(u.shape)
        log_integral[outer] = _log_power_series(np.exp(-log_kernel[outer]), df[outer])
        total = np.zeros(np.count_nonzero(far))
        for node, weight in _LAGUERRE:
            total += weight / np.sqrt(-np.expm1(-log_kernel[far] - 2 * node / df[far]))
        log_integral[far] = np.log(total)
        value = np.asarray(log_peak - 0.5 * np.log(df) - exponent + log_integral)
        value[near] = np.log(special.stdtr(df[near], z[near]))
        return value


TAILS: dict[str, Tail] = {tail.name: tail for tail in (NormalTail(), StudentTail())}


def _log1p_square(u: FloatArray) -> FloatArray:
    """Return log(1 + u^2), also where the square overflows."""
    value = np.log1p(np.square(u))
    if np.any(far := np.isinf(value)):
        value = np.where(far, 2 * np.log(np.abs(np.where(far, u, 1.0))), value)
    return value


def _log_power_series(x: FloatArray, df: FloatArray) -> FloatArray:
    """Return log of the sum over k of (1/2)_k / k! x^k / (1 + 2 k / df), by Horner's scheme."""
    total = np.zeros(x.shape)
    for k, coefficient in _SERIES:
        total = total * x + coefficient / (1 + 2 * k / df)
    return np.log(total)


def _log_density_at_zero(df: FloatArray) -> FloatArray:
    """Return log f(0), from df = 30 by its series: the gamma functions cancel to eps df log df.

    SciPy's `poch` and `betaln` lose up to 7e-12 and 8e-10 of it.
    """
    gammas = special.gammaln(0.5 * df + 0.5) - special.gammaln(0.5 * df)
    exact = gammas - 0.5 * np.log(math.pi * df)
    r = 1 / df
    q = r * r
    series = r * (-1 / 4 + q * (1 / 24 + q * (-1 / 20 + q * (17 / 112 - q * (31 / 36)))))
    return np.where(df < 30, exact, series - 0.5 * LOG_2PI)
