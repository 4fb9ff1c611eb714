"""Reports of Abaqus/Viewer: nodal values frame by frame."""

import math
import re
from pathlib import Path

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.deck import Deck, read_deck
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import Frame, Line, NodeTable, Printed, on, read_lines, unused
from ridgebayes.fea.record import provenance

_DASHES = re.compile(r"\s*-{9,}\s*$")
_GAP = re.compile(r"\s{2,}")  # between names, which hold single blanks
_AGREE = 1e-4  # of the sum of sizes: how far a total may be off its rows
_MOVED = 1e-4  # of the largest displacement: how far undeformed coordinates may differ


def read_abaqus_rpt(
    path: Path,
    *,
    surface: str | None = None,
    reaction: str | None = None,
    deck: Path | None = None,
) -> ContactHistory:
    """Read field output reports of Abaqus/Viewer, one after another in a file.

    Parameters
    ----------
    path : pathlib.Path
        The ``.rpt`` file: nodal ``U.U1``, ``U.U2`` of the rim, ``RF.RF2`` where the load is read,
        and ``COORD.COOR1``, ``COORD.COOR2`` of the rim without a `deck`, in each frame.
    surface, reaction : str or None, optional
        A region as the report names it, ``PART-1-1.RIM`` or ``RIM``, or a node set of the deck;
        None takes the one region that has the columns.
    deck : pathlib.Path or None, optional
        The run's ``.inp`` file; without it the height of the ridges' tops is not known.

    Returns
    -------
    ContactHistory

    Raises
    ------
    InputError
        If the file cannot be understood, with its line; if a region is missing.

    Notes
    -----
    ``COORD`` is where nodes are, or where they were, depending on the step's ``NLGEOM``: it is what
    makes undeformed coordinates the same in all frames.
    """
    sheet = read_deck(deck) if deck is not None else None
    frames, messages = _frames(path)
    names = ["U.U1", "U.U2"] + ([] if sheet else ["COORD.COOR1", "COORD.COOR2"])
    rims, driven = _Region(surface, sheet), _Region(reaction, sheet)
    kept: list[str] = []
    used: list[NodeTable] = []
    force: list[float] = []
    nodes: list[int] = []
    for one in frames:
        try:
            rim = rims.table(one, *names)
            nodes = nodes or rims.nodes_of(rim)
            if missing := set(nodes) - set(rim.rows.nodes.tolist()):
                raise LookupError(f"{len(missing)} nodes missing")
            forces = driven.table(one, "RF.RF2")
        except LookupError as lack:
            messages.append(f"{one.name}, line {one.line}: frame ignored, {lack}")
            continue
        kept.append(one.name)
        used.append(rim)
        force.append(_force(forces, driven.nodes_of(forces)))
    if not kept:
        raise InputError(
            f"{path}: no frame with {', '.join(names)} and RF.RF2; expected nodal field output "
            "of both" + "".join(f"; {line}" for line in messages[:3])
        )
    moved = np.array([rim.of(nodes, "U.U1", "U.U2") for rim in used])
    digits = 0.5 * 10.0 ** (1 - max(map(_digits, used))) * float(np.abs(moved).max())
    if sheet is not None and deck is not None:
        undeformed = sheet.coordinates(nodes, str(deck))
        rigid = sheet.coordinates(sheet.rigid_nodes(nodes), str(deck))
    else:
        at = np.array([rim.of(nodes, "COORD.COOR1", "COORD.COOR2") for rim in used])
        undeformed, how = _undeformed(path, at, moved)
        messages.append(how)
        rigid = np.zeros((0, 2))
    given = {"deck": deck and deck.name, "surface": surface, "reaction": reaction}
    details = (f"{key}={name}" for key, name in given.items() if name)
    position = undeformed + moved
    return ContactHistory(
        np.array(force),
        str(path),
        provenance(path, "abaqus-rpt", *details),
        "abaqus",
        position[..., 0],
        position[..., 1],
        undeformed=undeformed,
        rigid=rigid,
        digits=digits,
        messages=(f"{path}: {len(kept)} frames, {kept[0]} to {kept[-1]}", *messages),
    )


def _frames(path: Path) -> tuple[list[Frame], list[str]]:
    """Return the frames of a file in the order of steps and increments."""
    report = _Report()
    for line in read_lines(path):
        report.take(line)
    if not report.n:
        raise InputError(
            f"{path}: no 'Field Output Report'; expected a field report of Abaqus/Viewer"
        )
    return [report.found[key] for key in sorted(report.found)], unused(report.others)


