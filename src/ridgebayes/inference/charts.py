r"""Coordinates in which the coefficients hardly depend on the error model's parameters.

Given the error model's parameters phi, log loads are nearly linear in the coefficients' normal
scores: with J the derivatives of the rows' errors and r their residuals at a reference u*, the
coefficients are normal with precision and mean

.. math:: A = I + J' S^{-1} J = R R', \qquad \hat u = -A^{-1} J' S^{-1} (r - J u^*).

A *chart* replaces the coefficients' scores u by ``z = R'(u - u_hat)``. The posterior of u narrows
as sigma decreases; that of z does not, which makes it easy to sample. A posterior with several
modes in the coefficients has a chart about each.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import optimize

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import ComputationError
from ridgebayes.inference.latent import LatentIntegral, Prepared
from ridgebayes.inference.modes import N_START
from ridgebayes.model.linear_algebra import cholesky_or_nan, solve_lower
from ridgebayes.model.noise import SMOOTH

_MAX_ROUNDING = 1e-13  # rounding error of log loads, relative if they are above 1
# Number of random subsets of k + 1 rows. With two groups of equal size and two coefficients, each
# group contains one of the subsets completely in nine of ten cases.
_N_CANDIDATE = 24
_MIN_GROUP_SHARE = 0.3  # share of the rows; smaller groups are treated as outliers
_MIN_GROUP_DISTANCE = 4.0  # distance of two fits, in units of the group's largest residual
_MAX_GROUPS = 2
# In prior sds: distance of starts from the centre, and smallest distance of two minima.
_START_DISTANCE, _MIN_DISTANCE = 2.0, 0.1


class Conditional(NamedTuple):
    """Normal approximation of the coefficients given the error model's parameters, for many draws.

    Parameters
    ----------
    centre : ndarray of float, shape (n_draw, k)
        Mean u_hat.
    factor : ndarray of float, shape (n_draw, k, k)
        Lower Cholesky factor R of the precision.
    """

    centre: FloatArray
    factor: FloatArray

    @property
    def log_jacobian(self) -> FloatArray:
        """Log |du/dq|, shape (n_draw,)."""
        value: FloatArray = -np.log(np.diagonal(self.factor, axis1=-2, axis2=-1)).sum(axis=-1)
        return value

    def to_scores(self, q: FloatArray) -> FloatArray:
        """Convert coordinates to normal scores, shape (n_draw, n_outer)."""
        k = self.centre.shape[1]
        step = solve_lower(self.factor, q[:, :k, None], transposed=True)[..., 0]
        return np.concatenate([self.centre + step, q[:, k:]], axis=1)

    def from_scores(self, u: FloatArray) -> FloatArray:
        """Convert normal scores to coordinates, shape (n_draw, n_outer)."""
        k = self.centre.shape[1]
        z = np.einsum("dji,dj->di", self.factor, u[:, :k] - self.centre)
        return np.concatenate([z, u[:, k:]], axis=1)


# Largest spread of random starts in prior sds, if the form has no rates at the priors' centre.
_MAX_START_SD = 6.0


@dataclass(frozen=True, eq=False)
class Chart:
    """Coordinates about a reference point.

    Parameters
    ----------
    integral : LatentIntegral
        Integral of the model.
    reference : ndarray of float, shape (n_outer_coefficient,)
        Reference u*.
    columns : ndarray of float, shape (n_row, n_outer_coefficient + 1)
        The columns of J, then r.
    """

    integral: LatentIntegral
    reference: FloatArray
    columns: FloatArray

    def conditional(self, prepared: Prepared) -> Conditional:
        """Return u_hat and R at each draw of the error model's parameters."""
        k = len(self.reference)
        if not k:
            return Conditional(
                np.empty((len(prepared.eta), 0)), np.empty((len(prepared.eta), 0, 0))
            )
        products = self.integral.products(self.columns, prepared)
        information, pull = products[:, :k, :k], products[:, :k, k]
        factor = cholesky_or_nan(information + np.eye(k))
        pull = information @ self.reference - pull
        half = solve_lower(factor, pull[..., None])
        return Conditional(solve_lower(factor, half, transposed=True)[..., 0], factor)


