"""Recognition of headers by the words in `words.toml`, and of units and numbers."""

import functools
import math
import re
import unicodedata
from collections.abc import Collection, Iterable, Mapping
from fractions import Fraction
from pathlib import Path

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, FloatArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import read_toml
from ridgebayes.scene.units import Dimension, to_si
from ridgebayes.table.columns import NAMES
from ridgebayes.table.rules import row_codes

_WORDS = read_toml(Path(__file__).with_name("words.toml"))
_UNITS = _WORDS["units"]
DIMENSIONS: dict[str, Dimension] = {
    key: dimension for dimension, keys in _WORDS["dimensions"].items() for key in keys
}
_PLACES = [re.compile(pattern) for pattern in _UNITS["places"]]
MOST_DISTINCT = 10_000  # largest number of distinct values that Python code loops over
NUMBER = re.compile(r"\s*[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?\s*", re.A)
# Fortran prints exponents with a D, or with three digits and without a letter.
FORTRAN = re.compile(r"\s*([+-]?(?:\d+\.\d*|\.\d+))(?:[dD]([+-]?\d+)|([+-]\d{3}))\s*", re.A)
_POWER = re.compile(r"(?:1e|10\s?\^?)\s?(-?\d)")


@functools.lru_cache(maxsize=1000)
def unit_factor(unit: str, dimension: Dimension) -> Fraction | None:
    """Return the factor of a unit to SI; None if it is not a unit of the dimension.

    Examples
    --------
    >>> unit_factor("N/mm²", "pressure")
    Fraction(1000000, 1)
    >>> unit_factor("mm", "pressure") is None
    True
    """
    for spelling, name in _UNITS["spellings"].items():
        unit = unit.replace(spelling, name)
    if not unit.strip():
        return None
    try:
        return to_si(f"1 {unit}", dimension)
    except InputError:
        return None


def load_kind(unit: str) -> str:
    """Return the key of the kind of load that a unit has: p, line or force; empty if none.

    Examples
    --------
    >>> load_kind("N/mm"), load_kind("mm")
    ('line', '')
    """
    kinds = ("p", "line", "force")
    return next((key for key in kinds if unit_factor(unit, DIMENSIONS[key]) is not None), "")


def split_header(header: str) -> tuple[str, str]:
    """Split a header into its words and the text in place of a unit.

    Examples
    --------
    >>> split_header("Ridge width [mm]"), split_header("E, kPa"), split_header("p / kPa")
    (('Ridge width', 'mm'), ('E', 'kPa'), ('p', 'kPa'))
    >>> split_header("Load, total"), split_header("p_kPa")
    (('Load, total', ''), ('p', 'kPa'))
    """
    for pattern in _PLACES if header not in NAMES else ():  # avoids the slow import of units
        if match := pattern.fullmatch(header):
            words, unit = match.group(1).strip(), match.group(2).strip().replace("_per_", "/")
            # "Load N/mm" is not in mm, nor is "load_N_mm": the word before the unit is a unit.
            last = re.split(r"[\s_]+", words)[-1]
            is_sure = is_unit(unit) and last != "per" and not is_unit(last)
            if words and (pattern in _PLACES[:2] or is_sure):
                return words, unit
    return header, ""


def is_unit(text: str) -> bool:
    """Return whether text is a unit of length, pressure, line load or force."""
    is_number = NUMBER.fullmatch(text) is not None
    dimensions = () if is_number else _WORDS["dimensions"]
    return any(unit_factor(text, dimension) is not None for dimension in dimensions)


def number_and_unit(text: str) -> tuple[float, str]:
    """Return the number at the beginning of a text (NaN if there is none), and the rest.

    Examples
    --------
    >>> number_and_unit("0.05 N"), number_and_unit("half")
    ((0.05, 'N'), (nan, ''))
    """
    match = NUMBER.match(text)
    return (math.nan, "") if match is None else (float(match[0]), text[match.end() :].strip())


