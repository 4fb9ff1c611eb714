"""`ridgebayes plan`: a scene's effects as a table and figures."""

import math
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from ridgebayes.commands import table_options as options
from ridgebayes.commands.parsing import medians_taken, refuse_existing, refuse_suffix
from ridgebayes.commands.terminal import Answer, files_in, warn
from ridgebayes.errors import InputError, RidgebayesError
from ridgebayes.runtime.atomic import write_text
from ridgebayes.runtime.text import duration, percent
from ridgebayes.scene.effects import Plan, beyond_reach, plan_table
from ridgebayes.scene.estimates import plan
from ridgebayes.scene.scene import Scene
from ridgebayes.simulate.responses import contact_at_loads
from ridgebayes.table.datafiles import data_path
from ridgebayes.table.files import check_name, write_frame

_METHODS = {
    "half-plane": "the half-plane equation",
    "two-scale": "two scales (half-plane ridges on a largely deformed body)",
    "cylinder-fe": "finite elements",
}


def command(asked: options.PlanOptions) -> Answer:
    """Do what the command line asks for."""
    if asked.new is not None:
        return _new_scene(asked)
    if asked.scene is None:
        raise InputError("SCENE: missing; expected a scene file or --new")
    if asked.out is not None:
        check_name(asked.out)
        refuse_existing(asked.out, asked.force)
    if asked.figures is not None and asked.figures.exists() and not asked.figures.is_dir():
        raise InputError(f"{asked.figures}: not a folder; --figures names one")
    scene = Scene.from_toml(asked.scene)
    warned = warn(*filter(None, [beyond_reach(scene)]))
    plans = plan(scene)
    if asked.out is not None:
        write_frame(plan_table(plans), asked.out)
    parts: list[str | pd.DataFrame] = [*medians_taken(scene.uncertain_names)]
    parts += [part for planned in plans for part in scene_text(scene, planned)]
    reasons = plan_table(plans)[["texture", "effect", "number", "reason"]]
    files, failed, problem = [asked.out] if asked.out else [], [], ""
    if asked.figures is not None:
        try:
            failed = _draw(scene, plans, asked.figures)
            files += files_in(asked.figures)
        except OSError as error:  # the plan is reported all the same
            named = isinstance(error, RidgebayesError)  # which says the file itself
            problem = str(error) if named else f"{error.filename}: {error.strerror}"
    return Answer(
        parts,
        plan_table(plans),
        files,
        (reasons,),
        warnings=failed,
        early=warned,
        problem=problem,
    )


def _new_scene(asked: options.PlanOptions) -> Answer:
    """Write a scene file to start from."""
    path = asked.new
    if path is None or asked.scene is not None:
        raise InputError("--new: expected without a scene")
    refuse_suffix(path, (".toml",))
    refuse_existing(path, asked.force)
    write_text(data_path("scenes/template.toml").read_text(encoding="utf-8"), path)
    summary = f"{path}: a scene to start from. Change its values, then: ridgebayes plan {path}"
    return Answer((summary,), files=[path])


def _draw(scene: Scene, plans: Sequence[Plan], folder: Path) -> list[str]:
    """Draw each texture, and return why a figure could not be made."""
    # Here, not above: it loads matplotlib, which a plan alone does without.
    from ridgebayes.commands.plan_figures import draw_plan

    folder.mkdir(parents=True, exist_ok=True)
    return [why for planned in plans for why in draw_plan(scene, planned, folder)]


def scene_text(scene: Scene, planned: Plan) -> list[str | pd.DataFrame]:
    """Say what a texture of a scene is: sentences, and its effects as a table.

    Parameters
    ----------
    scene : Scene
        Scene with the load.
    planned : Plan
        Plan of one of its textures.
    """
    texture = planned.texture
    lines = [f"a/R = {texture.a_over_R:g}, b/R = {texture.b_over_R:g}: {_expected(scene, planned)}"]
    simulated = [effect for effect in planned.effects if effect.simulated]
    wanted = f"loads right to {percent(scene.relative)}" if scene.relative else "its loads"
    sizes = ", ".join(
        f"{effect.name} ({percent(effect.estimate)})"
        for effect in simulated
        if effect.estimate != 0
    )
    cost = duration(sum(effect.cost_s for effect in simulated))
    cost = cost if cost.startswith("under") else f"about {cost}"
    how = _METHODS[planned.solver]
    lines.append(f"To compute {wanted}, simulate: {sizes}. By {how} that takes {cost}.")
    if planned.left_out:
        names = ", ".join(
            f"{effect.name} ({percent(effect.estimate)})" for effect in planned.left_out
        )
        lines.append(f"Not simulated, though it may matter: {names}.")
    rows = [
        {
            "effect": effect.name,
            "simulated": "yes" if effect.simulated else "no",
            "changes loads by": percent(effect.estimate),
            "takes": duration(effect.cost_s),
        }
        for effect in planned.effects
        if not math.isnan(effect.cost_s)
    ]
    unknown = ", ".join(effect.name for effect in planned.effects if math.isnan(effect.cost_s))
    return [*lines, pd.DataFrame(rows), f"Not modelled: {unknown}."]


def _expected(scene: Scene, planned: Plan) -> str:
    """Say which count and contact the highest load gives."""
    p = scene.highest_load(planned.texture)
    load = f"p/E = {p:.3g}"
    body = scene.body
    if body.load and p == scene.p_over_E:
        load = f"{body.load} ({load})"
    alone = scene.model_copy(update={"textures": (planned.texture,)})
    (contact,) = contact_at_loads(alone, [p]).to_dict("records")
    if math.isnan(contact["half_width_over_R"]):
        return f"Q at {load} is not known: {contact['status']}."
    width = 2 * contact["half_width_over_R"]
    size = f"{width:.2g} R"
    if body.radius is not None:
        size += f" ({1e3 * width * float(body.radius):.2g} mm)"
    mean = " on average over offsets" if planned.texture.offset == "uniform" else ""
    words = f"at {load} expect Q = {contact['Q']:.3g}{mean} in a contact {size} wide"
    words += f", of which {percent(contact['contact_fraction'])} touches."
    if contact["rel_se"]:
        words += (
            f" Standard error of the load: {percent(contact['rel_se'])}, of lengths half of it."
        )
    return words if contact["status"] == "ok" else f"{words} This is {contact['status']}."
