"""Figures of `ridgebayes plan` for each texture of a scene."""

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ridgebayes._types import FloatArray
from ridgebayes.commands.parsing import refuse_output
from ridgebayes.contact import hertz
from ridgebayes.contact.contact_solution import load_factor, solve_contact
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.newton import NotConvergedError
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.contact.two_scale import half_plane_load, load_of
from ridgebayes.drawing import KINDS
from ridgebayes.drawing.scenes import plot_counts, plot_effects
from ridgebayes.drawing.style import save
from ridgebayes.errors import ComputationError, RidgebayesError
from ridgebayes.report.figures.bodies import plot_deformed, plot_pressed
from ridgebayes.runtime.text import one_line_message
from ridgebayes.scene.effects import HIGHEST_LOAD, Plan, full_profile, plan_label, plan_table
from ridgebayes.scene.scene import Scene
from ridgebayes.simulate.solvers import LOAD_PRESETS

_NAMES = ("effects", "counts", "deformed")


def refuse_files(plans: Sequence[Plan], folder: Path, force: bool) -> None:
    """Raise InputError for a figure that cannot be written to an existing folder."""
    labels = [plan_label(planned.texture) for planned in plans] if folder.is_dir() else []
    for label, name, kind in itertools.product(labels, _NAMES, KINDS):
        refuse_output(folder / f"{name}-{label}.{kind}", force)


def draw_plans(scene: Scene, plans: Sequence[Plan], folder: Path) -> tuple[list[Path], list[str]]:
    """Draw the figures of each texture of a scene.

    Returns
    -------
    written : list of Path
        Files written.
    failed : list of str
        Reason for each missing figure.
    """
    drawn = [_draw_plan(scene, planned, folder) for planned in plans]
    written, failed = (list(itertools.chain(*lists)) for lists in zip(*drawn, strict=True))
    return written, failed


def _draw_plan(scene: Scene, planned: Plan, folder: Path) -> tuple[list[Path], list[str]]:
    """Draw the pressed body at the highest load, Q against load, and the size of each effect."""
    texture, p_max = planned.texture, scene.highest_load(planned.texture)
    sharp = Profile(texture.a_over_R, texture.b_over_R)
    profile = planned.profile
    if profile is None:
        profile = sharp if planned.solver == "half-plane" else full_profile(texture)
    written: list[Path] = []
    failed: list[str] = []
    recipes: tuple[Callable[[], Figure], ...] = (
        lambda: plot_effects(plan_table([planned]), scene.relative),
        lambda: _counts(profile, sharp, scene, planned),
        lambda: _deformed(profile, scene, planned, p_max),
    )
    for name, make in zip(_NAMES, recipes, strict=True):
        label = f"{name}-{plan_label(texture)}"
        try:
            figure = make()
        # A failed computation leaves out the figure; an OSError of `save` is not caught.
        except (RidgebayesError, ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            failed.append(f"{label}: no figure: {one_line_message(error)}")
        else:
            written += save(figure, folder / label)
    return written, failed


def _counts(profile: Profile, sharp: Profile, scene: Scene, planned: Plan) -> Figure:
    p_max = scene.highest_load(planned.texture)
    # Equal profiles are drawn once, with the first of their names.
    names: dict[Profile, str] = {profile: "as planned"}
    names.setdefault(full_profile(planned.texture), "all that the scene gives")
    names.setdefault(sharp, "ridges alone")
    p = _half_plane_load(scene, planned, p_max)
    steps = {name: _curve(side, scene, p) for side, name in names.items()}
    if planned.solver == "two-scale":
        steps = {
            name: (load_of(loads, scene.nu, scene.ogden), Q) for name, (loads, Q) in steps.items()
        }
    steps["Hertz, no grooves"] = _smooth(sharp, scene, p_max)
    curves = {name: curve for name, curve in steps.items() if len(curve[0])}
    if not curves:
        raise ComputationError(f"no further ridges are reached under p/E = {p_max:g}")
    return plot_counts(curves)


def _deformed(profile: Profile, scene: Scene, planned: Plan, p_max: float) -> Figure:
    if planned.solver != "cylinder-fe":
        p = _half_plane_load(scene, planned, p_max)
        return plot_pressed(solve_contact(profile, load_factor(scene.nu) * p))
    if p_max > HIGHEST_LOAD:  # the solver would fail after minutes
        raise ComputationError(f"p/E = {p_max:.2g} is above {HIGHEST_LOAD:g}")
    nu, friction, ogden = scene.nu, scene.friction, scene.ogden
    edges = LOAD_PRESETS["quick"].edges
    body = Cylinder(profile, p_max=p_max, nu=nu, friction=friction, edges=edges, ogden=ogden)
    try:
        return plot_deformed(body, body.at_load(p_max, body.unloaded()))
    except NotConvergedError as failed:
        raise ComputationError(str(failed)) from None


def _half_plane_load(scene: Scene, planned: Plan, p_max: float) -> float:
    """Return the load at which the half-plane has the same contact as the body at `p_max`."""
    if planned.solver != "two-scale":
        return p_max
    return float(half_plane_load(p_max, scene.nu, scene.ogden))


def _curve(profile: Profile, scene: Scene, p_max: float) -> tuple[FloatArray, FloatArray]:
    factor = load_factor(scene.nu)
    events = reaching_loads(profile, W_max=factor * p_max, n_max=200)
    ok = np.array([status == "ok" for status in events.status], dtype=bool)
    return events.W[ok] / factor, events.Q[ok].astype(float)


def _smooth(profile: Profile, scene: Scene, p_max: float) -> tuple[FloatArray, FloatArray]:
    Q = np.arange(4.0, 404.0, 2.0)
    loads = hertz.transition_load(Q, profile.a, profile.b, nu=scene.nu)
    return loads[loads <= p_max], Q[loads <= p_max]
