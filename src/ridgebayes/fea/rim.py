"""The rim of a pressed cylinder: its circle, its sides, and how far it is from points below."""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import krogh_interpolate

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.record import FARTHEST, HUGE

_ROUND = 2e-3  # of R: how far surface nodes may lie off a circle
_LEAST_NODES = 5
_TINY = 1e-9  # of R: nodes so near to the axis are on both sides


@dataclass(frozen=True)
class Rim:
    """The surface's nodes from the bottom outwards, each side by itself, x counted outwards.

    Parameters
    ----------
    R : float, length
        Radius.
    centre : ndarray of float, shape (2,), length
        Centre of the undeformed circle.
    sides : tuple of (ndarray of int, float)
        Numbers of a side's nodes, and the sign of its x.
    """

    R: float
    centre: FloatArray
    sides: tuple[tuple[IntArray, float], ...] = field(repr=False)

    @classmethod
    def of(cls, undeformed: FloatArray, where: str, *, R: float | None, symmetry: str) -> "Rim":
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
        if symmetry == "half":
            # The axis is where the mesh ends: nodes on it tell it better than a circle does.
            x = at[np.argmin(np.abs(at[:, 0] - x)), 0]
        centre = np.array([x, y])
        fitted = math.sqrt(max(c + x * x + y * y, 0.0))
        R = fitted if R is None else R
        off = np.abs(np.hypot(*(at - centre).T) - R)
        if not off.max() <= _ROUND * R:
            raise InputError(
                f"{where}: surface nodes lie up to {off.max():.3g} off a circle of R = {R:.6g} "
                f"about ({x:.4g}, {y:.4g}); expected the undeformed surface of a cylinder, within "
                f"{_ROUND:g} R (the circle through them has R = {fitted:.6g})"
            )
        angle = np.arctan2(at[:, 0] - x, y - at[:, 1])
        return cls(float(R), centre, _sides(angle, where, symmetry))

    @classmethod
    def deformed(cls, x: FloatArray, where: str, *, R: float | None, symmetry: str) -> "Rim":
        """Take the sides of nodes at x, shape (n_node,), about an axis at x = 0: R is given.

        Raises
        ------
        InputError
            If R is not given, or nodes are few.
        """
        if R is None:
            raise InputError(f"{where}: no undeformed surface: expected --R, the body's radius")
        return cls(R, np.array([0.0, R]), _sides(x / R, where, symmetry))

    def check_reach(self, what: str, distance: float, where: str) -> None:
        """Refuse what is so far from the axis as no body is.

        Raises
        ------
        InputError
        """
        if not distance <= FARTHEST * self.R:
            rule = f"R = {self.R:.6g}; expected within {FARTHEST:g} R"
            raise InputError(f"{where}: a {what} {distance:.3g} from the axis, {rule}")

    def _outwards(self, position: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Return each side's x, counted outwards from the axis, and y."""
        x, y = position[:, 0] - self.centre[0], position[:, 1]
        return [(sign * x[nodes], y[nodes]) for nodes, sign in self.sides]

    def gaps(self, position: FloatArray, corners: FloatArray, radius: float) -> FloatArray:
        """Return the distance of the rim's nearer side from each corner, above sharp corners."""
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
        """Return how deep the rim is inside ridges, on the mean of where it is: a penalty's."""
        deep = []
        for x, y in self._outwards(position):
            on = (corners[:, :1] <= x) & (x <= corners[:, :1] + width)
            inside = corners[:, 1:] - y
            deep.append(inside[on & (inside > 0)])
        depths = np.concatenate(deep)
        return float(depths.mean()) if depths.size else 0.0


def _sides(along: FloatArray, where: str, symmetry: str) -> tuple[tuple[IntArray, float], ...]:
    """Return the nodes of each side of the axis, from places along the rim, and its sign."""
    outwards = {sign: np.argsort(sign * along, kind="stable") for sign in (1.0, -1.0)}
    halves = [(nodes[sign * along[nodes] >= -_TINY], sign) for sign, nodes in outwards.items()]
    sides = tuple(half for half in halves if len(half[0]) >= _LEAST_NODES)
    if len(sides) != (1 if symmetry == "half" else 2):
        there = ("no side of the axis", "one side of the axis only", "both sides of the axis")
        use = ("finer meshes", "--symmetry half", "--symmetry full")
        raise InputError(f"{where}: surface nodes on {there[len(sides)]}; use {use[len(sides)]}")
    return sides


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
        heights.append(float(krogh_interpolate(xs, ys, at)))
    return min(heights)


def _distance(x: FloatArray, y: FloatArray, at: float, height: float) -> float:
    """Return how far a point below is from a curve through nodes, straight between them."""
    start, along = np.column_stack([x, y])[:-1], np.diff(np.column_stack([x, y]), axis=0)
    from_start = np.array([at, height]) - start
    length = np.maximum((along**2).sum(axis=1), 1e-300)
    part = np.clip((from_start * along).sum(axis=1) / length, 0.0, 1.0)
    return float(np.hypot(*(from_start - part[:, None] * along).T).min())
