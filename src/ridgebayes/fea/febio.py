"""Reader for log data of FEBio: node positions and a force at each step."""

import math
import re

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.fea.deck import Run
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import Line
from ridgebayes.fea.printed import Increment, MissingError, Printed, on
from ridgebayes.fea.transitions import last_digit


def read_febio(run: Run) -> ContactHistory:
    """Read log data of FEBio.

    Parameters
    ----------
    run : Run
        Text files with ``*Step``, ``*Time``, ``*Data`` and rows ``id,value,...``. The data are
        ``x;y`` of the nodes of the body's surface, and ``Fy`` of the rigid body or ``Ry`` of the
        driven nodes, which are summed. Positions and forces may be in one file or in two.

    Returns
    -------
    ContactHistory
        Heights of the surface, without undeformed positions, which log data do not contain.

    Raises
    ------
    InputError
        If a line cannot be parsed (the message names file and line), or data are missing.
    """
    log = _Log()
    for path in run.paths:
        log.read(path)

    def state(increment: Increment) -> tuple[float, FloatArray]:
        at = np.column_stack([log.column(increment, name) for name in "xy"])
        force = math.fsum(log.column(increment, "Fy", "Ry"))
        if not at.any():
            raise MissingError("zeros, as before the first step: no state")
        return force, at

    required = (
        "data x, y, and Fy or Ry; expected log data x;y of the surface's nodes, and Fy of the "
        "rigid body or Ry of the driven nodes: ridgebayes import POSITIONS FORCES"
    )
    load, states = log.states(state, run.path, required)
    at = np.array(states)
    return ContactHistory(load, at, digits=last_digit(at[..., 1]) / 2, messages=log.messages)


class _Log(Printed):
    """Parser of log data."""

    @on(r"\*Step\s*=\s*(\S+)\s*$")
    def _step(self, line: Line, match: re.Match[str]) -> None:
        self.begin(line, (line.finite(match[1]),))

    @on(r"\*Time\s*=")
    def _time(self, line: Line, match: re.Match[str]) -> None:
        self.table = None

    @on(r"\*Data\s*=\s*(\S.*?)\s*$")
    def _data(self, line: Line, match: re.Match[str]) -> None:
        self.open(line, "", match[1].split(";")).whole = True

    @on("")
    def _row(self, line: Line, match: re.Match[str]) -> None:
        if self.table is None:
            raise line.unexpected("*Step, *Time, *Data, and rows below *Data")
        self.table.lines.append(line._replace(text=line.text.replace(",", " ")))
