"""Scene files: TOML with units or without, to the plain numbers of a `Scene`, and back.

Keys: `[body]` radius, youngs_modulus, poissons_ratio; `[texture]` (or several `[[texture]]`)
ridge_width, groove_width, groove_depth, corner_radius, offset, role, max_p_over_E; `[load]` one
of max (p), line (P' = 2 R p), force with length (of the cylinder) and p_over_E, and friction;
`[accuracy]` relative.
"""

import json
import re
import tomllib
from dataclasses import dataclass
from difflib import get_close_matches
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, PlainValidator, ValidationError

from ridgebayes._types import Json
from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import LARGEST_TEXT, read_bytes
from ridgebayes.runtime.text import one_line_message
from ridgebayes.scene import fields
from ridgebayes.scene.body import Body
from ridgebayes.scene.units import Dimension, to_si, with_point

# A texture's keys in a file, and the fields of a `Texture` that they become.
_TEXTURE_KEYS = {
    "ridge_width": "a_over_R",
    "groove_width": "b_over_R",
    "groove_depth": "groove_depth_over_R",
    "corner_radius": "corner_radius_over_R",
    "offset": "offset",
    "role": "role",
    "max_p_over_E": "max_p_over_E",
}


@dataclass(frozen=True)
class _Measure:
    """A number in SI units, or the plain number of a file without units; and what was written."""

    value: Fraction
    raw: str | float


def _measured(dimension: Dimension, raw: object, *, may_be_zero: bool = False) -> _Measure:
    """Read a quantity: text with a unit, or a plain number."""
    if not isinstance(raw, str | int | float) or isinstance(raw, bool):
        raise ValueError("must be a number, or text with a number and a unit")
    try:
        # The decimal as written, so that ratios come out as a person would write them.
        value = to_si(raw, dimension) if isinstance(raw, str) else Fraction(repr(raw))
    except InputError as error:
        raise ValueError(str(error).removeprefix(f"{raw!r}: ")) from None
    except ValueError:
        raise ValueError("must be finite") from None
    if value < 0 or (value == 0 and not may_be_zero):
        raise ValueError(f"must be {'>= 0' if may_be_zero else '> 0'}")
    return _Measure(value, raw)


_Length = Annotated[_Measure, PlainValidator(partial(_measured, "length"))]
_LengthOrZero = Annotated[_Measure, PlainValidator(partial(_measured, "length", may_be_zero=True))]
_Pressure = Annotated[_Measure, PlainValidator(partial(_measured, "pressure"))]
_LineLoad = Annotated[_Measure, PlainValidator(partial(_measured, "line load"))]
_Force = Annotated[_Measure, PlainValidator(partial(_measured, "force"))]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class _Body(_Section):
    radius: _Length | None = None
    youngs_modulus: _Pressure | None = None
    poissons_ratio: fields.PoissonsRatio = 0.5


class _Texture(_Section):
    ridge_width: _Length
    groove_width: _Length
    groove_depth: _Length | None = None
    corner_radius: _LengthOrZero | None = None
    offset: fields.Offset = 0.0
    role: fields.Role = "calibration"
    max_p_over_E: fields.Positive | None = None


class _Load(_Section):
    max: _Pressure | None = None
    line: _LineLoad | None = None
    force: _Force | None = None
    length: _Length | None = None
    p_over_E: fields.Positive | None = None
    friction: fields.NotNegative = 0.0


class _Accuracy(_Section):
    relative: fields.Relative | None = None


class _SceneFile(_Section):
    body: _Body = _Body()
    texture: Annotated[list[_Texture], Field(min_length=1)]
    load: _Load = _Load()
    accuracy: _Accuracy = _Accuracy()


_SECTIONS: dict[str, type[BaseModel]] = {
    "body": _Body,
    "texture": _Texture,
    "load": _Load,
    "accuracy": _Accuracy,
}
# What is no TOML but was meant as a quantity: a decimal comma, or a unit without quotes.
_QUANTITY_LINE = re.compile(
    r"\s*([\w.]+\s*=\s*)([+-]?[0-9][0-9.,]*)[ \t]*([^\s\"'#\[\],][^\"'#]*)?(#.*)?"
)


def read_body(path: Path) -> Body:
    """Read what a scene file gives with units, for loads and lengths beside it.

    Parameters
    ----------
    path : pathlib.Path
        The TOML file.

    Returns
    -------
    Body
        Empty where the file has no units.

    Raises
    ------
    InputError
        As `read_scene_file` does.
    """
    scene = _read(path)
    body, load = scene.body, scene.load
    if body.radius is None or not isinstance(body.radius.raw, str):
        return Body()
    words = next((str(one.raw) for one in (load.max, load.line, load.force) if one), "")
    if load.force and load.length:
        words += f" on {load.length.raw}"
    modulus = body.youngs_modulus.value if body.youngs_modulus else None
    return Body(body.radius.value, modulus, load.length.value if load.length else None, words)


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
    return _plain(_read(path))


def _read(path: Path) -> _SceneFile:
    """Read a scene file, and check every rule of keys and between them."""
    try:
        path.stat()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    content = read_bytes(path, LARGEST_TEXT)
    try:
        data = tomllib.loads(content.decode("utf-8"))
    # A thousand brackets in each other: RecursionError.
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: {_syntax_error(content, error)}") from None
    single = isinstance(data.get("texture"), dict)
    try:
        scene = _SceneFile(**{**data, "texture": [data["texture"]]} if single else data)
    except ValidationError as error:
        lines = fields.findings(error, str(path), _meant)
        raise InputError(
            "\n".join(line.replace("texture[1]", "texture") if single else line for line in lines)
        ) from None
    problems = _clashes(scene)
    if problems:
        raise InputError("\n".join(f"{path}: {problem}" for problem in problems))
    return scene


