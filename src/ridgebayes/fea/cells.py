"""Cells of a table file, whatever its format: headers, values, and where each cell stands."""

import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray
from ridgebayes.errors import InputError

SHOWN = 20  # cells a message lists; the rest is counted
NUMBER = re.compile(r"\s*[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?\s*", re.A)
FINITE = "expected a finite number, with a point for decimals, or an empty cell"
FORMULA = "expected values, not formulas"
MOST_COLUMNS = 2000
LONGEST_HEADER = 500
_PLAIN = r"-?(?:0|[1-9]\d{0,14})(?:\.\d+)?(?:[eE][+-]?\d{1,2})?|"
_UNNAMED = "(column {})"


@dataclass(frozen=True, eq=False)
class Cells:
    """Rows of a table file.

    Parameters
    ----------
    where : str
        File, and sheet if it has several, that messages show.
    frame : DataFrame, n_row rows
        Columns by header: those asked for as numbers are float64, NaN where a cell is empty.
    place : callable
        Row from 0 and header to words such as ``mine.csv, line 4``.
    typed : callable
        Rows and headers to the cells as typed.
    line : callable or None
        Row from 0 to the file's line, where it has lines.
    messages : tuple of str
        Format, separator, decimal mark, blank rows.
    """

    where: str
    frame: pd.DataFrame
    place: Callable[[int, str], str]
    typed: Callable[[Sequence[tuple[int, str]]], list[str]]
    line: Callable[[int], int] | None
    messages: tuple[str, ...]

    def check(self, *rules: tuple[BoolArray, str, str]) -> None:
        """Refuse the cells where a mask of shape (n_row,) is true; each with header and rule."""
        rows = np.concatenate([np.flatnonzero(bad) for bad, *_ in rules]) if rules else np.zeros(0)
        if not rows.size:
            return
        which = np.repeat(np.arange(len(rules)), [int(bad.sum()) for bad, *_ in rules])
        order = np.lexsort((which, rows))[:SHOWN]
        found = [(int(rows[i]), *rules[which[i]][1:]) for i in order]
        typed = self.typed([(row, name) for row, name, _ in found])
        raise refusal(
            self.where,
            [
                (self.place(row, name), name, cell, rule)
                for (row, name, rule), cell in zip(found, typed, strict=True)
            ],
            len(rows),
        )

    def without_blank_rows(self) -> "Cells":
        """Return the rows that hold anything, without unnamed columns that hold nothing."""
        empty = {name: _empty(self.frame[name]) for name in self.frame}
        blank = np.ones(len(self.frame), dtype=bool)
        for one in empty.values():
            blank &= one
        for i, (name, one) in enumerate(empty.items(), start=1):
            if name == _UNNAMED.format(i) and not one.all():
                raise InputError(
                    f"{self.where}: column {i} has cells but no header; expected a header for each "
                    "column"
                )
        named = [n for i, n in enumerate(self.frame, start=1) if n != _UNNAMED.format(i)]
        frame, messages = self.frame[named], self.messages
        if blank.all():
            raise InputError(f"{self.where}: no rows below the header")
        if not blank.any():
            return Cells(self.where, frame, self.place, self.typed, self.line, messages)
        kept = np.flatnonzero(~blank)
        line = self.line
        return Cells(
            self.where,
            frame.iloc[kept].reset_index(drop=True),
            lambda row, name: self.place(int(kept[row]), name),
            lambda wanted: self.typed([(int(kept[row]), name) for row, name in wanted]),
            None if line is None else lambda row: line(int(kept[row])),
            (*messages, f"{int(blank.sum())} rows with nothing in them: passed over"),
        )


class Source(Protocol):
    """A table file whose header is known."""

    where: str
    headers: tuple[str, ...]

    def read(self, numeric: Collection[str]) -> Cells:
        """Read all rows, the columns of these headers as numbers."""


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
        place = f"{where}, header, column {i} = {text[:60]!r}"
        if text.startswith("="):
            raise InputError(f"{place}: {FORMULA}")
        if re.search(r"[\x00-\x1f\x7f]", text):
            raise InputError(f"{place}: expected no control characters")
        if len(text) > LONGEST_HEADER:
            raise InputError(f"{place}: expected at most {LONGEST_HEADER} characters")
        if text and text in headers:
            raise InputError(f"{place}: expected each header once")
        headers.append(text or _UNNAMED.format(i))
    if all(name == _UNNAMED.format(i) for i, name in enumerate(headers, start=1)):
        raise InputError(f"{where}: no header; expected a header for each column")
    return tuple(headers)


def refusal(where: str, bad: Sequence[tuple[str, str, str, str]], n: int) -> InputError:
    """Return the error that lists cells: place, header, cell and rule of each, and counts all.

    Examples
    --------
    >>> print(refusal("a.csv", [("a.csv, line 2", "p", "x", "expected a number")], 1))
    a.csv, line 2, column 'p' = 'x': expected a number
    """
    lines = [
        f"{place}, column {name!r} = {_clipped(cell)}: {rule}"
        for place, name, cell, rule in bad[:SHOWN]
    ]
    if n == 1:
        return InputError(lines[0])
    if n > len(lines):
        lines.append(f"and {n - len(lines)} more")
    return InputError("\n  ".join([f"{where}: {n} cells break a rule", *lines]))


def lossless(cells: "pd.Series[str]") -> "pd.Series[str] | pd.Series[float]":
    """Return a column of text as numbers, if all of it is and none loses anything by it.

    Examples
    --------
    >>> lossless(pd.Series(["1", ""])).tolist(), lossless(pd.Series(["007"])).tolist()
    ([1.0, nan], ['007'])
    """
    full = cells != ""
    if not full.any() or not re.fullmatch(_PLAIN, str(cells[full].iloc[0])):
        return cells
    if not cells.str.fullmatch(_PLAIN).all():
        return cells
    values = cells.mask(~full, "nan").to_numpy(dtype=object).astype(np.float64)
    if full.all() and cells.str.fullmatch(r"-?\d+").all():
        values = values.astype(np.int64)
    return pd.Series(values, index=cells.index)


def _empty(cells: "pd.Series[str]") -> BoolArray:
    if cells.dtype.kind in "fiubM":
        return cells.isna().to_numpy(dtype=bool)
    return (cells.isna() | (cells == "")).to_numpy(dtype=bool)


def _clipped(cell: str) -> str:
    return repr(cell if len(cell) <= 60 else f"{cell[:57]}...")
