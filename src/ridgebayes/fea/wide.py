"""Conversion of wide tables, with one column of loads per Q or per repeat, to long tables."""

from collections.abc import Sequence
from typing import Any

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
    rest = [use for use in uses if use.label is None]
    loads: dict[Any, str] = {use.label: use.header for use in wide if use.key in LOADS}
    is_Q = wide[0].Q is not None
    names = ", ".join(repr(use.header) for use in wide[:8])
    if is_Q and (rule := _broken(rest, wide)):
        raise problems.error(f"columns {names}: {rule}")
    key = "Q" if is_Q else "series"
    new = [Use(key, key, "1" if is_Q else None, how="wide")]
    for name in dict.fromkeys(use.key for use in wide):
        units = {use.own_unit for use in wide if use.key == name}
        if len(units) > 1:
            raise problems.error(f"{name} in {', '.join(sorted(units))}; expected one unit")
        new.append(Use(name, name, units.pop() or "1", how="wide"))
    kept = cells.drop(columns={use.header for use in (*wide, *new)} & set(cells))
    labels = sorted(loads) if is_Q else list(loads)
    parts = [
        kept.assign(
            **{key: float(label) if is_Q else label},
            **{use.key: cells[use.header] for use in wide if use.label == label},
        )[cells[loads[label]].notna()]
        for label in labels
    ]
    table = pd.concat(parts).sort_index(kind="stable")
    if table.empty and not problems:
        rows = f"{count(len(cells), 'row')} with empty cells only"
        raise problems.error(f"columns {names}: expected a number in some cell, got {rows}")
    kind = f"Q: {len(labels)} loads from Q = {labels[0]} to {labels[-1]}"
    problems.messages.append(f"one column for each {kind if is_Q else f'repeat: {names}'}")
    if n_empty := len(cells) * len(labels) - len(table):
        what = "reached" if is_Q else "measured"
        problems.messages.append(f"{n_empty} empty cells: not {what}")
    return table, [*rest, *new]


def _broken(rest: Sequence[Use], wide: Sequence[Use]) -> str:
    """Return an error message if the columns per Q break a rule; empty otherwise."""
    loads = [use for use in wide if use.key in LOADS]
    counts = {use.Q for use in loads}
    single = [use.header for use in rest if use.key in (*LOADS, "Q")]
    alone = [use for use in wide if use.Q not in counts]
    if single or not loads:
        fault = f"also column {single[0]!r}" if single else "no load"
        return f"{fault}; expected a load for each Q, or columns Q and load"
    if alone:
        return f"no load of Q = {alone[0].Q} beside {alone[0].header!r}; expected one"
    several = len({use.key for use in loads}) > 1
    return "loads of several kinds; expected one unit for all Q" if several else ""
