"""Abaqus runs: printed displacements and reaction forces of a ``.dat`` with its deck."""

import math
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ridgebayes.errors import InputError
from ridgebayes.fea.deck import check_material, read_deck, rigid_nodes
from ridgebayes.fea.levels import Body, Levels, table_of
from ridgebayes.fea.record import NUMBER, Imported, finite, provenance
from ridgebayes.runtime.reading import read_text

_SUMMARY = re.compile(r"\s*INCREMENT\s+(\d{1,9})\s+SUMMARY\s*$")
_STEP = re.compile(r"\s*S T E P\s+(\d{1,9})\s")
_PAGE = re.compile(r".*\bSTEP\s+(\d{1,9})\s+INCREMENT\s+\d+\b")
_ALL = "ALL NODES"
_TABLE = re.compile(
    r"\s*THE FOLLOWING TABLE IS PRINTED FOR (?:(ALL NODES)|NODES BELONGING TO NODE SET ?(\S*))\s*$"
)
_HEADER = re.compile(r"\s*NODE\s+FOOT-\s+(\S.*)$")
_ZERO = "ALL VALUES IN THIS TABLE ARE ZERO"
_EXTREMES = ("MAXIMUM", "MINIMUM")
_TRAILERS = (*_EXTREMES, "AT", "TOTAL")


@dataclass
class _Table:
    """One printed table: rows that are all zero are left out of it."""

    line: int
    nodes: str
    columns: tuple[str, ...] = ()
    rows: dict[int, tuple[float, ...]] = field(default_factory=dict)
    total: tuple[float, ...] | None = None
    extremes: dict[str, tuple[float, ...]] = field(default_factory=dict)
    zero: bool = False
    below: bool = False  # whether a blank line came after rows
    unit: float = 0.0  # of the last printed digit, the coarsest of the rows

    @property
    def whole(self) -> bool:
        """Whether its end was printed, so that rows not there are rows of zeros."""
        return self.zero or bool(self.extremes) or self.total is not None

    def has(self, *names: str) -> bool:
        return all(name in self.columns for name in names)

    def of(self, node: int, *names: str) -> tuple[float, ...]:
        row = self.rows.get(node)
        return tuple(0.0 if row is None else row[self.columns.index(name)] for name in names)


@dataclass
class _Increment:
    """What was printed of one increment."""

    line: int
    tables: list[_Table] = field(default_factory=list)
    perturbation: bool = False


