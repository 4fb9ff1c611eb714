"""A parabola pressed on ridges by any load: where it touches, and what follows from that.

Contact covers part of each land: up to a sharp corner, where the pressure is singular, or to an end
that is found from zero pressure. Ends take Newton steps, all at once; lands that the surface would
penetrate are added, contacts that shrink to nothing are dropped.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize

from ridgebayes._types import FloatArray
from ridgebayes.contact.intervals import (
    Intervals,
    PressureSolution,
    chebyshev_coefficients,
    chebyshev_points,
    solve_pressure,
)
from ridgebayes.contact.rigid_profile import Profile, RigidSegment
from ridgebayes.errors import InputError

_MAX_ITERATIONS = 80
_SHRINK = 0.1  # a contact keeps at least this share of its width in one step
_TENSION = 0.1  # times the root of the tolerance, of the mean pressure: free ends err by as much
_BEGUN, _ROUNDING = 1e-6, 1e-9  # of the load
_NOTHING = 1e-11  # of a land's width: narrower is no contact
_MAX_UNKNOWNS, _MOST_COEFFICIENTS = 4_000, 400
_PER_LAYER, _MOST_ORDERS = 400.0, 65_536


def load_factor(nu: float) -> float:
    """Return W over p/E: 4 (1 - nu^2)/pi."""
    return 4 / math.pi * (1 - nu**2)


@dataclass(frozen=True, eq=False)
class ContactSolution:
    """A body pressed on ridges.

    Parameters
    ----------
    profile : Profile
        The rigid side.
    lands : tuple of Land
        Those in contact, from left to right; of a mirrored profile the right half.
    pressing : Pressing
        Pressures on them.
    status : str
        ``ok``, or which condition does not hold.
    """

    profile: Profile
    segments: tuple[RigidSegment, ...]
    pressing: PressureSolution
    status: str

    @property
    def W(self) -> float:
        """The load: integral of pressure times 2/(pi E*), over R; p/E is pi/4 W/(1 - nu^2)."""
        return self.pressing.load

    @property
    def Q(self) -> int:
        """Ridges in contact: each at its proximal corner, one below the centre with any part."""
        touched = [land.ridge is not None for land in self.segments]
        return int(np.sum(self.pressing.intervals.weight[touched]))

    @property
    def ends(self) -> tuple[float, float]:
        """Outermost ends of contact, left and right; NaN where nothing was solved."""
        intervals = self.pressing.intervals
        if not self.segments:
            return math.nan, math.nan
        last = float(intervals.right[-1])
        return -last if self.profile.mirrored else float(intervals.left[0]), last

    @property
    def contact_fraction(self) -> float:
        """Length in contact over the distance between the outermost ends."""
        intervals, (first, last) = self.pressing.intervals, self.ends
        return float(2 * intervals.half_width @ intervals.weight) / (last - first)

    @property
    def approach(self) -> float:
        """By which the body has come down on the ridges' tops, over R.

        Relative to its surface at a distance R from the centre: a half-plane has no depth at which
        it would rest, so that some distance has to be named.
        """
        return self.pressing.approach

    def penetration(self, groove: int) -> float:
        """Return how deep the surface hangs into the groove right of a ridge, over R."""
        floor = self.profile.floor_after(groove)
        # Where no pressure acts the surface is convex: one minimum.
        lowest = optimize.minimize_scalar(
            lambda x: float(self.pressing.surface(np.array([x]))[0]),
            bounds=(floor.start, floor.stop),
            method="bounded",
            options={"xatol": 1e-6 * self.profile.b},
        )
        return float(-lowest.fun)


def solve_contact(
    profile: Profile,
    W: float,
    *,
    rel_tol: float = 1e-8,
    n_coefficients: int | None = None,
    start: ContactSolution | None = None,
    ridges: range | None = None,
) -> ContactSolution:
    """Press a parabola on ridges by a load.

    Parameters
    ----------
    profile : Profile
        The rigid side.
    W : float
        Load: 4 (1 - nu^2)/pi times p/E.
    rel_tol : float, optional
        Tolerance of the ends, over their interval's width, of tension and of penetration.
    n_coefficients : int, optional
        Per interval; by the profile and the tolerance if not given.
    start : Pressed, optional
        A solution at a load nearby, to begin with.
    ridges : range, optional
        Numbers of the only ridges there are: what happens up to the load that reaches the next.

    Returns
    -------
    Pressed
        Its status says which of the conditions (no tension, no penetration, ends at zero pressure,
        coefficients decayed, forces in balance) does not hold, if any.

    Raises
    ------
    InputError
        If the load is not finite and positive.
    """
    if not 0 < W < math.inf:
        raise InputError(f"W = {W!r}; expected finite and > 0")
    if profile.corner < rel_tol * profile.a:  # loads change by less than the corner over a
        profile = replace(profile, corner=0.0)
    m = n_coefficients or coefficients_for(profile, rel_tol)
    hertz = math.sqrt(2 * W)
    if ridges is None and (first := hertz / profile.pitch) * m > 2 * _MAX_UNKNOWNS:
        # What Hertz's contact covers alone is too much: not even listed, there may be millions.
        return _nothing(
            profile, m, f"not computed: some {first * m:.2g} unknowns; cap {_MAX_UNKNOWNS}"
        )
    within = [
        land
        for land in profile.segments(1.3 * hertz + 3 * profile.pitch)
        if ridges is None or land.ridge is None or land.ridge in ridges
    ]
    state = _State(profile, within, rel_tol)
    state.begin(W, hertz, start)
    found, segments = None, []
    status = "not converged: contact ends still move"
    for _ in range(_MAX_ITERATIONS):
        intervals = state.intervals()
        if len(intervals.left) * m > _MAX_UNKNOWNS:
            status = f"not computed: {len(intervals.left) * m} unknowns; cap {_MAX_UNKNOWNS}"
            break
        try:
            found = solve_pressure(intervals, _heights(state.touched, intervals), W, m)
            segments = state.touched
        except np.linalg.LinAlgError:
            status = "not converged: singular equations"
            break
        if state.move(found):
            continue
        if state.add_penetrated(found):
            continue
        if not _resolved(found, rel_tol) and m < _MOST_COEFFICIENTS:
            m = math.ceil(1.5 * m)  # a contact has come near its neighbour
            continue
        status = "ok"
        break
    if found is None:
        return _nothing(profile, m, status)
    if status == "ok":
        status = _checked(found, W, rel_tol)
    return ContactSolution(profile, tuple(segments), found, status)


def _nothing(profile: Profile, m: int, status: str) -> ContactSolution:
    """Return a record without a solution, which says why there is none."""
    nothing = Intervals(np.empty(0), np.empty(0), profile.mirrored)
    empty = PressureSolution(nothing, np.empty((0, m)), math.nan, np.empty(0), m)
    return ContactSolution(profile, (), empty, status)


def coefficients_for(profile: Profile, rel_tol: float) -> int:
    """Return how many coefficients an interval takes: more where grooves are narrow."""
    excess = 2 * profile.b / profile.a
    log_rho = math.log1p(excess + math.sqrt(excess * (2 + excess)))
    sharp = math.log(0.1 / rel_tol) / (2 * log_rho) + 4
    return math.ceil(1.15 * sharp)


def _heights(segments: Sequence[RigidSegment], intervals: Intervals) -> FloatArray:
    """Return the Chebyshev coefficients of each land's depth on its interval."""
    if not any(land.corner for land in segments):
        return np.array([[land.depth] for land in segments])
    # Enough for the narrowest layer beyond a kink: at an angle of phi orders of 1/phi see it.
    angles = [np.pi]
    for land, centre, half in zip(segments, intervals.centre, intervals.half_width, strict=True):
        for kink in land.flat if land.corner else ():
            s = (kink - centre) / half
            if -1 < s < 1:
                angles.append(min(math.acos(s), math.pi - math.acos(s)))
    n = int(min(max(_PER_LAYER / max(min(angles), 1e-9), 128), _MOST_ORDERS))
    points = chebyshev_points(intervals, n)
    values = [land.height(x) for land, x in zip(segments, points, strict=True)]
    return chebyshev_coefficients(np.stack(values))


