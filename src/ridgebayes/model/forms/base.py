"""The abstract base class of contact forms, with loads and counts common to all forms."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import Texture, reduced_load
from ridgebayes.errors import InputError
from ridgebayes.model.forms.arguments import aligned, even_counts, loads, widths

MAX_COEFFICIENT = 1e60  # keeps rates finite for all allowed widths


@dataclass(frozen=True)
class Form(ABC):
    """A contact form; subclasses define `parameter_names` and the five abstract methods.

    `Q`, `a_over_R`, `b_over_R`, `p_over_E` and `nu` broadcast as in NumPy. The leading axes of
    `theta`, for example draws, come first: results have shape ``theta.shape[:-1] + shape``, with
    `shape` the broadcast shape. One call with ``a_over_R[:, None]`` and ``p_over_E[None, :]`` thus
    evaluates a grid of draws x textures x loads. If `theta` is not given, the published
    coefficients are used.

    Examples
    --------
    s = sqrt(p/E) at a transition is shape over rate, and dQ'/ds is K = 2 rate for Hybrid:

    >>> import ridgebayes as rb
    >>> form, theta, texture = rb.Hybrid(), np.array([1.348, 0.01583]), (0.022, 0.02)
    >>> form.parameter_names, form.bind((texture,)) is form
    (('c1', 'c2'), True)
    >>> rate = form.rate(theta, *texture)
    >>> float(form.shape(6, *texture)), bool(np.isclose(form.load(6, *texture), (2 / rate) ** 2))
    (2.0, True)
    >>> float(form.pairs(np.array(2.0), *texture)), bool(form.slope(*texture) == 2 * rate)
    (2.0, True)
    >>> (form.log_rate_gradient(theta, *texture) * rate).round(1).tolist()  # 1/0.042 and 1/0.022
    [23.8, 45.5]
    """

    name: ClassVar[str]
    published: ClassVar[tuple[float, ...] | None] = None

    @property
    @abstractmethod
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the coefficients, in the order of the last axis of `theta`."""

    @abstractmethod
    def shape(self, Q: ArrayLike, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        """Return s times rate at the transition to `Q`, which does not depend on coefficients.

        Parameters
        ----------
        Q : array_like of int, broadcastable, dimensionless
            Counts.
        a_over_R, b_over_R : array_like of float, broadcastable, dimensionless
            Ridge and groove width over radius.

        Returns
        -------
        ndarray of float, broadcast shape, dimensionless
            Positive for Q >= 4.
        """

    @abstractmethod
    def pairs(self, shape: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        """Return the continuous number of pairs h = Q'/2 - 1 at ``shape = s rate``.

        Parameters
        ----------
        shape : ndarray of float, broadcastable, dimensionless
            s times rate.
        a_over_R, b_over_R : array_like of float, broadcastable, dimensionless
            Ridge and groove width over radius.

        Returns
        -------
        ndarray of float, broadcast shape, dimensionless
            Pairs beyond the first.
        """

    @abstractmethod
    def rate(self, theta: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        """Return the rate, which depends on the coefficients but not on `Q`.

        Parameters
        ----------
        theta : ndarray of float, shape (..., n_parameter), dimensionless
            Coefficients.
        a_over_R, b_over_R : array_like of float, broadcastable, dimensionless
            Ridge and groove width over radius.

        Returns
        -------
        ndarray of float, shape theta.shape[:-1] + broadcast shape, dimensionless
            Zero or negative if no load reaches a further ridge.
        """

    @abstractmethod
    def log_rate_gradient(
        self, theta: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike
    ) -> FloatArray:
        """Return d log rate / d theta.

        Parameters
        ----------
        theta, a_over_R, b_over_R : array_like of float, broadcastable, dimensionless
            As for `rate`.

        Returns
        -------
        ndarray of float, shape theta.shape[:-1] + broadcast shape + (n_parameter,), dimensionless
            Gradient.
        """

    @abstractmethod
    def slope(
        self, a_over_R: ArrayLike, b_over_R: ArrayLike, theta: ArrayLike | None = None
    ) -> FloatArray:
        """Return K, the slope dQ'/ds of a texture.

        Parameters
        ----------
        a_over_R, b_over_R : array_like of float, broadcastable, dimensionless
            Ridge and groove width over radius.
        theta : array_like of float, shape (..., n_parameter), dimensionless
            Coefficients; the published ones if not given.

        Returns
        -------
        ndarray of float, shape theta.shape[:-1] + broadcast shape, dimensionless
            Slope.

        Raises
        ------
        InputError
            If a width or a coefficient is out of range.
        """

    def bind(self, textures: tuple[Texture, ...], labels: tuple[str, ...] = ()) -> "Form":
        """Return the form for given textures, if it has a coefficient for each texture.

        Parameters
        ----------
        textures : tuple of (float, float)
            a/R and b/R of each texture.
        labels : tuple of str, optional
            Names of the textures.

        Returns
        -------
        Form
            The same form, unless its coefficients belong to textures.
        """
        return self

    def load(
        self,
        Q: ArrayLike,
        a_over_R: ArrayLike,
        b_over_R: ArrayLike,
        theta: ArrayLike | None = None,
        nu: ArrayLike = 0.5,
    ) -> FloatArray:
        """Return the load p/E at which `Q` proximal edges are reached.

        Parameters
        ----------
        Q : array_like of int, broadcastable, dimensionless
            Even counts, at least 2.
        a_over_R, b_over_R : array_like of float, broadcastable, dimensionless
            Ridge and groove width over radius.
        theta : array_like of float, shape (..., n_parameter), dimensionless
            Coefficients; the published ones if not given.
        nu : array_like of float, broadcastable, dimensionless
            Poisson's ratio.

        Returns
        -------
        ndarray of float, shape theta.shape[:-1] + broadcast shape, dimensionless
            p/E; NaN if the rate is not positive (no load reaches a further ridge), infinite if the
            rate is so small that the load overflows.

        Raises
        ------
        InputError
            If a count is odd, below 2 or above 2^53, a width is outside 1e-50 to 1e50, shapes do
            not broadcast, a coefficient is not finite or larger than 1e60 in size, or the form has
            no published coefficients and `theta` is not given.

        Notes
        -----
        *Validity.* Small strain, `nu` from 0 to 0.5, and textures similar to the calibrated
        textures. A form does not store the calibrated range; `Fit.predict` flags extrapolation.

        Examples
        --------
        The Modified form reaches one more pair at s = L/c; here L = 0.0276, s = 0.02:

        >>> from ridgebayes.model.forms import Modified
        >>> float(Modified().load(4, 0.0138, 0.0138).round(12))
        0.0004
        """
        Q = even_counts(Q)
        a, b = aligned(*widths(a_over_R, b_over_R), Q=Q, nu=nu)
        return self._load(Q, a, b, self.rate(self._theta(theta), a, b), nu)

    def _load(
        self, Q: FloatArray, a: FloatArray, b: FloatArray, rate: FloatArray, nu: ArrayLike
    ) -> FloatArray:
        """Return the load; `Q` may already have the leading axes of the draws."""
        with np.errstate(over="ignore"):
            s = self.shape(Q, a, b) / np.where(rate > 0, rate, np.nan)
            return s * s / reduced_load(1.0, nu)

    def continuous_count(
        self,
        p_over_E: ArrayLike,
        a_over_R: ArrayLike,
        b_over_R: ArrayLike,
        theta: ArrayLike | None = None,
        nu: ArrayLike = 0.5,
    ) -> FloatArray:
        """Return Q', the count before it is rounded down to an even number.

        Parameters
        ----------
        p_over_E : array_like of float, broadcastable, dimensionless
            Normalised load, at least 0.
        a_over_R, b_over_R, theta, nu : array_like of float, broadcastable, dimensionless
            As for `load`.

        Returns
        -------
        ndarray of float, shape theta.shape[:-1] + broadcast shape, dimensionless
            Q'; below 2 at small loads for the Classic form, in line with its equation. NaN if the
            rate is not positive.

        Raises
        ------
        InputError
            If a load is negative or above 1e300, or for widths and coefficients as in `load`.

        Notes
        -----
        *Validity.* As for `load`.

        Examples
        --------
        >>> from ridgebayes.model.forms import Hybrid
        >>> float(Hybrid().continuous_count(0.0, 0.02, 0.03))
        2.0
        """
        p = loads(p_over_E)
        a, b = aligned(*widths(a_over_R, b_over_R), p_over_E=p, nu=nu)
        rate = self.rate(self._theta(theta), a, b)
        s = np.sqrt(reduced_load(p, nu))
        return 2 + 2 * self.pairs(s * np.where(rate > 0, rate, np.nan), a, b)

    def count(
        self,
        p_over_E: ArrayLike,
        a_over_R: ArrayLike,
        b_over_R: ArrayLike,
        theta: ArrayLike | None = None,
        nu: ArrayLike = 0.5,
    ) -> IntArray:
        """Return Q, the largest even count with a load of at most `p_over_E`; at least 2.

        Parameters
        ----------
        p_over_E, a_over_R, b_over_R, theta, nu : array_like of float, broadcastable, dimensionless
            As for `continuous_count`.

        Returns
        -------
        ndarray of int, shape theta.shape[:-1] + broadcast shape, dimensionless
            Even counts.

        Raises
        ------
        InputError
            As `continuous_count`; also if a count is above 2^52, where floats cannot separate
            pairs, or if a rate is not positive.

        Notes
        -----
        *Accuracy.* Q' is only a first guess, which is then compared with `load`, so that rounding
        never loses a pair: at a load that `load` returned, the count is exactly the same Q.

        Examples
        --------
        >>> from ridgebayes.model.forms import Hybrid
        >>> form = Hybrid()
        >>> int(form.count(form.load(1_000_000, 0.012, 0.03), 0.012, 0.03))
        1000000
        """
        guess = self.continuous_count(p_over_E, a_over_R, b_over_R, theta, nu)
        if np.any(np.isnan(guess)):
            raise InputError("theta: expected a positive rate of every texture, got a rate <= 0")
        if np.any(guess > 2**52):
            raise InputError(f"p_over_E: expected counts up to 2^52, got {p_over_E!r}")
        pairs, p = np.maximum(np.floor(guess / 2 - 1), 0), np.asarray(p_over_E, dtype=float)
        a, b = aligned(*widths(a_over_R, b_over_R), p_over_E=p, nu=nu)
        rate = self.rate(self._theta(theta), a, b)
        # The guess can be wrong by one pair; the second pass confirms the result.
        for _ in range(2):
            up = self._load(2 * pairs + 4, a, b, rate, nu) <= p
            down = self._load(2 * pairs + 2, a, b, rate, nu) > p
            pairs = np.maximum(pairs + up - down, 0)
        return (2 * pairs + 2).astype(np.int64)

    def log_load_gradient(
        self, theta: ArrayLike, a_over_R: ArrayLike, b_over_R: ArrayLike
    ) -> FloatArray:
        """Return d log(p/E) / d theta of a texture, which does not depend on Q.

        The gradient is NaN if the rate is not positive.

        Parameters
        ----------
        theta : array_like of float, shape (..., n_parameter), dimensionless
            Coefficients.
        a_over_R, b_over_R : array_like of float, broadcastable, dimensionless
            Ridge and groove width over radius.

        Returns
        -------
        ndarray of float, shape theta.shape[:-1] + broadcast shape + (n_parameter,), dimensionless
            Gradient.

        Examples
        --------
        >>> from ridgebayes.model.forms import Modified
        >>> Modified().log_load_gradient([2.0], 0.02, 0.03).tolist()
        [-1.0]
        """
        values, (a, b) = self._theta(theta), widths(a_over_R, b_over_R)
        rate = self.rate(values, a, b)[..., None]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(rate > 0, -2 * self.log_rate_gradient(values, a, b), np.nan)

    def _theta(self, theta: ArrayLike | None) -> FloatArray:
        if theta is None:
            if self.published is None:
                raise InputError(f"{self.name}: no published coefficients; pass theta")
            theta = self.published
        values = np.atleast_1d(np.asarray(theta, dtype=float))
        if values.shape[-1] != len(self.parameter_names):
            raise InputError(
                f"{self.name}: theta: expected {len(self.parameter_names)} coefficients on its "
                f"last axis ({', '.join(self.parameter_names)}), got {values.shape[-1]}"
            )
        out_of_range = ~(np.abs(values) <= MAX_COEFFICIENT)
        if np.any(out_of_range):
            raise InputError(
                f"{self.name}: theta: expected finite, -{MAX_COEFFICIENT:g} to "
                f"{MAX_COEFFICIENT:g}, got {values[out_of_range][0]!s}"
            )
        return values
