"""Which column of a file is which of the contract: by a mapping, by name, or by a clear guess."""

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.fea.column_units import DIMENSIONS, column_unit, split_header, unit_factor
from ridgebayes.runtime.reading import LARGEST_TEXT, read_text
from ridgebayes.runtime.text import one_line_message
from ridgebayes.table.columns import NAMES, NUMBERS

_SHOWN = 80  # characters of a key or a value that messages show


def parse_map(texts: Iterable[str]) -> dict[str, str]:
    """Return a mapping from texts ``key=header``, ``key=header;unit`` or ``gap Q=4=header``.

    Raises
    ------
    InputError
        If a text has no key or header, or a key stands twice.

    Examples
    --------
    >>> parse_map(["a=Ridge width;mm", "gap Q=4=Gap 1 [mm]", "Q=4=First", "p=Load Q=* [kPa]"])
    {'a': 'Ridge width;mm', 'gap Q=4': 'Gap 1 [mm]', 'Q=4': 'First', 'p': 'Load Q=* [kPa]'}
    """
    found: dict[str, str] = {}
    for text in texts:
        match = re.fullmatch(r"\s*((?:\w+[\s:]+)?Q?\s*=?\s*\d+|[^=]*?)\s*=\s*(.*?)\s*", text, re.S)
        if match is None or not match.group(1) or not match.group(2):
            raise InputError(f"--map {text!r}: expected KEY=HEADER, or KEY=HEADER;UNIT")
        key, header = match.groups()
        if key in found:
            raise InputError(f"--map {text!r}: expected each key once")
        found[key] = header
    return found


