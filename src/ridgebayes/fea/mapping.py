"""Matching of a file's columns with contract columns: by mapping, by name, or by header words."""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from ridgebayes.fea.record import FileError
from ridgebayes.fea.words import (
    DIMENSIONS,
    N_MEAN,
    OF_CORNERS,
    corners_of,
    count_term,
    is_likely,
    key_of,
    load_kind,
    named,
    plain,
    repeats_of,
    split_header,
    unit_factor,
)
from ridgebayes.table.columns import NAMES, NUMBERS

TEXTS = tuple(name for name in NAMES if name not in NUMBERS)
LOADS = ("p_over_E", "p", "line", "force")
LOWERS = tuple(f"{key}_lower" for key in LOADS)
SDS, _SEMS = (tuple(f"{key}{end}" for key in (*LOADS, "rel")) for end in ("_sd", "_sem"))
NEVER_EMPTY = ("a", "b", "pitch", "R", "D", "E")  # columns that must not have empty cells
ABOVE_0 = (*NEVER_EMPTY, "thickness", "n_mean", "p", "line", "force")  # p_over_E: table rules
_MEAN_KEYS = ("load", "load_lower", "load_sd", "load_sem", "n_mean")
_UNLISTED_KEYS = ("gap", "x", "thickness", *SDS, *_SEMS)
KEYS = (*NAMES, *(key for key in DIMENSIONS if key not in _UNLISTED_KEYS), *_MEAN_KEYS)
_OVER_D = ("a_over_D", "b_over_D", "offset_over_D")  # doubled: D is twice R
_MAPPED = (*KEYS, *SDS, *_SEMS, *_OVER_D)
PER_Q = ("load", *LOADS, "status")
_NUMERIC_KEYS = (*NUMBERS, *DIMENSIONS, *_MEAN_KEYS, *SDS, *_SEMS, *_OVER_D)
_NEVER_CONSTANT = ("Q", "p_over_E", "p_over_E_lower", "source")
_CONSTANT = ("R", "D", "E", "thickness", "load_se", "a", "b", "pitch", "offset", *NUMBERS, *TEXTS)
CONSTANTS = tuple(name for name in _CONSTANT if name not in _NEVER_CONSTANT)
_WIDE_HEADER = re.compile(r"(.*?[\s_])?Q[\s_]*=?[\s_]*(\d{1,6})")
_CORNER_KEY = re.compile(r"\s*([A-Za-z_]*?)[\s:]*Q?[\s]*[= ]?\s*(\d{1,6})\s*")
_ALTERNATIVES = (
    *((key, f"{key}_over_R", f"{key}_over_D") for key in ("a", "b", "offset")),
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
    problems: FileError,
) -> tuple[list[Use], str | None]:
    """Assign keys to the columns of a file.

    Parameters
    ----------
    headers : sequence of str
        Headers of the file.
    mapping : mapping of str to str
        Headers by key, with ``;unit`` if the header has no unit. A header with ``*`` maps one
        column per Q. Other columns are recognised.
    problems : FileError
        The import, with constants; collects columns whose meaning is unclear.

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
        If a key of a column or constant is unknown, a header is missing, or two columns are mapped
        to one key.
    """
    columns = Columns(headers, problems)
    for name, text in mapping.items():
        columns.map(name, " ".join(text.split()))
    columns.name()
    if not any(use.key == "Q" or use.Q is not None for use in columns.uses):
        columns.name_corners()
    columns.guess()
    columns.settle()
    columns.propose()
    # Counts that were recognised by words may be counts of edges, ridges or segments.
    counts = [u for u in columns.uses if u.key == "Q" and u.how == "guessed"]
    terms = columns.terms | {count_term(use.header) for use in counts}
    term = None if not terms else min(terms) if len(terms) == 1 else ""
    return [as_load(use, columns.uses, problems) for use in columns.uses], term


