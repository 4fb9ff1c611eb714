"""Rows that are increments of a run: when each corner was reached, by gap, pressure or status."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.importers.increments import transitions_of
from ridgebayes.table_cells import row_codes

MOST = 2000  # histories in a file: some milliseconds each
_SHOWN = 20  # remarks on single histories
_OPEN = ("open", "0", "0.0", "no", "false", "off", "free", "separated", "not in contact")
_CLOSED = (
    *("closed", "1", "1.0", "yes", "true", "on", "touched", "contact", "in contact"),
    *("stick", "sticking", "slip", "slipping", "sliding"),
)
STATUS_RULE = (
    "rule: open or 0, closed or 1, or an empty cell (codes of contact programs beyond 0 and 1 "
    "have to be told apart before)"
)


@dataclass(frozen=True, eq=False)
class Histories:
    """Increments of runs.

    Parameters
    ----------
    curve : DataFrame, n_row rows
        Columns that are constant in a run, by contract name; one run each distinct row.
    load : ndarray of float, shape (n_row,), dimensionless
        p/E.
    gap : ndarray of float, shape (n_row, n_corner)
        As `ridgebayes.importers.increments.transitions_of`.
    Q : sequence of int, length n_corner
        Rising.
    """

    curve: pd.DataFrame
    load: FloatArray
    gap: FloatArray
    Q: Sequence[int]

    def transitions(self, where: str, *, brackets: bool) -> tuple[pd.DataFrame, list[str]]:
        """Return a row for each corner that was reached, and remarks.

        Raises
        ------
        InputError
            If no corner of any run was reached, or there are over 2000 runs.
        """
        run = row_codes(*(self.curve[name] for name in self.curve))
        n_run = int(run.max()) + 1
        if n_run > MOST:
            raise InputError(
                f"{where}: increments of {n_run} runs; rule: at most {MOST} (texture, nu, offset, "
                "series, solver and source are constant in a run)"
            )
        frames, said, failed = [], [], []
        order = np.argsort(run, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(run[order])) + 1):
            one = self.curve.iloc[int(rows[0])]
            name = "" if n_run == 1 else f"{_label(one)}: "
            try:
                frame, odd = self._run(rows, brackets=brackets)
            except InputError as error:
                failed.append(f"{name}{error}")
                continue
            said += [f"{name}{text}" for text in odd]
            frames.append(frame.assign(**{str(key): one[str(key)] for key in self.curve}))
        if not frames:
            raise InputError(f"{where}: {failed[0]}")
        said += [f"left out: {text}" for text in failed]
        if len(said) > _SHOWN:
            said = [*said[:_SHOWN], f"and {len(said) - _SHOWN} more remarks on runs"]
        return pd.concat(frames, ignore_index=True), [f"{n_run} runs of increments", *said]

    def _run(self, rows: IntArray, *, brackets: bool) -> tuple[pd.DataFrame, list[str]]:
        Q = np.array(self.Q, dtype=np.int64)
        # Absurd numbers overflow where loads are extrapolated, and then are not used.
        with np.errstate(all="ignore"):
            load, gap = self.load[rows], self.gap[rows]
            frame, said = transitions_of(load, gap, Q, brackets=brackets)
            if not brackets and (np.diff(frame["p_over_E"]) <= 0).any():
                # A load within an increment, beside the end of the same increment.
                frame, said = transitions_of(load, gap, Q, brackets=True)
                said.append("several corners reached in one increment: all as brackets")
        again = np.flatnonzero(np.diff(frame["p_over_E"]) == 0) + 1
        if again.size:
            names = ", ".join(str(q) for q in frame["Q"].to_numpy()[again])
            said.append(f"Q = {names}: reached in the same increment as the Q before: left out")
            frame = frame.drop(index=again.tolist())
        return frame, said


def touching(words: "pd.Series[str]") -> tuple[FloatArray, BoolArray]:
    """Return gaps of which only the sign is known, and the cells that are no status.

    Examples
    --------
    >>> gap, bad = touching(pd.Series(["open", "Closed", "", "maybe"]))
    >>> gap.tolist(), bad.tolist()
    ([inf, -inf, nan, nan], [False, False, False, True])
    """
    plain = words.str.strip().str.lower()
    is_open, closed = plain.isin(_OPEN).to_numpy(bool), plain.isin(_CLOSED).to_numpy(bool)
    gap = np.where(is_open, np.inf, np.where(closed, -np.inf, np.nan))
    return gap, ~(is_open | closed | (plain == "").to_numpy(bool))


def _label(one: "pd.Series[str]") -> str:
    texture = str(one.get("texture", "")) or f"a/R = {one['a_over_R']:g}, b/R = {one['b_over_R']:g}"
    series = str(one.get("series", ""))
    return f"{texture}, {series}" if series else texture
