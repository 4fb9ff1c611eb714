"""Rigid side as faces divided into segments: tops, round corners, walls and floors.

The contact pressure is constant on each segment. The ends of a top are ends of segments, so a sharp
corner needs no node of the body's mesh, wherever the body slides.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.rigid_profile import Profile, RigidSegment

_N_GAUSS = 3  # quadrature points between kinks, where the gap is smooth
_GROWTH = 0.25  # of segment lengths with distance from the nearest corner
_WALL_DEPTH = 0.5  # groove widths; depth of a wall without a floor
_MAX_BEHIND = 0.02  # over R; depth of the body inside the rigid side during the solution
_NEAR_SEGMENTS = 10.0  # longest segments of a face; farther nodes are no kinks of closing gaps


@dataclass(frozen=True)
class Resolution:
    """Lengths of the segments of the rigid side, over R.

    Parameters
    ----------
    corner : float
        Length of segments at sharp corners.
    arc : int
        Number of segments of a round corner.
    most : float
        Largest length on a ridge.
    edge : float
        Length of the body's edges. The wall at a sharp corner begins at this depth: edges that
        turn around the corner are on neither of its sides.
    """

    corner: float
    arc: int
    most: float
    edge: float


@dataclass(frozen=True, eq=False)
class Face:
    """Straight or round part of the rigid side, divided into segments.

    Parameters
    ----------
    origin : ndarray of float, shape (2,)
        Point of the straight line, or centre of the circle.
    angle : float
        Angle of a straight face, whose normal is (sin, cos) of the angle.
    radius : float
        Radius of a round face; 0 for a straight face.
    breaks : ndarray of float, shape (n + 1,)
        Ends of segments, rising: distance from the origin along (cos, -sin) of the angle, or
        the angle of the normal.
    ridge : int or None
        Number of the face's ridge; None for floors.
    below : float or None
        Height of the sharp corner at the top of a wall. A body point inside the ridge came through
        the wall if it is farther below the corner than inside the wall, otherwise from above.
    """

    origin: FloatArray
    angle: float
    radius: float
    breaks: FloatArray
    ridge: int | None
    below: float | None = None

    @property
    def measure(self) -> float:
        """Length of a unit of the breaks."""
        return self.radius or 1.0

    def at(self, where: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return points and normals at places along the face, shape (n, 2)."""
        angle = where if self.radius else np.full_like(where, self.angle)
        normal = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
        if self.radius:
            return self.origin + self.radius * normal, normal
        tangent = np.stack([normal[:, 1], -normal[:, 0]], axis=-1)
        return self.origin + where[:, None] * tangent, normal

    def of(self, point: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the places to which points project, and their distance from the face; (n,)."""
        x = point - self.origin
        if self.radius:
            return np.arctan2(x[:, 0], x[:, 1]), np.hypot(x[:, 0], x[:, 1]) - self.radius
        sine, cosine = math.sin(self.angle), math.cos(self.angle)
        return x @ np.array([cosine, -sine]), x @ np.array([sine, cosine])


@dataclass(frozen=True, eq=False)
class Rays:
    """Quadrature points of all segments, between the kinks of the gap."""

    point: FloatArray
    normal: FloatArray
    weight: FloatArray
    segment: IntArray
    face: IntArray
    behind: FloatArray


class Faces:
    """All faces, with their segments numbered consecutively.

    Parameters
    ----------
    faces : sequence of Face
        Faces of the rigid side.
    """

    def __init__(self, faces: Sequence[Face]) -> None:
        self.faces = tuple(faces)
        counts = [len(face.breaks) - 1 for face in self.faces]
        self._first = np.concatenate([[0], np.cumsum(counts)])
        lengths = [face.measure * np.diff(face.breaks) for face in self.faces]
        self.length: FloatArray = np.concatenate(lengths)
        self.face: IntArray = np.repeat(np.arange(len(counts)), counts)
        self._radius = np.array([face.radius for face in self.faces])
        self._angle = np.array([face.angle for face in self.faces])
        self._origin = np.array([face.origin for face in self.faces])

    def __len__(self) -> int:
        return len(self.length)

    def of_ridge(self, number: int) -> np.ndarray:
        """Return a mask of the segments of a ridge, shape (n_segment,)."""
        return np.array([face.ridge == number for face in self.faces])[self.face]

    def frames(
        self, point: FloatArray, face: IntArray, rise: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return tangents and normals at the projections of points, and the projection's rate.

        Parameters
        ----------
        point : ndarray of float, shape (n, 2), over R
            Points near the faces.
        face : ndarray of int, shape (n,)
            Number of each point's face.
        rise : float, over R
            Rise of the ridges.

        Returns
        -------
        tangent, normal : ndarray of float, shape (n, 2)
            Unit tangents and normals of the faces at the projections.
        per_length : ndarray of float, shape (n,)
            Movement of the projection along the face for a unit movement of the point.
        """
        radius = self._radius[face]
        out = point - self._origin[face] - np.array([0.0, rise])
        far = np.hypot(out[:, 0], out[:, 1])
        is_round = radius > 0
        angle = np.where(is_round, np.arctan2(out[:, 0], out[:, 1]), self._angle[face])
        normal = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
        tangent = np.stack([normal[:, 1], -normal[:, 0]], axis=-1)
        return tangent, normal, np.where(is_round, radius / np.where(is_round, far, 1.0), 1.0)

    def rays(self, nodes: FloatArray, rise: float) -> Rays:
        """Return quadrature points for a rim whose gap has kinks at the given nodes.

        Parameters
        ----------
        nodes : ndarray of float, shape (n_node, 2), over R
            End points of the rim's edges.
        rise : float, over R
            Rise of the ridges.
        """
        x, w = np.polynomial.legendre.leggauss(_N_GAUSS)
        some: list[tuple[FloatArray, ...]] = []
        up = np.array([0.0, rise])
        for number, face in enumerate(self.faces):
            place, apart = face.of(nodes - up)
            near = _NEAR_SEGMENTS * face.measure * float(np.diff(face.breaks).max())
            kinks = place[np.abs(apart) < near]
            kinks = kinks[(kinks > face.breaks[0]) & (kinks < face.breaks[-1])]
            breaks = np.unique(np.concatenate([face.breaks, kinks]))
            low, width = breaks[:-1, None], np.diff(breaks)[:, None]
            where = (low + 0.5 * width * (1.0 + x)).ravel()
            weight = (0.5 * face.measure * width * w).ravel()
            segment = np.searchsorted(face.breaks, where) - 1 + self._first[number]
            point, normal = face.at(where)
            behind = np.full(len(where), _MAX_BEHIND)
            if face.below is not None:
                behind = np.minimum(face.below - point[:, 1], _MAX_BEHIND)
            number_of = np.full(len(where), number)
            some.append((point + up, normal, weight, segment, number_of, behind))
        return Rays(*(np.concatenate([columns[i] for columns in some]) for i in range(6)))


@dataclass(frozen=True)
class Corner:
    """Corner of a ridge that the body reaches first: centre and radius of its arc."""

    ridge: int
    centre: tuple[float, float]
    radius: float


def first_height(profile: Profile) -> float:
    """Return the height of the ridges' tops at which they touch the disk of radius 1."""
    heights = []
    for segment in profile.segments(3 * profile.pitch):
        low, high = segment.flat
        if low <= 0.0 <= high:
            heights.append(-1.0 + segment.depth)
            continue
        inner = min(abs(low), abs(high))
        if inner < 1.0 + segment.corner:
            centre = -math.sqrt((1.0 + segment.corner) ** 2 - inner**2)
            heights.append(centre + segment.corner + segment.depth)
    return min(heights)


def proximal_corner(profile: Profile, number: int, height: float) -> Corner:
    """Return the corner of a ridge nearest to the body's axis."""
    segment = profile.ridge(number)
    right = segment.start + segment.stop > 0
    x = segment.start + segment.corner if right else segment.stop - segment.corner
    return Corner(number, (x, height - segment.corner), segment.corner)


def ridge_faces(
    profile: Profile, numbers: range, height: float, resolution: Resolution
) -> list[Face]:
    """Divide ridges and the floors between them into segments.

    Parameters
    ----------
    profile : Profile
        Rigid profile; only the right half of a mirrored profile is used.
    numbers : range
        Numbers of the ridges.
    height : float
        Height of the ridges' tops.
    resolution : Resolution
        Lengths of segments.

    Returns
    -------
    list of Face
        Tops, round corners, walls and floors.
    """
    faces: list[Face] = []
    for number in numbers:
        faces += _ridge(profile, profile.ridge(number), height, resolution)
    if math.isfinite(profile.depth):
        for number in range(numbers.start - 1, numbers.stop):
            segment = profile.floor_after(number)
            start = max(segment.start, 0.0) if profile.mirrored else segment.start
            if segment.stop > start:
                n = math.ceil((segment.stop - start) / resolution.most)
                breaks = np.linspace(start, segment.stop, n + 1)
                faces.append(Face(np.array([0.0, height - profile.depth]), 0.0, 0.0, breaks, None))
    return faces


def plate(width: float, most: float) -> Face:
    """Divide the right half of a flat under the disk into segments of limited length."""
    breaks = np.linspace(0.0, width, math.ceil(width / most) + 1)
    return Face(np.array([0.0, -1.0]), 0.0, 0.0, breaks, 0)


def _ridge(
    profile: Profile, segment: RigidSegment, height: float, resolution: Resolution
) -> Iterator[Face]:
    r, number = segment.corner, segment.ridge
    depth = min(profile.depth, max(_WALL_DEPTH * profile.b, 2 * r))
    at_corner = r * math.pi / 2 / resolution.arc if r else resolution.corner
    cut_up = _graded if r else cut
    start, stop = segment.flat
    halved = profile.mirrored and start < 0.0
    low = 0.0 if halved else start
    if stop > low:
        first = resolution.most if halved else at_corner
        breaks = low + cut_up(stop - low, first, at_corner, resolution.most)
        yield Face(np.array([0.0, height]), 0.0, 0.0, breaks, number)
    for side, at in ((-1.0, start), (1.0, stop)):
        if halved and side < 0:
            continue
        if r:
            angle = np.sort(side * np.linspace(0.0, math.pi / 2, resolution.arc + 1))
            yield Face(np.array([at, height - r]), 0.0, r, angle, number)
        top = r or resolution.edge
        if depth > top:
            down = top + _graded(depth - top, at_corner, resolution.most, resolution.most)
            breaks = np.sort(side * down)  # along (cos, -sin): downwards on the right
            origin = np.array([at + side * r, height])
            yield Face(origin, side * math.pi / 2, 0.0, breaks, number, below=None if r else height)


def cut(length: float, first: float, last: float, most: float) -> FloatArray:
    """Return breaks from 0 to length: end segments of the given lengths, equal ones between."""
    if length <= 2 * (first + last):
        return np.linspace(0.0, length, 5)
    between = length - first - last
    n = max(round(between / most), 1)
    return np.concatenate([[0.0], first + np.linspace(0.0, between, n + 1), [length]])


def _graded(length: float, first: float, last: float, most: float) -> FloatArray:
    """Return breaks from 0 to length whose segments grow from both ends up to a limit."""
    fine = np.linspace(0.0, length, 4001)
    size = np.minimum(np.minimum(first + _GROWTH * fine, last + _GROWTH * (length - fine)), most)
    count = np.concatenate([[0.0], np.cumsum(0.5 * (1 / size[1:] + 1 / size[:-1]))]) * fine[1]
    n = max(math.ceil(count[-1] - 1e-9), 1)
    return np.interp(np.linspace(0.0, count[-1], n + 1), count, fine)
