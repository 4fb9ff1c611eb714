"""Loads at which contact reaches one ridge after another, for any profile: events, not steps.

The gap over a ridge that is not there yet falls as the load rises; where it vanishes is the load
that reaches it. No load increment enters.
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

_TINY = 1e-10  # of a load: about as small as rounding lets one be solved for


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
    profile: Profile, *, W_max: float, n_max: int = 10_000, rel_tol: float = DEFAULT_REL_TOL
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
    *Cost.* As for `all_events`; from where a floor may be touched `solve_contact` for each
    event.
    """
    if profile.corner < rel_tol * profile.a:  # loads change by less than the corner over a
        profile = replace(profile, corner=0.0)
    together = all_events(profile, W_max=W_max, n_max=n_max + 1, rel_tol=rel_tol)
    low, *later = touch_order(profile, len(together.W) + 1).tolist()
    high, least = low, _TINY * min(W_max, profile.pitch**2)
    events: list[tuple[float, int, str]] = []
    for W, ridge in zip(together.W.tolist(), later, strict=True):
        low, high = min(low, ridge), max(high, ridge)
        if least < W <= W_max:
            events.append((W, _count(profile, low, high), "ok"))
    if together.why and math.isinf(profile.depth):
        events.append((math.nan, _count(profile, low, high + 1), together.why))
    elif together.why:
        W = float(together.W[-1]) if later else 0.0
        alone = _one_by_one(profile, W, low, high, W_max, rel_tol)
        events += itertools.islice(alone, n_max - len(events))
    loads, counts, status = zip(*events[:n_max], strict=True) if events else ((), (), ())
    return TransitionLoads(np.array(loads), np.array(counts, dtype=np.int64), status)


def _count(profile: Profile, low: int, high: int) -> int:
    """Return how many ridges there are from one to another, mirror images included."""
    if not profile.mirrored:
        return high - low + 1
    return 2 * high + (1 if abs(profile.offset) == 0.5 else 2)


def _one_by_one(
    profile: Profile, W: float, low: int, high: int, W_max: float, rel_tol: float
) -> Iterator[tuple[float, int, str]]:
    """Yield the events after a load at which ridges from one to another are touched; 0 is none."""
    last = None
    if W == 0.0:
        last = _smallest(profile, W_max, rel_tol)
        first = [segment.ridge for segment in last.segments if segment.ridge is not None]
        # Where a floor alone is touched the ridges beside it, -1 and 0, are yet to be reached.
        low, high, W = min(first, default=0), max(first, default=-1), last.W
    status = "ok" if last is None else last.status
    while status == "ok":
        # To the right, and where the profile is no mirror image also to the left.
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
    """Return the contact under a load as small as can be solved for."""
    largest = min(W_max, profile.pitch**2)
    W = _TINY * largest
    # Round corners bear so little on a spot near rounding's size.
    while (smallest := solve_contact(profile, W, rel_tol=rel_tol)).status != "ok" and largest > W:
        W *= 10
    return smallest
