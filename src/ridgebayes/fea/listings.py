"""Readers for log data of FEBio and for listings of ANSYS: values of nodes at each step."""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from ridgebayes._types import IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.deck import Run
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import Line
from ridgebayes.fea.printed import MissingError, NodeTable, Printed, Wanted, on
from ridgebayes.fea.record import FileError, Given, parse_map
from ridgebayes.fea.transitions import half_digit
from ridgebayes.fea.words import ANSYS_CLOSED
from ridgebayes.table.columns import SHOWN as MOST_SHOWN

# Start of a number that follows another without a blank, as in columns of fixed width.
_NUMBER_START = re.compile(r"(?<=[\d.])(?=[-+]\d*\.)")
# Rows start with a node and a number; lines of page headers do not.
_ROW = re.compile(r"\s*\d+(?:\s+|(?=-))[-+.]*\d")
_CORNER = re.compile(r"(?:status|pressure)\W*Q\W*(\d{1,6})")
_COORDINATES = ("X", "Y")


def read_febio(run: Run) -> ContactHistory:
    """Read log data of FEBio.

    Parameters
    ----------
    run : Run
        Text files with ``*Step``, ``*Time``, ``*Data`` and rows ``id,value,...``. The data are
        ``x;y`` of the nodes of the body's surface, and ``Fy`` of the rigid body or ``Ry`` of the
        driven nodes, which are summed. Positions and forces may be in one file or in two.

    Returns
    -------
    ContactHistory
        Heights of the surface, without undeformed positions, which log data do not contain.

    Raises
    ------
    InputError
        If a line cannot be parsed (the message names file and line), or data are missing.
    """
    log = _Log()
    for path in run.paths:
        log.read(path)
    nodes, name = log.nodes_with("x", "y"), "Fy" if log.nodes_with("Fy") else "Ry"
    required = (
        "data x, y, and Fy or Ry; expected log data x;y of the surface's nodes, and Fy of the "
        "rigid body or Ry of the driven nodes: ridgebayes import POSITIONS FORCES"
    )
    force = Wanted([name], log.nodes_with(name))
    load, at = log.states(force, Wanted("xy", nodes), run.path, required)
    return ContactHistory(load, at, digits=half_digit(at[..., 1]), messages=log.messages)


class _Log(Printed):
    """Parser of log data."""

    @on(r"\*Step\s*=\s*(\S+)\s*$")
    def _step(self, line: Line, match: re.Match[str]) -> None:
        self.begin(line, (line.finite(match[1]),))

    @on(r"\*Time\s*=")
    def _time(self, line: Line, match: re.Match[str]) -> None:
        self.table = None

    @on(r"\*Data\s*=\s*(\S.*?)\s*$")
    def _data(self, line: Line, match: re.Match[str]) -> None:
        self.open(line, "", match[1].split(";")).whole = True

    @on("")
    def _row(self, line: Line, match: re.Match[str]) -> None:
        if self.table is None:
            raise line.unexpected("*Step, *Time, *Data, and rows below *Data")
        self.table.lines.append(line._replace(text=line.text.replace(",", " ")))

    def filled(self, table: NodeTable, wanted: Wanted) -> pd.DataFrame:
        """Return the rows of all wanted nodes; refuse positions that are all 0."""
        rows = super().filled(table, wanted)
        if table.has("xy") and not rows.any(axis=None):
            raise MissingError("zeros, as before the first step: no state")
        return rows


