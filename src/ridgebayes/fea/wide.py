"""Wide tables made long: one column for each Q, or one for each repeat."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from ridgebayes._types import IntArray
from ridgebayes.fea.column_units import split_header, unit_factor
from ridgebayes.fea.mapping import LOADS, Use
from ridgebayes.fea.problems import FileError
from ridgebayes.fea.words import texture_of
from ridgebayes.runtime.text import count

Melted = tuple[pd.DataFrame, list[Use]]


def melt_counts(cells: pd.DataFrame, uses: Sequence[Use], problems: FileError) -> Melted:
    """Return a row for each Q that was reached, of a table with a column for each Q.

    Raises
    ------
    InputError
        If there is a load beside them, no load, or the units of one quantity differ.
    """
    per_Q = [use for use in uses if use.Q is not None]
    loads = {use.Q: use for use in per_Q if use.key in LOADS}
    single = [use for use in uses if use.Q is None and use.key in (*LOADS, "Q")]
    if single or not loads:
        what = f"column {single[0].header!r}" if single else "no load"
        names = ", ".join(repr(use.header) for use in per_Q[:8])
        raise problems.error(
            f"{what} beside columns for each Q ({names}); expected a load for each Q, or "
            "columns Q and load"
        )
    if extra := [use for use in per_Q if use.Q not in loads]:
        raise problems.error(
            f"column {extra[0].header!r}: no load of Q = {extra[0].Q}; expected one"
        )
    if len({use.key for use in loads.values()}) > 1:
        raise problems.error("loads of several kinds; expected one unit for all Q")
    counts = np.sort([Q or 0 for Q in loads])
    row, which = np.nonzero(cells[[loads[Q].header for Q in counts]].notna())
    if not row.size and not problems:
        raise problems.error("no load in any column; expected a load in some cell")
    new = {"Q": counts[which].astype(float)}
    more = [Use("Q", "Q", "1", how="wide")]
    for key in dict.fromkeys(use.key for use in per_Q):
        some = {use.Q: use for use in per_Q if use.key == key}
        empty = np.full(len(cells), np.nan)
        wide = [cells[some[Q].header] if Q in some else empty for Q in counts]
        new[key] = np.column_stack(wide)[row, which]
        more.append(_one(key, list(some.values()), problems))
    n_empty = len(cells) * len(counts) - row.size
    told = f"one column for each Q: {len(counts)} loads from Q = {counts[0]} to {counts[-1]}"
    problems.messages += [told, *([f"{n_empty} empty cells: not reached"] if n_empty else ())]
    return _melted(cells, row, new, per_Q), [*(use for use in uses if use.Q is None), *more]


def melt_repeats(cells: pd.DataFrame, uses: Sequence[Use], problems: FileError) -> Melted:
    """Return a row for each load, of a table with a column of loads for each repeat.

    Raises
    ------
    InputError
        If all cells are empty, or the units of the columns differ.
    """
    each = [use for use in uses if use.repeat is not None]
    numbers = np.column_stack([cells[use.header] for use in each])
    row, which = np.nonzero(~np.isnan(numbers))
    names = ", ".join(repr(use.header) for use in each[:8])
    if not row.size and not problems:
        raise problems.error(
            f"columns {names}: expected a number in some cell, got "
            f"{count(len(cells), 'row')} of empty ones"
        )
    labels = np.array([use.repeat for use in each], dtype=object)
    new = {"value": numbers[row, which], "repeat": labels[which]}
    n_empty = numbers.size - row.size
    problems.messages.append(
        f"one column of loads for each repeat: {names}"
        + (f"; {n_empty} empty cells: not measured" if n_empty else "")
    )
    more = [
        replace(_one(each[0].key, each, problems), header="value"),
        Use("series", "repeat", how="wide"),
    ]
    return _melted(cells, row, new, each), [*(use for use in uses if use not in each), *more]


def named_textures(cells: pd.DataFrame, uses: Sequence[Use], problems: FileError) -> Melted | None:
    """Return both widths as columns where names of textures such as ``240x80 um`` have them."""
    named = [use for use in uses if use.key == "texture"]
    if not named or any(use.key in ("a", "b", "a_over_R", "b_over_R") for use in uses):
        return None
    names = cells[named[0].header].astype(str)
    pairs = {name: texture_of(name) for name in names.unique()}
    found = {name: pair for name, pair in pairs.items() if pair is not None}
    units = {pair[2] for pair in found.values()} or {"?"}
    header, given = named[0].header, named[0].unit
    unit = split_header(header)[1] or min(units) if given is None else given.strip("1")
    if len(found) < len(pairs) or len(units) > 1 or unit_factor(unit or "mm", "length") is None:
        return None
    if given is None and not unit and any(split_header(use.header)[1] for use in uses):
        problems.need(
            f"widths in column {header!r} have no unit: expected --map 'texture={header};mm', or 1 "
            "for widths over the radius",
            {"texture": f"{header};?"},
        )
    columns = _widths(unit)
    wide = np.array([[float(part) for part in found[name][:2]] for name in names])
    new = dict(zip([use.key for use in columns], wide.T, strict=True))
    shown = ", ".join(new)
    problems.messages.append(f"{shown}: the numbers in {header!r}, {unit or 'over the radius'}")
    return cells.assign(**new), [*columns, *uses]


def _widths(unit: str) -> list[Use]:
    """Return the uses of columns of both widths in a unit; over the radius without one."""
    keys = ("a", "b") if unit else ("a_over_R", "b_over_R")
    return [Use(key, key, unit or "1", how="wide") for key in keys]


def _one(key: str, some: Sequence[Use], problems: FileError) -> Use:
    """Return the use of columns that became one, named by their key."""
    units = {use.own_unit for use in some}
    if len(units) > 1:
        raise problems.error(f"{key} in {', '.join(sorted(units))}; expected one unit")
    return Use(key, key, units.pop() or "1", how="wide")


def _melted(
    cells: pd.DataFrame, row: IntArray, new: dict[str, np.ndarray], gone: Sequence[Use]
) -> pd.DataFrame:
    names = {*new, *(use.header for use in gone)}
    return cells.drop(columns=[name for name in cells if name in names]).iloc[row].assign(**new)
