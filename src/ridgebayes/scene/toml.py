"""Scene files: TOML with units or without, to the plain numbers of a `Scene`, and back.

Keys: `[body]` radius, youngs_modulus, poissons_ratio; `[texture]` (or several `[[texture]]`)
ridge_width, groove_width, groove_depth, corner_radius, offset, role, max_p_over_E; `[load]` one
of max (p), line (P' = 2 R p), force with length (of the cylinder) and p_over_E, and friction;
`[accuracy]` relative.
"""

import json
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, PlainValidator, ValidationError

from ridgebayes._types import Json
from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import LARGEST_TEXT, read_bytes
from ridgebayes.runtime.text import one_line_message
from ridgebayes.scene.fields import (
    NotNegative,
    Offset,
    PoissonsRatio,
    Positive,
    Relative,
    Role,
    findings,
)
from ridgebayes.scene.units import Dimension, to_si


@dataclass(frozen=True)
class _Measure:
    """A number in SI units, or the plain number of a file without units."""

    value: Fraction
    has_unit: bool
    raw: str | float


def _measured(dimension: Dimension, *, may_be_zero: bool = False) -> Callable[[object], _Measure]:
    """Return the parser of a quantity: text with a unit, or a plain number."""

    def parse(raw: object) -> _Measure:
        if isinstance(raw, str):
            try:
                measure = _Measure(to_si(raw, dimension), True, raw)
            except InputError as error:
                raise ValueError(str(error).removeprefix(f"{raw!r}: ")) from None
        elif isinstance(raw, int | float) and not isinstance(raw, bool):
            try:
                # The decimal as written, so that ratios come out as a person would write them.
                measure = _Measure(Fraction(repr(raw)), False, raw)
            except ValueError:
                raise ValueError("must be finite") from None
        else:
            raise ValueError("must be a number, or text with a number and a unit")
        if measure.value < 0 or (measure.value == 0 and not may_be_zero):
            raise ValueError(f"must be {'>= 0' if may_be_zero else '> 0'}")
        return measure

    return parse


_Length = Annotated[_Measure, PlainValidator(_measured("length"))]
_LengthOrZero = Annotated[_Measure, PlainValidator(_measured("length", may_be_zero=True))]
_Pressure = Annotated[_Measure, PlainValidator(_measured("pressure"))]
_LineLoad = Annotated[_Measure, PlainValidator(_measured("line load"))]
_Force = Annotated[_Measure, PlainValidator(_measured("force"))]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class _Body(_Section):
    radius: _Length | None = None
    youngs_modulus: _Pressure | None = None
    poissons_ratio: PoissonsRatio = 0.5


class _Texture(_Section):
    ridge_width: _Length
    groove_width: _Length
    groove_depth: _Length | None = None
    corner_radius: _LengthOrZero | None = None
    offset: Offset = 0.0
    role: Role = "calibration"
    max_p_over_E: Positive | None = None


class _Load(_Section):
    max: _Pressure | None = None
    line: _LineLoad | None = None
    force: _Force | None = None
    length: _Length | None = None
    p_over_E: Positive | None = None
    friction: NotNegative = 0.0


class _Accuracy(_Section):
    relative: Relative | None = None


class _SceneFile(_Section):
    body: _Body = _Body()
    texture: Annotated[list[_Texture], Field(min_length=1)]
    load: _Load = _Load()
    accuracy: _Accuracy = _Accuracy()


def read_scene_file(path: Path) -> Json:
    """Read a scene file into the plain numbers of a `Scene`.

    Parameters
    ----------
    path : pathlib.Path
        The TOML file.

    Returns
    -------
    dict
        Keywords of `Scene`, each texture a dict of keywords of `Texture`.

    Raises
    ------
    InputError
        If the file cannot be read, is not TOML, has an unknown or a missing key, a value that
        breaks its rule, units in one place and none in another, or more than one load: all such
        findings in one message.

    Notes
    -----
    Without units a missing radius is 1. Without any load, p/E goes to the 0.02 of the study.
    """
    try:
        path.stat()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    content = read_bytes(path, LARGEST_TEXT)
    try:
        data = tomllib.loads(content.decode("utf-8"))
    # A thousand brackets in each other: RecursionError.
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not a TOML file in UTF-8: {one_line_message(error)}") from None
    single = isinstance(data.get("texture"), dict)
    try:
        scene = _SceneFile(**{**data, "texture": [data["texture"]]} if single else data)
    except ValidationError as error:
        lines = findings(error, str(path))
        raise InputError(
            "\n".join(line.replace("texture[1]", "texture") if single else line for line in lines)
        ) from None
    problems = _clashes(scene)
    if problems:
        raise InputError("\n".join(f"{path}: {problem}" for problem in problems))
    return _plain(scene)


