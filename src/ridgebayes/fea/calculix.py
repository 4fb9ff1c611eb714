"""Reader for CalculiX runs: a ``.dat`` or ``.frd`` file with its deck and ``.sta`` file."""

import math
import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.deck import Deck, Run
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import Line, numbers_of, read_lines
from ridgebayes.fea.printed import Increment, NodeTable, Printed, on
from ridgebayes.fea.words import N_PLANE_FACES, PRINTED_ROUNDING
from ridgebayes.runtime.text import clipped

COLUMNS = {"DISP": ["vx", "vy", "vz"], "FORC": ["fx", "fy", "fz"]}
# Step, increment, attempt (with a U if it did not converge), iterations, three times.
_ATTEMPT = re.compile(r"\s*\d{1,9}\s+\d{1,9}\s+\d{1,9}(U?)\s+\d{1,9}\s+(\S+)\s+(\S+)\s+(\S+)\s*$")
_HEADERS = ("SUMMARY OF JOB INFORMATION", "STEP")
_FACES = "slave element+face"
_STRESS = ("element", "face", "press", "tang1", "tang2")
_FORCES, _MOVED = (tuple(COLUMNS[name]) for name in ("FORC", "DISP"))
_COLUMNS = {
    "total force": _FORCES,
    "forces": _FORCES,
    "displacements": _MOVED,
    "contact stress": _STRESS,
}
# CalculiX expands a plane element to one layer of solid elements. Faces 1 and 2 of the solid are
# the front and back of the plane; face i + 2 is side i of the plane element.


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


def read_calculix(run: Run) -> ContactHistory:
    """Read the results of a CalculiX run.

    Parameters
    ----------
    run : Run
        One file. A ``.dat`` file needs, at each increment, ``*NODE PRINT`` of ``U`` on the
        surface's set and of ``RF`` on the driven set (of each node, or ``TOTALS=ONLY`` or
        ``YES``). ``*CONTACT PRINT`` of ``CSTR`` can replace displacements if the contact pair has
        ``TYPE=SURFACE TO SURFACE``. A ``.frd`` file needs ``*NODE FILE, OUTPUT=2D`` of ``U`` and
        ``RF``. The deck gives coordinates, node sets and the ridges' nodes. If a ``.sta`` file
        lies beside the result file, increments that it does not list as converged are ignored.

    Returns
    -------
    ContactHistory
        Heights of the surface, or its pressed faces with their undeformed positions.

    Raises
    ------
    InputError
        If a line cannot be parsed (the message names file and line), or a set is missing.
    """
    nodes, driven = map(run.deck.nodes_of, run.sets)
    is_frd = run.path.suffix.lower() == ".frd"
    printed = (Frd() if is_frd else _Blocks(run.sets)).read(run.path)
    surface, reaction = ("", "") if is_frd else run.sets
    ignore_unconverged(printed, run.path.with_suffix(".sta"))
    # Displacements give gaps; contact stress only shows which faces carry load.
    is_moved = any(table.has(*_MOVED) for table in printed.tables)

    def state(increment: Increment) -> tuple[float, FloatArray]:
        force = increment.table(_FORCES, reaction).force(driven, "fy")
        if not is_moved:
            return force, _faces(increment.table(_STRESS))
        return force, increment.table(_MOVED, surface).of(nodes, "vx", "vy")

    required = "displacements of {} or contact stress, and forces of {}; ".format(*run.sets)
    required += "expected *NODE PRINT of U and of RF, TOTALS=ONLY; or *NODE FILE, OUTPUT=2D of both"
    load, states = printed.states(state, run.path, required)
    places = run.places(nodes)
    if is_moved:
        rounding = PRINTED_ROUNDING["frd" if is_frd else "dat"]
        digits = float(rounding * np.abs(states).max())
        contact: dict[str, Any] = {"at": places["undeformed"] + np.array(states), "digits": digits}
    else:
        contact = _pressed(states, run.deck)
        n = contact["closed"].sum(axis=1).max()
        printed.messages.append(f"pressed faces: {n} at most, where they were")
    return ContactHistory(load, messages=printed.messages, **places, **contact)


