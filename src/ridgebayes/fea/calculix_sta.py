"""CalculiX's ``.sta``: which increments converged."""

import math
import re
from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.fea.lines import read_lines
from ridgebayes.fea.printed import Printed

# Step, increment, attempt (U where it did not converge), iterations, three times.
_ATTEMPT = re.compile(r"\s*\d{1,9}\s+\d{1,9}\s+\d{1,9}(U?)\s+\d{1,9}\s+(\S+)\s+(\S+)\s+(\S+)\s*$")
_HEADS = ("SUMMARY OF JOB INFORMATION", "STEP")
_PRINTED = 2e-6  # of a time: six digits are printed here, seven in the .dat


def ignore_unconverged(printed: Printed, path: Path) -> None:
    """Ignore increments whose times are not those of converged ones.

    Parameters
    ----------
    printed : Printed
        Increments by their total times, as a ``.dat`` prints them.
    path : pathlib.Path
        The ``.sta`` file; all increments count where there is none. A last line without an end is
        that of a run still going on: it is not read.

    Raises
    ------
    InputError
        If a line cannot be understood, with its number, or there is none.
    """
    if not path.is_file():
        return
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
    stopped = f"; it stopped after {n_tail} attempts without convergence" if n_tail else ""
    printed.messages.append(f"{path}: {len(ends)} converged increments{stopped}")
    for (time,), increment in printed.increments.items():
        if not any(math.isclose(time, end, rel_tol=_PRINTED) for end in ends):
            increment.ignored = "it did not converge"
