"""Other files of CalculiX: results in a ``.frd``, and converged increments in a ``.sta``."""

import math
import re
from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.fea.lines import Line, read_lines
from ridgebayes.fea.printed import NodeTable, Printed, on
from ridgebayes.fea.words import PRINTED_ROUNDING

COLUMNS = {"DISP": ["vx", "vy", "vz"], "FORC": ["fx", "fy", "fz"]}
# Step, increment, attempt (with a U if it did not converge), iterations, three times.
_ATTEMPT = re.compile(r"\s*\d{1,9}\s+\d{1,9}\s+\d{1,9}(U?)\s+\d{1,9}\s+(\S+)\s+(\S+)\s+(\S+)\s*$")
_HEADERS = ("SUMMARY OF JOB INFORMATION", "STEP")


class Frd(Printed):
    """Parser of the blocks of a ``.frd`` file; each block has the values of all nodes."""

    _width = 0  # characters of a node number

    @on(r"(?<= )-1")
    def _row(self, line: Line, match: re.Match[str]) -> None:
        if self.table is not None:
            text, first = line.text, 3 + self._width
            ends = range(first, first + 12 * len(self.table.columns), 12)
            cells = [text[3:first], *(text[start : start + 12] for start in ends)]
            self.table.lines.append(line._replace(text=" ".join(cells)))

    @on("100C")
    def _time(self, line: Line, match: re.Match[str]) -> None:
        form = line.text[73:75].strip()
        if form not in ("0", "1"):
            raise line.error(f"format {form!r}; expected text, 0 or 1, not binary")
        self._width = 10 if form == "1" else 5
        self.begin(line, (line.finite(line.text[12:24].strip()),))

    @on(r"-4 {2}(.{8})")
    def _block(self, line: Line, match: re.Match[str]) -> None:
        self.table, name = None, match[1].strip()
        if name not in COLUMNS:
            self.others.add(name)
        else:
            self.open(line, name, COLUMNS[name])

    @on("-3")
    def _end(self, line: Line, match: re.Match[str]) -> None:
        if self.table is not None:
            self.table.whole, self.table = True, None
        self.increment = None  # each block has its own header with the time

    def row(self, line: Line, table: NodeTable) -> None:
        """Ignore a line with a component name: the columns are known."""


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
