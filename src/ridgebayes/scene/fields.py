"""Rules shared by scene files and the records of a scene, and messages about broken rules."""

import math
import re
import tomllib
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    NonNegativeFloat,
    PlainValidator,
    PositiveFloat,
    ValidationError,
)

from ridgebayes._types import Ogden
from ridgebayes.errors import InputError
from ridgebayes.runtime.text import one_line_message, shown_value
from ridgebayes.scene.units import with_point
from ridgebayes.table.columns import LARGEST_WIDTH, LEAST_WIDTH

# Matches a quantity that is invalid TOML: with a decimal comma, or a unit without quotes.
_QUANTITY_LINE = re.compile(
    r"\s*([\w.]+\s*=\s*)([+-]?[0-9][0-9.,]*)[ \t]*([^\s\"'#\[\],][^\"'#]*)?(#.*)?"
)

_MAX_TERMS, _MIN_EXP, _MAX_EXP = 3, 0.5, 30  # of Ogden materials; exponents by size


def _offset(raw: object) -> float | str:
    if raw == "uniform":
        return "uniform"
    number = isinstance(raw, int | float) and not isinstance(raw, bool)
    if not (number and -0.5 <= raw <= 0.5):  # type: ignore[operator]
        raise ValueError("must be a fraction of a pitch from -0.5 to 0.5, or 'uniform'")
    return float(raw)  # type: ignore[arg-type]


def _ogden(raw: object) -> Ogden:
    rule = "must be one to three pairs [share, exponent]"
    if not isinstance(raw, list | tuple) or not 1 <= len(raw) <= _MAX_TERMS:
        raise ValueError(rule)
    numbers = [x for pair in raw if isinstance(pair, list | tuple) for x in pair]
    plain = all(isinstance(x, int | float) and not isinstance(x, bool) for x in numbers)
    if not plain or any(not isinstance(pair, list | tuple) or len(pair) != 2 for pair in raw):
        raise ValueError(rule)
    terms = tuple((float(share), float(exponent)) for share, exponent in raw)
    if not all(share > 0 and _MIN_EXP <= abs(exponent) <= _MAX_EXP for share, exponent in terms):
        raise ValueError(f"{rule}, shares > 0, exponents from {_MIN_EXP} to {_MAX_EXP} in size")
    if not math.isclose(math.fsum(share for share, _ in terms), 1.0, abs_tol=1e-9):
        raise ValueError("shares must sum to 1")
    return terms


# Field types of scene files and of records.
Positive = PositiveFloat
NotNegative = NonNegativeFloat
PoissonsRatio = Annotated[NonNegativeFloat, Field(le=0.5)]
Relative = Annotated[PositiveFloat, Field(lt=1.0)]
Offset = Annotated[float | Literal["uniform"], PlainValidator(_offset)]
OgdenTerms = Annotated[Ogden, BeforeValidator(_ogden)]
Role = Literal["calibration", "held-out"]


def shape_rules(values: Mapping[str, Any]) -> dict[str, tuple[Any, str]]:
    """Return, by name, whether the values of a texture are valid, and the rule.

    Parameters
    ----------
    values : mapping of str to float or ndarray of float
        a, b, depth and corner, over R.
    """
    a, b, depth, corner = (values[name] for name in ("a", "b", "depth", "corner"))
    width = f"from {LEAST_WIDTH:g} to {LARGEST_WIDTH:g}"
    return {
        "a": ((a >= LEAST_WIDTH) & (a <= LARGEST_WIDTH), width),
        "b": ((b >= LEAST_WIDTH) & (b <= LARGEST_WIDTH), width),
        "corner": ((corner >= 0) & (corner <= 0.5 * a), "from 0 to half the ridge width"),
        "depth": ((depth > 0) & (2 * depth >= corner), "at least half the radius of corners"),
    }


class Record(BaseModel):
    """Frozen model that refuses unknown names, other types and NaN with `InputError`."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise InputError("\n".join(findings(error, type(self).__name__))) from None


def findings(
    error: ValidationError, where: str, hint: Callable[[tuple[int | str, ...]], str] | None = None
) -> list[str]:
    """Format each error of pydantic as place, key, value and rule.

    Parameters
    ----------
    error : pydantic.ValidationError
        Error that validation raised.
    where : str
        File or record name.
    hint : callable, optional
        Function that returns a suggestion for an unknown key, given its place.

    Returns
    -------
    list of str
        One line per error.
    """
    lines = []
    errors = error.errors(include_url=False)
    unknown = [finding["loc"] for finding in errors if finding["type"] == "extra_forbidden"]
    hints = {place: "" if hint is None else hint(place) for place in unknown}
    for finding in errors:
        *table, name = finding["loc"] or ("",)
        suggestion = f"did you mean {name}?"
        if finding["type"] == "missing" and any(
            list(place[:-1]) == table and text == suggestion for place, text in hints.items()
        ):
            continue  # reported as the unknown key
        key = ""
        for part in finding["loc"]:
            key += f"[{part + 1}]" if isinstance(part, int) else f"{'.' if key else ''}{part}"
        rule = finding["msg"].removeprefix("Value error, ")
        if finding["type"] == "extra_forbidden":
            rule = "; ".join(filter(None, ("unknown key", hints[finding["loc"]])))
        elif finding["type"] == "model_type":
            rule = "must be a table"
        elif finding["type"] == "missing":
            rule = "missing; expected a value"
        shown = "" if finding["type"] == "missing" else f" = {shown_value(finding['input'])}"
        # Rules between several keys have no place; their text names the keys.
        about = f"{key}{shown}: " if key else ""
        lines.append(f"{where}: {about}{rule[:1].lower()}{rule[1:]}")
    return lines


def syntax_error(content: bytes, error: Exception) -> str:
    """Return why a file is not TOML; a line meant as a quantity has a message of its own."""
    place = re.search(r"at line (\d+)", str(error))
    if isinstance(error, tomllib.TOMLDecodeError) and place is not None:
        number = int(place[1])
        quantity = _QUANTITY_LINE.fullmatch(content.decode("utf-8").split("\n")[number - 1])
        if quantity is not None:
            key, value, unit = quantity[1], quantity[2], (quantity[3] or "").strip()
            wrong = "a decimal comma" if "," in value else "a unit without quotes"
            right = f'"{with_point(value)} {unit}"' if unit else with_point(value)
            written = f"{key}{value} {unit}".strip()
            return f"line {number}: {written}: has {wrong}; expected {key}{right}"
    return f"not a TOML file in UTF-8: {one_line_message(error)}"