def read_mapping(path: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Read a mapping that is kept beside the data.

    Parameters
    ----------
    path : pathlib.Path
        A TOML file: ``[columns]`` of key and header (``a = "Ridge width [mm]"``), and optionally
        ``[values]`` of key and value (``R = "8 mm"``).

    Returns
    -------
    mapping, values : dict of str to str
        As `ridgebayes.fea.columns.read_columns` takes them.

    Raises
    ------
    InputError
        If it is not TOML, or has other keys, or others than text in columns.
    """
    try:
        content = tomllib.loads(read_text(path, LARGEST_TEXT))
    # A thousand brackets in each other: RecursionError.
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        raise InputError(f"{path}: not TOML: {one_line_message(error, 200)}") from None
    tables: dict[str, dict[str, str]] = {"columns": {}, "values": {}}
    for name, entries in content.items():
        if name not in tables or not isinstance(entries, dict):
            raise InputError(f"{path}: {name[:_SHOWN]}: expected tables [columns] and [values]")
        for key, value in entries.items():
            number = isinstance(value, int | float) and not isinstance(value, bool)
            text = value if isinstance(value, str) else _text(value)
            if not (isinstance(value, str) or (number and text and name == "values")):
                raise InputError(
                    f"{path}: [{name}] {key[:_SHOWN]} = {text[:_SHOWN] or 'what is too long'}: "
                    "expected text in quotes"
                )
            tables[name][key] = text
    return tables["columns"], tables["values"]


def _text(value: object) -> str:
    """Return a value of TOML other than text as Python writes it, or nothing if it cannot."""
    try:
        return repr(value)
    # An integer of thousands of digits, or thousands of tables in each other.
    except (ValueError, RecursionError):
        return ""


TEXTS = tuple(name for name in NAMES if name not in NUMBERS)
LOADS = ("p_over_E", "p", "line")
LOWERS = ("p_over_E_lower", "p_lower", "line_lower")
CORNERS = ("gap", "gap_over_R", "pressure", "status")
KEYS = (*NAMES, *(key for key in DIMENSIONS if key != "gap"), "load")
_PER_Q = (*LOADS, *LOWERS, "load", "rel_se", *CORNERS)
_QUANTITIES = (*NUMBERS, *DIMENSIONS, "load", "gap_over_R", "pressure")
_CONSTANTS = ("R", "E", "a", "b", "offset", *NUMBERS, *TEXTS)
_NO_CONSTANTS = ("Q", "p_over_E", "p_over_E_lower", "source")
_WIDE = re.compile(r"(.*?[\s_])?Q[\s_]*=?[\s_]*(\d{1,6})")
_KEY = re.compile(r"\s*([A-Za-z_]*?)[\s:]*Q?[\s]*[= ]?\s*(\d{1,6})\s*")
# Words in place of keys, where nothing else is mapped.
_WORDS = {
    "a": ("ridge width",),
    "b": ("groove width",),
    "R": ("radius", "cylinder radius"),
    "E": ("youngs modulus", "elastic modulus"),
    "nu": ("poissons ratio", "poisson ratio"),
    "offset": ("lateral offset",),
    "p": ("pressure",),
    "line": ("line load",),
    "a_over_R": ("a/r", "a over r"),
    "b_over_R": ("b/r", "b over r"),
    "p_over_E": ("p/e", "p over e"),
    "offset_over_R": ("offset/r",),
}
_GUESSES = {words: key for key, some in _WORDS.items() for words in some}
_WIDE_GUESSES = {"": "load", "p/e": "p_over_E", "p over e": "p_over_E", "line load": "line"}


@dataclass(frozen=True)
class Use:
    """A column of the file, and what it is.

    Parameters
    ----------
    key : str
        A contract column, or one with a dimension.
    header : str
        The file's header.
    unit : str or None
        The unit that the mapping gives; None leaves it to the header.
    Q : int or None
        Which corner, for one column per Q.
    how : {"mapped", "named", "guessed"}
        Who says so.
    """

    key: str
    header: str
    unit: str | None = None
    Q: int | None = None
    how: str = "mapped"

    @property
    def is_number(self) -> bool:
        """Whether its cells are numbers."""
        return self.key in _QUANTITIES

    @property
    def name(self) -> str:
        """The key, with the corner."""
        return self.key if self.Q is None else f"{self.key} Q={self.Q}"

    def __str__(self) -> str:
        return f"{self.name}={self.header!r}" + ("" if self.unit is None else f";{self.unit}")


def assign(
    headers: Sequence[str], mapping: Mapping[str, str], values: Mapping[str, object], where: str
) -> list[Use]:
    """Tell what each column of a file is.

    Parameters
    ----------
    headers : sequence of str
        The file's.
    mapping : mapping of str to str
        Keys to headers, with ``;unit`` where the header has none; a header with ``*`` stands for
        one column per Q, and ``Q=*`` for headers such as ``Q=4``.
    values : mapping of str to object
        Constants by key.
    where : str
        Name that messages show.

    Returns
    -------
    list of Use
        Headers that are in none are the user's own.

    Raises
    ------
    InputError
        If a key is unknown, a header is not there, or two columns could be meant.
    """
    headers = list(headers)
    uses: list[Use] = []
    force_wide = False
    for name, text in mapping.items():
        if name.strip() == "Q" and text.strip() in ("*", "Q=*"):
            force_wide = True
            continue
        uses += _mapped(name, " ".join(text.split()), headers, where)
    taken = {use.key for use in uses} | set(values)
    used = {use.header for use in uses}
    wide = [use for use in uses if use.Q is not None]
    for header in headers:
        if header in values:
            raise InputError(
                f"{where}: {header} is given as a value, and as column {header!r}; expected once"
            )
        if header in NAMES and header not in taken and header not in used:
            if header == "Q" and (wide or force_wide):
                continue
            if header in LOADS and taken & {*LOADS, "load"}:
                continue
            if header in LOWERS and taken & set(LOWERS):
                continue
            uses.append(Use(header, header, how="named"))
    uses += _named(headers, uses, values, guesses=not mapping)
    told = any(use.key in ("load", *LOADS, *CORNERS) for use in wide)
    if not any(use.key == "Q" for use in uses) and not told:
        uses += _columns_per_Q(headers, uses, force_wide, where)
    _once(uses, values, where)
    return [_without_load(use, where) for use in uses]


def check_constants(values: Mapping[str, object], where: str) -> None:
    """Refuse constants that are none.

    Raises
    ------
    InputError
        If a key is unknown or must be a column.
    """
    for key in values:
        if key not in _CONSTANTS or key in _NO_CONSTANTS:
            allowed = [name for name in _CONSTANTS if name not in _NO_CONSTANTS]
            raise InputError(f"{where}: value {key!r}: expected one of {', '.join(allowed)}")


def _mapped(name: str, text: str, headers: list[str], where: str) -> list[Use]:
    key, Q = name.strip(), None
    if key not in KEYS and key not in CORNERS:
        match = _KEY.fullmatch(key)
        key, Q = (match.group(1) or "load", int(match.group(2))) if match else (key, None)
        if match is None or key not in _PER_Q:
            raise InputError(
                f"{where}: mapping key {name!r}: expected one of {', '.join(KEYS)}, or of "
                f"{', '.join(CORNERS)} with a corner, as 'gap Q=4'"
            )
    header, unit = text, None
    if text not in headers and ";" in text:
        header, unit = (part.strip() for part in text.rsplit(";", 1))
    if header in headers:
        found = [header]
    elif "*" in header:
        return _starred(key, header, unit, headers, where)
    else:
        found = [one for one in headers if split_header(one)[0] == header]
    if len(found) != 1:
        raise InputError(
            f"{where}: mapping {name}={text}: {'several columns' if found else 'no column'} "
            f"{header!r}; the columns are {', '.join(map(repr, headers[:50]))}"
        )
    if Q is None and key in CORNERS and key not in KEYS:
        raise InputError(f"{where}: mapping {name}={text}: expected with a corner, as '{key} Q=4'")
    return [Use(key, found[0], unit, Q)]


def _starred(key: str, header: str, unit: str | None, headers: list[str], where: str) -> list[Use]:
    if header.count("*") != 1 or key not in _PER_Q:
        raise InputError(
            f"{where}: mapping {key}={header}: expected one * in a header of {', '.join(_PER_Q)}"
        )
    left, right = map(re.escape, header.split("*"))
    pattern = re.compile(rf"{left}(\d{{1,6}}){right}")
    uses = []
    for one in headers:
        match = pattern.fullmatch(one) or pattern.fullmatch(split_header(one)[0])
        if match is not None:
            uses.append(Use(key, one, unit, int(match.group(1))))
    if not uses:
        raise InputError(
            f"{where}: mapping {key}={header}: no such column; the columns are "
            f"{', '.join(map(repr, headers[:50]))}"
        )
    return uses


def _named(
    headers: list[str], uses: list[Use], values: Mapping[str, object], *, guesses: bool
) -> list[Use]:
    """Return columns whose headers are keys with dimensions, or words that mean one."""
    found: list[Use] = []
    for tier in ("named", "guessed") if guesses else ("named",):
        taken = {use.key for use in [*uses, *found]} | set(values)
        used = {use.header for use in [*uses, *found]}
        for header in headers:
            words = split_header(header)[0]
            key = words if tier == "named" else _GUESSES.get(_plain(words), "")
            if key not in KEYS or key in taken or header in used or key in ("Q", *TEXTS):
                continue
            # A contract column says the same without a unit, and says it better.
            if _rivals(key) & taken:
                continue
            found.append(Use(key, header, how=tier))
    return found


def _rivals(key: str) -> set[str]:
    for group in (
        ("a", "a_over_R"),
        ("b", "b_over_R"),
        ("offset", "offset_over_R"),
        (*LOADS, "load"),
        LOWERS,
    ):
        if key in group:
            return set(group)
    return {key}


def _columns_per_Q(headers: list[str], uses: list[Use], force: bool, where: str) -> list[Use]:
    used = {use.header for use in uses}
    found = []
    for header in headers:
        match = None if header in used else _WIDE.fullmatch(split_header(header)[0])
        if match is None:
            continue
        words = (match.group(1) or "").strip(" _")
        key = words if words in _PER_Q else _WIDE_GUESSES.get(_plain(words), "")
        if key:
            found.append(Use(key, header, Q=int(match.group(2)), how="named"))
    if force and not found:
        raise InputError(
            f"{where}: no column with a header such as 'Q=4'; the columns are "
            f"{', '.join(map(repr, headers[:50]))}"
        )
    return found


def _once(uses: list[Use], values: Mapping[str, object], where: str) -> None:
    """Refuse two columns, or a column and a value, that say the same."""
    seen: dict[tuple[str, int | None], str] = {}
    for use in uses:
        for key in _rivals(use.key) if use.key not in CORNERS else {use.key}:
            if key in values:
                raise InputError(
                    f"{where}: {key} is given as a value, and as column {use.header!r}; expected "
                    "once"
                )
        group = min(_rivals(use.key)) if use.Q is None or use.key not in CORNERS else "corner"
        place = (group, use.Q)
        if place in seen:
            raise InputError(
                f"{where}: columns {seen[place]!r} and {use.header!r} could both be {use.key}"
                f"{'' if use.Q is None else f' of Q = {use.Q}'}; name one with --map"
            )
        seen[place] = use.header


def _without_load(use: Use, where: str) -> Use:
    """Return what a load is, by its unit."""
    if use.key != "load":
        return use
    unit = use.unit if use.unit is not None else split_header(use.header)[1]
    key = "p_over_E"
    if unit_factor(unit, "pressure") is not None:
        key = "p"
    elif unit_factor(unit, "line load") is not None:
        key = "line"
    else:
        column_unit("load", use.header, use.unit, where)
    return Use(key, use.header, use.unit, use.Q, use.how)


def _plain(words: str) -> str:
    words = words.replace("'", "").replace("\N{RIGHT SINGLE QUOTATION MARK}", "").replace("_", " ")
    return " ".join(words.lower().split()).replace(" / ", "/")
