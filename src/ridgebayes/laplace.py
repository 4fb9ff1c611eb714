r"""The normal approximation of a posterior, in coordinates that suit it.

In unconstrained coordinates u (the prior's normal scores) a posterior is a funnel: the smaller
sigma, the better the coefficients are known. Given sigma, a direction of the coefficients about
which the rows hold the information d (at error variance 1) has the standard deviation

    s = (d / t^2 + 1)^(-1/2),      t^2 = sigma^2 + the rows' mean known variance + what shared
                                         offsets add to a mean over all rows,

the 1 being the prior's. In coordinates w, in which each such direction is measured in units of its
own s, the posterior is nearly normal. The Jacobian moves the mode from the joint mode, where sigma
is too small (and with few rows runs to zero), to the mode of sigma's own marginal.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import linalg, optimize

from ridgebayes._types import FloatArray
from ridgebayes.errors import ComputationError
from ridgebayes.likelihood import Model

_ROUGH_TOL = 1e-2  # accepted distance from the mode where gradients are numerical, in sds
_RUNAWAY = 25.0  # prior sds from the prior's centre at which a search has run away


@dataclass(frozen=True, eq=False)
class Funnel:
    """How the scale of each direction of the coefficients depends on the error model's parameters.

    Parameters
    ----------
    basis : ndarray of float, shape (n_coefficient, n_coefficient)
        Orthonormal directions, in its columns.
    information : ndarray of float, shape (n_coefficient,)
        What the rows know of each at error variance 1.
    error_variance : callable
        Unconstrained coordinates of the error model's parameters, (..., n_noise), to t^2, (...).
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


