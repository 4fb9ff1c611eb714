"""Loads at which contact reaches one ridge after another, for any profile: events, not steps.

The gap over a ridge that is not there yet falls as the load rises; where it vanishes is the load
that reaches it. No load increment enters.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.all_events import Events, all_events
from ridgebayes.contact.contact_solution import (
    ContactSolution,
    bearing_half_width,
    coefficients_for,
    solve_contact,
    too_many,
)
from ridgebayes.contact.ridge_row import touch_order
from ridgebayes.contact.rigid_profile import Profile

_MOST_STEPS = 60
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
        Ridges that are touched from the smallest load on are no event. Each event of a mirrored
        profile is a pair of ridges.

    Notes
    -----
    *Cost.* As for `all_events`; where its conditions do not hold, as over floors that are touched,
    about ten solves of `solve_contact` for each event, twice as many beside the centre.
    """
    if profile.corner < rel_tol * profile.a:  # loads change by less than the corner over a
        profile = replace(profile, corner=0.0)
    together = all_events(profile, W_max=W_max, n_max=n_max, rel_tol=rel_tol)
    order = touch_order(profile, len(together.W) + 1)
    begun = None if together.ok[:1].any() else _smallest(profile, W_max, rel_tol)
    low, high = _touched_first(profile, together, W_max, begun)
    loads: list[float] = []
    counts: list[int] = []
    status: list[str] = []
    found = begun
    while len(loads) < n_max:
        n = high - low + 1
        known = 0 < n < len(order) and together.ok[n - 1]
        if known and {low, high} <= set(order[:n].tolist()):
            W, ridge, said = float(together.W[n - 1]), int(order[n]), "ok"
        else:
            if n == len(order) > 1 and together.ok[-1]:  # ended by the most unknowns
                half_width = bearing_half_width(profile, W_max)
                found = too_many(profile, n * coefficients_for(profile, rel_tol, half_width))
            elif found is None:
                found = _smallest(profile, W_max, rel_tol)
            # Roots of the loads of pairs rise nearly evenly: the search starts from the next one.
            rise = 2 * math.sqrt(loads[-1]) - math.sqrt(loads[-2]) if len(loads) > 1 else 0.0
            begin = min(rise**2, W_max) if profile.mirrored and rise else max([found.W, *loads])
            # To the right, and where the profile is no mirror image also to the left.
            sides = (high + 1,) if profile.mirrored else (high + 1, low - 1)
            W, ridge, found = _reach(found, begin, range(low, high + 1), sides, W_max, rel_tol)
            said = found.status
        if not W_max >= W:
            break
        low, high = min(low, ridge), max(high, ridge)
        loads.append(W if said == "ok" else math.nan)
        counts.append(_count(profile, low, high))
        status.append(said)
        if said != "ok":
            break
    return TransitionLoads(np.array(loads), np.array(counts, dtype=np.int64), tuple(status))


def _smallest(profile: Profile, W_max: float, rel_tol: float) -> ContactSolution:
    """Return the contact under a load as small as can be solved for."""
    # Round corners bear so little on a spot near rounding's size.
    for tiny in _TINY * min(W_max, profile.pitch**2):
        found = solve_contact(profile, float(tiny), rel_tol=rel_tol)
        if found.status == "ok":
            break
    return found


def _touched_first(
    profile: Profile, together: Events, W_max: float, begun: ContactSolution | None
) -> tuple[int, int]:
    """Return the first and last ridge that are touched from the smallest load on."""
    if begun is None:
        nothing = _TINY[0] * min(W_max, profile.pitch**2)
        both = not profile.mirrored and together.W[0] <= nothing
        order = touch_order(profile, 2 if both else 1)
        return int(order.min()), int(order.max())
    first = [segment.ridge for segment in begun.segments if segment.ridge is not None]
    # Where a floor alone is touched the ridges beside it, -1 and 0, are yet to be reached.
    return (min(first), max(first)) if first else (0, -1)


def _count(profile: Profile, low: int, high: int) -> int:
    """Return how many ridges there are from one to another, mirror images included."""
    if not profile.mirrored:
        return high - low + 1
    return 2 * high + (1 if abs(profile.offset) == 0.5 else 2)


def _reach(
    found: ContactSolution,
    W: float,
    ridges: range,
    sides: tuple[int, ...],
    W_max: float,
    rel_tol: float,
) -> tuple[float, int, ContactSolution]:
    """Return the load that reaches a ridge beyond those given, infinite if above W_max, and which.

    The gap over a ridge falls with the load, and by less the wider the contact is: each of Newton's
    steps, from wherever it begins, ends below the load that is sought.
    """
    if found.status != "ok":
        return W, sides[0], found
    profile, least = found.profile, found.W
    ahead = [profile.ridge(number) for number in sides]
    for _ in range(_MOST_STEPS):
        found = solve_contact(profile, W, rel_tol=rel_tol, start=found, ridges=ridges)
        if found.status != "ok":
            return W, sides[0], found
        x, gap = np.array([found.nearest_gap(segment) for segment in ahead]).T
        steps = -gap / found.pressing.surface_by_load(x)
        nearest = int(np.argmin(steps))
        step = max(float(steps[nearest]), least - W)
        W += step
        if W_max < W:
            return math.inf, sides[nearest], found
        if abs(step) <= 1e-3 * rel_tol * W:
            return W, sides[nearest], found
    return W, sides[0], replace(found, status="not converged: the load that reaches a ridge")
