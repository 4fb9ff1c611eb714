"""Readers for Abaqus: the ``.dat`` of a run with its deck, and field reports (``.rpt``)."""

import re
from pathlib import Path

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.deck import Run
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import NUMBER, Line, last_digit_of
from ridgebayes.fea.printed import Increment, MissingError, NodeTable, Printed, on
from ridgebayes.fea.record import SHOWN
from ridgebayes.runtime.text import some_of

_ALL_ZERO = "ALL VALUES IN THIS TABLE ARE ZERO"
_DASHES = re.compile(r"\s*-{9,}\s*$")
_COLUMN_GAP = re.compile(r"\s{2,}")  # column names contain single blanks
# Tolerance for rounded printed values, relative to the sum of absolute forces or to the largest
# displacement.
_PRINTED_RTOL = 1e-4
_U, _COORD, _RF = ("U.U1", "U.U2"), ("COORD.COOR1", "COORD.COOR2"), "RF.RF2"


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
    printed = _Tables("in global directions (no footnotes)").read(run.path, unfinished=True)
    digits = [0.0]

    def state(increment: Increment) -> tuple[float, FloatArray]:
        rim = increment.table(("U1", "U2"), surface)
        digits.append(_last_digit(rim))
        forces = increment.table(("RF2",), reaction)
        _fill(rim, nodes)
        _fill(forces, driven)
        return forces.force(driven, "RF2"), rim.of(nodes, "U1", "U2")

    rule = f"expected *NODE PRINT of both; the tables are {printed.shown}"
    required = f"U1 and U2 of {surface}, RF2 of {reaction}; {rule}"
    load, moved = printed.states(state, run.path, required)
    places = run.places(nodes)
    at = places["undeformed"] + np.array(moved)
    return ContactHistory(load, at, digits=max(digits) / 2, messages=printed.messages, **places)


def _fill(table: NodeTable, nodes: list[int]) -> None:
    """Add the rows of zeros that Abaqus does not print.

    Raises
    ------
    MissingError
        If rows are missing and the table has no summary.
    InputError
        If a node is not in the set, or the printed extremes differ from those of the rows.
    """
    rows, n = table.rows, len(table.rows)
    if unknown := set(rows.index) - set(nodes):
        # A deck with parts numbers the nodes of instances differently.
        rule = f"is not in the deck's {table.nodes}; expected the run's deck, without parts"
        raise table.line.error(f"node {min(unknown)} {rule}")
    if n < len(nodes) and not table.whole:
        raise MissingError(f"a table of {table.nodes} with {n} of {len(nodes)} nodes, and no end")
    table.rows = rows.reindex(nodes, fill_value=0.0)
    for name, values in (("MAXIMUM", table.rows.max()), ("MINIMUM", table.rows.min())):
        for column, value in zip(table.columns, table.below.get(name, ()), strict=False):
            if values[column] != value:
                rule = f"{name} {value:g} is not that of the rows; expected whole tables"
                raise table.line.error(f"{column} of {table.nodes}: {rule}")


def _last_digit(rim: NodeTable) -> float:
    """Return the value of the last printed digit of the largest displacement."""
    size = rim.rows.abs().to_numpy()
    if not size.any():
        return 0.0
    row, column = np.unravel_index(size.argmax(), size.shape)
    return last_digit_of(rim.lines[row].words[1 + column])


class _Tables(Printed):
    """Parser of a ``.dat`` file."""

    def __init__(self, rule: str) -> None:
        super().__init__(rule)
        self._step, self._ignored = 0, ""
        self._name = ""  # node set of the next table
        self._is_below = False  # whether a blank line followed the rows

    @property
    def shown(self) -> str:
        """Names of the tables in the file, for messages."""
        names = {f"{' '.join(table.columns)} of {table.nodes}" for table in self.tables}
        return some_of(sorted(names), SHOWN) or "none"

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
        """Add a row to the table."""
        if not table.whole and not (self._is_below and self._is_count(line)):
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

    def _is_count(self, line: Line) -> bool:
        """Return whether the line counts warnings, as at the end of a file, and is not a row."""
        return self._is_below and not all(NUMBER.fullmatch(word) for word in line.words)


def read_abaqus_rpt(run: Run) -> ContactHistory:
    """Read a file of Abaqus/Viewer field output reports.

    Parameters
    ----------
    run : Run
        One ``.rpt`` file with, in each frame, nodal ``U.U1`` and ``U.U2`` of the rim and ``RF.RF2``
        of the driven nodes. Without a deck, also ``COORD.COOR1`` and ``COORD.COOR2`` of the rim.
        The facts `surface` and `reaction` are regions of the report (``PART-1-1.RIM`` or ``RIM``)
        or node sets of the deck; without them, the only region with the columns is used. Without a
        deck, the height of the ridges' tops is unknown.

    Returns
    -------
    ContactHistory

    Raises
    ------
    InputError
        If a line cannot be parsed (the message names it), or a region is missing.

    Notes
    -----
    ``COORD`` holds deformed or undeformed coordinates, depending on the step's ``NLGEOM``. The
    reader uses the interpretation for which undeformed coordinates agree in all frames.
    """
    (surface, reaction), has_deck = run.sets, bool(run.deck.nodes)
    printed = _Report("averaged where elements meet").read(run.path)
    columns = _U if has_deck else _COORD + _U
    sets = [run.deck.nsets.get(name.upper(), []) for name in run.sets]
    nodes, driven = (list(dict.fromkeys(numbers)) for numbers in sets)
    digits = []

    def state(increment: Increment) -> tuple[float, FloatArray]:
        # A set of the deck may be part of a larger region.
        rim = increment.table(columns, surface, *[""] * bool(nodes))
        forces = increment.table((_RF,), reaction, *[""] * bool(driven))
        nodes[:] = nodes or rim.rows.index.tolist()
        digits.append(_digits(rim))
        return _force(forces, driven), rim.of(nodes, *columns)

    required = f"{', '.join(columns)} and {_RF}; expected nodal output of both in a field report"
    load, states = printed.states(state, run.path, required)
    moved = np.array(states)[..., -2:]
    if has_deck:
        places = run.places(nodes)
    else:
        undeformed, how = _undeformed(run.path, np.array(states)[..., :2], moved)
        places = {"undeformed": undeformed, "rigid": np.zeros((0, 2))}
        printed.messages.append(how)
    rounding = 0.5 * 10.0 ** (1 - max(digits)) * float(np.abs(moved).max())
    at = places["undeformed"] + moved
    return ContactHistory(load, at, digits=rounding, messages=printed.messages, **places)


