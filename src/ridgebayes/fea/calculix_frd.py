"""Parser of CalculiX ``.frd`` files: displacements and forces in columns of fixed width."""

import re

from ridgebayes.fea.lines import Line
from ridgebayes.fea.printed import NodeTable, Printed, on

COLUMNS = {"DISP": ["vx", "vy", "vz"], "FORC": ["fx", "fy", "fz"]}


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
