"""Read scene files (TOML, with or without units) into the numbers of a `Scene`, and write them.

Keys: `[body]` radius, youngs_modulus, poissons_ratio, ogden; `[texture]` (or several `[[texture]]`)
ridge_width, groove_width, groove_depth, corner_radius, offset, role, max_p_over_E; `[load]` one
of max (p), line (P' = 2 R p), force with length (of the cylinder) and p_over_E, and friction;
`[accuracy]` relative. Radius, modulus, ratio, widths, depth, corner radius, offset and load may be
distributions (`distributions.grammar`). Each `[[joint]]` correlates some of them: `of` lists their
places such as body.radius, and `correlation` is the matrix of their normal scores.
"""

import json
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PlainValidator,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
)

from ridgebayes._types import NEO_HOOKEAN, Json
from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import LARGEST_TEXT, read_bytes
from ridgebayes.scene import fields
from ridgebayes.scene.units import LENGTHS, Body, Dimension, is_uncertain, over_body, to_si

DEFAULT_LOAD = 0.02  # p/E of the study
# Fields of `Texture` that follow from several keys of a file, by their names in `over_body`.
DERIVED = {
    "a": "a_over_R",
    "b": "b_over_R",
    "depth": "groove_depth_over_R",
    "corner": "corner_radius_over_R",
    "offset": "offset",
}
_COPIED = ("role", "max_p_over_E")  # fields of `Texture` that equal a key of the file


@dataclass(frozen=True)
class _Measure:
    """A number, in SI units if the file has units, and the value as written.

    The value of a distribution is its median; its draws come from `source`.
    """

    value: Fraction
    raw: Any
    source: Any = None  # a `scene.uncertain.Source`
    has_unit: bool | None = None  # None: unknown, as for Python objects


def _measure(
    dimension: Dimension, raw: object, info: ValidationInfo, *, may_be_zero: bool = False
) -> _Measure:
    """Read a quantity: text with a unit, a plain number, or a distribution of either."""

    def refuse_negative(value: float | Fraction) -> None:
        if value < 0 or (value == 0 and not may_be_zero):
            raise ValueError(f"must be {'>= 0' if may_be_zero else '> 0'}")

    if (measure := _read_uncertain(dimension, raw, info, refuse_negative)) is not None:
        return measure
    if not isinstance(raw, str | int | float) or isinstance(raw, bool):
        raise ValueError("must be a number, or text with a number and a unit")
    try:
        # Exact decimals: ratios of round numbers are round.
        value = to_si(raw, dimension) if isinstance(raw, str) else Fraction(repr(raw))
    except InputError as error:
        raise ValueError(str(error).removeprefix(f"{raw!r}: ")) from None
    except ValueError:
        raise ValueError("must be finite") from None
    refuse_negative(value)
    return _Measure(value, raw, has_unit=isinstance(raw, str))


def _read_uncertain(
    dimension: Dimension | None,
    raw: object,
    info: ValidationInfo,
    refuse_invalid: Callable[[float], object],
) -> _Measure | None:
    """Return the measure of a distribution of valid values; None if the value is plain."""
    is_text = isinstance(raw, str)
    if isinstance(raw, int | float | list | dict) or (is_text and not is_uncertain(str(raw))):
        return None
    from ridgebayes.scene.uncertain import read_source  # loads scipy, only if a value is uncertain

    try:
        source = read_source(dimension, raw, (info.context or {}).get("folder", Path()))
    except InputError as error:
        raise ValueError(str(error).removeprefix(f"{raw!r}: ")) from None
    if source is None:
        return None
    for end in source.ends:
        try:
            refuse_invalid(end)
        except ValueError as error:
            rule = error.errors()[0]["msg"] if isinstance(error, ValidationError) else str(error)
            raise ValueError(
                f"{rule.removeprefix('Value error, ')}, got a distribution that reaches {end:.3g}; "
                "expected one without values outside, such as a truncated one"
            ) from None
    return _Measure(Fraction(repr(source.median)), raw, source, source.has_unit)


def _or_uncertain(raw: object, plain: ValidatorFunctionWrapHandler, info: ValidationInfo) -> object:
    """Read a number without a unit, or a distribution of valid numbers."""
    measure = _read_uncertain(None, raw, info, plain)
    return plain(raw) if measure is None else measure


_Uncertain = WrapValidator(_or_uncertain)
_Length = Annotated[_Measure, PlainValidator(partial(_measure, "length"))]
_LengthOrZero = Annotated[_Measure, PlainValidator(partial(_measure, "length", may_be_zero=True))]
_Pressure = Annotated[_Measure, PlainValidator(partial(_measure, "pressure"))]
_LineLoad = Annotated[_Measure, PlainValidator(partial(_measure, "line load"))]
_Force = Annotated[_Measure, PlainValidator(partial(_measure, "force"))]


