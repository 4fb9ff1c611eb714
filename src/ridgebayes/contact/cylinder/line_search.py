"""How far to go along a Newton step.

Where the rim snaps past a corner the potential is far from a parabola: a whole step leads beyond
the valley, or a small part of the way down. The search looks at the slope of the potential along
the step, which is the residual's work; the slope has to fall, not to vanish.
"""

import math
from collections.abc import Callable

_ENOUGH = 0.5  # of the first slope: the next step corrects a smaller one
_MOST = 8  # slopes, each a seventh of a Newton step's time


def best_part(slope: Callable[[float], float]) -> float:
    """Return the part of a step, 1 being all of it, at which the slope has all but vanished.

    The part doubles until the slope changes sign, then its interval is halved.

    Parameters
    ----------
    slope : callable
        Slope of the potential along the step, at a part of the step; infinite where undefined.

    Returns
    -------
    float
        1 if that is good enough, or where the step does not lead down. 0 where no such part was
        found: the slope jumps, as where the rim has folded.
    """
    first = slope(0.0)
    if not first < 0:
        return 1.0
    low, high, part = 0.0, math.inf, 1.0
    for _ in range(_MOST):
        value = slope(part)
        if abs(value) <= _ENOUGH * -first:
            return part
        low, high = (part, high) if value < 0 else (low, part)
        part = 2 * part if math.isinf(high) else 0.5 * (low + high)
    return 0.0
