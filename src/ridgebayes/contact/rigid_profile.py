"""The rigid side of a contact: the tops of ridges and the floors of grooves, one segment each."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError


@dataclass(frozen=True)
class RigidSegment:
    """A stretch of the rigid surface that contact may cover; lengths over the body's radius.

    Parameters
    ----------
    ridge : int or None
        Number of the ridge: 0, 1, ... to the right of the groove below the centre, -1, -2, ... to
        its left. None for a groove's floor.
    start, stop : float
        Ends, x = 0 below the body's centre.
    depth : float
        Below the ridges' tops.
    corner : float
        Radius of both corners; 0 is sharp.
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
        # The parabola of a circle's curvature: a half-plane is first order in slopes anyway.
        return np.maximum(into, 0.0) ** 2 / (2 * self.corner)

    @property
    def flat(self) -> tuple[float, float]:
        """Ends of its flat part."""
        return self.start + self.corner, self.stop - self.corner


@dataclass(frozen=True)
class Profile:
    """Parallel ridges under a body; lengths over the body's radius.

    Parameters
    ----------
    a, b : float
        Ridge and groove width.
    depth : float
        Of the grooves' floors; infinite where they are never touched.
    corner : float
        Radius of the ridges' top corners, at most half a ridge; 0 is sharp.
    offset : float
        Of the body's centre from a groove's centre, in pitches, -0.5 to 0.5; 0.5 is over a ridge.

    Raises
    ------
    InputError
        If a value breaks its rule.
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
        """Distance from ridge to ridge."""
        return self.a + self.b

    @cached_property
    def mirrored(self) -> bool:
        """Whether the left half is the mirror image of the right one."""
        return self.offset in (-0.5, 0.0, 0.5)

    def ridge(self, number: int) -> RigidSegment:
        """Return the top of a ridge."""
        if abs(self.offset) == 0.5:  # over a ridge: that one is number 0, and exactly symmetric
            start = number * self.pitch - 0.5 * self.a
        else:
            start = 0.5 * self.b + (number - self.offset) * self.pitch
        return RigidSegment(number, start, start + self.a, 0.0, self.corner)

    def floor_after(self, number: int) -> RigidSegment:
        """Return the floor of the groove to the right of a ridge."""
        stop = self.ridge(number + 1).start
        return RigidSegment(None, stop - self.b, stop, self.depth)

    def ridge_before(self, segment: RigidSegment) -> int:
        """Return the number of a ridge, or of the one to the left of a groove's floor."""
        if segment.ridge is not None:
            return segment.ridge
        return round((segment.start - self.ridge(0).stop) / self.pitch)

    def segments(self, reach: float) -> list[RigidSegment]:
        """Return every segment that begins within `reach` of the centre, from left to right.

        Of a mirrored profile those of the right half, and the one that straddles the centre.
        """
        n = math.ceil(reach / self.pitch) + 1
        found = []
        for number in range(-n - 1, n + 1):
            for segment in (self.ridge(number), self.floor_after(number)):
                if segment.ridge is None and math.isinf(self.depth):
                    continue
                left = segment.start + segment.stop < -1e-9 * self.pitch
                if min(abs(segment.start), abs(segment.stop)) > reach or (self.mirrored and left):
                    continue
                found.append(segment)
        return sorted(found, key=lambda segment: segment.start)
