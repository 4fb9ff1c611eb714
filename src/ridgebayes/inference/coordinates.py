r"""Coordinates in which coefficients do not depend on the error model's parameters.

In unconstrained coordinates (the prior's normal scores) a posterior is a funnel: the smaller the
errors, the better the coefficients are known. Two maps take that out.

`Conditional` serves any rows. Log loads are nearly linear in the coefficients' coordinates c, and
given the error model's parameters the rows' covariance is known. With J the rows' derivatives and r
their residuals at a reference c0, c is then normal with precision P and mean c0 + d,

.. math:: P = I + J' \Sigma^{-1} J, \qquad P d = -(c_0 + J' \Sigma^{-1} r).

Coefficients are measured from that mean, in units of P's Cholesky factor: what is left to search,
and to fit proposals to, is the error model's few parameters.

`Funnel` serves exact, independent, normal rows of one known error. Given sigma, a direction of the
coefficients about which the rows hold the information d (at error variance 1) has the standard
deviation

    s = (d / t^2 + 1)^(-1/2),      t^2 = sigma^2 + the rows' known variance,

the 1 being the prior's. Measured in units of its own s, a direction is nearly normal. The Jacobian
moves the mode from the joint mode, where sigma is too small (and with few rows runs to zero), to
the mode of sigma's own marginal. The centre moves too, since rows and prior share the say on it. At
the mode, c0 and t0, they pull with equal force, -c0 and +c0. At another t the rows pull with
c0 t0^2/t^2, and the centre is, direction by direction,

    c0 - c0 (t^2 - t0^2) / (d + t^2).

Few rows leave mass at a sigma so small that this is thousands of times s: proposals about one
centre never come near it, and an evidence by them lacks that mass.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ridgebayes._types import FloatArray
from ridgebayes.model.cholesky import cholesky_or_nan, solve_lower
from ridgebayes.model.forms import PowerLaw
from ridgebayes.model.model import Model


@dataclass(frozen=True, eq=False)
class Conditional:
    """The normal approximation of the coefficients given the error model's parameters.

    Parameters
    ----------
    reference : ndarray of float, shape (n_coefficient,)
        Unconstrained coordinates that rows are linearised about.
    columns : ndarray of float, shape (n_obs, n_coefficient + 1)
        J, and last r.
    products : callable
        Unconstrained coordinates of the error model's parameters, (..., n_noise), and columns X to
        ``X' inverse(Sigma) X``: `Model.products`.
    n_at_once : int, optional
        Draws whose covariances are held at a time: those whose likelihood is asked for next.
    """

    reference: FloatArray
    columns: FloatArray
    products: Callable[[FloatArray, FloatArray], FloatArray]
    n_at_once: int = 1_024

    @classmethod
    def of(cls, model: Model, reference: FloatArray) -> "Conditional":
        """Linearise a model's rows about coefficients.

        Of a power law with weights of rows it is about each K that lies amid its own rows: from
        elsewhere all of them look like outliers, the more so the smaller sigma.
        """
        if model.is_latent and isinstance(model.form, PowerLaw):
            reference = _amid_rows(model, reference)
        columns = model.linearised(reference)
        return cls(reference, columns, model.products, model.n_at_once)

    @property
    def n_coefficient(self) -> int:
        """Coefficients."""
        return len(self.reference)

    def forward(self, w: FloatArray, u_noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return coefficients' coordinates of standard normals `w`, and log |du/dw|."""
        factor, mean = self._factor_and_mean(u_noise)
        step = solve_lower(factor, w[..., None], transposed=True)[..., 0]
        return mean + step, _log_volume(factor)

    def inverse(self, u: FloatArray, u_noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the standard normals of coefficients' coordinates: the inverse of `forward`."""
        factor, mean = self._factor_and_mean(u_noise)
        return np.einsum("...ji,...j->...i", factor, u - mean), _log_volume(factor)

    def _factor_and_mean(self, u_noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        lead, k = u_noise.shape[:-1], len(self.reference)
        flat = u_noise.reshape(math.prod(lead), u_noise.shape[-1])
        factor, mean = np.empty((len(flat), k, k)), np.empty((len(flat), k))
        for i in range(0, len(flat), self.n_at_once):
            here = slice(i, i + self.n_at_once)
            with np.errstate(all="ignore"):
                products = self.products(flat[here], self.columns)
            factor[here] = cholesky_or_nan(products[..., :k, :k] + np.eye(k))
            half = solve_lower(factor[here], (self.reference + products[..., :k, k])[..., None])
            step = solve_lower(factor[here], half, transposed=True)[..., 0]
            mean[here] = self.reference - step
        return factor.reshape(*lead, k, k), mean.reshape(*lead, k)


def _amid_rows(model: Model, reference: FloatArray) -> FloatArray:
    """Return coordinates of K at which the residuals of each texture have the median 0."""
    linear, step = model.linearised(reference), np.zeros_like(reference)
    for j in range(len(reference)):
        its = linear[model.data.texture == j]
        step[j] = np.median(its[:, -1]) / its[0, j]
    return reference - step


class NoCoefficients:
    """The frame of a posterior that has none: its coordinates are as they are."""

    n_coefficient = 0

    def forward(self, w: FloatArray, u_noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return `w`, of length 0, and the log of a volume of 1."""
        return w, np.zeros(u_noise.shape[:-1])

    inverse = forward


def _log_volume(factor: FloatArray) -> FloatArray:
    """Return log |du/dw|; of a covariance that cannot be factorised, that of no volume at all."""
    value = -np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum(axis=-1)
    return np.where(np.isnan(value), -np.inf, value)


@dataclass(frozen=True, eq=False)
class Funnel:
    """The scale of each direction of the coefficients given sigma.

    Parameters
    ----------
    basis : ndarray of float, shape (n_coefficient, n_coefficient)
        Orthonormal directions, in its columns.
    information : ndarray of float, shape (n_coefficient,)
        What the rows know of each at error variance 1.
    error_variance : callable
        Unconstrained coordinate of sigma, (..., 1), to t^2, (...).
    """

    basis: FloatArray
    information: FloatArray
    error_variance: Callable[[FloatArray], FloatArray]

    @classmethod
    def of(cls, model: Model, u: FloatArray) -> "Funnel":
        """Take the directions from the rows' information at `u`."""
        information, basis = linalg.eigh(model.information(u))
        return cls(basis, np.maximum(information, 0.0), model.error_variance)

    def log_scales(self, u_noise: FloatArray) -> FloatArray:
        """Return log s of each direction, shape ``u_noise.shape[:-1] + (n_coefficient,)``."""
        variance = self.error_variance(u_noise)[..., None]
        with np.errstate(all="ignore"):  # far out a variance is 0 or infinite
            odds = np.where(self.information > 0, self.information / variance, 0.0)
        return -0.5 * np.log1p(odds)

    def slope(self, u_noise: FloatArray) -> FloatArray:
        """Return d/du_noise of the summed log scales, shape (n_noise,)."""
        h = 1e-4
        steps = h * np.eye(len(u_noise))
        up = self.log_scales(u_noise + steps).sum(axis=-1)
        value: FloatArray = (up - self.log_scales(u_noise - steps).sum(axis=-1)) / (2 * h)
        return value

    def about(self, mode: FloatArray) -> "FunnelAbout":
        """Return the map between coefficients and directions in units of their widths."""
        k = len(self.basis)
        return FunnelAbout(self, mode[:k], mode[k:], self.log_scales(mode[k:]))


@dataclass(frozen=True, eq=False)
class FunnelAbout:
    """A funnel seen from a mode, where its scales are 1 and its centre is.

    Parameters
    ----------
    funnel : Funnel
        Scales.
    centre : ndarray of float, shape (n_coefficient,)
        Coefficients of the mode.
    noise : ndarray of float, shape (n_noise,)
        Error model's parameters of the mode.
    log_scale : ndarray of float, shape (n_coefficient,)
        Log scales at the mode.
    """

    funnel: Funnel
    centre: FloatArray
    noise: FloatArray
    log_scale: FloatArray

    @property
    def n_coefficient(self) -> int:
        """Coefficients."""
        return len(self.centre)

    def forward(self, w: FloatArray, u_noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return coefficients' coordinates at `w`, and log |du/dw|."""
        basis, log_scale = self.funnel.basis, self.funnel.log_scales(u_noise) - self.log_scale
        step = w @ basis * np.exp(log_scale) + self._shift(u_noise)
        return self.centre + step @ basis.T, log_scale.sum(axis=-1)

    def inverse(self, u: FloatArray, u_noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return w of coefficients' coordinates, and log |du/dw|: the inverse of `forward`."""
        basis, log_scale = self.funnel.basis, self.funnel.log_scales(u_noise) - self.log_scale
        step = (u - self.centre) @ basis - self._shift(u_noise)
        return step * np.exp(-log_scale) @ basis.T, log_scale.sum(axis=-1)

    @property
    def slope(self) -> FloatArray:
        """How the coefficients' centre moves with u_noise at the mode, (n_coefficient, n_noise)."""
        h = 1e-4
        steps = self.noise + h * np.concatenate([np.eye(len(self.noise)), -np.eye(len(self.noise))])
        up, down = np.split(self._shift(steps) @ self.funnel.basis.T, 2)
        return (up - down).T / (2 * h)

    def _shift(self, u_noise: FloatArray) -> FloatArray:
        """Return how far the centre is from the mode's, in the basis, (..., n_coefficient)."""
        variance = self.funnel.error_variance(u_noise)[..., None]
        information = self.funnel.information
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            moved = variance - self.funnel.error_variance(self.noise)
            share = np.where(np.isposinf(variance), 1.0, moved / (information + variance))
        # What no row knows of stays where its prior has it.
        return -(self.centre @ self.funnel.basis) * np.where(information > 0, share, 0.0)
