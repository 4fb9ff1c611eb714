"""Abaqus runs: printed displacements and reaction forces of a ``.dat`` with its deck."""

import math
import re
from pathlib import Path

import numpy as np

from ridgebayes.errors import InputError
from ridgebayes.fea.deck import RunDeck
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import (
    NUMBER,
    Frame,
    Line,
    NodeTable,
    Printed,
    last_digit_of,
    on,
    read_lines,
    unused,
)

_ALL = "ALL NODES"
_ZERO = "ALL VALUES IN THIS TABLE ARE ZERO"
_MOST_DIGITS = 18  # of the number of a node
_RULE = "in global directions (no footnotes)"
_TRAILERS = ("MAXIMUM", "MINIMUM", "TOTAL")


def read_abaqus_dat(path: Path, *, deck: RunDeck) -> ContactHistory:
    """Read a run of Abaqus/Standard.

    Parameters
    ----------
    path : pathlib.Path
        The ``.dat`` file: ``*NODE PRINT`` of ``U`` on the surface's set, and of ``RF`` on the
        driven set (summed, or its total with ``TOTALS=YES``), at each increment.
    deck : RunDeck
        The run's ``.inp`` file: coordinates, sets, and the ridges' nodes.

    Returns
    -------
    ContactHistory

    Raises
    ------
    InputError
        If a file cannot be understood, with file and line; if a set is missing.

    Notes
    -----
    Abaqus leaves out rows of zeros. A node that is not there has moved by nothing where its table
    ends in a summary (``MAXIMUM``, ``TOTAL``), without which the increment is ignored.
    """
    surface, reaction = deck.surface, deck.reaction
    asked = {
        surface.upper(): set(deck.nodes),
        reaction.upper(): set(deck.driven),
        _ALL: set(deck.deck.nodes),
    }
    increments, messages = _increments(path)
    force, moved, unit = [], [], 0.0
    for one in increments:
        try:
            rim, driven = _table(one, surface, "U1", "U2"), _table(one, reaction, "RF2")
            _check_whole(rim, asked[rim.nodes])
            _check_whole(driven, asked[driven.nodes])
        except LookupError as lack:
            messages.append(f"line {one.line}: increment ignored, {lack}")
            continue
        moved.append(np.nan_to_num(rim.of(deck.nodes, "U1", "U2")))
        unit = max(unit, _last_digit(rim))
        if "TOTAL" in driven.trailers and driven.nodes == reaction.upper():
            force.append(driven.trailers["TOTAL"][driven.columns.index("RF2")])
        else:
            force.append(math.fsum(np.nan_to_num(driven.of(deck.driven, "RF2")[:, 0])))
    if not force:
        printed = {f"{' '.join(t.columns)} of {t.nodes}" for one in increments for t in one.tables}
        raise InputError(
            f"{path}: no increment with U1 and U2 of {surface} and RF2 of {reaction}; expected "
            "*NODE PRINT of U on the one and of RF on the other; the tables are "
            + (", ".join(sorted(printed)[:5]) or "none")
            + "".join(f"; {line}" for line in messages[:3])
        )
    at = deck.undeformed + np.array(moved)
    return ContactHistory(
        np.array(force),
        str(path),
        deck.provenance(path, "abaqus-dat"),
        "abaqus",
        at[..., 0],
        at[..., 1],
        undeformed=deck.undeformed,
        rigid=deck.rigid,
        digits=unit / 2,
        messages=(f"{path}: {len(force)} increments with {surface} and {reaction}", *messages),
    )


def _table(increment: Frame, nodes: str, *columns: str) -> NodeTable:
    """Return the table of a set, or else of all nodes, that has some columns; or LookupError."""
    if increment.ignored:
        raise LookupError(increment.ignored)
    for name in (nodes.upper(), _ALL):
        for one in increment.tables:
            if one.nodes == name and one.has(*columns):
                return one
    raise LookupError(f"{' and '.join(columns)} of {nodes} missing")


def _check_whole(table: NodeTable, nodes: set[int]) -> None:
    """Refuse a table that contradicts itself; LookupError if something of it is missing."""
    rows = table.rows
    if strange := set(rows.nodes.tolist()) - nodes:
        # Numbers of an assembly's instances are not those of the deck's parts.
        raise table.line.error(
            f"node {min(strange)} is not in the deck's "
            f"{table.nodes}; expected the deck of this run, without parts and instances"
        )
    missing = len(nodes) - len(rows.nodes)
    if missing and not table.whole:
        raise LookupError(
            f"a table of {table.nodes} with {len(rows.nodes)} of {len(nodes)} nodes, and no end"
        )
    zeros = np.zeros((int(missing > 0 or not nodes), len(table.columns)))
    values = np.vstack([rows.values, zeros])
    for name, pick in (("MAXIMUM", np.max), ("MINIMUM", np.min)):
        for i, value in enumerate(table.trailers.get(name, ())):
            if pick(values[:, i]) != value:
                raise table.line.error(
                    f"{table.columns[i]} of {table.nodes}: {name} {value:g} is not that of the "
                    "rows; expected whole tables"
                )


