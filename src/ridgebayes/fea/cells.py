"""Cells of a table file, whatever its format: headers, values, and where each cell stands."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.column_units import split_header
from ridgebayes.fea.problems import Problems

NUMBER = re.compile(r"\s*[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?\s*", re.A)
FINITE = "expected a finite number, with a point for decimals, or an empty cell"
FORMULA = "expected values, not formulas"
MOST_COLUMNS = 2000
LONGEST_HEADER = 500
_UNNAMED = "(column {})"


def filled(frame: pd.DataFrame, where: str, problems: Problems) -> pd.DataFrame:
    """Return the rows of a file that hold anything, without unnamed columns that hold nothing.

    Parameters
    ----------
    frame : DataFrame, n_row rows
        All cells by header: numbers, NaN where a cell is empty, or text.
    where : str
        Name that messages show.
    problems : Problems
        Where it is said how many rows are empty.

    Returns
    -------
    DataFrame
        Its index tells which rows of the file they are, from 0.

    Raises
    ------
    InputError
        If no row does.
    """
    empty = frame.isna() | (frame == "")
    unnamed = {_UNNAMED.format(i) for i in range(1, len(empty.columns) + 1)}
    used = [name for name in frame if name not in unnamed or not empty[name].all()]
    blank = empty.all(axis=1)
    if blank.all():
        raise InputError(f"{where}: no rows below the header")
    if n := int(blank.sum()):
        problems.messages.append(f"{n} empty rows ignored")
    return frame.loc[~blank, used]


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
