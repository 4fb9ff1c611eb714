"""Cells of a table file, whatever its format: headers, values, and where each cell stands."""

import heapq
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.text import clipped

SHOWN = 20  # cells a message lists; the rest is counted
NUMBER = re.compile(r"\s*[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?\s*", re.A)
FINITE = "expected a finite number, with a point for decimals, or an empty cell"
FORMULA = "expected values, not formulas"
MOST_COLUMNS = 2000
LONGEST_HEADER = 500
_PLAIN = r"-?(?:0|[1-9]\d{0,14})(?:\.\d+)?(?:[eE][+-]?\d{1,2})?|"
_UNNAMED = "(column {})"


class Source(Protocol):
    """A table file whose header is known; rows are counted from 0 below it."""

    where: str
    headers: tuple[str, ...]

    def read(self, numeric: Collection[str]) -> "Cells":
        """Read all rows, the columns of these headers as numbers."""

    def lines(self, rows: IntArray) -> IntArray | None:
        """Return the file's lines of some rows; None where it has no lines."""
        return None

    def place(self, row: int, name: str) -> str:
        """Return words for a cell, such as ``mine.csv, line 4``."""

    def typed(self, wanted: Sequence[tuple[int, str]]) -> list[str]:
        """Return cells, each of a row and a header, as they were typed."""


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
            If no row does, or an unnamed column does.
        """
        empty = {name: _empty(frame[name]) for name in frame}
        unnamed = {_UNNAMED.format(i): i for i in range(1, len(empty) + 1)}
        for name, i in unnamed.items():
            if name in empty and not empty[name].all():
                raise InputError(
                    f"{source.where}: column {i} has cells but no header; expected a header for "
                    "each column"
                )
        blank = np.logical_and.reduce(list(empty.values()))
        if blank.all():
            raise InputError(f"{source.where}: no rows below the header")
        frame, kept = frame[[name for name in empty if name not in unnamed]], np.flatnonzero(~blank)
        if n := len(blank) - len(kept):
            frame = frame.iloc[kept].reset_index(drop=True)
            messages = (*messages, f"{n} empty rows ignored")
        return cls(source, frame, kept, messages)

    @property
    def lines(self) -> IntArray | None:
        """The file's line of each row, where it has lines."""
        return self.source.lines(self.row)

    def check(self, *rules: tuple[BoolArray, str, str]) -> None:
        """Refuse the cells where a mask of shape (n_row,) is true; each with header and rule."""
        found = [(row, i) for i, (bad, *_) in enumerate(rules) for row in np.flatnonzero(bad)]
        if found:
            first = heapq.nsmallest(SHOWN, found)
            shown = [(int(self.row[row]), *rules[i][1:]) for row, i in first]
            raise cells_error(self.source, shown, len(found))


def cells_error(source: Source, bad: Sequence[tuple[int, str, str]], n: int) -> InputError:
    """Return the error that lists cells, each of a row, a header and a rule, and counts all."""
    typed = source.typed([(row, name) for row, name, _ in bad])
    lines = [
        f"{source.place(row, name)}, column {name!r} = {clipped(cell)}: {rule}"
        for (row, name, rule), cell in zip(bad, typed, strict=True)
    ]
    return lines_error(source.where, lines, n, "cells break a rule")


def lines_error(where: str, lines: Sequence[str], n: int, what: str) -> InputError:
    """Return the error of one line, or of the first lines of some that are counted.

    Examples
    --------
    >>> print(lines_error("a.csv", ["a.csv, line 2: odd", "a.csv, line 4: odd"], 3, "rows are odd"))
    a.csv: 3 rows are odd
      a.csv, line 2: odd
      a.csv, line 4: odd
      and 1 more
    """
    if n == 1:
        return InputError(lines[0])
    more = [f"and {n - len(lines)} more"] if n > len(lines) else []
    return InputError("\n  ".join([f"{where}: {n} {what}", *lines, *more]))


def clean_headers(names: Sequence[object], where: str) -> tuple[str, ...]:
    r"""Return headers on one line each, and a stand-in for a column without one.

    Raises
    ------
    InputError
        If a header stands twice, is a formula, is too long or has control characters, or there
        are over 2000.

    Examples
    --------
    >>> clean_headers(["Ridge  width\n[mm]", None], "mine.csv")
    ('Ridge width [mm]', '(column 2)')
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
            "expected each header once": bool(text) and text in headers,
        }
        for rule, is_broken in rules.items():
            if is_broken:
                raise InputError(f"{where}, header, column {i} = {text[:60]!r}: {rule}")
        headers.append(text or _UNNAMED.format(i))
    if all(name == _UNNAMED.format(i) for i, name in enumerate(headers, start=1)):
        raise InputError(f"{where}: no header; expected a header for each column")
    return tuple(headers)


def lossless(cells: "pd.Series[str]") -> "pd.Series[str] | pd.Series[float]":
    """Return a column of text as numbers, if all of it is and none loses anything by it.

    Examples
    --------
    >>> lossless(pd.Series(["1", ""])).tolist(), lossless(pd.Series(["007"])).tolist()
    ([1.0, nan], ['007'])
    """
    full = cells != ""
    is_like_first = full.any() and re.fullmatch(_PLAIN, str(cells[full].iloc[0]))
    if not is_like_first or not cells.str.fullmatch(_PLAIN).all():
        return cells
    values = cells.mask(~full, "nan").to_numpy(dtype=object).astype(np.float64)
    if full.all() and cells.str.fullmatch(r"-?\d+").all():
        values = values.astype(np.int64)
    return pd.Series(values, index=cells.index)


def _empty(cells: "pd.Series[str]") -> BoolArray:
    empty = cells.isna() if cells.dtype.kind in "fiubM" else cells.isna() | (cells == "")
    return empty.to_numpy(dtype=bool)
