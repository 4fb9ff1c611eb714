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
from ridgebayes.contact.rigid_profile import Profile

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
    last = None
    if W == 0.0:
        last = _smallest(profile, W_max, rel_tol)
        first = [segment.ridge for segment in last.segments if segment.ridge is not None]
        # If only a floor is touched, the ridges beside it, -1 and 0, are reached next.
        low, high, W = min(first, default=0), max(first, default=-1), last.W
    status = "ok" if last is None else last.status
    while status == "ok":
        # Next ridge on the right, and on the left if the profile is not mirrored.
        sides = (high + 1,) if profile.mirrored else (high + 1, low - 1)
        ahead, touched = [profile.ridge(number) for number in sides], range(low, high + 1)
        last = solve_contact(profile, W, rel_tol=rel_tol, start=last, ridges=touched, ahead=ahead)
        status = last.status
        if status == "ok":
            W = last.W
            if W_max < W:
                return
            ridge = sides[int(np.argmin(last.nearest_gaps(ahead)[1]))]
            low, high = min(low, ridge), max(high, ridge)
            yield W, _count(profile, low, high), status
    yield math.nan, _count(profile, low, high + 1), status


def _smallest(profile: Profile, W_max: float, rel_tol: float) -> ContactSolution:
    """Return the contact under the smallest load that can be solved."""
    largest = min(W_max, profile.pitch**2)
    W = _MIN_LOAD_RATIO * largest
    # With round corners the contact may be too small for floating-point numbers.
    while (smallest := solve_contact(profile, W, rel_tol=rel_tol)).status != "ok" and largest > W:
        W *= 10
    return smallest
