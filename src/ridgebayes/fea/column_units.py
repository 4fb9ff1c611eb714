"""Units of columns: from header texts, exactly, everywhere or nowhere."""

import functools
import re
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.scene.units import Dimension, to_si
from ridgebayes.table.rules import row_codes

_KEYS: dict[Dimension, tuple[str, ...]] = {
    "length": ("a", "b", "pitch", "R", "D", "thickness", "offset", "gap"),
    "pressure": ("E", "p", "p_lower"),
    "line load": ("line", "line_lower"),
    "force": ("force", "force_lower"),
}
DIMENSIONS = {key: dimension for dimension, keys in _KEYS.items() for key in keys}
_NONE = ("", "-", "1")  # units of a column without one
_MOST_EXACT = 10_000  # distinct rows that are divided as fractions
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
# What people write for units that pint knows under another name.
_SPELLINGS = (
    *(("²", "^2"), ("³", "^3"), ("·", "*"), ("⁻¹", "^-1"), ("mm2", "mm^2"), ("cm2", "cm^2")),
    *(("m2", "m^2"), ("Zoll", "inch"), ('"', "inch"), ("kpa", "kPa"), ("kp", "kilopond")),
    *(("KPa", "kPa"), ("Mpa", "MPa"), ("gf", "gram_force"), ("kgram_force", "kilogram_force")),
)
NUMBER = re.compile(r"\s*[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?\s*", re.A)
_POWER = re.compile(r"(?:1e|10\s?\^?)\s?(-?\d)")


@dataclass(frozen=True, eq=False)
class Quantity:
    """Numbers of one unit.

    Parameters
    ----------
    name : str
        What messages call it.
    values : ndarray of float, shape (n_row,) or (), in its unit
        NaN where a cell is empty.
    unit : str
        Its unit's name; empty for a plain number.
    factor : Fraction
        From its unit to the SI unit; 1 for a plain number.
    """

    name: str
    values: FloatArray
    unit: str = ""
    factor: Fraction = Fraction(1)


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


def split_header(header: str) -> tuple[str, str, bool]:
    """Return a header's words, what stands in place of a unit, and whether it must be one.

    Examples
    --------
    >>> split_header("Ridge width [mm]"), split_header("E, kPa"), split_header("p / kPa")
    (('Ridge width', 'mm', True), ('E', 'kPa', False), ('p', 'kPa', False))
    >>> split_header("Load, total"), split_header("p_kPa")
    (('Load, total', '', False), ('p', 'kPa', False))
    """
    for pattern, strict in _STYLES:
        if match := pattern.fullmatch(header):
            words, unit = match.group(1).strip(), match.group(2).strip().replace("_per_", "/")
            # "Load N/mm" is no load in N over mm, and "load_N_mm" none in mm.
            last = re.split(r"[\s_]+", words)[-1]
            is_sure = is_unit(unit) and last != "per" and not is_unit(last)
            if words and (strict or is_sure):
                return words, unit, strict
    return header, "", False


def is_unit(text: str) -> bool:
    """Return whether text is a unit of length, pressure, line load or force."""
    return any(unit_factor(text, dimension) is not None for dimension in _KEYS)


def column_unit(key: str, header: str, explicit: str | None, where: str) -> tuple[str, Fraction]:
    """Return the unit of a column and its factor to SI; no unit and 1 if it has none.

    Parameters
    ----------
    key : str
        What the column is: one of `DIMENSIONS`, or dimensionless.
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
    words, unit, _ = split_header(header)
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


def divided(over: Quantity, *under: Quantity, by: int = 1) -> FloatArray:
    """Divide a quantity by others and by a whole number.

    Parameters
    ----------
    over, *under : Quantity
        Shapes (n_row,) or ().
    by : int, optional
        One more divisor.

    Returns
    -------
    ndarray of float, shape (n_row,) or (), dimensionless
        The numbers nearest to the quotients of the decimals as written; of columns with more than
        10,000 distinct rows, within some units of the last place.
    """
    factor = over.factor / by
    for one in under:
        factor /= one.factor
    arrays = np.broadcast_arrays(over.values, *(one.values for one in under))
    shape = arrays[0].shape
    columns = [np.atleast_1d(one).astype(float) for one in arrays]
    if factor == 1 and not under:
        return columns[0].reshape(shape)
    code = row_codes(*columns)
    first = np.unique(code, return_index=True)[1]
    if first.size > _MOST_EXACT:
        with np.errstate(all="ignore"):
            found = columns[0] * float(factor)
            for column in columns[1:]:
                found = found / column
        return found.reshape(shape)
    exact = np.array([_quotient(factor, *(one[i] for one in columns)) for i in first])
    return exact[code].reshape(shape)


def _quotient(factor: Fraction, over: float, *under: float) -> float:
    if not np.isfinite([over, *under]).all():
        return float("nan")
    # The decimals as written: their quotient is the number that a person would write.
    found = factor * Fraction(repr(float(over)))
    for one in under:
        found /= Fraction(repr(float(one)))
    try:
        return float(found)
    except OverflowError:
        return float("inf") if found > 0 else float("-inf")