def _pressed(stress: Sequence[FloatArray], deck: Deck) -> dict[str, Any]:
    """Return the pressed faces in each increment, and their undeformed positions."""
    pressed = [{(int(row[0]), int(row[1])) for row in rows if row[2] > 0} for rows in stress]
    faces = sorted(set().union(*pressed))
    ends = np.array([deck.ends(element, side - N_PLANE_FACES) for element, side in faces])
    ends = ends.reshape(-1, 2)
    closed = np.array([[face in some for face in faces] for some in pressed], dtype=bool)
    at = np.broadcast_to(ends.mean(axis=1), closed.shape)[..., None]
    return {"at": at, "closed": closed, "width": np.abs(np.diff(ends)[:, 0])}


class _Blocks(Printed):
    """Parser of a ``.dat`` file: blocks of two node sets, and of contact stress."""

    def __init__(self, sets: Collection[str]) -> None:
        super().__init__()
        self._sets = {name.upper() for name in sets}
        self._blocks: dict[float, set[str]] = {}
        self._above = ""  # "head", "words" or "row": kind of the previous line; "" if blank
        self._is_total = self._is_lost = False

    def blank(self) -> None:
        """Forget the kind of the previous line."""
        self._above = ""

    def take(self, line: Line) -> None:
        """Parse a line; refuse words between rows.

        CalculiX prints headings between blank lines. Other words are damage, and the rows below
        them would be lost.
        """
        here = "words" if line.text.strip()[0].isalpha() else "row"
        is_lost = self._above == "words" and self._is_lost
        is_head = here == "words" and self._head.pattern.match(line.text) is not None
        is_wrong = is_lost if here == "row" else self._above and self.table and not is_head
        if is_wrong:
            text = clipped(line.text.strip())
            raise line.error(f"{text} among rows; expected rows, a blank line, a heading")
        if here == "row" and self.table is not None:
            self.row(line, self.table)
        elif is_head:
            super().take(line)
        elif here == "words":
            self._is_lost, self.table = is_lost or self.table is not None, None
        self._above = "head" if is_head else here

    @on(
        r"(total force|forces|displacements|relative contact displacement|contact stress)"
        r" \(([^)]*)\) for (?:set (\S+)|all \S+ ?\S*) and time +(\S+)\s*$"
    )
    def _head(self, line: Line, match: re.Match[str]) -> None:
        block, columns, name = match[1], match[2], (match[3] or "").upper()
        self.table = None
        is_stress = block == "contact stress" and not name
        if is_stress and not columns.startswith(_FACES):
            if not columns.startswith("slave node"):
                raise line.unexpected(f"contact stress ({_FACES},...) or (slave node,...)")
            self.others.add(f"{block} by ({columns}); expected of faces, TYPE=SURFACE TO SURFACE")
        elif block in _COLUMNS and (is_stress or name in self._sets):
            time = line.finite(match[4])
            if time not in self._blocks or block in self._blocks[time]:
                self._blocks[time] = set()
            self.begin(line, (time,), anew=not self._blocks[time])
            self._blocks[time].add(block)
            self._is_total = block == "total force"
            self.open(line, name, list(_COLUMNS[block]))
        else:
            self.others.add(f"{block} of {name or 'all'}")

    def row(self, line: Line, table: NodeTable) -> None:
        """Add a row or a total to the table."""
        if not self._is_total:
            table.lines.append(line)
        elif "TOTAL" in table.below:
            raise line.unexpected("one total force an increment")
        else:
            table.below["TOTAL"] = line.values(table.columns)


def _faces(table: NodeTable) -> FloatArray:
    """Return element, face and pressure of each row of contact stress."""
    rows = numbers_of(table.lines, _STRESS)
    element, face, pressure = rows[:, :3].T
    is_face = (element % 1 == 0) & (face % 1 == 0) & ((face > N_PLANE_FACES) | (pressure <= 0))
    for i in np.flatnonzero(~is_face)[:1]:
        raise table.lines[i].error(
            f"face {face[i]:g} of {element[i]:g}; expected a side of a plane element"
        )
    return rows
