"""Rules of a contact table; all violations are collected before they are reported."""

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.table import columns as contract
from ridgebayes.table.columns import Column, Findings, RawTable, check_header

_CONTROL = r"[\x00-\x1f\x7f]"


Check = Callable[[RawTable], tuple[pd.DataFrame, Findings]]


def validated(
    raw: RawTable, check: Check, columns: Sequence[Column] = contract.COLUMNS
) -> pd.DataFrame:
    """Validate the cells of a table and return its canonical frame.

    Parameters
    ----------
    raw : RawTable
        Unchecked cells.
    check : callable
        Returns the frame and the cells that violate a rule, such as `checked`.
    columns : sequence of Column, optional
        Column definitions; those of a contact table if not given.

    Raises
    ------
    InputError
        If a column is missing, there are no rows, or a cell violates a rule.
    """
    check_header(list(raw.frame.columns), raw.where, columns)
    if not len(raw.frame):
        raise InputError(f"{raw.where}: no rows below the header")
    frame, findings = check(raw)
    if findings:
        raise InputError(findings.message(raw))
    return frame


def checked(raw: RawTable) -> tuple[pd.DataFrame, Findings]:
    """Convert cells to the canonical frame and find all cells that violate a rule.

    Parameters
    ----------
    raw : RawTable
        Unchecked cells below a checked header.

    Returns
    -------
    frame : pandas.DataFrame
        Columns of the contract in their order with defaults filled in, then additional columns.
        Valid only if there are no findings.
    findings : Findings
        Cells that violate a rule.

    Notes
    -----
    *Cost*: array operations only, if number columns hold numbers.
    """
    typed, empty, findings = read_cells(raw.frame, contract.COLUMNS)
    _check_cells(typed, empty, findings)
    textures = row_codes(typed["a_over_R"], typed["b_over_R"])
    check_labels(typed, textures, findings)
    check_curves(typed, textures, findings)
    if not findings:
        typed["Q"] = typed["Q"].astype(np.int64)
    return pd.DataFrame(typed), findings


def read_number(cells: pd.DataFrame, column: Column, findings: Findings) -> tuple[Any, BoolArray]:
    """Return the numbers of a column, with defaults filled in, and a mask of empty cells."""
    default = np.nan if column.default is None else column.default
    if column.name not in cells:
        return np.full(len(cells), default), np.ones(len(cells), dtype=bool)
    values, empty, text = as_numbers(cells[column.name])
    findings.add(text, column.name, "must be a number, with a point for decimals")
    findings.add(~np.isfinite(values) & ~empty, column.name, column.rule)
    return np.where(empty, default, values), empty


def read_text(cells: pd.DataFrame, column: Column, findings: Findings) -> tuple[Any, BoolArray]:
    """Return the text of a column, with defaults filled in, and a mask of empty cells."""
    if column.name not in cells:
        words = pd.Series(column.default, index=range(len(cells)), dtype=str)
        return words, np.ones(len(cells), dtype=bool)
    words = as_text(cells[column.name])
    _check_one_line(words, column.name, findings)
    empty = (words == "").to_numpy(dtype=bool)
    return words.mask(empty, column.default) if column.default else words, empty


def own_column(cells: "pd.Series[Any]", name: str, findings: Findings) -> "pd.Series[Any]":
    """Return an additional column: numbers, truth values and dates unchanged, else as text."""
    if cells.dtype.kind in "biufM":
        return cells
    words = as_text(cells)
    _check_one_line(words, name, findings)
    return words


def _check_one_line(words: "pd.Series[Any]", name: str, findings: Findings) -> None:
    # Some CSV readers change line breaks and NUL characters.
    codes, distinct = pd.factorize(words)
    control = pd.Series(distinct).str.contains(_CONTROL, regex=True).to_numpy(dtype=bool)
    findings.add(control[codes], name, "must be text on one line")


def read_cells(
    frame: pd.DataFrame, columns: Sequence[Column]
) -> tuple[dict[str, Any], dict[str, BoolArray], Findings]:
    """Return all columns by name, masks of empty cells, and the cells that cannot be converted."""
    cells = frame.reset_index(drop=True)
    findings = Findings(len(cells))
    typed: dict[str, Any] = {}
    empty: dict[str, BoolArray] = {}
    for column in columns:
        read = read_number if column.holds == "number" else read_text
        typed[column.name], empty[column.name] = read(cells, column, findings)
    for name in cells.columns:
        if name not in empty:
            typed[name] = own_column(cells[name], name, findings)
    return typed, empty, findings