class Columns:
    """The columns of a file, and the keys assigned so far.

    Parameters
    ----------
    headers : sequence of str
        Headers of the file.
    problems : FileError
        The import, with constants; collects columns whose meaning is unclear.
    keys : collection of str, optional
        Keys of the mapping; those of a contact table if not given.
    """

    def __init__(
        self, headers: Sequence[str], problems: FileError, keys: Collection[str] = _MAPPED
    ) -> None:
        self.mapped = keys
        self.uses: list[Use] = []
        self.terms: set[str] = set()
        self.problems = problems
        for key in problems.values:
            if key not in CONSTANTS:
                raise problems.error(f"value {key!r}: expected one of {', '.join(CONSTANTS)}")
        self._split = {header: split_header(header) for header in headers}  # words and unit

    def map(self, name: str, text: str) -> None:
        """Add the columns of an entry ``name=text`` of the mapping."""
        key, Q, header, unit = name.strip(), None, text, None
        if text not in self._split and ";" in text:
            header, unit = map(str.strip, text.rsplit(";", 1))
        star = "*" in header and header not in self._split
        match = None if key in _MAPPED or star else _CORNER_KEY.fullmatch(key)
        if match is not None:
            key, Q = match[1] or "load", int(match[2])
        if key not in (PER_Q if star or match else self.mapped):
            keys = ", ".join(KEYS if self.mapped is _MAPPED else self.mapped)
            raise self.problems.error(
                f"mapping {name}={text}: key {name!r}: expected one of {keys}"
            )
        pattern = re.escape(header)
        if star:
            pattern = pattern.replace(re.escape("*"), r"(\d{1,6})", 1)
        there = [header] if header in self._split else list(self._split)
        columns = [
            Use(key, name, unit, int(match[1]) if star else Q)
            for name in there
            if (match := re.fullmatch(pattern, name) or re.fullmatch(pattern, self._split[name][0]))
        ]
        if not columns or (len(columns) > 1 and not star):
            several = "several columns" if columns else "no column"
            names = ", ".join(map(repr, [*self._split][:50]))
            fault = f"mapping {name}={text}: {several} {header!r}; the columns are {names}"
            raise self.problems.error(fault)
        self.uses += columns

    def name(self) -> None:
        """Add columns whose header is a contract column or a key with a dimension."""
        has_Q = any(use.Q is not None for use in self.uses)
        for names in (NAMES, set(KEYS) - {"Q", *TEXTS}):
            keys = self._keys()
            for header, words, unit in self._free():
                # Duplicate headers have a column number, such as "force #5".
                key = (header if names is NAMES else words).partition(" #")[0]
                # "force [N/mm]" is a line load by its unit.
                is_other = key in LOADS[1:] and unit and not unit_factor(unit, DIMENSIONS[key])
                has_key = _alternatives(key) & keys or (key == "Q" and has_Q)
                if key in names and not is_other and not has_key:
                    self.uses.append(Use(key, header, how="named"))

    def name_corners(self) -> None:
        """Add columns with headers such as ``Q=4``, or with headers that differ in one number."""
        n, free = len(self.uses), self._free()
        for header, words, _ in free:
            match = _WIDE_HEADER.fullmatch(words)
            key = (match[1] or "load").strip(" _") if match else ""
            if match and (key := key if key in PER_Q else named(key, OF_CORNERS)):
                if key not in PER_Q:
                    rule = "expected the status of corners, open or closed, or --format nodes"
                    raise self.problems.error(f"column {header!r}: a {key} of a corner: {rule}")
                self.uses.append(Use(key, header, Q=int(match[2]), how="named"))
        if len(self.uses) == n:
            corners = corners_of([words for _, words, _ in free])
            for header, words, _ in free:
                if words in corners:
                    key, Q, term = corners[words]
                    self.uses.append(Use(key, header, Q=Q, how="guessed"))
                    self.terms.add(term)

    def guess(self, recognise: Callable[[str], str] = key_of) -> None:
        """Add columns that are recognised by the words in their headers."""
        keys = self._keys()
        free = [(header, words.partition(" #")[0], unit) for header, words, unit in self._free()]
        is_wide = any(use.Q is not None for use in self.uses)
        found = keys | {recognise(words) for _, words, _ in free if plain(words) not in N_MEAN}
        of_mean = "Q" in found and not found.isdisjoint(("rel_sd", "load_sd", "load_sem"))
        for header, words, unit in free:
            key = "n_mean" if of_mean and plain(words) in N_MEAN else recognise(words)
            of_each_Q = is_wide and key.removesuffix("_lower") in ("Q", *PER_Q)
            if not key or _alternatives(key) & keys or of_each_Q:
                continue
            of_R = key in ("a", "b", "offset") and unit.startswith("%")
            key, mapped = (f"{key}_over_R", "%") if of_R else (key, None)
            self.uses.append(Use(key, header, mapped, how="guessed"))

    def settle(self) -> None:
        """Resolve several columns with one key, and refuse a column that is also a constant."""
        places: dict[tuple[str, int | None], list[Use]] = {}
        values = self.problems.values
        for use in self.uses:
            rivals = _alternatives(use.key)
            places.setdefault((min(rivals), use.Q), []).append(use)
            rivals |= {"R"} if use.key == "D" else set()
            self.problems.wrong += [
                f"{name} is given as {values[name]!r}, and as column {use.header!r}: expected one "
                "of the two; leave the value out, or rename the column"
                for name in sorted(rivals & values.keys() - set(TEXTS))
            ]
        self.uses = [use for uses in places.values() for use in self._settled(uses)]

    def propose(self) -> None:
        """Ask for the required quantities that neither a column nor a constant gives.

        A column that its unit makes likely is added, so that further errors are found; the user
        has to confirm it. Several loads or counts are ambiguous.
        """
        keys, per_Q = self._keys(), {use.key for use in self.uses if use.Q is not None}
        keys |= self.problems.values.keys()
        if "pitch" in keys:
            keys.add("a" if keys & _alternatives("b") else "b")
        if per_Q:
            keys |= {"Q"} if "status" in per_Q else {"Q", "load"}
        is_bare = not any(unit for _, unit in self._split.values())
        lacking = [key for key in ("a", "b", "Q", "load") if not keys & _alternatives(key)]
        for key in lacking:
            likely = [one for one, *split in self._free() if is_likely(key, is_bare, *split)]
            header = likely[0] if likely and (key in ("a", "b") or len(likely) == 1) else None
            names = ", ".join(sorted(_alternatives(key)))
            text = f"no column {names}; name it with --map '{key}=HEADER'"
            if header is None and key in ("a", "b"):
                self.problems.need(f"{text}, or give --texture A,B", texture="?,?")
            else:
                self.problems.need(text, {key: header or "?"})
            self.uses += [Use(key, header)] if header is not None else []
        there = ", ".join(map(repr, [*self._split][:50]))
        self.problems.needs += [f"the columns are {there}"] * bool(lacking)

    def _settled(self, uses: list[Use]) -> list[Use]:
        """Return the columns to keep among several with one key; they may be repeats of loads."""
        first, headers = uses[0], [use.header for use in uses]
        are_guessed = all(use.how == "guessed" for use in uses)
        if len(uses) == 1 or (first.key == "series" and are_guessed):
            return uses
        if are_guessed and first.key in PER_Q and first.Q is None and (n := repeats_of(headers)):
            return [replace(use, key=first.key, repeat=n[use.header]) for use in uses]
        if not (are_guessed and first.key in TEXTS and self.mapped is _MAPPED):
            text = f"columns {', '.join(map(repr, headers))} could all be {first.name}"
            if any(use.how == "mapped" for use in uses[1:]):
                raise self.problems.error(f"{text}; expected one column")
            text += f": name one with --map '{first.name}=HEADER'"
            text += ", or copy equal tables below each other" * any(" #" in one for one in headers)
            self.problems.need(text, {first.name: headers[0]})
        return uses[:1]

    def _keys(self) -> set[str]:
        """Return the keys of all assigned columns and texts."""
        return {use.key for use in self.uses} | (self.problems.values.keys() & set(TEXTS))

    def _free(self) -> list[tuple[str, str, str]]:
        """Return the header, words and unit of each unassigned column."""
        used = {use.header for use in self.uses}
        return [(header, *split) for header, split in self._split.items() if header not in used]


