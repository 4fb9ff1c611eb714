"""Facts that the user gives to an import, and the result: a table, or a list of all errors."""

import hashlib
import heapq
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, IntArray
from ridgebayes.contact.hertz import transition_load
from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import read_bytes, read_toml
from ridgebayes.runtime.text import clipped, count, shown_value, some_of
from ridgebayes.table.columns import COUNT, CURVE, OK, TRANSITION
from ridgebayes.table.columns import SHOWN as MOST_SHOWN
from ridgebayes.table.table import ContactTable

Row = tuple[int, list[str]]  # line of a record, from 1, and its cells
# Largest number of columns in a file, and of runs, each of which takes some milliseconds.
MOST = 2000
SHOWN = 3  # cells that a message lists for one broken rule; further cells are counted


@dataclass(frozen=True)
class Given:
    """Facts that a file does not contain and the user gives; each format uses some of them.

    Parameters
    ----------
    map : tuple of str
        Texts ``key=header``, or paths of TOML files with a mapping.
    sheet : str or None
        Name or number of a worksheet, or "all"; None uses the sheet with the most recognised
        headers.
    skip_rows : int
        Lines to skip at the top.
    header_row : int or None
        Line of the header; 0 for a file without header, None to search for it.
    decimal : str or None
        Decimal mark, "point" or "comma"; None to infer it.
    empty : tuple of str
        Texts that mean an empty cell.
    count_is : str or None
        Counted objects, one of `ridgebayes.fea.words.COUNTS`.
    brackets, interpolate : bool
        Result for increments: always intervals, even if gaps allow interpolation (`brackets`), or
        always loads (`interpolate`).
    closed_is : tuple of int
        Codes of a status that mean contact; empty for 0 (open) and 1 (closed).
    skip_empty : bool
        Whether to leave out rows without a load.
    load_se : str or None
        Standard error of all loads of a table, in a unit of loads.
    texture : (float, float) or None
        Ridge and groove width over R.
    nu, R, E : str or None
        Text typed by the user, with units for tables and as plain numbers in the run's units for
        runs.
    thickness : str or None
        Thickness of the slice or body on which forces act, typed as R.
    symmetry : str or None
        "half" or "full".
    top, corner : float or None
        Height of the ridges' tops; corner radius over R.
    deck : Path or None
        Input deck of a run.
    surface, reaction : str or None
        Node sets of the surface and of the driven nodes.
    field, time : str or None
        Name of the displacements of a series; meaning of its times, "p_over_E" or "line".
    loads : tuple of float
        Loads, with the meaning given by `time`, of several ``.vtu`` files or of a ``.pvd`` file
        whose times are not loads.
    """

    map: tuple[str, ...] = ()
    sheet: str | None = None
    skip_rows: int = 0
    header_row: int | None = None
    decimal: str | None = None
    empty: tuple[str, ...] = ()
    count_is: str | None = None
    brackets: bool = False
    interpolate: bool = False
    closed_is: tuple[int, ...] = ()
    skip_empty: bool = False
    load_se: str | None = None
    texture: tuple[float, float] | None = None
    nu: str | None = None
    R: str | None = None
    E: str | None = None
    thickness: str | None = None
    symmetry: str | None = None
    top: float | None = None
    corner: float | None = None
    deck: Path | None = None
    surface: str | None = None
    reaction: str | None = None
    field: str | None = None
    time: str | None = None
    loads: tuple[float, ...] = ()

    def columns_and_values(self) -> tuple[dict[str, str], dict[str, str]]:
        """Return headers by key and constants by key, from mapping files and options."""
        mapping: dict[str, str] = {}
        values: dict[str, str] = {}
        files = [text for text in self.map if text.endswith(".toml") and "=" not in text]
        for file in files:
            columns, constants = read_mapping(Path(file))
            mapping |= columns
            values |= constants
        mapping |= parse_map(text for text in self.map if text not in files)
        values |= self.numbers()
        if self.texture is not None:
            values["a_over_R"], values["b_over_R"] = map(str, self.texture)
        return mapping, {key: text.strip() for key, text in values.items()}

    def numbers(self) -> dict[str, str]:
        """Return the given values of nu, R, E, thickness and load_se by key, as typed."""
        typed = {key: getattr(self, key) for key in ("nu", "R", "E", "thickness", "load_se")}
        return {key: text for key, text in typed.items() if text is not None}


