r"""The normal approximation of a posterior, in coordinates that suit it.

Given sigma, coefficients are known to a multiple of sigma: in unconstrained coordinates u the
posterior is a funnel. In coordinates w with

    u_sigma = mode_sigma + w_sigma,   u_coefficient = mode_coefficient + w_coefficient t / t_mode,

where t^2 = sigma^2 + the rows' mean known variance, it is nearly normal. The Jacobian moves the
mode from the joint mode, where sigma is too small (and with few rows runs to zero), to the mode
of sigma's own marginal.

The search uses the analytic gradient on scaled parameters; the curvature is that gradient's central
difference on a scale taken from the curvature itself, so that parameters of very different size (c1
near 1.35, c2 near 0.017, correlated -0.96) are treated alike.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg, optimize

from ridgebayes._types import FloatArray
from ridgebayes.errors import ComputationError
from ridgebayes.likelihood import Model


@dataclass(frozen=True, eq=False)
class Laplace:
    """Normal approximation of a posterior, and the whitened coordinates it defines.

    Parameters
    ----------
    mode : ndarray of float, shape (n_parameter,)
        Mode in the coordinates w, given in u.
    factor : ndarray of float, shape (n_parameter, n_parameter)
        Lower Cholesky factor of the covariance of w.
    log_density : float
        Log posterior density in u at the mode, not normalised.
    n_coefficient : int
        Parameters before this one are coefficients; the one at it is log sigma.
    known_variance : float
        Mean squared known relative error of the rows.
    """

    mode: FloatArray
    factor: FloatArray
    log_density: float
    n_coefficient: int
    known_variance: float = 0.0

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
            log |du/dw|.
        """
        w = z @ self.factor.T
        log_sigma = self.mode[self.n_coefficient] + w[..., self.n_coefficient]
        log_scale = self._log_total(log_sigma) - self._log_total(self.mode[self.n_coefficient])
        w[..., : self.n_coefficient] *= np.exp(log_scale)[..., None]
        return self.mode + w, self.n_coefficient * log_scale

    def whiten(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return z of u, and log |du/dw| there: the inverse of `unwhiten`."""
        w = u - self.mode
        n = self.n_coefficient
        log_scale = self._log_total(u[..., n]) - self._log_total(self.mode[n])
        w[..., :n] *= np.exp(-log_scale)[..., None]
        flat = w.reshape(-1, w.shape[-1]).T
        return _solve_lower(self.factor, flat).T.reshape(w.shape), n * log_scale

    def _log_total(self, log_sigma: FloatArray) -> FloatArray:
        return 0.5 * np.log(np.exp(2 * log_sigma) + self.known_variance)

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
    # One unit of each search coordinate is about one prior sd.
    scale = np.array(
        [1.0 if prior.positive else prior.scale for prior in model.priors.values()], dtype=float
    )

    n, known = model.n_coefficient, float(np.mean(model.data.rel_se**2))

    # The density in w is that in u times the Jacobian (t / t_mode)^n, t^2 = sigma^2 + known.
    def negative(x: FloatArray) -> float:
        total = math.exp(2 * min(x[n], 300.0)) + known
        value = -float(model.log_density(x * scale)) - 0.5 * n * math.log(total)
        return value if math.isfinite(value) else 1e300

    def gradient(x: FloatArray) -> FloatArray:
        slope = -model.log_density_gradient(x * scale) * scale
        variance = math.exp(2 * min(x[n], 300.0))
        slope[n] -= n * variance / (variance + known)
        return slope

    def hessian(x: FloatArray) -> FloatArray:
        return _curvature(gradient, x)

    found = optimize.minimize(
        negative,
        model.start / scale,
        jac=gradient,
        hess=hessian,
        method="trust-exact",
        options={"gtol": 1e-6, "maxiter": 500},
    )
    precision = hessian(found.x)
    try:
        root = linalg.cholesky(precision, lower=True)
    except linalg.LinAlgError:
        root = np.full_like(precision, np.nan)
    # How far the mode still is, in posterior sds: the search's own flag gives up on rounding.
    decrement = np.linalg.norm(_solve_lower(root, gradient(found.x)))
    if not decrement < tol or np.any(np.abs(found.x * scale - model.start) > 50):
        raise ComputationError(
            f"{model.form.name}: the posterior has no interior mode ({found.message}); "
            "rows that a form fits without misfit send sigma to 0"
        )
    covariance = linalg.cho_solve((root, True), np.eye(len(scale)))
    factor = scale[:, None] * linalg.cholesky(covariance, lower=True)
    mode = found.x * scale
    return Laplace(mode, factor, float(model.log_density(mode)), n, known)


def _solve_lower(factor: FloatArray, right: FloatArray) -> FloatArray:
    return linalg.solve_triangular(factor, right, lower=True, check_finite=False)


def _curvature(gradient, x: FloatArray) -> FloatArray:  # type: ignore[no-untyped-def]
    """Hessian by central differences of the gradient, one step size per coordinate."""
    n = len(x)
    hessian = np.empty((n, n))
    for i in range(n):
        # A rough curvature first, then a step of a hundredth of the width that it implies:
        # truncation 1e-4 of the third derivative's effect, rounding far below it.
        probe = np.zeros(n)
        probe[i] = 1e-5
        rough = abs((gradient(x + probe)[i] - gradient(x - probe)[i]) / 2e-5)
        probe[i] = 1e-2 / math.sqrt(max(rough, 1e-4))
        hessian[i] = (gradient(x + probe) - gradient(x - probe)) / (2 * probe[i])
    return 0.5 * (hessian + hessian.T)
