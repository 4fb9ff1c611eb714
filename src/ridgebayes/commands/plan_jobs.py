"""The jobs behind `plan`: a scene's effects as a table and figures, and the check of estimates."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ridgebayes.checks.plan_check import check_plans, sobol_scenes
from ridgebayes.commands.run_folder import new_folder, write_csv, write_text
from ridgebayes.contact import hertz
from ridgebayes.contact.contact_solution import load_factor, solve_contact
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.runtime.progress import Progress
from ridgebayes.scene.effects import Plan, full_profile, plan, plan_label, plan_table
from ridgebayes.scene.scene import Scene

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from ridgebayes._types import FloatArray

CHECK_CSV = "plan-check.csv"
_TOLERANCE = 1e-5  # of the curves in figures
_EDGES = 10.0  # a ridge, of the mesh in figures


def plan_job(scene: Scene, *, out: Path | None = None, figures: Path | None = None) -> list[Plan]:
    """Plan a scene, write the table, draw the figures.

    Parameters
    ----------
    scene : Scene
        What is there.
    out : Path, optional
        CSV file to write.
    figures : Path, optional
        Folder to draw into, made if it does not exist: of each texture the body pressed by the
        highest load, Q against load, and the size of each effect, as PNG and SVG.

    Returns
    -------
    list of Plan
        One per texture.
    """
    if figures is not None and figures.exists() and not figures.is_dir():
        raise InputError(f"{figures}: not a folder; --figures names one")
    plans = plan(scene)
    if out is not None:
        write_csv(plan_table(plans), out)
    if figures is not None:
        from ridgebayes.drawing.style import save

        figures.mkdir(parents=True, exist_ok=True)
        for one in plans:
            label = plan_label(one.texture)
            for name, figure in _figures(scene, one).items():
                save(figure, figures / f"{name}-{label}")
    return plans


def plan_check_job(
    folder: Path, *, n: int = 32, seed: int = 0, force: bool = False
) -> "pd.DataFrame":
    """Check the estimates behind plans on scenes spread over the space.

    Parameters
    ----------
    folder : Path
        Folder to make: plan-check.csv, its figure, report.md.
    n : int, optional
        Scenes.
    seed : int, optional
        Seed of their spread.
    force : bool, optional
        Whether an existing folder of this command may be replaced.

    Returns
    -------
    pandas.DataFrame
        As `ridgebayes.checks.plan_check.check_plans` returns it.
    """
    from ridgebayes.drawing.style import save
    from ridgebayes.report.figures.scenes import plot_plan_check

    scenes = sobol_scenes(n, rng=seed)
    with new_folder(folder, force=force, about=CHECK_CSV) as partial, Progress(1) as progress:
        with progress.stage("scenes"):
            found = check_plans(scenes, progress=progress.detail)
        write_csv(found, partial / CHECK_CSV)
        save(plot_plan_check(found), partial / "plan-check")
        write_text(_report(found), partial / "report.md")
    return found


def _figures(scene: Scene, one: Plan) -> dict[str, "Figure"]:
    from ridgebayes.report.figures.scenes import plot_counts, plot_effects

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


def _deformed(profile: Profile, scene: Scene, one: Plan, p_max: float) -> "Figure":
    if not one.needs_finite_elements:
        from ridgebayes.report.figures.scenes import plot_pressed

        return plot_pressed(
            solve_contact(profile, load_factor(scene.nu) * p_max, rel_tol=_TOLERANCE)
        )
    from ridgebayes.contact.cylinder.cylinder import Cylinder
    from ridgebayes.contact.cylinder.newton import NotConvergedError
    from ridgebayes.report.figures.cylinder import plot_deformed

    body = Cylinder(profile, p_max=p_max, nu=scene.nu, friction=scene.friction, edges=_EDGES)
    try:
        return plot_deformed(body, body.at_load(p_max, body.unloaded()))
    except NotConvergedError as failed:
        raise ComputationError(
            f"{plan_label(one.texture)}: no figure of the body: {failed}"
        ) from None


def _curve(profile: Profile, scene: Scene, p_max: float) -> "tuple[FloatArray, FloatArray]":
    factor = load_factor(scene.nu)
    found = reaching_loads(profile, W_max=factor * p_max, n_max=200, rel_tol=_TOLERANCE)
    ok = np.array([status == "ok" for status in found.status], dtype=bool)
    return found.W[ok] / factor, found.Q[ok].astype(float)


def _smooth(profile: Profile, scene: Scene, p_max: float) -> "tuple[FloatArray, FloatArray]":
    Q = np.arange(4.0, 404.0, 2.0)
    loads = hertz.transition_load(Q, profile.a, profile.b, nu=scene.nu)
    return loads[loads <= p_max], Q[loads <= p_max]


def _report(found: "pd.DataFrame") -> str:
    """Return the check as Markdown: what it shows, and a table of every row."""
    neglected = found[~found["simulated"]]
    within = neglected["true_change"] <= neglected["relative"]
    shown = ["scene", "effect", "number", "estimate", "true_change", "relative", "simulated"]
    lines = [
        "# Are the estimates honest?",
        "",
        f"{found['scene'].nunique()} scenes spread by a Sobol sequence; each effect of each was "
        "switched over alone, all else as planned, and the true change of the transition loads "
        "compared with the estimate and with the accuracy that the scene wants.",
        "",
        f"- {int(within.sum())} of {len(neglected)} neglected effects change loads by no more "
        "than the accuracy wanted.",
        f"- {int(found['honest'].sum())} of {len(found)} estimates are honest: not exceeded where "
        "it matters, and at most ten times too large.",
        "",
        "![Estimates against true changes](plan-check.png)",
        "",
        "| " + " | ".join(shown) + " |",
        "|" + "---|" * len(shown),
    ]
    for row in found[shown].to_dict("records"):
        cells = [
            f"{value:.3g}" if isinstance(value, float) else str(value) for value in row.values()
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"
