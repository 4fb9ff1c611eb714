"""Tables of other layouts than a row for each load: merged cells, wide tables, increments."""

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.convert import Converter, listed
from ridgebayes.fea.mapping import LOADS, NEVER_EMPTY, Use
from ridgebayes.fea.record import FileError
from ridgebayes.fea.transitions import middle_loads, transitions_of_runs
from ridgebayes.fea.words import MOST_DISTINCT
from ridgebayes.runtime.text import count
from ridgebayes.table.columns import OK
from ridgebayes.table.rules import as_text, row_codes

# Columns that may have a value only in the first row of a group, as in merged cells.
_GROUP_KEYS = (*NEVER_EMPTY, "a_over_R", "b_over_R", "nu", "offset", "offset_over_R", "thickness")


def filled_down(cells: pd.DataFrame, uses: Iterable[Use], problems: FileError) -> pd.DataFrame:
    """Return a table with empty cells filled from above where a value is typed once for a group.

    Cells are filled if the first row of each group has all group values (widths), and consecutive
    groups differ. Otherwise the empty cells are missing values.
    """
    there = [use.header for use in uses if use.Q is None and use.header in cells]
    groups = [use.header for use in uses if use.key in _GROUP_KEYS and use.header in there]
    widths = [name for name in groups if cells[name].dtype.kind == "f" and cells[name].isna().any()]
    if not widths:
        return cells
    head = cells[widths].notna()
    first, values = head.all(axis=1), cells[widths]
    follows = first & first.shift(fill_value=False)
    again = follows & (values == values.shift()).all(axis=1)
    if (head.any(axis=1) != first).any() or not first.iloc[0] or again.any():
        return cells
    cells = cells.assign(**values.ffill())
    texts = [use.header for use in uses if use.key in ("series", "texture") and use.header in there]
    full = [name for name in texts if (cells[name].ne("") <= first).all()]
    for name in full:
        cells[name] = cells[name].mask(cells[name].eq("") & ~first).ffill()
    problems.messages.append(
        f"columns {', '.join(map(repr, [*widths, *full]))}: {count(int((~first).sum()), 'row')} "
        "with empty cells have the value above, as in merged cells"
    )
    return cells


def one_series(
    cells: pd.DataFrame, uses: list[Use], problems: FileError
) -> tuple[pd.DataFrame, list[Use]]:
    """Return the table with all recognised series columns joined; drop columns of row numbers."""
    series = [use for use in uses if use.key == "series" and use.how in ("guessed", "wide")]
    kept = [use for use in series if len(cells) == 1 or cells[use.header].duplicated().any()]
    for use in series:
        if use not in kept:
            problems.known.pop("series", None)
            how = f"it numbers the rows (--map 'series={use.header}' takes it)"
            problems.messages.append(f"column {use.header!r} is not taken as series: {how}")
    rest = [use for use in uses if use not in series]
    if len(kept) < 2:
        return cells, [*rest, *kept]
    name = ", ".join(use.header for use in kept)
    joined = pd.DataFrame({use.header: as_text(cells[use.header]) for use in kept})
    problems.messages.append(f"series: {name}, joined")
    joined_use = Use("series", name, how="guessed")
    return cells.assign(**{name: joined.agg(", ".join, axis=1)}), [*rest, joined_use]


def melted(
    cells: pd.DataFrame, uses: Sequence[Use], problems: FileError
) -> tuple[pd.DataFrame, list[Use]]:
    """Convert a table with a column per Q or per repeat to a table with a row per load.

    Raises
    ------
    InputError
        If the table also has a column of all loads or counts, has no load, or has loads in
        different units.
    """
    wide = sorted((use for use in uses if use.label is not None), key=lambda use: use.Q or 0)
    rest = [use for use in uses if use.label is None]
    load, is_Q = wide[0], wide[0].Q is not None
    names = ", ".join(repr(use.header) for use in wide[:8])
    single = [use.header for use in rest if is_Q and use.key in (*LOADS, "Q")]
    units = {f"{use.key} [{use.own_unit}]" for use in wide}
    if single or len(units) > 1:
        fault = f"also column {single[0]!r}" if single else ", ".join(sorted(units))
        rule = "expected a load for each Q in one unit, or columns Q and load"
        raise problems.error(f"columns {names}: {fault}; {rule}")
    key = "Q" if is_Q else "series"
    labels = {use.header: float(use.Q) if use.Q is not None else use.repeat for use in wide}
    kept = [name for name in map(str, cells) if name not in (*labels, key, load.key)]
    table = cells.melt(kept, list(labels), key, load.key, ignore_index=False)
    table = table.dropna(subset=load.key).sort_index(kind="stable")
    table[key] = table[key].map(labels)
    if table.empty and not problems:
        rows = f"{count(len(cells), 'row')} with empty cells only"
        raise problems.error(f"columns {names}: expected a number in some cell, got {rows}")
    kind = f"Q: {len(wide)} loads from Q = {load.Q} to {wide[-1].Q}"
    problems.messages.append(f"one column for each {kind if is_Q else f'repeat: {names}'}")
    if n_empty := len(cells) * len(wide) - len(table):
        what = "reached" if is_Q else "measured"
        problems.messages.append(f"{n_empty} empty cells: not {what}")
    new = [Use(key, key, "1" if is_Q else None, how="wide")]
    return table, [*rest, *new, Use(load.key, load.key, load.own_unit or "1", how="wide")]


