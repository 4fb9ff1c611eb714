"""Which column of a file is which of the contract: by a mapping, by name, or by a clear guess."""

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
CORNERS = ("gap", "gap_over_R", "pressure", "status")
KEYS = (
    *NAMES,
    *(key for key in DIMENSIONS if key not in ("gap", "thickness")),
    *("load", "load_lower", "load_sd", "n_mean"),
)
PER_Q = (*LOADS, *LOWERS, "load", "load_lower", "rel_se", *CORNERS)
_QUANTITIES = (*NUMBERS, *DIMENSIONS, "load", "load_lower", "load_sd", "n_mean")
_QUANTITIES += ("gap_over_R", "pressure")
_VARYING = ("Q", "p_over_E", "p_over_E_lower", "source")
_KNOWN = ("R", "D", "E", "thickness", "load_se", "a", "b", "pitch", "offset", *NUMBERS, *TEXTS)
CONSTANTS = tuple(name for name in _KNOWN if name not in _VARYING)
_WIDE = re.compile(r"(.*?[\s_])?Q[\s_]*=?[\s_]*(\d{1,6})")
_KEY = re.compile(r"\s*([A-Za-z_]*?)[\s:]*Q?[\s]*[= ]?\s*(\d{1,6})\s*")
_SAME = (
    *(("a", "a_over_R"), ("b", "b_over_R"), ("offset", "offset_over_R")),
    *((*LOADS, "load"), (*LOWERS, "load_lower")),
)


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
    repeat : str or None
        Which repeat, for one column of loads each.
    """

    key: str
    header: str
    unit: str | None = None
    Q: int | None = None
    how: str = "mapped"
    repeat: str | None = None

    @property
    def is_number(self) -> bool:
        """Whether its cells are numbers."""
        return self.key in _QUANTITIES

    @property
    def own_unit(self) -> str:
        """Unit that the mapping gives, or else the text in the unit's place in the header."""
        return split_header(self.header)[1] if self.unit is None else self.unit

    @property
    def name(self) -> str:
        """The key, with the corner."""
        return self.key if self.Q is None else f"{self.key} Q={self.Q}"

    def __str__(self) -> str:
        return f"{self.name}={self.header!r}" + ("" if self.unit is None else f";{self.unit}")


def assign(
    headers: Sequence[str],
    mapping: Mapping[str, str],
    values: Mapping[str, object],
    problems: FileError,
) -> tuple[list[Use], str | None]:
    """Tell what each column of a file is.

    Parameters
    ----------
    headers : sequence of str
        The file's.
    mapping : mapping of str to str
        Keys to headers, with ``;unit`` where the header has none; a header with ``*`` means
        one column per Q, and ``Q=*`` for headers such as ``Q=4``. The rest is recognised.
    values : mapping of str to object
        Constants by key.
    problems : FileError
        Where columns are noted of which it is not clear what they are.

    Returns
    -------
    list of Use
        Headers that are in none are the user's own.
    str or None
        Things counted, one of `ridgebayes.fea.words.COUNTS`; empty where words do not say, None
        where the user does, or the header is Q.

    Raises
    ------
    InputError
        If a key is unknown, a header is not there, or two columns are mapped to one key.
    """
    columns = _Columns(headers, values, problems)
    is_wide = False
    for name, text in mapping.items():
        if name.strip() == "Q" and text.strip() in ("*", "Q=*"):
            is_wide = True
        else:
            columns.map(name, " ".join(text.split()))
    columns.name_contract(is_wide or any(use.Q is not None for use in columns.uses))
    columns.name_keys()
    of_corners = ("load", *LOADS, *CORNERS)
    if not any(u.key == "Q" or (u.Q is not None and u.key in of_corners) for u in columns.uses):
        columns.name_corners(required=is_wide)
    columns.guess()
    columns.check_once()
    # Q by words that may count something else.
    counts = [u for u in columns.uses if u.key == "Q" and u.how == "guessed"]
    terms = columns.terms | {count_term(use.header) for use in counts}
    term = None if not terms else min(terms) if len(terms) == 1 else ""
    return [as_load(use, columns.uses, values, problems) for use in columns.uses], term


def check_constants(values: Mapping[str, object], where: str) -> None:
    """Refuse constants that are none.

    Raises
    ------
    InputError
        If a key is unknown or must be a column.
    """
    for key in values:
        if key not in CONSTANTS:
            raise InputError(f"{where}: value {key!r}: expected one of {', '.join(CONSTANTS)}")


