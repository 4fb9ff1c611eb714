"""The rim of a pressed cylinder: its nodes, and how far they are from ridges."""

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.record import HUGE

_ROUND = 2e-3  # of R: how far surface nodes may lie off a circle
_LEAST_NODES = 5


@dataclass(frozen=True)
class Rim:
    """The surface's nodes from the bottom outwards, each side by itself, x counted outwards.

    Parameters
    ----------
    R : float, length
        Radius.
    centre : ndarray of float, shape (2,), length
        Of the undeformed circle.
    sides : tuple of (ndarray of int, float)
        Numbers of a side's nodes, and the sign of its x.
    """

    R: float
    centre: FloatArray
    sides: tuple[tuple[IntArray, float], ...] = field(repr=False)  # node numbers, sign of x

    @classmethod
    def of(
        cls,
        undeformed: FloatArray,
        where: str,
        *,
        R: float | None,
        symmetry: Literal["half", "full"],
    ) -> "Rim":
        """Find centre, radius and sides of nodes, shape (n_node, 2).

        Raises
        ------
        InputError
            If they are few, are not on a circle, or not on the sides that the symmetry says.
        """
        at = undeformed
        if len(at) < _LEAST_NODES:
            raise InputError(f"{where}: {len(at)} surface nodes; expected at least {_LEAST_NODES}")
        if not (np.abs(at) <= HUGE).all():
            raise InputError(f"{where}: surface nodes; expected coordinates within {HUGE:g}")
        matrix = np.column_stack([2 * at, np.ones(len(at))])
        (x, y, c), *_ = np.linalg.lstsq(matrix, (at**2).sum(axis=1), rcond=None)
        centre = np.array([x, y])
        if symmetry == "half":
            # The axis is where the mesh ends: nodes on it tell it better than a circle does.
            x = at[np.argmin(np.abs(at[:, 0] - x)), 0]
            centre[0] = x
        found = math.sqrt(max(c + x * x + y * y, 0.0))
        R = found if R is None else R
        off = np.abs(np.hypot(*(at - centre).T) - R)
        if not off.max() <= _ROUND * R:
            raise InputError(
                f"{where}: surface nodes lie up to {off.max():.3g} off a circle of R = {R:.6g} "
                f"about ({x:.4g}, {y:.4g}); expected the undeformed surface of a cylinder, within "
                f"{_ROUND:g} R (the circle through them has R = {found:.6g})"
            )
        angle = np.arctan2(at[:, 0] - x, y - at[:, 1])
        sides = []
        tiny = 1e-9
        for sign in (1.0, -1.0):
            some = np.flatnonzero(sign * angle >= -tiny)
            some = some[np.argsort(sign * angle[some])]
            if len(some) >= _LEAST_NODES:
                sides.append((some, sign))
        if not sides or (symmetry == "full" and len(sides) < 2):
            raise InputError(
                f"{where}: surface nodes on one side of the axis only; use --symmetry half"
            )
        if symmetry == "half" and len(sides) > 1:
            raise InputError(
                f"{where}: surface nodes on both sides of the axis; use --symmetry full"
            )
        return cls(float(R), centre, tuple(sides))

    def gaps(self, position: FloatArray, corners: FloatArray, radius: float) -> FloatArray:
        """Return how far the rim is from each corner, the nearer side's: above sharp ones."""
        sides = []
        for nodes, sign in self.sides:
            x = sign * (position[nodes, 0] - self.centre[0])
            y = position[nodes, 1]
            if radius == 0:
                sides.append([_height(x, y, far) - high for far, high in corners])
            else:
                centres = corners + np.array([radius, -radius])
                sides.append([_distance(x, y, *centre) - radius for centre in centres])
        return np.min(np.array(sides), axis=0)

    def overlap(self, position: FloatArray, corners: FloatArray, width: float) -> float:
        """Return how deep the rim is inside ridges, on the mean of where it is: a penalty's."""
        deep = []
        for nodes, sign in self.sides:
            x = sign * (position[nodes, 0] - self.centre[0])
            over = corners[:, :1] <= x
            on = over & (x <= corners[:, :1] + width)
            inside = corners[:, 1:] - position[nodes, 1]
            deep.append(inside[on & (inside > 0)])
        found = np.concatenate(deep)
        return float(found.mean()) if found.size else 0.0


def _height(x: FloatArray, y: FloatArray, at: float) -> float:
    """Return the lowest y of a curve through nodes where x = at; NaN where it does not get there.

    Through four nodes around, where x rises through them; straight between two else.
    """
    crossing = np.flatnonzero((x[:-1] - at) * (x[1:] - at) <= 0)
    if not crossing.size:
        return math.nan
    heights = []
    for i in crossing:
        some = slice(max(i - 1, 0), i + 3)
        xs, ys = x[some], y[some]
        if len(xs) < 4 or not (np.diff(xs) > 0).all():
            xs, ys = x[i : i + 2], y[i : i + 2]
            if xs[0] == xs[1]:
                heights.append(float(ys.min()))
                continue
        weights = [
            np.prod([(at - xs[k]) / (xs[i] - xs[k]) for k in range(len(xs)) if k != i])
            for i in range(len(xs))
        ]
        heights.append(float(np.dot(weights, ys)))
    return min(heights)


def _distance(x: FloatArray, y: FloatArray, at: float, height: float) -> float:
    """Return how far a point below is from a curve through nodes, straight between them."""
    start, along = np.column_stack([x, y])[:-1], np.diff(np.column_stack([x, y]), axis=0)
    from_start = np.array([at, height]) - start
    length = np.maximum((along**2).sum(axis=1), 1e-300)
    part = np.clip((from_start * along).sum(axis=1) / length, 0.0, 1.0)
    return float(np.hypot(*(from_start - part[:, None] * along).T).min())
