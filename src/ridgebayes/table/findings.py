"""Where a cell came from, which cells break a rule, and the one message that lists them all."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, IntArray
from ridgebayes.runtime.text import clipped

SHOWN = 20  # a message a person can still read; the rest is counted


@dataclass(frozen=True)
class RawTable:
    """Cells as they came in, with what a message needs to point at them.

    `line` gives the file's line of a row counted from 0, where there is one; `retyped` reads the
    same file again with every cell as typed, which is slow and only done to word an error.
    """

    frame: pd.DataFrame
    where: str
    line: Callable[[int], int] | None = None
    retyped: "Callable[[], RawTable] | None" = None

    def place(self, row: int) -> str:
        """Return the words for a row counted from 0."""
        line = "" if self.line is None else f" (line {self.line(row)})"
        return f"{self.where}, row {row + 1}{line}"

    def shown(self, row: int, column: str) -> str:
        """Return a cell as it was typed."""
        cell: Any = self.frame[column].iloc[row] if column in self.frame else ""
        if isinstance(cell, str):
            return clipped(cell) if cell else "(empty)"
        return str(cell)


class Findings:
    """Cells that break a rule; of each cell only the first rule it breaks is told."""

    def __init__(self, n_row: int) -> None:
        self.n_row = n_row
        self.bad: dict[str, BoolArray] = {}
        self._told: list[tuple[IntArray, str, str, IntArray | None]] = []

    def add(self, broken: BoolArray, column: str, rule: str, other: IntArray | None = None) -> None:
        """Note the rows where `broken`; ``{other}`` in the rule is a second row of each."""
        seen = self.bad.setdefault(column, np.zeros(self.n_row, dtype=bool))
        rows = np.flatnonzero(broken & ~seen)
        if len(rows):
            seen[rows] = True
            self._told.append((rows, column, rule, other))

    def sound(self, *columns: str) -> BoolArray:
        """Return where none of the columns broke a rule so far, shape (n_row,)."""
        fine = np.ones(self.n_row, dtype=bool)
        for column in columns:
            if column in self.bad:
                fine &= ~self.bad[column]
        return fine

    def __bool__(self) -> bool:
        return bool(self._told)

    def message(self, raw: RawTable) -> str:
        """Return one line a cell, in the order of the file, the first twenty of them."""
        rows = np.concatenate([rows for rows, *_ in self._told])
        which = np.repeat(np.arange(len(self._told)), [len(rows) for rows, *_ in self._told])
        order = np.lexsort((which, rows))
        lines = []
        for i in order[:SHOWN]:
            row = int(rows[i])
            _, column, rule, other = self._told[which[i]]
            if other is not None:
                rule = rule.format(other=int(other[row]) + 1)
            lines.append(f"{raw.place(row)}: {column} = {raw.shown(row, column)}: {rule}")
        return listed(raw.where, lines, len(rows), len(np.unique(rows)))


def listed(where: str, lines: list[str], n_cell: int, n_row: int) -> str:
    """Return the lines below a headline, with the rest counted."""
    cells, verb = ("1 value", "breaks") if n_cell == 1 else (f"{n_cell} values", "break")
    if n_cell > len(lines):
        lines = [*lines, f"... and {n_cell - len(lines)} more"]
    what = "1 row" if n_row == 1 else f"{n_row} rows"
    return "\n  ".join([f"{where}: {cells} in {what} {verb} the rules of the table", *lines])
