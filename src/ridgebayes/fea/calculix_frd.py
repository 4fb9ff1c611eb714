"""CalculiX's ``.frd``: displacements and forces of all nodes, in columns of fixed width."""

import re

from ridgebayes.fea.lines import Line
from ridgebayes.fea.printed import NodeTable, Printed, on

COLUMNS = {"DISP": ["vx", "vy", "vz"], "FORC": ["fx", "fy", "fz"]}


class Frd(Printed):
    """Blocks of all nodes."""

    _width = 0  # of a node's number

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
        self.increment = None  # each block has a head with its time

    def row(self, line: Line, table: NodeTable) -> None:
        """Take the name of a component: columns are those of a plane run."""
