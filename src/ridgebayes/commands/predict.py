"""The command `ridgebayes predict`: bands on Q at textures and loads, from a finished run."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes import drawing
from ridgebayes._types import FloatArray
from ridgebayes.commands import options
from ridgebayes.commands.parsing import parse_form, parse_inches, refuse_output
from ridgebayes.commands.run_files import read_run
from ridgebayes.commands.terminal import MOST_SHOWN, Answer
from ridgebayes.comparison.bands import bands_table, scene_bands
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.contact import scaling
from ridgebayes.contact.scaling import reduced_load
from ridgebayes.errors import InputError
from ridgebayes.predict.extrapolation import NAMES, CalibratedRange
from ridgebayes.predict.of_scene import NO_UNIT, load_unit, without_effect
from ridgebayes.predict.predict import KINDS
from ridgebayes.runtime.atomic import write_bytes
from ridgebayes.runtime.text import count
from ridgebayes.scene.scene import Scene, Texture
from ridgebayes.scene.typed import has_unit, parse_loads, parse_texture
from ridgebayes.scene.units import Body, first_quantity, is_uncertain, load_to_si
from ridgebayes.table.files import check_name, write_frame

_MAX_Q_DRAWN = 200  # largest Q for which a figure of bands shows the exact load of each step
# Relative distance of the loads on both sides of a step; larger than rounding.
_REL_STEP = np.sqrt(np.finfo(float).eps)
_PROB_ERROR = "0.005 (from the number of draws)"


def command(asked: options.Predict) -> Answer:
    """Run `ridgebayes predict`."""
    check_name(asked.out)
    refuse_output(asked.out, asked.force)
    files = [asked.out]
    if asked.plot is not None:
        refuse_output(asked.plot, asked.force, ".png", ".svg", ".pdf")
        files.append(asked.plot)
    elif asked.width is not None:
        raise InputError(f"--width {asked.width!r}: needs --plot, whose width it sets")
    width = drawing.style.WIDTH if asked.width is None else parse_inches(asked.width, "--width")
    if asked.kind not in (*KINDS, "both"):
        raise InputError(f"--kind {asked.kind!r}: expected curve, simulation or both")
    if asked.p_over_E is not None and asked.load is not None:
        raise InputError("--p-over-E and --load: expected only one of the two, got both")
    if not asked.texture and asked.scene is None:
        raise InputError("no textures; expected --texture A,B or --scene")
    if asked.p_over_E is None and asked.load is None and asked.scene is None:
        raise InputError("no loads; expected --p-over-E, --load or --scene")
    how: dict[str, Any] = {
        "prob": asked.prob,
        "kinds": KINDS if asked.kind == "both" else (asked.kind,),
    }
    form, scene, textures = parse_form(asked.form), _scene(asked), None
    if scene is not None and (scene.uncertain or any(t.offset != 0 for t in scene.textures)):
        how |= _scene_loads(asked, scene)
        run = read_run(asked.folder)
        bands = drawn = scene_bands(run, scene, form, **how)
        unit = None if asked.p_over_E is not None else _unit_of(scene.body)
    else:
        textures, loads, how["nu"], unit = _where(asked, scene)
        run = read_run(asked.folder)
        how |= {"textures": textures, "forms": [form]}
        bands = drawn = bands_table(run, loads=loads, **how)
    write_frame(bands, asked.out)
    if asked.plot is not None:
        if textures is not None:
            drawn = bands_table(run, loads=with_transitions(run, form, bands, textures), **how)
        seen = run.table.ok.frame
        figure = drawing.predictions.plot_bands(drawn, seen, form, unit=unit, width=width)
        kind = asked.plot.suffix.lower().removeprefix(".")
        write_bytes(drawing.style.as_bytes(figure, kind), asked.plot)
    answer = _answer(bands, files, unit)
    doubts = list(without_effect(scene))
    is_share = not all(map(has_unit, asked.texture or ()))
    if is_share and bands[["a_over_R", "b_over_R"]].to_numpy().max() > 1:
        doubts.append(
            "widths above the radius: without units widths are shares of the radius; write "
            "lengths with units, such as --texture '40 um,30 um' --R '8 mm'"
        )
    return replace(answer, warnings=[*doubts, *answer.warnings])


def _scene(asked: options.Predict) -> Scene | None:
    """Return the scene of the file, or of typed values if one has an error, or else None."""
    typed = {"--R": asked.R, "--E": asked.E, "--thickness": asked.thickness}
    if asked.scene is None:
        uncertain = any(is_uncertain(text) for text in (asked.load, *typed.values()) if text)
        return _typed_scene(asked) if uncertain else None
    if any(value is not None for value in typed.values()):
        raise InputError(
            "--scene, and --R or --E or --thickness: expected only one of the two, got both"
        )
    return Scene.from_toml(asked.scene)


def _typed_scene(asked: options.Predict) -> Scene:
    """Return the scene of the values on the command line, some of which have errors."""
    varies = asked.R is not None and is_uncertain(asked.R)
    if varies and not all(map(has_unit, asked.texture or ())):
        raise InputError(
            f"--R {asked.R!r}: expected textures with units beside an uncertain radius, such "
            "as --texture '0.3 mm,0.25 mm'"
        )
    # The radius is arbitrary for a pressure and for widths over R.
    body = {"radius": asked.R or "1 m", "youngs_modulus": asked.E, "poissons_ratio": asked.nu}
    load: dict[str, str] = {"length": asked.thickness} if asked.thickness else {}
    if asked.load is not None:
        highest = _highest(asked.load)
        if is_uncertain(highest) and ":" in asked.load:
            raise InputError(f"--load {asked.load!r}: expected one load where it has an error")
        quantity = first_quantity(highest) if is_uncertain(highest) else highest
        try:
            kind = load_to_si(quantity or highest)[1]
        except InputError as error:
            raise InputError(f"--load {error}") from None
        if kind != "pressure" and asked.R is None:
            raise InputError(f"--load {asked.load!r}: needs the radius; expected --R")
        load[{"pressure": "max", "line load": "line", "force": "force"}[kind]] = highest
    texts = asked.texture or ()
    shares = [parse_texture(text, "1 m" if varies else asked.R) for text in texts]
    # If the radius has no error, the widths are placeholders, replaced by widths over R below.
    widths = [text.split(",") for text in texts] if varies else [["1 m", "1 m"]]
    textures = [{"ridge_width": a, "groove_width": b} for a, b in widths]
    data = {"body": {k: v for k, v in body.items() if v is not None}, "texture": textures}
    scene = Scene.from_dict({**data, "load": load} if load else data)
    if varies:
        return scene
    exact = tuple(Texture(a_over_R=a, b_over_R=b) for a, b in shares)
    return scene.model_copy(update={"textures": exact})


def _scene_loads(asked: options.Predict, scene: Scene) -> dict[str, Any]:
    """Return the loads at which to predict a scene with distributions; empty for its own loads."""
    for option, value in (("--texture", asked.texture), ("--nu", asked.nu)):
        if value and asked.scene is not None:
            raise InputError(
                f"--scene and {option}: a scene with distributions or an offset keeps its own "
                "values; remove one of the two options"
            )
    if asked.p_over_E is not None:
        return {"p_over_E": parse_loads(asked.p_over_E)}
    if asked.load is not None and not is_uncertain(asked.load):
        unit = load_unit(scene)
        if unit == NO_UNIT:
            raise InputError(f"--load {asked.load!r}: needs a load with a unit in --scene")
        size = scene.body.p_over_E(f"1 {unit}")
        loads = parse_loads(asked.load, "--load", lambda text: scene.body.p_over_E(text) / size)
        return {"load": loads}
    if asked.load is not None and asked.scene is not None:
        raise InputError("--load with an error: expected it in the scene, as load.max")
    return {}


def _unit_of(body: Body) -> tuple[float, str] | None:
    """Return the load at which p = E, in the unit of the body's loads, and the unit."""
    if body.load_unit is None:
        return None
    unit = body.load_unit[0]
    return 1 / body.p_over_E(f"1 {unit}"), unit


