"""The command `ridgebayes plan`: effects of a scene as a table and figures."""

import math
from pathlib import Path

import pandas as pd

from ridgebayes.commands import table_options as options
from ridgebayes.commands.parsing import medians_taken, refuse_output
from ridgebayes.commands.terminal import Answer, warn
from ridgebayes.errors import InputError, RidgebayesError
from ridgebayes.runtime.atomic import cannot_write, write_text
from ridgebayes.runtime.templates import rendered
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
    """Run `ridgebayes plan`, or write a new scene file."""
    if asked.new is not None:
        return _new_scene(asked)
    if asked.scene is None:
        raise InputError("SCENE: missing; expected a scene file or --new")
    if asked.out is not None:
        check_name(asked.out)
        refuse_output(asked.out, asked.force)
    if asked.figures is not None and asked.figures.exists() and not asked.figures.is_dir():
        raise InputError(f"{asked.figures}: not a folder; --figures names one")
    scene = Scene.from_toml(asked.scene)
    warned = warn(*filter(None, [beyond_reach(scene)]))
    plans = plan(scene)
    if asked.figures is not None:
        # Imported here, since matplotlib is slow to import and other plans do not use it.
        from ridgebayes.commands.plan_figures import draw_plans, refuse_files

        refuse_files(plans, asked.figures, asked.force)
    if asked.out is not None:
        write_frame(plan_table(plans), asked.out)
    parts: list[str | pd.DataFrame] = [*medians_taken(scene.uncertain_names)]
    parts += [part for planned in plans for part in scene_text(scene, planned)]
    reasons = plan_table(plans)[["texture", "effect", "number", "reason"]]
    files, problem = [asked.out] if asked.out else [], ""
    failed: list[str] = []
    if asked.figures is not None:
        try:
            asked.figures.mkdir(parents=True, exist_ok=True)
            written, failed = draw_plans(scene, plans, asked.figures)
            files += written
        except OSError as error:  # the answer still contains the plan
            named = isinstance(error, RidgebayesError)  # its message already names the file
            problem = str(error if named else cannot_write(Path(error.filename), error))
    return Answer(
        parts, plan_table(plans), files, (reasons,), warnings=failed, early=warned, problem=problem
    )


def _new_scene(asked: options.PlanOptions) -> Answer:
    """Write a commented scene file as a template."""
    path = asked.new
    if path is None or asked.scene is not None:
        raise InputError("--new: cannot be combined with a scene")
    refuse_output(path, asked.force, ".toml")
    write_text(data_path("scenes/template.toml").read_text(encoding="utf-8"), path)
    summary = f"{path}: a scene to start from. Change its values, then: ridgebayes plan {path}"
    return Answer((summary,), files=[path])


def scene_text(scene: Scene, planned: Plan) -> list[str | pd.DataFrame]:
    """Describe a texture of a scene by sentences and a table of its effects.

    Parameters
    ----------
    scene : Scene
        Scene with the load.
    planned : Plan
        Plan of one of its textures.
    """
    p = scene.highest_load(planned.texture)
    single = scene.model_copy(update={"textures": (planned.texture,)})
    (contact,) = contact_at_loads(single, [p]).to_dict("records")
    width = 2 * contact["half_width_over_R"]
    simulated = [effect for effect in planned.effects if effect.simulated]
    text = rendered(
        "ridgebayes.commands",
        "plan.txt.jinja",
        percent=percent,
        scene=scene,
        planned=planned,
        p=p,
        contact=contact,
        width=None if math.isnan(width) else width,
        simulated=simulated,
        method=_METHODS[planned.solver],
        cost=duration(sum(effect.cost_s for effect in simulated)),
    )
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
    lines = filter(None, text.splitlines())
    return [*lines, pd.DataFrame(rows), f"Not modelled: {unknown}."]