def _check_cells(typed: dict[str, Any], empty: dict[str, BoolArray], findings: Findings) -> None:
    """Find cells that are invalid by themselves or given other cells of their row."""
    for name in ("a_over_R", "b_over_R", "Q"):
        findings.add(empty[name], name, "must not be empty or NaN")
    nu, kind, role, status = typed["nu"], typed["kind"], typed["role"], typed["status"]
    p, lower = typed["p_over_E"], typed["p_over_E_lower"]
    outside = {
        "a_over_R": ~(typed["a_over_R"] > 0),
        "b_over_R": ~(typed["b_over_R"] > 0),
        "p_over_E": ~(p > 0) & ~empty["p_over_E"],
        "p_over_E_lower": lower < 0,
        "rel_se": ~(typed["rel_se"] >= 0),
        "nu": ~((nu >= 0) & (nu <= 0.5)),
        "kind": ~kind.isin([contract.TRANSITION, contract.COUNT]).to_numpy(),
        "role": ~role.isin([contract.CALIBRATION, contract.HELD_OUT]).to_numpy(),
    }
    for name, broken in outside.items():
        findings.add(broken, name, contract.RULES[name])

    ok = (status == contract.OK).to_numpy()
    # A status " OK" would silently exclude the row from every fit.
    nearly = status.str.strip().str.lower().eq(contract.OK).to_numpy() & ~ok
    findings.add(nearly, "status", "expected exactly 'ok', or a description of the failure")

    Q, count = typed["Q"], (kind == contract.COUNT).to_numpy()
    centred = (typed["offset_over_R"] == 0) & findings.sound("offset_over_R")
    whole = findings.sound("Q") & (np.abs(Q) <= contract.LARGEST_Q) & (np.round(Q) == Q)
    findings.add(~whole, "Q", contract.RULES["Q"])
    odd = np.zeros(findings.n_row, dtype=bool)
    odd[whole] = Q[whole] % 2 == 1
    findings.add(odd & centred, "Q", "must be even where offset_over_R is 0")
    findings.add(whole & count & (Q < 2), "Q", "must be at least 2 for a count")
    findings.add(whole & ~count & (Q < 4), "Q", "must be at least 4 for a transition")

    findings.add(
        empty["p_over_E"] & ok, "p_over_E", "must not be empty or NaN where status is 'ok'"
    )
    above = (lower > p) & findings.sound("p_over_E")
    findings.add(above, "p_over_E_lower", "must not be above p_over_E of its row")


def check_labels(typed: dict[str, Any], texture: IntArray, findings: Findings) -> None:
    """Fill in empty labels, and find labels shared by two textures.

    `texture` holds a code of (a_over_R, b_over_R) for each row.
    """
    a, b, label = typed["a_over_R"], typed["b_over_R"], typed["texture"]
    first = np.unique(texture, return_index=True)[1]
    # The loop runs over distinct textures instead of rows.
    names = pd.Series([texture_label(a[i], b[i]) for i in first], dtype=object).astype(str)
    filled = label.mask((label == "").to_numpy(), names.take(texture).reset_index(drop=True))
    typed["texture"] = filled
    sound = np.flatnonzero(findings.sound("a_over_R", "b_over_R", "texture"))
    code = pd.factorize(filled)[0]
    _, owner, which = np.unique(code[sound], return_index=True, return_inverse=True)
    other = sound[owner][which]
    clash = texture[sound] != texture[other]
    rule = "one label names one texture, and row {other} gives it to another (a_over_R, b_over_R)"
    findings.add(sound[clash], "texture", rule, other[clash])


def check_curves(typed: dict[str, Any], texture: IntArray, findings: Findings) -> None:
    """Find repeated counts in a curve, and loads that do not rise with Q."""
    use = (typed["kind"] == contract.TRANSITION) & (typed["status"] == contract.OK)
    sound = findings.sound(*contract.REQUIRED, *contract.CURVE, "kind", "status")
    rows = np.flatnonzero(use.to_numpy() & sound)
    if not len(rows):
        return
    Q, p = typed["Q"][rows], typed["p_over_E"][rows]
    others = [name for name in contract.CURVE if name not in ("a_over_R", "b_over_R")]
    curve = row_codes(texture[rows], *(pd.Series(typed[name]).iloc[rows] for name in others))
    order = np.lexsort((rows, Q, curve))
    now, before = order[1:], order[:-1]
    same_curve = curve[now] == curve[before]
    same_Q = same_curve & (Q[now] == Q[before])
    beside = ("p_over_E", "p_over_E_lower", "rel_se", "texture", "role")
    identical = same_Q
    if same_Q.any():
        content = row_codes(*(pd.Series(typed[name]).iloc[rows] for name in beside))
        identical = same_Q & (content[now] == content[before])

    def tell(pairs: BoolArray, column: str, rule: str) -> None:
        findings.add(rows[now[pairs]], column, rule, rows[before[pairs]])

    tell(identical, "Q", "identical row of one curve twice: row {other} is the same")
    tell(same_Q, "Q", "each Q must stand once in a curve, and row {other} has it too")
    rises, reached = same_curve & ~same_Q, "must rise with Q along a curve: row {other} has"
    tell(rises & (p[now] < p[before]), "p_over_E", f"{reached} a lower Q")
    # A load step that passes two corners locates only the first of them.
    two_counts = f"{reached} a lower Q and this load; of one load step, keep the lowest Q"
    tell(rises & (p[now] == p[before]), "p_over_E", two_counts)


