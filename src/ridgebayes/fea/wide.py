"""Wide tables made long: one column for each Q, or one for each repeat."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from ridgebayes._types import IntArray
from ridgebayes.fea.mapping import LOADS, Use
from ridgebayes.fea.record import FileError
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
