r"""How the width of the coefficients depends on sigma, where rows are independent.

In unconstrained coordinates u (the prior's normal scores) a posterior is a funnel: the smaller
sigma, the better the coefficients are known. Given sigma, a direction of the coefficients about
which the rows hold the information d (at error variance 1) has the standard deviation

    s = (d / t^2 + 1)^(-1/2),      t^2 = sigma^2 + the rows' mean known variance,

the 1 being the prior's. Measured in units of its own s, a direction is nearly normal. The Jacobian
moves the mode from the joint mode, where sigma is too small (and with few rows runs to zero), to
the mode of sigma's own marginal.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ridgebayes._types import FloatArray
from ridgebayes.model.model import Model


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
        with np.errstate(divide="ignore"):
            return 0.5 * (np.log(variance) - np.log(self.information + variance))

    def slope(self, u_noise: FloatArray) -> FloatArray:
        """Return d/du_noise of the summed log scales, shape (n_noise,)."""
        h = 1e-4
        steps = h * np.eye(len(u_noise))
        up = self.log_scales(u_noise + steps).sum(axis=-1)
        return (up - self.log_scales(u_noise - steps).sum(axis=-1)) / (2 * h)

    def about(self, mode: FloatArray) -> "FunnelAbout":
        """Return the map between coefficients and directions in units of their widths."""
        k = len(self.basis)
        return FunnelAbout(self, mode[:k], self.log_scales(mode[k:]))


@dataclass(frozen=True, eq=False)
class FunnelAbout:
    """A funnel seen from a mode, where its scales are 1.

    Parameters
    ----------
    funnel : Funnel
        Scales.
    centre : ndarray of float, shape (n_coefficient,)
        Coefficients of the mode.
    log_scale : ndarray of float, shape (n_coefficient,)
        Log scales at the mode.
    """

    funnel: Funnel
    centre: FloatArray
    log_scale: FloatArray

    @property
    def n_coefficient(self) -> int:
        """Coefficients."""
        return len(self.centre)

    def forward(self, w: FloatArray, u_noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return coefficients' coordinates at `w`, and log |du/dw|."""
        basis, log_scale = self.funnel.basis, self.funnel.log_scales(u_noise) - self.log_scale
        return self.centre + (w @ basis * np.exp(log_scale)) @ basis.T, log_scale.sum(axis=-1)

    def inverse(self, u: FloatArray, u_noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return w of coefficients' coordinates, and log |du/dw|: the inverse of `forward`."""
        basis, log_scale = self.funnel.basis, self.funnel.log_scales(u_noise) - self.log_scale
        w = ((u - self.centre) @ basis * np.exp(-log_scale)) @ basis.T
        return w, log_scale.sum(axis=-1)
