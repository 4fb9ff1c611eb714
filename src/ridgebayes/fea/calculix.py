"""Reader for CalculiX runs: a ``.dat`` or ``.frd`` file with its deck and ``.sta`` file."""

import math
import re
from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.fea.deck import Run
from ridgebayes.fea.history import ContactHistory, moved_surface
from ridgebayes.fea.lines import Line, read_lines
from ridgebayes.fea.printed import NodeTable, Printed, Wanted, on
from ridgebayes.fea.words import TIME_ROUNDING

_FORCES, _MOVED = ["fx", "fy", "fz"], ["vx", "vy", "vz"]
# Columns by the name of a block in a .dat and in a .frd file.
_COLUMNS = {
    **dict.fromkeys(("total force", "forces", "FORC"), _FORCES),
    **dict.fromkeys(("displacements", "DISP"), _MOVED),
}
# Step, increment, attempt (with a U if it did not converge), iterations, three times.
_ATTEMPT = re.compile(r"\s*\d{1,9}\s+\d{1,9}\s+\d{1,9}(U?)\s+\d{1,9}\s+(\S+)\s+(\S+)\s+(\S+)\s*$")
_HEADERS = ("SUMMARY OF JOB INFORMATION", "STEP")


def read_calculix(run: Run) -> ContactHistory:
    """Read the results of a CalculiX run.

    Parameters
    ----------
    run : Run
        One file. A ``.dat`` file needs, at each increment, ``*NODE PRINT`` of ``U`` on the
        surface's set and of ``RF`` on the driven set (of each node, or ``TOTALS=ONLY`` or
        ``YES``). A ``.frd`` file needs ``*NODE FILE, OUTPUT=2D`` of ``U`` and ``RF``. The deck
        gives coordinates, node sets and the ridges' nodes. If a ``.sta`` file lies beside the
        result file, increments that it does not list as converged are ignored.

    Returns
    -------
    ContactHistory

    Raises
    ------
    InputError
        If a line cannot be parsed (the message names file and line), or a set is missing.
    """
    nodes, driven = map(run.deck.nodes_of, run.sets)
    is_frd = run.path.suffix.lower() == ".frd"
    surface, reaction = ("", "") if is_frd else run.sets
    printed = (_Frd() if is_frd else _Dat(run.sets)).read(run.path)
    _ignore_unconverged(printed, run.path.with_suffix(".sta"))
    required = "displacements of {} and forces of {}; ".format(*run.sets)
    required += "expected *NODE PRINT of U and of RF, TOTALS=ONLY; or *NODE FILE, OUTPUT=2D of both"
    force, values = Wanted(["fy"], driven, reaction), Wanted(["vx", "vy"], nodes, surface)
    load, moved = printed.states(force, values, run.path, required)
    return moved_surface(run, nodes, load, moved, printed.messages)


class _Frd(Printed):
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
        if name not in _COLUMNS:
            self.others.add(name)
        else:
            self.open(line, "", _COLUMNS[name])

    @on("-3")
    def _end(self, line: Line, match: re.Match[str]) -> None:
        if self.table is not None:
            self.table.whole, self.table = True, None
        self.increment = None  # each block has its own header with the time

    def row(self, line: Line, table: NodeTable) -> None:
        """Ignore a line with a component name: the columns are known."""


class _Dat(Printed):
    """Parser of a ``.dat`` file: blocks of two node sets.

    CalculiX prints headings between blank lines. Words directly below rows are damage.
    """

    def __init__(self, sets: tuple[str, str]) -> None:
        super().__init__()
        self._sets, self._time = {name.upper() for name in sets}, ""
        self._blocks: set[str] = set()  # of the increment at this time
        self._is_total = self._is_below_row = False

    def blank(self) -> None:
        """Forget the row above."""
        self._is_below_row = False

    @on(r"([a-z ]+) \([^)]*\) for (?:set (\S+)|all \S+ ?\S*) and time +(\S+)\s*$")
    def _head(self, line: Line, match: re.Match[str]) -> None:
        block, name, time = match[1], (match[2] or "").upper(), match[3]
        self.table, self._is_below_row = None, False
        if block not in _COLUMNS or name not in self._sets:
            self.others.add(f"{block} of {name or 'all'}")
            return
        is_next = time != self._time or block in self._blocks
        self.begin(line, (line.finite(time),), anew=is_next)
        self._blocks = {block} if is_next else {*self._blocks, block}
        self._time, self._is_total = time, block == "total force"
        self.open(line, name, _COLUMNS[block])

    @on(r"(?=[^\W\d])")
    def _words(self, line: Line, match: re.Match[str]) -> None:
        if self._is_below_row:
            raise line.unexpected("rows, a blank line, a heading")
        self.table = None

    def row(self, line: Line, table: NodeTable) -> None:
        """Add a row or a total to the table."""
        self._is_below_row = True
        if not self._is_total:
            table.lines.append(line)
        elif "TOTAL" in table.below:
            raise line.unexpected("one total force an increment")
        else:
            table.below["TOTAL"] = line.values(table.columns)


def _ignore_unconverged(printed: Printed, path: Path) -> None:
    """Mark the increments as ignored whose times the ``.sta`` file does not list as converged.

    If the file does not exist, no increment is ignored. A last line without line end belongs to a
    run in progress and is skipped.
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
            raise line.unexpected("STEP, INC, ATT, ITRS and three times, as in a .sta file")
        time, *_ = [line.finite(word) for word in match.groups()[1:]]
        if match[1]:
            n_tail += 1
        # The last increment of a step may be shorter than the digits of its time.
        elif ends and time < ends[-1]:
            raise line.error(f"time {time:g} after {ends[-1]:g}; expected times that do not fall")
        else:
            ends.append(time)
            n_tail = 0
    if not ends and not n_tail:
        raise InputError(f"{path}: no increments; expected a .sta of CalculiX")
    stopped = f"; it stopped after {n_tail} attempts without convergence" if n_tail else ""
    printed.messages.append(f"{path}: {len(ends)} converged increments{stopped}")
    for (time,), increment in printed.increments.items():
        if not any(math.isclose(time, end, rel_tol=TIME_ROUNDING) for end in ends):
            increment.ignored = "it did not converge"
