"""Parser of CalculiX ``.sta`` files, which list the converged increments."""

import math
import re
from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.fea.lines import read_lines
from ridgebayes.fea.printed import Printed
from ridgebayes.fea.words import PRINTED_ROUNDING

# Step, increment, attempt (with a U if it did not converge), iterations, three times.
_ATTEMPT = re.compile(r"\s*\d{1,9}\s+\d{1,9}\s+\d{1,9}(U?)\s+\d{1,9}\s+(\S+)\s+(\S+)\s+(\S+)\s*$")
_HEADERS = ("SUMMARY OF JOB INFORMATION", "STEP")


def ignore_unconverged(printed: Printed, path: Path) -> None:
    """Mark the increments as ignored whose times the ``.sta`` file does not list as converged.

    Parameters
    ----------
    printed : Printed
        Increments by total time, as read from a ``.dat`` or ``.frd`` file.
    path : pathlib.Path
        The ``.sta`` file. If it does not exist, no increment is ignored. A last line without line
        end belongs to a run in progress and is skipped.

    Raises
    ------
    InputError
        If a line cannot be parsed (the message names it), or the file lists no increment.
    """
    if not path.is_file():
        return
    ends: list[float] = []
    n_tail = 0
    for line in read_lines(path):
        if not line.text.strip() or line.text.strip().startswith(_HEADERS):
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
        if not any(math.isclose(time, end, rel_tol=PRINTED_ROUNDING["sta"]) for end in ends):
            increment.ignored = "it did not converge"
