"""A parabola pressed on ridges by any load: where it touches, and what follows from that.

Contact covers part of each segment: up to a sharp corner, where the pressure is singular, or to an
end that is found from zero pressure, see `contact_set`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.contact.contact_set import BEGUN, TENSION, ContactSet, nearest_gaps
from ridgebayes.contact.intervals import Intervals, PressureSolution, solve_pressure
from ridgebayes.contact.rigid_profile import Kinks, Profile, RigidSegment, falls
from ridgebayes.errors import InputError

_MAX_ITERATIONS = 200  # ends take steps in turn, more of them where few coefficients are used
MOST_UNKNOWNS, _MOST_COEFFICIENTS = 4_000, 400
DEFAULT_REL_TOL = 1e-8  # of loads and of contact ends


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
    segments : tuple of RigidSegment
        Those in contact, from left to right; of a mirrored profile the right half.
    pressing : PressureSolution
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
    def covered(self) -> dict[RigidSegment, tuple[float, float]]:
        """Ends of contact on each segment."""
        left, right = self.pressing.intervals.left, self.pressing.intervals.right
        ends = zip(left.tolist(), right.tolist(), strict=True)
        return dict(zip(self.segments, ends, strict=True))

    @property
    def Q(self) -> int:
        """Ridges in contact: each at its proximal corner, one below the centre with any part."""
        touched = [segment.ridge is not None for segment in self.segments]
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

    def nearest_gaps(self, segments: Sequence[RigidSegment]) -> tuple[FloatArray, FloatArray]:
        """Return where the gap to each of some segments that are not touched is least, and the gap.

        Shape (n_segment,), over R.
        """
        return nearest_gaps(self.pressing, segments)[:2]

    def rise_to_touch(self, segments: Sequence[RigidSegment]) -> float:
        """Return by how much more load the first of some segments is touched: Newton's step."""
        x, gap = self.nearest_gaps(segments)
        return float((-gap / self.pressing.surface_by_load(x)).min())

    @cached_property
    def penetrations(self) -> dict[int, float]:
        """How deep the surface hangs into each groove between touched ridges, by ridge."""
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
    n_coefficients: int | None = None,
    start: ContactSolution | None = None,
    ridges: range | None = None,
    ahead: Sequence[RigidSegment] = (),
) -> ContactSolution:
    """Press a parabola on ridges by a load, or up to the load that reaches another ridge.

    Parameters
    ----------
    profile : Profile
        The rigid side.
    W : float
        Load: 4 (1 - nu^2)/pi times p/E. Where there are ridges ahead, the smallest load.
    rel_tol : float, optional
        Tolerance of the ends, over their interval's width, of tension and of penetration.
    n_coefficients : int, optional
        Per interval; by the profile and the tolerance if not given.
    start : ContactSolution, optional
        A solution at a load nearby, to begin with.
    ridges : range, optional
        Numbers of the only ridges there are: what happens up to the load that reaches the next.
    ahead : sequence of RigidSegment, optional
        Ridges beside those: the load is sought at which the gap over the first of them vanishes.

    Returns
    -------
    ContactSolution
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
    half_width = bearing_half_width(profile, W)
    m = n_coefficients or coefficients_for(profile, rel_tol, half_width)
    hertz = math.sqrt(2 * W)
    if ridges is None and (first := hertz / profile.pitch) * m > 2 * MOST_UNKNOWNS:
        # Ridges under Hertz's contact alone are too many: not even listed, there may be millions.
        return too_many(profile, first * m)
    within = profile.segments(1.3 * hertz + 3 * profile.pitch)
    if ridges is not None:
        within = [segment for segment in within if segment.ridge is None or segment.ridge in ridges]
    state = ContactSet(profile, within, rel_tol)
    state.begin(W, {} if start is None else start.covered, 0.5 * profile.a - half_width)
    solution, least, step = no_solution(profile, "not converged: contact ends still move"), W, 0.0
    for _ in range(_MAX_ITERATIONS):
        W += step
        intervals = state.intervals()
        if len(intervals.left) * m > MOST_UNKNOWNS:
            return too_many(profile, len(intervals.left) * m)
        try:
            height, kinks = _heights(state.touched, intervals)
            pressing = solve_pressure(intervals, height, W, m, kinks)
        except np.linalg.LinAlgError:
            return replace(solution, status="not converged: singular equations")
        solution = replace(solution, segments=tuple(state.touched), pressing=pressing)
        moves = state.move(pressing)
        # Ends at zero pressure do not change the gap to first order: load and ends step at once.
        rise = max(solution.rise_to_touch(ahead), least - W) if ahead else 0.0
        if abs(rise) > 1e-3 * rel_tol * W:
            if rise * step >= 0:
                state.forget_steps()
            moves, step = True, rise
        else:
            step = 0.0
        if moves or state.add_penetrated(pressing):
            continue
        if _resolved(pressing, rel_tol) or m >= _MOST_COEFFICIENTS:
            return replace(solution, status=_checked(pressing, W, rel_tol))
        m = math.ceil(1.5 * m)  # a contact has come near its neighbour
    return solution


def no_solution(profile: Profile, status: str) -> ContactSolution:
    """Return a record without a solution, which says why there is none."""
    nothing = Intervals(np.empty(0), np.empty(0), profile.mirrored)
    none, last = np.empty((0, 1)), np.empty(0)
    empty = PressureSolution(nothing, none, math.nan, last, Kinks.none(0), (none, math.nan))
    return ContactSolution(profile, (), empty, status)


def too_many(profile: Profile, unknowns: float) -> ContactSolution:
    """Return the record of a contact that is not computed, which names what it has too much of."""
    of = f"a/R = {profile.a:.3g}, b/R = {profile.b:.3g}"
    why = f"not computed: some {unknowns:.4g} unknowns with {of}; cap {MOST_UNKNOWNS}"
    return no_solution(profile, why)


def bearing_half_width(profile: Profile, W: float) -> float:
    """Return what contact on a ridge is expected to stay within: its own, or less by its corners.

    Equation (19) of docs/derivations/contact.md, by a fifth more than Hertz's largest pressure.
    """
    corner, pitch = profile.corner, profile.pitch
    flat = corner + 0.5 * profile.b  # from a groove's middle
    wanted = 1.2 * 0.5 * math.pi * math.sqrt(2 * W) * corner / flat
    tau = wanted + 1.0
    for _ in range(6):  # Newton's steps, all from above
        tau -= (tau - math.tanh(tau) - wanted) / math.tanh(tau) ** 2
    free = pitch / math.pi * math.asin(math.sin(math.pi * flat / pitch) / math.cosh(tau))
    return min(0.5 * profile.a, 0.5 * pitch - free)


def coefficients_for(profile: Profile, rel_tol: float, half_width: float) -> int:
    """Return how many coefficients contact within a half-width of each ridge takes.

    More where what is left of a groove is narrow.
    """
    excess = (profile.b + (profile.a - 2 * half_width)) / half_width
    log_rho = math.log1p(excess + math.sqrt(excess * (2 + excess)))
    sharp = math.log(0.1 / rel_tol) / (2 * log_rho) + 4
    return math.ceil(1.15 * sharp)


def _heights(segments: Sequence[RigidSegment], intervals: Intervals) -> tuple[FloatArray, Kinks]:
    """Return each segment's depth on its interval: a polynomial's coefficients, and kinks."""
    half, n = intervals.half_width, len(segments)
    height = np.array([[segment.depth, 0.0, 0.0] for segment in segments])
    radius = np.array([segment.corner for segment in segments])
    if not radius.any():
        return height, Kinks.none(n)
    flat = np.array([segment.flat for segment in segments]).T
    beyond = np.stack([flat[0] - intervals.left, intervals.right - flat[1]])
    added, kinks = falls(beyond, half, radius)
    return height + added, kinks


def _checked(pressing: PressureSolution, W: float, rel_tol: float) -> str:
    """Return ``ok``, or which condition does not hold."""
    if not abs(pressing.load / W - 1) <= 1e-10:
        return f"forces not in balance: {pressing.load / W - 1:.1e}"
    if not _resolved(pressing, rel_tol):
        return f"not converged: coefficient tail {pressing.tail:.1e}"
    smallest = smallest_pressure(pressing)
    if not smallest >= -max(TENSION * math.sqrt(rel_tol), 1e-6):
        return f"tension: {smallest:.1e} of the mean pressure"
    return "ok"


def _resolved(pressing: PressureSolution, rel_tol: float) -> bool:
    """Return whether coefficients have decayed: loads err by under tail^2."""
    return pressing.tail**2 <= rel_tol


def smallest_pressure(pressing: PressureSolution) -> float:
    """Return the smallest q sqrt(1 - s^2) of any interval over its mean: negative is tension."""
    width = pressing.intervals.half_width
    ends = (end / width for end in pressing.singular)
    pressure = np.column_stack([pressing.pressure_at_points(), *ends])
    mean = pressing.coefficients[:, 0] / width
    # Pressures of contacts that have only just started are rounding errors.
    counts = pressing.forces * pressing.intervals.weight > BEGUN * pressing.load
    return float((pressure.min(axis=1) / mean)[counts].min(initial=np.inf))


def solve_many_contacts(
    profile: Profile, W: Sequence[float] | FloatArray, *, rel_tol: float = DEFAULT_REL_TOL
) -> list[ContactSolution]:
    """Press by each of several loads; each begins where the next lower one ended."""
    solutions: dict[int, ContactSolution] = {}
    last = None
    for i in np.argsort(W).tolist():
        solutions[i] = last = solve_contact(profile, float(W[i]), rel_tol=rel_tol, start=last)
    return [solutions[i] for i in sorted(solutions)]
