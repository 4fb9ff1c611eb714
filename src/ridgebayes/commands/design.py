"""`ridgebayes design`: textures that meet a goal, from a finished run and a scene."""

import re
from pathlib import Path

import pandas as pd

from ridgebayes.commands import options
from ridgebayes.commands.run_files import read_run
from ridgebayes.commands.run_folder import new_folder, write_csv
from ridgebayes.commands.terminal import Answer, files_in
from ridgebayes.errors import InputError
from ridgebayes.report.design_page import design_page, drawn_design
from ridgebayes.runtime.atomic import write_text
from ridgebayes.runtime.text import percent
from ridgebayes.scene.scene import Scene
from ridgebayes.scene.units import Body
from ridgebayes.texture_design.bodies import Tolerance
from ridgebayes.texture_design.design import design
from ridgebayes.texture_design.goals import parse_goals
from ridgebayes.texture_design.record import Design

_ABOUT = "design.json"
_LITTLE = 0.01  # of what is open: not worth a measurement


def command(asked: options.DesignOptions) -> Answer:
    """Do what the command line asks for."""
    scene = Scene.from_toml(asked.scene)
    body = scene.body
    sizes: dict[str, object] = {
        name: _bounds(text, f"--{name}", body)
        for name, text in (("a", asked.a), ("b", asked.b))
        if text is not None
    }
    if asked.step is not None:
        sizes["step"] = _length(asked.step, "--step", body)
    tolerance = Tolerance.parse(asked.tolerance, lambda text: _over_radius(text, body))
    parse_goals(asked.goal, body=body)  # before the run is read, which takes seconds
    with new_folder(asked.out, force=asked.force, about=_ABOUT) as folder:
        found = design(
            read_run(asked.folder),
            scene,
            asked.goal,
            sizes=sizes,
            tolerance=tolerance,
            loads=asked.p_over_E,
            objective=asked.objective,
            rng=asked.seed,
        )
        _write(found, folder, body)
    return _answer(found, asked.out, body)


def _over_radius(text: str, body: Body) -> float:
    """Return a length over the radius, of a text with a unit or a number."""
    return body.over_radius(text) if _has_unit(text) else float(text)


def _has_unit(text: str) -> bool:
    return re.search(r"[^\W\d_eE]", text) is not None


def _length(text: str, option: str, body: Body) -> float:
    try:
        value = _over_radius(text, body)
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
    if _has_unit(low) != _has_unit(high):
        raise InputError(f"{option} {text!r}: expected two lengths with units, or two over R")
    return _length(low, option, body), _length(high, option, body)


def _write(found: Design, folder: Path, body: Body) -> None:
    write_csv(found.designs, folder / "designs.csv")
    write_text(found.to_json(), folder / _ABOUT)
    figure = {kind: drawn_design(found, kind) for kind in ("png", "svg")}
    for kind, content in figure.items():
        (folder / f"design.{kind}").write_bytes(content)
    write_text(design_page(found, figure["png"], body), folder / "design.html")


def _answer(found: Design, out: Path, body: Body) -> Answer:
    row, check = found.best, found.check
    columns = {
        "": ["recommended" if found.feasible else "nearest"],
        "a/R": [row["a_over_R"]],
        "b/R": [row["b_over_R"]],
        "value": [row["probability"]],
        "margin": [row["margin"]],
        f"check by {check['n']:,} draws": [check["probability"]],
    }
    if "load" in row:
        columns["load"] = [row["load"]]
    if body.radius is not None:
        micrometres = 1e6 * float(body.radius)
        columns |= {
            "a (um)": [row["a_over_R"] * micrometres],
            "b (um)": [row["b_over_R"] * micrometres],
        }
    n = int(found.designs["feasible"].sum())
    told = f"{out}: {n} of {len(found.designs)} textures meet the goal"
    if found.limits is not None:
        told += f"; the nearest misses it by {-row['margin']:.3g}. {found.limits['why']}"
    told += f"\n{found.conditions}"
    warnings = []
    if row["extrapolation"]:
        warnings.append(f"the texture lies beyond what was calibrated: {row['extrapolation_of']}")
    shares = found.shares[found.shares["of"] == "Q"].sort_values("total_order", ascending=False)
    orders = {"first_order": "alone", "total_order": "with interactions"}
    shown = shares[["source", *orders]].rename(columns=orders)
    for name in orders.values():
        shown[name] = [percent(min(max(share, 0.0), 1.0)) for share in shown[name]]
    parts: list[str | pd.DataFrame] = [told, pd.DataFrame(columns)]
    if len(shown):
        parts += ["Shares of the variance of Q:", shown]
    else:
        parts.append("Q varies in too few draws to divide its variance among sources.")
    if len(found.measure):
        first = found.measure.iloc[0]
        would = f"known exactly, it would remove {percent(first['resolved'])} of the uncertainty"
        is_little = first["resolved"] < _LITTLE
        little = "nothing: no source, known exactly, would remove 1 % of the uncertainty"
        what = little if is_little else f"{first['measure']} ({would})"
        parts.append(f"What to measure next: {what}")
    return Answer(parts, found.to_dict(), files_in(out), warnings=warnings)
