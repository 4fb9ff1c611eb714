"""Figures of `ridgebayes plan`: of each texture of a scene, and of the check of estimates."""

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ridgebayes._types import FloatArray
from ridgebayes.contact import hertz
from ridgebayes.contact.contact_solution import load_factor, solve_contact
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.newton import NotConvergedError
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.drawing.scenes import plot_counts, plot_effects, plot_plan_check
from ridgebayes.drawing.style import save
from ridgebayes.errors import ComputationError
from ridgebayes.report.figures.bodies import plot_deformed, plot_pressed
from ridgebayes.scene.effects import Plan, full_profile, plan_label, plan_table
from ridgebayes.scene.scene import Scene

_TOLERANCE = 1e-5  # of the curves
_EDGES = 10.0  # a ridge, of the mesh


def draw_plan(scene: Scene, one: Plan, folder: Path) -> None:
    """Draw a texture's body at the highest load, Q against load, and the size of each effect."""
    for name, figure in _figures(scene, one).items():
        save(figure, folder / f"{name}-{plan_label(one.texture)}")


def draw_check(found: pd.DataFrame, folder: Path) -> None:
    """Draw estimates against true changes."""
    save(plot_plan_check(found), folder / "plan-check")


def _figures(scene: Scene, one: Plan) -> dict[str, Figure]:
    texture, p_max = one.texture, scene.highest_load(one.texture)
    sharp = Profile(texture.a_over_R, texture.b_over_R)
    profile = one.profile or (full_profile(texture) if one.needs_finite_elements else sharp)
    figures = {
        "deformed": _deformed(profile, scene, one, p_max),
        "effects": plot_effects(plan_table([one]), scene.relative),
    }
    # The same line twice would hide the first: each profile goes by its first name.
    names: dict[Profile, str] = {profile: "as planned"}
    names.setdefault(full_profile(texture), "all that the scene gives")
    names.setdefault(sharp, "ridges alone")
    found = {name: _curve(each, scene, p_max) for each, name in names.items()}
    curves = {name: curve for name, curve in found.items() if len(curve[0])}
    smooth = _smooth(sharp, scene, p_max)
    if len(smooth[0]):
        curves["Hertz, no grooves"] = smooth
    if curves:
        figures["counts"] = plot_counts(curves)
    return figures


def _deformed(profile: Profile, scene: Scene, one: Plan, p_max: float) -> Figure:
    if not one.needs_finite_elements:
        return plot_pressed(
            solve_contact(profile, load_factor(scene.nu) * p_max, rel_tol=_TOLERANCE)
        )
    body = Cylinder(profile, p_max=p_max, nu=scene.nu, friction=scene.friction, edges=_EDGES)
    try:
        return plot_deformed(body, body.at_load(p_max, body.unloaded()))
    except NotConvergedError as failed:
        raise ComputationError(
            f"{plan_label(one.texture)}: no figure of the body: {failed}"
        ) from None


def _curve(profile: Profile, scene: Scene, p_max: float) -> tuple[FloatArray, FloatArray]:
    factor = load_factor(scene.nu)
    found = reaching_loads(profile, W_max=factor * p_max, n_max=200, rel_tol=_TOLERANCE)
    ok = np.array([status == "ok" for status in found.status], dtype=bool)
    return found.W[ok] / factor, found.Q[ok].astype(float)


def _smooth(profile: Profile, scene: Scene, p_max: float) -> tuple[FloatArray, FloatArray]:
    Q = np.arange(4.0, 404.0, 2.0)
    loads = hertz.transition_load(Q, profile.a, profile.b, nu=scene.nu)
    return loads[loads <= p_max], Q[loads <= p_max]
