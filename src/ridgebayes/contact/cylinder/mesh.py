"""Graded quadrilateral meshes of a disk, finest along the pressed part of its rim.

A core of three blocks in each quarter is surrounded by a ring in polar coordinates, whose columns
split in three towards the rim. All elements are quadrilaterals, so no mesh generator is needed.
Edges are quadratic and follow the circle.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from skfem import MeshQuad, MeshQuad2

from ridgebayes._types import FloatArray, IntArray

_CORE_RADIUS = 0.45  # over the radius of the disk
_MIN_COLUMNS = 6  # of the core along a quarter of its rim
_HEIGHT_OVER_WIDTH = 1.5  # of elements
_SPLIT_DEPTH = 2.0  # depth at which columns split, over their width; 1 costs 0.4 % of a load


@dataclass(frozen=True, eq=False)
class DiskMesh:
    """Part of the disk of radius 1 around the origin, pressed from below.

    Parameters
    ----------
    mesh : skfem.MeshQuad2
        Nine-node quadrilaterals.
    rim : ndarray of int, shape (n_edge, 3)
        Nodes of the edges along the circle, counter-clockwise from the lowest angle: first,
        middle, last.
    axis, mid_plane : ndarray of int
        Nodes with x = 0, and with y = 0.
    """

    mesh: MeshQuad2
    rim: IntArray
    axis: IntArray
    mid_plane: IntArray

    @property
    def points(self) -> FloatArray:
        """Node coordinates, shape (n_node, 2)."""
        return np.ascontiguousarray(self.mesh.doflocs.T)


def disk_mesh(
    size: Callable[[FloatArray], FloatArray], *, refine: int = 1, both_sides: bool = False
) -> DiskMesh:
    """Mesh a quarter of a disk, or its lower half.

    Parameters
    ----------
    size : callable
        Returns the target length of the rim's edges, over the radius, at angles from the lowest
        point, shape (n,), 0 to pi/2. It is used for both sides if both are meshed.
    refine : int, optional
        Factor by which the core's elements are at least refined; `size` determines the rim.
    both_sides : bool, optional
        Whether to mesh x < 0 too, as the mirror image.

    Returns
    -------
    DiskMesh
        Mesh whose finest elements are about as long as wide, with edges at most as long as the
        target; elements inside grow with depth.
    """
    ring: list[FloatArray] = []
    smallest = float(np.min(size(np.linspace(0.0, math.pi / 2, 20_001))))
    n_core, n_level = _columns(smallest, _MIN_COLUMNS * refine)
    edges = np.linspace(0.0, math.pi / 2, n_core + 1)
    width = edges[1]
    depth = 1.0 - _CORE_RADIUS

    def add(theta: Sequence[FloatArray], radius: Sequence[float]) -> None:
        """Add quadrilaterals of one shape, with corners counter-clockwise."""
        angle, r = np.column_stack(theta), np.array(radius)
        ring.append(np.stack([r * np.sin(angle), -r * np.cos(angle)], axis=-1))

    def rows(stop: float) -> None:
        low, high = edges[:-1], edges[1:]
        n = max(round((depth - stop) / (_HEIGHT_OVER_WIDTH * width)), 1)
        for inner, outer in pairwise(1.0 - np.linspace(depth, stop, n + 1)):
            add((low, low, high, high), (inner, outer, outer, inner))

    for _ in range(n_level):
        reach = _SPLIT_DEPTH * width
        below = 0.8 * width / 3  # height of the row in which columns split
        rows(reach)
        edges = _split(edges, size, (1.0 - reach, 1.0 - reach + below), add)
        depth, width = reach - below, width / 3
    rows(0.0)
    quads = np.concatenate([_core(n_core), *ring])
    if both_sides:
        quads = np.concatenate([quads, (quads * [-1.0, 1.0])[:, ::-1]])
    return _joined(quads)


def _columns(smallest: float, fewest: int) -> tuple[int, int]:
    """Return the number of columns of the core and of splits that give the finest width."""
    return min(
        (
            (n, level)
            for n in range(fewest, 3 * fewest - 1, 2)
            for level in range(12)
            if math.pi / 2 / n / 3**level <= smallest * (1 + 1e-9)
        ),
        key=lambda choice: -(math.pi / 2 / choice[0] / 3 ** choice[1]) + 1e-6 * choice[0],
    )


def _split(
    edges: FloatArray,
    size: Callable[[FloatArray], FloatArray],
    radii: tuple[float, float],
    add: Callable[[Sequence[FloatArray], Sequence[float]], None],
) -> FloatArray:
    """Add a row in which too wide columns split in three; return the edges above it."""
    low, high = edges[:-1], edges[1:]
    width = high - low
    at = low[:, None] + np.linspace(0.0, 1.0, 9) * width[:, None]
    wide = width > (1 + 1e-9) * size(at.ravel()).reshape(at.shape).min(axis=1)
    inner, outer = radii
    middle = 0.5 * (inner + outer)
    left, right = low[~wide], high[~wide]
    add((left, left, right, right), (inner, outer, outer, inner))
    first, last, third = low[wide], high[wide], width[wide] / 3
    low_third, high_third = first + third, last - third
    add((first, first, low_third, low_third), (inner, outer, outer, middle))
    add((low_third, low_third, high_third, high_third), (middle, outer, outer, middle))
    add((high_third, high_third, last, last), (middle, outer, outer, inner))
    add((first, low_third, high_third, last), (inner, middle, middle, inner))
    return np.sort(np.concatenate([edges, low_third, high_third]))


def _core(n: int) -> FloatArray:
    """Return the quadrilaterals of the core: a square, and two blocks between it and the ring."""
    m = n // 2
    side = 0.55 * _CORE_RADIUS
    grid = np.linspace(0.0, side, m + 1)
    theta = np.linspace(0.0, math.pi / 2, n + 1)
    arc = _CORE_RADIUS * np.column_stack([np.sin(theta), -np.cos(theta)])
    across = np.column_stack([grid, np.full(m + 1, -side)])
    inner = np.concatenate([across, np.column_stack([np.full(m, side), -grid[-2::-1]])])
    n_row = max(m // 2, 1)
    t = np.linspace(0.0, 1.0, n_row + 1)[:, None, None]
    around = inner + t * (arc - inner)  # (row, column, 2)
    X, Y = np.meshgrid(grid, -grid, indexing="ij")
    square = np.stack([X, Y], axis=-1)
    return np.concatenate([_cells(square)[:, ::-1], _cells(around)])


def _cells(grid: FloatArray) -> FloatArray:
    cells = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2)
    return cells.reshape(-1, 4, 2)


def _joined(quads: FloatArray) -> DiskMesh:
    """Join quadrilaterals at their common corners, and curve the edges of the ring."""
    corners = quads.reshape(-1, 2)
    keys = np.round(corners * 1e9).astype(np.int64)
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    cells = number.reshape(-1, 4)
    flat = MeshQuad(np.ascontiguousarray(corners[first].T), np.ascontiguousarray(cells.T))
    mesh = MeshQuad2.from_mesh(flat)
    points = np.array(mesh.doflocs)
    element, facets = mesh.dofs.element_dofs, flat.facets
    middle = mesh.dofs.facet_dofs[0]
    points[:, middle] = _halfway(points[:, facets])
    points[:, element[8]] = _halfway(points[:, element[:4]])
    mesh = MeshQuad2(points, mesh.t)
    on_rim = np.hypot(*points[:, facets]).min(axis=0) > 1.0 - 1e-9
    ends = facets[:, on_rim]
    # The angle of an edge's middle is unique, also where the rim starts and ends at the top.
    x, y = points[:, middle[on_rim]]
    theta = np.arctan2(x, -y)
    first, last = points[:, ends[0]], points[:, ends[1]]
    forward = (last[0] - first[0]) * -y + (last[1] - first[1]) * x > 0
    ends = np.where(forward, ends, ends[::-1])
    rim = np.column_stack([ends[0], middle[on_rim], ends[1]])[np.argsort(theta)]
    axis, mid_plane = (np.flatnonzero(np.abs(x) < 1e-12) for x in points)
    return DiskMesh(mesh, rim, axis, mid_plane)


def _halfway(points: FloatArray) -> FloatArray:
    """Return the means of points, shape (2, n_point, n), in polar coordinates in the ring."""
    straight = points.mean(axis=1)
    radius = np.hypot(*points)
    ring = radius.min(axis=0) > _CORE_RADIUS - 1e-9
    direction = (points / np.maximum(radius, 1e-300)).mean(axis=1)
    direction /= np.maximum(np.hypot(*direction), 1e-300)
    value: FloatArray = np.where(ring, radius.mean(axis=0) * direction, straight)
    return value
