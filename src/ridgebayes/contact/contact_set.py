"""Active set of the contact: ends of contact move, and segments enter and leave.

All ends take Newton steps at once. Segments that the surface would penetrate are added, and
contacts that shrink to nothing are removed. Equations refer to `docs/derivations/contact.md`.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ridgebayes._types import BoolArray, FloatArray
from ridgebayes.contact.intervals import Intervals
from ridgebayes.contact.pressure import PressureSolution
from ridgebayes.contact.rigid_profile import Profile, RigidSegment

SHRINK = 0.1  # smallest factor on the width of a contact in one step
TENSION = 0.1  # tension allowed at free ends, over the mean pressure and the root of the tolerance
# Shares of the load: contacts below `BEGUN` need less accuracy, and the smallest are rounding.
BEGUN, _ROUNDING_SHARE = 1e-6, 1e-9
_MIN_STEP = 1e-13  # over a contact's width; shorter steps are rounding errors
N_PLACES = 17  # on a segment
_MIN_WIDTH = 1e-11  # of a contact, over its segment's width


class ContactSet:
    """Segments in contact, with the ends of contact on each."""

    def __init__(self, profile: Profile, segments: Sequence[RigidSegment], rel_tol: float) -> None:
        self._profile, self._segments, self._tol = profile, list(segments), rel_tol
        self._ends: dict[RigidSegment, tuple[float, float]] = {}
        self._dropped: set[RigidSegment] = set()  # since the ends last settled
        self._near: set[RigidSegment] | None = None  # segments that may be penetrated
        self._last_steps: dict[RigidSegment, tuple[float, ...]] = {}  # of both ends, outward

    @property
    def touched(self) -> list[RigidSegment]:
        return sorted(self._ends, key=lambda segment: segment.start)

    def intervals(self) -> Intervals:
        ends = np.array([self._ends[segment] for segment in self.touched]).reshape(-1, 2)
        return Intervals(ends[:, 0].copy(), ends[:, 1].copy(), self._profile.mirrored)

    def begin(
        self, W: float, start: Mapping[RigidSegment, tuple[float, float]], spared: float
    ) -> None:
        """Start from the ends of a similar solution, or from the ridges inside Hertz's contact.

        The start excludes a width `spared` on both sides of each ridge, for round corners.
        """
        hertz = math.sqrt(2 * W)
        tops = [segment for segment in self._segments if segment.ridge is not None]
        known = [segment for segment in self._segments if segment in start]
        self._ends = {segment: self._within(segment, *start[segment]) for segment in known}
        if not self._ends:
            for segment in tops:
                low, high = max(segment.start + spared, -hertz), min(segment.stop - spared, hertz)
                if low < high:
                    self._ends[segment] = self._within(segment, low, high)
        if not self._ends:
            # Start at the nearest corner; the slope of the body determines the width.
            tops = tops or self._segments
            near = min(tops, key=lambda segment: min(abs(segment.start), abs(segment.stop)))
            self._ends[near] = self._initial_contact(near, W)

    def _initial_contact(self, segment: RigidSegment, W: float) -> tuple[float, float]:
        """Guess a new contact at the segment's point nearest to the centre."""
        low, high = segment.flat
        at = min(max(0.0, low), high)
        guess = max(W / max(abs(at), math.sqrt(W)), 1e-6 * at)
        width = 0.5 * min(segment.stop - segment.start, guess)
        if low < 0 < high:
            return self._within(segment, -width, width)
        into = width if segment.corner else 0.0  # sharp corners are ends of contact
        if at == low:
            return self._within(segment, low - into, low + width)
        return self._within(segment, high - width, high + into)

    def _within(self, segment: RigidSegment, low: float, high: float) -> tuple[float, float]:
        rounding = self._tol * (segment.stop - segment.start)
        low = segment.start if low < segment.start + rounding else low
        high = segment.stop if high > segment.stop - rounding else high
        if self._profile.mirrored and segment.start < 0 < segment.stop:
            high = max(high, -low)
            low = -high
        return low, high

    def move(self, pressing: PressureSolution) -> bool:
        """Move free ends by Newton steps, and remove vanishing contacts; return if any changed."""
        touched = self.touched
        ends = np.array([self._ends[segment] for segment in touched]).T
        moved = self._next_ends(pressing, touched, ends)
        for segment, (low, high) in zip(touched, moved.T.tolist(), strict=True):
            length, width = segment.stop - segment.start, high - low
            # A floor at this distance is penetrated by less than the tolerance.
            on_floor = segment.ridge is None and width**2 <= self._scale(pressing) * length
            if (width <= _MIN_WIDTH * length or on_floor) and len(self._ends) > 1:
                del self._ends[segment]
                self._dropped.add(segment)
                continue
            if self._profile.mirrored and segment.start < 0 < segment.stop:
                low = -high
            self._ends[segment] = low, high
        return len(self._ends) < len(touched) or not np.array_equal(moved, ends)

    def forget_steps(self) -> None:
        """Remove the limits that the last steps set on the next steps."""
        self._last_steps.clear()

    def _next_ends(
        self, pressing: PressureSolution, touched: list[RigidSegment], ends: FloatArray
    ) -> FloatArray:
        """Return ends after their steps, (2, n); equations of docs/derivations/contact.md."""
        sign = np.array([[-1.0], [1.0]])
        limits = np.array([(segment.start, segment.stop) for segment in touched]).T
        layer = sign * (ends - np.array([segment.flat for segment in touched]).T)
        room, stuck = np.abs(limits - ends), ends == limits
        width, mean = 2 * pressing.intervals.half_width, np.abs(pressing.coefficients[:, 0])
        strength = pressing.singular
        step = end_steps(strength, np.nan_to_num(pressing.outward, nan=0.0), width, stuck)
        near = np.abs(step) <= self._small_step(width, math.pi * mean / pressing.load, layer)
        stays = np.where(stuck, strength >= -self._tol * mean, near)  # (5), (10)
        last = np.array([self._last_steps.get(segment, (0.0, 0.0)) for segment in touched]).T
        most = np.where(step * last < 0, 0.5 * np.abs(last), np.inf)  # (9a)
        # A floor's contact ends before the wall, where the surface would cut through the ridge.
        on_floor = np.array([segment.ridge is None for segment in touched])
        step = np.clip(step, -most, np.where(on_floor, np.minimum(most, (1 - SHRINK) * room), most))
        made = np.where(stays, last, np.minimum(step, room))
        self._last_steps |= zip(touched, map(tuple, made.T.tolist()), strict=True)
        return np.where(stays, ends, np.where(step >= room, limits, ends + sign * step))

    def _small_step(self, width: FloatArray, share: FloatArray, layer: FloatArray) -> FloatArray:
        """Return the step below which an end has converged, from its share of the load (eq. 10)."""
        bears = share > max(_ROUNDING_SHARE, 0.01 * self._tol)
        by_share = self._tol * width * np.maximum(1.0, BEGUN / np.where(bears, share, 1.0))
        # Beyond a kink the pressure falls to zero within the layer.
        by_layer = 0.3 * TENSION * math.sqrt(self._tol) * layer
        near = np.where((layer > 0) & (layer < width), by_layer, np.inf)
        near = np.minimum(near, np.where(bears, by_share, np.inf))
        return np.maximum(near, _MIN_STEP * width)

    def _scale(self, pressing: PressureSolution) -> float:
        """Return the penetration that is within the tolerance."""
        return max(self._tol * pressing.load, 1e-15)

    def add_penetrated(self, pressing: PressureSolution, *, settled: bool) -> bool:
        """Add contacts on segments that the surface penetrates; return whether there are any.

        Contacts that vanished return only when the ends have settled, to avoid cycles. All segments
        are checked at the start and when the ends have settled, between these only near ones.
        """
        before = len(self._ends)
        if settled:
            self._dropped.clear()
        out = self._ends.keys() | self._dropped
        others = [segment for segment in self._segments if segment not in out]
        if settled or self._near is None:
            self._near = set()
            if others:
                _, gaps, slack = nearest_gaps(pressing, others, n_round=1)
                self._near = {others[i] for i in np.flatnonzero(gaps <= slack)}
        others = [segment for segment in others if segment in self._near]
        if not others:
            return False
        # Before, gaps still change by more than the error of two rounds.
        x, gaps, _ = nearest_gaps(pressing, others, n_round=4 if settled else 2)
        for segment, at, gap in zip(others, x.tolist(), gaps.tolist(), strict=True):
            # On a sloping surface a contact of less than the minimum width penetrates this deep.
            start, stop = segment.start, segment.stop
            by_slope = 100 * _MIN_WIDTH * (stop - start) * max(-start, stop)
            if gap >= -max(self._scale(pressing), by_slope):
                continue
            if segment.ridge is not None and segment.corner == 0:
                self._ends[segment] = self._initial_contact(segment, pressing.load)
            else:
                half = math.sqrt(-segment.corner * gap) or 0.02 * (stop - start)
                if segment.ridge is None:
                    # Both ends start off the walls, or they would count as ends at a corner.
                    at = min(max(at, start + 1.1 * half), stop - 1.1 * half)
                self._ends[segment] = self._within(segment, at - half, at + half)
        return len(self._ends) > before