class _State:
    """Which lands are in contact, from where to where, and which ends are stuck at a corner."""

    def __init__(self, profile: Profile, segments: Sequence[RigidSegment], rel_tol: float) -> None:
        self._profile, self._lands, self._tol = profile, list(segments), rel_tol
        self._ends: dict[RigidSegment, tuple[float, float]] = {}

    @property
    def touched(self) -> list[RigidSegment]:
        return sorted(self._ends, key=lambda land: land.start)

    def intervals(self) -> Intervals:
        ends = np.array([self._ends[land] for land in self.touched]).reshape(-1, 2)
        return Intervals(ends[:, 0].copy(), ends[:, 1].copy(), self._profile.mirrored)

    def begin(self, W: float, hertz: float, start: ContactSolution | None) -> None:
        """Begin with a solution nearby, or with what Hertz's contact covers."""
        if start is not None and len(start.segments):
            known = set(self._lands)
            intervals = start.pressing.intervals
            self._ends = {
                land: (float(low), float(high))
                for land, low, high in zip(
                    start.segments, intervals.left, intervals.right, strict=True
                )
                if land in known
            }
        if not self._ends:
            for land in self._lands:
                low, high = max(land.start, -hertz), min(land.stop, hertz)
                if land.ridge is not None and high > low:
                    self._ends[land] = self._within(land, low, high)
        if not self._ends:
            # The nearest corners: as wide as a body's slope there takes the load.
            tops = [land for land in self._lands if land.ridge is not None] or self._lands
            near = min(tops, key=lambda land: min(abs(land.start), abs(land.stop)))
            self._ends[near] = self._first(near, W)

    def _first(self, land: RigidSegment, W: float) -> tuple[float, float]:
        """Guess a new contact: at the land's nearest point to the centre."""
        low, high = land.flat
        at = min(max(0.0, low), high)
        width = 0.5 * min(land.stop - land.start, max(W / max(abs(at), math.sqrt(W)), 1e-6 * at))
        if low < 0 < high:
            return self._within(land, -width, width)
        if at == low:
            return self._within(land, land.start if land.corner == 0 else low - width, low + width)
        return self._within(land, high - width, land.stop if land.corner == 0 else high + width)

    def _within(self, land: RigidSegment, low: float, high: float) -> tuple[float, float]:
        low, high = max(low, land.start), min(high, land.stop)
        if self._profile.mirrored and land.start < 0 < land.stop:
            high = max(high, -low)
            low = -high
        return low, high

    def move(self, found: PressureSolution) -> bool:
        """Move free ends by Newton's step, drop what shrinks to nothing; whether any did."""
        moved = False
        width = 2 * found.intervals.half_width
        typical = np.abs(found.coefficients[:, 0])
        share = math.pi * typical / found.load
        outward = [np.nan_to_num(step, nan=0.0) for step in found.outward]
        for i, land in enumerate(self.touched):
            ends = list(self._ends[land])
            sharp = land.corner == 0
            has_stuck = sharp and (ends[0] == land.start or ends[1] == land.stop)
            most = (1 - _SHRINK) * width[i] * (1.0 if has_stuck else 0.5)
            for side, limit in ((0, land.start), (1, land.stop)):
                strength = found.singular[side][i]
                step = outward[side][i]
                if strength > 0 and step <= 0:  # no zero of pressure ahead: as far as it goes
                    step = width[i]
                elif strength < 0 and step >= 0:
                    step = -most
                stuck = sharp and ends[side] == limit
                if stuck and strength >= -self._tol * typical[i]:
                    continue
                # A contact that has only just begun is as wide as rounding lets it be.
                near = self._tol * width[i] * max(1.0, _BEGUN / max(share[i], 1e-300))
                near = near if share[i] > max(_ROUNDING, 0.01 * self._tol) else math.inf
                layer = (2 * side - 1) * (ends[side] - land.flat[side])
                if 0 < layer < width[i]:  # beyond a kink pressure falls to zero within it
                    near = min(near, 0.3 * _TENSION * math.sqrt(self._tol) * layer)
                if not stuck and abs(step) <= near:
                    continue
                step = float(min(max(step, -most), 2 * width[i]))
                room = abs(limit - ends[side])
                if land.corner:  # never as far as the wall, where the profile is vertical
                    step = min(step, 0.5 * room)
                new = limit if step >= room else ends[side] + (2 * side - 1) * step
                moved = moved or new != ends[side]
                ends[side] = new
            if ends[1] - ends[0] <= _NOTHING * (land.stop - land.start) and len(self._ends) > 1:
                del self._ends[land]
                moved = True
                continue
            if self._profile.mirrored and land.start < 0 < land.stop:
                ends[0] = -ends[1]
            self._ends[land] = ends[0], ends[1]
        return moved

    def add_penetrated(self, found: PressureSolution) -> bool:
        """Begin a contact on every land that the surface penetrates; whether there was any."""
        added = False
        scale = max(self._tol * found.load, 1e-15)
        for land in self._lands:
            if land in self._ends:
                continue
            low, high = land.flat
            x = np.linspace(low, high, 33 if land.ridge is None else 9)
            if land.corner:  # a round corner is touched before the flat is
                into = np.linspace(0, land.corner, 33)[:0:-1]
                x = np.concatenate([low - into, x, high + into[::-1]])
            x = np.unique(x)
            gap = found.surface(x) + land.height(x)
            for _ in range(3):
                x, gap = _with_vertex(found, land, x, gap)
            # On a sloping surface a contact too narrow to be one stands for this much.
            narrow = 100 * _NOTHING * (land.stop - land.start) * max(-land.start, land.stop)
            if gap.min() < -max(scale, narrow):
                inside = x[gap < 0]
                if land.ridge is None:
                    middle, half = 0.5 * float(inside[0] + inside[-1]), 0.5 * float(np.ptp(inside))
                    half = max(0.5 * half, 0.02 * (high - low))
                    self._ends[land] = self._within(land, middle - half, middle + half)
                else:
                    self._ends[land] = self._first(land, found.load)
                added = True
        return added


