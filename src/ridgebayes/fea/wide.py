"""Conversion of wide tables, with one column of loads per Q or per repeat, to long tables."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ridgebayes.fea.mapping import LOADS, Use
from ridgebayes.fea.record import FileError
from ridgebayes.runtime.text import count


def melted(
    cells: pd.DataFrame, uses: Sequence[Use], problems: FileError
) -> tuple[pd.DataFrame, list[Use]]:
    """Convert a table with a column per Q or per repeat to a table with a row per load.

    Raises
    ------
    InputError
        If the table also has a column of all loads or counts, has no load, or has columns of one
        quantity in different units.
    """
    wide = [use for use in uses if use.label is not None]
    is_Q = wide[0].Q is not None
    if is_Q and (rule := _broken(uses, wide)):
        raise problems.error(rule)
    loads = {use.label: use for use in wide if use.key in LOADS}
    labels = sorted(loads, key=lambda label: label if isinstance(label, int) else 0)
    row, which = np.nonzero(cells[[loads[label].header for label in labels]].notna())
    names = ", ".join(repr(use.header) for use in wide[:8])
    if not row.size and not problems:
        rows = f"{count(len(cells), 'row')} with empty cells only"
        raise problems.error(f"columns {names}: expected a number in some cell, got {rows}")
    key = "Q" if is_Q else "series"
    new = {key: np.array(labels, dtype=float if is_Q else object)[which]}
    long = [Use(key, key, "1" if is_Q else None, how="wide")]
    for key in dict.fromkeys(use.key for use in wide):
        by_label = {use.label: use for use in wide if use.key == key}
        units = {use.own_unit for use in by_label.values()}
        if len(units) > 1:
            raise problems.error(f"{key} in {', '.join(sorted(units))}; expected one unit")
        empty = np.full(len(cells), np.nan)
        columns = [cells[by_label[i].header] if i in by_label else empty for i in labels]
        new[key] = np.column_stack(columns)[row, which]
        long.append(Use(key, key, units.pop() or "1", how="wide"))
    n_empty = len(cells) * len(labels) - row.size
    kind = f"Q: {len(labels)} loads from Q = {labels[0]} to {labels[-1]}"
    problems.messages.append(f"one column for each {kind if is_Q else f'repeat: {names}'}")
    if n_empty:
        what = "reached" if is_Q else "measured"
        problems.messages.append(f"{n_empty} empty cells: not {what}")
    gone = {*new, *(use.header for use in wide)}
    kept = cells.drop(columns=[name for name in cells if name in gone])
    return kept.iloc[row].assign(**new), [*(use for use in uses if use.label is None), *long]


def _broken(uses: Sequence[Use], wide: Sequence[Use]) -> str:
    """Return an error message if the columns per Q break a rule; empty otherwise."""
    loads = [use for use in wide if use.key in LOADS]
    single = [use for use in uses if use.Q is None and use.key in (*LOADS, "Q")]
    counts = {use.Q for use in loads}
    if single or not loads:
        what = f"column {single[0].header!r}" if single else "no load"
        names = ", ".join(repr(use.header) for use in wide[:8])
        return (
            f"{what} beside columns for each Q ({names}); expected a load for each Q, or "
            "columns Q and load"
        )
    if extra := [use for use in wide if use.Q not in counts]:
        return f"column {extra[0].header!r}: no load of Q = {extra[0].Q}; expected one"
    several = len({use.key for use in loads}) > 1
    return "loads of several kinds; expected one unit for all Q" if several else ""