def _where(
    asked: options.Predict, scene: Scene | None
) -> tuple[Sequence[scaling.Texture], FloatArray, float, tuple[float, str] | None]:
    """Return textures, loads, Poisson's ratio and the unit of loads, as typed or of the scene."""
    body = Body.of(asked.R, asked.E, asked.thickness) if scene is None else scene.body
    textures = [parse_texture(text, body) for text in asked.texture or ()]
    of_scene = [] if textures or scene is None else scene.textures
    textures += [(texture.a_over_R, texture.b_over_R) for texture in of_scene]
    if asked.load is not None:
        loads = parse_loads(asked.load, "--load", body.p_over_E)
        body = replace(body, load=_highest(asked.load))
    elif asked.p_over_E is not None or scene is None:
        loads = parse_loads(asked.p_over_E or "")
    else:
        highest = [scene.highest_load(texture) for texture in of_scene] or [scene.p_over_E]
        loads = np.array(highest)[:, None]
    nu = 0.5 if scene is None else scene.nu
    return textures, loads, nu if asked.nu is None else asked.nu, _unit_of(body)


def _highest(loads: str) -> str:
    """Return the highest load of a text such as ``0.01``, ``LO:HI:N`` or ``log:LO:HI:N``."""
    return loads.split(":")[-2:][0]