def column_unit(key: str, header: str, explicit: str | None) -> tuple[str, Fraction, str]:
    """Return the unit of a column, its factor to SI, and the broken rule; "" and 1 if none.

    Parameters
    ----------
    key : str
        Quantity in the column: one of `DIMENSIONS`, or a dimensionless quantity.
    header : str
        Header in the file.
    explicit : str or None
        Unit in the mapping; ``1`` for no unit, None to use the header's unit.

    Examples
    --------
    >>> column_unit("a", "w [mm]", None), column_unit("a", "w [mm]", "um")[2]
    (('mm', Fraction(1, 1000), ''), "the mapping says 'um'; expected one unit a column")
    """
    words, unit = split_header(header)
    dimension, header_unit, unity = DIMENSIONS.get(key), unit, Fraction(1)
    unit = unit if explicit is None else explicit.strip()
    factor = unit_factor(unit, dimension) if dimension else None
    if unit in _UNITS["none"]:
        # A header such as "a mm" must not be read as a number without unit.
        last = re.split(r"[\s_/]+", words)[-1]
        is_unit_too = dimension and explicit is None and last != words
        if dimension and is_unit_too and unit_factor(last, dimension) is not None:
            way = f"expected --map '{key}={header};{last}', or 1 in its place for no unit"
            return "", unity, f"{last!r} may be its unit; {way}"
        return "", unity, ""
    if dimension is None:
        power = _POWER.fullmatch(unit)
        if unit == "%" or power:
            return unit, Fraction(10) ** int(power[1]) if power else Fraction(1, 100), ""
        is_wrong = explicit is not None or is_unit(unit)
        rule = f"unit {unit!r}: expected {key} is a plain number, or in %"
        return "", unity, rule if is_wrong else ""
    if factor is None or factor <= 0:
        way = f"a unit such as [mm], [kPa] or [N/mm], or in the mapping {key}={header};1 for none"
        return "", unity, f"{unit!r} is no unit of {dimension}: expected {way}"
    if unit_factor(header_unit, dimension) not in (None, factor):
        return "", unity, f"the mapping says {explicit!r}; expected one unit a column"
    return unit, factor, ""


def divided(over: FloatArray, *under: FloatArray) -> FloatArray:
    """Divide an array by others, each of shape (n_row,) or ().

    Numbers within rounding of a decimal with 14 digits count as that decimal. Their quotients are
    exact before one rounding, so that equal widths in any unit give equal ratios. With over 10,000
    distinct rows, quotients have rounding errors of some units in the last place.
    """
    with np.errstate(all="ignore"):
        quotient = np.asarray(functools.reduce(np.divide, under, over))
    parts = [part.ravel() for part in np.broadcast_arrays(over, *under)]
    codes = row_codes(*parts)
    first = np.unique(codes, return_index=True)[1]  # codes count rows in order of appearance
    if len(first) > MOST_DISTINCT:
        return quotient
    distinct, decimal = quotient.ravel()[first], functools.cache(_decimal)
    rows = np.stack([part[first] for part in parts], axis=1)
    for i in np.flatnonzero(np.isfinite(rows).all(axis=1) & np.isfinite(distinct)).tolist():
        distinct[i] = float(functools.reduce(Fraction.__truediv__, map(decimal, rows[i].tolist())))
    return np.asarray(distinct[codes].reshape(quotient.shape))


def _decimal(number: float) -> Fraction:
    """Return a number exactly, or the decimal with 14 digits that it is within rounding of."""
    short = f"{number:.14g}"
    return Fraction(short if math.isclose(float(short), number, rel_tol=2e-15) else number)


def _any_of(words: Iterable[str]) -> str:
    """Return a pattern of any of the words, with COUNTED replaced by the counted objects."""
    return rf"(?:{'|'.join(words)})".replace("COUNTED", rf"(?:{'|'.join(_WORDS['counted'])})")


