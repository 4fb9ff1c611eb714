"""Rim of a pressed cylinder: its circle, its sides, and its distance from ridge corners."""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import krogh_interpolate

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.record import FARTHEST, HUGE

_MAX_OFF_CIRCLE = 2e-3  # largest distance over R of a surface node from the fitted circle
_MIN_NODES = 5
_FLAT = 1.5  # departure from a circle, over that of a flat, from which a surface is none
NEAR = 1e-5  # distance over R below which a node is on a corner, the circle or the axis


@dataclass(frozen=True)
class Rim:
    """Surface nodes of a cylinder, sorted outwards on each side of the axis.

    Parameters
    ----------
    R : float, length
        Radius.
    centre : ndarray of float, shape (2,), length
        Centre of the undeformed circle.
    sides : tuple of (ndarray of int, float)
        Indices of the nodes of each side, and the sign of their x.
    """

    R: float
    centre: FloatArray
    sides: tuple[tuple[IntArray, float], ...] = field(repr=False)

    @classmethod
    def of(cls, undeformed: FloatArray, where: str, *, R: float | None, symmetry: str) -> "Rim":
        """Fit centre, radius and sides to undeformed nodes, shape (n_node, 2).

        Raises
        ------
        InputError
            If there are too few nodes, or they are not on a circle or not on the sides that
            `symmetry` requires.
        """
        at = undeformed
        if len(at) < _MIN_NODES:
            raise InputError(f"{where}: {len(at)} surface nodes; expected at least {_MIN_NODES}")
        if not (np.abs(at) <= HUGE).all():
            raise InputError(f"{where}: surface nodes; expected coordinates within {HUGE:g}")
        matrix = np.column_stack([2 * at, np.ones(len(at))])
        (x, y, c), *_ = np.linalg.lstsq(matrix, (at**2).sum(axis=1), rcond=None)
        if symmetry == "half":
            # A half mesh ends at the axis; the node there is more accurate than the fitted circle.
            x = at[np.argmin(np.abs(at[:, 0] - x)), 0]
        centre = np.array([x, y])
        fitted = math.sqrt(max(c + x * x + y * y, 0.0))
        R = fitted if R is None else R
        off = np.abs(np.hypot(*(at - centre).T) - R)
        if not off.max() <= _MAX_OFF_CIRCLE * R:
            raise InputError(
                f"{where}: surface nodes lie up to {off.max():.3g} off a circle of R = {R:.6g} "
                f"about ({x:.4g}, {y:.4g}); expected the undeformed surface of a cylinder, within "
                f"{_MAX_OFF_CIRCLE:g} R (the circle through them has R = {fitted:.6g})"
            )
        angle = np.arctan2(at[:, 0] - x, y - at[:, 1])
        if np.cos(angle).mean() < -_MAX_OFF_CIRCLE:  # about 0 for a whole circle
            rule = "expected the body above the ridges, with y upwards"
            raise InputError(f"{where}: the surface is the upper side of its circle; {rule}")
        return cls(float(R), centre, _sides(angle, where, symmetry))

    @classmethod
    def deformed(cls, at: FloatArray, where: str, *, R: float | None, symmetry: str) -> "Rim":
        """Find the sides of nodes about an axis at x = 0, for a given R.

        Parameters
        ----------
        at : ndarray of float, shape (n_node, 1) or (n_node, 2), length
            Coordinates across the ridges in the first state and, if they are known, heights.
        where, R, symmetry
            As in `of`.

        Raises
        ------
        InputError
            If R is None, there are too few nodes, they are not on the sides that `symmetry`
            requires, or their heights are surely not those of the lower side of the circle.
        """
        if R is None:
            raise InputError(f"{where}: no undeformed surface: expected --R, the body's radius")
        x, *heights = at.T
        # Contact only flattens the circle; on its upper side, heights differ from it by twice that.
        circle = R - np.sqrt(np.maximum(R * R - x * x, 0.0))
        if heights and np.ptp(heights[0] - circle) > _FLAT * np.ptp(circle) + NEAR * R:
            raise InputError(
                f"{where}: the surface is not the lower side of a circle of R = {R:.6g} about "
                "x = 0: expected the body above the ridges, with y upwards, and --R in the unit of "
                "the coordinates"
            )
        return cls(R, np.array([0.0, R]), _sides(x / R, where, symmetry))

    def check_reach(self, what: str, distance: float, where: str) -> None:
        """Check the distance of an object, named `what` in the message, from the axis.

        Raises
        ------
        InputError
            If the distance is larger than `FARTHEST` times R.
        """
        if not distance <= FARTHEST * self.R:
            rule = f"R = {self.R:.6g}; expected within {FARTHEST:g} R"
            raise InputError(f"{where}: a {what} {distance:.3g} from the axis, {rule}")

    def _outwards(self, position: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Return the distance from the axis and the height of the nodes of each side."""
        x, y = position[:, 0] - self.centre[0], position[:, 1]
        return [(sign * x[nodes], y[nodes]) for nodes, sign in self.sides]

    def gaps(self, position: FloatArray, corners: FloatArray, radius: float) -> FloatArray:
        """Return the smaller gap of both sides at each corner: vertical for sharp corners."""
        sides = []
        for x, y in self._outwards(position):
            if radius == 0:
                sides.append([_height(x, y, far) - high for far, high in corners])
            else:
                centres = corners + np.array([radius, -radius])
                sides.append([_distance(x, y, *centre) - radius for centre in centres])
        value: FloatArray = np.min(np.array(sides), axis=0)
        return value

    def overlap(self, position: FloatArray, corners: FloatArray, width: float) -> float:
        """Return the mean depth of rim nodes inside ridges, the overlap of penalty contact."""
        deep = []
        for x, y in self._outwards(position):
            on = (corners[:, :1] <= x) & (x <= corners[:, :1] + width)
            inside = corners[:, 1:] - y
            deep.append(inside[on & (inside > 0)])
        depths = np.concatenate(deep)
        return float(depths.mean()) if depths.size else 0.0


def _sides(along: FloatArray, where: str, symmetry: str) -> tuple[tuple[IntArray, float], ...]:
    """Return the nodes of each side, sorted outwards by angle, and the sign of their x."""
    outwards = {sign: np.argsort(sign * along, kind="stable") for sign in (1.0, -1.0)}
    halves = [(nodes[sign * along[nodes] >= -NEAR], sign) for sign, nodes in outwards.items()]
    sides = tuple(half for half in halves if len(half[0]) >= _MIN_NODES)
    if len(sides) != (1 if symmetry == "half" else 2):
        there = ("no side of the axis", "one side of the axis only", "both sides of the axis")
        use = ("finer meshes", "--symmetry half", "--symmetry full")
        raise InputError(f"{where}: surface nodes on {there[len(sides)]}; use {use[len(sides)]}")
    return sides


def _height(x: FloatArray, y: FloatArray, at: float) -> float:
    """Return the lowest y at x = at of a curve through nodes; NaN if the curve does not reach it.

    The interpolation is cubic through four nodes if their x rises, and linear otherwise.
    """
    crossing = np.flatnonzero((x[:-1] - at) * (x[1:] - at) <= 0)
    if not crossing.size:
        return math.nan
    heights = []
    for i in crossing:
        near = slice(max(i - 1, 0), i + 3)
        xs, ys = x[near], y[near]
        if len(xs) < 4 or not (np.diff(xs) > 0).all():
            xs, ys = x[i : i + 2], y[i : i + 2]
            if xs[0] == xs[1]:
                heights.append(float(ys.min()))
                continue
        heights.append(float(krogh_interpolate(xs, ys, at)))
    return min(heights)


def _distance(x: FloatArray, y: FloatArray, at: float, height: float) -> float:
    """Return the distance of a point from a polygon through nodes."""
    start, along = np.column_stack([x, y])[:-1], np.diff(np.column_stack([x, y]), axis=0)
    from_start = np.array([at, height]) - start
    length = np.maximum((along**2).sum(axis=1), 1e-300)
    part = np.clip((from_start * along).sum(axis=1) / length, 0.0, 1.0)
    return float(np.hypot(*(from_start - part[:, None] * along).T).min())
