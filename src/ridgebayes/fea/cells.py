"""Cells of a table file, whatever its format: headers, values, and where each cell stands."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.column_units import split_header
from ridgebayes.fea.problems import Places, Problems

NUMBER = re.compile(r"\s*[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?\s*", re.A)
FINITE = "expected a finite number, with a point for decimals, or an empty cell"
FORMULA = "expected values, not formulas"
MOST_COLUMNS = 2000
LONGEST_HEADER = 500
_UNNAMED = "(column {})"


class Source(Places, Protocol):
    """A table file whose header is known; rows are counted from 0 below it."""

    headers: tuple[str, ...]
    settings: Mapping[str, tuple[str, int]]  # constants of title lines, each with its line

    def read(self, numeric: Collection[str], problems: Problems) -> "Cells":
        """Read all rows, the columns of these headers as numbers; note cells that are none."""

    def lines(self, rows: IntArray) -> IntArray | None:
        """Return the file's lines of some rows; None where it has no lines."""
        return None


@dataclass(frozen=True, eq=False)
class Cells:
    """Rows of a table file.

    Parameters
    ----------
    source : Source
        The file.
    frame : DataFrame, n_row rows
        Columns by header: those asked for as numbers are float64, NaN where a cell is empty.
    row : ndarray of int, shape (n_row,)
        Which rows of the file they are.
    messages : tuple of str
        Format, separator, decimal mark, blank rows.
    """

    source: Source
    frame: pd.DataFrame
    row: IntArray
    messages: tuple[str, ...]

    @classmethod
    def of(cls, source: Source, frame: pd.DataFrame, *messages: str) -> "Cells":
        """Return the rows that hold anything, without unnamed columns that hold nothing.

        Raises
        ------
        InputError
            If no row does.
        """
        empty = {name: _empty(frame[name]) for name in frame}
        unnamed = {_UNNAMED.format(i) for i in range(1, len(empty) + 1)}
        used = [name for name in empty if name not in unnamed or not empty[name].all()]
        blank = np.logical_and.reduce(list(empty.values()))
        if blank.all():
            raise InputError(f"{source.where}: no rows below the header")
        frame, kept = frame[used], np.flatnonzero(~blank)
        if n := len(blank) - len(kept):
            frame = frame.iloc[kept].reset_index(drop=True)
            messages = (*messages, f"{n} empty rows ignored")
        return cls(source, frame, kept, messages)

    def kept(self, keep: BoolArray) -> "Cells":
        """Return some of the rows."""
        frame = self.frame[keep].reset_index(drop=True)
        return Cells(self.source, frame, self.row[keep], self.messages)

    @property
    def lines(self) -> IntArray | None:
        """The file's line of each row, where it has lines."""
        return self.source.lines(self.row)


def clean_headers(names: Sequence[object], where: str) -> tuple[str, ...]:
    r"""Return headers on one line each, and a stand-in for a column without one.

    A header that stands twice gets the number of its column.

    Raises
    ------
    InputError
        If a header is a formula, is too long or has control characters, or there are over 2000.

    Examples
    --------
    >>> clean_headers(["Ridge  width\n[mm]", None, "Q", "Q"], "mine.csv")
    ('Ridge width [mm]', '(column 2)', 'Q', 'Q #4')
    """
    headers: list[str] = []
    if len(names) > MOST_COLUMNS:
        raise InputError(f"{where}: {len(names)} columns; expected at most {MOST_COLUMNS}")
    for i, name in enumerate(names, start=1):
        text = "" if name is None else " ".join(str(name).split())
        rules = {
            FORMULA: text.startswith("="),
            "expected no control characters": re.search(r"[\x00-\x1f\x7f]", text) is not None,
            f"expected at most {LONGEST_HEADER} characters": len(text) > LONGEST_HEADER,
        }
        for rule, is_broken in rules.items():
            if is_broken:
                raise InputError(f"{where}, header, column {i} = {text[:60]!r}: {rule}")
        if text in headers:
            words, unit, _ = split_header(text)
            text = f"{words} #{i}" + (f" [{unit}]" if unit else "")
        headers.append(text or _UNNAMED.format(i))
    if all(name == _UNNAMED.format(i) for i, name in enumerate(headers, start=1)):
        raise InputError(f"{where}: no header; expected a header for each column")
    return tuple(headers)


def as_numbers(cells: "pd.Series[Any]") -> FloatArray:
    """Return the numbers of a column, with points or commas for decimals; none if some are not."""
    if cells.dtype.kind not in "if":
        cells = pd.to_numeric(cells.astype(str).str.replace(",", "."), errors="coerce")
        if cells.isna().any():
            return np.array([])
    return cells.to_numpy(float)


def _empty(cells: "pd.Series[str]") -> BoolArray:
    empty = cells.isna() if cells.dtype.kind in "fiubM" else cells.isna() | (cells == "")
    return empty.to_numpy(dtype=bool)
