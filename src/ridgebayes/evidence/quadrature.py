"""Evidence by the trapezoidal rule in whitened coordinates: the deterministic reference.

In coordinates where the posterior is nearly a standard normal the trapezoidal rule converges faster
than any power of its step: for an exact normal a step of 1 errs by 5e-9. So there is little to do
but to widen the box until nothing is left outside, and to halve the step until nothing changes.
"""

import math
from collections.abc import Callable

import numpy as np
from scipy.special import logsumexp

from ridgebayes._types import FloatArray
from ridgebayes.inference.laplace import Laplace
from ridgebayes.inference.log_evidence import LogEvidence

_OUTSIDE = -24.0  # log density relative to the peak that may be cut off at a face of the box
_HALF_WIDTH_MAX = 200.0  # with known errors sigma may go to 0, and log sigma has a long tail
_BEYOND = 4.0  # sds by which the box is widened to see that nothing is left outside
_CHUNK = 100_000


def quadrature_evidence(
    log_density: Callable[[FloatArray], FloatArray],
    laplace: Laplace,
    *,
    tol: float = 1e-6,
    points_max: int = 20_000_000,
) -> LogEvidence:
    """Integrate a posterior of up to four parameters.

    Parameters
    ----------
    log_density : callable
        (n, n_parameter) to (n,): log posterior density in unconstrained coordinates.
    laplace : Laplace
        Its whitened coordinates are integrated over.
    tol : float, optional
        The step is halved until the log evidence changes by less.
    points_max : int, optional
        Size of the finest grid; one that needs more counts as failed.

    Returns
    -------
    LogEvidence
        `se` is the last change, a bound on the error. The status is not ok, and the value NaN,
        where there are more than four parameters, the tails do not fall off, or the tolerance
        needs too many points.

    Notes
    -----
    *Accuracy.* Better than `tol`, usually by orders of magnitude: convergence is geometric.
    *Cost.* A few thousand points for two parameters, a few hundred thousand for four.
    """
    n_parameter = len(laplace.mode)
    if n_parameter > 4:
        return _failed(f"{n_parameter} parameters; quadrature is for up to four")

    in_z, turn = laplace.whitened(log_density), _turn(n_parameter)

    def turned(z: FloatArray) -> FloatArray:
        return in_z(z @ turn)

    box = _box(turned, n_parameter)
    if box is None:
        return _failed(f"the density does not fall off within {_HALF_WIDTH_MAX:g} sds")
    step, before = 1.0, math.nan
    while True:
        axes = [np.arange(low, high + step / 2, step) for low, high in box]
        if math.prod(map(len, axes)) > points_max:
            return _failed(f"the log evidence still changes by more than {tol:g}")
        value = _sum(turned, axes) + n_parameter * math.log(step)
        if abs(value - before) < tol:
            # A ridge narrower than the box's own points may have slipped through a face: what is
            # beyond has to be negligible at a step that is known to be fine enough.
            wider = [(low - _BEYOND, high + _BEYOND) for low, high in box]
            axes = [np.arange(low, high + step, 2 * step) for low, high in wider]
            if math.prod(map(len, axes)) > points_max:
                return _failed(f"the log evidence still changes by more than {tol:g}")
            beyond = _sum(turned, axes) + n_parameter * math.log(2 * step) - before
            if abs(beyond) < tol:
                return LogEvidence("quadrature", value, max(abs(value - before), 1e-12))
            if max(high for _, high in wider) > _HALF_WIDTH_MAX:
                return _failed(f"the density does not fall off within {_HALF_WIDTH_MAX:g} sds")
            box, value = wider, math.nan
        step, before = step / 2, value


def _turn(n: int) -> FloatArray:
    """Return a reflection that shares the last coordinate, an error's scale, out to all axes.

    Of few rows its density ends abruptly towards zero. Along an axis of its own, that is what
    decides how fine a grid has to be; beside the others, which are smooth, it is averaged out.
    """
    if n == 1:
        return np.eye(1)
    mirror = np.eye(n)[-1] - 1 / math.sqrt(n)
    value: FloatArray = np.eye(n) - 2 * np.outer(mirror, mirror) / (mirror @ mirror)
    return value


def _failed(reason: str) -> LogEvidence:
    return LogEvidence("quadrature", math.nan, math.nan, reason)


def _box(
    in_z: Callable[[FloatArray], FloatArray], n_parameter: int
) -> list[tuple[float, float]] | None:
    """Widen a box face by face until the density on every face is negligible."""
    low, high = np.full(n_parameter, -6.0), np.full(n_parameter, 6.0)

    def highest(axis: int | None = None, at: float = 0.0) -> float:
        # Two sds between points: what this must not miss is a slow tail, not a narrow peak.
        grids = [np.arange(a, b + 1, 2.0) for a, b in zip(low, high, strict=True)]
        if axis is not None:
            grids[axis] = np.array([at])
        return float(in_z(_points(grids)).max())

    while max(-low.min(), high.max()) <= _HALF_WIDTH_MAX:
        peak, grown = highest(), False
        for axis in range(n_parameter):
            if highest(axis, low[axis]) > peak + _OUTSIDE:
                low[axis], grown = low[axis] - 4, True
            if highest(axis, high[axis]) > peak + _OUTSIDE:
                high[axis], grown = high[axis] + 4, True
        if not grown:
            return [(float(a), float(b)) for a, b in zip(low, high, strict=True)]
    return None


def _points(axes: list[FloatArray]) -> FloatArray:
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def _sum(in_z: Callable[[FloatArray], FloatArray], axes: list[FloatArray]) -> float:
    """Return log of the sum over the grid, in chunks of bounded memory."""
    rest = _points(axes[1:]) if len(axes) > 1 else np.empty((1, 0))
    per_chunk = max(_CHUNK // len(rest), 1)
    parts = []
    for i in range(0, len(axes[0]), per_chunk):
        first = axes[0][i : i + per_chunk]
        z = np.concatenate(
            [np.repeat(first, len(rest))[:, None], np.tile(rest, (len(first), 1))], axis=1
        )
        parts.append(float(logsumexp(in_z(z))))
    return float(logsumexp(parts))
