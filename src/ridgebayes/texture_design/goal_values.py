"""Values of goals at textures: exact given all that is drawn but the error of a load.

Given coefficients, body and widths, a load is reached with the probability that the error model
gives. This probability is averaged over the same draws at every texture: the error is
smaller than that of counts, and differences between textures are surer than values.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import special

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import reduced_load
from ridgebayes.errors import InputError
from ridgebayes.predict.posterior_loads import widest_count
from ridgebayes.texture_design.bodies import Bodies
from ridgebayes.texture_design.drawn_loads import DrawnLoads
from ridgebayes.texture_design.goals import MOST_COUNT, Case, Goal, Load

N_DRAW = 16_384  # of all that is uncertain, shared out by weight
_LEAST_DRAWS = 512
_NEGLIGIBLE = 1e-7
Corner = tuple[float, float]


@dataclass(frozen=True)
class Value:
    """The value of a goal at a texture: a probability, or a standard deviation of Q.

    Parameters
    ----------
    value, se : float
        The worst of its cases and corners, and its standard error.
    case : Case
        That case.
    corner : (float, float)
        That corner, see `Tolerance.corners`.
    """

    value: float
    se: float
    case: Case
    corner: Corner


@dataclass(frozen=True, eq=False)
class PosteriorDraws:
    """Draws of one posterior, each with a body.

    Parameters
    ----------
    loads : DrawnLoads
        Loads of the posterior's draws.
    weight : float
        Weight of the posterior.
    which : ndarray of int, shape (n,)
        Draws of the posterior.
    bodies : Bodies
        Bodies, one for each draw.
    """

    loads: DrawnLoads
    weight: float
    which: IntArray
    bodies: Bodies
    _log_p: dict[Load, FloatArray] = field(default_factory=dict)

    def log_p(self, load: Load) -> FloatArray:
        """Return the log of the load at nu = 0.5 of each draw."""
        if load not in self._log_p:
            p = load.p_over_E(self.bodies.units)
            self._log_p[load] = np.log(reduced_load(p, self.bodies.nu))
        return self._log_p[load]


class PlacedDraws:
    """A part at one texture.

    Parameters
    ----------
    part : PosteriorDraws
        The part.
    a, b : float
        Texture.
    corner : (float, float)
        See `Tolerance.corners`.
    """

    def __init__(self, part: PosteriorDraws, a: float, b: float, corner: Corner) -> None:
        self._part = part
        calibrated = part.loads.fit.model.data.textures
        self._texture = (a, b) if part.bodies.is_certain and (a, b) in calibrated else None
        wide, groove = part.bodies.widths(a, b, corner)
        pitch = wide + groove
        self._ratio = wide / pitch
        self._log_area = 0.0 if self._texture else 2 * np.log(pitch)
        self._last: FloatArray | None = None
        if not part.loads.has_mean:  # Student tails leave some to any count: up to the whole width
            self._last = widest_count(wide, groove)
        self._known: dict[int, tuple[FloatArray, FloatArray]] = {}

    def threshold(self, count: int, load: Load) -> FloatArray:
        """Return the error, in scales, up to which the count is reached by the load."""
        if count <= 2:
            return np.full(len(self._part.which), np.inf)
        if count not in self._known:
            loads, which = self._part.loads, self._part.which
            if self._texture:
                location, scale = loads.at_calibrated(self._texture, count)
                self._known[count] = location[which], scale[which]
            else:
                self._known[count] = loads.at(count, which, self._ratio)
        location, scale = self._known[count]
        t = (self._part.log_p(load) - self._log_area - location) / scale
        return t if self._last is None else np.where(count <= self._last, t, -np.inf)

    def window(self, case: Case) -> tuple[FloatArray | None, FloatArray | None]:
        """Return between which errors the case happens; None for no bound."""
        above = [self.threshold(*bound) for bound in case.below]
        below = [self.threshold(*bound) for bound in case.at_least]
        low = np.maximum.reduce(above) if above else None
        return low, np.minimum.reduce(below) if below else None

    def probability(self, case: Case) -> FloatArray:
        """Return the probability of a case of each draw, shape (n,)."""
        low, high = self.window(case)
        upper = 1.0 if high is None else special.ndtr(high)
        lower = 0.0 if low is None else special.ndtr(low)
        return np.asarray(np.maximum(upper - lower, 0.0))

    def reached(self, load: Load) -> Iterator[tuple[int, FloatArray]]:
        """Yield counts from 4 on, and the probability of each draw to reach them."""
        for count in range(4, MOST_COUNT + 2, 2):
            share: FloatArray = special.ndtr(self.threshold(count, load))
            if share.mean() < _NEGLIGIBLE:
                return
            yield count, share
        raise InputError(f"load: expected counts up to {MOST_COUNT}, got more")


class GoalValues:
    """Values of goals at textures, over the same draws at all of them.

    Parameters
    ----------
    loads : sequence of (DrawnLoads, float)
        Loads of each posterior's draws, and its weight; weights sum to 1.
    draw_bodies : callable
        Draws of bodies, from their number.
    n : int
        Draws, shared out by weight.
    """

    def __init__(
        self,
        loads: Sequence[tuple[DrawnLoads, float]],
        draw_bodies: Callable[[int], Bodies],
        n: int,
    ) -> None:
        sizes = [max(round(n * weight), _LEAST_DRAWS) for _, weight in loads]
        bodies = draw_bodies(sum(sizes))
        self.corners = bodies.tolerance.corners
        self.parts, first = [], 0
        for (drawn, weight), size in zip(loads, sizes, strict=True):
            # Bodies are in no order, so draws of the posterior go with any.
            which = np.arange(size) * max(drawn.n_draw // size, 1) % drawn.n_draw
            some = bodies.some(slice(first, first + size))
            self.parts.append(PosteriorDraws(drawn, weight, which, some))
            first += size

    def at(self, goal: Goal, a: float, b: float) -> Value:
        """Return the value of a goal at a texture: the worst of its cases and corners."""
        values = []
        for corner in self.corners:
            placed = [PlacedDraws(part, a, b, corner) for part in self.parts]
            for case in goal.cases:
                if goal.is_spread:
                    value_and_se = self._spread(placed, case)
                else:
                    value_and_se = self._average([part.probability(case) for part in placed])
                values.append(Value(*value_and_se, case, corner))
        return min(values, key=lambda candidate: goal.margin(candidate.value))

    def _spread(self, placed: Sequence[PlacedDraws], case: Case) -> tuple[float, float]:
        """Return the standard deviation of Q, and its error by its influence function."""
        ((_, load),) = case.at_least
        firsts, squares = [], []
        for part, at_texture in zip(self.parts, placed, strict=True):
            first, square = np.full(len(part.which), 2.0), np.full(len(part.which), 4.0)
            for n, reached in at_texture.reached(load):
                first, square = first + 2 * reached, square + (4 * n - 4) * reached
            firsts.append(first)
            squares.append(square)
        mean = self._average(firsts)[0]
        centred = zip(squares, firsts, strict=True)
        variance, se = self._average([s - 2 * mean * f + mean**2 for s, f in centred])
        sd = float(np.sqrt(max(variance, 0.0)))
        return sd, se / (2 * sd) if sd else 0.0

    def _average(self, values: Sequence[FloatArray]) -> tuple[float, float]:
        """Return the weighted mean of the parts' means, and its standard error."""
        weights = [part.weight for part in self.parts]
        pairs = list(zip(weights, values, strict=True))
        mean = sum(w * float(v.mean()) for w, v in pairs)
        return mean, float(np.sqrt(sum(w * w * float(v.var()) / len(v) for w, v in pairs)))