def parse_map(texts: Iterable[str]) -> dict[str, str]:
    """Parse texts ``key=header``, ``key=header;unit`` or ``status Q=4=header`` of a mapping.

    Raises
    ------
    InputError
        If a text has no key or header, or a key occurs twice.

    Examples
    --------
    >>> parse_map(["a=Ridge width;mm", "status Q=4=Stat 1", "Q=4=First", "p=Load Q=* [kPa]"])
    {'a': 'Ridge width;mm', 'status Q=4': 'Stat 1', 'Q=4': 'First', 'p': 'Load Q=* [kPa]'}
    """
    mapping: dict[str, str] = {}
    for text in texts:
        match = re.fullmatch(r"\s*((?:\w+[\s:]+)?Q?\s*=?\s*\d+|[^=]*?)\s*=\s*(.*?)\s*", text, re.S)
        if match is None or not match.group(1) or not match.group(2):
            raise InputError(f"--map {text!r}: expected KEY=HEADER, or KEY=HEADER;UNIT")
        key, header = match.groups()
        if key in mapping:
            raise InputError(f"--map {text!r}: expected each key once")
        mapping[key] = header
    return mapping


def read_mapping(path: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Read a mapping file.

    Parameters
    ----------
    path : pathlib.Path
        TOML file with a table ``[columns]`` of headers by key (``a = "Ridge width [mm]"``), and
        optionally a table ``[values]`` of constants by key (``R = "8 mm"``).

    Returns
    -------
    mapping, values : dict of str to str
        Headers and constants by key.

    Raises
    ------
    InputError
        If the file is not TOML, has other tables, or has a header that is not text.
    """
    tables: dict[str, dict[str, str]] = {"columns": {}, "values": {}}
    for name, entries in read_toml(path).items():
        if name not in tables or not isinstance(entries, dict):
            raise InputError(f"{path}: {name[:80]}: expected tables [columns] and [values]")
        for key, value in entries.items():
            is_number = type(value) in (int, float)
            text = value if isinstance(value, str) else shown_value(value)
            if not isinstance(value, str) and not (is_number and name == "values"):
                raise InputError(f"{path}: [{name}] {key[:80]} = {text}: expected text in quotes")
            tables[name][key] = text
    return tables["columns"], tables["values"]


class TableFile(Protocol):
    """A table file whose header has been read; rows below it are numbered from 0."""

    where: str
    headers: tuple[str, ...]
    lines: IntArray | None  # line of each row; None for files without lines

    def read(self, numeric: Collection[str], problems: "FileError") -> pd.DataFrame:
        """Read all rows, `numeric` columns as numbers; report cells that are not numbers."""

    def cell(self, row: int, name: str) -> tuple[str, str]:
        """Return the place of a cell, such as ``line 4``, and its text."""


@dataclass(eq=False, repr=False)
class FileError(InputError):
    """An import: the user's facts, and all messages, errors and questions, raised as one error.

    Parameters
    ----------
    where : str
        File, for messages.
    facts : Given
        The user's options.
    values : dict of str to str
        Constants by key.
    wrong, needs : list of str
        Broken rules, and facts that the user has to give.
    options : dict of str to str
        Options for a second try, by name; ``?`` is a value that the user has to give.
    mapping : dict of str to str
        Entries of ``--map`` for a second try.
    known : dict of str to str
        Recognised columns, in the notation of ``--map``.
    is_broken : bool
        Whether rules are broken that no option mends.
    messages : list of str
        Messages about the import so far.
    """

    where: str
    facts: Given = field(default_factory=Given)
    values: dict[str, str] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)
    needs: list[str] = field(default_factory=list)
    options: dict[str, str] = field(default_factory=dict)
    mapping: dict[str, str] = field(default_factory=dict)
    known: dict[str, str] = field(default_factory=dict)
    is_broken: bool = False
    messages: list[str] = field(default_factory=list)
    _cells: dict[tuple[str, str], list[int]] = field(default_factory=dict)

    def __str__(self) -> str:
        lines = [*self.wrong, *self.needs]
        if len(lines) == 1:
            return lines[0] if lines[0].startswith(self.where) else f"{self.where}: {lines[0]}"
        n_rule, n_value = (count(len(self.wrong), "rule"), count(len(self.needs), "value"))
        heads = [f"{n_rule} broken"] * bool(self.wrong)
        head = " and ".join([*heads, *[f"{n_value} missing or unclear"] * bool(self.needs)])
        more = [f"and {len(lines) - MOST_SHOWN} more"] if len(lines) > MOST_SHOWN else []
        shown = [line.removeprefix(self.where).lstrip(",: ") for line in lines[:MOST_SHOWN]]
        return "\n  ".join([f"{self.where}: {head}", *shown, *more])

    def __bool__(self) -> bool:
        return bool(self.wrong or self.needs or self._cells)

    def error(self, message: str) -> InputError:
        """Return an error that names the file and that no option mends."""
        return InputError(f"{self.where}: {message}")

    def need(self, text: str, mapping: dict[str, str] | None = None, /, **options: str) -> None:
        """Record a fact that the user has to give, with the options that would give it."""
        if text not in self.needs:
            self.needs.append(text)
        self.mapping |= mapping or {}
        self.options |= {**options, **self.options}

    def cells(self, bad: "BoolArray | IntArray | pd.Index[int]", header: str, rule: str) -> None:
        """Record cells that break a rule, by a mask or by row numbers; report each cell once."""
        rows = np.flatnonzero(bad) if bad.dtype == bool else bad
        seen = {row for (name, _), rows in self._cells.items() if name == header for row in rows}
        if fresh := [row for row in rows.tolist() if row not in seen]:
            self._cells.setdefault((header, rule), []).extend(fresh)

    def rows(self) -> set[int]:
        """Return the rows with a reported cell."""
        return set(chain(*self._cells.values()))

    def broken_rows(self) -> set[int]:
        """Return the rows with a reported cell that no option mends."""
        return {r for (_, rule), rows in self._cells.items() if "--" not in rule for r in rows}

    def raise_all(self, source: TableFile | None = None) -> None:
        """Raise this error if any problem was recorded."""
        # A rule that names an option is not a broken rule: the option mends its cells.
        self.is_broken = bool(self.wrong) or any("--" not in rule for _, rule in self._cells)
        self.wrong += [] if source is None else self._cell_errors(source)
        if self.wrong or self.needs:
            raise self

    def _cell_errors(self, source: TableFile) -> list[str]:
        """Return a message for each rule that cells of a column break, in the order of the file."""
        texts = []
        for (header, rule), rows in self._cells.items():
            first = heapq.nsmallest(SHOWN, rows)
            cells = [source.cell(row, header) for row in first]
            spots = [(place, clipped(text)) for place, text in cells]
            text = broken_rule(source.where, f"column {header!r}", rule, spots, len(rows))
            texts.append((first[0], text))
        return [text for _, text in sorted(texts, key=lambda item: item[0])]


def broken_rule(where: str, name: str, rule: str, spots: Sequence[tuple[str, str]], n: int) -> str:
    """Return the message for n cells of a column that break a rule; `spots` are the first cells.

    Examples
    --------
    >>> broken_rule("t.csv", "Q", "expected 4", [("row 1", "5")], 1)
    't.csv, row 1, Q = 5: expected 4'
    >>> broken_rule("t.csv", "Q", "expected 4", [("row 1", "5"), ("row 3", "7")], 2)
    't.csv, Q, 2 cells: expected 4: row 1 = 5, row 3 = 7'
    """
    if n == 1:
        return f"{where}, {spots[0][0]}, {name} = {spots[0][1]}: {rule}"
    shown = some_of([f"{place} = {cell}" for place, cell in spots], SHOWN, n)
    return f"{where}, {name}, {n} cells: {rule}: {shown}"


FIRST = 4  # smallest Q with a transition load: two ridges touch at any load
MAX_REL_SE = 0.2  # larger relative errors get a caution
# Loads that differ from a smooth body's by more than this factor get a caution: by the half-plane
# equation textures need 0.27 to 1 times that load, from a/b = 0.01 to wide ridges.
_MAX_LOAD_RATIO = 5.0
FARTHEST = 4.0  # largest distance over R of a point of the body from the axis
HUGE = 1e100  # largest length or load; the product of three is still a finite float


@dataclass(frozen=True, eq=False)
class Imported:
    """Result of an import.

    Parameters
    ----------
    table : ContactTable
        Imported rows.
    messages : tuple of str
        One-line messages about columns, units, textures, rows kept, and parts ignored with the
        reason.
    known : mapping of str to str
        Recognised columns of a table file by key, in the notation of ``--map``.
    doubts : tuple of str
        Cautions on the mesh of a run, or on columns that contradict each other.
    """

    table: ContactTable
    messages: tuple[str, ...]
    known: Mapping[str, str] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()

    @property
    def cautions(self) -> list[str]:
        """Warnings about doubtful rows, which break no rule of the table.

        Doubtful are a relative error above 0.2, a curve that begins above Q = 4, and a load above
        five times, or below a fifth of, the load at which a smooth body reaches the same corner.
        """
        frame = self.table.frame
        is_ok, is_count = frame["status"] == OK, frame["kind"] == COUNT
        transition = frame[(frame["kind"] == TRANSITION) & is_ok]
        first = transition.loc[transition.groupby(list(CURVE), sort=False)["Q"].idxmin()]
        # A count is seen from the load of its corner, or from any load, to that of the next pair.
        texture = (frame["a_over_R"], frame["b_over_R"])
        first_load = transition_load(frame["Q"], *texture, nu=frame["nu"]) * (frame["Q"] >= FIRST)
        last_load = transition_load(frame["Q"] + 2 * is_count, *texture, nu=frame["nu"])
        load = frame["p_over_E"]
        is_far = (load < first_load / _MAX_LOAD_RATIO) | (load > last_load * _MAX_LOAD_RATIO)
        is_far &= is_ok
        factor = f"{_MAX_LOAD_RATIO:g} times, or under 1/{_MAX_LOAD_RATIO:g} of, that of a smooth"
        doubtful = {
            f"p/E is over {factor} body whose contact reaches this corner; check the units of "
            "loads, widths, R and E": frame[is_far],
            f"rel_se is above {MAX_REL_SE:g}: the load is hardly known": frame[
                frame["rel_se"] > MAX_REL_SE
            ],
            "a curve begins here; loads of lower Q are missing": first[first["Q"] > FIRST],
        }
        return [*self.doubts] + [
            f"{count(len(rows), 'row')}, "
            f"{some_of(map(_shown, rows[:SHOWN].itertuples()), SHOWN, len(rows))}: {what}"
            for what, rows in doubtful.items()
            if len(rows)
        ]


def _shown(row: Any) -> str:
    return f"{row.texture} Q = {row.Q:g} p/E = {row.p_over_E:.5g}"


def provenance(path: Path, importer: str, *details: str) -> str:
    """Return the source of rows: importer, file name, first digits of its SHA-256, and details."""
    digest = hashlib.sha256(read_bytes(path)).hexdigest()[:16]
    return " ".join([f"import {importer}:", path.name, f"sha256={digest}", *details])
