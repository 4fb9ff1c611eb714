"""`design`: find the textures that meet a goal under all uncertainties, and recommend one."""

import os
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import pandas as pd

from ridgebayes._types import Json, Rng, __version__
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.contact import two_scale
from ridgebayes.contact.scaling import Texture
from ridgebayes.errors import InputError, expect, warn_of
from ridgebayes.inference.posterior import Posterior
from ridgebayes.predict.of_scene import without_effect
from ridgebayes.results import Fit
from ridgebayes.runtime.randomness import seed_of
from ridgebayes.runtime.reading import refusing
from ridgebayes.scene.scene import Scene, as_scene
from ridgebayes.scene.units import Body
from ridgebayes.texture_design.bodies import Bodies, Tolerance, median_units, uncertain_widths
from ridgebayes.texture_design.choice import OBJECTIVES, chosen, mark_extrapolation, plain, tied
from ridgebayes.texture_design.goal_values import N_DRAW, GoalValues, ratio_loads
from ridgebayes.texture_design.goals import Goal, Load, parse_goals, read_loads
from ridgebayes.texture_design.lattice import lattice
from ridgebayes.texture_design.limits import Limits, textures_in
from ridgebayes.texture_design.next_simulation import next_simulation
from ridgebayes.texture_design.record import DESIGN_COLUMNS, Design
from ridgebayes.texture_design.sensitivity import (
    Sources,
    drawn_check,
    sobol_shares,
    what_to_measure,
)

_N_LOADS = 20  # default of the objective min-load


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
    """Find the textures that meet a goal with the required probability, and recommend one.

    Parameters
    ----------
    source : Fit or Comparison
        Posterior; forms and error models are averaged by their weights.
    scene : Scene or path
        Body and load, whose values may be distributions. Distributions of the scene's widths
        describe manufactured widths, relative to the nominal ones.
    goal : str or sequence of str
        Such as ``P(Q >= 8) >= 0.95``; `ridgebayes.texture_design.goals` lists all kinds of goals.
    sizes : mapping, optional
        ``a`` and ``b``: bounds (low, high) over R; the calibrated range if not given. ``step``:
        widths are multiples of it (over R); if not given, a round number for about 60 widths.
    tolerance : str or Tolerance, optional
        Manufacturing tolerance: ``5 %`` or a length (over R, or ``10 um``) is the standard
        deviation of each width (normal); ``worst 5 %`` sets bounds, and the goal has to be met at
        the worst corner.
    loads : str or sequence of float, optional
        Loads p/E of goals without loads: LO:HI:N, also with units, or numbers. Goals have to be met
        at the worst load. The scene's largest load if not given.
    objective : str, optional
        margin (the coarsest texture if margins are equal within error), max-pitch, min-pitch,
        max-ridge, min-ridge, max-groove, min-groove, or min-load: the smallest load at which a
        texture meets the goal (20 steps to the scene's largest load if `loads` is not given).
    rng : int or numpy.random.Generator, optional
        Seed; the same seed gives the same design.

    Returns
    -------
    Design
        Map, recommended texture, check, and sources of the uncertainty.

    Raises
    ------
    InputError
        If a goal does not parse or contradicts another, bounds or step are not positive and in
        order, the lattice has more than 40,000 textures, the scene has several textures, or p/E is
        above 0.5.
    ComputationError
        If a comparison has no form with an evidence.

    Warns
    -----
    CautionWarning
        If values of the scene have no effect.

    Notes
    -----
    Probabilities cover forms, error models, coefficients, body, load and manufactured widths. They
    are exact over the error of the load, and averaged over 16,384 draws of the rest, the same for
    every texture (4,096 for a bound on the spread).
    If possible, the recommended texture is inside the calibrated range, and its probability exceeds
    the level by two standard errors. It is checked with 100,000 independent draws of the count.

    *Validity.* As `predict`. Textures are new, with new offsets, except for calibrated textures
    whose manufactured widths and radius are certain.

    *Cost.* About 2 ms per texture and posterior.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> scene = rb.Scene.of([(0.022, 0.02)], p_over_E=0.01)
    >>> result = rb.design(
    ...     fit, scene, "P(Q >= 8) >= 0.95", sizes={"step": 0.004}, tolerance="5 %",
    ...     objective="max-pitch",
    ... )
    >>> result.recommended["feasible"], result.recommended["probability"] > 0.95
    (True, True)
    """
    scene, seed = as_scene(scene), seed_of(rng)
    tol = Tolerance.parse(tolerance, scene.body)
    warn_of(without_effect(scene, "offset"))
    expect(Fit, Comparison, source=source)
    expect(str, objective=objective)
    expect(Mapping, None, sizes=sizes)
    if objective not in OBJECTIVES:
        raise InputError(f"objective: expected one of {', '.join(OBJECTIVES)}, got {objective!r}")
    alternatives = _alternatives(loads, objective, scene.body)
    goals_by_load = [parse_goals(goal, some, scene.body) for some in alternatives]
    loads_by_goals = [_loads_of(goals, scene) for goals in goals_by_load]
    averaged = source.averaged
    textures, about = lattice(sizes or {}, [fit for fit, _ in averaged])
    tol.check(min(min(texture) for texture in textures))
    draw = partial(Bodies.draw, scene, tol, seed=seed)
    loads_of = ratio_loads(averaged, draw(N_DRAW).ratios(textures))
    values = GoalValues(loads_of, draw, N_DRAW)
    for goals, goal_loads in zip(goals_by_load, loads_by_goals, strict=True):
        designs = _map(values, goals, textures)
        p_over_E = [load["p_over_E"] for load in goal_loads]
        mark_extrapolation(designs, averaged, goals, max(p_over_E), scene.nu)
        if designs["feasible"].any():
            break
    limits: Json | None = None
    if designs["feasible"].any():
        best = chosen(designs, objective)
    else:
        nearest = Limits(values, goals, p_over_E, two_scale.checked(scene.ogden))
        rows = tied(_inside(designs))
        best = plain(rows, nearest.nearest(rows))
        limits = nearest.at(best, tol)
    texture = (float(best["a_over_R"]), float(best["b_over_R"]))
    tightest = goals[int(best.get("goal", 1)) - 1]
    value = values.at(tightest, *texture)
    sources = Sources(scene, tol, loads_of, texture, value)
    about |= {
        "loads": goal_loads,
        "tolerance": vars(tol),
        "uncertain_widths": uncertain_widths(scene),
        "averaged": [[fit.form.name, fit.noise.name, weight] for fit, weight in averaged],
        "seed": seed,
        "ridgebayes_version": __version__,
    }
    if objective == "min-load":
        best["load"] = str(value.case.loads[0])
    return Design(
        goals,
        objective,
        designs,
        best,
        drawn_check(sources, tightest, seed + 1),
        limits,
        *_why(sources, tightest, seed),
        next_simulation(_leading(source), textures_in(_inside(designs)), seed),
        about,
    )


