"""Matching of a file's columns with contract columns: by mapping, by name, or by header words."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches

from ridgebayes.errors import InputError
from ridgebayes.fea.record import FileError
from ridgebayes.fea.words import (
    DIMENSIONS,
    corner_key,
    corners_of,
    count_term,
    is_number_of_repeats,
    key_of,
    repeats_of,
    split_header,
    unit_factor,
)
from ridgebayes.table.columns import NAMES, NUMBERS

TEXTS = tuple(name for name in NAMES if name not in NUMBERS)
LOADS = ("p_over_E", "p", "line", "force")
LOWERS = tuple(f"{key}_lower" for key in LOADS)
SDS, _SEMS = (tuple(f"{key}{end}" for key in LOADS) for end in ("_sd", "_sem"))
CORNERS = ("gap", "gap_over_R", "pressure", "status")
ABOVE_0 = ("a", "b", "pitch", "R", "D", "E", "thickness", "p", "line", "force")
_MEAN_KEYS = ("load", "load_lower", "load_sd", "load_sem", "n_mean")
_UNLISTED_KEYS = ("gap", "thickness", *SDS, *_SEMS)
KEYS = (*NAMES, *(key for key in DIMENSIONS if key not in _UNLISTED_KEYS), *_MEAN_KEYS)
PER_Q = (*LOADS, *LOWERS, "load", "load_lower", "rel_se", *CORNERS)
_NUMERIC_KEYS = (*NUMBERS, *DIMENSIONS, *_MEAN_KEYS, *SDS, *_SEMS, "gap_over_R", "pressure")
_NEVER_CONSTANT = ("Q", "p_over_E", "p_over_E_lower", "source")
_CONSTANT = ("R", "D", "E", "thickness", "load_se", "a", "b", "pitch", "offset", *NUMBERS, *TEXTS)
CONSTANTS = tuple(name for name in _CONSTANT if name not in _NEVER_CONSTANT)
_WIDE_HEADER = re.compile(r"(.*?[\s_])?Q[\s_]*=?[\s_]*(\d{1,6})")
_CORNER_KEY = re.compile(r"\s*([A-Za-z_]*?)[\s:]*Q?[\s]*[= ]?\s*(\d{1,6})\s*")
_ALTERNATIVES = (
    *(("a", "a_over_R"), ("b", "b_over_R"), ("offset", "offset_over_R")),
    *((*LOADS, "load"), (*LOWERS, "load_lower"), (*SDS, "load_sd"), (*_SEMS, "load_sem")),
)


@dataclass(frozen=True)
class Use:
    """A recognised column of a file.

    Parameters
    ----------
    key : str
        Contract column, or quantity with a dimension.
    header : str
        Header in the file.
    unit : str or None
        Unit in the mapping; None uses the unit in the header.
    Q : int or None
        Q of the corner, in tables with one column per Q.
    how : {"mapped", "named", "guessed", "wide"}
        Source of the match: mapping, header equal to a key, words in the header, or conversion
        from a wide table.
    repeat : str or None
        Label of the repeat, in tables with one column of loads per repeat.
    """

    key: str
    header: str
    unit: str | None = None
    Q: int | None = None
    how: str = "mapped"
    repeat: str | None = None

    @property
    def is_number(self) -> bool:
        """Whether the cells are numbers."""
        return self.key in _NUMERIC_KEYS

    @property
    def own_unit(self) -> str:
        """Unit in the mapping, or else the text in place of a unit in the header."""
        return split_header(self.header)[1] if self.unit is None else self.unit

    @property
    def label(self) -> int | str | None:
        """Q or repeat of the column; None for a column with all corners and repeats."""
        return self.repeat if self.Q is None else self.Q

    @property
    def name(self) -> str:
        """The key, with Q if the column belongs to one corner."""
        return self.key if self.Q is None else f"{self.key} Q={self.Q}"

    @property
    def typed(self) -> str:
        """The column in the notation of ``--map``."""
        return self.header if self.unit is None else f"{self.header};{self.unit}"


def assign(
    headers: Sequence[str],
    mapping: Mapping[str, str],
    values: Mapping[str, object],
    problems: FileError,
) -> tuple[list[Use], str | None]:
    """Assign keys to the columns of a file.

    Parameters
    ----------
    headers : sequence of str
        Headers of the file.
    mapping : mapping of str to str
        Headers by key, with ``;unit`` if the header has no unit. A header with ``*`` maps one
        column per Q, and ``Q=*`` maps headers such as ``Q=4``. Other columns are recognised.
    values : mapping of str to object
        Constants by key.
    problems : FileError
        Collects columns whose meaning is unclear.

    Returns
    -------
    list of Use
        Recognised columns. Other columns are the user's additional columns.
    str or None
        Counted objects, a key of `ridgebayes.fea.words.COUNTS`; empty if the header does not tell
        them, None if no header of counts was guessed.

    Raises
    ------
    InputError
        If a key is unknown, a header is missing, or two columns are mapped to one key.
    """
    columns = _Columns(headers, values, problems)
    is_wide = False
    for name, text in mapping.items():
        if name.strip() == "Q" and text.strip() in ("*", "Q=*"):
            is_wide = True
        else:
            columns.map(name, " ".join(text.split()))
    columns.name(is_wide)
    of_corners = ("load", *LOADS, *CORNERS)
    if not any(u.key == "Q" or (u.Q is not None and u.key in of_corners) for u in columns.uses):
        columns.name_corners(required=is_wide)
    columns.guess()
    columns.settle()
    # Counts that were recognised by words may be counts of edges, ridges or segments.
    counts = [u for u in columns.uses if u.key == "Q" and u.how == "guessed"]
    terms = columns.terms | {count_term(use.header) for use in counts}
    term = None if not terms else min(terms) if len(terms) == 1 else ""
    uses = [as_load(use, columns.uses, values, problems) for use in columns.uses]
    return [_as_error(use, uses) for use in uses], term


def check_constants(values: Mapping[str, object], where: str) -> None:
    """Check the keys of constants.

    Raises
    ------
    InputError
        If a key is unknown, or the quantity must be a column.
    """
    for key in values:
        if key not in CONSTANTS:
            raise InputError(f"{where}: value {key!r}: expected one of {', '.join(CONSTANTS)}")


class _Columns:
    """The columns of a file, and the keys assigned so far."""

    def __init__(
        self, headers: Sequence[str], values: Mapping[str, object], problems: FileError
    ) -> None:
        self.uses: list[Use] = []
        self.terms: set[str] = set()
        self.problems = problems
        self._headers, self.values = list(headers), values
        for header in headers:
            if header in values:
                raise self._duplicate(header, header)

    def map(self, name: str, text: str) -> None:
        """Add the columns of an entry ``name=text`` of the mapping."""
        key, Q = name.strip(), None
        if key not in (*KEYS, *CORNERS, *SDS, *_SEMS):
            match = _CORNER_KEY.fullmatch(key)
            key, Q = (match[1] or "load", int(match[2])) if match else (key, None)
            if match is None or key not in PER_Q:
                raise self.problems.error(
                    f"mapping key {name!r}: expected one of {', '.join(KEYS)}, or of "
                    f"{', '.join(CORNERS)} with a corner, as 'gap Q=4'"
                )
        header, unit = text, None
        if text not in self._headers and ";" in text:
            header, unit = map(str.strip, text.rsplit(";", 1))
        if "*" in header and header not in self._headers:
            self._map_all(key, header, unit)
            return
        if Q is None and key in CORNERS and key not in KEYS:
            raise self.problems.error(
                f"mapping {name}={text}: expected with a corner, as '{key} Q=4'"
            )
        headers = [header] if header in self._headers else self._headers_with_words(header)
        if len(headers) != 1:
            several = "several columns" if headers else "no column"
            error = self._missing(f"mapping {name}={text}: {several} {header!r}")
            words = (split_header(other)[0] for other in self._headers)
            if not (near := get_close_matches(header, words, 1)):
                raise error
            headers = self._headers_with_words(near[0])[-1:]
            meant = headers[0] if unit is None else f"{headers[0]};{unit}"
            self.problems.need(f"{error}; did you mean {headers[0]!r}?", {name: meant})
        self.uses.append(Use(key, headers[0], unit, Q))

    def _headers_with_words(self, words: str) -> list[str]:
        return [header for header in self._headers if split_header(header)[0] == words]

    def _map_all(self, key: str, text: str, unit: str | None) -> None:
        """Add all columns that match a header with ``*``."""
        if text.count("*") != 1 or key not in PER_Q:
            raise self.problems.error(
                f"mapping {key}={text}: expected one * in a header of {', '.join(PER_Q)}"
            )
        pattern = re.compile(r"(\d{1,6})".join(map(re.escape, text.split("*"))))
        n = len(self.uses)
        for header in self._headers:
            if match := pattern.fullmatch(header) or pattern.fullmatch(split_header(header)[0]):
                self.uses.append(Use(key, header, unit, int(match[1])))
        if len(self.uses) == n:
            raise self._missing(f"mapping {key}={text}: no such column")

    def name(self, is_wide: bool) -> None:
        """Add columns whose header is a contract column or a key with a dimension."""
        has_Q = is_wide or any(use.Q is not None for use in self.uses)
        for names in (NAMES, set(KEYS) - {"Q", *TEXTS}):
            keys = self._keys()
            for header, words, unit in self._free():
                # Duplicate headers have a column number, such as "force #5".
                key = (header if names is NAMES else words).partition(" #")[0]
                # "force [N/mm]" is a line load by its unit.
                is_other = key in LOADS[1:] and unit and not unit_factor(unit, DIMENSIONS[key])
                is_given = _alternatives(key) & keys or (key == "Q" and has_Q)
                if key in names and not is_given and not is_other:
                    self.uses.append(Use(key, header, how="named"))

    def name_corners(self, *, required: bool) -> None:
        """Add columns with headers such as ``Q=4``, or with headers that differ in one number."""
        n = len(self.uses)
        words = {header: text for header, text, _ in self._free()}
        for header, text in words.items():
            match = _WIDE_HEADER.fullmatch(text)
            key = (match[1] or "load").strip(" _") if match is not None else ""
            key = key if key in PER_Q else corner_key(key)
            if match is not None and key:
                self.uses.append(Use(key, header, Q=int(match[2]), how="named"))
        if len(self.uses) == n:
            corners = corners_of(words.values())
            for header, text in words.items():
                if text in corners:
                    key, Q, term = corners[text]
                    self.uses.append(Use(key, header, Q=Q, how="guessed"))
                    self.terms.add(term)
        if required and len(self.uses) == n:
            raise self._missing("no column with a header such as 'Q=4'")

    def guess(self) -> None:
        """Add columns that are recognised by the words in their headers."""
        keys, free = self._keys(), self._free()
        is_wide = any(use.Q is not None for use in self.uses)
        of_mean = sum(key_of(words) in ("load_sd", "load_sem", "Q") for _, words, _ in free) > 2
        for header, words, unit in free:
            key = "n_mean" if of_mean and is_number_of_repeats(words) else key_of(words)
            of_each_Q = is_wide and (key == "Q" or (key in PER_Q and key != "rel_se"))
            if not key or _alternatives(key) & keys or of_each_Q:
                continue
            of_R = key in ("a", "b", "offset") and unit.startswith("%")
            use = Use(f"{key}_over_R", header, "%") if of_R else Use(key, header)
            self.uses.append(replace(use, how="guessed"))

    def settle(self) -> None:
        """Resolve several columns with one key, and refuse a column that is also a constant."""
        places: dict[tuple[str, int | None], list[Use]] = {}
        for use in self.uses:
            is_corner = use.Q is not None and use.key in CORNERS
            rivals = _alternatives(use.key)
            for key in {use.key} if use.key in CORNERS else rivals:
                if key in self.values:
                    raise self._duplicate(key, use.header)
            places.setdefault(("corner" if is_corner else min(rivals), use.Q), []).append(use)
        self.uses = [use for uses in places.values() for use in self._settled(uses)]

    def _settled(self, uses: list[Use]) -> list[Use]:
        """Return the columns to keep among several with one key; they may be repeats of loads."""
        first, headers = uses[0], [use.header for use in uses]
        are_guessed = all(use.how == "guessed" for use in uses)
        if len(uses) == 1 or (first.key == "series" and are_guessed):
            return uses
        if are_guessed and first.key in PER_Q and first.Q is None and (n := repeats_of(headers)):
            return [replace(use, key=first.key, repeat=n[use.header]) for use in uses]
        if not (are_guessed and first.key in TEXTS):
            text = f"columns {', '.join(map(repr, headers))} could all be {first.name}"
            if any(use.how == "mapped" for use in uses[1:]):
                raise self.problems.error(f"{text}; expected one column")
            text += f": name one with --map '{first.name}=HEADER'"
            self.problems.need(text, {first.name: headers[0]})
        return uses[:1]

    def _keys(self) -> set[str]:
        """Return the keys of all assigned columns and constants."""
        return {use.key for use in self.uses} | set(self.values)

    def _free(self) -> list[tuple[str, str, str]]:
        """Return the header, words and unit of each unassigned column."""
        used = {use.header for use in self.uses}
        return [(text, *split_header(text)) for text in self._headers if text not in used]

    def _missing(self, message: str) -> InputError:
        names = ", ".join(map(repr, self._headers[:50]))
        return self.problems.error(f"{message}; the columns are {names}")

    def _duplicate(self, key: str, header: str) -> InputError:
        return self.problems.error(
            f"{key} is given as a value, and as column {header!r}; expected once"
        )


def _alternatives(key: str) -> set[str]:
    """Return the keys that give the same quantity, including the key itself."""
    return next((set(group) for group in _ALTERNATIVES if key in group), {key})


def lacking(uses: Sequence[Use], values: Mapping[str, object]) -> list[str]:
    """Return the required quantities (a, b, Q, load) that neither a column nor a constant gives."""
    keys = {use.key for use in uses} | set(values)
    per_Q = {use.key for use in uses if use.Q is not None}
    if "pitch" in keys:
        keys.add("b")
    if per_Q:
        keys |= {"Q"} if per_Q & set(CORNERS) else {"Q", "load"}
    return [key for key in ("a", "b", "Q", "load") if not keys & _alternatives(key)]


def as_load(
    use: Use, uses: Sequence[Use], values: Mapping[str, object], problems: FileError
) -> Use:
    """Replace the key "load" by the kind of load of its unit; ask for a unit if it is missing."""
    if use.key not in ("load", "load_lower"):
        return use
    lower = use.key.removeprefix("load")
    unit = use.own_unit
    for key in LOADS[1:]:
        if unit_factor(unit, DIMENSIONS[key]) is not None:
            return replace(use, key=key + lower)
    others = [other for other in uses if other.key in DIMENSIONS]
    has_units = any(other.own_unit not in ("", "1", "-") for other in others)
    keys = {other.key for other in others}
    needs_R = bool(keys & {"a", "b"}) and not keys & {"R", "D"}
    if use.unit is None and (has_units or needs_R or {"E", "R"} & values.keys()):
        shown = re.sub(r"\d+", "*", use.header) if use.Q is not None else use.header
        is_mass = unit_factor(f"{unit}f", "force") is not None
        hint = f"{unit!r} is no unit" + (f" of loads ({unit}f is one)" if is_mass else "")
        problems.need(
            f"column {shown!r}: {hint if unit else 'no unit'}: p/E, pressure, line load or force: "
            f"name it, as --map 'p_over_E={shown}', 'p={shown};kPa', 'line={shown};N/mm' or "
            f"'force={shown};N'",
            {use.key: f"{shown};{unit}f" if unit and is_mass else f"{shown};?"},
            **({} if "E" in keys | values.keys() else {"E": "? kPa"}),
        )
    return replace(use, key=f"p_over_E{lower}")


def _as_error(use: Use, uses: Sequence[Use]) -> Use:
    """Replace the key of an sd or standard error of loads by the kind of its or the mean's unit."""
    mean = next((other for other in uses if other.key in LOADS), None)
    if use.key not in ("load_sd", "load_sem") or mean is None:
        return use
    unit = use.own_unit or mean.own_unit
    kinds = (key for key in LOADS[1:] if unit_factor(unit, DIMENSIONS[key]) is not None)
    key = use.key.replace("load", next(kinds, mean.key))
    return replace(use, key=key, unit=use.unit if use.own_unit else unit)
