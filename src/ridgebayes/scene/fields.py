"""Rules that scene files and the records of a scene share, and messages about broken rules."""

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

# A line that is no TOML but was meant as a quantity: a decimal comma, or a unit without quotes.
_QUANTITY_LINE = re.compile(
    r"\s*([\w.]+\s*=\s*)([+-]?[0-9][0-9.,]*)[ \t]*([^\s\"'#\[\],][^\"'#]*)?(#.*)?"
)

_MOST_TERMS, _LEAST, _MOST = 3, 0.5, 30  # of Ogden's material, and sizes of its exponents


def _offset(raw: object) -> float | str:
    if raw == "uniform":
        return "uniform"
    number = isinstance(raw, int | float) and not isinstance(raw, bool)
    if not (number and -0.5 <= raw <= 0.5):  # type: ignore[operator]
        raise ValueError("must be a fraction of a pitch from -0.5 to 0.5, or 'uniform'")
    return float(raw)  # type: ignore[arg-type]


def _ogden(raw: object) -> Ogden:
    rule = "must be one to three pairs [share, exponent]"
    if not isinstance(raw, list | tuple) or not 1 <= len(raw) <= _MOST_TERMS:
        raise ValueError(rule)
    numbers = [x for pair in raw if isinstance(pair, list | tuple) for x in pair]
    plain = all(isinstance(x, int | float) and not isinstance(x, bool) for x in numbers)
    if not plain or any(not isinstance(pair, list | tuple) or len(pair) != 2 for pair in raw):
        raise ValueError(rule)
    terms = tuple((float(share), float(exponent)) for share, exponent in raw)
    if not all(share > 0 and _LEAST <= abs(exponent) <= _MOST for share, exponent in terms):
        raise ValueError(f"{rule}, shares > 0, exponents from {_LEAST} to {_MOST} in size")
    if not math.isclose(math.fsum(share for share, _ in terms), 1.0, abs_tol=1e-9):
        raise ValueError("shares must sum to 1")
    return terms


# The rules of scene files and of the records below.
Positive = PositiveFloat
NotNegative = NonNegativeFloat
PoissonsRatio = Annotated[float, Field(ge=0.0, le=0.5)]
Relative = Annotated[float, Field(gt=0.0, lt=1.0)]
Offset = Annotated[float | Literal["uniform"], PlainValidator(_offset)]
OgdenTerms = Annotated[Ogden, BeforeValidator(_ogden)]
Role = Literal["calibration", "held-out"]


def shape_rules(values: Mapping[str, Any]) -> dict[str, tuple[Any, str]]:
    """Return by name whether values of a texture fit together, and the rule.

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
    """Frozen; no unknown names, no silent conversions, no NaN; errors are `InputError`."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise InputError("\n".join(findings(error, type(self).__name__))) from None


def findings(
    error: ValidationError, where: str, hint: Callable[[tuple[int | str, ...]], str] | None = None
) -> list[str]:
    """Say each finding of pydantic as place, key, value and rule.

    Parameters
    ----------
    error : pydantic.ValidationError
        Error that validation raised.
    where : str
        File or record name.
    hint : callable, optional
        Function from the place of an unknown key to a hint at the key that was meant.

    Returns
    -------
    list of str
        One line a finding.
    """
    lines = []
    every = error.errors(include_url=False)
    unknown = [finding["loc"] for finding in every if finding["type"] == "extra_forbidden"]
    meant = {place: "" if hint is None else hint(place) for place in unknown}
    for finding in every:
        *table, name = finding["loc"] or ("",)
        asked = f"did you mean {name}?"
        if finding["type"] == "missing" and any(
            list(place[:-1]) == table and text == asked for place, text in meant.items()
        ):
            continue  # reported once, as the unknown key that it was written as
        key = ""
        for part in finding["loc"]:
            key += f"[{part + 1}]" if isinstance(part, int) else f"{'.' if key else ''}{part}"
        rule = finding["msg"].removeprefix("Value error, ")
        if finding["type"] == "extra_forbidden":
            rule = "; ".join(filter(None, ("unknown key", meant[finding["loc"]])))
        elif finding["type"] == "missing":
            rule = "missing; expected a value"
        shown = "" if finding["type"] == "missing" else f" = {shown_value(finding['input'])}"
        # A rule between several keys names them itself.
        about = f"{key}{shown}: " if key else ""
        lines.append(f"{where}: {about}{rule[:1].lower()}{rule[1:]}")
    return lines


def syntax_error(content: bytes, error: Exception) -> str:
    """Say why a file is not TOML: in the words of a quantity where it was meant as one."""
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
