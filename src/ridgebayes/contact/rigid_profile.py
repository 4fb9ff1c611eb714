r"""Rigid side of a contact: a segment for the top of each ridge and the floor of each groove.

Beyond a kink a round corner is a parabola, whose part of the pressure has a closed form. Towards an
end of an interval the rigid surface falls by h = g/2 (s - c)^2 beyond a kink at s = c, with
g = w^2/r. Its Chebyshev coefficients h_n fall as n^-3, and those of the pressure, -n h_n/pi, only
as n^-2. A truncated series would be inaccurate, so sums over all orders are used.
"""

import math
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.polynomial.polynomial import polyval

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError

_THIN_ANGLE, _THIN_NODES = 0.3, 8  # of a thin layer; nodes for Gauss quadrature to rounding error
_N_FAR = 8  # orders of z that suffice far away, where the closed sum would cancel
_gauss = cache(np.polynomial.legendre.leggauss)


@dataclass(frozen=True)
class RigidSegment:
    """Part of the rigid surface that contact may cover; lengths over the body's radius.

    Parameters
    ----------
    ridge : int or None
        Number of the ridge: 0, 1, ... to the right of the groove below the centre, -1, -2, ... to
        its left. None for a groove's floor.
    start, stop : float
        Ends, with x = 0 below the body's centre.
    depth : float
        Depth below the ridges' tops.
    corner : float
        Radius of both corners; 0 if sharp.
    """

    ridge: int | None
    start: float
    stop: float
    depth: float = 0.0
    corner: float = 0.0

    def height(self, x: FloatArray) -> FloatArray:
        """Return the depth of the segment's surface below the ridges' tops at x, of any shape."""
        if self.corner == 0.0:
            return np.full(np.shape(x), self.depth)
        into = np.maximum(self.start + self.corner - x, x - self.stop + self.corner)
        # A parabola with the circle's curvature: half-plane theory is of first order in slopes.
        return np.maximum(into, 0.0) ** 2 / (2 * self.corner)

    @property
    def flat(self) -> tuple[float, float]:
        """Ends of the flat part."""
        return self.start + self.corner, self.stop - self.corner


@dataclass(frozen=True)
class Profile:
    """Parallel ridges under a body; lengths over the body's radius.

    Parameters
    ----------
    a, b : float
        Ridge and groove width.
    depth : float
        Depth of the grooves' floors; infinite if they are never touched.
    corner : float
        Radius of the ridges' top corners, at most half a ridge; 0 if sharp.
    offset : float
        Offset of the body's centre from a groove's centre, in pitches, -0.5 to 0.5; 0.5 is over a
        ridge.

    Raises
    ------
    InputError
        If a value is out of range.
    """

    a: float
    b: float
    depth: float = math.inf
    corner: float = 0.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        a, b, depth, corner = self.a, self.b, self.depth, self.corner
        for name, value, holds, rule in (
            ("a", a, 0 < a < math.inf, "finite and > 0"),
            ("b", b, 0 < b < math.inf, "finite and > 0"),
            ("depth", depth, depth > 0, "> 0"),
            ("corner", corner, 0 <= corner <= 0.5 * a, "0 to half the ridge width"),
            ("depth", depth, 2 * depth >= corner, "at least half the corners' radius"),
            ("offset", self.offset, -0.5 <= self.offset <= 0.5, "-0.5 to 0.5 pitches"),
        ):
            if not holds:
                raise InputError(f"{name} = {value!r}; expected {rule}")

    @property
    def pitch(self) -> float:
        """Distance between ridges."""
        return self.a + self.b

    @cached_property
    def mirrored(self) -> bool:
        """Whether the left half is the mirror image of the right half."""
        return self.offset in (-0.5, 0.0, 0.5)

    def ridge(self, number: int) -> RigidSegment:
        """Return the top of a ridge."""
        if abs(self.offset) == 0.5:  # over a ridge, which is number 0 and exactly symmetric
            start = number * self.pitch - 0.5 * self.a
        else:
            start = 0.5 * self.b + (number - self.offset) * self.pitch
        return RigidSegment(number, start, start + self.a, 0.0, self.corner)

    def floor_after(self, number: int) -> RigidSegment:
        """Return the floor of the groove to the right of a ridge."""
        stop = self.ridge(number + 1).start
        return RigidSegment(None, stop - self.b, stop, self.depth)

    def ridge_before(self, segment: RigidSegment) -> int:
        """Return the number of a ridge, or of the ridge to the left of a groove's floor."""
        if segment.ridge is not None:
            return segment.ridge
        return round((segment.start - self.ridge(0).stop) / self.pitch)

    def segments(self, reach: float) -> list[RigidSegment]:
        """Return every segment that begins within `reach` of the centre, from left to right.

        For mirrored profiles, only the right half and a segment that straddles the centre.
        """
        n = math.ceil(reach / self.pitch) + 1
        within = []
        for number in range(-n - 1, n + 1):
            for segment in (self.ridge(number), self.floor_after(number)):
                if segment.ridge is None and math.isinf(self.depth):
                    continue
                left = segment.start + segment.stop < -1e-9 * self.pitch
                if min(abs(segment.start), abs(segment.stop)) > reach or (self.mirrored and left):
                    continue
                within.append(segment)
        return sorted(within, key=lambda segment: segment.start)


