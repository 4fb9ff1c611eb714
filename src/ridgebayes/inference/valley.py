r"""A curved valley of two coefficients, straightened.

Where rows know one direction of two coefficients far better than the other (Hybrid at a single
texture: the rate is known, how it is shared among c1 and c2 is not), the posterior lies along a
curve, of constant rates, many of its own widths away from its tangent. Along the tangent s and
across it t, the shear

.. math:: (s, t) \to (s, t + h(s))

carries the tangent onto the curve. Its volume is 1.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import interpolate, linalg

from ridgebayes._types import FloatArray
from ridgebayes.model.model import Model

_N_SIDE = 24  # nodes on each side of the mode
_REACH = 8.0  # posterior sds along the valley
_STRAIGHT = 0.3  # posterior sds across, within three along, below which nothing is bent
_N_NEWTON = 20
_CLOSE = 1e-9  # of the sd across, at which a node is found


@dataclass(frozen=True, eq=False)
class Valley:
    """The curve, as the height h over a tangent.

    Parameters
    ----------
    origin : ndarray of float, shape (2,)
        Point of the curve, in unconstrained coordinates.
    basis : ndarray of float, shape (2, 2)
        Orthonormal columns: along the tangent, and across it.
    height : scipy.interpolate.CubicSpline
        h(s).
    """

    origin: FloatArray
    basis: FloatArray
    height: interpolate.CubicSpline

    def bent(self, u: FloatArray, sign: int = 1) -> FloatArray:
        """Carry points, shape (..., 2), from the tangent to the curve; with `sign` -1 back."""
        along = (u - self.origin) @ self.basis[:, 0]
        ends = self.height.x[[0, -1]]
        shift = sign * self.height(np.clip(along, *ends))
        moved: FloatArray = u + shift[..., None] * self.basis[:, 1]
        return moved


def find_valley(model: Model, mode: FloatArray, covariance: FloatArray) -> Valley | None:
    """Return the valley of constant rates through a mode.

    Parameters
    ----------
    model : Model
        Posterior.
    mode : ndarray of float, shape (n_coefficient,)
        Unconstrained coordinates of the coefficients.
    covariance : ndarray of float, shape (n_coefficient, n_coefficient)
        Theirs, near the mode.

    Returns
    -------
    Valley or None
        None where coefficients are not two, or the valley is straight as far as the posterior goes.
    """
    if model.n_coefficient != 2 or not np.isfinite(covariance).all():
        return None
    at_mode = model.linearised(mode)
    _, vectors = linalg.eigh(at_mode[:, :2].T @ at_mode[:, :2])
    sd = np.sqrt(np.einsum("ji,jk,ki->i", vectors, covariance, vectors))
    across = 1 / math.sqrt(vectors[:, 1] @ linalg.solve(covariance, vectors[:, 1]))
    sides = []
    for sign in (-1, 1):
        steps = sign * sd[0] * _REACH * np.arange(1, _N_SIDE + 1) / _N_SIDE
        sides.append(_heights(model, mode, vectors, steps, at_mode[:, 2], across))
    below, above = sides
    if min(len(below), len(above)) < 2:
        return None
    s = np.concatenate([below[::-1, 0], [0.0], above[:, 0]])
    t = np.concatenate([below[::-1, 1], [0.0], above[:, 1]])
    if np.abs(t[np.abs(s) <= 3 * sd[0]]).max() < _STRAIGHT * across:
        return None
    return Valley(mode, vectors, interpolate.CubicSpline(s, t))


def _heights(
    model: Model,
    mode: FloatArray,
    vectors: FloatArray,
    steps: FloatArray,
    residual: FloatArray,
    across: float,
) -> FloatArray:
    """Follow the valley from the mode; return s and h where rates are most nearly those of it."""
    found: list[tuple[float, float]] = []
    t = 0.0
    for s in steps:
        for _ in range(_N_NEWTON):
            rows = model.linearised(mode + vectors @ np.array([s, t]))
            if not np.isfinite(rows).all():  # no rate is positive there
                change = math.nan
                break
            slope = rows[:, :2] @ vectors[:, 1]
            change = float(slope @ (rows[:, 2] - residual) / (slope @ slope))
            t -= change
            if not abs(change) > _CLOSE * across:
                break
        else:
            change = math.nan
        if not math.isfinite(change):
            break
        found.append((s, t))
    return np.array(found).reshape(-1, 2)