def read_ansys(run: Run) -> ContactHistory:
    """Read the ANSYS listings of one run.

    Parameters
    ----------
    run : Run
        Listings of ``PRRSOL`` (``FY`` of the driven nodes), of ``PRNSOL`` (``UX`` and ``UY`` of the
        surface, or the contact result ``STAT`` or ``PRES``), and of ``NLIST`` (coordinates ``X``
        and ``Y``). Page headers are allowed anywhere. The fact `closed_is` lists the codes of
        ``STAT`` that mean contact, by default 2 (sliding) and 3 (sticking). `map` gives the node
        at the corner of each Q if there is no ``NLIST``.

    Returns
    -------
    ContactHistory

    Raises
    ------
    InputError
        If a line cannot be parsed (the message names file and line), or results are missing.
    """
    corners, listing, facts = _corner_nodes(run.facts), _Listing(), run.facts
    for path in run.paths:
        listing.read(path, unfinished=True)
    kind = next((name for name in ("UY", "STAT", "PRES") if listing.nodes_with(name)), "UY")
    names = ["UX", "UY"] if kind == "UY" else [kind]
    nodes, driven = listing.nodes_with(*names), listing.nodes_with("FY")
    tables = "FY and UY, STAT or PRES; expected listings: ridgebayes import PRNSOL.lis PRRSOL.lis"
    load, values = listing.states(Wanted(["FY"], driven), Wanted(names, nodes), run.path, tables)
    closed = values[..., 0] > 0
    if kind == "STAT":
        codes = sorted(facts.closed_is or ANSYS_CLOSED)
        listing.messages.append(f"STAT {', '.join(map(str, codes))}: contact")
        closed = np.isin(values[..., 0], codes)
    history = ContactHistory(load, messages=listing.messages)
    if corners or not (listing.places.lines or kind == "UY"):
        Q, corner = _at_corners(str(run.path), nodes, corners)
        return replace(history, closed=closed[:, corner], Q=Q)
    place = listing.places.rows.reindex(nodes).to_numpy()
    if lost := np.flatnonzero(np.isnan(place[:, 0])).tolist():
        raise InputError(f"{run.path}: node {nodes[lost[0]]} has no X and Y; expected NLIST beside")
    if kind == "UY":
        digits = half_digit(values[..., 1])
        return replace(history, at=place + values, undeformed=place, digits=digits)
    at = np.broadcast_to(place[:, :1], (*closed.shape, 1))
    return replace(history, at=at, closed=closed, undeformed=place)


def _corner_nodes(facts: Given) -> dict[int, int]:
    """Return the node at the corner of each Q."""
    corners = {}
    for key, node in parse_map(facts.map).items():
        match = _CORNER.fullmatch(key.strip())
        if match is None or not node.isdigit():
            raise InputError(f"--map {key}={node}: expected 'status Q=4=NODE' for a listing")
        corners[int(match[1])] = int(node)
    return corners


def _at_corners(
    where: str, nodes: list[int], corners: Mapping[int, int]
) -> tuple[IntArray, list[int]]:
    """Return the Q of each mapped corner, and the index of its node in `nodes`."""
    problems = FileError(where)
    if not corners:
        likely = {f"status Q={4 + 2 * i}": str(node) for i, node in enumerate(nodes[:MOST_SHOWN])}
        rule = "expected NLIST beside, or each proximal corner's node, --map 'status Q=4=NODE'"
        problems.need(f"nodes {nodes[0]} to {nodes[-1]} have no place: {rule}", likely)
        problems.raise_all()
    if lost := [node for node in corners.values() if node not in nodes]:
        raise problems.error(f"no results of node {lost[0]}; the nodes are {nodes[:MOST_SHOWN]}")
    return np.array(sorted(corners)), [nodes.index(corners[Q]) for Q in sorted(corners)]


class _Listing(Printed):
    """Parser of ANSYS listings."""

    def __init__(self) -> None:
        super().__init__()
        self.places = NodeTable(Line(Path(), 0, ""), "", list(_COORDINATES))  # from `NLIST`

    @on(r"LOAD STEP=\s*(\d+)\s+SUBSTEP=\s*(\d+)")
    def _step(self, line: Line, match: re.Match[str]) -> None:
        self.begin(line, (int(match[1]), int(match[2])))

    @on(r"NODE((?:\s+[A-Z]\w*)+)\s*$")
    def _header(self, line: Line, match: re.Match[str]) -> None:
        columns = match[1].split()
        if columns[:2] == list(_COORDINATES):
            self.table = self.places
        else:
            self.open(line, "", columns)

    @on(r"(?:MAXIMUM|MINIMUM|TOTAL)\b")
    def _end(self, line: Line, match: re.Match[str]) -> None:
        self.table = None

    def row(self, line: Line, table: NodeTable) -> None:
        """Add a row of fixed-width columns; skip lines of a page header."""
        if _ROW.match(line.text):
            if not line.ended:
                raise line.error("the last line is cut off; expected a whole listing")
            words = _NUMBER_START.sub(" ", line.text).split()
            words = words[:3] if table is self.places else words
            table.lines.append(line._replace(text=" ".join(words)))