@dataclass(frozen=True, eq=False)
class Kinks:
    """Kinks towards the two ends of n intervals.

    Parameters
    ----------
    bend : ndarray of float, shape (n,)
        Factor g: the square of the half-width over the corner's radius.
    angle : ndarray of float, shape (2, n)
        Angle theta of the kinks towards the left and right end, 0 to pi, where c = cos(theta) from
        this end; 0 without a kink.
    """

    bend: FloatArray
    angle: FloatArray

    @classmethod
    def none(cls, n: int) -> "Kinks":
        """Return n intervals without kinks."""
        return cls(np.zeros(n), np.zeros((2, n)))

    def series(self, n_order: int) -> FloatArray:
        """Return h_n, n = 0 ... n_order - 1, shape (n, n_order)."""
        angle = self.angle.ravel()
        coefficients = np.zeros((len(angle), n_order))
        for has, integral in (
            (np.flatnonzero(angle > _THIN_ANGLE), _closed_integral),
            (np.flatnonzero((angle > 0) & (angle <= _THIN_ANGLE)), _thin_integral),
        ):
            if len(has):
                coefficients[has] = integral(angle[has], n_order)
        left, right = coefficients.reshape(2, -1, n_order)
        left[:, 1::2] *= -1.0
        value: FloatArray = (left + right) * (self.bend[:, None] / np.pi)
        value[:, 0] *= 0.5
        return value

    @cached_property
    def few(self) -> FloatArray:
        """The first h_n, which suffice far away, shape (n, 8)."""
        return self.series(_N_FAR)

    def slopes(self) -> FloatArray:
        """Return sums of n^3 h_n T_n at the left and right end, shape (2, n)."""
        theta, sine, c = self.angle, np.sin(self.angle), np.cos(self.angle)
        near, far = 3 * sine + (2 - c) * theta, (2 + c) * theta - 3 * sine
        value: FloatArray = self.bend / np.pi * (near + far[::-1])
        return value

    def at_ends(self) -> FloatArray:
        """Return sums of n h_n T_n at the left and right end, shape (2, n)."""
        theta, sine, c = self.angle, np.sin(self.angle), np.cos(self.angle)
        near = (1 - c) * (sine + theta) + 0.5 * (sine * c - theta)
        far = (1 + c) * (theta - sine) + 0.5 * (sine * c - theta)
        value: FloatArray = self.bend / np.pi * (near + far[::-1])
        return value

    def strengths(self, at: FloatArray) -> FloatArray:
        """Return sums of n h_n cos(n at) at angles (n_point,), shape (n, n_point)."""
        theta, c = self.angle[..., None], np.cos(self.angle)[..., None]
        at = np.stack([np.pi - at, at])[:, None]
        cosine, sine = np.cos(at), np.sin(at)
        # cos(at) - c as a product; where it is 0, its product with the logarithm is 0
        apart = np.sin(0.5 * np.abs(theta - at))
        together = np.sin(0.5 * (theta + at))
        with np.errstate(divide="ignore", invalid="ignore"):
            log = np.where(apart > 0, np.log(together / apart), 0.0)
        inner = np.sin(theta) + cosine * theta - sine * log
        value = (cosine - c) * inner + 0.5 * (np.sin(theta) * c - theta)
        sums: FloatArray = (self.bend[:, None] / np.pi * value).sum(axis=0)
        return sums

    def harmonic(self, s: FloatArray) -> FloatArray:
        """Return sums of h_n z^n cos(n theta) at s (n_point, n), z and theta as in `intervals`.

        Within an interval this equals h.
        """
        size = np.maximum(np.abs(s), 1.0)
        z = 1 / (size + np.sqrt(size**2 - 1))
        sums = np.asarray(polyval(np.copysign(z, s), self.few.T, tensor=False), np.float64)
        is_near = z ** float(_N_FAR) > np.finfo(np.float64).eps
        point, i = np.nonzero(is_near & self.angle.any(axis=0))
        s, z, angle = s[point, i], z[point, i], self.angle[:, i]
        sums[point, i] = self.bend[i] * (_continued(-s, z, angle[0]) + _continued(s, z, angle[1]))
        return sums


