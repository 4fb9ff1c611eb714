"""Gaps between the deformed rim and the rigid side, with their derivatives.

A ray runs from a point y of the rigid side along its normal n to the rim x(s). The gap is
n.(x(s) - y) with t.(x(s) - y) = 0. With m = n - t (n.x')/(t.x') and ds = -(t.du)/(t.x'),
"""

from dataclasses import dataclass

import numpy as np

from ridgebayes._types import FloatArray, IntArray


def shapes(s: FloatArray) -> FloatArray:
    """Return the quadratic shape functions of an edge at s in [0, 1], shape (..., 3)."""
    return np.stack([(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)], axis=-1)


def slopes(s: FloatArray) -> FloatArray:
    """Return the derivatives of the shape functions by s, shape (..., 3)."""
    return np.stack([4 * s - 3, 4 - 8 * s, 4 * s - 1], axis=-1)


def _dot(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the scalar products of vectors, shape (n,)."""
    value: FloatArray = np.einsum("ni,ni->n", x, y)
    return value


_CURVATURES = slopes(np.ones(())) - slopes(np.zeros(()))  # second derivatives, constant in s
_ROUNDING = 1e-12
_RAYS_PER_BOX = 16
# Limit of an edge's slope in the stiffness. The tangent of an edge that folds over a sharp corner
# changes sign at the vertical, and a stiffness of the wrong sign misleads Newton's method. A lower
# limit would cut real slopes.
_MAX_SLOPE = 1e4


@dataclass(frozen=True, eq=False)
class Hits:
    """Intersections of rays from the rigid side with the rim, one for each ray that meets it.

    Parameters
    ----------
    ray : ndarray of int, shape (n,)
        Number of the ray.
    edge : ndarray of int, shape (n,)
        Edge of the rim.
    s : ndarray of float, shape (n,)
        Position on the edge, 0 to 1.
    gap : ndarray of float, shape (n,)
        Gap along the ray; negative if the body is inside the rigid side.
    gradient : ndarray of float, shape (n, 3, 2)
        Derivative of the gap by the edge's node positions.
    hessian : ndarray of float, shape (n, 6, 6)
        Second derivative of the gap.
    along : ndarray of float, shape (n, 6, 6)
        Derivative of the nodal forces of a unit force along the rigid side.
    tangent : ndarray of float, shape (n, 2)
        Tangents of the rigid side.
    """

    ray: IntArray
    edge: IntArray
    s: FloatArray
    gap: FloatArray
    gradient: FloatArray
    hessian: FloatArray
    along: FloatArray
    tangent: FloatArray


def cast(
    rim: FloatArray, point: FloatArray, normal: FloatArray, *, behind: FloatArray, ahead: float
) -> Hits:
    """Cast rays from the rigid side to the rim.

    Parameters
    ----------
    rim : ndarray of float, shape (n_edge, 3, 2), over R
        Node positions of the edges, with the body on the left of their direction.
    point, normal : ndarray of float, shape (n, 2)
        Origins and directions of the rays.
    behind : ndarray of float, shape (n,)
        Distance to search backwards along each ray.
    ahead : float
        Distance to search forwards.

    Returns
    -------
    Hits
        For each ray that enters the body in this range, the entry nearest to its origin.
    """
    tangent = np.stack([normal[:, 1], -normal[:, 0]], axis=-1)
    ray, edge = _near(rim, point, normal, behind, ahead)
    start = _dot(tangent, point)[ray, None]
    along = tangent[ray, :1] * rim[edge, :, 0] + tangent[ray, 1:] * rim[edge, :, 1] - start
    low, high = _bounds(along)
    slack = _ROUNDING * (high - low)
    meets = (low <= slack) & (high >= -slack)
    ray, edge, along = ray[meets], edge[meets], along[meets]
    s, where = _rising_roots(along)
    ray, edge = ray[where], edge[where]
    at = rim[edge]
    x = np.einsum("nk,nki->ni", shapes(s), at)
    gap = _dot(normal[ray], x - point[ray])
    near = (gap > -behind[ray]) & (gap < ahead)
    order = np.lexsort((np.abs(gap), ray))
    order = order[near[order]]
    first = order[np.unique(ray[order], return_index=True)[1]]
    ray = ray[first]
    return _with_derivatives(ray, edge[first], s[first], gap[first], rim, tangent, normal)


def _bounds(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return bounds of parabolas through three values along the second axis."""
    # A parabola stays within the range of its Bezier control points.
    control = 2.0 * values[:, 1] - 0.5 * (values[:, 0] + values[:, 2])
    low = np.minimum(np.minimum(values[:, 0], values[:, 2]), control)
    return low, np.maximum(np.maximum(values[:, 0], values[:, 2]), control)


def _near(
    rim: FloatArray, point: FloatArray, normal: FloatArray, behind: FloatArray, ahead: float
) -> tuple[IntArray, IntArray]:
    """Pair rays with the edges that they may meet, by comparing bounding boxes.

    Neighbouring rays share a box, so that few boxes are compared.
    """
    low, high = _bounds(rim)
    ends = np.stack([point - behind[:, None] * normal, point + ahead * normal])
    first = np.arange(0, len(point), _RAYS_PER_BOX)
    lows = np.minimum.reduceat(ends.min(axis=0), first) - _ROUNDING
    highs = np.maximum.reduceat(ends.max(axis=0), first) + _ROUNDING
    apart = (low > highs[:, None]) | (high < lows[:, None])
    block, edge = np.nonzero(~apart.any(axis=-1))
    size = np.diff(np.append(first, len(point)))[block]
    before = np.cumsum(size) - size
    return np.arange(size.sum()) + np.repeat(first[block] - before, size), np.repeat(edge, size)


def _rising_roots(values: FloatArray) -> tuple[FloatArray, IntArray]:
    """Find where parabolas through values at 0, 1/2, 1 rise through zero, and their indices."""
    a = 2 * values[:, 0] - 4 * values[:, 1] + 2 * values[:, 2]
    b = -3 * values[:, 0] + 4 * values[:, 1] - values[:, 2]
    c = values[:, 0]
    inside = b**2 - 4 * a * c
    real = inside >= 0
    root = np.sqrt(np.where(real, inside, 0.0))
    # The root with slope +root is (-b + root) / 2a, written without cancellation for b > 0.
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.where(b > 0, -2 * c / (b + root), (-b + root) / (2 * a))
    # A node belongs to both of its edges; rounding must not exclude it from both.
    where = np.flatnonzero(real & (root > 0) & (s >= -_ROUNDING) & (s <= 1.0 + _ROUNDING))
    return np.clip(s[where], 0.0, 1.0), where


def _with_derivatives(
    ray: IntArray,
    edge: IntArray,
    s: FloatArray,
    gap: FloatArray,
    rim: FloatArray,
    tangent: FloatArray,
    normal: FloatArray,
) -> Hits:
    at, N, dN, tangent, normal = rim[edge], shapes(s), slopes(s), tangent[ray], normal[ray]
    first = np.einsum("nk,nki->ni", dN, at)
    second = np.einsum("k,nki->ni", _CURVATURES, at)
    speed = _dot(tangent, first)
    m = normal - tangent * (_dot(normal, first) / speed)[:, None]
    gradient = N[:, :, None] * m[:, None, :]
    moved = (dN[:, :, None] * m[:, None, :]).reshape(-1, 6)
    slid = (-N[:, :, None] * tangent[:, None, :] / speed[:, None, None]).reshape(-1, 6)
    cross = moved[:, :, None] * slid[:, None, :]
    bend = _dot(m, second)[:, None, None]
    hessian = cross + cross.transpose(0, 2, 1) + bend * slid[:, :, None] * slid[:, None, :]
    shifted = (dN[:, :, None] * tangent[:, None, :]).reshape(-1, 6)
    along = shifted[:, :, None] * slid[:, None, :]
    return Hits(ray, edge, s, gap, gradient, hessian, along, tangent)


def kink(rim: FloatArray, edge: IntArray, tangent: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the jump of the gap's derivative at the node between two edges.

    Parameters
    ----------
    rim : ndarray of float, shape (n_edge, 3, 2)
        Node positions of the edges.
    edge : ndarray of int, shape (n,)
        Edges that end at the nodes.
    tangent, normal : ndarray of float, shape (n, 2)
        Tangents and normals of the rigid side.

    Returns
    -------
    ndarray of float, shape (n,)
        n.x'/t.x' after the node minus its value before: minus the jump of m along t.
    """
    before = np.einsum("k,nki->ni", slopes(np.ones(())), rim[edge])
    after = np.einsum("k,nki->ni", slopes(np.zeros(())), rim[edge + 1])
    low, high = (_slope(_dot(normal, first), _dot(tangent, first)) for first in (before, after))
    return high - low


def _slope(rise: FloatArray, run: FloatArray) -> FloatArray:
    """Return rise over run limited to `_MAX_SLOPE`, also for an edge turned past the normal."""
    return np.asarray(rise / np.maximum(run, np.maximum(np.abs(rise) / _MAX_SLOPE, 1e-300)))


def distance(rim: FloatArray, point: FloatArray) -> tuple[float, int, FloatArray]:
    """Return the distance of a point from the body.

    Parameters
    ----------
    rim : ndarray of float, shape (n_edge, 3, 2), over R
        Node positions of the edges, with the body on the left of their direction.
    point : ndarray of float, shape (2,)
        Point.

    Returns
    -------
    distance : float
        Distance to the nearest point of the rim; negative inside the body.
    edge : int
        Edge with the nearest point.
    gradient : ndarray of float, shape (3, 2)
        Derivative of the distance by the edge's node positions.
    """
    apart = np.linalg.norm(rim - point, axis=-1).min(axis=1)
    size = np.linalg.norm(rim[:, 2] - rim[:, 0], axis=-1)
    near = np.flatnonzero(apart - size <= apart.min() + 1e-300)
    s = np.linspace(0.0, 1.0, 9)[None, :].repeat(len(near), axis=0)
    at = rim[near]
    x = shapes(s) @ at
    best = np.argmin(np.linalg.norm(x - point, axis=-1), axis=1)
    s = s[0, best]
    for _ in range(20):
        x = np.einsum("nk,nki->ni", shapes(s), at) - point
        first = np.einsum("nk,nki->ni", slopes(s), at)
        second = np.einsum("k,nki->ni", _CURVATURES, at)
        f = _dot(x, first)
        df = _dot(first, first) + _dot(x, second)
        s = np.clip(s - f / np.where(df > 0, df, np.inf), 0.0, 1.0)
    x = np.einsum("nk,nki->ni", shapes(s), at) - point
    i = int(np.argmin(np.linalg.norm(x, axis=-1)))
    first = slopes(s[i]) @ at[i]
    out = np.array([first[1], -first[0]]) / np.hypot(*first)
    away = -x[i]
    # At a kink between edges the nearest point is the node; the direction is between normals.
    size_of = np.hypot(*away)
    if s[i] in (0.0, 1.0) and size_of > 0:
        out = away / size_of * (-1.0 if away @ out < 0 else 1.0)
    return float(away @ out), int(near[i]), -shapes(s[i])[:, None] * out
