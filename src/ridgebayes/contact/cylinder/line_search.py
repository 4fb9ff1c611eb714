"""How far to go along a Newton step.

Where the rim snaps past a corner the potential is far from a parabola: a whole step leads beyond
the valley, or a small part of the way down. The search looks at the slope of the potential along
the step, which is the residual's work; the slope has to fall, not to vanish.
"""

import math
from collections.abc import Callable

_ENOUGH = 0.5  # of the first slope: the next step corrects a smaller one
_MOST = 8  # slopes, each a seventh of a Newton step's time
_LEAST, _LARGEST = 0.1, 0.9  # of an interval, where the slope's chord has its zero
_GROWTH = (1.5, 4.0)


def best_part(slope: Callable[[float], float]) -> float:
    """Return the part of a step, 1 being all of it, at which the slope has all but vanished.

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
    low, at_low, high, at_high = 0.0, first, math.inf, math.inf
    part = 1.0
    for _ in range(_MOST):
        value = slope(part)
        if abs(value) <= _ENOUGH * -first:
            return part
        if value < 0:
            low, at_low = part, value
        else:
            high, at_high = part, value
        if math.isinf(high):
            chord = first / (first - value) if value > first else math.inf
            part *= min(max(chord, _GROWTH[0]), _GROWTH[1])
        else:
            share = at_low / (at_low - at_high)
            part = low + (high - low) * min(max(share, _LEAST), _LARGEST)
    return 0.0
