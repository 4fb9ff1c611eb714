"""Units of columns: from header texts, exactly, everywhere or nowhere."""

import functools
import re
from fractions import Fraction

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.scene.units import Dimension, to_si

_KEYS: dict[Dimension, tuple[str, ...]] = {
    "length": ("a", "b", "pitch", "R", "D", "thickness", "offset", "gap"),
    "pressure": ("E", "p", "p_lower"),
    "line load": ("line", "line_lower"),
    "force": ("force", "force_lower"),
}
DIMENSIONS = {key: dimension for dimension, keys in _KEYS.items() for key in keys}
_NONE = ("", "-", "1")  # units of a column without one
_MOST_ROUNDED = 10_000  # distinct numbers
_STYLES = (
    (re.compile(r"(.*?)\s*\[([^\[\]]*)\]"), True),
    (re.compile(r"(.*?)\s*\(([^()]*)\)"), True),
    (re.compile(r"(.*),\s*([^,]*)"), False),
    (re.compile(r"(.*?)\s+/\s+(\S+)"), False),
    (re.compile(r"(.*?)\s+in\s+(\S+)"), False),
    (re.compile(r"([^/]*?)/\(?([^()]+)\)?"), False),  # "Width/mm"
    (re.compile(r"(.*)_([^_]+_per_[^_]+)"), False),  # "load_N_per_mm"
    (re.compile(r"(.*)_([^_]+)"), False),
)
# Common spellings of units that pint knows under another name.
_SPELLINGS = (
    *(("²", "^2"), ("³", "^3"), ("·", "*"), ("⁻¹", "^-1"), ("mm2", "mm^2"), ("cm2", "cm^2")),
    *(("m2", "m^2"), ("Zoll", "inch"), ('"', "inch"), ("kpa", "kPa"), ("kp", "kilopond")),
    *(("KPa", "kPa"), ("Mpa", "MPa"), ("gf", "gram_force"), ("kgram_force", "kilogram_force")),
)
NUMBER = re.compile(r"\s*[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?\s*", re.A)
# Exponents as Fortran prints them: with a D, or of three digits and without any letter.
FORTRAN = re.compile(r"\s*([+-]?(?:\d+\.\d*|\.\d+))(?:[dD]([+-]?\d+)|([+-]\d{3}))\s*", re.A)
_POWER = re.compile(r"(?:1e|10\s?\^?)\s?(-?\d)")


@functools.lru_cache(maxsize=1000)
def unit_factor(unit: str, dimension: Dimension) -> Fraction | None:
    """Return how many SI units a unit is; None if it is no unit of the dimension.

    Examples
    --------
    >>> unit_factor("N/mm²", "pressure")
    Fraction(1000000, 1)
    >>> unit_factor("mm", "pressure") is None
    True
    """
    for written, known in _SPELLINGS:
        unit = unit.replace(written, known)
    if not unit.strip():
        return None
    try:
        return to_si(f"1 {unit}", dimension)
    except InputError:
        return None


def split_header(header: str) -> tuple[str, str]:
    """Return a header's words, and what stands in place of a unit.

    Examples
    --------
    >>> split_header("Ridge width [mm]"), split_header("E, kPa"), split_header("p / kPa")
    (('Ridge width', 'mm'), ('E', 'kPa'), ('p', 'kPa'))
    >>> split_header("Load, total"), split_header("p_kPa")
    (('Load, total', ''), ('p', 'kPa'))
    """
    for pattern, strict in _STYLES:
        if match := pattern.fullmatch(header):
            words, unit = match.group(1).strip(), match.group(2).strip().replace("_per_", "/")
            # "Load N/mm" is no load in N over mm, and "load_N_mm" none in mm.
            last = re.split(r"[\s_]+", words)[-1]
            is_sure = is_unit(unit) and last != "per" and not is_unit(last)
            if words and (strict or is_sure):
                return words, unit
    return header, ""


def is_unit(text: str) -> bool:
    """Return whether text is a unit of length, pressure, line load or force."""
    return any(unit_factor(text, dimension) is not None for dimension in _KEYS)


def column_unit(key: str, header: str, explicit: str | None, where: str) -> tuple[str, Fraction]:
    """Return the unit of a column and its factor to SI; no unit and 1 if it has none.

    Parameters
    ----------
    key : str
        Quantity in the column: one of `DIMENSIONS`, or a dimensionless quantity.
    header : str
        The file's header.
    explicit : str or None
        The unit that the mapping gives; ``1`` for none.
    where : str
        Name that messages show.

    Raises
    ------
    InputError
        If the unit is not understood, is of another dimension, or differs from the header's.
    """
    words, unit = split_header(header)
    place = f"{where}, header {header!r}"
    if explicit is not None and explicit not in _NONE and unit and key in DIMENSIONS:
        dimension = DIMENSIONS[key]
        own = unit_factor(unit, dimension)
        if own is not None and own != unit_factor(explicit, dimension):
            raise InputError(f"{place}: the mapping says {explicit!r}; expected one unit a column")
    if explicit is not None:
        unit = explicit.strip()
    if key not in DIMENSIONS:
        if unit == "%":
            return "%", Fraction(1, 100)
        if power := _POWER.fullmatch(unit):
            return unit, Fraction(10) ** int(power[1])
        if is_unit(unit) or (explicit is not None and unit not in _NONE):
            raise InputError(f"{place}: unit {unit!r}: expected {key} is a plain number, or in %")
        return "", Fraction(1)
    dimension = DIMENSIONS[key]
    if unit in _NONE:
        # "a_mm" without a unit would make metres of millimetres wherever R has one.
        last = re.split(r"[\s_/]+", words)[-1]
        if explicit is None and last != words and unit_factor(last, dimension) is not None:
            raise InputError(
                f"{place}: {last!r} may be its unit; expected --map '{key}={header};{last}', or "
                "1 in its place for no unit"
            )
        return "", Fraction(1)
    factor = unit_factor(unit, dimension)
    if factor is None or factor <= 0:
        raise InputError(
            f"{place}: {unit!r} is no unit of {dimension}: expected a unit such as [mm], [kPa] or "
            f"[N/mm], or in the mapping {key}={header};1 for none"
        )
    return unit, factor


def divided(over: FloatArray, *under: FloatArray) -> FloatArray:
    """Divide an array by others, each of shape (n_row,) or ().

    Quotients err by some units of the last place; those of at most 14 digits are as a person would
    write them, where there are not over 10,000 distinct ones.
    """
    with np.errstate(all="ignore"):
        found = functools.reduce(np.divide, under, over)
    place, distinct = pd.factorize(found.ravel(), use_na_sentinel=False)
    if distinct.size > _MOST_ROUNDED:
        return np.asarray(found)
    short = np.array([float(f"{one:.14g}") for one in distinct])
    near = np.isclose(short, distinct, rtol=2e-15, atol=0.0)
    return np.where(near, short, distinct)[place].reshape(found.shape)