def _last_digit(rim: NodeTable) -> float:
    """Return what the last digit of the largest displacement is worth."""
    size = np.abs(rim.rows.values)
    if not size.any():
        return 0.0
    row, column = np.unravel_index(np.argmax(size), size.shape)
    return last_digit_of(rim.lines[int(row)].words[1 + int(column)])


def _increments(path: Path) -> tuple[list[Frame], list[str]]:
    """Return the increments of a file in its order; one printed again counts once, as last."""
    reader = _Dat()
    lines = read_lines(path, unfinished=True)
    cut = lines[-1].number if lines and not lines[-1].ended else 0
    for line in lines:
        if line.text.strip() and line.number != cut:
            reader.take(line)
        elif reader.table is not None and reader.table.lines:
            reader.table.below = True
    found = reader.found
    messages = unused(reader.others)
    if reader.repeated:
        messages.append(f"{reader.repeated} increments printed again: the later one counts")
    if cut and found:
        messages.append(f"line {cut} ignored: the last one, and without an end")
    return list(found.values()), messages


class _Dat(Printed):
    """Increments of a run."""

    def __init__(self) -> None:
        super().__init__()
        self.repeated, self._step, self._ignored = 0, 0, ""
        self._is_name = False  # whether the next line is the long name of a set

    def take(self, line: Line) -> None:
        """Read a line that is not blank."""
        if self._is_name:
            self._is_name, self.table = False, NodeTable(line, line.words[0].upper(), _RULE)
        else:
            super().take(line)

    @on(r"INCREMENT\s+(\d{1,9})\s+SUMMARY\s*$")
    def _summary(self, line: Line, match: re.Match[str]) -> None:
        key = (self._step, int(match[1]))
        self.repeated += key in self.found
        self.found.pop(key, None)
        self.frame = self.found[key] = Frame(line.number, ignored=self._ignored)
        self.table = None

    @on(r"S T E P\s+(\d{1,9})\s")
    def _new_step(self, line: Line, match: re.Match[str]) -> None:
        self._step, self._ignored = int(match[1]), ""
        self.frame = self.table = None

    @on(r".*\bSTEP\s+(\d{1,9})\s+INCREMENT\s+\d+\b|1\s*$|.*TIME COMPLETED IN THIS STEP")
    def _page(self, line: Line, match: re.Match[str]) -> None:
        # A page's head; it may stand in the middle of a table.
        self._step = int(match[1] or self._step)

    @on(".*LINEAR PERTURBATION STEP")
    def _perturbation(self, line: Line, match: re.Match[str]) -> None:
        self._ignored = "a perturbation step"

    @on(
        r"THE FOLLOWING TABLE IS PRINTED FOR (?:(ALL NODES)|NODES BELONGING TO NODE SET ?(\S*))\s*$"
    )
    def _title(self, line: Line, match: re.Match[str]) -> None:
        name = _ALL if match[1] else match[2].upper()
        self._is_name, self.table = not name, NodeTable(line, name, _RULE) if name else None

    @on(r"NODE\s+FOOT-\s+(\S.*)$")
    def _header(self, line: Line, match: re.Match[str]) -> None:
        """Take the columns of a table, and go on with it if it began on the page before."""
        if (table := self.table) is None:
            return
        table.columns, self.table = match[1].split(), None
        if not table.has("U1", "U2") and not table.has("RF2"):
            self.others.add(f"{' '.join(table.columns)} of {table.nodes}")
            return
        if self.frame is None:
            raise line.error("a table before its increment; expected INCREMENT n SUMMARY first")
        for one in self.frame.tables:
            if (one.nodes, one.columns) == (table.nodes, table.columns) and not one.whole:
                self.table = one
                return
        self.frame.tables.append(table)
        self.table = table

    def row(self, line: Line, table: NodeTable) -> None:
        """Take a row, or what stands below the rows."""
        words = line.words
        is_row = words[0].isascii() and words[0].isdecimal() and len(words[0]) <= _MOST_DIGITS
        if not table.columns or words[0] == "AT" or (is_row and table.whole):
            return
        if is_row:
            if not table.below or all(NUMBER.fullmatch(word) for word in words):
                # Else counts of messages at the end of the file.
                table.lines.append(line)
        elif words[0] in _TRAILERS:
            values = [line.finite(word) for word in words[1:]]
            if len(values) != len(table.columns):
                raise line.error(f"{len(values)} values; expected {len(table.columns)}")
            table.whole = True
            table.trailers[words[0]] = values
        elif " ".join(words) == _ZERO:
            table.whole = True
        # Else NOTE below the header, a page's head, or what follows the table.