@dataclass(frozen=True, eq=False)
class Laplace:
    """Normal approximation of a posterior, and the whitened coordinates it defines.

    Parameters
    ----------
    mode : ndarray of float, shape (n_coordinate,)
        Mode in the coordinates w, given in u: coefficients, the error model's parameters, and
        zeros for offsets that are sampled.
    factor : ndarray of float, shape (n_coordinate, n_coordinate)
        Lower Cholesky factor of the covariance of w.
    log_density : float
        Log posterior density in u at the mode, not normalised.
    funnel : Funnel
        The scales of w.
    n_noise : int
        Parameters of the error model.
    is_mode : bool
        Whether the mode was found; else the coordinates are useful all the same.
    """

    mode: FloatArray
    factor: FloatArray
    log_density: float
    funnel: Funnel
    n_noise: int
    is_mode: bool = True

    def unwhiten(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return u at w = factor z, and log |du/dw|.

        Parameters
        ----------
        z : ndarray of float, shape (..., n_coordinate)
            Whitened coordinates: standard normal as far as the approximation is right.

        Returns
        -------
        u : ndarray of float, shape (..., n_coordinate)
            Unconstrained coordinates.
        log_jacobian : ndarray of float, shape (...)
            Log |du/dw|.
        """
        w, basis = z @ self.factor.T, self.funnel.basis
        k = len(basis)
        log_scale = self._log_scale(self.mode[self._noise] + w[..., self._noise])
        w[..., :k] = (w[..., :k] @ basis * np.exp(log_scale)) @ basis.T
        return self.mode + w, log_scale.sum(axis=-1)

    def whiten(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return z of u, and log |du/dw| there: the inverse of `unwhiten`."""
        w, basis = u - self.mode, self.funnel.basis
        k = len(basis)
        log_scale = self._log_scale(u[..., self._noise])
        w[..., :k] = (w[..., :k] @ basis * np.exp(-log_scale)) @ basis.T
        flat = w.reshape(-1, w.shape[-1]).T
        return _solve_lower(self.factor, flat).T.reshape(w.shape), log_scale.sum(axis=-1)

    @property
    def n_latent(self) -> int:
        """Coordinates of sampled offsets, the last ones."""
        return len(self.mode) - len(self.funnel.basis) - self.n_noise

    @property
    def _noise(self) -> slice:
        k = len(self.funnel.basis)
        return slice(k, k + self.n_noise)

    def _log_scale(self, u_noise: FloatArray) -> FloatArray:
        return self.funnel.log_scales(u_noise) - self.funnel.log_scales(self.mode[self._noise])

    @property
    def log_volume(self) -> float:
        """Log |dw/dz|: the volume of the unit cube of z in w."""
        return float(np.log(np.diag(self.factor)).sum())

    @property
    def log_evidence(self) -> float:
        """Laplace's approximation of the log evidence."""
        return self.log_density + 0.5 * len(self.mode) * math.log(2 * math.pi) + self.log_volume


def fit_laplace(model: Model, *, tol: float = 1e-4) -> Laplace:
    """Find the posterior's mode and its curvature there.

    Parameters
    ----------
    model : Model
        Posterior.
    tol : float, optional
        Largest distance from the mode that is accepted, in posterior standard deviations, where
        gradients are analytic.

    Returns
    -------
    Laplace
        Mode, covariance factor and density.

    Raises
    ------
    ComputationError
        If there is no interior mode: the search runs away, or the curvature is not definite.

    Notes
    -----
    Where offsets are sampled, the mode is that of the parameters with the rows taken as normal, and
    the offsets' own coordinates are standard normal to begin with.

    *Validity.* Perfect data (rows without misfit, more of them than coefficients) send sigma to
    zero, where the approximation is undefined; the search says so instead of returning a point on
    the way.
    """
    u = np.zeros(model.n_parameter)
    for _ in range(2):  # directions of the funnel at the prior's centre, then at the mode
        funnel = Funnel.of(model, u)
        u = _search(model, funnel, u)
    precision = _curvature(model, funnel, u)
    try:
        root = linalg.cholesky(precision, lower=True)
    except (linalg.LinAlgError, ValueError):
        root = np.full_like(precision, np.nan)
    # How far the mode still is, in posterior sds: the search's own flag gives up on rounding.
    decrement = float(np.linalg.norm(_solve_lower(root, _gradient(model, funnel, u))))
    is_mode = decrement < (tol if model.is_plain else _ROUGH_TOL)
    if not is_mode:
        if model.is_plain or not np.all(np.abs(u) < _RUNAWAY):
            raise ComputationError(
                f"{model.form.name}: the posterior has no interior mode: the form reproduces all "
                "rows, or nearly, and sigma has no lower bound; add rows, or leave the form out"
            )
        # Humps and kinks of a Student posterior: coordinates need a scale, not the very mode.
        values, vectors = linalg.eigh(precision)
        root = linalg.cholesky((vectors * np.maximum(np.abs(values), 1)) @ vectors.T, lower=True)
    covariance = linalg.cho_solve((root, True), np.eye(len(u)))
    n_latent = model.n_coordinate - model.n_parameter
    factor = linalg.block_diag(linalg.cholesky(covariance, lower=True), np.eye(n_latent))
    mode = np.concatenate([u, np.zeros(n_latent)])
    n_noise = model.n_parameter - model.n_coefficient
    return Laplace(mode, factor, float(model.log_density(mode)), funnel, n_noise, is_mode)


def _search(model: Model, funnel: Funnel, start: FloatArray) -> FloatArray:
    """Return the minimiser of minus the log density in w, as far as the search gets."""

    def negative(u: FloatArray) -> float:
        scales = funnel.log_scales(u[model.n_coefficient :])
        value = -float(model.marginal_log_density(u)) - float(scales.sum())
        return value if math.isfinite(value) else 1e300

    if not model.is_plain:  # numerical gradients are too dear, and too rough, for curvatures
        found = optimize.minimize(
            negative, start, jac=lambda u: _gradient(model, funnel, u), method="BFGS"
        )
        return found.x
    try:
        return optimize.minimize(
            negative,
            start,
            jac=lambda u: _gradient(model, funnel, u),
            hess=lambda u: _curvature(model, funnel, u),
            method="trust-exact",
            options={"gtol": 1e-6, "maxiter": 500},
        ).x
    except ValueError:  # a curvature that is not finite: sigma has run away
        return np.full_like(start, np.nan)


def _gradient(model: Model, funnel: Funnel, u: FloatArray) -> FloatArray:
    with np.errstate(all="ignore"):
        slope = -model.marginal_gradient(u)
        slope[model.n_coefficient :] -= funnel.slope(u[model.n_coefficient :])
    return slope


def _curvature(model: Model, funnel: Funnel, u: FloatArray) -> FloatArray:
    """Hessian by central differences of the gradient, one step size per coordinate."""
    n = len(u)
    hessian = np.empty((n, n))
    for i in range(n):
        # A rough curvature first, then a step of a hundredth of the width that it implies (a tenth
        # of numerical gradients): truncation 1e-4 (1e-2) of the fourth derivative's effect.
        probe, first = np.zeros(n), 1e-5 if model.is_plain else 1e-2
        probe[i] = first
        up, down = _gradient(model, funnel, u + probe), _gradient(model, funnel, u - probe)
        rough = abs(up[i] - down[i]) / (2 * first)
        step = 1e-2 if model.is_plain else 0.1
        probe[i] = step / math.sqrt(max(rough, 1e-4)) if math.isfinite(rough) else first
        up, down = _gradient(model, funnel, u + probe), _gradient(model, funnel, u - probe)
        hessian[i] = (up - down) / (2 * probe[i])
    return 0.5 * (hessian + hessian.T)


def _solve_lower(factor: FloatArray, right: FloatArray) -> FloatArray:
    return linalg.solve_triangular(factor, right, lower=True, check_finite=False)
