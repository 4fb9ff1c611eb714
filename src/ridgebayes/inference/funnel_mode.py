"""The mode where rows are independent and normal, by Newton's method in the funnel's frame."""

import math

import numpy as np
from scipy import optimize

from ridgebayes._types import FloatArray
from ridgebayes.errors import ComputationError
from ridgebayes.inference.coordinates import Funnel
from ridgebayes.model.model import Model

_ROUNDING = 2e-14  # of log loads less log shapes, some 5 to 20: a few of their last digits
_LOWEST = -8.0  # of sigma's normal scores
_STEPS = 30  # of Gauss and Newton, which take fewer than ten from the prior's centre
_COEFFICIENTS = 100  # of more, each texture has its own: they are not drawn about a mode


def no_mode(model: Model) -> ComputationError:
    """Return what is raised where the posterior of sigma runs to zero."""
    return ComputationError(
        f"{model.form.name}: the posterior has no interior mode: the form reproduces all rows, or "
        "nearly, and sigma has no lower bound; add rows, give the error of the loads in a column "
        "rel_se, or leave the form out"
    )


def reproduces_rows(model: Model, u: FloatArray) -> bool:
    """Return whether some coefficients give all rows to their last digits.

    Where independent rows are more than coefficients, the posterior is improper then: near
    sigma = 0 the likelihood grows faster than the coefficients' volume shrinks. A prior that keeps
    sigma away from there leaves it proper.

    Parameters
    ----------
    model : Model
        Posterior. Rows that have an error of their own, `rel_se`, and intervals do not count.
    u : ndarray of float, shape (n_parameter,)
        Where Gauss and Newton's steps begin.
    """
    k, centre = model.n_coefficient, model.rows.centre[0]
    known = np.flatnonzero(model.rows.exact & (model.rows.rel_se == 0))
    texture, first = np.unique(model.rows.texture[known], return_index=True)
    if not k < len(known) or k > _COEFFICIENTS:
        return False
    if model.priors["sigma"].value_at(_LOWEST) > _ROUNDING:
        return False
    position = np.searchsorted(texture, model.rows.texture[known])
    if not np.abs(centre[known] - centre[known[first]][position]).max() < _ROUNDING:
        return False  # so with most tables: rows of one texture do not agree
    u_k = u[:k]
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            linear = model.linearised(u_k)[known[first]]
            misfit = np.abs(linear[:, k]).max()
            if not np.isfinite(linear).all() or misfit < _ROUNDING:
                return bool(misfit < _ROUNDING)
            u_k = u_k - np.linalg.lstsq(linear[:, :k], linear[:, k])[0]
    return False


def funnel_mode(model: Model, funnel: Funnel, start: FloatArray) -> FloatArray:
    """Return the minimiser of minus the log density in w, as far as the search gets.

    Raises
    ------
    ComputationError
        If sigma runs away to where a slope or curvature is not finite.
    """

    def finite(values: FloatArray) -> FloatArray:
        if not np.isfinite(values).all():
            raise no_mode(model)
        return values

    def negative(u: FloatArray) -> float:
        scales = funnel.log_scales(u[model.n_coefficient :])
        value = -float(model.log_density(u)) - float(scales.sum())
        return value if math.isfinite(value) else 1e300

    result: FloatArray = optimize.minimize(
        negative,
        start,
        jac=lambda u: finite(slope_in_w(model, funnel, u)),
        hess=lambda u: finite(curvature_in_w(model, funnel, u)),
        method="trust-exact",
        options={"gtol": 1e-6, "maxiter": 500},
    ).x
    return result


def slope_in_w(model: Model, funnel: Funnel, u: FloatArray) -> FloatArray:
    """Return the gradient of minus the log density in w at u, shape (n_parameter,)."""
    with np.errstate(all="ignore"):
        slope = -model.gradient(u)
        slope[model.n_coefficient :] -= funnel.slope(u[model.n_coefficient :])
    return slope


def curvature_in_w(model: Model, funnel: Funnel, u: FloatArray) -> FloatArray:
    """Hessian by central differences of the gradient, one step size per coordinate."""
    n = len(u)
    hessian = np.empty((n, n))
    for i in range(n):
        # A rough curvature first, then a step of a hundredth of the width that it implies:
        # truncation 1e-4 of the third derivative's effect, rounding far below it.
        probe = np.zeros(n)
        probe[i] = 1e-5
        up, down = slope_in_w(model, funnel, u + probe), slope_in_w(model, funnel, u - probe)
        with np.errstate(all="ignore"):
            rough = abs(up[i] - down[i]) / 2e-5
        probe[i] = 1e-2 / math.sqrt(max(rough, 1e-4)) if math.isfinite(rough) else 1e-5
        up, down = slope_in_w(model, funnel, u + probe), slope_in_w(model, funnel, u - probe)
        with np.errstate(all="ignore"):
            hessian[i] = (up - down) / (2 * probe[i])
    return 0.5 * (hessian + hessian.T)
