"""`ridgebayes design`: search for textures that meet a goal, given a run and a scene."""

from pathlib import Path
from warnings import catch_warnings

import pandas as pd

from ridgebayes.commands import options
from ridgebayes.commands.run_files import read_run
from ridgebayes.commands.run_folder import new_folder, write_csv
from ridgebayes.commands.terminal import Answer, files_in
from ridgebayes.errors import CautionWarning, InputError
from ridgebayes.predict.of_scene import without_effect
from ridgebayes.report.design_page import design_page, drawn_design
from ridgebayes.runtime.atomic import write_text
from ridgebayes.runtime.text import percent
from ridgebayes.scene.scene import Scene
from ridgebayes.scene.typed import has_unit, over_radius
from ridgebayes.scene.units import Body
from ridgebayes.texture_design.bodies import Tolerance
from ridgebayes.texture_design.design import design
from ridgebayes.texture_design.goals import parse_goals
from ridgebayes.texture_design.record import Design

_ABOUT = "design.json"
_MIN_RESOLVED_SHARE = 0.01  # of the uncertainty, for a recommended measurement


def command(asked: options.DesignOptions) -> Answer:
    """Find textures that meet the goals and write them, a figure and a page to the folder."""
    scene = Scene.from_toml(asked.scene)
    body = scene.body
    typed = {"a": (asked.a, _bounds), "b": (asked.b, _bounds), "step": (asked.step, _length)}
    sizes: dict[str, object] = {
        name: parse(text, f"--{name}", body)
        for name, (text, parse) in typed.items()
        if text is not None
    }
    tolerance = Tolerance.parse(asked.tolerance, body)
    parse_goals(asked.goal, body=body)  # report errors before the run is read, which takes seconds
    with (
        new_folder(asked.out, force=asked.force, about=_ABOUT) as folder,
        catch_warnings(action="ignore", category=CautionWarning),  # the answer has them
    ):
        result = design(
            read_run(asked.folder),
            scene,
            asked.goal,
            sizes=sizes,
            tolerance=tolerance,
            loads=asked.p_over_E,
            objective=asked.objective,
            rng=asked.seed,
        )
        _write(result, folder, body)
    return _answer(result, asked.out, scene)


def _length(text: str, option: str, body: Body) -> float:
    try:
        value = over_radius(text, body)
    except InputError as error:
        raise InputError(f"{option} {error}") from None
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise InputError(f"{option} {text!r}: expected a length above 0, over R or such as '10 um'")
    return value


def _bounds(text: str, option: str, body: Body) -> tuple[float, float]:
    low, colon, high = text.partition(":")
    if not colon:
        raise InputError(f"{option} {text!r}: expected LO:HI, such as 0.01:0.04 or '80 um:320 um'")
    if has_unit(low) != has_unit(high):
        raise InputError(f"{option} {text!r}: expected two lengths with units, or two over R")
    return _length(low, option, body), _length(high, option, body)


def _write(result: Design, folder: Path, body: Body) -> None:
    write_csv(result.designs, folder / "designs.csv")
    write_text(result.to_json(), folder / _ABOUT)
    for kind in ("svg", "png"):
        figure = drawn_design(result, kind)
        (folder / f"design.{kind}").write_bytes(figure)
    write_text(design_page(result, figure, body), folder / "design.html")


def _answer(result: Design, out: Path, scene: Scene) -> Answer:
    row, check, body = result.best, result.check, scene.body
    columns = {
        "": ["recommended" if result.feasible else "nearest"],
        "a/R": [row["a_over_R"]],
        "b/R": [row["b_over_R"]],
        "value": [row["probability"]],
        "margin": [row["margin"]],
        f"check by {check['n']:,} draws": [check["probability"]],
    }
    if "load" in row:
        columns["load"] = [row["load"]]
    if body.radius is not None:
        columns |= {
            f"{name} (um)": [row[f"{name}_over_R"] * 1e6 * float(body.radius)] for name in "ab"
        }
    n = int(result.designs["feasible"].sum())
    summary = f"{out}: {n} of {len(result.designs)} textures meet the goal"
    if result.limits is not None:
        summary += f"; the nearest misses it by {-row['margin']:.3g}. {result.limits['why']}"
    parts: list[str | pd.DataFrame] = [f"{summary}\n{result.conditions}", pd.DataFrame(columns)]
    shares = result.shares[result.shares["of"] == "Q"].sort_values("total_order", ascending=False)
    if len(shares):
        orders = {"first_order": "alone", "total_order": "with interactions"}
        clipped = shares[[*orders]].clip(0.0, 1.0).map(percent)
        shown = shares[["source"]].join(clipped).rename(columns=orders)
        parts += ["Shares of the variance of Q:", shown]
    else:
        parts.append("Q varies in too few draws to divide its variance among sources.")
    if len(result.measure):
        first = result.measure.iloc[0]
        text = "nothing: no source, known exactly, would remove 1 % of the uncertainty"
        if first["resolved"] >= _MIN_RESOLVED_SHARE:
            share = percent(first["resolved"])
            text = f"{first['measure']} (known exactly, it would remove {share} of the uncertainty)"
        parts.append(f"What to measure next: {text}")
    beyond = f"the texture lies beyond what was calibrated: {row['extrapolation_of']}"
    warnings = without_effect(scene, "offset") + ([beyond] if row["extrapolation"] else [])
    return Answer(parts, result.to_dict(), files_in(out), warnings=warnings)
