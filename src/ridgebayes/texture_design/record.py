"""`Design`: the record of the textures that meet a goal, and of the recommended texture."""

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pandas as pd

from ridgebayes import drawing
from ridgebayes._types import Json, Tabular
from ridgebayes.predict.extrapolation import NAMES
from ridgebayes.texture_design.goals import Goal

if TYPE_CHECKING:  # heavy
    from matplotlib.axes import Axes

DESIGN_COLUMNS = {  # columns of `designs`, and their meaning
    "a_over_R": "ridge width over the radius",
    "b_over_R": "groove width over the radius",
    "probability": "of the goal with the smallest margin; for a bound on the spread, `sd(Q)`",
    "probability_se": "its standard error",
    "feasible": "whether all goals are met",
    "extrapolation": "whether a quantity is beyond the calibrated range",
    "extrapolation_of": f"these quantities, some of {', '.join(NAMES)}",
    "margin": "probability minus its level; for a bound on the spread, its unused share",
    "goal": "number of the goal with the least margin, where there are several",
}


@dataclass(frozen=True, eq=False, repr=False)
class Design(Tabular):
    """Textures that meet a goal, and the recommended one.

    Parameters
    ----------
    goals : tuple of Goal
        Goals as requested.
    objective : str
        Criterion of the recommendation.
    designs : pandas.DataFrame
        One row per texture, with the columns of `ridgebayes.texture_design.record.DESIGN_COLUMNS`.
    best : dict
        The recommended row. If no texture meets the goals, the nearest row: among the textures with
        the largest margin, the texture whose loads have to change least.
    check : dict
        n, probability and se of an independent run of draws at the texture of `best`, and the goal.
    limits : dict or None
        If no texture meets the goals, load_factor and width_factor that would meet them at the
        nearest texture (None if no factor would), and why, a sentence.
    shares : pandas.DataFrame
        Sobol indices at the texture of `best`; see `texture_design.sensitivity`.
    measure : pandas.DataFrame
        Effect of knowing one source better: exactly, or with half its spread.
    simulate_next : pandas.DataFrame
        Textures, ranked by how well a simulation discriminates between the two leading forms.
    options : dict
        Bounds, step, loads, tolerance, averaged forms and error models, seed and version.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> scene = rb.Scene.of([(0.022, 0.02)], p_over_E=0.01)
    >>> result = rb.design(fit, scene, "P(Q >= 8) >= 0.95", sizes={"step": 0.004})
    >>> result.feasible, result.recommended["a_over_R"], result.recommended["b_over_R"]
    (True, 0.012, 0.028)
    >>> result.shown, len(result.to_dataframe()), result.plot().get_xlabel()
    ('probability', 110, 'ridge width $a/R$')
    >>> result.conditions
    'At p/E 0.01, with widths made exactly, averaged over hybrid and one error model.'
    >>> json.loads(result.to_json()) == result.to_dict()
    True
    """

    goals: tuple[Goal, ...]
    objective: str
    designs: pd.DataFrame
    best: Json
    check: Json
    limits: Json | None
    shares: pd.DataFrame
    measure: pd.DataFrame
    simulate_next: pd.DataFrame
    options: Json

    def __repr__(self) -> str:
        texts = " and ".join(goal.text for goal in self.goals)
        row, word = self.best, "recommended" if self.feasible else "nearest"
        place = f"a/R {row['a_over_R']:.4g}, b/R {row['b_over_R']:.4g}"
        summary = f"{self.designs['feasible'].sum()} of {len(self.designs)} textures"
        return f"Design({texts}: {summary}; {word} {place}, margin {row['margin']:.3g})"

    @property
    def feasible(self) -> bool:
        """Whether any texture meets the goals."""
        return bool(self.designs["feasible"].any())

    @property
    def recommended(self) -> Json | None:
        """The row of the recommended texture; None where no texture meets the goals."""
        return self.best if self.feasible else None

    @property
    def shown(self) -> str:
        """Quantity on the map: the probability, the sd of Q, or the margin for several goals."""
        if len(self.goals) > 1:
            return "margin"
        return "sd of $Q$" if self.goals[0].is_spread else "probability"

    @property
    def conditions(self) -> str:
        """Conditions of the goals in one sentence: loads, tolerance, forms and error models.

        p/E is at the scene's medians.
        """
        loads = [load["p_over_E"] for load in self.options["loads"]]
        several = f" to {max(loads):.3g} ({len(loads)} loads)" if len(loads) > 1 else ""
        tolerance, kind = self.options["tolerance"], "made exactly"
        if self.options.get("uncertain_widths"):
            kind = "that vary as in the scene"
        if size := tolerance["size"]:
            number = f"{size:.2g} R" if tolerance["is_length"] else f"{100 * size:.3g} %"
            worst = tolerance["is_worst"]
            kind = f"made to {'within' if worst else 'a standard deviation of'} {number}"
        forms = list(dict.fromkeys(form for form, _, _ in self.options["averaged"]))
        n_pair = len(self.options["averaged"])
        error_models = "their error models" if n_pair > 1 else "one error model"
        return (
            f"At p/E {min(loads):.3g}{several}, with widths {kind}, averaged over "
            f"{' and '.join(forms)} and {error_models}."
        )

    def to_dataframe(self) -> pd.DataFrame:
        """Return the textures as a table.

        Returns
        -------
        pandas.DataFrame
            A copy of `designs`.
        """
        return self.designs.copy()

    def to_dict(self) -> Json:
        """Return all but the map as plain values, as in design.json.

        Returns
        -------
        dict
            goals, feasible, recommended (a row, or None), best, objective, check, limits, shares,
            measure, simulate_next, options.
        """
        plain = ("feasible", "recommended", "best", "objective", "check", "limits")
        return {
            "goals": [goal.text for goal in self.goals],
            **{name: getattr(self, name) for name in plain},
            "shares": _rows(self.shares),
            "measure": _rows(self.measure),
            "simulate_next": _rows(self.simulate_next.head(5)),
            "options": self.options,
        }

    def to_json(self) -> str:
        """Return `to_dict` as JSON.

        Returns
        -------
        str
            Indented text.
        """
        return json.dumps(self.to_dict(), indent=2) + "\n"

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the probability over ridge and groove width, and the recommended texture.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; those of a new figure if not given.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on. The bold line encloses feasible textures; extrapolation is
            grey.
        """
        best = (self.best["a_over_R"], self.best["b_over_R"])
        axes = drawing.records.axes_or_new(ax)
        drawing.designs.draw_designs(axes, self.designs, best, self.shown, is_met=self.feasible)
        return axes


def _rows(frame: pd.DataFrame) -> list[Json]:
    """Return rows of plain values; missing estimates are None."""
    rows = frame.astype(object).where(frame.notna(), None).to_dict("records")
    return [{str(name): value for name, value in row.items()} for row in rows]
