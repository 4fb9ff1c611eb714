"""Parse textures (``A,B``) and loads (``LO:HI:N``) typed by users, with or without units."""

import re
from collections.abc import Callable

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.scene.units import Body

MOST_LOADS = 10_000  # a larger number is probably a typing error


def parse_texture(
    text: str, body: Body | str | None = None, where: str = "--texture"
) -> tuple[float, float]:
    """Return the ridge and groove width over the radius from ``A,B``.

    Parameters
    ----------
    text : str
        Two fractions of the radius, or two lengths with units.
    body : Body or str, optional
        Body, or its radius as typed, to divide lengths by.
    where : str, optional
        Place that errors name.

    Raises
    ------
    InputError
        If the text is not a texture, a width is not finite and above 0, or lengths have no radius.

    Examples
    --------
    >>> parse_texture("0.2 mm, 160 um", "8 mm"), parse_texture("0.025,0.02")
    ((0.025, 0.02), (0.025, 0.02))
    """
    parts, where = text.split(","), f"{where} {text!r}"
    with_unit = [has_unit(part) for part in parts]
    pair = f"{where}: expected A,B, two widths with one comma, such as 0.022,0.02 or '1 mm,2 mm'"
    if len(parts) != 2:
        raise InputError(pair)
    if any(with_unit) and not all(with_unit):
        rule = "both widths with a unit, or both without (shares of the radius)"
        raise InputError(f"{where}: expected {rule}")
    try:
        if not isinstance(body, Body):
            body = Body.of(body if any(with_unit) else None, None)
        a, b = (over_radius(part, body) for part in parts)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    except ValueError:
        raise InputError(pair) from None
    if not (0 < a < float("inf") and 0 < b < float("inf")):
        raise InputError(f"{where}: expected both widths finite and > 0")
    return a, b


def has_unit(text: str) -> bool:
    """Return whether a text has a unit after a number."""
    return re.search(r"\d.*[^\W\d_eE]", text) is not None


def over_radius(text: str, body: Body) -> float:
    """Return a length over the radius, from a text with a unit or a number."""
    return body.over_radius(text) if has_unit(text) else float(text)


def parse_loads(
    text: str, option: str = "--p-over-E", number: Callable[[str], float] = float
) -> FloatArray:
    """Return the loads of a single number, LO:HI:N or log:LO:HI:N, shape (N,).

    Parameters
    ----------
    text : str
        Loads as typed.
    option : str, optional
        Place that errors name.
    number : callable, optional
        Function that converts the text of a load to a number.

    Raises
    ------
    InputError
        If the text has none of these forms, or N is above 10,000.

    Examples
    --------
    >>> [parse_loads(text).tolist() for text in ("0.01", "0.01:0.03:2", "log:0.0001:0.01:3")]
    [[0.01], [0.01, 0.03], [0.0001, 0.001, 0.01]]
    """
    is_log, parts = text.startswith("log:"), text.removeprefix("log:").split(":")
    if len(parts) == 1 and not is_log:
        parts = [text, text, "1"]
    try:
        low, high, n = number(parts[0]), number(parts[1]), int(parts[2])
        valid = len(parts) == 3 and 0 < low <= high < float("inf") and 1 <= n <= MOST_LOADS
    except InputError as error:
        raise InputError(f"{option} {error}") from None
    except (ValueError, IndexError):
        valid = False
    if not valid:
        raise InputError(
            f"{option} {text!r}: expected one load, LO:HI:N or log:LO:HI:N with 0 < LO <= HI and "
            f"N from 1 to {MOST_LOADS}, such as 0.001:0.02:50"
        )
    return np.geomspace(low, high, n) if is_log else np.linspace(low, high, n)
