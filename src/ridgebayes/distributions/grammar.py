"""Distributions as text, such as ``lognormal(1.382, 10 %)``, and as plain values for JSON.

| text | |
|---|---|
| ``normal(mean, sd)`` | sd may be a percentage of the mean |
| ``lognormal(median, log_sd)`` | log_sd: sd of the natural logarithm, which may be in per cent |
| ``halfnormal(sd)`` | |
| ``gamma(shape, rate)`` | |
| ``uniform(low, high)`` | |
| ``truncated(DIST, low, high)`` | another distribution between bounds, which may be -inf or inf |
| ``empirical(FILE.csv, COLUMN)`` | sample in a column of a file, relative to the naming file |
"""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from ridgebayes._types import Json
from ridgebayes.distributions.auto import AutoLogNormal
from ridgebayes.distributions.bounded import Truncated, Uniform
from ridgebayes.distributions.distribution import Distribution, Gamma, HalfNormal, LogNormal, Normal
from ridgebayes.distributions.empirical import Empirical, read_sample
from ridgebayes.errors import InputError
from ridgebayes.runtime.text import clipped

CLOSED: dict[str, type[Distribution]] = {
    "normal": Normal,
    "lognormal": LogNormal,
    "halfnormal": HalfNormal,
    "gamma": Gamma,
    "uniform": Uniform,
}
USAGE = {
    name: f"{name}({', '.join(f.name for f in fields(kind))})" for name, kind in CLOSED.items()
} | {"truncated": "truncated(DIST, low, high)", "empirical": "empirical(FILE.csv, COLUMN)"}
_ALL: tuple[type[Distribution], ...] = (*CLOSED.values(), AutoLogNormal, Truncated, Empirical)
_KINDS = {kind.kind: kind for kind in _ALL}
_WITHOUT_UNIT = ("log_sd", "shape", "rate")
_CALL = re.compile(r"\s*(\w+)\s*\((.*)\)\s*", flags=re.DOTALL)
_COMMA = re.compile(r",(?![^(]*\))")  # a comma outside of brackets
_MAX_CHARACTERS = 1_000


def parse_distribution(
    text: object,
    where: str = "",
    *,
    number: Callable[[str], float] = float,
    folder: Path = Path(),
    auto: bool = False,
) -> Distribution:
    """Parse the text of a distribution.

    Parameters
    ----------
    text : object
        Value from a file.
    where : str, optional
        Name for messages.
    number : callable, optional
        Converts text such as ``60 kPa`` to the parameter's unit; raises ValueError.
    folder : Path, optional
        Folder of the files of samples.
    auto : bool, optional
        Whether ``auto`` is allowed as the median of a log-normal; `at_place` replaces it.

    Raises
    ------
    InputError
        If the distribution is unknown, or a number is missing or out of its range.

    Examples
    --------
    >>> parse_distribution("truncated(normal(1, 10 %), 0.9, inf)", "c")
    Truncated(base=Normal(mean=1.0, sd=0.1), low=0.9, high=inf)
    """
    call = _CALL.fullmatch(text) if isinstance(text, str) and len(text) <= _MAX_CHARACTERS else None
    place = f"{where}: " if where else ""
    if call is None or call[1] not in USAGE:
        got = clipped(text) if isinstance(text, str) else repr(text)
        raise InputError(f"{place}expected one of {', '.join(USAGE.values())}, got {got}")
    name, at = call[1], f"{where} = {clipped(str(text))}: " if where else ""
    parts = [part.strip() for part in _COMMA.split(call[2])]
    usage = USAGE[name]
    if len(parts) != usage.count(",") + 1 or not all(parts):
        raise InputError(f"{at}expected {usage}")
    arguments: list[Any] = []
    if name == "truncated":
        inner = parts.pop(0)
        arguments.append(parse_distribution(inner, where, number=number, folder=folder, auto=auto))
    try:
        if name == "empirical":
            sample = read_sample(folder / parts[0], parts[1], number)
            return Empirical.of(sample, f"{parts[1]} of {parts[0]}")
        kind = Truncated if name == "truncated" else CLOSED[name]
        if auto and name == "lognormal" and parts[0] == "auto":
            kind, arguments = AutoLogNormal, [1.0]
            parts.pop(0)
        for part, field in zip(parts, fields(kind)[len(arguments) :], strict=True):
            arguments.append(_number(part, field.name, arguments, number))
        return kind(*arguments)
    except InputError as error:
        raise InputError(f"{at}{error}") from None


def _number(part: str, name: str, before: list[Any], number: Callable[[str], float]) -> float:
    if name in ("low", "high") and part in ("-inf", "inf"):
        return float(part)  # infinite bounds have no unit; `Uniform` refuses them
    try:
        if not part.endswith("%"):
            return float(part) if name in _WITHOUT_UNIT else number(part)
        percent = float(part.removesuffix("%"))
    except InputError:
        raise  # keeps the message about a unit
    except ValueError:
        raise InputError(f"expected a number for {name}, got {clipped(part)}") from None
    if name == "log_sd":
        return percent / 100
    if name == "sd" and before:
        value: float = abs(before[0]) * percent / 100
        return value
    raise InputError(f"percent: expected only for sd after a mean, or log_sd, got {part!r}")


def to_dict(distribution: Distribution) -> Json:
    """Return a distribution as plain values for `from_dict`."""
    values = {f.name: getattr(distribution, f.name) for f in fields(distribution)}
    plain = {k: to_dict(v) if isinstance(v, Distribution) else v for k, v in values.items()}
    return {"kind": distribution.kind, **plain}


def from_dict(values: Json) -> Distribution:
    """Return the distribution described by the plain values of `to_dict`."""
    fields_of_kind: dict[str, Any] = dict(values)
    kind = _KINDS[fields_of_kind.pop("kind")]
    return kind(
        **{k: from_dict(v) if isinstance(v, dict) else v for k, v in fields_of_kind.items()}
    )


def priors_from_json(text: str) -> dict[str, Distribution]:
    """Return priors from the JSON text of `priors_to_json`."""
    return {name: from_dict(values) for name, values in json.loads(text).items()}


def priors_to_json(priors: Mapping[str, Distribution]) -> str:
    """Return priors as JSON text."""
    return json.dumps({name: to_dict(prior) for name, prior in priors.items()})