def _alternatives(key: str) -> set[str]:
    """Return the keys that give the same quantity, including the key itself."""
    return next((set(group) for group in _ALTERNATIVES if key in group), {key})


def as_load(use: Use, uses: Sequence[Use], problems: FileError) -> Use:
    """Replace "load" in a key by the kind of load of its unit; ask for a unit if it is missing.

    An sd or a standard error of loads without a unit has the unit of the loads, and one in per cent
    is a share of the load, unless the loads are in per cent, too.
    """
    stem, _, end = use.key.partition("_")
    loads = [other for other in uses if other.key in (*LOADS, "load")]
    is_error = end in ("sd", "sem")
    if stem != "load" or (is_error and not loads):
        return use
    unit = use.own_unit or (loads[0].own_unit if is_error else "")
    if is_error and unit == "%" != loads[0].own_unit:
        return replace(use, key=f"rel_{end}")
    kind = load_kind(unit) or (loads[0].key if is_error else "load").replace("load", "")
    use = replace(use, unit=unit if is_error and not use.own_unit else use.unit)
    if kind or is_error or use.unit is not None:
        return replace(use, key=use.key.replace("load", kind or "p_over_E"))
    others = [other for other in uses if other.key in DIMENSIONS]
    keys = {other.key for other in others}
    has_units = any(other.own_unit not in ("", "1", "-") for other in others)
    needs_R = bool(keys & {"a", "b"}) and not keys & {"R", "D"}
    if has_units or needs_R or {"E", "R"} & problems.values.keys():
        shown = re.sub(r"\d+", "*", use.header) if use.Q is not None else use.header
        is_mass = unit != "" and load_kind(f"{unit}f") == "force"
        hint = f"{unit!r} is no unit" + (f" of loads ({unit}f is one)" if is_mass else "")
        problems.need(
            f"column {shown!r}: {hint if unit else 'no unit'}: p/E, pressure, line load or force: "
            f"name it, as --map 'p_over_E={shown}', 'p={shown};kPa', 'line={shown};N/mm' or "
            f"'force={shown};N'",
            {use.key: f"{shown};{unit}f" if is_mass else f"{shown};?"},
            **({} if "E" in keys | problems.values.keys() else {"E": "? kPa"}),
        )
    return replace(use, key=use.key.replace("load", "p_over_E"))
