"""Modes of a posterior in the coordinates of its charts, from many starts."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ridgebayes._types import FloatArray

N_START = 64
_MAX_CLIMBS = 16  # the best of the starts are climbed from
_MAX_STEPS = 30
_DIFFERENCE = 1e-3  # normal scores: differences keep half the digits of the density
_MAX_STEP = 2.0  # normal scores
_STEP_FACTORS = (1.0, 0.4, 0.1, 0.01)  # lengths of a step that are tried in one call
_MIN_DISTANCE = 0.1  # normal scores: climbs that are nearer to each other end at one summit
_MIN_GAIN = 1e-4  # nats: a climb ends with a step that gains less
_MIN_DIP = 1.0  # nats: two summits with a shallower dip between them are one mode
_MAX_MODES = 3
_MIN_CURVATURE = 0.25  # the prior alone has 1
Density = Callable[[FloatArray], FloatArray]


class FoundMode(NamedTuple):
    """A mode, and the normal approximation there.

    Parameters
    ----------
    centre : ndarray of float, shape (d,)
        Coordinates.
    factor : ndarray of float, shape (d, d)
        Lower Cholesky factor of the covariance.
    log_mass : float
        Log of the integral by Laplace's approximation.
    """

    centre: FloatArray
    factor: FloatArray
    log_mass: float


def find_modes(log_density: Density, starts: FloatArray) -> list[FoundMode]:
    """Return the modes that a quasi-Newton search reaches, the heaviest first.

    Parameters
    ----------
    log_density : callable
        (n, d) to (n,), smooth; all points of a step are asked for in one call.
    starts : ndarray of float, shape (n, d)
        Points; the best of them are searched from.
    """
    values = log_density(starts)
    order = np.argsort(-np.where(np.isfinite(values), values, -np.inf), kind="stable")
    best = order[:_MAX_CLIMBS]
    best = best[np.isfinite(values[best])]
    if not len(best):
        return []
    x, value = _searched(log_density, starts[best], values[best])
    summits: list[int] = []
    for i in np.argsort(-value, kind="stable").tolist():
        if value[i] == -np.inf or len(summits) == _MAX_MODES:
            break
        if summits:  # no dip on the way to a higher summit: the same mode
            middles = log_density(0.5 * (x[i] + x[summits]))
            if np.any(middles > value[i] - _MIN_DIP):
                continue
        summits.append(i)
    modes = [_approximated(log_density, x[i], float(value[i])) for i in summits]
    return sorted(modes, key=lambda mode: -mode.log_mass)


def _searched(
    log_density: Density, x: FloatArray, value: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Climb from every point at once by BFGS with differences for gradients."""
    n, d = x.shape
    inverse = np.repeat(np.eye(d)[None], n, axis=0)
    gradient = _gradients(log_density, x)
    active = np.arange(n)
    for _ in range(_MAX_STEPS):
        step = np.einsum("nij,nj->ni", inverse[active], gradient[active])
        longest = np.abs(step).max(axis=1, keepdims=True)
        step *= np.minimum(1, _MAX_STEP / np.maximum(longest, 1e-300))
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
        inverse[here] = _updated(inverse[here], change, before - gradient[here])
        active = here[gain[moved] > _MIN_GAIN]
        # Climbs far below the best, and those that have met a higher one, need not go on.
        active = active[value[active] > value.max() - 30]
        apart = np.abs(x[active][:, None] - x).max(axis=-1)
        met = (apart < _MIN_DISTANCE) & (value > value[active][:, None])
        active = active[~met.any(axis=1)]
        if not len(active):
            break
    return x, value


def _updated(inverse: FloatArray, s: FloatArray, y: FloatArray) -> FloatArray:
    """Return the inverse Hessians after a BFGS update; as they were where curvature is negative."""
    product = (s * y).sum(axis=1)
    good = product > 1e-10
    rho = np.where(good, 1 / np.where(good, product, 1.0), 0.0)[:, None, None]
    eye = np.eye(s.shape[1])
    left = eye - rho * s[:, :, None] * y[:, None, :]
    value = left @ inverse @ np.swapaxes(left, 1, 2) + rho * s[:, :, None] * s[:, None, :]
    return np.where(good[:, None, None], value, inverse)


def _gradients(log_density: Density, x: FloatArray) -> FloatArray:
    n, d = x.shape
    ahead, behind = x[:, None] + _DIFFERENCE * np.eye(d), x[:, None] - _DIFFERENCE * np.eye(d)
    values = log_density(np.concatenate([ahead, behind]).reshape(-1, d)).reshape(2, n, d)
    slope: FloatArray = (values[0] - values[1]) / (2 * _DIFFERENCE)
    return np.asarray(np.nan_to_num(slope, posinf=0.0, neginf=0.0))


def _approximated(log_density: Density, x: FloatArray, value: float) -> FoundMode:
    d, size = len(x), 0.02
    steps = size * np.eye(d)
    along, across = steps[:, None] + steps, steps[:, None] - steps
    corners = np.stack([along, across, -across, -along])
    densities = log_density(x + corners.reshape(-1, d)).reshape(2, 2, d, d)
    densities = np.where(np.isfinite(densities), densities, value - 1.0)
    hessian = (densities[0, 0] - densities[0, 1] - densities[1, 0] + densities[1, 1]) / (
        4 * size**2
    )
    curvature, vectors = np.linalg.eigh(-0.5 * (hessian + hessian.T))
    variance = 1 / np.maximum(curvature, _MIN_CURVATURE)
    factor = np.linalg.cholesky((vectors * variance) @ vectors.T)
    log_mass = value + 0.5 * np.log(2 * np.pi * variance).sum()
    return FoundMode(x, factor, float(log_mass))
