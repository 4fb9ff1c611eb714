"""CalculiX's ``.sta``: which increments converged."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.lines import read_lines

# Step, increment, attempt (U where it did not converge), iterations, three times.
_ATTEMPT = re.compile(
    r"\s*(\d{1,9})\s+(\d{1,9})\s+(\d{1,9})(U?)\s+(\d{1,9})\s+(\S+)\s+(\S+)\s+(\S+)\s*$"
)
_HEADS = ("SUMMARY OF JOB INFORMATION", "STEP")
_PRINTED = 2e-6  # of a time: six digits are printed here, seven in the .dat


@dataclass(frozen=True, eq=False)
class Status:
    """Content of a ``.sta``.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    times : ndarray of float, shape (n,)
        Total time at the end of each converged increment.
    cut_backs : int
        Attempts that did not converge and were followed by another.
    tail : int
        Attempts at the end that did not converge: the run stopped there.
    """

    path: Path
    times: FloatArray
    cut_backs: int
    tail: int

    def converged(self, times: FloatArray) -> np.ndarray:
        """Tell which times are those of converged increments.

        Parameters
        ----------
        times : ndarray of float, shape (n_level,)
            Total times, as a ``.dat`` prints them.

        Returns
        -------
        ndarray of bool, shape (n_level,)
        """
        far = np.abs(np.asarray(times, dtype=float)[:, None] - self.times)
        return np.asarray((far <= _PRINTED * np.abs(self.times)).any(axis=1))

    def summary(self) -> str:
        """Return one line about the run."""
        n = len(self.times)
        last = f", the last at time {self.times[-1]:.6g}" if n else ""
        tail = f"; it stopped after {self.tail} attempts without convergence" if self.tail else ""
        return f"{self.path}: {n} converged increments{last}, {self.cut_backs} cut-backs{tail}"


def read_sta(path: Path) -> Status:
    """Read a ``.sta``.

    Parameters
    ----------
    path : pathlib.Path
        The file.

    Returns
    -------
    Status

    Raises
    ------
    InputError
        If a line cannot be understood, with its number, or there is none.

    Notes
    -----
    A last line without an end is that of a run still going on: it is not read.
    """
    found: dict[tuple[int, int], float] = {}
    cut_backs, tail, last = 0, 0, 0.0
    for line in read_lines(path):
        if not line.text.strip() or line.text.strip().startswith(_HEADS):
            continue
        match = _ATTEMPT.match(line.text)
        if match is None:
            raise line.unexpected(
                "STEP, INC, ATT, ITRS and three times, as CalculiX's .sta has them"
            )
        time, *_ = [line.finite(word) for word in match.groups()[5:]]
        if match[4]:
            tail += 1
            continue
        cut_backs, tail = cut_backs + tail, 0
        key = (int(match[1]), int(match[2]))
        if key in found or time < last:
            raise line.error(
                f"step {key[0]}, increment {key[1]} at time {time:g}; expected each once, in the "
                "order of time"
            )
        found[key] = last = time
    if not found and not tail:
        raise InputError(f"{path}: no increments; expected a .sta of CalculiX")
    return Status(path, np.array(list(found.values())), cut_backs, tail)