# Key, pattern of its words, and pattern of words that exclude it. The first match wins.
_PATTERNS = [
    (key, re.compile(_any_of(words["words"])), re.compile(_any_of(words.get("but_not", [r"(?!)"]))))
    for key, words in _WORDS["keys"].items()
]
_TERMS = {term: _any_of(count["words"]) for term, count in _WORDS["counts"].items()}
NOT_READ, DISGUISES, OPTIONS = (_WORDS[name] for name in ("not_read", "disguises", "options"))
RECOGNISED = _WORDS["recognised"]
OF_NODES, OF_CORNERS = _WORDS["nodes"], _WORDS["corners"]
ANSYS_CLOSED = _WORDS["status"]["ansys_closed"]
TIME_ROUNDING = _WORDS["calculix"]["time_rounding"]
N_MEAN = _WORDS["columns"]["n_mean"]  # headers of the number of measurements of a mean
COUNTS = {term: count["said"] for term, count in _WORDS["counts"].items()}
STATUS_RULE = (
    "expected open or 0, closed or 1, or an empty cell; --closed-is says which codes are contact"
)
_LOWER, _FILLERS = (
    re.compile(rf"\b{_any_of(_WORDS['columns'][name])}\b") for name in ("lower", "fillers")
)
NOTHING = re.compile(rf"\s*{_any_of(_WORDS['columns']['nothing'])}\s*", re.I)
_COUNTER = re.compile(_any_of(_WORDS["columns"]["counter"]))
_NO_CORNER = re.compile(_any_of(_WORDS["columns"]["no_corner"]))
_LOADS = ("load", "p", "line")
_RATIO = re.compile(r"(.+?) ?(?:/|\bover\b|\bdurch\b) ?(.+)")


def plain(text: str) -> str:
    """Return text in small letters without accents, and without signs except ``/``, ``*``, ``%``.

    Examples
    --------
    >>> plain("RidgeWidth"), plain("Flächen-Pressung"), plain("a / R")
    ('ridge width', 'flachen pressung', 'a / r')
    """
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    text = unicodedata.normalize("NFKD", text.lower().replace("ß", "ss"))
    text = "".join(sign for sign in text if not unicodedata.combining(sign))
    return re.sub(r"[^a-z0-9/*\u03bd%]+", " ", text.replace("'", "")).strip()


def key_of(words: str) -> str:
    """Return the key of ``--map`` that a header's words mean; empty if they are not recognised.

    Examples
    --------
    >>> [key_of(text) for text in ("Stegbreite", "Groove width", "Normalkraft", "p over E", "Note")]
    ['a', 'b', 'load', 'p_over_E', '']
    """
    text = plain(words)
    if match := _RATIO.fullmatch(text):
        key, under = (_key_of(part) for part in match.groups())
        over_R = key if key in ("a", "b", "offset") else match[1] if match[1] in ("a", "b") else ""
        if (under := "D" if match[2] == "d" else under) in ("R", "D") and over_R:
            return f"{over_R}_over_{under}"
        is_line = re.fullmatch(r"\(?2 ?\*? ?r ?\*? ?e\)?", match[2]) is not None
        if key in _LOADS and (under == "E" or is_line):
            return "p_over_E"
        if under in ("R", "E"):
            return ""
    return _key_of(text)


def _key_of(text: str) -> str:
    for key, yes, no in _PATTERNS:
        if yes.search(text) and not no.search(text):
            is_error = key.startswith(("load_s", "rel_s"))
            if is_error and _key_of(yes.sub("", text).strip()) not in ("", *_LOADS):
                return ""  # the sd of another quantity, such as E
            is_lower = key in _LOADS and _LOWER.search(text)
            return f"{key}_lower" if is_lower else key
    return ""


def is_likely(key: str, is_bare: bool, words: str, unit: str) -> bool:
    """Return whether a column of these words and unit may be a quantity that no word names.

    Words that belong to the quantity, but exclude this column, make it unlikely. In bare tables no
    column has a unit.
    """
    keys = _LOADS if key == "load" else (key,)
    is_excluded = any(yes.search(plain(words)) for name, yes, _ in _PATTERNS if name in keys)
    if is_excluded or _COUNTER.search(words.lower()) or (key == "Q" and count_term(words)):
        return False
    if key == "Q" or is_bare:
        return not unit
    return bool(load_kind(unit)) if key == "load" else unit_factor(unit, "length") is not None


