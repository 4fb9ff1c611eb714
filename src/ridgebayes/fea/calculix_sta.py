"""CalculiX's ``.sta``: which increments converged."""

import re
from pathlib import Path

import numpy as np

from ridgebayes._types import BoolArray, FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.lines import read_lines

# Step, increment, attempt (U where it did not converge), iterations, three times.
_ATTEMPT = re.compile(r"\s*\d{1,9}\s+\d{1,9}\s+\d{1,9}(U?)\s+\d{1,9}\s+(\S+)\s+(\S+)\s+(\S+)\s*$")
_HEADS = ("SUMMARY OF JOB INFORMATION", "STEP")
_PRINTED = 2e-6  # of a time: six digits are printed here, seven in the .dat


def read_sta(path: Path, times: FloatArray) -> tuple[BoolArray, str]:
    """Tell which times are those of converged increments.

    Parameters
    ----------
    path : pathlib.Path
        The ``.sta`` file. A last line without an end is that of a run still going on: it is not
        read.
    times : ndarray of float, shape (n_level,)
        Total times, as a ``.dat`` prints them.

    Returns
    -------
    ndarray of bool, shape (n_level,)
    str
        A line about the run.

    Raises
    ------
    InputError
        If a line cannot be understood, with its number, or there is none.
    """
    ends: list[float] = []
    n_tail = 0
    for line in read_lines(path):
        if not line.text.strip() or line.text.strip().startswith(_HEADS):
            continue
        match = _ATTEMPT.match(line.text)
        if match is None:
            raise line.unexpected(
                "STEP, INC, ATT, ITRS and three times, as CalculiX's .sta has them"
            )
        time, *_ = [line.finite(word) for word in match.groups()[1:]]
        if match[1]:
            n_tail += 1
        elif ends and time <= ends[-1]:
            raise line.error(f"time {time:g} after {ends[-1]:g}; expected rising times")
        else:
            ends.append(time)
            n_tail = 0
    if not ends and not n_tail:
        raise InputError(f"{path}: no increments; expected a .sta of CalculiX")
    end = np.array(ends)
    stopped = f"; it stopped after {n_tail} attempts without convergence" if n_tail else ""
    said = f"{path}: {len(ends)} converged increments{stopped}"
    return (np.abs(times[:, None] - end) <= _PRINTED * np.abs(end)).any(axis=1), said
