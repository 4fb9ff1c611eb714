"""Rows that are increments of a run: when each corner was reached, by gap, pressure or status."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.increments import transitions_of
from ridgebayes.table.rules import row_codes

MOST = 2000  # histories in a file: some milliseconds each
_SHOWN = 20  # remarks on single histories
_OPEN = ("open", "0", "0.0", "no", "false", "off", "free", "separated", "not in contact")
_CLOSED = (
    *("closed", "1", "1.0", "yes", "true", "on", "touched", "contact", "in contact"),
    *("stick", "sticking", "slip", "slipping", "sliding"),
)
STATUS_RULE = (
    "expected open or 0, closed or 1, or an empty cell (codes of contact programs beyond 0 and 1 "
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
        As `ridgebayes.fea.increments.transitions_of`.
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
                f"{where}: increments of {n_run} runs; expected at most {MOST} (texture, nu, "
                "offset, "
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
            self._check_order(load, gap)
            return transitions_of(load, gap, Q, brackets=brackets)

    def _check_order(self, load: FloatArray, gap: FloatArray) -> None:
        """Refuse outer corners that touch in an increment before inner ones: columns exchanged."""
        touched = gap <= 0
        first = np.where(touched.any(axis=0), touched.argmax(axis=0), len(load))
        for i in np.flatnonzero(np.diff(first) < 0).tolist():
            raise InputError(
                f"Q = {self.Q[i + 1]} is touched at p/E = {load[first[i + 1]]:.5g}, before "
                f"Q = {self.Q[i]}; expected inner corners first"
            )


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