def _with_vertex(
    found: PressureSolution, land: RigidSegment, x: FloatArray, gap: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return places and gaps with the lowest point of the parabola through the lowest three."""
    if len(x) < 3:
        return x, gap
    i = int(np.clip(np.argmin(gap), 1, len(x) - 2))
    near, far = x[i] - x[i - 1], x[i + 1] - x[i]
    left, right = (gap[i] - gap[i - 1]) / near, (gap[i + 1] - gap[i]) / far
    bend = right - left
    if not bend > 0:
        return x, gap
    at = 0.5 * (x[i] + x[i - 1]) - left * 0.5 * (near + far) / bend
    at = float(np.clip(at, x[i - 1], x[i + 1]))
    place = int(np.searchsorted(x, at))
    if at in (x[i - 1], x[i], x[i + 1]):
        return x, gap
    lowest = found.surface(np.array([at])) + land.height(np.array([at]))
    return np.insert(x, place, at), np.insert(gap, place, lowest[0])


def _checked(found: PressureSolution, W: float, rel_tol: float) -> str:
    """Return ``ok``, or which condition does not hold."""
    if not abs(found.load / W - 1) <= 1e-10:
        return f"forces not in balance: {found.load / W - 1:.1e}"
    if not _resolved(found, rel_tol):
        return f"not converged: coefficient tail {found.tail:.1e}"
    smallest = smallest_pressure(found)
    if not smallest >= -max(_TENSION * math.sqrt(rel_tol), 1e-6):
        return f"tension: {smallest:.1e} of the mean pressure"
    return "ok"


def _resolved(found: PressureSolution, rel_tol: float) -> bool:
    """Return whether coefficients have decayed: loads err by under tail^2."""
    return found.tail**2 <= rel_tol


def smallest_pressure(found: PressureSolution) -> float:
    """Return the smallest q sqrt(1 - s^2) of any interval over its mean: negative is tension."""
    pressure, m = found.pressure_at_points(), found.coefficients.shape[1]
    if m > found.n_coupled:  # a kink's series says nothing of the last few of its own waves
        ends = math.ceil(16 / math.pi * pressure.shape[1] / m)
        pressure = pressure[:, ends:-ends]
    else:
        width = found.intervals.half_width
        pressure = np.column_stack([pressure, *(end / width for end in found.singular)])
    mean = found.coefficients[:, 0] / found.intervals.half_width
    # A contact that has only just begun is as small as rounding lets it be.
    counts = found.forces * found.intervals.weight > _BEGUN * found.load
    return float((pressure.min(axis=1) / mean)[counts].min(initial=np.inf))


def solve_many_contacts(
    profile: Profile, W: Sequence[float] | FloatArray, *, rel_tol: float = 1e-8
) -> list[ContactSolution]:
    """Press by each of several loads; each begins where the next lower one ended."""
    order = np.argsort(W)
    found: dict[int, ContactSolution] = {}
    last = None
    for i in order.tolist():
        found[i] = last = solve_contact(profile, float(W[i]), rel_tol=rel_tol, start=last)
    return [found[i] for i in range(len(order))]
