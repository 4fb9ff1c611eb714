"""CalculiX's ``.sta``: which increments converged."""

import re
from pathlib import Path

import numpy as np

from ridgebayes._types import BoolArray, FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.lines import read_lines

# Step, increment, attempt (U where it did not converge), iterations, three times.
_ATTEMPT = re.compile(r"\s*(\d{1,9}\s+\d{1,9})\s+\d{1,9}(U?)\s+\d{1,9}\s+(\S+)\s+(\S+)\s+(\S+)\s*$")
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
    ends: dict[str, float] = {}
    cut_backs, tail = 0, 0
    for line in read_lines(path):
        if not line.text.strip() or line.text.strip().startswith(_HEADS):
            continue
        match = _ATTEMPT.match(line.text)
        if match is None:
            raise line.unexpected(
                "STEP, INC, ATT, ITRS and three times, as CalculiX's .sta has them"
            )
        time, *_ = [line.finite(word) for word in match.groups()[2:]]
        if match[2]:
            tail += 1
            continue
        cut_backs, tail = cut_backs + tail, 0
        key = ", increment ".join(match[1].split())
        if key in ends or time < max(ends.values(), default=0.0):
            raise line.error(
                f"step {key} at time {time:g}; expected each once, in the order of time"
            )
        ends[key] = time
    if not ends and not tail:
        raise InputError(f"{path}: no increments; expected a .sta of CalculiX")
    end = np.array(list(ends.values()))
    last = f", the last at time {end[-1]:.6g}" if len(end) else ""
    stopped = f"; it stopped after {tail} attempts without convergence" if tail else ""
    said = f"{path}: {len(end)} converged increments{last}, {cut_backs} cut-backs{stopped}"
    return (np.abs(times[:, None] - end) <= _PRINTED * np.abs(end)).any(axis=1), said
