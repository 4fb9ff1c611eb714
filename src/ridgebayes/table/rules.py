"""The rules of a contact table: every cell that breaks one is found before anything is said."""

from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray
from ridgebayes.table.cells import as_numbers, as_text, row_codes
from ridgebayes.table.columns import (
    CALIBRATION,
    COLUMNS,
    COUNT,
    HELD_OUT,
    LARGEST_Q,
    NAMES,
    OK,
    RULES,
    TRANSITION,
    Column,
)
from ridgebayes.table.curve_rules import check_curves, check_labels
from ridgebayes.table.findings import Findings, RawTable

_CONTROL = r"[\x00-\x1f\x7f]"


def checked(raw: RawTable) -> tuple[pd.DataFrame, Findings]:
    """Turn raw cells into the canonical frame and find every cell that breaks a rule.

    Parameters
    ----------
    raw : RawTable
        Cells as they came in; the header was checked before.

    Returns
    -------
    frame : pandas.DataFrame
        Every column of the contract in its order, defaults filled, then the user's own. To be
        used only if there are no findings.
    findings : Findings
        The cells that break a rule.

    Notes
    -----
    *Cost*: array operations only, as long as number columns hold numbers.
    """
    cells = raw.frame.reset_index(drop=True)
    found = Findings(len(cells))
    typed: dict[str, Any] = {}
    empty: dict[str, BoolArray] = {}
    for column in COLUMNS:
        read = _read_number if column.holds == "number" else _read_text
        typed[column.name], empty[column.name] = read(cells, column, found)
    for name in cells.columns:
        if name not in NAMES:
            typed[name] = _own_column(cells[name], name, found)
    _check_cells(typed, empty, found)
    textures = row_codes(typed["a_over_R"], typed["b_over_R"])
    check_labels(typed, textures, found)
    check_curves(typed, textures, found)
    if not found:
        typed["Q"] = typed["Q"].astype(np.int64)
    return pd.DataFrame(typed), found


def _read_number(cells: pd.DataFrame, column: Column, found: Findings) -> tuple[Any, BoolArray]:
    """Return values, defaults filled, and where the cell was empty."""
    default = np.nan if column.default is None else column.default
    if column.name not in cells:
        return np.full(len(cells), default), np.ones(len(cells), dtype=bool)
    values, empty, text = as_numbers(cells[column.name])
    found.add(text, column.name, "must be a number, with a point for decimals")
    found.add(~np.isfinite(values) & ~empty, column.name, column.rule)
    return np.where(empty, default, values), empty


def _read_text(cells: pd.DataFrame, column: Column, found: Findings) -> tuple[Any, BoolArray]:
    """Return text, defaults filled, and where the cell was empty."""
    if column.name not in cells:
        words = pd.Series(column.default, index=range(len(cells)), dtype=str)
        return words, np.ones(len(cells), dtype=bool)
    words = as_text(cells[column.name])
    _check_one_line(words, column.name, found)
    empty = (words == "").to_numpy(dtype=bool)
    return words.mask(empty, column.default) if column.default else words, empty


def _own_column(cells: "pd.Series[Any]", name: str, found: Findings) -> "pd.Series[Any]":
    """Return a column of the user's own: numbers, truth values and dates as they are, else text."""
    if cells.dtype.kind in "biufM":
        return cells
    words = as_text(cells)
    _check_one_line(words, name, found)
    return words


def _check_one_line(words: "pd.Series[Any]", name: str, found: Findings) -> None:
    # A line break or a NUL does not come back from every CSV reader as it went in.
    codes, distinct = pd.factorize(words)
    control = pd.Series(distinct).str.contains(_CONTROL, regex=True).to_numpy(dtype=bool)
    found.add(control[codes], name, "must be text on one line")


def _check_cells(typed: dict[str, Any], empty: dict[str, BoolArray], found: Findings) -> None:
    """Find the cells that are wrong by themselves or beside others of their row."""
    for name in ("a_over_R", "b_over_R", "Q"):
        found.add(empty[name], name, "must not be empty or NaN")
    nu, kind, role, status = typed["nu"], typed["kind"], typed["role"], typed["status"]
    p, lower = typed["p_over_E"], typed["p_over_E_lower"]
    outside = {
        "a_over_R": ~(typed["a_over_R"] > 0),
        "b_over_R": ~(typed["b_over_R"] > 0),
        "p_over_E": ~(p > 0) & ~empty["p_over_E"],
        "p_over_E_lower": lower < 0,
        "rel_se": ~(typed["rel_se"] >= 0),
        "nu": ~((nu >= 0) & (nu <= 0.5)),
        "kind": ~kind.isin([TRANSITION, COUNT]).to_numpy(),
        "role": ~role.isin([CALIBRATION, HELD_OUT]).to_numpy(),
    }
    for name, broken in outside.items():
        found.add(broken, name, RULES[name])

    ok = (status == OK).to_numpy()
    # " OK" is not `ok`: it would quietly leave the row out of every fit.
    nearly = status.str.strip().str.lower().eq(OK).to_numpy() & ~ok
    found.add(nearly, "status", "must be 'ok' exactly, or say what failed")

    Q, count = typed["Q"], (kind == COUNT).to_numpy()
    centred = (typed["offset_over_R"] == 0) & found.sound("offset_over_R")
    whole = found.sound("Q") & (np.abs(Q) <= LARGEST_Q) & (np.round(Q) == Q)
    found.add(~whole, "Q", RULES["Q"])
    odd = np.zeros(found.n_row, dtype=bool)
    odd[whole] = Q[whole] % 2 == 1
    found.add(odd & centred, "Q", "must be even where offset_over_R is 0")
    found.add(whole & count & (Q < 2), "Q", "must be at least 2 for a count")
    found.add(whole & ~count & (Q < 4), "Q", "must be at least 4 for a transition")

    found.add(empty["p_over_E"] & ok, "p_over_E", "must not be empty or NaN where status is 'ok'")
    above = (lower > p) & found.sound("p_over_E")
    found.add(above, "p_over_E_lower", "must not be above p_over_E of its row")
