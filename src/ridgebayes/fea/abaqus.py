"""Reader for the ``.dat`` of an Abaqus run with its deck."""

import re

import pandas as pd

from ridgebayes.fea.deck import Run
from ridgebayes.fea.history import ContactHistory, moved_surface
from ridgebayes.fea.lines import NUMBER, Line
from ridgebayes.fea.printed import MissingError, NodeTable, Printed, Wanted, on
from ridgebayes.fea.record import SHOWN
from ridgebayes.runtime.text import some_of

_ALL_ZERO = "ALL VALUES IN THIS TABLE ARE ZERO"


def read_abaqus_dat(run: Run) -> ContactHistory:
    """Read the ``.dat`` file of an Abaqus/Standard run.

    Parameters
    ----------
    run : Run
        One ``.dat`` file: ``*NODE PRINT`` of ``U`` on the surface's set, and of ``RF`` on the
        driven set (summed, or its total with ``TOTALS=YES``), at each increment. The deck gives
        coordinates, node sets and the ridges' nodes.

    Returns
    -------
    ContactHistory

    Raises
    ------
    InputError
        If a line cannot be parsed (the message names file and line), or a set is missing.

    Notes
    -----
    Abaqus does not print rows of zeros. A missing node has zero values if its table ends with a
    summary (``MAXIMUM``, ``TOTAL``); without the summary, the increment is ignored.
    """
    surface, reaction = run.sets
    nodes, driven = map(run.deck.nodes_of, run.sets)
    printed = _Dat().read(run.path, unfinished=True)
    names = {f"{' '.join(table.columns)} of {table.nodes}" for table in printed.tables}
    rule = f"expected *NODE PRINT of both; the tables are {some_of(sorted(names), SHOWN) or 'none'}"
    required = f"U1 and U2 of {surface}, RF2 of {reaction}; {rule}"
    force, values = Wanted(["RF2"], driven, reaction), Wanted(["U1", "U2"], nodes, surface)
    load, moved = printed.states(force, values, run.path, required)
    return moved_surface(run, nodes, load, moved, printed.messages)


class _Dat(Printed):
    """Parser of a ``.dat`` file."""

    def __init__(self) -> None:
        super().__init__()
        self._step, self._ignored = 0, ""
        self._name = ""  # node set of the next table
        self._is_below = False  # whether a blank line followed the rows

    def blank(self) -> None:
        """Record a blank line after rows, which may end a table."""
        self._is_below = self.table is not None and bool(self.table.lines)

    def take(self, line: Line) -> None:
        """Parse a line; ignore a last line without line end, which may be incomplete."""
        if self._name == "\n":
            self._name = line.words[0].upper()
        elif not line.ended:
            self.messages.append(f"line {line.number} ignored: the last one, and without an end")
        else:
            super().take(line)

    @on(r"INCREMENT\s+(\d{1,9})\s+SUMMARY\s*$")
    def _summary(self, line: Line, match: re.Match[str]) -> None:
        self.begin(line, (self._step, int(match[1])), anew=True, ignored=self._ignored)

    @on(r"S T E P\s+(\d{1,9})\s")
    def _new_step(self, line: Line, match: re.Match[str]) -> None:
        self._step, self._ignored = int(match[1]), ""
        self.increment = self.table = None

    @on(r".*\bSTEP\s+(\d{1,9})\s+INCREMENT\s+\d+\b|1\s*$|.*TIME COMPLETED IN THIS STEP")
    def _page(self, line: Line, match: re.Match[str]) -> None:
        # A page header can interrupt a table.
        self._step = int(match[1] or self._step)

    @on(".*LINEAR PERTURBATION STEP")
    def _perturbation(self, line: Line, match: re.Match[str]) -> None:
        self._ignored = "a perturbation step"

    @on(r"THE FOLLOWING TABLE IS PRINTED FOR (?:NODES BELONGING TO NODE SET ?(\S*)|(ALL NODES))")
    def _title(self, line: Line, match: re.Match[str]) -> None:
        self.table = None
        self._name = match[2] or match[1].upper() or "\n"  # a long name follows on the next line

    @on(r"NODE\s+FOOT-\s+(\S.*)$")
    def _header(self, line: Line, match: re.Match[str]) -> None:
        """Start a table with these columns, or continue it if it began on the previous page."""
        columns, self.table = match[1].split(), None
        if {"U1", "U2"} <= set(columns) or "RF2" in columns:
            self.open(line, self._name, columns)
        else:
            self.others.add(f"{' '.join(columns)} of {self._name}")

    def row(self, line: Line, table: NodeTable) -> None:
        """Add a row to the table, unless it counts warnings, as at the end of a file."""
        is_count = self._is_below and not all(map(NUMBER.fullmatch, line.words))
        if not table.whole and not is_count:
            table.lines.append(line)

    def other(self, line: Line, table: NodeTable) -> None:
        """Add a damaged row, or read a summary below the rows."""
        word, _, values = line.text.strip().partition(" ")
        if word.isdecimal():
            self.row(line, table)
        elif word in ("MAXIMUM", "MINIMUM", "TOTAL"):
            table.whole = True
            table.below[word] = line._replace(text=values).values(table.columns)
        elif line.text.strip() == _ALL_ZERO:
            table.whole = True
        # Other lines (NOTE, AT NODE, page headers, text below the table) hold no values.

    def filled(self, table: NodeTable, wanted: Wanted) -> pd.DataFrame:
        """Return the rows of all wanted nodes, with the zeros that Abaqus does not print.

        Raises
        ------
        MissingError
            If rows are missing and the table has no summary.
        InputError
            If a node is not in the set, or the printed extremes differ from those of the rows.
        """
        nodes = wanted.nodes
        if unknown := set(table.rows.index) - set(nodes):
            # A deck with parts numbers the nodes of instances differently.
            rule = f"is not in the deck's {table.nodes}; expected the run's deck, without parts"
            raise table.line.error(f"node {min(unknown)} {rule}")
        if (n := len(table.rows)) < len(nodes) and not table.whole:
            lack = f"a table of {table.nodes} with {n} of {len(nodes)} nodes, and no end"
            raise MissingError(lack)
        rows = table.rows.reindex(pd.Index(nodes), fill_value=0.0)
        for name, values in (("MAXIMUM", rows.max()), ("MINIMUM", rows.min())):
            for column, value in zip(table.columns, table.below.get(name, []), strict=False):
                if values[column] != value:
                    rule = f"{name} {value:g} is not that of the rows; expected whole tables"
                    raise table.line.error(f"{column} of {table.nodes}: {rule}")
        return rows