def _linearised(integral: LatentIntegral, u: FloatArray) -> FloatArray:
    """Return the Jacobian of the rows' errors in the coefficients' scores, then the residuals."""
    model = integral.model
    outer_u = np.concatenate([u, np.zeros(model.n_outer - len(u))])
    log_rates = model.outer_log_rates(model.outer_theta(outer_u))
    jacobian = model.jacobian(outer_u)[model.rows.texture]
    return np.column_stack([jacobian, integral.middles(log_rates)])


def charts_of(integral: LatentIntegral, rng: np.random.Generator) -> list[Chart]:
    """Return charts about the least-squares fits, and about groups of rows that fit differently.

    Groups are searched for under Student errors only, where the rows of one group can be outliers
    of the other's fit, so that each group gives a mode. Under normal errors the posterior has one
    mode per least-squares fit. Step and smooth offsets absorb most of the difference between
    groups.

    Parameters
    ----------
    integral : LatentIntegral
        Integral of the model.
    rng : numpy.random.Generator
        Source of the random subsets of rows to which candidates are fitted.

    Raises
    ------
    InputError
        If the methods of a user's form contradict each other.
    ComputationError
        If the form reproduces all rows to rounding, so that sigma has no lower bound.
    """
    model, k = integral.model, integral.model.n_outer_coefficient
    base = _least_squares(integral, _start(integral, rng)) if k else np.zeros(0)
    model.check_form(np.concatenate([base, np.zeros(model.n_outer - k)]))
    _refuse_perfect_rows(integral, base)
    references = [base]
    if k:
        references += _other_minima(integral, base)
        if model.noise.tail != "normal" and not {"step", SMOOTH} & set(model.noise.factors):
            references += _groups(integral, base, rng)
    return [Chart(integral, u, _linearised(integral, u)) for u in references]


def _start(integral: LatentIntegral, rng: np.random.Generator) -> FloatArray:
    """Return the scores of coefficients at which the form has rates.

    The priors' centre is returned if possible, else the nearest of 64 random points, whose spread
    grows to six prior sds.
    """
    model, k = integral.model, integral.model.n_outer_coefficient
    wide = np.linspace(1, _MAX_START_SD, N_START)[:, None]
    for u in (np.zeros((1, k)), wide * rng.standard_normal((N_START, k))):
        outer_u = np.concatenate([u, np.zeros((len(u), model.n_outer - k))], axis=1)
        with np.errstate(all="ignore"):
            log_rates = model.outer_log_rates(model.outer_theta(outer_u))
        feasible = u[np.isfinite(log_rates).all(axis=1)]
        if len(feasible):
            return np.asarray(feasible[(feasible**2).sum(axis=1).argmin()])
    return np.zeros(k)


def _other_minima(integral: LatentIntegral, base: FloatArray) -> list[FloatArray]:
    """Return further least-squares fits that are about as good, from starts two prior sds away."""
    best = float(np.sqrt(np.mean(_linearised(integral, base)[:, -1] ** 2)))
    minima: list[FloatArray] = []

    def is_new(u: FloatArray) -> bool:
        return all(np.abs(u - other).max() > _MIN_DISTANCE for other in (base, *minima))

    for start in np.concatenate([np.eye(len(base)), -np.eye(len(base))]) * _START_DISTANCE:
        near = _least_squares(integral, start, scale=max(best, _MAX_ROUNDING), n_pass=1, tol=1e-3)
        if is_new(near):
            u = _least_squares(integral, near)
            size = float(np.sqrt(np.mean(_linearised(integral, u)[:, -1] ** 2)))
            if is_new(u) and size < 2 * best and len(minima) < _MAX_GROUPS:
                minima.append(u)
    return minima


