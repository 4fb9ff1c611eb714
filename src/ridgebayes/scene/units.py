"""Quantities with units, at the border only: text in, exact numbers in SI units out."""

import functools
import re
from fractions import Fraction
from typing import Any, Literal, TypeAlias

from ridgebayes.errors import InputError

Dimension: TypeAlias = Literal["length", "pressure", "line load", "force"]

_SI: dict[Dimension, str] = {"length": "m", "pressure": "Pa", "line load": "N/m", "force": "N"}
EXAMPLES: dict[Dimension, str] = {
    "length": "0.25 mm",
    "pressure": "60 kPa",
    "line load": "20 N/m",
    "force": "5 N",
}
_DECIMAL_COMMA = re.compile(r"(?<=[0-9]),(?=[0-9])")
# One number, then unit names with one-digit powers: pint's own parser would also take "2 * 3 mm",
# and would compute "mm ** 999999".
_NUMBER = r"([+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?)"
_POWER = r"[^\W\d]+(?:(?:\*\*|\^)-?[0-9])?"
_QUANTITY = re.compile(rf"\s*{_NUMBER}\s*({_POWER}(?:\s*[*/\s]\s*{_POWER})*)\s*")

_SHOWN = 200  # characters of a text that messages show


def to_si(text: str, dimension: Dimension) -> Fraction:
    """Convert a quantity such as ``"0.25 mm"`` to its SI unit, exactly.

    Parameters
    ----------
    text : str
        A decimal number and a unit.
    dimension : {"length", "pressure", "line load", "force"}
        What the unit has to measure; the results are in m, Pa, N/m and N.

    Returns
    -------
    fractions.Fraction, scalar, SI unit of the dimension
        Exact, so that a ratio of two lengths is the number a person would write.

    Raises
    ------
    InputError
        If the text is not a number with a unit, or the unit is unknown or measures something
        else.

    Examples
    --------
    >>> float(to_si("0.25 mm", "length") / to_si("8 mm", "length"))
    0.03125
    >>> to_si("1.2 kPa", "pressure")
    Fraction(1200, 1)
    """
    match = _QUANTITY.fullmatch(text)
    shown = text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
    rule = f"must be a number and a unit of {dimension}, such as {EXAMPLES[dimension]!r}"
    if _DECIMAL_COMMA.search(text):
        rule = f"has a decimal comma; expected a point, such as {with_point(shown)!r}"
    if match is None:
        raise InputError(f"{shown!r}: {rule}")
    number, unit = match.groups()
    try:
        factor = _registry().Quantity(1, unit).to(_SI[dimension]).magnitude
    # pint lets out exceptions of many kinds on what is no unit of the kind (its own, tokenize's,
    # AttributeError, TypeError ...); some cannot be formatted with fractions, so none is shown.
    except Exception:
        raise InputError(f"{shown!r}: {rule}") from None
    try:
        return Fraction(number) * Fraction(factor)
    except ValueError:  # Python makes no integers of some thousand digits
        raise InputError(f"{shown!r}: {rule}") from None


def with_point(text: str) -> str:
    """Return text with decimal points for decimal commas.

    Examples
    --------
    >>> with_point("0,25 mm")
    '0.25 mm'
    """
    return _DECIMAL_COMMA.sub(".", text)


@functools.cache
def _registry() -> Any:
    """Load pint's unit definitions, on first use only: 0.1 s and more."""
    import pint

    return pint.UnitRegistry(non_int_type=Fraction)