def end_steps(
    strength: FloatArray, newton: FloatArray, width: FloatArray, stuck: BoolArray
) -> FloatArray:
    """Return Newton steps of left and right ends, outward, (2, n), limited by a contact's size.

    A negative strength of the edge singularity is tension. Equations (7) to (9) of
    docs/derivations/contact.md.
    """
    # Half of the width if both ends can move inward, so that they cannot cross.
    most = (1 - SHRINK) * width * np.where(stuck.sum(axis=0) == 1, 1.0, 0.5)
    step = np.where((strength > 0) & (newton <= 0), width, newton)  # no zero of pressure ahead
    step = np.where((strength < 0) & (newton >= 0), -most, step)
    return np.clip(step, -most, 2 * width)


def nearest_gaps(
    pressing: PressureSolution, segments: Sequence[RigidSegment], *, n_round: int = 4
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the places where the gaps to untouched segments are smallest, and these gaps.

    The third array is the possible decrease of each gap between the evaluated places, which are
    eight times as close in each round. After four rounds they are 1e-4 of the segment apart, and
    the error of gaps is of third order in this distance.
    """
    rows = np.arange(len(segments))
    start, stop = np.array([(s.start, s.stop) for s in segments]).T
    for _ in range(n_round):
        x = np.linspace(start, stop, N_PLACES, axis=1)
        heights = [segment.height(at) for segment, at in zip(segments, x, strict=True)]
        gap = pressing.surface(x) + heights
        # Outside of contact the surface is convex, as ridges are, so there is a single minimum.
        i = np.clip(np.argmin(gap, axis=1), 1, N_PLACES - 2)
        start, stop = x[rows, i - 1], x[rows, i + 1]
    around = gap[rows, [i - 1, i, i + 1]]
    # The least value of a parabola through three places.
    slope, bend = 0.5 * (around[2] - around[0]), np.diff(around, n=2, axis=0)[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.nan_to_num(np.clip(-slope / np.maximum(bend, 0.0), -1.0, 1.0))
    nearest = x[rows, i] + 0.5 * t * (stop - start)
    return nearest, around[1] + (slope + 0.5 * bend * t) * t, np.ptp(around, axis=0)
