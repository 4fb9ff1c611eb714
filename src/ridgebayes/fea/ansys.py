"""ANSYS listings: nodal results (``PRNSOL``), reactions (``PRRSOL``) and places (``NLIST``)."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ridgebayes._types import BoolArray, FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import Line, read_lines
from ridgebayes.fea.record import FileError, provenance
from ridgebayes.fea.transitions import last_digit

MARK = re.compile(rb"\*\*\*\*\* POST1 .* LISTING|LIST (?:ALL )?SELECTED NODES|PRINT .* PER NODE")
CLOSED = (2, 3)  # of STAT: 0 far, 1 near, 2 sliding, 3 sticking
_STEP = re.compile(r"\s*LOAD STEP=\s*(\d+)\s+SUBSTEP=\s*(\d+)")
_HEADER = re.compile(r"\s*NODE((?:\s+[A-Z]\w*)+)\s*$")
_TOUCH = re.compile(r"(?<=[\d.])(?=[-+]\d*\.)")  # where a number begins in fixed columns
_END = re.compile(r"\s*(?:MAXIMUM|MINIMUM|TOTAL)\b")
_MOST = 20  # nodes that messages name
_Key = tuple[int, int]
_Nodes = dict[int, float]


def read_ansys(
    paths: Sequence[Path], *, closed_is: Collection[int] = (), corners: Mapping[int, int] = {}
) -> ContactHistory:
    """Read listings of ANSYS, of one run.

    Parameters
    ----------
    paths : sequence of pathlib.Path
        Text of ``PRRSOL`` (``FY`` of the driven nodes) and of ``PRNSOL``: ``UX``, ``UY`` of the
        surface, or ``STAT`` or ``PRES`` of contact; and ``NLIST`` (``X``, ``Y``) where nodes are.
        Page heads may stand anywhere.
    closed_is : collection of int, optional
        Codes of ``STAT`` that mean contact; 2 (sliding) and 3 (sticking) if not given.
    corners : mapping of int to int, optional
        Node at the corner of each Q, in place of ``NLIST``.

    Returns
    -------
    ContactHistory

    Raises
    ------
    InputError
        If a line cannot be understood, with file and line, or results are missing.
    """
    where = str(paths[0])
    steps: dict[_Key, dict[str, _Nodes]] = {}
    places: dict[str, _Nodes] = {}
    for path in paths:
        _read(path, steps, places)
    names = {name for one in steps.values() for name in one}
    kind = next((name for name in ("UY", "STAT", "PRES") if name in names), "")
    if not kind or "FY" not in names:
        raise InputError(
            f"{where}: no {'FY' if kind else 'UY, STAT or PRES'} (there is "
            f"{', '.join(sorted(names)) or 'nothing'}); expected listings of PRRSOL and PRNSOL: "
            "ridgebayes import PRNSOL.lis PRRSOL.lis"
        )
    whole = {key: one for key, one in steps.items() if {kind, "FY"} <= one.keys()}
    messages = [f"{where}: ANSYS listing, {len(whole)} substeps with {kind} and FY"]
    if n := len(steps) - len(whole):
        messages.append(f"{n} substeps ignored: {kind} or FY missing")
    if not whole:
        raise InputError(f"{where}: no substep with both {kind} and FY; expected those of one run")
    order = [whole[key] for key in sorted(whole)]
    nodes = sorted(order[0][kind])
    for name in (kind, "FY"):
        for key in sorted(whole):
            if whole[key][name].keys() != order[0][name].keys():
                raise InputError(
                    f"{where}: load step {key[0]}, substep {key[1]}: {name} of other nodes than at "
                    "the first one; expected whole listings of the same nodes"
                )
    force = np.array([sum(one["FY"].values()) for one in order])
    history = ContactHistory(
        force,
        where,
        provenance(paths[0], "ansys", *(path.name for path in paths[1:])),
        "ansys",
        undeformed=_places(where, nodes, places) if places and not corners else None,
        messages=tuple(messages),
    )
    values = {
        name: np.array([[one.get(name, {}).get(node, np.nan) for node in nodes] for one in order])
        for name in {kind, "UX"}
    }
    if kind == "UY":
        return _moved(history, values["UX"], values["UY"])
    closed, said = values[kind] > 0, ""
    if kind == "STAT":
        codes = sorted(closed_is or CLOSED)
        closed, said = np.isin(values[kind], codes), f"STAT {', '.join(map(str, codes))}: contact"
    return _closed(replace(history, messages=(*messages, said)), closed, nodes, corners)


def _places(where: str, nodes: Sequence[int], places: Mapping[str, _Nodes]) -> FloatArray:
    if missing := [node for node in nodes if node not in places["X"]]:
        raise InputError(f"{where}: node {missing[0]} is not in the list of nodes")
    return np.array([[places[name][node] for name in "XY"] for node in nodes])


def _moved(history: ContactHistory, ux: FloatArray, uy: FloatArray) -> ContactHistory:
    """Return a history of heights."""
    at = history.undeformed
    if at is None or np.isnan(ux).any():
        raise InputError(
            f"{history.where}: no {'UX' if at is not None else 'X and Y'} of the nodes; expected "
            "PRNSOL,U,COMP, and NLIST beside"
        )
    return replace(history, x=at[:, 0] + ux, height=at[:, 1] + uy, digits=last_digit(uy) / 2)


def _closed(
    history: ContactHistory, closed: BoolArray, nodes: list[int], corners: Mapping[int, int]
) -> ContactHistory:
    """Return a history of closed nodes, by their places or by their corners."""
    if history.undeformed is not None:
        x = np.broadcast_to(history.undeformed[:, 0], closed.shape)
        return replace(history, x=x, closed=closed)
    problems = FileError(history.where)
    if not corners:
        likely = {f"status Q={4 + 2 * i}": str(node) for i, node in enumerate(nodes[:_MOST])}
        problems.need(
            f"nodes {nodes[0]} to {nodes[-1]} have no place: expected a listing of NLIST beside, "
            "or the node at each proximal corner, --map 'status Q=4=NODE'",
            likely,
        )
        problems.raise_all()
    if lost := [node for node in corners.values() if node not in nodes]:
        raise problems.error(f"no results of node {lost[0]}; the nodes are {nodes[:_MOST]}")
    Q = sorted(corners)
    at = [nodes.index(corners[count]) for count in Q]
    return replace(history, closed=closed[:, at], Q=np.array(Q))


def _read(path: Path, steps: dict[_Key, dict[str, _Nodes]], places: dict[str, _Nodes]) -> None:
    """Add what a listing holds: columns of nodes by step, or without one."""
    columns: list[str] = []
    key: _Key | None = None
    for line in read_lines(path, unfinished=True):
        if match := _STEP.match(line.text):
            key, columns = (int(match[1]), int(match[2])), []
        elif match := _HEADER.match(line.text):
            columns = match[1].split()
            if columns[:3] == ["X", "Y", "Z"]:
                columns = ["X", "Y", "Z"]
            elif key is None:
                raise line.error(f"columns {', '.join(columns)} before a LOAD STEP")
        elif _END.match(line.text):
            columns = []
        elif columns and line.text.strip()[:1].isdigit() and line.text.strip() != "1":
            # A 1 by itself is a page's head.
            node, *words = _TOUCH.sub(" ", line.text).split()
            is_place = columns[0] == "X"
            if not line.ended:
                raise line.error("the last line has no end; expected a whole listing")
            if len(words) != len(columns) and not (is_place and len(words) > len(columns)):
                raise line.unexpected(f"node, {', '.join(columns)}")
            into = places if is_place or key is None else steps.setdefault(key, {})
            _take(line, line.node(node, ()), dict(zip(columns, words, strict=False)), into)


def _take(line: Line, node: int, row: Mapping[str, str], into: dict[str, _Nodes]) -> None:
    for name, word in row.items():
        value, there = line.finite(word), into.setdefault(name, {})
        if there.setdefault(node, value) != value:
            raise line.error(f"{name} of node {node} again, with another value; expected once")
