"""FEBio's log data: positions of nodes and a force, step by step, in files of their own."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ridgebayes.errors import InputError
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import Line, NodeRows, read_lines
from ridgebayes.fea.record import provenance
from ridgebayes.fea.transitions import last_digit

MARK = re.compile(rb"^\*Step\s*=\s*\d+\s*$", re.M)
_KEY = re.compile(r"\*(Step|Time|Data)\s*=\s*(\S.*?)\s*$")
_FORCES = ("Fy", "Ry")  # of a rigid body, and of nodes


@dataclass(eq=False)
class _Step:
    """Rows printed at a step, by the quantities of their columns."""

    line: Line
    names: dict[str, tuple[NodeRows, int]] = field(default_factory=dict)

    def column(self, name: str) -> np.ndarray:
        """Return a column's values."""
        rows, at = self.names[name]
        return np.asarray(rows.values[:, at])


def read_febio(paths: Sequence[Path]) -> ContactHistory:
    """Read log data of FEBio.

    Parameters
    ----------
    paths : sequence of pathlib.Path
        Text files of ``*Step``, ``*Time``, ``*Data`` and rows ``id,value,...``: ``x;y`` of the
        body's surface (the nodes of one set), and ``Fy`` of the rigid body or ``Ry`` of the driven
        nodes, which are summed. One file may hold both.

    Returns
    -------
    ContactHistory
        Heights of the surface. Where it was before is not in such files.

    Raises
    ------
    InputError
        If a line cannot be understood, with file and line, or data are missing.
    """
    steps: dict[int, _Step] = {}
    for path in paths:
        _read(path, steps)
    where = str(paths[0])
    names = {name for one in steps.values() for name in one.names}
    force = next((name for name in _FORCES if name in names), "")
    if missing := [name for name in ("x", "y") if name not in names] + [" or ".join(_FORCES)] * (
        not force
    ):
        raise InputError(
            f"{where}: no data {', '.join(missing)} (there is {', '.join(sorted(names))}); "
            "expected log data x;y of the surface's nodes, and Fy of the rigid body or Ry of the "
            "driven nodes, in one file or in several: ridgebayes import POSITIONS FORCES"
        )
    whole = {n: one for n, one in steps.items() if {"x", "y", force} <= one.names.keys()}
    # FEBio prints zeros before the first step is solved: no state.
    used = {n: one for n, one in whole.items() if one.column("x").any() or one.column("y").any()}
    messages = [f"{where}: FEBio log data, {len(used)} steps"]
    if n_lack := len(steps) - len(whole):
        messages.append(f"{n_lack} steps ignored: positions or force missing")
    if n_zero := len(whole) - len(used):
        messages.append(f"{n_zero} steps of zeros ignored: no states")
    if not used:
        raise InputError(f"{where}: no step with positions and a force; {'; '.join(messages[1:])}")
    order = [used[n] for n in sorted(used)]
    nodes = order[0].names["x"][0].nodes
    for one in order:
        if not np.array_equal(one.names["x"][0].nodes, nodes):
            raise one.line.error("other nodes than at the first step; expected the same in all")
    height = np.array([one.column("y") for one in order])
    return ContactHistory(
        np.array([one.column(force).sum() for one in order]),
        where,
        provenance(paths[0], "febio", *(path.name for path in paths[1:])),
        "febio",
        np.array([one.column("x") for one in order]),
        height,
        digits=last_digit(height) / 2,
        messages=tuple(messages),
    )


def _read(path: Path, steps: dict[int, _Step]) -> None:
    """Add what a file holds."""
    step: _Step | None = None
    names: list[str] = []
    rows: list[Line] = []

    def finish() -> None:
        if step is None or not names:
            return
        found = NodeRows.of_lines(rows, "id, " + ", ".join(names))
        for at, name in enumerate(names):
            if name in step.names:
                raise step.line.error(f"data {name} twice in a step; expected once, in all files")
            step.names[name] = found, at

    for line in read_lines(path):
        if match := _KEY.match(line.text):
            if match[1] == "Time":
                continue
            finish()
            names, rows = [], []
            if match[1] == "Step":
                number = line.finite(match[2])
                step = steps.setdefault(int(number), _Step(line))
            else:
                names = match[2].split(";")
        elif line.text.strip():
            if not names:
                raise line.unexpected("*Step, *Time, *Data, and rows below *Data")
            rows.append(Line(path, line.number, line.text.replace(",", " ")))
    finish()
