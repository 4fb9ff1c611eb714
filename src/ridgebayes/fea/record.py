"""Facts that a user gives to an import, and its result: a table, or all that is wrong."""

import hashlib
import heapq
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, IntArray
from ridgebayes.contact.hertz import load_of_half_width
from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import read_bytes, read_toml
from ridgebayes.runtime.text import clipped, count, shown_value, some_of
from ridgebayes.table.columns import CURVE, OK, TRANSITION
from ridgebayes.table.columns import SHOWN as MOST_SHOWN
from ridgebayes.table.table import ContactTable

SHOWN = 3  # cells of one complaint that a message lists; the rest is counted


@dataclass(frozen=True)
class Given:
    """Facts that a file lacks and the user gives; each format takes only some of them.

    Parameters
    ----------
    map : tuple of str
        ``key=header``, or paths of TOML files with them.
    sheet : str or None
        Worksheet by name or number; None takes the one with the words of the field.
    skip_rows : int
        Lines to pass over at the top.
    header_row : int or None
        Line of the header; 0 for none, None looks for it.
    decimal : str or None
        "point" or "comma".
    empty : tuple of str
        Texts of cells that are empty.
    count_is : str or None
        Things counted, one of `ridgebayes.fea.words.COUNTS`.
    brackets, interpolate : bool
        For increments: always intervals, even where gaps tell the load within; or always loads.
    closed_is : tuple of int
        Codes of a status that mean contact; none for 0 open, 1 closed.
    skip_empty : bool
        Whether rows without a load are left out.
    load_se : str or None
        Standard error of every load of a table, in any unit of loads.
    texture : (float, float) or None
        Ridge and groove width over R.
    nu, R, E : str or None
        As typed; lengths and stresses with units for tables, plain numbers in a run's own units.
    thickness : str or None
        As R: of the slice, or of the body that forces press on.
    symmetry : str or None
        "half" or "full".
    top, corner : float or None
        Height of the ridges' tops, corner radius over R.
    deck : Path or None
        Input deck of a run.
    surface, reaction : str or None
        Node sets.
    field, time : str or None
        Name of a series' displacements; meaning of its time, "p_over_E" or "line".
    loads : tuple of float
        Loads of several ``.vtu``, or of a ``.pvd`` whose times are no loads, as `time` says.
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

    def columns_and_values(self) -> tuple[dict[str, str], dict[str, str | float]]:
        """Return headers by key, and constants of a table by key: of files, and of options."""
        mapping: dict[str, str] = {}
        values: dict[str, str | float] = {}
        files = [text for text in self.map if text.endswith(".toml") and "=" not in text]
        for file in files:
            columns, constants = read_mapping(Path(file))
            mapping |= columns
            values |= constants
        mapping |= parse_map(text for text in self.map if text not in files)
        values |= self.numbers()
        if self.load_se is not None:
            values["load_se"] = self.load_se
        if self.texture is not None:
            values["a_over_R"], values["b_over_R"] = self.texture
        return mapping, values

    def numbers(self) -> dict[str, str]:
        """Return the numbers of the body that were typed, by key."""
        typed = {key: getattr(self, key) for key in ("nu", "R", "E", "thickness")}
        return {key: text for key, text in typed.items() if text is not None}


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
    """A table file whose header is known; rows are counted from 0 below it."""

    where: str
    headers: tuple[str, ...]
    lines: IntArray | None  # of the rows, where the file has lines

    def read(self, numeric: Collection[str], problems: "FileError") -> pd.DataFrame:
        """Read all rows, the columns of these headers as numbers; note cells that are none."""

    def spot(self, row: int, name: str) -> str:
        """Return words for a cell, such as ``line 4``."""

    def typed(self, row: int, name: str) -> str:
        """Return a cell as it was typed."""


@dataclass(eq=False, repr=False)
class FileError(InputError):
    """A file that cannot be imported as it was asked for: gathered, and raised once all is known.

    Parameters
    ----------
    where : str
        The file, for messages.
    wrong, needs : list of str
        Broken rules, and facts that the user has to give.
    options : dict of str to str
        Options that a second try needs, by name; ``?`` replaces values that only the user knows.
    mapping : dict of str to str
        The same of ``--map``.
    known : dict of str to str
        Recognised columns, as ``--map`` would name them.
    is_broken : bool
        Whether cells break rules that no option changes.
    messages : list of str
        Messages about the reading so far.
    columns : str
        The columns that there are, where one is missing.
    """

    where: str
    wrong: list[str] = field(default_factory=list)
    needs: list[str] = field(default_factory=list)
    options: dict[str, str] = field(default_factory=dict)
    mapping: dict[str, str] = field(default_factory=dict)
    known: dict[str, str] = field(default_factory=dict)
    is_broken: bool = False
    messages: list[str] = field(default_factory=list)
    columns: str = ""
    _cells: dict[tuple[str, str], list[int]] = field(default_factory=dict)
    _told: set[tuple[int, str]] = field(default_factory=set)

    def __str__(self) -> str:
        lines = [*self.wrong, *self.needs]
        if len(lines) == 1:
            return lines[0] if lines[0].startswith(self.where) else f"{self.where}: {lines[0]}"
        counts = ((len(self.wrong), "rules broken"), (len(self.needs), "values missing or unclear"))
        head = " and ".join(f"{n} {what}" for n, what in counts if n)
        more = [f"and {len(lines) - MOST_SHOWN} more"] if len(lines) > MOST_SHOWN else []
        return "\n  ".join([f"{self.where}: {head}", *lines[:MOST_SHOWN], *more])

    def __bool__(self) -> bool:
        return bool(self.wrong or self.needs or self._cells)

    def error(self, message: str) -> InputError:
        """Return an error about the file that no option mends."""
        return InputError(f"{self.where}: {message}")

    def need(self, text: str, mapping: dict[str, str] | None = None, /, **options: str) -> None:
        """Note what the user has to say, with the options that would say it."""
        if text not in self.needs:
            self.needs.append(text)
        self.mapping |= mapping or {}
        self.options |= {**options, **self.options}

    def cells(self, bad: "BoolArray | IntArray | pd.Index[int]", header: str, rule: str) -> None:
        """Note cells, by a mask over the file's rows or by rows; each cell is reported once."""
        rows = np.flatnonzero(bad) if bad.dtype == bool else bad
        fresh = [row for row in rows.tolist() if (row, header) not in self._told]
        if fresh:
            self._told |= {(row, header) for row in fresh}
            self._cells.setdefault((header, rule), []).extend(fresh)

    def rows(self) -> set[int]:
        """Return the file's rows with a reported cell."""
        return {row for row, _ in self._told}

    def broken_rows(self) -> set[int]:
        """Return the file's rows with a cell that no option mends."""
        return {r for (_, rule), rows in self._cells.items() if "--" not in rule for r in rows}

    def raise_all(self, source: TableFile | None = None) -> None:
        """Raise what was noted, if anything was."""
        # A cell that an option mends is not broken.
        self.is_broken = bool(self.wrong) or any("--" not in rule for _, rule in self._cells)
        self.wrong += [] if source is None else self._of_cells(source)
        self.needs += [f"the columns are {self.columns}"] if self.columns else []
        if self.wrong or self.needs:
            raise self

    def _of_cells(self, source: TableFile) -> list[str]:
        """Return a line for each complaint about cells, in the order of the file."""
        texts = []
        for (header, rule), rows in self._cells.items():
            first = heapq.nsmallest(SHOWN, rows)
            spots = [source.spot(row, header) for row in first]
            cells = [clipped(source.typed(row, header)) for row in first]
            if len(rows) == 1:
                text = f"{source.where}, {spots[0]}, column {header!r} = {cells[0]}: {rule}"
            else:
                pairs = [f"{spot} = {cell}" for spot, cell in zip(spots, cells, strict=True)]
                shown = some_of(pairs, SHOWN, len(rows))
                text = f"column {header!r}, {len(rows)} cells: {rule}: {shown}"
            texts.append((first[0], text))
        return [text for _, text in sorted(texts, key=lambda item: item[0])]


