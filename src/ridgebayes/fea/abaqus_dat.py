"""Abaqus runs: printed displacements and reaction forces of a ``.dat`` with its deck."""

import math
import re
from pathlib import Path

import numpy as np

from ridgebayes.errors import InputError
from ridgebayes.fea.deck import RunDeck
from ridgebayes.fea.lines import (
    NUMBER,
    Frame,
    Line,
    NodeTable,
    handled,
    is_label,
    read_lines,
    unused,
)
from ridgebayes.fea.record import Imported
from ridgebayes.fea.surface import Body, Origin, SurfaceHistory, table_from_history

_SUMMARY = re.compile(r"\s*INCREMENT\s+(\d{1,9})\s+SUMMARY\s*$")
_STEP = re.compile(r"\s*S T E P\s+(\d{1,9})\s")
_PAGE = re.compile(r".*\bSTEP\s+(\d{1,9})\s+INCREMENT\s+\d+\b")
_PAGE_REST = re.compile(r"\s*1\s*$|.*TIME COMPLETED IN THIS STEP")
_PERTURBATION = re.compile(".*LINEAR PERTURBATION STEP")
_ALL = "ALL NODES"
_TABLE = re.compile(
    r"\s*THE FOLLOWING TABLE IS PRINTED FOR (?:(ALL NODES)|NODES BELONGING TO NODE SET ?(\S*))\s*$"
)
_HEADER = re.compile(r"\s*NODE\s+FOOT-\s+(\S.*)$")
_ZERO = "ALL VALUES IN THIS TABLE ARE ZERO"
_EXTREMES = ("MAXIMUM", "MINIMUM")
_TRAILERS = (*_EXTREMES, "AT", "TOTAL")


def read_abaqus_dat(
    path: Path, body: Body, *, deck: Path, surface: str, reaction: str, brackets: bool = False
) -> Imported:
    """Read a run of Abaqus/Standard.

    Parameters
    ----------
    path : pathlib.Path
        The ``.dat`` file: ``*NODE PRINT`` of ``U`` on the surface's set, and of ``RF`` on the
        driven set (summed, or its total with ``TOTALS=YES``), at each increment.
    body : Body
        What the files do not say.
    deck : pathlib.Path
        The run's ``.inp`` file: coordinates, sets, and the ridges' nodes.
    surface, reaction : str
        Node sets: the body's rim, and where the load is read.
    brackets : bool, optional
        As `ridgebayes.fea.transitions.transitions_of`.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        If a file cannot be understood, with file and line; if a set is missing.

    Notes
    -----
    Abaqus leaves out rows of zeros. A node that is not there has moved by nothing where its table
    ends in a summary (``MAXIMUM``, ``TOTAL``), without which the increment is ignored.
    """
    run = RunDeck.read(deck, surface, reaction, E=body.E, nu=body.nu)
    asked = {
        surface.upper(): set(run.nodes),
        reaction.upper(): set(run.driven),
        _ALL: set(run.deck.nodes),
    }
    increments, messages = _increments(path)
    force, moved, unit = [], [], 0.0
    for one in increments:
        rim, driven = _table(one, surface, "U1", "U2"), _table(one, reaction, "RF2")
        if one.ignored:
            messages.append(f"line {one.line}: increment ignored, {one.ignored}")
        elif rim is None or driven is None:
            what = f"U1 and U2 of {surface}" if rim is None else f"RF2 of {reaction}"
            messages.append(f"line {one.line}: increment ignored, {what} missing")
        elif short := _short(rim, asked) or _short(driven, asked):
            messages.append(f"line {one.line}: increment ignored, {short}")
        else:
            moved.append(rim.of(run.nodes, "U1", "U2"))
            unit = max(unit, rim.unit)
            if driven.total and driven.nodes == reaction.upper():
                force.append(driven.total[driven.columns.index("RF2")])
            else:
                force.append(math.fsum(driven.of(run.driven, "RF2")[:, 0]))
    if not force:
        printed = {f"{' '.join(t.columns)} of {t.nodes}" for one in increments for t in one.tables}
        raise InputError(
            f"{path}: no increment with U1 and U2 of {surface} and RF2 of {reaction}; expected "
            "*NODE PRINT of U on the one and of RF on the other; the tables are "
            + (", ".join(sorted(printed)[:5]) or "none")
            + "".join(f"; {line}" for line in messages[:3])
        )
    history = SurfaceHistory(
        np.array(force),
        run.undeformed,
        run.undeformed + np.array(moved),
        run.rigid,
        digits=unit / 2,
        messages=(f"{path}: {len(force)} increments with {surface} and {reaction}", *messages),
    )
    origin = Origin(str(path), "abaqus", run.provenance(path, "abaqus-dat"))
    return table_from_history(history, body, origin, brackets=brackets)


def _table(increment: Frame, nodes: str, *columns: str) -> NodeTable | None:
    """Return the table of a set, or else of all nodes, that has some columns."""
    for name in (nodes.upper(), _ALL):
        for one in increment.tables:
            if one.nodes == name and one.has(*columns):
                return one
    return None