def with_transitions(
    run: Comparison, form: str, bands: pd.DataFrame, textures: Sequence[scaling.Texture]
) -> FloatArray:
    """Return the loads of a table of bands, and the loads on both sides of each step of the bands.

    Bands have a step where an end or the median rises, and at the highest calibrated load. With
    these loads, a figure shows each step at its load instead of the next load of the grid.

    Parameters
    ----------
    run : Comparison
        Finished run.
    form : str
        Form, or ``average``.
    bands : pandas.DataFrame
        Bands of the form as `bands_table` returns them, with the same number of loads for each
        texture.
    textures : sequence of (float, float)
        Textures of the bands.

    Returns
    -------
    ndarray of float, shape (n_texture, n_load), dimensionless
        p/E, rising, from the first to the last load of each texture.
    """
    source = run if form == "average" else run.fits[form]
    calibrated = CalibratedRange.of(source.averaged[0][0])  # all posteriors have the same rows
    Q = np.arange(4, min(int(bands["q_upper"].max()), _MAX_Q_DRAWN) + 4, 2)
    kinds, tail = bands["kind_of_band"].unique(), (1 - bands["prob"].iloc[0]) / 2
    rows = bands[bands["kind_of_band"] == kinds[0]]
    a, b, nu, p = (
        rows[name].to_numpy(float).reshape(len(textures), -1)
        for name in ("a_over_R", "b_over_R", "nu", "p_over_E")
    )
    loads = [calibrated.load_max / reduced_load(1.0, nu[:, :1])]
    for kind in kinds:
        at = source.predict_load(a[:, :1], b[:, :1], Q, nu=nu[:, :1], kind=kind)
        loads += [at.quantile(share) for share in (tail, 0.5, 1 - tail)]
    # The loads on both sides show where bands step up and where extrapolation begins.
    sides = [np.hstack(loads) * (1 + side) for side in (-_REL_STEP, _REL_STEP)]
    ends = p.min(axis=1, keepdims=True), p.max(axis=1, keepdims=True)
    return np.sort(np.clip(np.hstack([p, *sides]), *ends), axis=1)


def _answer(bands: pd.DataFrame, files: Sequence[Path], unit: tuple[float, str] | None) -> Answer:
    """Return the answer: a table of the bands at some loads of each texture, and warnings."""
    by_texture = ["kind_of_band", "a_over_R", "b_over_R"]
    shown = pd.concat(_thinned(part) for _, part in bands.groupby(by_texture, sort=False))
    low, high = (shown[name].astype(int).astype(str) for name in ("q_lower", "q_upper"))
    prob = bands["prob"].iloc[0]
    columns = {
        "a/R": shown["a_over_R"],
        "b/R": shown["b_over_R"],
        "p/E": shown["p_over_E"],
        **({} if unit is None else {f"load in {unit[1]}": shown["p_over_E"] * unit[0]}),
        "Q (median)": shown["q_median"].astype(int),
        f"{100 * prob:g} % band": low.where(low == high, low + " to " + high),
    }
    if shown["extrapolation"].any():
        columns["extrapolated in"] = shown["extrapolation_of"]
    if len(set(bands["kind_of_band"])) > 1:
        columns = {"band of the": shown["kind_of_band"], **columns}
    beyond = bands["extrapolation_of"][bands["extrapolation"]]
    summary = f"{files[0]}: {count(len(bands), 'row')}; error of probabilities up to {_PROB_ERROR}"
    if len(shown) < len(bands):
        summary += f". {len(shown)} of the rows:"
    warnings = []
    if len(beyond):
        names = ",".join(beyond.unique()).split(",")
        verb = "lies" if len(beyond) == 1 else "lie"
        warnings.append(
            f"{len(beyond)} of {count(len(bands), 'row')} {verb} beyond the calibrated range of "
            f"{', '.join(name for name in NAMES if name in names)}"
        )
    return Answer((summary, pd.DataFrame(columns)), bands, files, warnings=warnings)


def _thinned(part: pd.DataFrame) -> pd.DataFrame:
    """Return at most `MOST_SHOWN` rows, evenly spaced from the first to the last."""
    places = np.unique(np.linspace(0, len(part) - 1, min(len(part), MOST_SHOWN)).astype(int))
    return part.iloc[places]