def _key(description: str, default: Any = None) -> Any:
    """Return the field of an optional key."""
    return Field(default=default, description=description)


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class _Body(_Section):
    radius: _Length | None = _key("of the cylinder")
    youngs_modulus: _Pressure | None = _key("at small strain")
    poissons_ratio: Annotated[fields.PoissonsRatio, _Uncertain] = _key("0 to 0.5", 0.5)
    ogden: fields.OgdenTerms = _key("shares and exponents, see below", NEO_HOOKEAN)


class _Texture(_Section):
    ridge_width: _Length = Field(description="of the flat top")
    groove_width: _Length = Field(description="between two ridges")
    groove_depth: _Length | None = _key("without it grooves have no floor")
    corner_radius: _LengthOrZero | None = _key("without it corners are sharp")
    offset: Annotated[fields.Offset, _Uncertain] = _key(
        "of the body from a groove's centre: -0.5 to 0.5 pitches, or `uniform`", 0.0
    )
    role: fields.Role = _key("or `held-out`: not fitted", "calibration")
    max_p_over_E: fields.Positive | None = _key("highest load on it alone")


class _Load(_Section):
    max: _Pressure | None = _key("force over the area 2 R times length")
    line: _LineLoad | None = _key("force over the length")
    force: _Force | None = _key("force, spread over `length`")
    length: _Length | None = _key("of the cylinder along the ridges")
    p_over_E: Annotated[fields.Positive, _Uncertain] | None = _key(
        "`max` over Young's modulus; 0.02 without any load"
    )
    friction: fields.NotNegative = _key("Coulomb's coefficient", 0.0)


class _Accuracy(_Section):
    relative: fields.Relative | None = _key("required accuracy of each transition load")


class _Joint(_Section):
    of: list[str] = Field(min_length=2, description="places, such as `texture.ridge_width`")
    correlation: list[list[float]] | None = _key("matrix, of normal scores")
    draws: Any = _key("rows of joint draws, without `correlation`")


class _SceneFile(_Section):
    body: _Body = _Body()
    texture: Annotated[list[_Texture], Field(min_length=1)]
    load: _Load = _Load()
    accuracy: _Accuracy = _Accuracy()
    joint: Annotated[list[_Joint], Field(default_factory=list)]


SECTIONS: dict[str, type[BaseModel]] = {
    "body": _Body,
    "texture": _Texture,
    "load": _Load,
    "accuracy": _Accuracy,
    "joint": _Joint,
}


def read_scene_file(path: Path) -> Json:
    """Read a scene file into the plain numbers of a `Scene`.

    Parameters
    ----------
    path : pathlib.Path
        The TOML file.

    Returns
    -------
    dict
        Keywords of `Scene`, with a dict of keywords of `Texture` for each texture. Uncertain
        values are at their medians.

    Raises
    ------
    InputError
        If the file cannot be read, is not TOML, has an unknown or missing key, a value that breaks
        its rule, units for only some values, or more than one load. One message lists all errors.

    Notes
    -----
    The radius is 1 if neither it nor units are given. Without a load, p/E is at most 0.02, as in
    the study.
    """
    try:
        path.stat()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    content = read_bytes(path, LARGEST_TEXT)
    try:
        data = tomllib.loads(content.decode("utf-8-sig"))
    # Deeply nested brackets raise RecursionError.
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: {fields.syntax_error(content, error)}") from None
    return _keywords(_validate(data, str(path), path.parent), str(path))


def scene_values(data: Json) -> Json:
    """Return the keywords of a `Scene` from the tables of a file; errors name ``scene``."""
    return _keywords(_validate(data, "scene", Path()), "scene")


def _keywords(scene: _SceneFile, where: str) -> Json:
    """Return the keywords of a `Scene`, over R and E; only the exact ratios are rounded."""
    placed = [("body", scene.body), *zip(_places(scene), scene.texture, strict=True)]
    at = {
        f"{section}.{key}": value
        for section, model in [*placed, ("load", scene.load)]
        for key, value in model
        if value is not None
    }
    measures = {place: value for place, value in at.items() if isinstance(value, _Measure)}
    exact = at | {place: measure.value for place, measure in measures.items()}
    textures, shared = [], dict[str, Any]()
    for place in _places(scene):
        shared = {name: _rounded(value) for name, value in over_body(exact, place).items()}
        named = {name: shared.pop(key) for key, name in DERIVED.items() if key in shared}
        copied = {key: at[f"{place}.{key}"] for key in _COPIED if f"{place}.{key}" in at}
        textures.append(named | copied)
    # The rest, nu and the load, is the same for all textures.
    values = shared | {"textures": textures, "friction": scene.load.friction}
    values |= {"ogden": scene.body.ogden, "relative": scene.accuracy.relative}
    values["body"] = _body(scene, measures)
    sources = {place: x.source for place, x in measures.items() if x.source is not None}
    if not sources and not scene.joint:
        return values
    # Imported here because it loads scipy, which certain scenes do not need.
    from ridgebayes.scene.uncertain import Uncertain

    medians = at | {place: float(measure.value) for place, measure in measures.items()}
    joint = [dict(section) for section in scene.joint]
    try:
        return values | {"uncertain": Uncertain.of(sources, medians, joint)}
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _places(scene: _SceneFile) -> list[str]:
    """Return the places of the textures, as messages name them."""
    n = len(scene.texture)
    return [f"texture[{i}]" for i in range(1, n + 1)] if n > 1 else ["texture"]


