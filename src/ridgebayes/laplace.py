r"""The normal approximation of a posterior, in coordinates that suit it.

Coefficients are known the better the smaller the errors are: in unconstrained coordinates a
posterior is a funnel. Coordinates w take that out, by `funnel` where rows are exact, independent
and normal, by `conditional` otherwise. In w a posterior is nearly normal: there its mode and
curvature are found, proposals are fitted, evidences integrated.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import linalg, optimize

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.conditional import Conditional
from ridgebayes.errors import ComputationError
from ridgebayes.funnel import Funnel, FunnelAbout
from ridgebayes.likelihood import Model

_RUNAWAY = 25.0  # prior sds from the prior's centre at which a search has run away
_FLAT = 1e-3  # slope per prior sd at which a search may end: it costs an evidence 1e-6 at most
_FEW = 4  # coefficients; of more, a proposal's mixture knows too little in its many dimensions
_STEP = 0.02  # of numerical derivatives by an error model's parameters, in prior sds


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
    frame : FunnelAbout or Conditional
        The map between w and u of the coefficients.
    n_noise : int
        Parameters of the error model.
    is_mode : bool
        Whether the mode was found; else the coordinates are useful all the same.
    """

    mode: FloatArray
    factor: FloatArray
    log_density: float
    frame: FunnelAbout | Conditional
    n_noise: int
    is_mode: bool = True

    def unwhiten(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return u at w = factor z, and log |du/dw|.

        Parameters
        ----------
        z : ndarray of float, shape (..., n_coordinate)
            Whitened coordinates: standard normal as far as the approximation is right. The first
            `n_curved` belong to what is least normal; the order is otherwise that of `mode`.

        Returns
        -------
        u : ndarray of float, shape (..., n_coordinate)
            Unconstrained coordinates.
        log_jacobian : ndarray of float, shape (...)
            Log |du/dw|.
        """
        w, k = z @ self.factor[:, self._order].T, self._n_coefficient
        u = self.mode + w
        u[..., :k], log_jacobian = self.frame.place(w[..., :k], u[..., self._noise])
        return u, log_jacobian

    def whiten(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return z of u, and log |du/dw| there: the inverse of `unwhiten`."""
        w, k = u - self.mode, self._n_coefficient
        w[..., :k], log_jacobian = self.frame.unplace(u[..., :k], u[..., self._noise])
        flat = w.reshape(-1, w.shape[-1]).T
        z = _solve_lower(self.factor, flat).T.reshape(w.shape)
        return z[..., self._order], log_jacobian

    @property
    def n_curved(self) -> int:
        """Coordinates z that are not taken as normal; the others come after them.

        Sampled offsets nearly are, and so are many coefficients given the error model.
        """
        return self.n_noise + (self._n_coefficient if self._n_coefficient <= _FEW else 0)

    @property
    def log_volume(self) -> float:
        """Log |dw/dz|: the volume of the unit cube of z in w."""
        return float(np.log(np.diag(self.factor)).sum())

    @property
    def log_evidence(self) -> float:
        """Laplace's approximation of the log evidence."""
        k = self._n_coefficient
        _, log_jacobian = self.frame.place(np.zeros(k), self.mode[self._noise])
        volume = self.log_volume + float(log_jacobian)
        return self.log_density + 0.5 * len(self.mode) * math.log(2 * math.pi) + volume

    @property
    def _n_coefficient(self) -> int:
        return self.frame.n_coefficient

    @property
    def _order(self) -> IntArray:
        """Which coordinate w each z belongs to."""
        order = np.arange(len(self.mode))
        if self._n_coefficient > _FEW:
            noise = order[self._noise]
            order = np.concatenate([noise, np.delete(order, noise)])
        return order

    @property
    def _noise(self) -> slice:
        return slice(self._n_coefficient, self._n_coefficient + self.n_noise)


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
    Where rows share offsets, are bracketed or have Student errors, coefficients are taken as normal
    given the error model's parameters and the mode is that of these parameters; offsets that are
    sampled are standard normal to begin with. A posterior of several humps has no such mode:
    `is_mode` tells.

    *Validity.* Perfect data (rows without misfit, more of them than coefficients) send sigma to
    zero, where the approximation is undefined; the search says so instead of returning a point on
    the way.
    """
    return _fit_plain(model, tol) if model.is_plain else _fit_conditional(model)


def _fit_conditional(model: Model) -> Laplace:
    """Search the error model's parameters, each with the coefficients at their mean given them."""
    k, n_noise = model.n_coefficient, model.n_parameter - model.n_coefficient
    reference, noise = np.zeros(k), np.zeros(n_noise)
    for _ in range(3):  # linearised about the prior's centre, then about where that led
        frame = Conditional.of(model, reference)

        def negative(u_noise: FloatArray, frame: Conditional = frame) -> FloatArray:
            u, log_jacobian = frame.place(np.zeros((*u_noise.shape[:-1], k)), u_noise)
            everything = np.concatenate([u, u_noise], axis=-1)
            value = -model.marginal_log_density(everything) - log_jacobian
            return np.where(np.isfinite(value), value, 1e300)

        noise = optimize.minimize(
            lambda x: float(negative(x)),
            noise,
            jac=lambda x: _slope(negative, x),
            method="BFGS",
            options={"gtol": _FLAT},
        ).x
        if not np.all(np.abs(noise) < _RUNAWAY):
            raise _no_mode(model)
        reference = frame.place(np.zeros(k), noise)[0]
    precision = _hessian(negative, noise)
    values, vectors = linalg.eigh(precision)
    is_mode = bool(np.all(values > 0))
    if not is_mode:
        # Humps and kinks of a Student posterior: coordinates need a scale, not the very mode.
        precision = (vectors * np.maximum(np.abs(values), 1)) @ vectors.T
    covariance = linalg.inv(precision)
    n_latent = model.n_coordinate - model.n_parameter
    factor = linalg.block_diag(
        np.eye(k), linalg.cholesky(0.5 * (covariance + covariance.T), lower=True), np.eye(n_latent)
    )
    mode = np.concatenate([reference, noise, np.zeros(n_latent)])
    return Laplace(mode, factor, float(model.log_density(mode)), frame, n_noise, is_mode)


def _slope(function: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """Gradient by central differences of fourth order, all points in one call."""
    steps = _STEP * np.eye(len(x))
    ahead, behind, far_ahead, far_behind = function(
        x + np.array([1.0, -1.0, 2.0, -2.0])[:, None, None] * steps
    )
    return (8 * (ahead - behind) - (far_ahead - far_behind)) / (12 * _STEP)


def _hessian(function: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """Hessian by central differences of gradients, with a step that rounding allows."""
    steps = 5 * _STEP * np.eye(len(x))
    rows = [(_slope(function, x + s) - _slope(function, x - s)) / (10 * _STEP) for s in steps]
    return 0.5 * (np.array(rows) + np.array(rows).T)


def _fit_plain(model: Model, tol: float) -> Laplace:
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
    if not np.linalg.norm(_solve_lower(root, _gradient(model, funnel, u))) < tol:
        raise _no_mode(model)
    covariance = linalg.cho_solve((root, True), np.eye(len(u)))
    factor = linalg.cholesky(covariance, lower=True)
    return Laplace(u, factor, float(model.log_density(u)), funnel.about(u), 1)


def _no_mode(model: Model) -> ComputationError:
    return ComputationError(
        f"{model.form.name}: the posterior has no interior mode: the form reproduces all rows, or "
        "nearly, and sigma has no lower bound; add rows, or leave the form out"
    )


def _search(model: Model, funnel: Funnel, start: FloatArray) -> FloatArray:
    """Return the minimiser of minus the log density in w, as far as the search gets."""

    def negative(u: FloatArray) -> float:
        scales = funnel.log_scales(u[model.n_coefficient :])
        value = -float(model.log_density(u)) - float(scales.sum())
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
        slope = -model.gradient(u)
        slope[model.n_coefficient :] -= funnel.slope(u[model.n_coefficient :])
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
