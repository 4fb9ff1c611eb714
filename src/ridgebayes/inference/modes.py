"""Search for the modes of a posterior from many starts, in the coordinates of a chart."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ridgebayes._types import FloatArray

N_START = 64
_MAX_CLIMBS = 16  # the search climbs from this many of the best starts
_MAX_STEPS = 30
_DIFFERENCE = 1e-3  # step of numerical gradients, in normal scores
_MAX_STEP_LENGTH = 2.0  # normal scores
_STEP_FACTORS = (1.0, 0.4, 0.1, 0.01)  # fractions of a step that are evaluated in one call
_MIN_DISTANCE = 0.1  # normal scores: a climb this near to a higher one ends
_MIN_GAIN = 1e-3  # nats: a climb ends after a step with a smaller gain
_MIN_DIP = 1.0  # nats: two maxima are one mode if the density between them dips less
_MAX_MODES = 3
_MIN_CURVATURE = 0.25  # bounds the variance of a normal approximation; the prior alone has 1
Density = Callable[[FloatArray], FloatArray]


class FoundMode(NamedTuple):
    """A mode with its normal approximation.

    Parameters
    ----------
    centre : ndarray of float, shape (d,)
        Coordinates of the mode.
    factor : ndarray of float, shape (d, d)
        Lower Cholesky factor of the covariance.
    log_mass : float
        Log of the mode's integral by Laplace's approximation.
    """

    centre: FloatArray
    factor: FloatArray
    log_mass: float


def find_modes(log_density: Density, starts: FloatArray) -> list[FoundMode]:
    """Find modes by a quasi-Newton search; return them in order of mass, the largest first.

    Parameters
    ----------
    log_density : callable
        Smooth function from points (n, d) to log densities (n,).
    starts : ndarray of float, shape (n, d)
        Starting points; the search uses those of highest density.
    """
    values = log_density(starts)
    order = np.argsort(-np.where(np.isfinite(values), values, -np.inf), kind="stable")
    best = order[:_MAX_CLIMBS]
    best = best[np.isfinite(values[best])]
    if not len(best):
        return []
    x, value = _climb(log_density, starts[best], values[best])
    maxima: list[int] = []
    for i in np.argsort(-value, kind="stable").tolist():
        if value[i] == -np.inf or len(maxima) == _MAX_MODES:
            break
        if maxima:  # without a dip between this and a higher maximum, both are one mode
            middles = log_density(0.5 * (x[i] + x[maxima]))
            if np.any(middles > value[i] - _MIN_DIP):
                continue
        maxima.append(i)
    modes = [_normal_approximation(log_density, x[i], float(value[i])) for i in maxima]
    return sorted(modes, key=lambda mode: -mode.log_mass)


def _climb(log_density: Density, x: FloatArray, value: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Climb from all points at once by BFGS with numerical gradients."""
    n, d = x.shape
    inverse = np.repeat(np.eye(d)[None], n, axis=0)
    gradient = _gradients(log_density, x)
    active = np.arange(n)
    for _ in range(_MAX_STEPS):
        step = np.einsum("nij,nj->ni", inverse[active], gradient[active])
        longest = np.abs(step).max(axis=1, keepdims=True)
        step *= np.minimum(1, _MAX_STEP_LENGTH / np.maximum(longest, 1e-300))
        tried = x[active] + np.array(_STEP_FACTORS)[:, None, None] * step
        densities = log_density(tried.reshape(-1, d)).reshape(len(_STEP_FACTORS), -1)
        densities = np.where(np.isnan(densities), -np.inf, densities)
        which, column = densities.argmax(axis=0), np.arange(len(active))
        gain = densities[which, column] - value[active]
        moved = gain > 0
        here = active[moved]
        if not len(here):
            break
        new = tried[which, column][moved]
        change, before = new - x[here], gradient[here]
        x[here], value[here] = new, densities[which, column][moved]
        gradient[here] = _gradients(log_density, new)
        inverse[here] = _update_inverse(inverse[here], change, before - gradient[here])
        active = here[gain[moved] > _MIN_GAIN]
        # Climbs 30 nats below the best three climbs, or next to a higher climb, end early. The best
        # climb alone can end in a region that is not smooth.
        active = active[value[active] > np.sort(value)[-_MAX_MODES:][0] - 30]
        distance = np.abs(x[active][:, None] - x).max(axis=-1)
        merged = (distance < _MIN_DISTANCE) & (value > value[active][:, None])
        active = active[~merged.any(axis=1)]
        if not len(active):
            break
    return x, value


def _update_inverse(inverse: FloatArray, s: FloatArray, y: FloatArray) -> FloatArray:
    """Return the inverse Hessians after a BFGS update; unchanged if the curvature is negative."""
    product = (s * y).sum(axis=1)
    good = product > 1e-10
    rho = np.where(good, 1 / np.where(good, product, 1.0), 0.0)[:, None, None]
    eye = np.eye(s.shape[1])
    factor_s = eye - rho * s[:, :, None] * y[:, None, :]
    value = factor_s @ inverse @ np.swapaxes(factor_s, 1, 2) + rho * s[:, :, None] * s[:, None, :]
    return np.where(good[:, None, None], value, inverse)


def _gradients(log_density: Density, x: FloatArray) -> FloatArray:
    """Return gradients by forward differences; a component is 0 if it is not finite.

    Approximate densities can depend on the other points of a call, so that all points of a
    difference are in one call.
    """
    n, d = x.shape
    steps = _DIFFERENCE * np.eye(d + 1, d, -1)  # the first row is 0
    values = log_density((x[:, None] + steps).reshape(-1, d)).reshape(n, d + 1)
    slope: FloatArray = (values[:, 1:] - values[:, :1]) / _DIFFERENCE
    return np.asarray(np.nan_to_num(slope, posinf=0.0, neginf=0.0))


def _normal_approximation(log_density: Density, x: FloatArray, value: float) -> FoundMode:
    """Return a mode whose covariance is the inverse Hessian, by differences."""
    d, size = len(x), 0.02
    steps = size * np.eye(d)
    i, j = np.tril_indices(d, -1)
    moved = np.concatenate([steps, steps[i] + steps[j]])
    densities = log_density(np.concatenate([x[None], x + moved, x - moved]))
    densities = np.where(np.isfinite(densities), densities, value - 1.0)
    change = densities[1 : 1 + len(moved)] + densities[1 + len(moved) :] - 2 * densities[0]
    hessian = np.diag(change[:d])
    hessian[i, j] = 0.5 * (change[d:] - change[i] - change[j])
    hessian /= size**2
    curvature, vectors = np.linalg.eigh(-hessian)  # eigh reads the lower triangle only
    variance = 1 / np.maximum(curvature, _MIN_CURVATURE)
    factor = np.linalg.cholesky((vectors * variance) @ vectors.T)
    log_mass = value + 0.5 * np.log(2 * np.pi * variance).sum()
    return FoundMode(x, factor, float(log_mass))
