"""Search for the minimum of a function of a few numbers by its values, many points in one call."""

from collections.abc import Callable

import numpy as np
from scipy import optimize

from ridgebayes._types import FloatArray

_WITHOUT_SLOPE = {"xatol": 1e-3, "fatol": 1e-4, "maxfev": 300}
# Of a rough function: a step that gains less ends the search (in a log density 0.04 sds), and so
# does one for which so many points were tried.
_ROUGH, _TRIES = 1e-3, 12
_STEP = 0.02  # of numerical derivatives by an error model's parameters, in prior sds
WIDTH = 5 * _STEP  # of steps between slopes, where the function bends little


class _RoughError(Exception):
    """No step of a search leads further."""


def _values_and_slopes(
    function: Callable[[FloatArray], FloatArray], x: FloatArray, order: int
) -> tuple[FloatArray, FloatArray]:
    """Values and gradients at points (n, d), by central differences of second or fourth order.

    All in one call.
    """
    n, d = x.shape
    steps = np.array([1.0, -1.0, 2.0, -2.0])[:order, None, None] * _STEP * np.eye(d)
    points = x[:, None] + np.concatenate([np.zeros((1, d)), steps.reshape(-1, d)])
    values = function(points.reshape(-1, d)).reshape(n, -1)
    ahead, behind, *far = np.swapaxes(values[:, 1:].reshape(n, order, d), 0, 1)
    if not far:
        return values[:, 0], (ahead - behind) / (2 * _STEP)
    return values[:, 0], (8 * (ahead - behind) - (far[0] - far[1])) / (12 * _STEP)


def searched(
    function: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    flat: float,
    *,
    smooth: bool = True,
    spread: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray | None]:
    """Return the minimiser, searched for in units of how sharply the function bends, and a spread.

    A function that is not smooth is an approximation itself: there the search ends where slopes
    lead no further. The spread, (n, n), is about the inverse of the curvature: another search near
    the same minimum is several times shorter with it. It is None where nothing tells it.
    """
    factors = scale(function, start)

    def scaled(y: FloatArray) -> FloatArray:
        return function(start + factors * y)

    reached, n_tried = (np.inf, np.zeros(len(start))), 0

    def value_and_slope(y: FloatArray) -> tuple[float, FloatArray]:
        nonlocal n_tried
        n_tried += 1
        if not smooth and n_tried > _TRIES:
            raise _RoughError
        values, slopes = _values_and_slopes(scaled, y[None], _order(smooth))
        return float(values[0]), slopes[0]

    def stepped(intermediate_result: optimize.OptimizeResult) -> None:
        nonlocal reached, n_tried
        gained = reached[0] - intermediate_result.fun
        reached, n_tried = (intermediate_result.fun, intermediate_result.x), 0
        if not smooth and gained < _ROUGH:
            raise StopIteration

    units = np.outer(factors, factors)
    options = {"gtol": flat, "hess_inv0": None if spread is None else spread / units}
    try:
        found = optimize.minimize(
            value_and_slope,
            np.zeros(len(start)),
            jac=True,
            method="BFGS",
            callback=stepped,
            options=options,
        )
    except _RoughError:
        return start + factors * reached[1], spread
    spread = 0.5 * (found.hess_inv + found.hess_inv.T) * units
    if smooth and not found.success:
        # Rounding of nearly singular covariances: no slope is to be had of it.
        found = optimize.minimize(
            lambda y: float(scaled(y)), found.x, method="Nelder-Mead", options=_WITHOUT_SLOPE
        )
    return start + factors * found.x, spread


def scale(function: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """Return factors of at most 1 by which steps have to shrink where a function bends sharply."""
    factors, is_sharp, here = np.ones(len(x)), np.ones(len(x), dtype=bool), function(x)
    for factor in 0.5 ** np.arange(9):
        steps = WIDTH * factor * np.eye(len(x))
        bends = np.abs(function(x + steps) + function(x - steps) - 2 * here)
        factors[is_sharp & (bends < 1)] = factor
        is_sharp &= ~(bends < 1)
        if not is_sharp.any():
            break
    return factors


def hessian(
    function: Callable[[FloatArray], FloatArray], x: FloatArray, *, smooth: bool = True
) -> FloatArray:
    """Hessian by central differences of gradients, with steps that rounding and bends allow."""
    factors = scale(function, x)

    def scaled(y: FloatArray) -> FloatArray:
        return function(x + factors * y)

    # Not all steps in one call: many textures' coefficients take memory at each point.
    pairs = [np.stack([step, -step]) for step in WIDTH * np.eye(len(x))]
    slopes = np.array([_values_and_slopes(scaled, pair, _order(smooth))[1] for pair in pairs])
    rows = (slopes[:, 0] - slopes[:, 1]) / (2 * WIDTH)
    value: FloatArray = 0.5 * (rows + rows.T) / np.outer(factors, factors)
    return value


def _order(smooth: bool) -> int:
    return 4 if smooth else 2


def widths(function: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """Return by how much each coordinate spreads alone, exp(-function) being its density.

    For functions with humps and kinks, whose curvature at a point says little of the rest. From a
    thousandth of a prior sd to four.
    """
    out = 0.001 * 2.0 ** np.arange(13)
    steps = np.concatenate([-out[::-1], [0.0], out])
    values = function(x + steps[:, None, None] * np.eye(len(x)))
    density = np.exp(np.minimum(values[len(out)] - values, 0.0))
    mass = density * np.gradient(steps)[:, None]
    value: FloatArray = np.sqrt(steps**2 @ mass / mass.sum(axis=0))
    return value