def _short(table: NodeTable, asked: dict[str, set[int]]) -> str:
    """Return what is missing of a table, or nothing; refuse one that contradicts itself."""
    nodes = asked[table.nodes]
    if strange := table.rows.keys() - nodes:
        # Numbers of an assembly's instances are not those of the deck's parts.
        raise table.line.error(
            f"node {min(strange)} is not in the deck's "
            f"{table.nodes}; expected the deck of this run, without parts and instances"
        )
    missing = len(nodes) - len(table.rows)
    if missing and not table.whole:
        return f"a table of {table.nodes} with {len(table.rows)} of {len(nodes)} nodes, and no end"
    for name, printed in table.extremes.items():
        found = list(table.rows.values())
        if missing or not found:
            found.append([0.0] * len(table.columns))
        pick = max if name == "MAXIMUM" else min
        for column, value in enumerate(printed):
            if pick(row[column] for row in found) != value:
                raise table.line.error(
                    f"{table.columns[column]} of {table.nodes}: "
                    f"{name} {value:g} is not that of the rows; expected whole tables"
                )
    return ""


def _increments(path: Path) -> tuple[list[Frame], list[str]]:
    """Return the increments of a file in its order; one printed again counts once, as last."""
    reader = _Dat()
    lines = read_lines(path, unfinished=True)
    cut = lines[-1].number if lines and not lines[-1].ended else 0
    for line in lines:
        if line.words and line.number != cut:
            reader.take(line)
        elif reader.table is not None and reader.table.rows:
            reader.table.below = True
    found = reader.found
    messages = unused(reader.others)
    if reader.repeated:
        messages.append(f"{reader.repeated} increments printed again: the later one counts")
    if cut and found:
        messages.append(f"line {cut} ignored: the last one, and without an end")
    return list(found.values()), messages


class _Dat:
    """What has been read of a file: increments, and the table that lines belong to."""

    def __init__(self) -> None:
        self.found: dict[tuple[int, int], Frame] = {}
        self.others: set[str] = set()
        self.repeated = 0
        self.table: NodeTable | None = None
        self._step, self._ignored = 0, ""
        self._increment: Frame | None = None
        self._is_name = False  # whether the next line is the long name of a set
        self._kinds = (
            (_SUMMARY, self._summary),
            (_STEP, self._new_step),
            (_PAGE, self._page),
            (_PAGE_REST, lambda line, match: None),
            (_PERTURBATION, lambda line, match: setattr(self, "_ignored", "a perturbation step")),
            (_TABLE, self._title),
            (_HEADER, self._header),
        )

    def take(self, line: Line) -> None:
        """Read a line that is not blank."""
        if self._is_name:
            self._is_name, self.table = False, NodeTable(line, line.words[0].upper())
            return
        if not handled(line, self._kinds) and self.table is not None and self.table.columns:
            _row(line, self.table)

    def _summary(self, line: Line, match: re.Match[str]) -> None:
        key = (self._step, int(match[1]))
        self.repeated += key in self.found
        self.found.pop(key, None)
        self._increment = Frame(line.number, ignored=self._ignored)
        self.found[key], self.table = self._increment, None

    def _new_step(self, line: Line, match: re.Match[str]) -> None:
        self._step, self._ignored = int(match[1]), ""
        self._increment = self.table = None

    def _page(self, line: Line, match: re.Match[str]) -> None:
        # A page's head; it may stand in the middle of a table.
        self._step = int(match[1])

    def _title(self, line: Line, match: re.Match[str]) -> None:
        name = _ALL if match[1] else match[2].upper()
        self._is_name, self.table = not name, NodeTable(line, name) if name else None

    def _header(self, line: Line, match: re.Match[str]) -> None:
        """Take the columns of a table, and go on with it if it began on the page before."""
        if (table := self.table) is None:
            return
        table.columns, self.table = match[1].split(), None
        if not table.has("U1", "U2") and not table.has("RF2"):
            self.others.add(f"{' '.join(table.columns)} of {table.nodes}")
            return
        if self._increment is None:
            raise line.error("a table before its increment; expected INCREMENT n SUMMARY first")
        for one in self._increment.tables:
            if (one.nodes, one.columns) == (table.nodes, table.columns) and not one.whole:
                self.table = one
                return
        self._increment.tables.append(table)
        self.table = table


def _row(line: Line, table: NodeTable) -> None:
    words = line.words
    if words[0] in _TRAILERS:
        if words[0] != "AT":
            values = [line.finite(word) for word in words[1:]]
            if len(values) != len(table.columns):
                raise line.error(f"{len(values)} values; expected {len(table.columns)}")
            table.whole = True
            if words[0] == "TOTAL":
                table.total = values
            else:
                table.extremes[words[0]] = values
        return
    if " ".join(words) == _ZERO:
        table.whole = True
        return
    if not is_label(words[0]) or table.whole:
        return  # NOTE below the header, a page's head, or what follows the table
    if table.below and not all(NUMBER.fullmatch(word) for word in words):
        return  # counts of messages at the end of the file
    if len(words) != len(table.columns) + 1:
        raise line.unexpected(
            f"node, {', '.join(table.columns)}, in global directions (no footnotes)"
        )
    node = line.node(words[0], table.rows)
    table.rows[node] = [line.finite(word) for word in words[1:]]
    for name, word, value in zip(table.columns, words[1:], table.rows[node], strict=True):
        if name in ("U1", "U2") and value and (match := NUMBER.fullmatch(word)):
            # The unit of the last printed digit: 0.001 of 1.234, 1e-7 of 1.2345E-03.
            decimals = len(match[1].partition(".")[2])
            unit = float(f"1e{int(match[2] or match[3] or 0) - decimals}")
            table.unit = max(table.unit, unit)