# Numbers as people write them; `float` would also accept "1_000" and non-Latin digits.
_NUMBER = re.compile(
    r"\s*[+-]?((\d+(?:\.\d*)?|\.\d+)(e[+-]?\d+)?|inf|infinity|nan)\s*", re.I | re.A
)

# Most numbers: whole columns are matched at once.
_PLAIN_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"


def shortest(value: float) -> str:
    """Return the shortest text that reads back as the same number.

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
    """Return the default label of a texture.

    Parameters
    ----------
    a_over_R, b_over_R : float, scalar, dimensionless
        Ridge and groove width over the radius.

    Returns
    -------
    str
        ``a<A>_b<B>`` with the shortest exact decimals, which is unique for each texture.

    Examples
    --------
    >>> texture_label(0.012, 0.09)
    'a0.012_b0.09'
    """
    return f"a{shortest(a_over_R)}_b{shortest(b_over_R)}"


def row_codes(*columns: Any) -> IntArray:
    """Return the number of each distinct row of some columns in order of first appearance.

    Parameters
    ----------
    *columns : array_like, shape (n_row,), any unit
        Numbers or text, one array for each column.

    Returns
    -------
    codes : numpy.ndarray of int, shape (n_row,), dimensionless
        Rows with equal cells have equal codes, counted from 0.

    Examples
    --------
    >>> row_codes(["x", "y", "x"], [1.0, 1.0, 1.0]).tolist()
    [0, 1, 0]
    """
    frame = pd.DataFrame(
        {i: pd.Series(column).reset_index(drop=True) for i, column in enumerate(columns)}
    )
    same = {i: frame[i].eq(frame[i].iloc[0]) for i in frame if len(frame)}
    varying = [i for i in same if not same[i].to_numpy(dtype=bool, na_value=False).all()]
    groups = frame.groupby(varying or [0], sort=False, dropna=False)
    return np.asarray(groups.ngroup(), dtype=np.int64)


def as_numbers(cells: "pd.Series[Any]") -> tuple[FloatArray, BoolArray, BoolArray]:
    """Convert the cells of a column to numbers.

    Parameters
    ----------
    cells : pandas.Series, shape (n_row,)
        Numbers, text, or a mixture; None, NaN and empty text count as empty cells.

    Returns
    -------
    values : numpy.ndarray of float, shape (n_row,), in the unit of the column
        Values; NaN for cells without a number.
    empty : numpy.ndarray of bool, shape (n_row,)
        Mask of empty cells.
    text : numpy.ndarray of bool, shape (n_row,)
        Mask of cells that hold something other than a number; a typed ``nan`` is neither empty nor
        text.

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
    if isinstance(cells.dtype, pd.StringDtype):  # each distinct text is converted once
        codes, distinct = pd.factorize(cells, use_na_sentinel=False)
        if distinct.str.fullmatch(_PLAIN_NUMBER).all():
            no_cell = np.zeros(len(cells), dtype=bool)
            return distinct.to_numpy(dtype=object).astype(float)[codes], no_cell, no_cell.copy()
        once = as_numbers(pd.Series(distinct, dtype=object))
        return once[0][codes], once[1][codes], once[2][codes]
    # One Python call for each cell: columns of plain numbers have returned above.
    values = np.full(len(cells), np.nan)
    text = np.zeros(len(cells), dtype=bool)
    for i, cell in enumerate(cells.astype(object)):
        words = isinstance(cell, str)
        empty[i] |= words and not cell.strip()
        if empty[i]:
            continue
        text[i] = isinstance(cell, (bool, np.bool_)) or (words and not _NUMBER.fullmatch(cell))
        try:
            values[i] = np.nan if text[i] else float(cell)
        except (TypeError, ValueError, OverflowError):
            text[i] = True
    return values, empty, text


def as_text(cells: "pd.Series[Any]") -> "pd.Series[Any]":
    """Convert the cells of a column to text.

    Parameters
    ----------
    cells : pandas.Series, shape (n_row,)
        Any values; numbers become their shortest decimals, so that series 1 and 1.0 are equal.

    Returns
    -------
    pandas.Series of str, shape (n_row,)
        Text of the cells; empty for empty cells.

    Examples
    --------
    >>> as_text(pd.Series([1.0, None, "fine"], dtype=object)).tolist()
    ['1', '', 'fine']
    """
    if isinstance(cells.dtype, pd.StringDtype):
        return cells.fillna("").astype(str)
    if cells.dtype.kind in "iuf" and not cells.is_unique:  # converts each number once
        codes, distinct = pd.factorize(cells, use_na_sentinel=False)
        return as_text(pd.Series(distinct)).take(codes).set_axis(cells.index)
    empty = cells.isna().to_numpy(dtype=bool)
    words = [
        "" if gone else shortest(cell) if isinstance(cell, float) else str(cell)
        for cell, gone in zip(cells.astype(object), empty, strict=True)
    ]
    return pd.Series(words, index=cells.index, dtype=object).astype(str)
