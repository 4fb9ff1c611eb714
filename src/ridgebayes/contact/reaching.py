"""Loads at which contact reaches further ridges, for any profile.

The gap over the next ridge falls as the load rises. The load of an event is the root of this gap,
so it does not depend on a load increment.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.all_events import all_events
from ridgebayes.contact.contact_solution import DEFAULT_REL_TOL, ContactSolution, solve_contact
from ridgebayes.contact.ridge_row import touch_order
from ridgebayes.contact.rigid_profile import Profile, RigidSegment

_MIN_LOAD_RATIO = 1e-10  # smallest load that rounding allows, over W_max or the square of the pitch


@dataclass(frozen=True, eq=False)
class TransitionLoads:
    """Loads that reach further ridges, in rising order.

    Parameters
    ----------
    W : ndarray of float, shape (n,)
        Loads, 4 (1 - nu^2)/pi times p/E; NaN if the load was not found.
    Q : ndarray of int, shape (n,)
        Number of ridges in contact from the load on.
    status : tuple of str
        ``ok``, or the reason why the load was not found.
    """

    W: FloatArray
    Q: IntArray
    status: tuple[str, ...]


def reaching_loads(
    profile: Profile, *, W_max: float, n_max: int = 10_000, rel_tol: float = DEFAULT_REL_TOL
) -> TransitionLoads:
    """Find the loads up to a largest load at which a further ridge, or pair of ridges, is reached.

    Parameters
    ----------
    profile : Profile
        Rigid profile.
    W_max : float
        Largest load.
    n_max : int, optional
        Largest number of events.
    rel_tol : float, optional
        Required relative error of each load.

    Returns
    -------
    TransitionLoads
        Ridges that are touched from the smallest load on have no event. Each event of a mirrored
        profile is a pair of ridges.

    Notes
    -----
    *Cost.* As for `all_events`. Once a floor may be touched, each event takes a `solve_contact`.
    """
    if profile.corner < rel_tol * profile.a:  # the corner changes loads by less than corner/a
        profile = replace(profile, corner=0.0)
    row_events = all_events(profile, W_max=W_max, n_max=n_max + 1, rel_tol=rel_tol)
    low, *later = touch_order(profile, len(row_events.W) + 1).tolist()
    high, least = low, _MIN_LOAD_RATIO * min(W_max, profile.pitch**2)
    events: list[tuple[float, int, str]] = []
    for W, ridge in zip(row_events.W.tolist(), later, strict=True):
        low, high = min(low, ridge), max(high, ridge)
        if least < W <= W_max:
            events.append((W, _count(profile, low, high), "ok"))
    if row_events.why and math.isinf(profile.depth):
        events.append((math.nan, _count(profile, low, high + 1), row_events.why))
    elif row_events.why:
        W = float(row_events.W[-1]) if later else 0.0
        alone = _one_by_one(profile, W, low, high, W_max, rel_tol)
        events += itertools.islice(alone, n_max - len(events))
    loads, counts, status = zip(*events[:n_max], strict=True) if events else ((), (), ())
    return TransitionLoads(np.array(loads), np.array(counts, dtype=np.int64), status)


def _count(profile: Profile, low: int, high: int) -> int:
    """Return the number of ridges from `low` to `high`, with their mirror images."""
    if not profile.mirrored:
        return high - low + 1
    return 2 * high + (1 if abs(profile.offset) == 0.5 else 2)


def _one_by_one(
    profile: Profile, W: float, low: int, high: int, W_max: float, rel_tol: float
) -> Iterator[tuple[float, int, str]]:
    """Yield the events after load W, at which ridges `low` to `high` are touched; W = 0: none."""
    past: list[ContactSolution] = []
    status = "ok"
    if W == 0.0:
        smallest = _smallest(profile, W_max, rel_tol)
        first = [segment.ridge for segment in smallest.segments if segment.ridge is not None]
        # If only a floor is touched, the ridges beside it, -1 and 0, are reached next.
        low, high = min(first, default=0), max(first, default=-1)
        W, status = smallest.W, smallest.status
    while status == "ok":
        # Next ridge on the right, and on the left if the profile is not mirrored.
        sides = (high + 1,) if profile.mirrored else (high + 1, low - 1)
        ahead, touched = [profile.ridge(number) for number in sides], range(low, high + 1)
        guess, ends = (W, past[-1].covered if past else {})
        if len(past) >= 2 * len(sides):
            guess, ends = _expected(profile, past[-len(sides)], past[-2 * len(sides)])
        last = solve_contact(
            profile, guess, rel_tol=rel_tol, start=ends, ridges=touched, ahead=ahead
        )
        past.append(last)
        status = last.status
        if status == "ok":
            W = last.W
            if W_max < W:
                return
            ridge = sides[int(np.argmin(last.nearest_gaps(ahead)[1]))]
            low, high = min(low, ridge), max(high, ridge)
            yield W, _count(profile, low, high), status
    yield math.nan, _count(profile, low, high + 1), status


def _expected(
    profile: Profile, last: ContactSolution, before: ContactSolution
) -> tuple[float, dict[RigidSegment, tuple[float, float]]]:
    """Return the expected load and ends of contact when each side has reached a further ridge.

    From `before` to `last` each side reached one as well. With each ridge the contact grows like
    that of the inner neighbour before, and the root of the load by a constant.
    """
    near, far = last.covered, before.covered
    numbers = [profile.ridge_before(segment) for segment in near]
    expected = {}
    for number in range(min(numbers) - 1, max(numbers) + 2):
        inner_number = number - 1 if number > 0 else number + 1 if number < -1 else number
        for kind in (profile.ridge, profile.floor_after):
            segment, inner = kind(number), kind(inner_number)
            if segment in near:
                low, high = near[segment]
                before_low, before_high = far.get(inner, near[inner])
                # Contact grows, on a floor to a tenth of the way from the walls: an end at a wall
                # would start as one at a corner.
                most = 0.9 if segment.ridge is None else 1.0
                low_growth = min(
                    max(before_low - near[inner][0], 0.0), most * (low - segment.start)
                )
                high_growth = min(
                    max(near[inner][1] - before_high, 0.0), most * (segment.stop - high)
                )
                expected[segment] = low - low_growth, high + high_growth
            elif inner in near:
                low, high = near[inner]
                shift = segment.start - inner.start
                expected[segment] = low + shift, high + shift
    return (2 * math.sqrt(last.W) - math.sqrt(before.W)) ** 2, expected


def _smallest(profile: Profile, W_max: float, rel_tol: float) -> ContactSolution:
    """Return the contact under the smallest load that can be solved."""
    largest = min(W_max, profile.pitch**2)
    W = _MIN_LOAD_RATIO * largest
    # With round corners the contact may be too small for floating-point numbers.
    while (smallest := solve_contact(profile, W, rel_tol=rel_tol)).status != "ok" and largest > W:
        W *= 10
    return smallest
