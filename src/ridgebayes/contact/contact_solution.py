"""A parabola pressed on ridges by a load: its contact, and quantities computed from it.

Contact covers part of each segment. It ends at a sharp corner, where the pressure is singular, or
at a free end, where the pressure is zero; see `contact_set`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.contact_set import BEGUN, TENSION, ContactSet, nearest_gaps
from ridgebayes.contact.intervals import Intervals
from ridgebayes.contact.logkernel import log_ellipse
from ridgebayes.contact.pressure import PressureSolution, solve_pressure
from ridgebayes.contact.rigid_profile import Kinks, Profile, RigidSegment, falls
from ridgebayes.errors import InputError

MAX_ITERATIONS = 200  # steps of the ends; few coefficients need many
MOST_UNKNOWNS = 4_000
DEFAULT_REL_TOL = 1e-8  # of loads and of contact ends


def load_factor(nu: float) -> float:
    """Return W over p/E: 4 (1 - nu^2)/pi."""
    return 4 / math.pi * (1 - nu**2)


@dataclass(frozen=True, eq=False)
class ContactSolution:
    """Solution for a body pressed on ridges.

    Parameters
    ----------
    profile : Profile
        Rigid profile.
    segments : tuple of RigidSegment
        Segments in contact, from left to right; for a mirrored profile, of the right half.
    pressing : PressureSolution
        Pressures on the segments.
    status : str
        ``ok``, or the condition that is violated.
    """

    profile: Profile
    segments: tuple[RigidSegment, ...]
    pressing: PressureSolution
    status: str

    @property
    def W(self) -> float:
        """Load: integral of pressure times 2/(pi E*), over R; p/E is pi/4 W/(1 - nu^2)."""
        return self.pressing.load

    @property
    def covered(self) -> dict[RigidSegment, tuple[float, float]]:
        """Ends of contact on each segment."""
        left, right = self.pressing.intervals.left, self.pressing.intervals.right
        ends = zip(left.tolist(), right.tolist(), strict=True)
        return dict(zip(self.segments, ends, strict=True))

    @property
    def Q(self) -> int:
        """Number of ridges in contact, in whole or in part."""
        touched = [segment.ridge is not None for segment in self.segments]
        return int(np.sum(self.pressing.intervals.weight[touched]))

    @property
    def ends(self) -> tuple[float, float]:
        """Outermost ends of contact, left and right; NaN without a solution."""
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
        """Downward movement of the body relative to the ridges' tops, over R.

        It is measured at the body's surface at a distance R from the centre, because the
        displacement of a half-plane has no limit far away.
        """
        return self.pressing.approach

    def nearest_gaps(self, segments: Sequence[RigidSegment]) -> tuple[FloatArray, FloatArray]:
        """Return the places where the gaps to untouched segments are smallest, and these gaps.

        Shape (n_segment,), over R.
        """
        return nearest_gaps(self.pressing, segments)[:2]

    def rise_to_touch(self, segments: Sequence[RigidSegment]) -> float:
        """Return the rise of the load until the first of some segments is touched (Newton step)."""
        x, gap = self.nearest_gaps(segments)
        return float((-gap / self.pressing.surface_by_load(x)).min())

    @cached_property
    def penetrations(self) -> dict[int, float]:
        """Depth of the surface in each groove between touched ridges, by ridge number."""
        numbers = [segment.ridge for segment in self.segments if segment.ridge is not None]
        first = min(numbers, default=0)
        first = -1 if self.profile.mirrored and first >= 0 else first
        grooves = list(range(first, max(numbers, default=first)))
        if not grooves:
            return {}
        floors = [replace(self.profile.floor_after(groove), depth=0.0) for groove in grooves]
        return dict(zip(grooves, (-self.nearest_gaps(floors)[1]).tolist(), strict=True))


def solve_contact(
    profile: Profile,
    W: float,
    *,
    rel_tol: float = DEFAULT_REL_TOL,
    start: Mapping[RigidSegment, tuple[float, float]] | None = None,
    ridges: range | None = None,
    ahead: Sequence[RigidSegment] = (),
) -> ContactSolution:
    """Press a parabola on ridges by a load, or up to the load at which it reaches another ridge.

    Parameters
    ----------
    profile : Profile
        Rigid profile.
    W : float
        Load: 4 (1 - nu^2)/pi times p/E. With `ahead`, a guess: a quarter of it is the least load.
    rel_tol : float, optional
        Tolerance of the ends, over their interval's width, of tension and of penetration.
    start : mapping of RigidSegment to (float, float), optional
        Ends of contact at a similar load, as the initial guess.
    ridges : range, optional
        Numbers of the ridges to include. The solution holds until another ridge is reached.
    ahead : sequence of RigidSegment, optional
        Ridges outside this range. If given, solve for the load that touches the first of these.

    Returns
    -------
    ContactSolution
        Solution whose status gives the first violated condition, if any: no tension, no
        penetration, ends at zero pressure, decayed coefficients, balance of forces.

    Raises
    ------
    InputError
        If the load is not finite and positive.
    """
    if not 0 < W < math.inf:
        raise InputError(f"W = {W!r}; expected finite and > 0")
    if profile.corner < rel_tol * profile.a:  # the corner changes loads by less than corner/a
        profile = replace(profile, corner=0.0)
    # The strength of a free end errs by a few times the tolerance, which TENSION has to exceed.
    rel_tol = min(rel_tol, (0.1 * TENSION) ** 2)
    half_width, hertz = bearing_half_width(profile, W), math.sqrt(2 * W)
    m_ridge = coefficients_for(profile, rel_tol, half_width)
    first = hertz / profile.pitch * m_ridge
    if ridges is None and first > 2 * MOST_UNKNOWNS:
        # The number of ridges is checked before they are listed, because it may be millions.
        return too_many(profile, first)
    within = profile.segments(1.3 * hertz + 3 * profile.pitch)
    if ridges is not None:
        within = [segment for segment in within if segment.ridge is None or segment.ridge in ridges]
    state = ContactSet(profile, within, rel_tol)
    state.begin(W, start or {}, 0.5 * profile.a - half_width)
    solution = no_solution(profile, "not converged: contact ends still move")
    # Pressures that end at zero need fewer coefficients than sharp ends: four fifths at first, and
    # a fifth more whenever the last coefficients have not decayed.
    least, step, share, m = 0.25 * W, 0.0, 0.8, np.empty(0, dtype=np.int64)
    most = 8 * m_ridge  # between a floor and its wall contact may need far less than its gap says
    for _ in range(MAX_ITERATIONS):
        W += step
        intervals = state.intervals()
        enough = np.minimum(_coefficients(intervals.distances(1), share, rel_tol), most)
        # Ends would keep moving if a few coefficients came and went.
        m = np.where(np.abs(enough - m) > 2, enough, m) if len(m) == len(enough) else enough
        if (unknowns := len(m) * m.max()) > MOST_UNKNOWNS:
            return too_many(profile, float(unknowns))
        try:
            height, kinks = _heights(state.touched, intervals)
            pressing = solve_pressure(intervals, height, W, m, kinks)
        except np.linalg.LinAlgError:
            return replace(solution, status="not converged: singular equations")
        solution = replace(solution, segments=tuple(state.touched), pressing=pressing)
        moves = state.move(pressing)
        # Free ends do not affect the gap to first order, so load and ends are updated together.
        rise = max(solution.rise_to_touch(ahead), least - W) if ahead else 0.0
        if abs(rise) > 1e-3 * rel_tol * W:
            if rise * step >= 0:
                state.forget_steps()
            moves, step = True, rise
        else:
            step = 0.0
        if state.add_penetrated(pressing, settled=not moves) or moves:
            continue
        if pressing.tail**2 <= rel_tol:  # the relative error of loads is below tail^2
            return replace(solution, status=_status_of(pressing, W, rel_tol))
        share, most = 1.2 * share, 2 * most
    return solution


def no_solution(profile: Profile, status: str) -> ContactSolution:
    """Return a solution without contact, whose status gives the reason."""
    nothing = Intervals(np.empty(0), np.empty(0), profile.mirrored)
    none, last = np.empty((0, 1)), np.empty(0)
    empty = PressureSolution(nothing, none, math.nan, last, Kinks.none(0), (none, math.nan))
    return ContactSolution(profile, (), empty, status)


def too_many(profile: Profile, unknowns: float) -> ContactSolution:
    """Return the status of a contact that would need too many unknowns."""
    of = f"a/R = {profile.a:.3g}, b/R = {profile.b:.3g}"
    why = f"not computed: some {unknowns:.4g} unknowns with {of}; cap {MOST_UNKNOWNS}"
    return no_solution(profile, why)


def bearing_half_width(profile: Profile, W: float) -> float:
    """Return the expected half-width of contact on a ridge, reduced by round corners.

    Equation (19) of docs/derivations/contact.md, for a pressure a fifth above Hertz's maximum. This
    is a margin: `all_events` starts again if a contact turns out wider.
    """
    corner, pitch = profile.corner, profile.pitch
    flat = corner + 0.5 * profile.b  # distance from a groove's middle
    pressure = 1.2 * 0.5 * math.pi * math.sqrt(2 * W) * corner / flat
    tau = pressure + 1.0
    for _ in range(6):  # Newton steps, all from above
        tau -= (tau - math.tanh(tau) - pressure) / math.tanh(tau) ** 2
    free = pitch / math.pi * math.asin(math.sin(math.pi * flat / pitch) / math.cosh(tau))
    return min(0.5 * profile.a, 0.5 * pitch - free)


def coefficients_for(profile: Profile, rel_tol: float, half_width: float) -> int:
    """Return the number of coefficients for contact within a half-width of each ridge.

    A narrow gap between contacts needs more.
    """
    excess = (profile.b + (profile.a - 2 * half_width)) / half_width
    return int(_coefficients(np.array([excess]), 1.0, rel_tol)[0])


def _coefficients(excess: FloatArray, share: float, rel_tol: float) -> IntArray:
    """Return the coefficients of intervals whose neighbours are `excess` half-widths away, (n,).

    Fully covered ridges need them all, free ends a `share`.
    """
    sharp = math.log(0.1 / rel_tol) / (2 * log_ellipse(excess)) + 4
    return np.ceil(1.15 * share * sharp).astype(np.int64)


def _heights(segments: Sequence[RigidSegment], intervals: Intervals) -> tuple[FloatArray, Kinks]:
    """Return the Chebyshev coefficients of each segment's depth on its interval, and its kinks."""
    half, n = intervals.half_width, len(segments)
    height = np.array([[segment.depth, 0.0, 0.0] for segment in segments])
    radius = np.array([segment.corner for segment in segments])
    if not radius.any():
        return height, Kinks.none(n)
    flat = np.array([segment.flat for segment in segments]).T
    beyond = np.stack([flat[0] - intervals.left, intervals.right - flat[1]])
    added, kinks = falls(beyond, half, radius)
    return height + added, kinks