class _Report(Printed):
    """Parser of a file with one or more reports."""

    def __init__(self, rule: str) -> None:
        super().__init__(rule)
        self._steps: dict[str, int] = {}
        self._database = self._step = ""
        self._header: list[str] = []
        self._pending: list[str] = []  # first words of a row that is wrapped over several lines

    @on(r"(ODB: .*\S)")
    def _run(self, line: Line, match: re.Match[str]) -> None:
        self.increment = self.table = None
        if self._database not in ("", match[1]):
            raise line.error(f"{match[1]}, and above {self._database}; expected one run")
        self._database = match[1]

    @on(r"Step: (.*\S)")
    def _new_step(self, line: Line, match: re.Match[str]) -> None:
        self._step = match[1]

    @on(r"(Frame: (?:Increment\s+(\d{1,9}): Step Time =\s*(\S+)|.*\S))")
    def _new_frame(self, line: Line, match: re.Match[str]) -> None:
        if match[2] is None:
            self.increment = None
            self.others.add(match[1])
            return
        line.finite(match[3])
        self.begin(line, (self._steps.setdefault(self._step, len(self._steps)), int(match[2])))

    @on(r"Field Output reported at(?: nodes for (?:part|region): (.*\S))?")
    def _region(self, line: Line, match: re.Match[str]) -> None:
        self._header, self._pending, self.table = [], [], None
        if match[1] is None:
            self.others.add(line.text.strip())
        elif self.increment is not None:
            self.table = NodeTable(line, match[1], rule=self._rule)

    def blank(self) -> None:
        """End the header or the rows of a table; a table that is cut off does not count."""
        if self._pending:
            return
        if self.table is None or not self.table.lines:
            self._header = []
        elif self.increment is not None and not self.table.whole:
            self.table.whole = True
            self.increment.tables.append(self.table)

    def row(self, line: Line, table: NodeTable) -> None:
        """Parse a line of a table: a header, a row or part of a row, or a summary."""
        text = line.text.strip()
        if _DASHES.match(text):
            # A table with wrapped rows has a second header for their second lines.
            names = _COLUMN_GAP.split(self._header[0]) if self._header else []
            table.columns += names[names[:1] in (["Node"], ["Node Label"]) :]
            self._header = []
        elif not (table.lines or self._pending or (table.columns and text[0].isdigit())):
            self._header.append(text)
        elif text[0].isalpha():
            self.blank()
            if text.startswith("Total"):
                table.below["Total"] = [line.finite(word) for word in line.words[1:]]
        elif not table.whole:
            self._pending += line.words
            if len(self._pending) > len(table.columns):
                table.lines.append(line._replace(text=" ".join(self._pending)))
                self._pending = []


def _digits(table: NodeTable) -> int:
    """Return the largest number of digits in a table, since trailing zeros are not printed."""
    words = (word for line in table.lines for word in line.words[1:])
    return max(len(re.sub(r"[EeDd].*|[-+.]", "", word).lstrip("0")) for word in words)


def _force(table: NodeTable, nodes: list[int]) -> float:
    """Return the sum of RF2; refuse a sum that differs from the printed total or cancels to 0."""
    driven, what = nodes or table.rows.index.tolist(), f"{_RF} of {table.nodes}"
    force, size = table.force(driven, _RF), float(table.rows[_RF].reindex(driven).abs().sum())
    totals = dict(zip(table.columns, table.below.get("Total", []), strict=False))
    total = totals.get(_RF, force) if len(driven) == len(table.lines) else force
    if abs(total - force) > _PRINTED_RTOL * size:
        sums = f"adds up to {force:.6g}, and the total is {total:.6g}"
        raise table.line.error(f"{what} {sums}; expected whole tables")
    if size > 0 and abs(force) < _PRINTED_RTOL * size:
        raise table.line.error(f"{what} cancels to {force:.3g}; expected the driven nodes alone")
    return force


def _undeformed(path: Path, at: FloatArray, moved: FloatArray) -> tuple[FloatArray, str]:
    """Return undeformed coordinates, and whether COORD holds deformed or undeformed positions."""
    largest = float(np.abs(moved).max())
    bases = {"undeformed": at, "deformed": at - moved}
    spread = {name: float(np.ptp(base, axis=0).max()) for name, base in bases.items()}
    digits = 1e-5 * float(np.abs(at).max())
    how = min(spread, key=lambda name: spread[name])
    if len(at) < 2 or spread[how] > _PRINTED_RTOL * largest + digits or largest < 10 * digits:
        changes = f"COORD by {spread['undeformed']:.3g} and COORD - U by {spread['deformed']:.3g}"
        rule = f"change between {len(at)} frames; expected one of the two to stay, or --deck"
        raise InputError(f"{path}: {changes} {rule}")
    base = at[0] if how == "undeformed" else np.median(at - moved, axis=0)
    return np.asarray(base, dtype=float), f"COORD: coordinates of {how} nodes"