class _Columns:
    """The columns of a file, and what is known of them so far."""

    def __init__(
        self, headers: Sequence[str], values: Mapping[str, object], problems: FileError
    ) -> None:
        self.uses: list[Use] = []
        self.terms: set[str] = set()
        self.problems = problems
        self._headers, self.values = list(headers), values
        for header in headers:
            if header in values:
                raise self._twice(header, header)

    def map(self, name: str, text: str) -> None:
        """Add what the mapping says."""
        key, Q = name.strip(), None
        if key not in (*KEYS, *CORNERS):
            match = _KEY.fullmatch(key)
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
        found = [one for one in self._headers if one == header]
        found = found or [one for one in self._headers if split_header(one)[0] == header]
        if len(found) != 1:
            several = "several columns" if found else "no column"
            error = self._missing(f"mapping {name}={text}: {several} {header!r}")
            words = {split_header(one)[0]: one for one in self._headers}
            if not (near := get_close_matches(header, words, 1)):
                raise error
            found = [words[near[0]]]
            meant = found[0] if unit is None else f"{found[0]};{unit}"
            self.problems.need(f"{error}; did you mean {found[0]!r}?", {name: meant})
        if Q is None and key in CORNERS and key not in KEYS:
            raise self.problems.error(
                f"mapping {name}={text}: expected with a corner, as '{key} Q=4'"
            )
        self.uses.append(Use(key, found[0], unit, Q))

    def _map_all(self, key: str, header: str, unit: str | None) -> None:
        """Add the columns of a header with ``*``."""
        if header.count("*") != 1 or key not in PER_Q:
            raise self.problems.error(
                f"mapping {key}={header}: expected one * in a header of {', '.join(PER_Q)}"
            )
        pattern = re.compile(r"(\d{1,6})".join(map(re.escape, header.split("*"))))
        n = len(self.uses)
        for one in self._headers:
            if match := pattern.fullmatch(one) or pattern.fullmatch(split_header(one)[0]):
                self.uses.append(Use(key, one, unit, int(match[1])))
        if len(self.uses) == n:
            raise self._missing(f"mapping {key}={header}: no such column")

    def name_contract(self, is_wide: bool) -> None:
        """Add columns of the contract by their names."""
        keys = self._keys()
        for header, *_ in self._free():
            # Columns given in another way: Q by the headers, a load by another column.
            by_another = header in (*LOADS, *LOWERS) and _rivals(header) & keys
            is_given = header in keys or (header == "Q" and is_wide) or by_another
            if header in NAMES and not is_given:
                self.uses.append(Use(header, header, how="named"))

    def name_keys(self) -> None:
        """Add columns whose headers are keys with dimensions."""
        keys = self._keys()
        for header, key, unit in self._free():
            if key in ("p", "line", "force") and unit and not unit_factor(unit, DIMENSIONS[key]):
                continue  # "force [N/mm]": its unit tells what it is
            # A contract column says the same without a unit, and says it better.
            if key in KEYS and key not in ("Q", *TEXTS) and not _rivals(key) & keys:
                self.uses.append(Use(key, header, how="named"))

    def name_corners(self, *, required: bool) -> None:
        """Add columns with headers such as ``Q=4``, or that differ in one even number."""
        n = len(self.uses)
        words = {header: text for header, text, _ in self._free()}
        for header, text in words.items():
            match = _WIDE.fullmatch(text)
            key = (match[1] or "load").strip(" _") if match is not None else ""
            key = key if key in PER_Q else corner_key(key)
            if match is not None and key:
                self.uses.append(Use(key, header, Q=int(match[2]), how="named"))
        if len(self.uses) == n:
            found = corners_of(words.values())
            for header, text in words.items():
                if text in found:
                    key, Q, term = found[text]
                    self.uses.append(Use(key, header, Q=Q, how="guessed"))
                    self.terms.add(term)
        if required and len(self.uses) == n:
            raise self._missing("no column with a header such as 'Q=4'")

    def guess(self) -> None:
        """Add columns whose headers have words of the field."""
        keys = self._keys()
        is_wide = any(use.Q is not None for use in self.uses)
        found: dict[str, dict[str, str]] = {}
        free = self._free()
        of_mean = sum(key_of(words) in ("load_sd", "Q") for _, words, _ in free) > 2
        for header, words, _ in free:
            key = key_of(words)
            key = "n_mean" if of_mean and is_number_of_repeats(words) else key
            if key and not _rivals(key) & keys and not (key == "Q" and is_wide):
                found.setdefault(min(_rivals(key)), {})[header] = key
        for some in found.values():
            header, key = next(iter(some.items()))
            if key == "series" or (key in PER_Q and not is_wide and repeats_of(some)):
                repeats = {} if key == "series" else repeats_of(some)
                self.uses += [Use(key, one, how="guessed", repeat=repeats.get(one)) for one in some]
                continue
            if len(some) > 1 and key not in TEXTS and not (key in PER_Q and is_wide):
                self.problems.need(
                    f"columns {', '.join(map(repr, some))} could each be {key}: name one with "
                    f"--map '{key}=HEADER'",
                    {key: header},
                )
            if key in PER_Q and key != "rel_se" and is_wide:
                continue
            of_R = key in ("a", "b", "offset") and split_header(header)[1].startswith("%")
            one = Use(f"{key}_over_R", header, "%") if of_R else Use(key, header)
            self.uses.append(replace(one, how="guessed"))

    def check_once(self) -> None:
        """Refuse two columns, or a column and a value, that say the same."""
        seen: dict[tuple[str, object], str] = {}
        for use in [*self.uses]:
            rivals = _rivals(use.key)
            for key in {use.key} if use.key in CORNERS else rivals:
                if key in self.values:
                    raise self._twice(key, use.header)
            is_corner = use.Q is not None and use.key in CORNERS
            place = ("corner" if is_corner else min(rivals), use.Q or use.repeat)
            if place in seen and not (use.key == "series" and use.how == "guessed"):
                of_Q = "" if use.Q is None else f" of Q = {use.Q}"
                text = (
                    f"columns {seen[place]!r} and {use.header!r} could both be {use.key}{of_Q}; "
                    "name one with --map"
                )
                if use.how == "mapped":
                    raise self.problems.error(text)
                self.problems.need(text, {use.name: seen[place]})
                self.uses.remove(use)
                continue
            seen[place] = use.header

    def _keys(self) -> set[str]:
        """Return keys that are given."""
        return {use.key for use in self.uses} | set(self.values)

    def _free(self) -> list[tuple[str, str, str]]:
        """Return headers that are not used, with their words and what stands in place of units."""
        used = {use.header for use in self.uses}
        return [(one, *split_header(one)) for one in self._headers if one not in used]

    def _missing(self, message: str) -> InputError:
        there = ", ".join(map(repr, self._headers[:50]))
        return self.problems.error(f"{message}; the columns are {there}")

    def _twice(self, key: str, header: str) -> InputError:
        return self.problems.error(
            f"{key} is given as a value, and as column {header!r}; expected once"
        )


