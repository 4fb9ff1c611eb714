r"""The normal approximation of a posterior, in coordinates that suit it.

Coefficients are known the better the smaller the errors are: in unconstrained coordinates a
posterior is a funnel. Coordinates w take that out, by `Funnel` where rows are exact, independent,
normal and alike in their known errors, by `Conditional` otherwise. In w a posterior is nearly
normal: there its mode and curvature are found, proposals are fitted, evidences integrated.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import ComputationError
from ridgebayes.inference.coordinates import Conditional, Funnel, FunnelAbout, NoCoefficients
from ridgebayes.inference.funnel_mode import (
    curvature_in_w,
    funnel_mode,
    no_mode,
    reproduces_rows,
    slope_in_w,
)
from ridgebayes.inference.mode_search import hessian, searched, widths
from ridgebayes.inference.tabulated_conditional import TabulatedConditional
from ridgebayes.inference.valley import Valley, find_valley
from ridgebayes.model.forms import FORMS
from ridgebayes.model.model import Model

_RUNAWAY = 25.0  # prior sds from the prior's centre at which a search has run away
_ROUNDING = 1e-14  # misfit of log loads that their digits make
_FLAT = 1e-3  # slope per prior sd at which a search may end: it costs an evidence 1e-6 at most
_FEW = 4  # coefficients; of more, a proposal's mixture knows too little in its many dimensions
_N_START = 256  # points tried where the prior's centre has no density
_N_TRIED = 64  # points that a search among humps may begin at
_CONFLICT = 4.0  # prior sds from the prior's centre at which a mode contradicts the prior
_N_SEARCH = 4  # starts in search of other modes, and as many mirrored
_APART = 5.0  # posterior sds between two modes that are not the same
_NEGLIGIBLE = -14.0  # ln of the share of the mass below which a mode does not count
_FAR = 1e100  # stands for minus the log density where there is none; its square is a number
_SHARP = 1e12  # curvature by (prior sds)^2 beyond which it is of rounding
_ROUGH = 0.1  # by which a log density may differ between two ways to one point

Frame = FunnelAbout | Conditional | TabulatedConditional | NoCoefficients


@dataclass(frozen=True, eq=False)
class Laplace:
    """Normal approximation of a posterior, and the whitened coordinates it defines.

    Parameters
    ----------
    mode : ndarray of float, shape (n_parameter,)
        Mode in the coordinates w, given in u: coefficients, then the error model's parameters.
    factor : ndarray of float, shape (n_parameter, n_parameter)
        Lower Cholesky factor of the covariance of w.
    log_density : float
        Log posterior density in u at the mode, not normalised.
    frame : FunnelAbout, Conditional, TabulatedConditional or NoCoefficients
        The map between w and u of the coefficients.
    n_noise : int
        Parameters of the error model.
    is_mode : bool
        Whether the mode was found; else the coordinates are useful all the same.
    other_modes : tuple of str
        What `several_modes` returned, where other modes were searched for.
    valley : Valley, optional
        The curve that the coefficients lie along, where it is curved.
    """

    mode: FloatArray
    factor: FloatArray
    log_density: float
    frame: Frame
    n_noise: int
    is_mode: bool = True
    other_modes: tuple[str, ...] = ()
    valley: Valley | None = None

    def bound_to(self, model: Model) -> "Laplace":
        """Return the same approximation in coordinates that a model of equal content works out.

        What they factorise is then kept for the density that is asked for next.
        """
        if not isinstance(self.frame, Conditional):
            return self
        return replace(self, frame=replace(self.frame, products=model.products))

    def unwhiten(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return u at w = factor z, and log |du/dw|.

        Parameters
        ----------
        z : ndarray of float, shape (..., n_parameter)
            Whitened coordinates: standard normal as far as the approximation is right. The first
            `n_curved` belong to what is least normal; the order is otherwise that of `mode`.

        Returns
        -------
        u : ndarray of float, shape (..., n_parameter)
            Unconstrained coordinates.
        log_jacobian : ndarray of float, shape (...)
            Log |du/dw|.
        """
        w, k = z @ self.factor[:, self._order].T, self._n_coefficient
        u = self.mode + w
        u[..., :k], log_jacobian = self.frame.forward(w[..., :k], u[..., self._noise])
        if self.valley is not None:
            u[..., :k] = self.valley.bent(u[..., :k])
        return u, log_jacobian

    def whitened(
        self, log_density: Callable[[FloatArray], FloatArray]
    ) -> Callable[[FloatArray], FloatArray]:
        """Return a log density in u as one in z of the same integral; (n, n_parameter) to (n,)."""

        def in_z(z: FloatArray) -> FloatArray:
            u, log_jacobian = self.unwhiten(z)
            return log_density(u) + log_jacobian + self.log_volume

        return in_z

    def whiten(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return z of u, and log |du/dw| there: the inverse of `unwhiten`."""
        w, k = u - self.mode, self._n_coefficient
        straight = u[..., :k] if self.valley is None else self.valley.bent(u[..., :k], -1)
        w[..., :k], log_jacobian = self.frame.inverse(straight, u[..., self._noise])
        flat = w.reshape(-1, w.shape[-1]).T
        z = _solve_lower(self.factor, flat).T.reshape(w.shape)
        return z[..., self._order], log_jacobian

    @property
    def n_curved(self) -> int:
        """Coordinates z that are not taken as normal; the others come after them.

        Many coefficients nearly are, given the error model.
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
        _, log_jacobian = self.frame.forward(np.zeros(k), self.mode[self._noise])
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


def fit_laplace(
    model: Model, *, search_others: bool = False, near: FloatArray | None = None
) -> Laplace:
    """Find the posterior's mode and its curvature there.

    Parameters
    ----------
    model : Model
        Posterior.
    search_others : bool, optional
        Whether other modes are searched for, see `several_modes`; `other_modes` tells of them.
    near : ndarray of float, shape (n_parameter,), optional
        Parameters `theta` near the mode, where they are known: the search is shorter from there.

    Returns
    -------
    Laplace
        Mode, covariance factor and density.

    Raises
    ------
    InputError
        If the form's gradient is not the slope of its rate.
    ComputationError
        If there is no interior mode: the search runs away, or the curvature is not definite; if no
        point near the prior has positive density.

    Notes
    -----
    Where rows share offsets, are bracketed or have Student errors, coefficients are taken as normal
    given the error model's parameters and the mode is that of these parameters, offsets integrated
    out. A posterior of several humps has no such mode: `is_mode` tells.

    *Validity.* Perfect data (rows without misfit, more of them than coefficients) send sigma to
    zero, where the approximation is undefined; the search says so instead of returning a point on
    the way.
    """
    start = _start(model) if near is None else _within(model.to_unconstrained(near))
    model.check_gradient(start)
    if reproduces_rows(model, start):
        raise no_mode(model)
    found = _fit(model, start, near=None if near is None else start[model.n_coefficient :])
    found = replace(found, valley=_valley(model, found))
    return replace(found, other_modes=several_modes(model, found)) if search_others else found


def _valley(model: Model, found: Laplace) -> Valley | None:
    k, h = model.n_coefficient, 1e-3
    steps = (found.unwhiten(h * np.eye(len(found.mode)))[0] - found.mode)[:, :k] / h
    return find_valley(model, found.mode[:k], steps.T @ steps)


def _fit(
    model: Model, start: FloatArray, tol: float = 1e-4, near: FloatArray | None = None
) -> Laplace:
    """Search from a start; `tol`: distance from the mode, in posterior sds, of independent rows.

    `near`: parameters of the error model that a search among these begins at.
    """
    # A funnel has one width at each sigma: of known errors that differ, a mean is nobody's.
    if model.is_iid_gaussian and np.ptp(model.rows.rel_se) == 0:
        return _fit_iid_gaussian(model, tol, start)
    return _fit_conditional(model, start, near)


def several_modes(model: Model, laplace: Laplace) -> tuple[str, ...]:
    """Search from elsewhere in the prior for modes that an approximation knows nothing of.

    Parameters
    ----------
    model : Model
        Posterior.
    laplace : Laplace
        Its approximation at one mode.

    Returns
    -------
    tuple of str
        One sentence if there is a mode of at least 1e-6 of the mass; empty if there is none.

    Notes
    -----
    The rate of each form of this package rises or falls with each coefficient: two modes there are
    only where prior and rows contradict each other (coefficients near the prior and errors wide, or
    coefficients near the rows). If the mode lies within four prior sds, no search is made for them.

    *Validity.* A mode that none of the searches ends at is not found.
    """
    contradicted = bool(np.abs(laplace.mode[: model.n_parameter]).max() > _CONFLICT)
    is_own = type(model.form) in FORMS.values()
    if is_own and not contradicted:
        return ()
    k = model.n_coefficient
    # Of a rate that rises or falls, coefficients follow from the error model: few starts do then.
    n_search = 1 if is_own and not model.is_iid_gaussian else _N_SEARCH
    starts = np.random.default_rng(0).standard_normal((n_search, k))
    for start in np.concatenate([np.zeros((1, k)), starts, -starts]):
        u = np.append(start, np.zeros(model.n_parameter - k))
        if not np.isfinite(model.marginal_log_density(u)):
            continue
        if contradicted and np.isfinite(rates := model.log_rates(model.to_theta(u))).all():
            # Errors as wide as the rows' distance from the start keep the search near it.
            theta = model.to_theta(u)
            residual = model.rows.centre[0] + 2 * rates[model.data.texture]
            theta[k] = np.sqrt(np.mean(residual**2))
            u = model.to_unconstrained(theta)
        try:
            other = _fit(model, u, 1e-2, u[k:] if contradicted else None)
        except ComputationError:
            continue
        apart = float(np.linalg.norm(laplace.whiten(other.mode)[0][: model.n_parameter]))
        # Towards the other mode, too: seen from a narrow mode a wide one's centre may be far.
        apart = min(apart, float(np.linalg.norm(other.whiten(laplace.mode)[0][: len(u)])))
        ahead = other.log_evidence - laplace.log_evidence
        if apart > _APART and ahead > _NEGLIGIBLE:
            values = zip(model.parameter_names, model.to_theta(other.mode), strict=True)
            where = ", ".join(f"{name} = {value:.6g}" for name, value in values)
            return (
                f"several modes: the draws miss one at {where}, whose ln evidence is {ahead:+.1f} "
                "relative to this one; use priors or a form with a single mode",
            )
    return ()


def _start(model: Model) -> FloatArray:
    """Return the prior's centre, or where no load reaches a ridge there, a point near it."""
    centre = np.zeros(model.n_parameter)
    if np.isfinite(model.marginal_log_density(centre)):
        return centre
    points = np.random.default_rng(0).standard_normal((_N_START, model.n_parameter))
    for width in (1, 2, 4, 8, 16):
        values = model.marginal_log_density(width * points)
        if np.isfinite(values).any():
            return np.asarray(width * points[np.argmax(values)])
    raise ComputationError(
        f"{model.form.name}: no point of positive density within some prior sds; expected priors "
        "under which the rate of every texture can be positive"
    )


def _within(u: FloatArray) -> FloatArray:
    return np.clip(u, -0.5 * _RUNAWAY, 0.5 * _RUNAWAY)


def _fit_conditional(model: Model, start: FloatArray, near: FloatArray | None = None) -> Laplace:
    """Search the error model's parameters, each with the coefficients at their mean given them."""
    k, n_noise = model.n_coefficient, model.n_parameter - model.n_coefficient
    reference, noise = start[:k], np.zeros(n_noise) if near is None else near
    spread: FloatArray | None = None
    exact = TabulatedConditional.of(model) if TabulatedConditional.serves(model) else None
    # Linearised about the prior's centre, then about where that led: the last search counts.
    # Where offsets are drawn densities are rough: there are no digits that a third would find.
    flats = (100 * _FLAT, 10 * _FLAT, _FLAT)[: 2 if model.is_latent else 3]
    for flat in flats[0 if near is None else 1 :]:
        frame = exact or Conditional.of(model, reference)

        def negative(u_noise: FloatArray, frame: Frame = frame) -> FloatArray:
            u, log_jacobian = frame.forward(np.zeros((*u_noise.shape[:-1], k)), u_noise)
            everything = np.concatenate([u, u_noise], axis=-1)
            with np.errstate(over="ignore"):  # where a search runs off, which is told below
                value = -model.marginal_log_density(everything) - log_jacobian
            return np.where(np.isfinite(value), value, _FAR)

        if model.is_latent and near is None and flat == flats[0]:
            # Of humps, the search climbs that which it begins on.
            tried = np.random.default_rng(0).standard_normal((_N_TRIED, n_noise))
            tried[0] = noise
            noise = tried[np.argmin(negative(tried))]
        noise, spread = searched(negative, noise, flat, smooth=not model.is_latent, spread=spread)
        if not np.all(np.abs(noise) < _RUNAWAY):
            raise no_mode(model)
        reference = frame.forward(np.zeros(k), noise)[0]
    precision = hessian(negative, noise, smooth=not model.is_latent)
    values = linalg.eigvalsh(precision)
    is_mode = bool(np.all((values > 0) & (values < _SHARP)))
    if not is_mode:
        # Humps and kinks of a Student posterior, or an edge of what rounding lets be computed:
        # coordinates need a scale, not the very mode.
        precision = np.diag(widths(negative, noise) ** -2.0)
    try:
        covariance = linalg.inv(precision)
        root = linalg.cholesky(0.5 * (covariance + covariance.T), lower=True)
    except (linalg.LinAlgError, ValueError):
        raise no_mode(model) from None
    factor = linalg.block_diag(np.eye(k), root)
    mode = np.concatenate([reference, noise])
    known = model.rows.exact & (model.rows.rel_se == 0)
    if model.to_theta(mode)[k] < _ROUNDING and known.any():
        raise no_mode(model)
    log_density = float(model.marginal_log_density(mode))
    if not abs(log_density + frame.forward(np.zeros(k), noise)[1] + negative(noise)) < _ROUGH:
        sigma = model.to_theta(mode)[k]
        raise ComputationError(
            f"{model.form.name}, {model.noise.name}: sigma falls to {sigma:.1g}, where rounding "
            "decides: rows agree with each other to more digits than their covariance can hold"
        )
    return Laplace(mode, factor, log_density, frame, n_noise, is_mode)


def _fit_iid_gaussian(model: Model, tol: float, u: FloatArray) -> Laplace:
    for _ in range(2):  # directions of the funnel at the prior's centre, then at the mode
        funnel = Funnel.of(model, u)
        u = funnel_mode(model, funnel, u)
    precision = curvature_in_w(model, funnel, u)
    try:
        root = linalg.cholesky(precision, lower=True)
    except (linalg.LinAlgError, ValueError):
        root = np.full_like(precision, np.nan)
    # How far the mode still is, in posterior sds: the search's own flag gives up on rounding.
    if not np.linalg.norm(_solve_lower(root, slope_in_w(model, funnel, u))) < tol:
        raise no_mode(model)
    frame, k = funnel.about(u), model.n_coefficient
    # The coefficients' centre moves with sigma: what they are about it, no more, depends on sigma.
    about_centre = np.eye(len(u))
    about_centre[:k, k:] = -frame.slope
    half = about_centre @ linalg.solve_triangular(root, np.eye(len(u)), lower=True, trans=1)
    factor = linalg.cholesky(half @ half.T, lower=True)
    return Laplace(u, factor, float(model.log_density(u)), frame, 1)


def _solve_lower(factor: FloatArray, right: FloatArray) -> FloatArray:
    value: FloatArray = linalg.solve_triangular(factor, right, lower=True, check_finite=False)
    return value