def _alternatives(
    loads: str | Sequence[float] | None, objective: str, body: Body
) -> list[tuple[Load, ...]]:
    """Return the loads of goals without loads; several alternatives for the objective min-load."""
    if loads is None:
        n = _N_LOADS if objective == "min-load" else 1
        alternatives = tuple(Load(i / n, "share") for i in range(1, n + 1))
    else:
        with refusing("loads", TypeError, ValueError, rule="; expected text, or loads p/E"):
            texts = [loads] if isinstance(loads, str) else [repr(float(p)) for p in loads]
        alternatives = tuple(load for text in texts for load in read_loads(text, "loads", body))
    if not alternatives:
        raise InputError("loads: expected at least one, got none")
    return [(load,) for load in alternatives] if objective == "min-load" else [alternatives]


def _loads_of(goals: Sequence[Goal], scene: Scene) -> list[Json]:
    """Return the distinct loads of goals, with p/E at the scene's medians; refuse p/E above 0.5."""
    units = median_units(scene)
    loads = dict.fromkeys(load for goal in goals for case in goal.cases for load in case.loads)
    values = {str(load): float(load.p_over_E(units)[0]) for load in loads}
    for load, p_over_E in values.items():
        if p_over_E > two_scale.REACH:
            rule = f"expected p/E of at most {two_scale.REACH:g}, above which no model here holds"
            raise InputError(f"load {load}: p/E = {p_over_E:.4g}; {rule}")
    return [{"load": load, "p_over_E": p_over_E} for load, p_over_E in values.items()]


def _map(values: GoalValues, goals: Sequence[Goal], textures: Sequence[Texture]) -> pd.DataFrame:
    """Return a table with the value of the goal with the least margin at each texture."""
    rows = []
    for a, b in textures:
        at_goals = [values.at(goal, a, b) for goal in goals]
        margins = [goal.margin(value.value) for goal, value in zip(goals, at_goals, strict=True)]
        i = margins.index(min(margins))
        rows.append((a, b, at_goals[i].value, at_goals[i].se, margins[i] >= 0, margins[i], i + 1))
    names = [name for name in DESIGN_COLUMNS if not name.startswith("extrapolation")]
    frame = pd.DataFrame(rows, columns=names)
    return frame if len(goals) > 1 else frame.drop(columns="goal")


def _inside(designs: pd.DataFrame) -> pd.DataFrame:
    """Return the textures inside the calibrated range; all textures if none is inside."""
    inside = designs[~designs["extrapolation"]]
    return inside if len(inside) else designs


def _leading(source: Fit | Comparison) -> list[list[tuple[Posterior, float]]]:
    """Return the posteriors of the two most probable forms."""
    if isinstance(source, Fit):
        return [source.averaged]
    probable = sorted(source.probabilities.items(), key=lambda item: -item[1])[:2]
    return [source.fits[name].averaged for name, _ in probable]


def _why(sources: Sources, goal: Goal, seed: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return Sobol shares and what to measure; a bound on the spread has no failures."""
    sobol, measure = sobol_shares(sources, seed + 2), what_to_measure(sources, seed + 4)
    return (sobol[sobol["of"] == "Q"], measure.iloc[:0]) if goal.is_spread else (sobol, measure)