def _rivals(key: str) -> set[str]:
    """Return the keys that say the same in another way."""
    return next((set(group) for group in _SAME if key in group), {key})


def as_load(
    use: Use, uses: Sequence[Use], values: Mapping[str, object], problems: FileError
) -> Use:
    """Return what a load is, by its unit; note one without a unit where a body has to be known."""
    if use.key not in ("load", "load_lower"):
        return use
    lower = use.key.removeprefix("load")
    unit = use.own_unit
    for key in LOADS[1:]:
        if unit_factor(unit, DIMENSIONS[key]) is not None:
            return replace(use, key=key + lower)
    of_dimension = [one for one in uses if one.key in DIMENSIONS]
    has_units = any(one.own_unit not in ("", "1", "-") for one in of_dimension)
    keys = {one.key for one in of_dimension}
    needs_R = bool(keys & {"a", "b"}) and not keys & {"R", "D"}
    if use.unit is None and (has_units or needs_R or {"E", "R"} & values.keys()):
        shown = re.sub(r"\d+", "*", use.header) if use.Q is not None else use.header
        problems.need(
            f"column {shown!r}: {f'{unit!r} is no unit' if unit else 'no unit'}: p/E, pressure, "
            "line load or force: name it, as "
            f"--map 'p_over_E={shown}', 'p={shown};kPa', 'line={shown};N/mm' or "
            f"'force={shown};N'",
            {use.key: f"{shown};?"},
            **({} if "E" in keys | values.keys() else {"E": "? kPa"}),
        )
    return replace(use, key=f"p_over_E{lower}")