FIRST = 4  # Q of the first load that a run can tell
_UNSURE = 0.2  # rel_se
_FAR = 5.0  # over the smooth body's load: loads of textures are lower
FARTHEST = 4.0  # over R: largest distance of a point of the body from the axis
HUGE = 1e100  # largest length or load: a product of three still is a float


@dataclass(frozen=True, eq=False)
class Imported:
    """A file that was understood.

    Parameters
    ----------
    table : ContactTable
        Its rows.
    messages : tuple of str
        Messages about the reading, a line each: columns, units, textures, rows kept, and parts
        ignored, with the reason.
    known : mapping of str to str
        Columns of a table file by key, as ``--map`` would name them.
    """

    table: ContactTable
    messages: tuple[str, ...]
    known: Mapping[str, str] = field(default_factory=dict)

    @property
    def cautions(self) -> list[str]:
        """Warnings of doubtful rows that break no rule of the table.

        An error above a fifth of the load, a curve that begins above Q = 4, and a load over five
        times that at which a smooth body reaches the same corner.
        """
        frame = self.table.frame
        transition = frame[(frame["kind"] == TRANSITION) & (frame["status"] == OK)]
        first = transition.loc[transition.groupby(list(CURVE), sort=False)["Q"].idxmin()]
        corner = frame["b_over_R"] / 2 + (frame["Q"] / 2 - 1) * (
            frame["a_over_R"] + frame["b_over_R"]
        )
        smooth = load_of_half_width(corner, nu=frame["nu"])
        far = f"p/E is over {_FAR:g} times that of a smooth body whose contact reaches this corner"
        doubtful = {
            f"{far}; check the units of loads, widths, R and E": frame[
                frame["p_over_E"] > _FAR * smooth
            ],
            f"rel_se is above {_UNSURE:g}: the load is hardly known": frame[
                frame["rel_se"] > _UNSURE
            ],
            "a curve begins here; loads of lower Q are missing": first[first["Q"] > FIRST],
        }
        return [
            f"{count(len(rows), 'row')}, {some_of(map(_shown, rows.itertuples()), 3)}: {what}"
            for what, rows in doubtful.items()
            if len(rows)
        ]


def _shown(row: Any) -> str:
    return f"{row.texture} Q = {row.Q:g} p/E = {row.p_over_E:.5g}"


def provenance(path: Path, importer: str, *details: str) -> str:
    """Return where rows come from: importer, file, the beginning of its SHA-256, details."""
    digest = hashlib.sha256(read_bytes(path)).hexdigest()[:16]
    return " ".join([f"import {importer}:", path.name, f"sha256={digest}", *details])
