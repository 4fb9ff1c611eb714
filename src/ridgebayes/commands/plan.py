"""`ridgebayes plan`: a scene's effects as a table and figures, and the check of estimates."""

import math
from pathlib import Path

import pandas as pd

from ridgebayes.checks.plan_check import check_plans, sobol_scenes
from ridgebayes.commands import options
from ridgebayes.commands.parsing import refuse_existing
from ridgebayes.commands.run_folder import new_folder, write_csv, write_text
from ridgebayes.commands.terminal import Answer, files_in
from ridgebayes.errors import InputError
from ridgebayes.runtime.progress import Progress
from ridgebayes.scene.effects import Plan, plan_table
from ridgebayes.scene.estimates import plan
from ridgebayes.scene.scene import Scene

CHECK_CSV = "plan-check.csv"


def command(asked: options.Plan) -> Answer:
    """Do what the command line asks for."""
    if asked.verify:
        if asked.scene is not None or asked.out is None:
            raise InputError("--verify: expected -o, a folder to create, and no scene")
        found = plan_check_job(asked.out, n=asked.scenes, seed=asked.seed, force=asked.force)
        n_bad = int((~found["honest"]).sum())
        told = f"{asked.out}: {len(found) - n_bad} of {len(found)} estimates are reliable"
        problem = f"{n_bad} estimates are not reliable; see {asked.out}/report.md"
        return Answer((told,), found, files_in(asked.out), problem=problem if n_bad else "")
    if asked.scene is None:
        raise InputError("SCENE: missing; expected a scene file, or --verify")
    if asked.out is not None:
        refuse_existing(asked.out, asked.force)
    parts = []
    plans = plan_job(Scene.from_toml(asked.scene), out=asked.out, figures=asked.figures)
    for one in plans:
        parts.append(f"a/R = {one.texture.a_over_R:g}, b/R = {one.texture.b_over_R:g}")
        for row in plan_table([one]).to_dict("records"):
            size, seconds = row["estimated_rel_change"], row["cost_s"]
            known = "size not known" if math.isnan(size) else f"changes loads by {size:.1e}"
            word = "simulated" if row["simulated"] else "left out"
            cost = "" if math.isnan(seconds) else f", {seconds:.2g} s"
            parts.append(f"  {row['effect']}: {word}; {known}{cost}; {row['reason']}")
    return Answer(parts, plan_table(plans), [asked.out] if asked.out else [])


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
        # Here, not above: it loads matplotlib, which a plan alone does without.
        from ridgebayes.commands.plan_figures import draw_plan

        figures.mkdir(parents=True, exist_ok=True)
        for one in plans:
            draw_plan(scene, one, figures)
    return plans


def plan_check_job(
    folder: Path, *, n: int = 32, seed: int = 0, force: bool = False
) -> pd.DataFrame:
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
    # Here, not above: it loads matplotlib, which a plan alone does without.
    from ridgebayes.commands.plan_figures import draw_check

    scenes = sobol_scenes(n, rng=seed)
    with new_folder(folder, force=force, about=CHECK_CSV) as partial, Progress(1) as progress:
        with progress.stage("scenes"):
            found = check_plans(scenes, progress=progress.detail)
        write_csv(found, partial / CHECK_CSV)
        draw_check(found, partial)
        write_text(_report(found), partial / "report.md")
    return found


def _report(found: pd.DataFrame) -> str:
    """Return the check as Markdown: what it shows, and a table of every row."""
    neglected = found[~found["simulated"]]
    within = neglected["true_change"] <= neglected["relative"]
    shown = ["scene", "effect", "number", "estimate", "true_change", "relative", "simulated"]
    lines = [
        "# Check of the estimates",
        "",
        f"{found['scene'].nunique()} scenes spread by a Sobol sequence; each effect was toggled "
        "on its own, with the rest as planned, and the true change of the transition loads "
        "compared with the estimate and with the accuracy that the scene wants.",
        "",
        f"- {int(within.sum())} of {len(neglected)} neglected effects change loads by no more "
        "than the accuracy wanted.",
        f"- {int(found['honest'].sum())} of {len(found)} estimates are reliable: not below the "
        "true change where it matters, and at most ten times above it.",
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
