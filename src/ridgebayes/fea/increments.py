"""Transitions of tables whose rows are increments with gaps, pressures, statuses or counts."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.convert import Converter, listed
from ridgebayes.fea.mapping import CORNERS, LOWERS, Use
from ridgebayes.fea.transitions import (
    last_digit,
    middle_loads,
    transitions_of_runs,
)
from ridgebayes.fea.words import STATUS_RULE, divided, touching
from ridgebayes.table.columns import OK
from ridgebayes.table.rules import as_text


def of_corners(converter: Converter, corners: Sequence[Use]) -> pd.DataFrame:
    """Return the transitions of a table with gap, pressure or status columns of corners.

    Parameters
    ----------
    converter : Converter
        Converter of the table.
    corners : sequence of Use
        Columns of gap, pressure or status, one per corner.
    """
    cells, problems = converter.cells, converter.problems
    for use in converter.uses.values():
        wrong = use.Q is not None and use.key not in CORNERS
        if use.how == "mapped" and (wrong or use.key in ("Q", "kind", "rel_se", *LOWERS)):
            raise problems.error(
                f"column {use.header!r} as {use.key} beside {corners[0].header!r}; expected a "
                "load of each increment, and columns of corners"
            )
    curve = converter.curve() | converter.texts("role")
    load = converter.load()
    converter.load_se()
    corners = sorted(corners, key=lambda use: use.Q or 0)
    gaps = np.column_stack([_gap(converter, use) for use in corners])
    digits = last_digit(gaps) / 2  # rounding error of a printed gap
    keep, remarks = np.ones(len(cells), dtype=bool), []
    if status := converter.uses.get(("status", None)):
        keep = as_text(cells[status.header]).isin(["", OK]).to_numpy(bool)
        converter.tell(status)
        if n := int((~keep).sum()):
            remarks.append(f"{n} increments ignored: their status is not 'ok'")
        if not keep.any():
            raise problems.error("no increment whose status is 'ok'")
    converter.summarize()
    if load is None or problems:
        return pd.DataFrame()
    frame = converter.framed(curve | {"p_over_E": load})[keep]
    Q = np.array([use.Q or 0 for use in corners])
    return _transitions(converter, frame.reset_index(drop=True), gaps[keep], Q, remarks, digits)


def of_counts(converter: Converter, frame: pd.DataFrame) -> pd.DataFrame:
    """Return the transitions of a table whose rows are increments with a count."""
    Q = frame["Q"].to_numpy()
    levels = np.arange(4, int(np.nanmax(Q)) + 1, 2)
    gaps = np.where(Q[:, None] >= levels, -np.inf, np.inf)
    gaps[np.isnan(Q)] = np.nan
    how = "loads" if converter.facts.interpolate else "brackets (--interpolate gives loads)"
    remark = f"counts repeat while loads rise: {len(frame)} increments of runs, taken as {how}"
    if converter.problems:
        return pd.DataFrame()
    curve = frame.drop(columns=["Q", "p_over_E_lower", "rel_se"], errors="ignore")
    return _transitions(converter, curve, gaps, levels, [remark])


def _transitions(
    converter: Converter,
    frame: pd.DataFrame,
    gaps: FloatArray,
    Q: IntArray,
    remarks: list[str],
    digits: float = 0.0,
) -> pd.DataFrame:
    problems, load = converter.problems, frame.pop("p_over_E").to_numpy()
    load_se = converter.load_se()
    brackets = converter.facts.brackets
    try:
        rows, notes = transitions_of_runs(frame, load, gaps, Q, brackets=brackets, digits=digits)
    except InputError as error:
        raise problems.error(str(error)) from None
    if left := converter.left():
        problems.messages.append(f"not used: {listed(left)}")
    problems.messages += [*remarks, *notes]
    if converter.facts.interpolate:
        rows, n = middle_loads(rows)
        problems.messages.append(f"{n} loads in the middle of their increments")
    if load_se is None:
        return rows
    if np.ptp(load_se):
        raise problems.error("--load-se: expected one R and E in all increments")
    return rows.assign(rel_se=np.hypot(rows["rel_se"], load_se.flat[0] / rows["p_over_E"]))


def _gap(converter: Converter, use: Use) -> FloatArray:
    """Return the gap of a corner at each increment; -inf or inf for a status or a pressure."""
    cells, problems = converter.cells, converter.problems
    if use.key == "status":
        converter.tell(use)
        gap, bad = touching(as_text(cells[use.header]), converter.facts.closed_is)
        problems.cells(cells.index[bad], use.header, STATUS_RULE)
        if bad.any():
            problems.options.setdefault("closed_is", "?")
        return gap
    if use.key == "pressure":
        converter.tell(use, ", contact pressure")
        numbers = cells[use.header].to_numpy(dtype=float)
        return np.where(np.isnan(numbers), np.nan, np.where(numbers > 0, -np.inf, np.inf))
    distance = converter.number(use.key, use.Q)
    assert distance is not None
    R = None if use.key == "gap_over_R" else converter.number("R")
    # Without R the gap keeps its unit: interpolation to zero does not depend on the unit.
    return distance if R is None else divided(distance, R)
