"""Reports of Abaqus/Viewer: nodal values frame by frame."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.deck import Deck, read_deck
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import Line
from ridgebayes.fea.printed import Increment, MissingError, NodeTable, Printed, on
from ridgebayes.fea.record import Given, provenance

_DASHES = re.compile(r"\s*-{9,}\s*$")
_GAP = re.compile(r"\s{2,}")  # between names, which hold single blanks
# How far printed numbers may be off: a share of the sum of sizes, of the largest displacement.
_AGREE = 1e-4
_U, _COORD, _RF = ("U.U1", "U.U2"), ("COORD.COOR1", "COORD.COOR2"), "RF.RF2"


def read_abaqus_rpt(paths: Sequence[Path], facts: Given) -> ContactHistory:
    """Read field output reports of Abaqus/Viewer, one after another in a file.

    Parameters
    ----------
    paths : sequence of pathlib.Path
        One ``.rpt`` file: nodal ``U.U1``, ``U.U2`` of the rim, ``RF.RF2`` where the load is read,
        and ``COORD.COOR1``, ``COORD.COOR2`` of the rim without a deck, in each frame.
    facts : Given
        Its surface and reaction are regions as the report names them, ``PART-1-1.RIM`` or ``RIM``,
        or node sets of the deck; None takes the one region that has the columns. Without the deck
        the height of the ridges' tops is not known.

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
    path, surface, reaction, deck = paths[0], facts.surface, facts.reaction, facts.deck
    sheet = Deck() if deck is None else read_deck(deck)
    printed = _Report("averaged where elements meet").read(path)
    columns = _U if deck else _COORD + _U
    sets = [sheet.nsets.get((name or "").upper(), []) for name in (surface, reaction)]
    nodes, driven = (list(dict.fromkeys(some)) for some in sets)
    digits = []

    def table(
        increment: Increment, names: tuple[str, ...], region: str | None, numbers: list[int]
    ) -> NodeTable:
        table = increment.table(names, region or "", *[""] * bool(numbers))
        if not table.whole:
            raise MissingError(f"{', '.join(names)} of {table.nodes} is cut off")
        return table

    def state(increment: Increment) -> tuple[float, FloatArray]:
        rim = table(increment, columns, surface, nodes)
        forces = table(increment, (_RF,), reaction, driven)
        nodes[:] = nodes or rim.rows.index.tolist()
        digits.append(_digits(rim))
        return _force(forces, driven), rim.of(nodes, *columns)

    wanted = f"{', '.join(columns)} and {_RF}; expected nodal output of both in a field report"
    load, states = printed.states(state, path, wanted)
    moved = np.array(states)[..., -2:]
    if deck is None:
        undeformed, how = _undeformed(path, np.array(states)[..., :2], moved)
        printed.messages.append(how)
    else:
        undeformed = sheet.coordinates(nodes, str(deck))
    options = {"deck": deck and deck.name, "surface": surface, "reaction": reaction}
    source = (f"{key}={name}" for key, name in options.items() if name)
    return printed.history(
        load,
        provenance(path, "abaqus-rpt", *source),
        "abaqus",
        at=undeformed + moved,
        undeformed=undeformed,
        rigid=sheet.coordinates(sheet.rigid_nodes(nodes), str(deck)),
        digits=0.5 * 10.0 ** (1 - max(digits)) * float(np.abs(moved).max()),
    )


class _Report(Printed):
    """Reports, one after another."""

    def __init__(self, rule: str) -> None:
        super().__init__(rule)
        self._steps: dict[str, int] = {}
        self._database = self._step = ""
        self._header: list[str] = []
        self._pending: list[str] = []  # a row so far: wide ones are wrapped

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
            self.increment.tables.append(self.table)

    def blank(self) -> None:
        """Take the end of a header, or of rows."""
        if self.table is not None and self.table.lines:
            self.table.whole = self.table.whole or not self._pending
        elif not self._pending:
            self._header = []

    def row(self, line: Line, table: NodeTable) -> None:
        """Take a line of a table: its header, a row or a piece of one, or what stands below."""
        text = line.text.strip()
        if _DASHES.match(text):
            # A wide table has a second header, over its second lines.
            names = _GAP.split(self._header[0]) if self._header else []
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
    """Return the most digits of a number of a table: zeros at the end are not printed."""
    words = (word for line in table.lines for word in line.words[1:])
    return max(len(re.sub(r"[EeDd].*|[-+.]", "", word).lstrip("0")) for word in words)


def _force(table: NodeTable, nodes: list[int]) -> float:
    """Return the sum of RF2, checked against a printed total and against nothing at all."""
    driven, what = nodes or table.rows.index.tolist(), f"{_RF} of {table.nodes}"
    force, size = table.force(driven, _RF), float(table.rows[_RF].reindex(driven).abs().sum())
    totals = dict(zip(table.columns, table.below.get("Total", []), strict=False))
    total = totals.get(_RF, force) if len(driven) == len(table.lines) else force
    if abs(total - force) > _AGREE * size:
        sums = f"adds up to {force:.6g}, and the total is {total:.6g}"
        raise table.line.error(f"{what} {sums}; expected whole tables")
    if size > 0 and abs(force) < _AGREE * size:
        raise table.line.error(f"{what} cancels to {force:.3g}; expected the driven nodes alone")
    return force


def _undeformed(path: Path, at: FloatArray, moved: FloatArray) -> tuple[FloatArray, str]:
    """Return coordinates that are the same in all frames, and whether COORD is before or after."""
    largest = float(np.abs(moved).max())
    bases = {"undeformed": at, "deformed": at - moved}
    spread = {name: float(np.ptp(base, axis=0).max()) for name, base in bases.items()}
    digits = 1e-5 * float(np.abs(at).max())
    how = min(spread, key=lambda name: spread[name])
    if len(at) < 2 or spread[how] > _AGREE * largest + digits or largest < 10 * digits:
        changes = f"COORD by {spread['undeformed']:.3g} and COORD - U by {spread['deformed']:.3g}"
        rule = f"change between {len(at)} frames; expected one of the two to stay, or --deck"
        raise InputError(f"{path}: {changes} {rule}")
    base = at[0] if how == "undeformed" else np.median(at - moved, axis=0)
    return np.asarray(base, dtype=float), f"COORD: coordinates of {how} nodes"
