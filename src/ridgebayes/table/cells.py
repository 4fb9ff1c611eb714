"""Raw cells turned into numbers and text, and rows into codes, without judging them."""

import re
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, FloatArray, IntArray

# What a person means by a number; `float` alone would also take "1_000" and non-Latin digits.
_NUMBER = re.compile(
    r"\s*[+-]?((\d+(?:\.\d*)?|\.\d+)(e[+-]?\d+)?|inf|infinity|nan)\s*", re.I | re.A
)


def shortest(value: float) -> str:
    """Return the shortest text that reads back as this number.

    Parameters
    ----------
    value : float
        Any number, dimensionless.

    Returns
    -------
    str
        Its `repr` without a trailing ``.0``.

    Examples
    --------
    >>> shortest(0.1 + 0.2), shortest(1.0)
    ('0.30000000000000004', '1')
    """
    return repr(float(value)).removesuffix(".0")


def texture_label(a_over_R: float, b_over_R: float) -> str:
    """Return the label of a texture that was given none.

    Parameters
    ----------
    a_over_R, b_over_R : float, scalar, dimensionless
        Ridge and groove width over the radius.

    Returns
    -------
    str
        ``a<A>_b<B>`` from the shortest exact decimals, so that two textures never share it.

    Examples
    --------
    >>> texture_label(0.012, 0.09)
    'a0.012_b0.09'
    """
    return f"a{shortest(a_over_R)}_b{shortest(b_over_R)}"


def row_codes(*columns: Any) -> IntArray:
    """Give each row of some columns a number, equal for equal rows, by first appearance.

    Parameters
    ----------
    *columns : array_like, shape (n_row,), any unit
        Numbers or text, one array a column.

    Returns
    -------
    codes : numpy.ndarray of int, shape (n_row,), dimensionless
        Rows with equal cells have equal codes, counted from 0.

    Examples
    --------
    >>> row_codes(["x", "y", "x"], [1.0, 1.0, 1.0]).tolist()
    [0, 1, 0]
    """
    codes = np.zeros(len(columns[0]), dtype=np.int64)
    for column in columns:
        cell, distinct = pd.factorize(pd.Series(column), use_na_sentinel=False)
        if len(distinct) == 1:  # as of most optional columns
            continue
        # Renumbered after every column, so the product stays below n_row^2 and cannot overflow.
        codes = pd.factorize(codes * np.int64(len(distinct)) + cell)[0].astype(np.int64)
    return codes


def as_numbers(cells: "pd.Series[Any]") -> tuple[FloatArray, BoolArray, BoolArray]:
    """Turn the raw cells of a column into numbers.

    Parameters
    ----------
    cells : pandas.Series, shape (n_row,)
        Numbers, text, or a mixture; None, NaN and empty text count as empty cells.

    Returns
    -------
    values : numpy.ndarray of float, shape (n_row,), in the unit of the column
        NaN where there is no number.
    empty : numpy.ndarray of bool, shape (n_row,)
        Where the cell is empty.
    text : numpy.ndarray of bool, shape (n_row,)
        Where the cell holds something that is not a number (a typed ``nan`` is one: it is
        neither empty nor text).

    Examples
    --------
    >>> values, empty, text = as_numbers(pd.Series(["0.5", "", "1,5"], dtype=object))
    >>> values.tolist(), empty.tolist(), text.tolist()
    ([0.5, nan, nan], [False, True, False], [False, False, True])
    """
    empty = np.array(cells.isna(), dtype=bool)
    if cells.dtype.kind in "iuf":
        values = cells.to_numpy(dtype=np.float64, na_value=np.nan)
        return values, empty, np.zeros(len(cells), dtype=bool)
    # One Python call a cell: only columns that are not plain numbers come here.
    values = np.full(len(cells), np.nan)
    text = np.zeros(len(cells), dtype=bool)
    for i, cell in enumerate(cells.astype(object)):
        if empty[i] or (isinstance(cell, str) and not cell.strip()):
            empty[i] = True
        elif isinstance(cell, (bool, np.bool_)) or (
            isinstance(cell, str) and not _NUMBER.fullmatch(cell)
        ):
            text[i] = True
        else:
            try:
                values[i] = float(cell)
            except (TypeError, ValueError, OverflowError):
                text[i] = True
    return values, empty, text


def as_text(cells: "pd.Series[Any]") -> "pd.Series[Any]":
    """Turn the raw cells of a column into text.

    Parameters
    ----------
    cells : pandas.Series, shape (n_row,)
        Anything; numbers become their shortest decimals, so that series 1 and 1.0 are the same.

    Returns
    -------
    pandas.Series of str, shape (n_row,)
        Empty text where a cell is empty.

    Examples
    --------
    >>> as_text(pd.Series([1.0, None, "fine"], dtype=object)).tolist()
    ['1', '', 'fine']
    """
    if isinstance(cells.dtype, pd.StringDtype):
        return cells.fillna("").astype(str)
    empty = cells.isna().to_numpy(dtype=bool)
    words = [
        "" if gone else shortest(cell) if isinstance(cell, float) else str(cell)
        for cell, gone in zip(cells.astype(object), empty, strict=True)
    ]
    return pd.Series(words, index=cells.index, dtype=object).astype(str)