def _closed_integral(angle: FloatArray, n_order: int) -> FloatArray:
    """Return Int_0^angle (cos t - cos angle)^2 cos n t dt, shape (n, n_order)."""
    c = np.cos(angle)
    sines = np.empty((n_order + 4, len(angle)))  # sin(n angle)/n from order -2 on, even in n
    sines[2], sines[3] = angle, np.sin(angle)
    sines[4] = 2 * c * sines[3]
    for n in range(5, n_order + 4):
        np.multiply(2 * c, sines[n - 1], out=sines[n])
        sines[n] -= sines[n - 2]
    sines[4:] /= np.arange(2, n_order + 2)[:, None]
    sines[0], sines[1] = sines[4], sines[3]
    square = 0.25 * (sines[:-4] + sines[4:]) + (0.5 + c**2) * sines[2:-2]
    value: FloatArray = square - c * (sines[1:-3] + sines[3:-1])
    return value.T


def _thin_integral(angle: FloatArray, n_order: int) -> FloatArray:
    """Return the integral of `_closed_integral` by Gauss quadrature, which does not cancel."""
    nodes, weights = _gauss(_THIN_NODES + math.ceil(0.5 * _THIN_ANGLE * n_order))
    half = 0.5 * angle[:, None]
    phi = half * (1 + nodes)
    # cos(phi) - cos(theta) as a product, because both are near 1
    beyond = 2 * np.sin(half + 0.5 * phi) * np.sin(half - 0.5 * phi)
    waves = np.cos(np.arange(n_order) * phi[..., None])
    value: FloatArray = np.einsum("in,inm->im", half * weights * beyond**2, waves)
    return value


def falls(
    beyond: FloatArray, half_width: FloatArray, radius: FloatArray
) -> tuple[FloatArray, Kinks]:
    """Return the depth of round corners below the flat on n intervals.

    Parameters
    ----------
    beyond : ndarray of float, shape (2, n)
        Distance of the left and right end beyond the flat's end.
    half_width, radius : ndarray of float, shape (n,)
        Half-widths of the intervals and radii of the corners; radius 0 is sharp.

    Returns
    -------
    height : ndarray of float, shape (n, 3)
        Chebyshev coefficients for intervals that lie on one parabola.
    kinks : Kinks
        Kinks of the other intervals.
    """
    bend = np.divide(half_width**2, radius, out=np.zeros(len(radius)), where=radius > 0)
    share = np.where(radius > 0, np.maximum(beyond, 0.0) / (2 * half_width), 0.0)  # (1 - c)/2
    # An interval entirely beyond a kink lies on one parabola.
    whole = share >= 1
    height = np.zeros((len(radius), 3))
    if whole.any():
        shift = np.array([[-1.0], [1.0]]) * (2 * share - 1)
        parabola = np.stack([0.5 * shift**2 + 0.25, shift, np.full_like(shift, 0.25)], axis=-1)
        height += (bend[:, None] * np.where(whole[..., None], parabola, 0.0)).sum(axis=0)
    return height, Kinks(bend, np.where(whole, 0.0, 2 * np.arcsin(np.sqrt(np.minimum(share, 1)))))


def _continued(s: FloatArray, z: FloatArray, theta: FloatArray) -> FloatArray:
    """Return `harmonic` for a kink towards the right and a bend of 1."""
    c, sine, zeta = np.cos(theta), np.sin(theta), np.copysign(z, s)
    angle = np.arctan2(zeta * sine, 1 - zeta * c)
    outside = (s - c) ** 2 * angle + 0.25 * sine * (zeta - 1 / zeta)
    outside += theta * (0.25 + 0.5 * c * c - c * zeta + 0.25 * zeta**2)
    inside = 0.5 * np.maximum(s - c, 0.0) ** 2
    value: FloatArray = np.where(np.abs(s) > 1, outside / np.pi, inside)
    return value
