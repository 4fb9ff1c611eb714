r"""The normal approximation of a posterior, in coordinates that suit it.

In unconstrained coordinates u (the prior's normal scores) a posterior is a funnel: the smaller
sigma, the better the coefficients are known. Given sigma, a direction of the coefficients about
which the rows hold the information d (at error variance 1) has the standard deviation

    s = (d / t^2 + 1)^(-1/2),      t^2 = sigma^2 + the rows' mean known variance,

the 1 being the prior's. In coordinates w, in which each such direction is measured in units of its
own s, the posterior is nearly normal. The Jacobian moves the mode from the joint mode, where sigma
is too small (and with few rows runs to zero), to the mode of sigma's own marginal.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg, optimize

from ridgebayes._types import FloatArray
from ridgebayes.errors import ComputationError
from ridgebayes.likelihood import Model
from ridgebayes.priors import Prior


@dataclass(frozen=True, eq=False)
class Funnel:
    """How the scale of each direction of the coefficients depends on sigma.

    Parameters
    ----------
    basis : ndarray of float, shape (n_coefficient, n_coefficient)
        Orthonormal directions, in its columns.
    information : ndarray of float, shape (n_coefficient,)
        What the rows know of each at error variance 1.
    known_variance : float
        Mean squared known relative error of the rows.
    sigma_prior : Prior
        Says which sigma its unconstrained coordinate is.
    """

    basis: FloatArray
    information: FloatArray
    known_variance: float
    sigma_prior: Prior

    @classmethod
    def of(cls, model: Model, u: FloatArray) -> "Funnel":
        """Take the directions from the rows' information at `u`."""
        information, basis = linalg.eigh(model.information(u))
        known = float(np.mean(model.data.rel_se**2))
        prior = model.priors["sigma"]
        return cls(basis, np.maximum(information, 0.0), known, prior)

    def log_scales(self, u_sigma: FloatArray) -> FloatArray:
        """Return log s of each direction, shape ``u_sigma.shape + (n_coefficient,)``."""
        variance = self._variance(u_sigma)[..., None]
        with np.errstate(divide="ignore"):
            return 0.5 * (np.log(variance) - np.log(self.information + variance))

    def slope(self, u_sigma: float) -> float:
        """Return d/du of the summed log scales."""
        sigma = float(self.sigma_prior.value_at(u_sigma))
        variance = float(self._variance(np.array(u_sigma)))
        growth = 2 * sigma * float(self.sigma_prior.slope_at(u_sigma))
        share = self.information / (self.information + variance)
        return 0.5 * float(share.sum()) / max(variance, 1e-300) * growth

    def _variance(self, u_sigma: FloatArray) -> FloatArray:
        return self.sigma_prior.value_at(u_sigma) ** 2 + self.known_variance


@dataclass(frozen=True, eq=False)
class Laplace:
    """Normal approximation of a posterior, and the whitened coordinates it defines.

    Parameters
    ----------
    mode : ndarray of float, shape (n_parameter,)
        Mode in the coordinates w, given in u; the coefficients, then sigma's coordinate.
    factor : ndarray of float, shape (n_parameter, n_parameter)
        Lower Cholesky factor of the covariance of w.
    log_density : float
        Log posterior density in u at the mode, not normalised.
    funnel : Funnel
        The scales of w.
    """

    mode: FloatArray
    factor: FloatArray
    log_density: float
    funnel: Funnel

    def unwhiten(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return u at w = factor z, and log |du/dw|.

        Parameters
        ----------
        z : ndarray of float, shape (..., n_parameter)
            Whitened coordinates: standard normal as far as the approximation is right.

        Returns
        -------
        u : ndarray of float, shape (..., n_parameter)
            Unconstrained coordinates.
        log_jacobian : ndarray of float, shape (...)
            Log |du/dw|.
        """
        w = z @ self.factor.T
        log_scale = self._log_scale(self.mode[-1] + w[..., -1])
        w[..., :-1] = (w[..., :-1] @ self.funnel.basis * np.exp(log_scale)) @ self.funnel.basis.T
        return self.mode + w, log_scale.sum(axis=-1)

    def whiten(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return z of u, and log |du/dw| there: the inverse of `unwhiten`."""
        w = u - self.mode
        log_scale = self._log_scale(u[..., -1])
        w[..., :-1] = (w[..., :-1] @ self.funnel.basis * np.exp(-log_scale)) @ self.funnel.basis.T
        flat = w.reshape(-1, w.shape[-1]).T
        return _solve_lower(self.factor, flat).T.reshape(w.shape), log_scale.sum(axis=-1)

    def _log_scale(self, u_sigma: FloatArray) -> FloatArray:
        return self.funnel.log_scales(u_sigma) - self.funnel.log_scales(self.mode[-1])

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
        Largest distance from the mode that is accepted, in posterior standard deviations.

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
    decrement = np.linalg.norm(_solve_lower(root, _gradient(model, funnel, u)))
    if not decrement < tol:
        raise ComputationError(
            f"{model.form.name}: the posterior has no interior mode: the form reproduces all rows, "
            "or nearly, and sigma has no lower bound; add rows, or leave the form out"
        )
    covariance = linalg.cho_solve((root, True), np.eye(len(u)))
    factor = linalg.cholesky(covariance, lower=True)
    return Laplace(u, factor, float(model.log_density(u)), funnel)


def _search(model: Model, funnel: Funnel, start: FloatArray) -> FloatArray:
    """Return the minimiser of minus the log density in w, as far as the search gets."""

    def negative(u: FloatArray) -> float:
        value = -float(model.log_density(u)) - float(funnel.log_scales(u[-1]).sum())
        return value if math.isfinite(value) else 1e300

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
        slope = -model.log_density_gradient(u)
        slope[-1] -= funnel.slope(u[-1])
    return slope


def _curvature(model: Model, funnel: Funnel, u: FloatArray) -> FloatArray:
    """Hessian by central differences of the gradient, one step size per coordinate."""
    n = len(u)
    hessian = np.empty((n, n))
    for i in range(n):
        # A rough curvature first, then a step of a hundredth of the width that it implies:
        # truncation 1e-4 of the third derivative's effect, rounding far below it.
        probe = np.zeros(n)
        probe[i] = 1e-5
        up, down = _gradient(model, funnel, u + probe), _gradient(model, funnel, u - probe)
        rough = abs(up[i] - down[i]) / 2e-5
        probe[i] = 1e-2 / math.sqrt(max(rough, 1e-4)) if math.isfinite(rough) else 1e-5
        up, down = _gradient(model, funnel, u + probe), _gradient(model, funnel, u - probe)
        hessian[i] = (up - down) / (2 * probe[i])
    return 0.5 * (hessian + hessian.T)


def _solve_lower(factor: FloatArray, right: FloatArray) -> FloatArray:
    return linalg.solve_triangular(factor, right, lower=True, check_finite=False)
