"""`design`: the textures that meet a goal under all uncertainties, the best of them, and why."""

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, Json, Rng, Tabular, __version__
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.contact.scaling import Texture
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.predict.extrapolation import CalibratedRange, names_of
from ridgebayes.predict.q_distribution import heavy_parts, shares
from ridgebayes.results import Fit
from ridgebayes.runtime.randomness import seed_of
from ridgebayes.scene.scene import Scene, as_scene
from ridgebayes.table.columns import LARGEST_WIDTH, LEAST_WIDTH
from ridgebayes.texture_design.bodies import Bodies, Tolerance
from ridgebayes.texture_design.drawn_check import drawn_check
from ridgebayes.texture_design.drawn_loads import DrawnLoads
from ridgebayes.texture_design.form_reliability import form_reliability
from ridgebayes.texture_design.goal_values import GoalValues, Value
from ridgebayes.texture_design.goals import LARGEST, Goal, Load, parse_goals, read_loads
from ridgebayes.texture_design.next_simulation import next_simulation
from ridgebayes.texture_design.sensitivity import Sources, sobol_shares, what_to_measure

if TYPE_CHECKING:  # heavy
    from matplotlib.axes import Axes


def _margin(rows: pd.DataFrame) -> pd.Series:
    return rows["margin"]


_OBJECTIVES = {
    "margin": _margin,
    "max-pitch": lambda row: row["a_over_R"] + row["b_over_R"],
    "min-pitch": lambda row: -row["a_over_R"] - row["b_over_R"],
    "max-ridge": lambda row: row["a_over_R"],
    "min-ridge": lambda row: -row["a_over_R"],
    "max-groove": lambda row: row["b_over_R"],
    "min-groove": lambda row: -row["b_over_R"],
    "min-load": _margin,  # at the smallest load at which any texture will do
}
_N_DRAW, _N_SPREAD, _N_PRECISE = 16_384, 4_096, 2**17
_PRECISE_ROUNDS, _PRECISE_SE = 8, 0.03
_N_CHECK = 100_000
_POINTS, _MOST_TEXTURES = 60, 40_000
_N_LOADS = 20  # of the objective min-load, where none are given
_ALIKE = 1e-4  # of margins
_SURE = 2.0  # standard errors by which a recommended texture lies inside