class _Report(Printed):
    """Reports, one after another."""

    def __init__(self) -> None:
        super().__init__()
        self.n, self._database, self._step = 0, "", ""
        self._steps: dict[str, int] = {}
        self._header: list[str] = []
        self._pending: list[str] = []  # a row so far: wide ones are wrapped

    @on("Field Output Report(?!.*reported at)")
    def _title(self, line: Line, match: re.Match[str]) -> None:
        self.n += 1
        self.frame = self.table = None

    @on(r"(ODB: .*\S)")
    def _run(self, line: Line, match: re.Match[str]) -> None:
        if self._database not in ("", match[1]):
            raise line.error(f"{match[1]}, and above {self._database}; expected one run")
        self._database = match[1]

    @on(r"Step: (.*\S)")
    def _new_step(self, line: Line, match: re.Match[str]) -> None:
        self._step = match[1]

    @on(r"(Frame: (?:Increment\s+(\d{1,9}): Step Time =\s*(\S+)|.*\S))")
    def _new_frame(self, line: Line, match: re.Match[str]) -> None:
        if match[2] is None:
            self.frame = None
            self.others.add(match[1])
            return
        line.finite(match[3])
        key = (self._steps.setdefault(self._step, len(self._steps)), int(match[2]))
        self.frame = self.found.setdefault(key, Frame(line.number, f"{self._step} {match[2]}"))

    @on(r"Field Output reported at(?: nodes for (?:part|region): (.*\S))?")
    def _region(self, line: Line, match: re.Match[str]) -> None:
        self._header, self._pending, self.table = [], [], None
        if match[1] is None:
            self.others.add(line.text.strip())
        elif self.frame is not None:
            self.table = NodeTable(line, match[1], "averaged where elements meet")
            self.frame.tables.append(self.table)

    def row(self, line: Line, table: NodeTable) -> None:
        """Take a line of a table: its header, a row or a piece of one, or what stands below."""
        text = line.text.strip()
        if _DASHES.match(text):
            # A wide table has a second header, over its second lines.
            names = _GAP.split(self._header[0]) if self._header else []
            table.columns += names[names[:1] in (["Node"], ["Node Label"]) :]
            self._header = []
        elif (
            not table.lines and not self._pending and (not table.columns or not text[:1].isdigit())
        ):
            self._header = [*self._header, text] if text else []
        elif not text or text[0].isalpha():
            table.whole = table.whole or not self._pending
            if text.startswith("Total"):
                table.trailers["TOTAL"] = [line.finite(word) for word in line.words[1:]]
        elif not table.whole:
            self._pending += line.words
            if len(self._pending) > len(table.columns):
                table.lines.append(line._replace(text=" ".join(self._pending)))
                self._pending = []


class _Region:
    """Nodes that are asked for: a region as the report names it, a set of the deck, or any."""

    def __init__(self, name: str | None, deck: Deck | None) -> None:
        self._name = name
        nsets = {} if deck is None else deck.nsets
        self._nodes = list(dict.fromkeys(nsets.get((name or "").upper(), ())))

    def table(self, frame: Frame, *columns: str) -> NodeTable:
        """Return the table that has some columns; LookupError if something of it is missing."""
        some = [one for one in frame.tables if one.has(*columns) and one.lines and one.whole]
        if self._name is not None:
            name = "." + self._name.upper()
            named = [one for one in some if f".{one.nodes.upper()}".endswith(name)]
            some = named or (some if self._nodes else [])
        if not some:
            cut = [one for one in frame.tables if one.has(*columns) and not one.whole]
            what = ", ".join(columns) + (f" of {self._name}" if self._name else "")
            raise LookupError(f"{what} is cut off" if cut else f"{what} missing")
        regions = sorted({one.nodes for one in some})
        if len(regions) > 1:
            raise some[-1].line.error(
                f"{', '.join(columns)} of {', '.join(regions)}; name one of these regions"
            )
        return some[-1]

    def nodes_of(self, table: NodeTable) -> list[int]:
        """Return the set's nodes, or all of the table."""
        return self._nodes or table.rows.nodes.tolist()


def _digits(table: NodeTable) -> int:
    """Return the most digits of a number of a table: zeros at the end are not printed."""
    words = (word for line in table.lines for word in line.words[1:])
    return max(len(re.sub(r"[EeDd].*|[-+.]", "", word).lstrip("0")) for word in words)


def _force(table: NodeTable, nodes: list[int]) -> float:
    """Return the sum of RF2, checked against a printed total and against nothing at all."""
    values = table.of(nodes, "RF.RF2")[:, 0]
    values = values[~np.isnan(values)]
    force, size = math.fsum(values), math.fsum(np.abs(values))
    totals = table.trailers.get("TOTAL", [])
    if len(totals) == len(table.columns) and len(values) == len(table.lines):
        total = totals[table.columns.index("RF.RF2")]
        if abs(total - force) > _AGREE * size:
            raise table.line.error(
                f"RF.RF2 of {table.nodes} adds up to {force:.6g}, and the total is {total:.6g}; "
                "expected whole tables"
            )
    if size > 0 and abs(force) < _AGREE * size:
        raise table.line.error(
            f"RF.RF2 of {table.nodes} cancels to {force:.3g}; expected a region of the driven "
            "nodes alone, where the load is read"
        )
    return force


def _undeformed(path: Path, at: FloatArray, moved: FloatArray) -> tuple[FloatArray, str]:
    """Return coordinates that are the same in all frames, and whether COORD is before or after."""
    largest = float(np.abs(moved).max())
    bases = {"undeformed": at, "deformed": at - moved}
    spread = {name: float(np.ptp(one, axis=0).max()) for name, one in bases.items()}
    digits = 1e-5 * float(np.abs(at).max())
    how = min(spread, key=lambda name: spread[name])
    if len(at) < 2 or spread[how] > _MOVED * largest + digits or largest < 10 * digits:
        raise InputError(
            f"{path}: COORD changes by {spread['undeformed']:.3g} and COORD - U by "
            f"{spread['deformed']:.3g} between {len(at)} frames; expected one of the two to stay, "
            "or --deck for the coordinates"
        )
    base = at[0] if how == "undeformed" else np.median(at - moved, axis=0)
    return np.asarray(base, dtype=float), f"COORD: coordinates of {how} nodes"
