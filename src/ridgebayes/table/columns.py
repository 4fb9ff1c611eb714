"""Columns of a contact table, check of the header, and messages about invalid cells."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ridgebayes._types import BoolArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.text import clipped, shown_value, some_of

if TYPE_CHECKING:  # scenes import this module without pandas
    import pandas as pd


@dataclass(frozen=True)
class Column:
    """Definition of a column of a table.

    A column whose `default` is None is required. A column that is not `always_written` is omitted
    from a file if every row has the default.
    """

    name: str
    holds: Literal["number", "text"]
    rule: str
    default: float | str | None = None
    always_written: bool = False
    means: str = ""


TRANSITION, COUNT = "transition", "count"
CALIBRATION, HELD_OUT = "calibration", "held-out"
OK = "ok"
# 2^53: integers up to it are exact as floats.
LARGEST_Q = int(2 / np.finfo(float).eps)

# Within these limits the load of any countable Q is a float of full precision.
LEAST_WIDTH, LARGEST_WIDTH, LARGEST_LOAD = 1e-50, 1e50, 1e300

_FREE = "any text on one line"
COLUMNS = (
    Column("a_over_R", "number", "must be finite and > 0", means="ridge width over the radius"),
    Column("b_over_R", "number", "must be finite and > 0", means="groove width over the radius"),
    Column(
        "Q",
        "number",
        "must be an integer of at most 2^53",
        means="proximal ridge edges in contact: even, unless the body is off the groove's centre",
    ),
    Column(
        "p_over_E",
        "number",
        "must be finite and > 0",
        means="load per projected area over Young's modulus: that at which Q was reached "
        "(transition), or seen (count)",
    ),
    Column(
        "p_over_E_lower",
        "number",
        "must be finite and >= 0",
        np.nan,
        means="the last load at which Q was not yet reached: the row is a bracket",
    ),
    Column(
        "rel_se",
        "number",
        "must be finite and >= 0",
        0.0,
        means="known relative standard error of the load, independent from row to row",
    ),
    Column(
        "kind",
        "text",
        "must be 'transition' or 'count'",
        TRANSITION,
        means="a load at which Q goes up, or a Q seen at some load",
    ),
    Column("nu", "number", "must be from 0 to 0.5", 0.5, True, "Poisson's ratio of the body"),
    Column(
        "offset_over_R",
        "number",
        "must be finite",
        0.0,
        means="lateral offset of the body from the groove's centre",
    ),
    Column(
        "texture",
        "text",
        "one label names one (a_over_R, b_over_R)",
        "",
        True,
        "label of the texture; empty means a<A>_b<B>",
    ),
    Column("series", "text", _FREE, "", means="which laboratory, rig, mesh or repeat made the row"),
    Column(
        "role",
        "text",
        "must be 'calibration' or 'held-out'",
        CALIBRATION,
        means="fitted, or predicted and compared only",
    ),
    Column("solver", "text", _FREE, "", True, "who computed the row"),
    Column("status", "text", _FREE, OK, True, "ok, or what failed: other rows are not fitted"),
    Column("source", "text", _FREE, "", True, "where the row came from"),
)
RULES = {column.name: column.rule for column in COLUMNS}
NAMES = tuple(column.name for column in COLUMNS)
REQUIRED = tuple(column.name for column in COLUMNS if column.default is None)
NUMBERS = tuple(column.name for column in COLUMNS if column.holds == "number")
CURVE = ("a_over_R", "b_over_R", "nu", "offset_over_R", "source", "solver", "series")


def check_header(names: Sequence[Any], where: str, contract: Sequence[Column] = COLUMNS) -> None:
    """Refuse a header with nameless, repeated or missing columns.

    Parameters
    ----------
    names : sequence of str
        Column names of a table, in any order.
    where : str
        Name for messages.
    contract : sequence of Column, optional
        Column definitions; those of a contact table if not given.

    Raises
    ------
    InputError
        If a column has no name, a name occurs twice, or a required column is missing.

    Examples
    --------
    >>> check_header(["a_over_R", "b_over_R", "Q", "p"], "fea.csv")
    Traceback (most recent call last):
        ...
    ridgebayes.errors.InputError: fea.csv, header: missing column p_over_E;
    the columns are 'a_over_R', 'b_over_R', 'Q', 'p'
    """
    there = some_of(map(shown_value, names), SHOWN) or "none"
    before: set[str] = set()
    for i, name in enumerate(names, start=1):
        rule = "each column must stand once" if name in before else None
        if not isinstance(name, str) or not name:
            rule = "must have a name, as text"
        if rule is not None:
            at = f"column {i} = {shown_value(name)}"
            raise InputError(f"{where}, header: {at}: {rule}; the columns are {there}")
        before.add(name)
    required = [column.name for column in contract if column.default is None]
    if missing := [name for name in required if name not in names]:
        columns = "column" if len(missing) == 1 else "columns"
        hint = " (columns are separated by commas)" if ";" in there or "\\t" in there else ""
        if contract is COLUMNS and len(missing) > 1:
            hint += ". ridgebayes import makes a table of other columns and units"
        raise InputError(
            f"{where}, header: missing {columns} {', '.join(missing)}; "
            f"the columns are {there}{hint}"
        )


SHOWN = 20  # cells listed in a message; the others are counted


@dataclass(frozen=True)
class RawTable:
    """Unchecked cells of a table with the information for messages about them.

    `lines` holds the line number of each row, if the table is a text file.
    """

    frame: "pd.DataFrame"
    where: str
    lines: IntArray | None = None

    def place(self, row: int) -> str:
        """Return the location of a row, counted from 0, for a message."""
        line = "" if self.lines is None else f" (line {self.lines[row]})"
        return f"{self.where}, row {row + 1}{line}"

    def shown(self, row: int, column: str) -> str:
        """Return a cell as typed."""
        cell: Any = self.frame[column].iloc[row] if column in self.frame else ""
        if isinstance(cell, str):
            return clipped(cell) if cell else "(empty)"
        return str(cell)


class Findings:
    """Cells that violate a rule; only the first violated rule of each cell is reported."""

    def __init__(self, n_row: int) -> None:
        self.n_row = n_row
        self.bad: dict[str, BoolArray] = {}
        self._added: list[tuple[IntArray, str, str, IntArray | None]] = []

    def add(
        self, broken: BoolArray | IntArray, column: str, rule: str, other: IntArray | None = None
    ) -> None:
        """Add rows by mask or number, with a second row of each if the rule has ``{other}``."""
        seen = self.bad.setdefault(column, np.zeros(self.n_row, dtype=bool))
        rows = np.flatnonzero(broken) if broken.dtype == bool else broken.astype(np.int64)
        fresh = ~seen[rows]
        if fresh.any():
            seen[rows] = True
            self._added.append((rows[fresh], column, rule, None if other is None else other[fresh]))

    def sound(self, *columns: str) -> BoolArray:
        """Return the rows without findings in the columns so far, shape (n_row,)."""
        bad = [self.bad[column] for column in columns if column in self.bad]
        return np.asarray(~np.any([np.zeros(self.n_row, dtype=bool), *bad], axis=0))

    def __bool__(self) -> bool:
        return bool(self._added)

    def complaints(self) -> Iterator[tuple[str, str, IntArray, IntArray | None]]:
        """Yield column, rule, the rows that violate it, and the rows that replace ``{other}``."""
        for rows, column, rule, other in self._added:
            yield column, rule, rows, other

    def message(self, raw: RawTable) -> str:
        """Return a message with a line for each cell in the order of the file, at most twenty."""
        rows = np.concatenate([rows for rows, *_ in self._added])
        which = np.repeat(np.arange(len(self._added)), [len(rows) for rows, *_ in self._added])
        order = np.lexsort((which, rows))
        lines = []
        for i in order[:SHOWN]:
            row = int(rows[i])
            at, column, rule, other = self._added[which[i]]
            if other is not None:
                rule = rule.format(other=int(other[np.flatnonzero(at == row)[0]]) + 1)
            lines.append(f"{raw.place(row)}: {column} = {raw.shown(row, column)}: {rule}")
        return listed(raw.where, lines, len(rows), len(np.unique(rows)))


def listed(where: str, lines: list[str], n_cell: int, n_row: int) -> str:
    """Return a headline and the lines below it, with the number of omitted lines."""
    cells, verb = ("1 value", "breaks") if n_cell == 1 else (f"{n_cell} values", "break")
    if n_cell > len(lines):
        lines = [*lines, f"... and {n_cell - len(lines)} more"]
    what = "1 row" if n_row == 1 else f"{n_row} rows"
    return "\n  ".join([f"{where}: {cells} in {what} {verb} the rules of the table", *lines])