def counts_repeat(frame: pd.DataFrame) -> bool:
    """Return whether rows are increments: counts of 4 or more repeat while the load rises.

    At least a third of the rows repeat the count of the previous row, and the load rises in 80 % of
    the repeats with another load up to the highest load of each curve. Held loads stand repeatedly.
    """
    Q, load = frame["Q"].to_numpy(), frame["p_over_E"].to_numpy()
    same = Q[1:] == Q[:-1]
    # Each count becomes a column in memory.
    if 3 * same.sum() < len(same) or not 4 <= np.nanmax(Q, initial=0) <= MOST_DISTINCT:
        return False
    curve = row_codes(*(frame[name] for name in frame if name not in ("Q", "p_over_E")))
    # A curve without loads has its highest load in the first row, and thus no increments.
    top = pd.Series(load).fillna(-np.inf).groupby(curve).transform("idxmax").to_numpy()
    same &= (curve[1:] == curve[:-1]) & (np.arange(1, len(Q)) <= top[1:]) & (load[1:] != load[:-1])
    rising = same & (load[1:] > load[:-1])
    return bool(0 < 0.8 * same.sum() <= rising.sum())


def of_corners(converter: Converter, corners: Sequence[Use]) -> pd.DataFrame:
    """Return the transitions of a table whose rows are increments with a status of each corner.

    Parameters
    ----------
    converter : Converter
        Converter of the table.
    corners : sequence of Use
        Columns of status, one per corner.
    """
    corners = sorted(corners, key=lambda use: use.Q or 0)
    curve, load = converter.curve() | converter.texts("role", "status"), converter.load()
    gaps = np.column_stack([converter.status(use) for use in corners])
    converter.summarize()
    if load is None or converter.problems:
        return pd.DataFrame()
    if (status := curve.pop("status", None)) is not None:
        gaps[~status.isin(["", OK])] = np.nan
    frame = converter.framed(curve | {"p_over_E": load}).reset_index(drop=True)
    return _transitions(converter, frame, gaps, np.array([use.Q for use in corners]))


def of_counts(converter: Converter, frame: pd.DataFrame) -> pd.DataFrame:
    """Return the transitions of a table whose rows are increments with a count."""
    Q = frame["Q"].to_numpy()
    levels = np.arange(4, int(np.nanmax(Q)) + 1, 2)
    gaps = np.where(Q[:, None] >= levels, -np.inf, np.inf)
    gaps[np.isnan(Q)] = np.nan
    gaps[Q[:, None] == levels - 1] = np.nan  # one side of the body touches, or a count is wrong
    how = "loads" if converter.facts.interpolate else "brackets (--interpolate gives loads)"
    if converter.problems:
        return pd.DataFrame()
    n_odd = int((Q % 2 == 1).sum())
    odd = f"; {count(n_odd, 'odd count')}: unclear, intervals around them are wider" * bool(n_odd)
    converter.messages.append(
        f"counts repeat while loads rise: {len(frame)} increments of runs, taken as {how}{odd}"
    )
    curve = frame.drop(columns=["Q", "p_over_E_lower", "rel_se"], errors="ignore")
    return _transitions(converter, curve, gaps, levels)


def _transitions(
    converter: Converter, frame: pd.DataFrame, gaps: FloatArray, Q: IntArray
) -> pd.DataFrame:
    problems, load = converter.problems, frame.pop("p_over_E").to_numpy()
    load_se = converter.load_se()
    try:
        rows, notes = transitions_of_runs(frame, load, gaps, Q)
    except InputError as error:
        raise problems.error(str(error)) from None
    if left := converter.left():
        problems.messages.append(f"not used: {listed(left)}")
    problems.messages += notes
    if converter.facts.interpolate:
        rows, n = middle_loads(rows)
        problems.messages.append(f"{count(n, 'load')} in the middle of their increments")
    if load_se is None:
        return rows
    if np.ptp(load_se):
        raise problems.error("--load-se: expected one R and E in all increments")
    return rows.assign(rel_se=np.hypot(rows["rel_se"], load_se.flat[0] / rows["p_over_E"]))