def _syntax_error(content: bytes, error: Exception) -> str:
    """Say why a file is not TOML: in the words of a quantity where it was meant as one."""
    place = re.search(r"at line (\d+)", str(error))
    if isinstance(error, tomllib.TOMLDecodeError) and place is not None:
        number = int(place[1])
        quantity = _QUANTITY_LINE.fullmatch(content.decode("utf-8").split("\n")[number - 1])
        if quantity is not None:
            key, value, unit = quantity[1], quantity[2], (quantity[3] or "").strip()
            wrong = "a decimal comma" if "," in value else "a unit without quotes"
            right = f'"{with_point(value)} {unit}"' if unit else with_point(value)
            given = f"{key}{value} {unit}".strip()
            return f"line {number}: {given}: has {wrong}; expected {key}{right}"
    return f"not a TOML file in UTF-8: {one_line_message(error)}"


def _meant(place: tuple[int | str, ...]) -> str:
    """Say which key was meant by an unknown one."""
    section, key = place[0], str(place[-1])
    keys = list(_SECTIONS if len(place) == 1 else _SECTIONS[str(section)].model_fields)
    longer = [name for name in keys if key.lower() in name]
    near = longer if len(key) > 2 and longer else get_close_matches(key.lower(), keys, 1, 0.5)
    if near:
        return f"did you mean {' or '.join(near)}?"
    others = [name for name, model in _SECTIONS.items() if key in model.model_fields]
    return f"it belongs to [{others[0]}]" if others else f"expected one of {', '.join(keys)}"


def _clashes(scene: _SceneFile) -> list[str]:
    """Find the rules broken between keys."""
    names = [f"texture[{i}]" for i in range(1, len(scene.texture) + 1)]
    textures = zip(names if len(names) > 1 else ["texture"], scene.texture, strict=True)
    united: list[str] = []
    plain: list[str] = []
    for section, model in (("body", scene.body), *textures, ("load", scene.load)):
        for key, value in model:
            if isinstance(value, _Measure):
                where = united if isinstance(value.raw, str) else plain
                where.append(f"{section}.{key} = {value.raw!r}")
    problems = []
    if united and plain:
        problems.append(
            f"{', '.join(united)}: with a unit, but {', '.join(plain)}: without; give units "
            "everywhere or nowhere"
        )
    if united and scene.body.radius is None:
        problems.append("body.radius: missing; widths with units need it")
    load = scene.load
    keys = ("max", "line", "force", "p_over_E")
    given = [f"load.{key}" for key in keys if getattr(load, key) is not None]
    if len(given) > 1:
        problems.append(f"{', '.join(given)}: give one of them")
    if (load.force is None) != (load.length is None):
        missing = "length" if load.length is None else "force"
        problems.append(f"load.{missing}: missing; a force takes both, load.force and load.length")
    if (load.max or load.line or load.force) and scene.body.youngs_modulus is None:
        problems.append(f"body.youngs_modulus: missing; {given[0]} needs it")
    return problems


def _plain(scene: _SceneFile) -> Json:
    """Divide lengths by R and pressures by E, exactly until the last rounding."""
    body, load = scene.body, scene.load
    radius = body.radius.value if body.radius else Fraction(1)
    textures: list[Json] = [{} for _ in scene.texture]
    for texture, values in zip(scene.texture, textures, strict=True):
        for key, name in _TEXTURE_KEYS.items():
            value = getattr(texture, key)
            if value is not None:
                values[name] = _ratio(value, radius) if isinstance(value, _Measure) else value
    values = {"textures": textures, "nu": body.poissons_ratio, "friction": load.friction}
    values["relative"] = scene.accuracy.relative
    if load.p_over_E is not None:
        values["p_over_E"] = load.p_over_E
    across = 2 * radius  # P' = 2 R p
    area = across * (load.length.value if load.length else 1)
    for measure, over in ((load.max, Fraction(1)), (load.line, across), (load.force, area)):
        if measure is not None and body.youngs_modulus is not None:
            values["p_over_E"] = _ratio(measure, over * body.youngs_modulus.value)
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
        Fields of `Scene`, textures as dicts without what stands at its default.

    Returns
    -------
    str
        TOML; what stands at its default is left out where it means "not asked for".
    """
    keys_of = _TEXTURE_KEYS.items()
    textures = [{key: one.get(name) for key, name in keys_of} for one in values["textures"]]
    load = {"p_over_E": values["p_over_E"], "friction": values["friction"] or None}
    sections: list[tuple[str, Json]] = [
        ("[body]", {"radius": 1.0, "poissons_ratio": values["nu"]}),
        *(("[[texture]]", texture) for texture in textures),
        ("[load]", load),
        ("[accuracy]", {"relative": values["relative"]}),
    ]
    parts = []
    for title, keys in sections:
        # A JSON string of ASCII words is a TOML string, and a float's repr is a TOML float.
        lines = [f"{key} = {json.dumps(value)}" for key, value in keys.items() if value is not None]
        if lines:
            parts.append("\n".join([title, *lines]) + "\n")
    return "\n".join(parts)