def _status_of(pressing: PressureSolution, W: float, rel_tol: float) -> str:
    """Return ``ok``, or a message about a violated condition."""
    if not abs(pressing.load / W - 1) <= 1e-10:
        return f"forces not in balance: {pressing.load / W - 1:.1e}"
    smallest = smallest_pressure(pressing)
    if not smallest >= -max(TENSION * math.sqrt(rel_tol), 1e-6):
        return f"tension: {smallest:.1e} of the mean pressure"
    return "ok"


def smallest_pressure(pressing: PressureSolution) -> float:
    """Return the smallest q sqrt(1 - s^2) of any interval over its mean; negative is tension."""
    width = pressing.intervals.half_width
    ends = (end / width for end in pressing.singular)
    pressure = np.column_stack([pressing.pressure_at_points(), *ends])
    mean = pressing.coefficients[:, 0] / width
    # Pressures of contacts that have just started are rounding errors.
    counts = pressing.forces * pressing.intervals.weight > BEGUN * pressing.load
    return float((pressure.min(axis=1) / mean)[counts].min(initial=np.inf))


def solve_many_contacts(
    profile: Profile, W: Sequence[float] | FloatArray, *, rel_tol: float = DEFAULT_REL_TOL
) -> list[ContactSolution]:
    """Solve for several loads; each solution starts from that of the next lower load."""
    solutions: dict[int, ContactSolution] = {}
    last = None
    for i in np.argsort(W).tolist():
        solutions[i] = last = solve_contact(
            profile, float(W[i]), rel_tol=rel_tol, start=None if last is None else last.covered
        )
    return [solutions[i] for i in sorted(solutions)]
