"""Values of goals at textures.

Given coefficients, body and widths, the error model gives the exact probability that a count is
reached. Values average this probability over draws, which has a smaller error than drawn counts.
All textures share the draws, so differences between textures are more accurate than values.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import special

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import reduced_load
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.predict.joint_draws import RatioLoads
from ridgebayes.predict.posterior_loads import PosteriorLoads, widest_count
from ridgebayes.predict.q_distribution import shares
from ridgebayes.texture_design.bodies import Bodies
from ridgebayes.texture_design.goals import MOST_COUNT, Case, Goal, Load

N_DRAW = 16_384  # draws, divided among posteriors by weight
_MIN_DRAWS = 512  # of each posterior
_NEGLIGIBLE_P = 1e-7  # mean probability of a count at which sums over counts end
Corner = tuple[float, float]


@dataclass(frozen=True)
class Value:
    """The value of a goal at a texture: a probability, or a standard deviation of Q.

    Parameters
    ----------
    value, se : float
        Value at the worst case and corner, and its standard error.
    case : Case
        The worst case.
    corner : (float, float)
        The worst corner; see `Tolerance.corners`.
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
    loads : RatioLoads
        Loads of the posterior's draws.
    weight : float
        Weight of the posterior.
    which : ndarray of int, shape (n,)
        Indices of the posterior's draws.
    bodies : Bodies
        Bodies, one for each draw.
    """

    loads: RatioLoads
    weight: float
    which: IntArray
    bodies: Bodies
    _log_p: dict[Load, FloatArray] = field(default_factory=dict)

    def log_p(self, load: Load) -> FloatArray:
        """Return the log load of each draw, converted to nu = 0.5."""
        if load not in self._log_p:
            p = load.p_over_E(self.bodies.units)
            self._log_p[load] = np.log(reduced_load(p, self.bodies.nu))
        return self._log_p[load]


class PlacedDraws:
    """Draws of one posterior at one texture.

    Parameters
    ----------
    part : PosteriorDraws
        Draws of the posterior.
    a, b : float
        Ridge and groove width over R.
    corner : (float, float)
        Corner of the tolerance; see `Tolerance.corners`.
    """

    def __init__(self, part: PosteriorDraws, a: float, b: float, corner: Corner) -> None:
        self._part = part
        calibrated = part.loads.loads.fit.model.data.textures
        self._texture = (a, b) if part.bodies.is_certain and (a, b) in calibrated else None
        wide, groove = part.bodies.widths(a, b, corner)
        pitch = wide + groove
        self._ratio = wide / pitch
        self._log_area = 0.0 if self._texture else 2 * np.log(pitch)
        self._max_count: FloatArray | None = None
        if not part.loads.loads.has_mean:  # Student tails reach every count: the width limits it
            self._max_count = widest_count(wide, groove)
        self._cache: dict[int, tuple[FloatArray, FloatArray]] = {}

    def threshold(self, count: int, load: Load) -> FloatArray:
        """Return the largest error, over its scale, at which the load reaches the count."""
        if count <= 2:
            return np.full(len(self._part.which), np.inf)
        if count not in self._cache:
            loads, which = self._part.loads, self._part.which
            if self._texture:
                location, scale = loads.loads.at(self._texture, np.array([count]))
                self._cache[count] = location[which, 0], scale[which, 0]
            else:
                self._cache[count] = loads.at_count(count, which, self._ratio)
        location, scale = self._cache[count]
        with np.errstate(over="ignore"):  # infinite where a draw has hardly any error
            t = (self._part.log_p(load) - self._log_area - location) / scale
        return t if self._max_count is None else np.where(count <= self._max_count, t, -np.inf)

    def window(self, case: Case) -> tuple[FloatArray, FloatArray]:
        """Return the errors between which the case happens; infinite for no bound."""
        no_bound = np.full(len(self._part.which), np.inf)
        above = [self.threshold(*bound) for bound in case.below]
        below = [self.threshold(*bound) for bound in case.at_least]
        return np.maximum.reduce([-no_bound, *above]), np.minimum.reduce([no_bound, *below])

    def probability(self, case: Case) -> FloatArray:
        """Return the probability of a case for each draw, shape (n,)."""
        low, high = self.window(case)
        return np.asarray(np.maximum(special.ndtr(high) - special.ndtr(low), 0.0))

    def reached(self, load: Load) -> Iterator[tuple[int, FloatArray]]:
        """Yield counts from 4 on, and the probability that each draw reaches them."""
        for count in range(4, MOST_COUNT + 2, 2):
            share: FloatArray = special.ndtr(self.threshold(count, load))
            if share.mean() < _NEGLIGIBLE_P:
                return
            yield count, share
        raise InputError(f"load: expected counts up to {MOST_COUNT}, got more")


def ratio_loads(
    averaged: Sequence[tuple[Posterior, float]], ratios: tuple[float, float]
) -> list[tuple[RatioLoads, float]]:
    """Return the loads of posteriors for a range of a/pitch, with weights that sum to 1."""
    weights = shares([weight for _, weight in averaged]).tolist()
    loads = [RatioLoads(PosteriorLoads(fit), *ratios) for fit, _ in averaged]
    return list(zip(loads, weights, strict=True))


class GoalValues:
    """Values of goals at textures, from the same draws for all textures.

    Parameters
    ----------
    loads : sequence of (RatioLoads, float)
        Loads of each posterior's draws, and its weight; weights sum to 1.
    draw_bodies : callable
        Function that draws a number of bodies.
    n : int
        Number of draws, divided among posteriors by weight.
    """

    def __init__(
        self,
        loads: Sequence[tuple[RatioLoads, float]],
        draw_bodies: Callable[[int], Bodies],
        n: int,
    ) -> None:
        sizes = [max(round(n * weight), _MIN_DRAWS) for _, weight in loads]
        bodies = draw_bodies(sum(sizes))
        self.corners = bodies.tolerance.corners
        self.parts, first = [], 0
        for (drawn, weight), size in zip(loads, sizes, strict=True):
            # Bodies are independent draws, so the posterior's draws may stay in order.
            n_draw = len(drawn.loads)
            which = np.arange(size) * max(n_draw // size, 1) % n_draw
            subset = bodies.subset(slice(first, first + size))
            self.parts.append(PosteriorDraws(drawn, weight, which, subset))
            first += size

    def at(self, goal: Goal, a: float, b: float) -> Value:
        """Return the value of a goal at a texture, for the worst case and corner."""
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
        """Return the standard deviation of Q, and its error from the influence function."""
        ((_, load),) = case.at_least
        moments = []  # E[Q] and E[Q^2] of the draws of each posterior
        for part, at_texture in zip(self.parts, placed, strict=True):
            first, square = np.full(len(part.which), 2.0), np.full(len(part.which), 4.0)
            for n, reached in at_texture.reached(load):
                first, square = first + 2 * reached, square + (4 * n - 4) * reached
            moments.append((first, square))
        mean, _ = self._average([first for first, _ in moments])
        variance, se = self._average([s - 2 * mean * f + mean**2 for f, s in moments])
        sd = float(np.sqrt(max(variance, 0.0)))
        return sd, se / (2 * sd) if sd else 0.0

    def _average(self, values: Sequence[FloatArray]) -> tuple[float, float]:
        """Return the weighted mean over posteriors, and its standard error."""
        pairs = [(part.weight, x) for part, x in zip(self.parts, values, strict=True)]
        mean = sum(w * float(v.mean()) for w, v in pairs)
        return mean, float(np.sqrt(sum(w * w * float(v.var()) / len(v) for w, v in pairs)))