@dataclass(frozen=True, eq=False, repr=False)
class Design(Tabular):
    """Textures that meet a goal, and the recommended one.

    Parameters
    ----------
    goals : tuple of Goal
        What was asked for.
    objective : str
        By what the recommended one was chosen.
    designs : pandas.DataFrame
        A row a texture: a_over_R, b_over_R, probability (of the goal with the least margin; of a
        bound on the spread the standard deviation of Q), probability_se, feasible, extrapolation,
        extrapolation_of, margin, and goal (its number) where there are several.
    best : dict
        The row that is recommended, or, where no texture meets the goals, comes nearest to it.
    check : dict
        n, probability and se of an independent run of draws at that texture, and the goal.
    shares : pandas.DataFrame
        Sobol's indices there, see `texture_design.sensitivity`.
    measure : pandas.DataFrame
        What knowing one source exactly would do.
    form_reliability : dict
        beta, probability (of failure), trusted, and why not.
    simulate_next : pandas.DataFrame
        Textures by what a simulation would tell of the two leading forms.
    options : dict
        Bounds, step, tolerance, seed and version.
    """

    goals: tuple[Goal, ...]
    objective: str
    designs: pd.DataFrame
    best: Json
    check: Json
    shares: pd.DataFrame
    measure: pd.DataFrame
    form_reliability: Json
    simulate_next: pd.DataFrame
    options: Json

    def __repr__(self) -> str:
        told = " and ".join(goal.text for goal in self.goals)
        row, word = self.best, "recommended" if self.feasible else "nearest"
        place = f"a/R {row['a_over_R']:.4g}, b/R {row['b_over_R']:.4g}"
        n = int(self.designs["feasible"].sum())
        return (
            f"Design({told}: {n} of {len(self.designs)} textures; {word} {place}, "
            f"margin {row['margin']:.3g})"
        )

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
        """What the map shows: the probability, the sd of Q, or of several goals the margin."""
        if len(self.goals) > 1:
            return "margin"
        return "sd of $Q$" if self.goals[0].is_spread else "probability"

    def to_dataframe(self) -> pd.DataFrame:
        """Return the textures as a table.

        Returns
        -------
        pandas.DataFrame
            A copy of `designs`.
        """
        return self.designs.copy()

    def to_dict(self) -> Json:
        """Return all but the map as plain values, as design.json holds them.

        Returns
        -------
        dict
            goals, feasible, recommended (a row, or None), best, objective, check, shares, measure,
            form_reliability, simulate_next, options.
        """
        return {
            "goals": [goal.text for goal in self.goals],
            "feasible": self.feasible,
            "recommended": self.recommended,
            "best": self.best,
            "objective": self.objective,
            "check": self.check,
            "shares": self.shares.to_dict("records"),
            "form_reliability": self.form_reliability,
            "measure": self.measure.to_dict("records"),
            "simulate_next": self.simulate_next.head(5).to_dict("records"),
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
            Where to draw; a new figure's if not given.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on. The bold line bounds what is feasible; grey is extrapolation.
        """
        from ridgebayes.drawing import designs, records  # loads matplotlib

        best = (self.best["a_over_R"], self.best["b_over_R"])
        axes = records.axes_or_new(ax)
        designs.draw_designs(axes, self.designs, best, self.shown, is_met=self.feasible)
        return axes


def design(
    source: Fit | Comparison,
    scene: Scene | str | os.PathLike[str],
    goal: str | Sequence[str],
    *,
    sizes: Mapping[str, Any] | None = None,
    tolerance: str | Tolerance | None = None,
    loads: str | Sequence[float] | None = None,
    objective: str = "margin",
    rng: Rng = 0,
) -> Design:
    """Find the textures that meet a goal with the probability asked for, and recommend one.

    Parameters
    ----------
    source : Fit or Comparison
        Posterior; forms and error models are averaged by their weights.
    scene : Scene or path
        Body and load, whose values may be distributions. Distributions of the scene's widths are
        taken as those of widths as made, relative to what is asked for.
    goal : str or sequence of str
        Such as ``P(Q >= 8) >= 0.95``: see `ridgebayes.texture_design.goals` for what else.
    sizes : mapping, optional
        ``a`` and ``b``: bounds (low, high) over R, those up to which textures are not extrapolated
        if not given. ``step``: the sizes that can be made are its multiples, over R; a round number
        that gives some 60 widths if not given.
    tolerance : str or Tolerance, optional
        Of widths as made: ``5 %`` or a length over R, a standard deviation of each width (normal);
        ``worst 5 %``: bounds, of which the worst corner counts.
    loads : str or sequence of float, optional
        Loads p/E of goals that name none, the worst of which counts: LO:HI:N, or numbers. The
        scene's largest load if not given.
    objective : str, optional
        margin (of those that cannot be told apart the coarsest), max-pitch, min-pitch, max-ridge,
        min-ridge, max-groove, min-groove, or min-load: the smallest of the loads (20 steps to the
        scene's largest if not given) that will do.
    rng : int or numpy.random.Generator, optional
        Seed; the same seed gives the same design.

    Returns
    -------
    Design
        Map, recommended texture, check, and where the uncertainty comes from.

    Raises
    ------
    InputError
        If a goal does not parse or contradicts another, bounds or step are not positive and in
        order, the lattice has more than 40,000 textures, or the scene has several textures.
    ComputationError
        If a comparison has no form with an evidence.

    Notes
    -----
    Probabilities are over forms, error models, coefficients, body, load and widths as made. Given
    all of these but the error of the load, the probability is exact; it is averaged over 16,384
    draws, the same for every texture (4,096 for a bound on the spread).
    The recommended texture is inside the calibrated range where a feasible one is, and its
    probability is above the level by two standard errors where one is. It is then drawn anew,
    100,000 times, by what `friction_inputs` draws with.

    *Validity.* As `predict`; textures are new ones, but those calibrated on where widths, radius
    and their making are certain.

    *Cost.* Some 2 ms a texture and posterior.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> scene = rb.Scene.of([(0.022, 0.02)], p_over_E=0.01)
    >>> found = rb.design(
    ...     fit, scene, "P(Q >= 8) >= 0.95", sizes={"step": 0.002}, tolerance="5 %",
    ...     objective="max-pitch",
    ... )
    >>> found.recommended["feasible"], found.recommended["probability"] > 0.95
    (True, True)
    """
    scene, seed, made = as_scene(scene), seed_of(rng), Tolerance.parse(tolerance)
    if objective not in _OBJECTIVES:
        raise InputError(f"objective: expected one of {', '.join(_OBJECTIVES)}, got {objective!r}")
    alternatives = _alternatives(loads, objective)
    asked = [parse_goals(goal, some) for some in alternatives]
    averaged = source.averaged
    textures, about = _lattice(sizes or {}, [fit for fit, _ in averaged])
    made.check(min(min(texture) for texture in textures))
    draw = partial(Bodies.draw, scene, made)
    loads_of = _drawn_loads(averaged, draw(_N_DRAW, seed).ratios(textures))
    n = _N_SPREAD if any(one.is_spread for one in asked[0]) else _N_DRAW
    values = GoalValues(loads_of, lambda size: draw(size, seed), n)
    for goals in asked:
        designs = _map(values, goals, textures)
        _mark_extrapolation(designs, averaged, scene, goals)
        if designs["feasible"].any():
            break
    best = _chosen(designs, objective)
    texture = (float(best["a_over_R"]), float(best["b_over_R"]))
    tightest = goals[int(best.get("goal", 1)) - 1]
    value = values.at(tightest, *texture)
    sources = Sources(scene, made, loads_of, texture, value)
    about |= {"tolerance": vars(made), "seed": seed, "ridgebayes_version": __version__}
    if objective == "min-load":
        best["load"] = str(value.case.loads[0])
    return Design(
        goals,
        objective,
        designs,
        best,
        {
            "goal": tightest.text,
            **drawn_check(averaged, draw, tightest, texture, value, _N_CHECK, seed + 1),
        },
        *_why(sources, tightest, draw, seed),
        next_simulation(_leading(source), _inside(designs), seed),
        about,
    )


def _alternatives(loads: str | Sequence[float] | None, objective: str) -> list[tuple[Load, ...]]:
    """Return the loads of goals that name none; several of them for the smallest that will do."""
    if loads is None:
        found: tuple[Load, ...] = (LARGEST,)
        if objective == "min-load":
            found = tuple(Load(i / _N_LOADS, is_share=True) for i in range(1, _N_LOADS + 1))
    elif isinstance(loads, str):
        found = read_loads(loads, "loads")
    else:
        found = tuple(one for p in loads for one in read_loads(repr(float(p)), "loads"))
    if not found:
        raise InputError("loads: expected at least one, got none")
    return [(one,) for one in found] if objective == "min-load" else [found]


def _lattice(sizes: Mapping[str, Any], fits: Sequence[Posterior]) -> tuple[list[Texture], Json]:
    """Return the textures that can be made, within bounds, and what bounds and step are."""
    unknown = set(sizes) - {"a", "b", "step"}
    if unknown:
        raise InputError(f"sizes: expected a, b and step, got {sorted(unknown)[0]!r}")
    ranges = [CalibratedRange.of(fit) for fit in fits]
    calibrated = {"a": [one.ridge for one in ranges], "b": [one.groove for one in ranges]}
    bounds = {}
    for name, known in calibrated.items():
        low, high = sizes.get(name) or (
            max(one[0] for one in known) / 1.5,
            min(one[1] for one in known) * 1.5,
        )
        if not LEAST_WIDTH <= low <= high <= LARGEST_WIDTH:
            raise InputError(f"{name}: expected bounds 0 < LO <= HI over R, got {low:g}:{high:g}")
        bounds[name] = float(low), float(high)
    widest = max(high - low for low, high in bounds.values())
    step = sizes.get("step") or _round_step(widest / _POINTS)
    if not (0 < step < math.inf):
        raise InputError(f"step: expected above 0, got {step!r}")
    columns = []
    for name, (low, high) in bounds.items():
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        if last - first >= _MOST_TEXTURES:
            raise InputError(f"step: expected at most {_MOST_TEXTURES:,} textures; a larger step")
        widths = [float(f"{i * step:.12g}") for i in range(first, last + 1)]
        if not widths and low == high:
            widths = [low]
        if not widths:
            raise InputError(f"{name}: no multiple of the step {step:g} is within {low:g}:{high:g}")
        columns.append(widths)
    textures = [(a, b) for a in columns[0] for b in columns[1]]
    if len(textures) > _MOST_TEXTURES:
        raise InputError(
            f"step: expected at most {_MOST_TEXTURES:,} textures, got {len(textures):,}; "
            "a larger step, or closer bounds"
        )
    return textures, {"a": list(bounds["a"]), "b": list(bounds["b"]), "step": float(step)}


def _round_step(least: float) -> float:
    """Return the least of 1, 2, 5, 10, ... times a power of ten that is not below a number."""
    power = 10.0 ** math.floor(math.log10(max(least, LEAST_WIDTH)))
    return float(next(k * power for k in (1, 2, 5, 10) if k * power >= least * (1 - 1e-9)))


def _drawn_loads(
    averaged: Sequence[tuple[Posterior, float]], ratios: tuple[float, float]
) -> list[tuple[DrawnLoads, float]]:
    weights = shares([weight for _, weight in averaged]).tolist()
    return [
        (DrawnLoads(fit, *ratios), weight)
        for (fit, _), weight in zip(averaged, weights, strict=True)
    ]


def _map(values: GoalValues, goals: Sequence[Goal], textures: Sequence[Texture]) -> pd.DataFrame:
    """Return the value of the goal with the least margin at each texture."""
    rows = []
    for a, b in textures:
        found: list[tuple[float, int, Value]] = []
        for i, goal in enumerate(goals):
            value = values.at(goal, a, b)
            found.append((goal.margin(value.value), i, value))
        margin, i, value = min(found, key=lambda one: one[0])
        rows.append((a, b, value.value, value.se, margin >= 0, margin, i + 1))
    names = ["a_over_R", "b_over_R", "probability", "probability_se", "feasible", "margin", "goal"]
    frame = pd.DataFrame(rows, columns=names)
    return frame if len(goals) > 1 else frame.drop(columns="goal")


def _mark_extrapolation(
    designs: pd.DataFrame,
    averaged: Sequence[tuple[Posterior, float]],
    scene: Scene,
    goals: Sequence[Goal],
) -> None:
    """Add what lies beyond what was calibrated, as `predict` says it."""
    a, b = designs["a_over_R"].to_numpy(), designs["b_over_R"].to_numpy()
    flags = np.zeros(len(designs), dtype=np.uint8)
    cases = [case for goal in goals for case in goal.cases]
    counts = [n for case in cases for n, _ in (*case.at_least, *case.below)]
    median = np.array([scene.highest_load(scene.textures[0])])
    largest = max(load.p_over_E(median)[0] for case in cases for load in case.loads)
    weights = shares([weight for _, weight in averaged])
    for (fit, _), is_heavy in zip(averaged, heavy_parts(weights), strict=True):
        if is_heavy:
            known = CalibratedRange.of(fit)
            flags |= known.texture_flags(a, b)
            flags |= known.load_flags(largest, scene.nu) | known.count_flags(max(counts))
    place = designs.columns.to_list().index("feasible") + 1
    designs.insert(place, "extrapolation", flags != 0)
    designs.insert(place + 1, "extrapolation_of", names_of(flags).astype(str))


def _chosen(designs: pd.DataFrame, objective: str) -> Json:
    """Return the recommended row, or that which comes nearest where none is feasible."""
    rows = designs
    if rows["feasible"].any():
        rows = rows[rows["feasible"]]
    else:
        objective = "margin"
    for wanted in (~rows["extrapolation"], rows["margin"] >= _SURE * rows["probability_se"]):
        if wanted[rows.index].any():
            rows = rows[wanted[rows.index]]
    if _OBJECTIVES[objective] is _margin:  # of margins that cannot be told apart, the coarsest
        least = rows["margin"].max() - _SURE * (rows["probability_se"] + _ALIKE)
        rows, objective = rows[rows["margin"] >= least], "max-pitch"
    # Of equals the first, from the largest margin on.
    rows = rows.sort_values("margin", ascending=False, kind="stable")
    key: FloatArray = _OBJECTIVES[objective](rows).to_numpy().round(12)
    row = rows.iloc[int(np.argmax(key))].to_dict()
    return {
        str(name): one.item() if isinstance(one, np.generic) else one for name, one in row.items()
    }


def _inside(designs: pd.DataFrame) -> list[Texture]:
    rows = designs[~designs["extrapolation"]]
    rows = rows if len(rows) else designs
    return list(zip(rows["a_over_R"].tolist(), rows["b_over_R"].tolist(), strict=True))


def _leading(source: Fit | Comparison) -> list[list[tuple[Posterior, float]]]:
    """Return the posteriors of the two most probable forms."""
    if isinstance(source, Fit):
        return [source.averaged]
    probable = sorted(source.probabilities.items(), key=lambda one: -one[1])[:2]
    return [source.fits[name].averaged for name, _ in probable]


def _why(
    sources: Sources, goal: Goal, draw: Any, seed: int
) -> tuple[pd.DataFrame, pd.DataFrame, Json]:
    """Return shares, what to measure, and the reliability index, at one texture."""
    found, measure = sobol_shares(sources, seed + 2), what_to_measure(sources, seed + 4)
    if goal.is_spread:
        why = "a bound on the spread has no failure"
        return (
            found[found["of"] == "Q"],
            measure.iloc[:0],
            {"beta": None, "probability": None, "trusted": False, "why": why},
        )
    met = Goal(goal.text, (sources.value.case,), goal.level)
    total, variance, rounds = 0.0, 0.0, 0
    while rounds < _PRECISE_ROUNDS:
        size = partial(draw, seed=seed + 1_000 + rounds)
        one = GoalValues(sources.loads, size, _N_PRECISE).at(
            met, *sources.texture, [sources.value.corner]
        )
        total, variance, rounds = total + 1 - one.value, variance + one.se**2, rounds + 1
        if math.sqrt(variance) <= _PRECISE_SE * total:
            break
    se = math.sqrt(variance) / rounds
    reliability = form_reliability(sources, total / rounds, se)
    return found, measure, reliability