def _rounded(value: object) -> object:
    """Return an exact number as a float; infinity, which records refuse, on overflow."""
    try:
        return float(value) if isinstance(value, Fraction) else value
    except OverflowError:
        return float("inf")


def _validate(data: Json, where: str, folder: Path) -> _SceneFile:
    single = isinstance(data.get("texture"), dict)
    tables = {**data, "texture": [data["texture"]]} if single else data
    try:
        scene = _SceneFile.model_validate(tables, context={"folder": folder})
    except ValidationError as error:
        lines = fields.findings(error, where, _suggest_key)
        text = "\n".join(lines)
        raise InputError(text.replace("texture[1]", "texture") if single else text) from None
    problems = _conflicts(scene)
    if problems:
        raise InputError("\n".join(f"{where}: {problem}" for problem in problems))
    return scene


def _suggest_key(place: tuple[int | str, ...]) -> str:
    """Return a suggestion for an unknown key."""
    section, key = place[0], str(place[-1])
    keys = list(SECTIONS if len(place) == 1 else SECTIONS[str(section)].model_fields)
    longer = [name for name in keys if key.lower() in name]
    near = longer if len(key) > 2 and longer else get_close_matches(key.lower(), keys, 1, 0.5)
    if near:
        return f"did you mean {' or '.join(near)}?"
    others = [name for name, model in SECTIONS.items() if key in model.model_fields]
    return f"it belongs to [{others[0]}]" if others else f"expected one of {', '.join(keys)}"


def _conflicts(scene: _SceneFile) -> list[str]:
    """Return the broken rules between keys."""
    textures = zip(_places(scene), scene.texture, strict=True)
    with_units: list[str] = []
    plain: list[str] = []
    for section, model in (("body", scene.body), *textures, ("load", scene.load)):
        for key, value in model:
            if isinstance(value, _Measure) and value.has_unit is not None:
                where = with_units if value.has_unit else plain
                where.append(f"{section}.{key} = {value.raw!r}")
    problems = []
    if with_units and plain:
        problems.append(
            f"{', '.join(with_units)}: with a unit, but {', '.join(plain)}: without; give units "
            "everywhere or nowhere"
        )
    if with_units and scene.body.radius is None:
        problems.append("body.radius: missing; widths with units need it")
    load = scene.load
    keys = ("max", "line", "force", "p_over_E")
    loads = [f"load.{key}" for key in keys if getattr(load, key) is not None]
    if len(loads) > 1:
        problems.append(f"{', '.join(loads)}: give one of them")
    if load.force is not None and load.length is None:
        problems.append("load.length: missing; a force is spread over it")
    if (load.max or load.line or load.force) and scene.body.youngs_modulus is None:
        problems.append(f"body.youngs_modulus: missing; {loads[0]} needs it")
    return problems


def _body(scene: _SceneFile, measures: Mapping[str, _Measure]) -> Body:
    """Return the body of a scene with units, at medians; an empty body without units."""
    if not any(measure.has_unit for measure in measures.values()):
        return Body()
    load = scene.load
    text = next((str(measure.raw) for measure in (load.max, load.line, load.force) if measure), "")
    if load.force and load.length:
        text += f" on {load.length.raw}"
    radius, modulus, length = (
        measure.value if measure else None
        for measure in (scene.body.radius, scene.body.youngs_modulus, load.length)
    )
    return Body(radius, modulus, length, text)


def scene_text(values: Json) -> str:
    """Return the text of a scene file without units.

    Parameters
    ----------
    values : dict
        Fields of `Scene`, with textures as dicts without default values.

    Returns
    -------
    str
        TOML, without the keys whose default means "not given".
    """
    names = {LENGTHS.get(key, key): name for key, name in DERIVED.items()}
    names |= {name: name for name in _COPIED}
    load = {"p_over_E": values["p_over_E"], "friction": values["friction"] or None}
    sections: list[tuple[str, Json]] = [
        ("[body]", {"radius": 1.0, "poissons_ratio": values["nu"], "ogden": values["ogden"]}),
        *(
            ("[[texture]]", {key: texture.get(name) for key, name in names.items()})
            for texture in values["textures"]
        ),
        ("[load]", load),
        ("[accuracy]", {"relative": values["relative"]}),
    ]
    parts = []
    for title, keys in sections:
        # ASCII strings and floats are the same in JSON and TOML.
        lines = [f"{key} = {json.dumps(value)}" for key, value in keys.items() if value is not None]
        if lines:
            parts.append("\n".join([title, *lines]) + "\n")
    return "\n".join(parts)