def count_term(words: str) -> str:
    """Return the counted objects, a key of `COUNTS`, that words name; empty if they name none.

    Examples
    --------
    >>> count_term("Anzahl Stege"), count_term("contacts")
    ('ridges', '')
    """
    return next((term for term, regex in _TERMS.items() if re.search(regex, plain(words))), "")


def named(words: str, vocabulary: Mapping[str, Collection[str]]) -> str:
    """Return the key whose words, without signs and capitals, are these; empty if there is none.

    Examples
    --------
    >>> named("STAT", OF_CORNERS), named("Node Label", OF_NODES), named("Note", OF_NODES)
    ('status', 'node', '')
    """
    return next((key for key, names in vocabulary.items() if plain(words) in names), "")


def corners_of(headers: Iterable[str]) -> dict[str, tuple[str, int, str]]:
    """Return key, count and counted objects of headers with one column per count.

    Such headers are at least two that differ in one whole number only. All numbers must be even if
    no word names the counted objects.

    Examples
    --------
    >>> corners_of(["a", "F at 4 ridges", "F at 6 ridges"])
    {'F at 4 ridges': ('load', 4, 'ridges'), 'F at 6 ridges': ('load', 6, 'ridges')}
    """
    groups: dict[str, dict[str, int]] = {}
    for header in headers:  # "#4" is the number of a column whose header stands twice
        if len(numbers := re.findall(r"(?<![#\d])\d+", header)) == 1 and len(numbers[0]) <= 6:
            groups.setdefault(re.sub(r"\d+", "*", header), {})[header] = int(numbers[0])
    corners: dict[str, tuple[str, int, str]] = {}
    for template, counts in groups.items():
        words = plain(template.replace("*", " "))
        term, rest = count_term(words), " ".join(_FILLERS.sub(" ", words).split())
        key = key_of(rest) if rest else "load"
        is_count = term or all(n % 2 == 0 for n in counts.values())
        is_load = key in (*_LOADS, "p_over_E")
        if len(counts) > 1 and is_count and is_load and not _NO_CORNER.search(words):
            corners |= {header: (key, n, term) for header, n in counts.items()}
    return corners


def repeats_of(headers: Iterable[str]) -> dict[str, str]:
    """Return the number of each header if the headers differ in one number only; else nothing.

    Examples
    --------
    >>> repeats_of(["Force 1 (N)", "Force 2 (N)"]), repeats_of(["Force", "Load"])
    ({'Force 1 (N)': '1', 'Force 2 (N)': '2'}, {})
    """
    parts = {header: re.split(r"(\d+)", header) for header in headers}
    numbers = {header: words[1] for header, words in parts.items() if len(words) == 3}
    templates = {(words[0], *words[2:]) for words in parts.values()}
    are_repeats = len(templates) == 1 and len(set(numbers.values())) == len(parts) > 1
    return numbers if are_repeats else {}


def touching(
    words: "pd.Series[str]", closed_is: Collection[int] = ()
) -> tuple[FloatArray, BoolArray]:
    """Return gaps of -inf (closed), inf (open) or NaN (empty), and a mask of invalid cells.

    Parameters
    ----------
    words : Series of str
        Cells of a status column.
    closed_is : collection of int, optional
        Codes that mean contact; all other whole numbers mean no contact.

    Examples
    --------
    >>> gap, bad = touching(pd.Series(["open", "Closed", "", "maybe"]))
    >>> gap.tolist(), bad.tolist()
    ([inf, -inf, nan, nan], [False, False, False, True])
    """
    status, plain = _WORDS["status"], words.str.strip().str.lower()
    is_open, closed = (plain.isin(status[state]).to_numpy(bool) for state in ("open", "closed"))
    if closed_is:
        code = pd.to_numeric(plain, errors="coerce").to_numpy(float)
        closed = np.isin(code, list(closed_is)) | (closed & np.isnan(code))
        is_whole = np.isfinite(code) & (np.trunc(code) == code)
        is_open = ~closed & (is_whole | (is_open & np.isnan(code)))
    gap = np.where(is_open, np.inf, np.where(closed, -np.inf, np.nan))
    return gap, ~(is_open | closed | (plain == "").to_numpy(bool))
