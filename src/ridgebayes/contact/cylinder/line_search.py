"""Line search along a Newton step.

Where the rim snaps past a corner, the potential is far from a parabola: a full step leads beyond
the valley, or only a small part of the way down. The search uses the slope of the potential along
the step, which is the work of the residual. The slope has to decrease, not to vanish.
"""

import math
from collections.abc import Callable

_MAX_SLOPE_SHARE = 0.5  # of the first slope; the next step corrects a smaller slope
_MAX_SLOPES = 8  # evaluations, each a seventh of the time of a Newton step


def best_part(slope: Callable[[float], float]) -> float:
    """Return the part of a step, 1 for a full step, at which the slope has nearly vanished.

    The part doubles until the slope changes sign, then its interval is halved.

    Parameters
    ----------
    slope : callable
        Slope of the potential along the step, at a part of the step; infinite if undefined.

    Returns
    -------
    float
        1 if a full step is good enough, or the step does not lead down. 0 if no such part is found
        because the slope jumps, for instance where the rim has folded.
    """
    first = slope(0.0)
    if not first < 0:
        return 1.0
    low, high, part = 0.0, math.inf, 1.0
    for _ in range(_MAX_SLOPES):
        value = slope(part)
        if abs(value) <= _MAX_SLOPE_SHARE * -first:
            return part
        low, high = (part, high) if value < 0 else (low, part)
        part = 2 * part if math.isinf(high) else 0.5 * (low + high)
    return 0.0