def _clashes(scene: _SceneFile) -> list[str]:
    """Find the rules broken between keys."""
    measures = {
        f"{section}.{key}": value
        for section, model in _sections(scene)
        for key, value in model
        if isinstance(value, _Measure)
    }
    problems = []
    united = [f"{key} = {m.raw!r}" for key, m in measures.items() if m.has_unit]
    plain = [f"{key} = {m.raw!r}" for key, m in measures.items() if not m.has_unit]
    if united and plain:
        problems.append(
            f"{', '.join(united)}: with a unit, but {', '.join(plain)}: without; give units "
            "everywhere or nowhere"
        )
    if united and scene.body.radius is None:
        problems.append("body.radius: missing; widths with units need it")
    loads = {key: getattr(scene.load, key) for key in ("max", "line", "force", "p_over_E")}
    given = [f"load.{key}" for key, value in loads.items() if value is not None]
    if len(given) > 1:
        problems.append(f"{', '.join(given)}: give one of them")
    if (scene.load.force is None) != (scene.load.length is None):
        missing = "length" if scene.load.length is None else "force"
        problems.append(f"load.{missing}: missing; a force takes both, load.force and load.length")
    dimensional = scene.load.max or scene.load.line or scene.load.force
    if dimensional and scene.body.youngs_modulus is None:
        problems.append(f"body.youngs_modulus: missing; {given[0]} needs it")
    return problems


def _sections(scene: _SceneFile) -> list[tuple[str, _Section]]:
    textures = [(f"texture[{i}]", texture) for i, texture in enumerate(scene.texture, start=1)]
    if len(textures) == 1:
        textures = [("texture", scene.texture[0])]
    return [("body", scene.body), *textures, ("load", scene.load)]


def _plain(scene: _SceneFile) -> Json:
    """Divide lengths by R and pressures by E, exactly until the last rounding."""
    radius = scene.body.radius.value if scene.body.radius else Fraction(1)
    textures = []
    for texture in scene.texture:
        depth, corner = texture.groove_depth, texture.corner_radius
        textures.append(
            {
                "a_over_R": _ratio(texture.ridge_width, radius),
                "b_over_R": _ratio(texture.groove_width, radius),
                "groove_depth_over_R": None if depth is None else _ratio(depth, radius),
                "corner_radius_over_R": 0.0 if corner is None else _ratio(corner, radius),
                "offset": texture.offset,
                "role": texture.role,
                "max_p_over_E": texture.max_p_over_E,
            }
        )
    values = {
        "textures": textures,
        "nu": scene.body.poissons_ratio,
        "friction": scene.load.friction,
        "relative": scene.accuracy.relative,
    }
    load, modulus = scene.load, scene.body.youngs_modulus
    if load.p_over_E is not None:
        values["p_over_E"] = load.p_over_E
    elif modulus is not None and load.max is not None:
        values["p_over_E"] = _ratio(load.max, modulus.value)
    elif modulus is not None and load.line is not None:
        values["p_over_E"] = _ratio(load.line, 2 * radius * modulus.value)  # P' = 2 R p
    elif modulus is not None and load.force is not None and load.length is not None:
        area = 2 * radius * load.length.value
        values["p_over_E"] = _ratio(load.force, area * modulus.value)
    return values


def _ratio(measure: _Measure, unit: Fraction) -> float:
    try:
        return float(measure.value / unit)
    except OverflowError:
        return float("inf")  # which the record's own rule refuses


def scene_text(values: Json) -> str:
    """Write the numbers of a `Scene` as a scene file without units.

    Parameters
    ----------
    values : dict
        Fields of `Scene`, textures as dicts.

    Returns
    -------
    str
        TOML; what stands at its default is left out where it means "not asked for".
    """
    lines = ["[body]", "radius = 1.0", f"poissons_ratio = {values['nu']!r}"]
    for texture in values["textures"]:
        keys = {
            "ridge_width": texture["a_over_R"],
            "groove_width": texture["b_over_R"],
            "groove_depth": texture["groove_depth_over_R"],
            "corner_radius": texture["corner_radius_over_R"] or None,
            "offset": texture["offset"] or None,
            "role": None if texture["role"] == "calibration" else texture["role"],
            "max_p_over_E": texture["max_p_over_E"],
        }
        lines += ["", "[[texture]]", *_entries(keys)]
    load = {"p_over_E": values["p_over_E"], "friction": values["friction"] or None}
    lines += ["", "[load]", *_entries(load)]
    if values["relative"] is not None:
        lines += ["", "[accuracy]", *_entries({"relative": values["relative"]})]
    return "\n".join(lines) + "\n"


def _entries(keys: dict[str, Any]) -> list[str]:
    # A JSON string of ASCII words is a TOML string, and a float's repr is a TOML float.
    return [f"{key} = {json.dumps(value)}" for key, value in keys.items() if value is not None]
