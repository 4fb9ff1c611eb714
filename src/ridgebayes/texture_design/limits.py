"""Limits of a goal that no texture meets: which load, or which widths, would do."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from ridgebayes._types import Json
from ridgebayes.contact import two_scale
from ridgebayes.contact.scaling import Texture
from ridgebayes.scene.scene import Scene
from ridgebayes.table.columns import LARGEST_WIDTH, LEAST_WIDTH
from ridgebayes.texture_design.bodies import Tolerance, median_units
from ridgebayes.texture_design.goal_values import GoalValues
from ridgebayes.texture_design.goals import Case, Goal, Load

_FACTORS = 1.25 ** np.arange(1, 17)  # to 36: further from all that was calibrated
_N_BISECTION = 10  # a factor is computed to 0.02 %
_MOST_TEXTURES = 32  # that are compared where the goal is equally far from many


class Limits:
    """The factors by which loads or widths have to change for a goal to be met.

    Parameters
    ----------
    values : GoalValues
        Values of goals.
    goals : sequence of Goal
        Goals that no texture meets.
    scene : Scene
        Scene of the design.
    """

    def __init__(self, values: GoalValues, goals: Sequence[Goal], scene: Scene) -> None:
        self._values, self._goals = values, goals
        units = median_units(scene)
        loads = [load for goal in goals for case in goal.cases for load in case.loads]
        p_over_E = [float(load.p_over_E(units)[0]) for load in loads]
        self.p_over_E = min(p_over_E), max(p_over_E)
        self.largest = two_scale.checked(scene.ogden)

    def nearest(self, rows: pd.DataFrame) -> tuple[int, float | None]:
        """Return the row of the texture whose loads have to change least, and their factor.

        Parameters
        ----------
        rows : pandas.DataFrame
            Textures whose margins are alike; at most 32 of them, evenly taken, are compared.
        """
        places = np.unique(np.linspace(0, len(rows) - 1, _MOST_TEXTURES).astype(int)).tolist()
        best_place = int(rows["margin"].to_numpy().argmax())
        places = list(dict.fromkeys([best_place, *places]))
        widths = rows[["a_over_R", "b_over_R"]].to_numpy()[places].tolist()
        textures = [(float(a), float(b)) for a, b in widths]
        for factors in _outward():
            found = [
                (self._at_loads(texture, factor), -i, factor)
                for factor in factors
                if self.p_over_E[1] * factor <= self.largest
                for i, texture in enumerate(textures)
            ]
            best = max(found, default=(-1.0, 0, 1.0))
            if best[0] >= 0:
                least = self._least(partial(self._at_loads, textures[-best[1]]), best[2])
                return places[-best[1]], least
        return places[0], None

    def of_widths(self, texture: Texture, tolerance: Tolerance) -> float | None:
        """Return the factor of both widths that is nearest to 1 and meets the goals."""
        a, b = texture
        least = tolerance.least_width

        def margin(factor: float) -> float:
            return self._margin(self._goals, (factor * a, factor * b))

        for factors in _outward():
            for factor in factors:
                is_width = max(LEAST_WIDTH, least) <= factor * min(texture)
                if is_width and factor * max(texture) <= LARGEST_WIDTH and margin(factor) >= 0:
                    return self._least(margin, factor)
        return None

    def _at_loads(self, texture: Texture, factor: float) -> float:
        return self._margin([_scaled(goal, factor) for goal in self._goals], texture)

    def _margin(self, goals: Sequence[Goal], texture: Texture) -> float:
        return min(goal.margin(self._values.at(goal, *texture).value) for goal in goals)

    def _least(self, margin: Callable[[float], float], factor: float) -> float:
        """Return the least change that will do, between a factor that does and one step less."""
        less = factor / _FACTORS[0] if factor > 1 else factor * _FACTORS[0]
        for _ in range(_N_BISECTION):
            middle = float(np.sqrt(less * factor))
            less, factor = (less, middle) if margin(middle) >= 0 else (middle, factor)
        return float(factor)


def limits(
    found: Limits, row: Json, goals: Sequence[Goal], load: float | None, tolerance: Tolerance
) -> Json:
    """Return what would do at the nearest texture, with a sentence on it.

    Parameters
    ----------
    found : Limits
        Limits of the goals.
    row : dict
        Row of the nearest texture.
    goals : sequence of Goal
        Goals.
    load : float or None
        Factor of its loads.
    tolerance : Tolerance
        Tolerance of the widths.

    Returns
    -------
    dict
        load_factor and width_factor (None where none was found) and why.
    """
    texture = float(row["a_over_R"]), float(row["b_over_R"])
    widths = found.of_widths(texture, tolerance)
    goal = goals[int(row.get("goal", 1)) - 1]
    told = "The sd of Q is at least" if goal.is_spread else "The largest probability found is"
    why = f"{told} {row['probability']:.3g}, and {goal.level:.3g} was asked for."
    would = []
    if load is not None:
        p = " to ".join(f"{load * one:.3g}" for one in dict.fromkeys(found.p_over_E))
        would.append(f"{load:.3g} times the load (p/E {p})")
    if widths is not None:
        a, b = (widths * one for one in texture)
        would.append(f"{widths:.3g} times both widths (a/R {a:.3g}, b/R {b:.3g})")
    place = f"a/R {texture[0]:.4g}, b/R {texture[1]:.4g}"
    if would:
        why += f" At {place} the goal would be met with {', or '.join(would)}."
    else:
        why += f" At {place} no load to p/E {found.largest:g} and no other pitch would do."
    return {"load_factor": load, "width_factor": widths, "why": why}


def _outward() -> Iterator[tuple[float, float]]:
    """Yield pairs of factors above and below 1, the nearest first."""
    for factor in _FACTORS.tolist():
        yield factor, 1 / factor


def _scaled(goal: Goal, factor: float) -> Goal:
    """Return a goal at loads multiplied by a factor."""

    def moved(pairs: Sequence[tuple[int, Load]]) -> tuple[tuple[int, Load], ...]:
        return tuple((n, replace(load, value=factor * load.value)) for n, load in pairs)

    cases = tuple(Case(moved(case.at_least), moved(case.below)) for case in goal.cases)
    return replace(goal, cases=cases)