def _refuse_perfect_rows(integral: LatentIntegral, base: FloatArray) -> None:
    """Raise ComputationError if rows outnumber coefficients and the form fits them to rounding."""
    model, rows = integral.model, integral.rows
    if model.noise.factors or not rows.exact.all() or rows.rel_se.any():
        return  # offsets, intervals or known errors keep sigma from 0
    outer_u = np.concatenate([base, np.zeros(model.n_outer - len(base))])
    log_rates = model.outer_log_rates(model.outer_theta(outer_u))
    residual = rows.errors(log_rates)
    n_free = len(residual) - len(base)
    if model.has_slopes:
        count = np.bincount(rows.texture)
        residual = residual - (np.bincount(rows.texture, residual) / count)[rows.texture]
        n_free = len(residual) - len(count)
    if n_free > 0 and np.abs(residual).max() < _MAX_ROUNDING * max(np.abs(rows.upper).max(), 1.0):
        raise ComputationError(
            f"{model.form.name}: the form reproduces all rows to rounding, and sigma has no lower "
            "bound; add rows or their `rel_se`, or leave the form out"
        )


def _least_squares(
    integral: LatentIntegral,
    start: FloatArray,
    rows: IntArray | None = None,
    scale: float = 0.1,
    n_pass: int = 3,
    tol: float = np.finfo(float).eps,
) -> FloatArray:
    """Return the scores that minimise the penalised sum of squared residuals of selected rows.

    If the form has no rates at the start, the start is returned. The penalty is the prior, scaled
    by the residuals' own size. A larger scale would pull the reference of nearly exact rows away by
    many of their standard errors.
    """
    selected = slice(None) if rows is None else rows

    def residual(u: FloatArray) -> FloatArray:
        value = _linearised(integral, u)[selected, -1]
        return np.append(np.nan_to_num(value, nan=1e99, posinf=1e99, neginf=-1e99), scale * u)

    def jacobian(u: FloatArray) -> FloatArray:
        return np.vstack([_linearised(integral, u)[selected, :-1], scale * np.eye(len(u))])

    u = start
    with np.errstate(all="ignore"):
        remaining = _linearised(integral, u)[selected, -1]
        for _ in range(n_pass):
            if not np.isfinite(remaining).all():  # no positive rates: use it as the reference
                return u
            fit = optimize.least_squares(
                residual, u, jacobian, method="lm", max_nfev=50, ftol=tol, xtol=tol, gtol=tol
            )
            u, remaining = fit.x, fit.fun[: -len(u)]
            scale = max(math.sqrt(float(np.mean(remaining**2))), _MAX_ROUNDING)
    return u


def _groups(
    integral: LatentIntegral, base: FloatArray, rng: np.random.Generator
) -> list[FloatArray]:
    """Return references fitted to groups of rows, each group with a closer fit than all rows."""
    k, n = len(base), len(integral.rows.upper)
    n_near = max(math.ceil(_MIN_GROUP_SHARE * n), k + 1)
    columns = _linearised(integral, base)
    jacobian, residual = columns[:, :-1], columns[:, -1]
    if n < 2 * (k + 1) or not np.isfinite(residual).all():
        return []
    candidates: list[tuple[float, FloatArray, IntArray]] = []
    for _ in range(_N_CANDIDATE):
        rows = rng.choice(n, k + 1, replace=False)
        for _ in range(4):  # alternate between a fit and the rows nearest to it until both settle
            step = np.linalg.lstsq(jacobian[rows], -residual[rows], rcond=None)[0]
            rows = np.argsort(np.abs(residual + jacobian @ step), kind="stable")[:n_near]
        size = float(np.abs(residual + jacobian @ step)[rows].max())
        candidates.append((size, np.asarray(step, float), rows))
    largest = float(np.median(np.abs(residual)))
    steps = [np.zeros(k)]
    references = []
    for size, step, rows in sorted(candidates, key=lambda candidate: candidate[0]):
        gaps = [np.sqrt(np.mean((jacobian @ (step - other)) ** 2)) for other in steps]
        if len(steps) <= _MAX_GROUPS and size < largest and min(gaps) > _MIN_GROUP_DISTANCE * size:
            steps.append(step)
            references.append(_least_squares(integral, base + step, rows))
    return references