def read_abaqus_dat(
    path: Path,
    body: Body,
    *,
    deck: Path,
    surface: str,
    reaction: str,
    brackets: bool = False,
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
        As `ridgebayes.fea.increments.transitions_of`.

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
    ends in a summary (``MAXIMUM``, ``TOTAL``), without which the level is left out.
    """
    sheet = read_deck(deck)
    nodes = list(dict.fromkeys(sheet.nodes_of(surface, str(deck))))
    driven = dict.fromkeys(sheet.nodes_of(reaction, str(deck)))
    asked = {surface.upper(): set(nodes), reaction.upper(): set(driven), _ALL: set(sheet.nodes)}
    undeformed = sheet.coordinates(nodes, str(deck))
    increments, said = _increments(path)
    force, moved, unit = [], [], 0.0
    for one in increments:
        rim, pushed = _table(one, surface, "U1", "U2"), _table(one, reaction, "RF2")
        if one.perturbation:
            said.append(f"line {one.line}: a perturbation step: left out")
        elif rim is None or pushed is None:
            what = f"U1 and U2 of {surface}" if rim is None else f"RF2 of {reaction}"
            said.append(f"line {one.line}: an increment without {what}: left out")
        elif short := _short(path, rim, asked) or _short(path, pushed, asked):
            said.append(f"line {one.line}: {short}: left out")
        else:
            moved.append([rim.of(node, "U1", "U2") for node in nodes])
            unit = max(unit, rim.unit)
            if pushed.total is not None and pushed.nodes == reaction.upper():
                force.append(pushed.total[pushed.columns.index("RF2")])
            else:
                force.append(math.fsum(pushed.of(node, "RF2")[0] for node in driven))
    if not force:
        printed = {f"{' '.join(t.columns)} of {t.nodes}" for one in increments for t in one.tables}
        raise InputError(
            f"{path}: no increment with U1 and U2 of {surface} and RF2 of {reaction}; expected "
            "*NODE PRINT of U on the one and of RF on the other; the tables are "
            + (", ".join(sorted(printed)[:5]) or "none")
            + "".join(f"; {line}" for line in said[:3])
        )
    position = undeformed + np.array(moved)
    check_material(sheet, body.E, body.nu, deck)
    levels = Levels(
        np.array(force),
        undeformed,
        position,
        sheet.coordinates(rigid_nodes(sheet, nodes), str(deck)),
        digits=unit / 2,
        said=(f"{path}: {len(force)} increments with {surface} and {reaction}", *said),
    )
    source = provenance(
        path, "abaqus-dat", f"deck={deck.name}", f"surface={surface}", f"reaction={reaction}"
    )
    return table_of(
        levels, body, where=str(path), solver="abaqus", source=source, brackets=brackets
    )


def _table(increment: _Increment, nodes: str, *columns: str) -> _Table | None:
    """Return the table of a set, or else of all nodes, that has some columns."""
    for name in (nodes.upper(), _ALL):
        for one in increment.tables:
            if one.nodes == name and one.has(*columns):
                return one
    return None


def _short(path: Path, table: _Table, asked: dict[str, set[int]]) -> str:
    """Return what is missing of a table, or nothing; refuse one that contradicts itself."""
    nodes = asked[table.nodes]
    if strange := table.rows.keys() - nodes:
        # Numbers of an assembly's instances are not those of the deck's parts.
        raise InputError(
            f"{path}, line {table.line}: node {min(strange)} is not in the deck's "
            f"{table.nodes}; expected the deck of this run, without parts and instances"
        )
    missing = len(nodes) - len(table.rows)
    if missing and not table.whole:
        return f"a table of {table.nodes} with {len(table.rows)} of {len(nodes)} nodes, and no end"
    for name, printed in table.extremes.items():
        found = list(table.rows.values())
        if missing or not found:
            found.append((0.0,) * len(table.columns))
        pick = max if name == "MAXIMUM" else min
        for column, value in enumerate(printed):
            if pick(row[column] for row in found) != value:
                raise InputError(
                    f"{path}, line {table.line}: {table.columns[column]} of {table.nodes}: "
                    f"{name} {value:g} is not that of the rows; expected whole tables"
                )
    return ""


def _increments(path: Path) -> tuple[list[_Increment], list[str]]:
    """Return the increments of a file in its order; one printed again counts once, as last."""
    found: dict[tuple[int, int], _Increment] = {}
    step, perturbation, repeated, others = 0, False, 0, set[str]()
    increment: _Increment | None = None
    table: _Table | None = None
    wrapped = False
    lines = read_text(path).split("\n")
    cut = len(lines) if lines[-1] else 0  # a last line without an end may be half of one
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if not words or number == cut:
            if table is not None and table.rows:
                table.below = True
            continue
        if wrapped:
            # A long name stands on the next line.
            wrapped, table = False, _Table(number, words[0].upper())
        elif (match := _SUMMARY.match(line)) is not None:
            key = (step, int(match[1]))
            repeated += key in found
            found.pop(key, None)
            increment, table = _Increment(number, perturbation=perturbation), None
            found[key] = increment
        elif (match := _STEP.match(line)) is not None:
            step, perturbation, increment, table = int(match[1]), False, None, None
        elif (match := _PAGE.match(line)) is not None:
            # A page's head; it may stand in the middle of a table.
            step = int(match[1])
        elif words == ["1"] or "TIME COMPLETED IN THIS STEP" in line:
            pass  # the other lines of that head
        elif "LINEAR PERTURBATION STEP" in line:
            perturbation = True
        elif (match := _TABLE.match(line)) is not None:
            name = _ALL if match[1] else match[2].upper()
            wrapped, table = not name, _Table(number, name) if name else None
        elif (match := _HEADER.match(line)) is not None and table is not None:
            table.columns = tuple(match[1].split())
            table = _opened(path, number, increment, table, others)
        elif table is not None and table.columns:
            _row(path, number, words, table)
    said = [f"not used: {', '.join(sorted(others))}"] if others else []
    if repeated:
        said.append(f"{repeated} increments printed again: the later one counts")
    if cut and found:
        said.append(f"line {cut}: the last one, without an end: not read")
    return list(found.values()), said


def _opened(
    path: Path, number: int, increment: _Increment | None, table: _Table, others: set[str]
) -> _Table | None:
    """Return the table that rows below a header belong to."""
    if not table.has("U1", "U2") and not table.has("RF2"):
        others.add(f"{' '.join(table.columns)} of {table.nodes}")
        return None
    if increment is None:
        raise InputError(
            f"{path}, line {number}: a table before its increment; expected INCREMENT n SUMMARY "
            "first"
        )
    for one in increment.tables:
        # A new page begins: the table goes on.
        if (one.nodes, one.columns) == (table.nodes, table.columns) and not one.whole:
            return one
    increment.tables.append(table)
    return table


def _row(path: Path, number: int, words: list[str], table: _Table) -> None:
    if words[0] in _TRAILERS:
        if words[0] != "AT":
            values = tuple(finite(path, number, word) for word in words[1:])
            if len(values) != len(table.columns):
                raise InputError(
                    f"{path}, line {number}: {len(values)} values; expected {len(table.columns)}"
                )
            if words[0] == "TOTAL":
                table.total = values
            else:
                table.extremes[words[0]] = values
        return
    if " ".join(words) == _ZERO:
        table.zero = True
        return
    if not (words[0].isascii() and words[0].isdigit() and len(words[0]) < 19) or table.whole:
        return  # NOTE below the header, a page's head, or what follows the table
    if table.below and not all(NUMBER.fullmatch(word) for word in words):
        return  # counts of messages at the end of the file
    if len(words) != len(table.columns) + 1:
        raise InputError(
            f"{path}, line {number}: {' '.join(words)[:60]!r}; expected node, "
            f"{', '.join(table.columns)}, in global directions (no footnotes)"
        )
    node = int(words[0])
    if node in table.rows:
        raise InputError(f"{path}, line {number}: node {node}: expected once a table")
    table.rows[node] = tuple(finite(path, number, word) for word in words[1:])
    for name, word, value in zip(table.columns, words[1:], table.rows[node], strict=True):
        if name in ("U1", "U2") and value:
            table.unit = max(table.unit, _last_digit(word))


def _last_digit(word: str) -> float:
    """Return the unit of a number's last printed digit: 0.001 of 1.234, 1e-7 of 1.2345E-03."""
    match = NUMBER.fullmatch(word)
    if match is None:
        return 0.0
    decimals = len(match[1].partition(".")[2])
    return float(f"1e{int(match[2] or match[3] or 0) - decimals}")
