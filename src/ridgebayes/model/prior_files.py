"""Priors as text: a TOML file of replacements for the default ones.

A table for each form, and one for the error models:

    [hybrid]
    c1 = "lognormal(1.382, 0.1)"   # median, sd of the logarithm
    c2 = "normal(0, 0.05)"         # mean, sd
    [power-law]
    K = "lognormal(auto, 30 %)"    # of every texture; auto: smooth Hertz at the texture's pitch
    [noise]
    sigma = "halfnormal(0.05)"     # scale
    df = "gamma(2, 0.1)"           # shape, rate
"""

import re
import tomllib
from dataclasses import fields
from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.model.default_priors import default_priors
from ridgebayes.model.forms import FORMS, PowerLaw
from ridgebayes.model.observations import Observations
from ridgebayes.model.priors import Gamma, HalfNormal, LogNormal, Normal, Prior
from ridgebayes.runtime.reading import LARGEST_TEXT, read_text
from ridgebayes.runtime.text import one_line_message

_KINDS: dict[str, type[Prior]] = {
    "normal": Normal,
    "lognormal": LogNormal,
    "halfnormal": HalfNormal,
    "gamma": Gamma,
}
_CALL = re.compile(r"\s*(\w+)\s*\(([^()]*)\)\s*")
_OF_ERRORS = "noise"


def read_priors(path: Path, data: Observations) -> dict[str, dict[str, Prior]]:
    """Read a file of priors.

    Parameters
    ----------
    path : Path
        TOML file.
    data : Observations
        Rows, whose textures the power law has a K for.

    Returns
    -------
    dict of str to dict of str to Prior
        By form name, or ``noise``, and parameter name: what `rb.compare` takes as ``priors``.

    Raises
    ------
    InputError
        If the file cannot be read, or names a form or distribution that there is not; the key and
        the value are named.
    """
    try:
        content = tomllib.loads(read_text(path, LARGEST_TEXT))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not TOML: {one_line_message(error)}") from None
    found: dict[str, dict[str, Prior]] = {}
    for owner, table in content.items():
        if owner not in (*FORMS, _OF_ERRORS) or not isinstance(table, dict):
            known = ", ".join(f"[{name}]" for name in (*FORMS, _OF_ERRORS))
            raise InputError(f"{path}: expected tables {known}, got {owner!r}")
        found[owner] = {}
        for name, text in table.items():
            where = f"{path}: [{owner}] {name}"
            if owner == PowerLaw.name and name == "K":
                found[owner] |= _of_every_texture(text, data, where)
            else:
                found[owner][name] = parse_prior(text, where)
    return found


def parse_prior(text: object, where: str, auto: float | None = None) -> Prior:
    """Return the prior that a text such as ``normal(0, 0.05)`` stands for.

    Parameters
    ----------
    text : object
        What a file holds.
    where : str
        Place that errors name.
    auto : float, optional
        What ``auto`` stands for as a median.

    Raises
    ------
    InputError
        If it is no known distribution, or a number is missing or out of its range.
    """
    call = _CALL.fullmatch(text) if isinstance(text, str) else None
    if call is None or call[1] not in _KINDS:
        known = ", ".join(_usage(name) for name in _KINDS)
        raise InputError(f"{where}: expected one of {known}, got {text!r}")
    kind = _KINDS[call[1]]
    names, parts = [f.name for f in fields(kind)], call[2].split(",")
    if len(parts) != len(names):
        raise InputError(f"{where}: expected {_usage(call[1])}, got {text!r}")
    numbers: list[float] = []
    for name, part in zip(names, parts, strict=True):
        numbers.append(_number(part.strip(), name, numbers, auto, f"{where} = {text!r}"))
    try:
        return kind(*numbers)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _of_every_texture(text: object, data: Observations, where: str) -> dict[str, Prior]:
    default = default_priors(PowerLaw().bind(data.textures, data.labels))
    own = {name: prior for name, prior in default.items() if isinstance(prior, LogNormal)}
    return {name: parse_prior(text, where, float(prior.median)) for name, prior in own.items()}


def _number(part: str, name: str, before: list[float], auto: float | None, where: str) -> float:
    if part == "auto" and name == "median" and auto is not None:
        return auto
    digits, percent = part.removesuffix("%").strip(), part.endswith("%")
    try:
        value = float(digits)
    except ValueError:
        raise InputError(f"{where}: expected a number for {name}, got {part!r}") from None
    if not percent:
        return value
    if name == "log_sd":
        return value / 100
    if name == "sd" and before:
        return abs(before[0]) * value / 100
    raise InputError(
        f"{where}: percent: expected only for sd after a mean, or log_sd, got {part!r}"
    )


def _usage(name: str) -> str:
    return f"{name}({', '.join(f.name for f in fields(_KINDS[name]))})"
