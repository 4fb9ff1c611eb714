"""Loads and widths at which a goal that no texture meets would be met."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy import optimize

from ridgebayes._types import Json
from ridgebayes.contact.scaling import Texture
from ridgebayes.table.columns import LARGEST_WIDTH, LEAST_WIDTH
from ridgebayes.texture_design.bodies import Tolerance
from ridgebayes.texture_design.goal_values import GoalValues
from ridgebayes.texture_design.goals import Case, Goal, Load


def textures_in(rows: pd.DataFrame) -> list[Texture]:
    """Return the textures (widths over R) of the rows of a map."""
    return list(zip(rows["a_over_R"].tolist(), rows["b_over_R"].tolist(), strict=True))


class Limits:
    """Factors by which loads or widths have to change to meet goals.

    Parameters
    ----------
    values : GoalValues
        Values of goals.
    goals : sequence of Goal
        Goals that no texture meets.
    p_over_E : sequence of float
        Loads of the goals, at the scene's medians.
    largest : float
        Largest load p/E considered.

    Notes
    -----
    Counts to reach bound the load factor from below, and counts to stay below bound it from above.
    The probability of a goal is largest between the two bounds, which follow from mean log loads.
    The factor that just meets the goal lies between the factor of the largest probability and 1.
    The width factor is the load factor to the power of -1/2, except for tolerances in length.
    """

    def __init__(
        self, values: GoalValues, goals: Sequence[Goal], p_over_E: Sequence[float], largest: float
    ) -> None:
        self._values, self._goals, self._largest = values, goals, largest
        self._p_over_E = min(p_over_E), max(p_over_E)
        self._part = max(values.parts, key=lambda part: part.weight)
        # The smallest load of each count to reach, and the largest of each count to stay below.
        self._reach = dict(sorted(self._mean_log_loads("at_least"), reverse=True))
        self._stay_below = dict(sorted(self._mean_log_loads("below")))

    def nearest(self, rows: pd.DataFrame) -> int:
        """Return the row of the texture whose loads have to change least, or the best such row."""
        factors = map(self._log_factors, textures_in(rows))
        change = [max(low, -high, 0.0) for low, high in factors]
        least = list(zip(change, -rows["margin"], strict=True))
        return least.index(min(least))

    def at(self, row: Json, tolerance: Tolerance) -> Json:
        """Return load_factor and width_factor at a texture (or None), and why, a sentence."""
        texture = float(row["a_over_R"]), float(row["b_over_R"])
        load, widths = self.of_loads(texture), self.of_widths(texture, tolerance)
        goal = self._goals[int(row.get("goal", 1)) - 1]
        extreme = "sd of Q is at least" if goal.is_spread else "largest probability found is"
        why = f"The {extreme} {row['probability']:.4g}, and {goal.level:.4g} was asked for."
        changes = []
        if load is not None:
            p = " to ".join(f"{load * p:.3g}" for p in dict.fromkeys(self._p_over_E))
            changes.append(f"{load:.3g} times the load (p/E {p})")
        if widths is not None:
            a, b = (widths * width for width in texture)
            changes.append(f"{widths:.3g} times both widths (a/R {a:.3g}, b/R {b:.3g})")
        met = f"no load to p/E {self._largest:g} and no other pitch would do"
        met = f"the goal would be met with {', or '.join(changes)}" if changes else met
        why += f" At a/R {texture[0]:.4g}, b/R {texture[1]:.4g} {met}."
        return {"load_factor": load, "width_factor": widths, "why": why}

    def of_loads(self, texture: Texture) -> float | None:
        """Return the factor of all loads that just meets the goals at a texture."""
        low, high = self._log_factors(texture)

        def margin(log_factor: float) -> float:
            scaled = [_scaled(goal, math.exp(log_factor)) for goal in self._goals]
            return self._margin(scaled, texture)

        bounds = 2 * math.log(LEAST_WIDTH), math.log(self._largest / self._p_over_E[1])
        return _root(margin, low, high, bounds)

    def of_widths(self, texture: Texture, tolerance: Tolerance) -> float | None:
        """Return the factor of both widths that just meets the goals."""
        a, b = texture
        low, high = (-0.5 * log_factor for log_factor in reversed(self._log_factors(texture)))
        least = max(LEAST_WIDTH, tolerance.least_width) / min(texture)

        def margin(log_factor: float) -> float:
            factor = math.exp(log_factor)
            return self._margin(self._goals, (factor * a, factor * b))

        bounds = math.log(least), math.log(LARGEST_WIDTH / max(texture))
        return _root(margin, low, high, bounds)

    def _mean_log_loads(self, kind: str) -> Iterator[tuple[int, float]]:
        for case in (case for goal in self._goals for case in goal.cases):
            for n, load in getattr(case, kind):
                yield n, float(self._part.log_p(load).mean())

    def _margin(self, goals: Sequence[Goal], texture: Texture) -> float:
        return min(goal.margin(self._values.at(goal, *texture).value) for goal in goals)

    def _log_factors(self, texture: Texture) -> tuple[float, float]:
        """Return the log load factors between which all counts are met, on average."""

        def at(count: int) -> float:
            if count <= 2:
                return -math.inf
            a, b = texture
            location, _ = self._part.loads.at_count(count, slice(None), a / (a + b))
            return float(location.mean()) + 2 * math.log(a + b)

        low = max((at(n) - log_p for n, log_p in self._reach.items()), default=-math.inf)
        high = [at(n) - log_p for n, log_p in self._stay_below.items()]
        high += [0.0 for goal in self._goals if goal.is_spread]  # sd(Q) falls with the load
        return low, min(high, default=math.inf)


def _root(
    margin: Callable[[float], float], low: float, high: float, bounds: tuple[float, float]
) -> float | None:
    """Return the factor between the largest margin and 1 at which a margin is 0; None if none."""
    ends = np.clip(sorted((low, high)), *bounds)
    best = optimize.minimize_scalar(lambda x: -margin(x), bounds=ends, method="bounded").x
    return None if margin(best) < 0 else math.exp(optimize.brentq(margin, best, 0.0))


def _scaled(goal: Goal, factor: float) -> Goal:
    """Return a goal at loads multiplied by a factor."""

    def moved(pairs: Sequence[tuple[int, Load]]) -> tuple[tuple[int, Load], ...]:
        return tuple((n, replace(load, value=factor * load.value)) for n, load in pairs)

    cases = tuple(Case(moved(case.at_least), moved(case.below)) for case in goal.cases)
    return replace(goal, cases=cases)
