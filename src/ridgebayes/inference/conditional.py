r"""Coefficients given the error model's parameters: nearly a linear-normal problem.

Log loads are nearly linear in the coefficients' unconstrained coordinates c, and given the error
model's parameters the rows' covariance is known. With J the rows' derivatives and r their residuals
at a reference c0, c is then normal with precision P and mean c0 + d,

.. math:: P = I + J' \Sigma^{-1} J, \qquad P d = -(c_0 + J' \Sigma^{-1} r).

Measured from that mean, in units of P's Cholesky factor, the coefficients no longer depend on the
error model: what is left to search, and to fit proposals to, is the error model's few parameters.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.model.conditional_offsets import cholesky_or_nan, solve_lower
from ridgebayes.model.model import Model

_BATCH = 1_024  # draws whose covariances are held at a time


@dataclass(frozen=True, eq=False)
class Conditional:
    """The normal approximation of the coefficients given the error model's parameters.

    Parameters
    ----------
    reference : ndarray of float, shape (n_coefficient,)
        Unconstrained coordinates that rows are linearised about.
    products : callable
        Unconstrained coordinates of the error model's parameters, (..., n_noise), to
        ``[J, r]' inverse(Sigma) [J, r]``, shape (..., n_coefficient + 1, n_coefficient + 1).
    """

    reference: FloatArray
    products: Callable[[FloatArray], FloatArray]

    @classmethod
    def of(cls, model: Model, reference: FloatArray) -> "Conditional":
        """Linearise a model's rows about coefficients."""
        columns = model.linearised(reference)
        return cls(reference, lambda u_noise: model.products(u_noise, columns))

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
        for i in range(0, len(flat), _BATCH):
            here = slice(i, i + _BATCH)
            with np.errstate(all="ignore"):
                products = self.products(flat[here])
            factor[here] = cholesky_or_nan(products[..., :k, :k] + np.eye(k))
            half = solve_lower(factor[here], (self.reference + products[..., :k, k])[..., None])
            step = solve_lower(factor[here], half, transposed=True)[..., 0]
            mean[here] = self.reference - step
        return factor.reshape(*lead, k, k), mean.reshape(*lead, k)


def _log_volume(factor: FloatArray) -> FloatArray:
    """Return log |du/dw|; of a covariance that cannot be factorised, that of no volume at all."""
    value = -np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum(axis=-1)
    return np.where(np.isnan(value), -np.inf, value)
