"""Loads at which contact reaches one ridge after another, for any profile: events, not steps.

The gap over a ridge that is not there yet falls as the load rises; where it vanishes is the load
that reaches it. No load increment enters.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import optimize

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.contact_solution import ContactSolution, solve_contact
from ridgebayes.contact.rigid_profile import Profile, RigidSegment

_TINY = np.array([1e-10, 1e-9, 1e-8, 1e-7, 1e-6])


@dataclass(frozen=True, eq=False)
class TransitionLoads:
    """The loads that reach further ridges, in rising order.

    Parameters
    ----------
    W : ndarray of float, shape (n,)
        Loads, 4 (1 - nu^2)/pi times p/E; NaN where none was found.
    Q : ndarray of int, shape (n,)
        Ridges in contact from that load on.
    status : tuple of str
        ``ok``, or why not.
    """

    W: FloatArray
    Q: IntArray
    status: tuple[str, ...]


def reaching_loads(
    profile: Profile, *, W_max: float, n_max: int = 10_000, rel_tol: float = 1e-8
) -> TransitionLoads:
    """Find every load up to a largest one at which a further ridge, or pair of them, is reached.

    Parameters
    ----------
    profile : Profile
        The rigid side.
    W_max : float
        Largest load.
    n_max : int, optional
        Most events.
    rel_tol : float, optional
        Wanted relative error of each load.

    Returns
    -------
    TransitionLoads
        What is touched from the smallest load on is no event. Of a mirrored profile each event is
        a pair of ridges.

    Notes
    -----
    *Cost.* About ten solves of `solve_contact` for each event, twice as many beside the centre.
    """
    loads: list[float] = []
    counts: list[int] = []
    status: list[str] = []
    # As small as can be solved for: round corners bear so little on a spot near rounding's size.
    for tiny in _TINY * min(W_max, profile.pitch**2):
        now = solve_contact(profile, float(tiny), rel_tol=rel_tol)
        if now.status == "ok":
            break
    first = [segment.ridge for segment in now.segments if segment.ridge is not None]
    # Where a floor alone is touched the ridges beside it, -1 and 0, are yet to be reached.
    low, high = (min(first), max(first)) if first else (0, -1)
    start = float(tiny)
    while len(loads) < n_max:
        # To the right, and where the profile is no mirror image also to the left.
        sides = (high + 1,) if profile.mirrored else (high + 1, low - 1)
        touched = range(low, high + 1)
        events = [_reach(profile, touched, one, start, W_max, rel_tol) for one in sides]
        W, ridge, why, solution = min(events, key=lambda event: event[0])
        if not W_max >= W:
            break
        low, high = min(low, ridge), max(high, ridge)
        loads.append(W if why == "ok" else math.nan)
        # A contact that begins at this very load is all rounding.
        W *= 1 + max(0.1 * rel_tol, 1e-9)
        step = 2 if profile.mirrored else 1
        counts.append((solution if solution is not None else now).Q + step)
        status.append(why)
        start = W
        if why != "ok":
            break
    return TransitionLoads(np.array(loads), np.array(counts, dtype=np.int64), tuple(status))


def _reach(
    profile: Profile, ridges: range, number: int, start: float, W_max: float, rel_tol: float
) -> tuple[float, int, str, ContactSolution | None]:
    """Return the load at which a ridge beyond those given is reached, infinite if above W_max."""
    segment = profile.ridge(number)
    last: list[ContactSolution | None] = [None]

    @cache  # from another start it might come out on the other side of zero
    def gap(W: float) -> float:
        found = solve_contact(profile, W, rel_tol=rel_tol, start=last[0], ridges=ridges)
        if found.status != "ok":
            raise _FailedError(found.status)
        last[0] = found
        return nearest_gap(found, segment)

    try:
        below, above = start, start
        at_below = at_above = gap(start)
        while at_above > 0:
            below, at_below = above, at_above
            if above >= W_max:
                return math.inf, number, "ok", last[0]
            above = min(max(1.5 * above, above + 0.1 * profile.pitch**2), W_max)
            at_above = gap(above)
        if at_below <= 0:
            return start, number, "ok", last[0]
        root = optimize.brentq(gap, below, above, xtol=1e-3 * rel_tol * above, rtol=1e-14)
        return float(root), number, "ok", last[0]
    except _FailedError as failed:
        return start, number, str(failed), last[0]


class _FailedError(Exception):
    """A solution on the way was not sound."""


def nearest_gap(found: ContactSolution, segment: RigidSegment) -> float:
    """Return the smallest gap between the body's surface and a segment that it does not touch."""
    low, high = segment.flat
    # Not by the flat's ends: corners of half a ridge leave none.
    inner, towards = (low, -1.0) if abs(segment.start) < abs(segment.stop) else (high, 1.0)
    if segment.corner == 0.0:
        return float(found.pressing.surface(np.array([inner]))[0] + segment.depth)

    def gap(into: float) -> float:
        x = np.array([inner + towards * into])
        return float((found.pressing.surface(x) + segment.height(x))[0])

    best = optimize.minimize_scalar(
        gap, bounds=(0.0, segment.corner * (1 - 1e-9)), method="bounded", options={"xatol": 1e-12}
    )
    return min(float(best.fun), gap(0.0))
