"""Reports of Abaqus/Viewer: nodal values frame by frame, and columns of X-Y data."""

import csv
import math
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.deck import Deck, check_material, read_deck, rigid_nodes
from ridgebayes.fea.levels import Body, Levels, table_of
from ridgebayes.fea.record import Imported, finite, provenance
from ridgebayes.runtime.reading import read_text

_TITLE = "Field Output Report"
_FRAME = re.compile(r"\s*Frame: Increment\s+(\d{1,9}): Step Time =\s*(\S+)")
_REGION = re.compile(r"\s*Field Output reported at nodes for (?:part|region): (.*\S)")
_DASHES = re.compile(r"\s*-{9,}\s*$")
_AGREE = 1e-4  # of the sum of sizes: how far a total may be off its rows
_MOVED = 1e-4  # of the largest displacement: how far undeformed coordinates may differ
_GAP = re.compile(r"\s{2,}")
_BEGINS = "+-.0123456789"
_SEPARATORS = (";", "\t", ",")


@dataclass
class _Table:
    """Nodal values of one region in one frame."""

    line: int
    region: str
    columns: list[str] = field(default_factory=list)
    rows: dict[int, list[float]] = field(default_factory=dict)
    total: list[float] = field(default_factory=list)
    digits: int = 0  # most digits of a number
    whole: bool = False  # whether something stands below the rows

    def has(self, *names: str) -> bool:
        return all(name in self.columns for name in names)

    def of(self, nodes: list[int], *names: str) -> FloatArray:
        """Return columns, shape (n_node, n_name)."""
        at = [self.columns.index(name) for name in names]
        return np.array([[self.rows[node][i] for i in at] for node in nodes]).reshape(-1, len(at))


@dataclass
class _Frame:
    """What a file has of one frame."""

    line: int
    name: str
    tables: list[_Table] = field(default_factory=list)


def read_abaqus_rpt(
    path: Path,
    body: Body,
    *,
    surface: str | None = None,
    reaction: str | None = None,
    deck: Path | None = None,
    brackets: bool = False,
) -> Imported:
    """Read field output reports of Abaqus/Viewer, one after another in a file.

    Parameters
    ----------
    path : pathlib.Path
        The ``.rpt`` file: nodal ``U.U1``, ``U.U2`` of the rim, ``RF.RF2`` where the load is read,
        and ``COORD.COOR1``, ``COORD.COOR2`` of the rim without a `deck`, in each frame.
    body : Body
        What the file does not say; with no `deck` it needs ``top``.
    surface, reaction : str or None, optional
        A region as the report names it, ``PART-1-1.RIM`` or ``RIM``, or a node set of the deck;
        None takes the one region that has the columns.
    deck : pathlib.Path or None, optional
        The run's ``.inp`` file.
    brackets : bool, optional
        As `ridgebayes.fea.increments.transitions_of`.

    Returns
    -------
    Imported

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
    frames, said = _frames(path)
    names = ["U.U1", "U.U2"] + ([] if sheet else ["COORD.COOR1", "COORD.COOR2"])
    kept: list[tuple[_Frame, _Table, float]] = []
    nodes: list[int] = []
    for one in frames:
        rim, lacks = _pick(path, one, surface, sheet, names)
        pushed, lack = _pick(path, one, reaction, sheet, ["RF.RF2"])
        if rim is None or pushed is None:
            said.append(f"{one.name}, line {one.line}: {lacks or lack}: left out")
            continue
        listed = _listed(rim, surface, sheet)
        nodes = nodes or listed
        if missing := set(nodes) - rim.rows.keys():
            said.append(f"{one.name}, line {one.line}: {len(missing)} nodes missing: left out")
            continue
        kept.append((one, rim, _force(path, pushed, reaction, sheet)))
    if not kept:
        raise InputError(
            f"{path}: no frame with {', '.join(names)} and RF.RF2; expected nodal field output "
            "of both" + "".join(f"; {line}" for line in said[:3])
        )
    moved = np.array([rim.of(nodes, "U.U1", "U.U2") for _, rim, _ in kept])
    digits = 0.5 * 10.0 ** (1 - max(rim.digits for _, rim, _ in kept)) * float(np.abs(moved).max())
    if sheet is not None and deck is not None:
        check_material(sheet, body.E, body.nu, deck)
        undeformed = sheet.coordinates(nodes, str(deck))
        rigid = sheet.coordinates(rigid_nodes(sheet, nodes), str(deck))
    else:
        at = np.array([rim.of(nodes, "COORD.COOR1", "COORD.COOR2") for _, rim, _ in kept])
        undeformed, how = _undeformed(path, at, moved)
        said.append(how)
        rigid = np.zeros((0, 2))
    levels = Levels(
        np.array([force for _, _, force in kept]),
        undeformed,
        undeformed + moved,
        rigid,
        digits=digits,
        said=(f"{path}: {len(kept)} frames, {kept[0][0].name} to {kept[-1][0].name}", *said),
    )
    details = [f"deck={deck.name}"] if deck is not None else []
    details += [f"surface={surface}"] if surface else []
    details += [f"reaction={reaction}"] if reaction else []
    source = provenance(path, "abaqus-rpt", *details)
    return table_of(
        levels, body, where=str(path), solver="abaqus", source=source, brackets=brackets
    )


def read_xy(path: Path) -> pd.DataFrame:
    """Read an X-Y report, or X-Y data as CSV.

    Parameters
    ----------
    path : pathlib.Path
        A header, ``X`` and the curves' names, on one line or wrapped over several, then rows of
        numbers: set in columns by blanks, or separated by commas, semicolons or tabs. Several
        tables with the same X become one.

    Returns
    -------
    DataFrame
        A column of float for each curve, ``X`` first; the index, ``line``, is that of the file.

    Raises
    ------
    InputError
        With the line, if the header has another number of columns than the rows, a name stands
        twice, a cell is no number, or there are no rows.
    """
    tables: list[tuple[list[str], list[int], list[list[float]]]] = []
    header: list[str] = []
    closed = False  # whether a blank line came below the header
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        if not line.strip() or _DASHES.match(line):
            closed = True
            continue
        if line.lstrip()[0] not in _BEGINS:
            # Names; or what stands below the rows, such as a minimum, which no rows follow.
            header, closed = [line] if closed else [*header, line], False
            continue
        words = _cells(line)
        if header:
            tables.append((_columns(path, number, header, line), [], []))
            header = []
        if not tables:
            raise InputError(
                f"{path}, line {number}: numbers before a header; expected X and names"
            )
        if len(words) != len(tables[-1][0]):
            raise InputError(
                f"{path}, line {number}: {len(words)} values; expected {len(tables[-1][0])} as "
                "in the "
                "header, with decimal points"
            )
        tables[-1][1].append(number)
        tables[-1][2].append([finite(path, number, word) for word in words])
    if not tables:
        raise InputError(f"{path}: no rows; expected a header, X and names, and rows of numbers")
    names, lines, rows = tables[0]
    frame = pd.DataFrame(np.array(rows), columns=names, index=pd.Index(lines, name="line"))
    for names, lines, rows in tables[1:]:
        values = np.array(rows)
        if not np.array_equal(values[:, 0], frame[frame.columns[0]]):
            raise InputError(f"{path}, line {lines[0]}: another X; expected tables of the same X")
        if twice := set(names[1:]) & set(frame.columns):
            raise InputError(f"{path}, line {lines[0]}: {min(twice)!r} again; expected once a name")
        for i, name in enumerate(names[1:], start=1):
            frame[name] = values[:, i]
    return frame


def _cells(line: str) -> list[str]:
    """Return the words of a row."""
    for separator in _SEPARATORS:
        if separator in line:
            return [cell.strip() for cell in line.strip().removesuffix(separator).split(separator)]
    return line.split()


def _columns(path: Path, number: int, header: list[str], row: str) -> list[str]:
    """Return the names above a row."""
    n, last = len(_cells(row)), header[-1].strip()
    separator = next((one for one in _SEPARATORS if one in row), None)
    if separator is not None:
        names = next(csv.reader([last.removesuffix(separator)], delimiter=separator))
        names = [name.strip() for name in names]
    else:
        # Names hold single blanks, and may be wrapped over several lines.
        names = _GAP.split(last)
        names = names if len(names) == n else last.split()
        if len(header) > 1 or len(names) != n:
            names = _wrapped(header, row)
    if len(names) != n or not all(names):
        raise InputError(
            f"{path}, line {number}: {n} values below the names {', '.join(map(repr, names))}; "
            "expected as many names"
        )
    if len(set(names)) < n:
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(
            f"{path}, line {number}: {twice!r} again in the header; expected once a name"
        )
    return names


def _wrapped(header: list[str], row: str) -> list[str]:
    """Return names over several lines: each piece belongs to the number next to it."""
    middles = [(m.start() + m.end()) / 2 for m in re.finditer(r"\S+", row)]
    names: list[list[str]] = [[] for _ in middles]
    for line in header:
        for piece in re.finditer(r"\S+(?: \S+)*", line):
            middle = (piece.start() + piece.end()) / 2
            names[int(np.argmin([abs(middle - one) for one in middles]))].append(piece[0])
    return [" ".join(pieces) for pieces in names]


def _frames(path: Path) -> tuple[list[_Frame], list[str]]:
    """Return the frames of a file in the order of steps and increments."""
    found: dict[tuple[int, int], _Frame] = {}
    steps: list[str] = []
    step, database, reports = "", "", 0
    frame: _Frame | None = None
    table: _Table | None = None
    others = set[str]()
    header: list[str] = []
    pending: list[str] = []  # a row so far: wide ones are wrapped
    lines = read_text(path).split("\n")
    lines.pop()  # nothing, or a last line without an end: half of one
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if text.startswith(_TITLE) and "reported at" not in text:
            reports, frame, table = reports + 1, None, None
        elif text.startswith("ODB: "):
            if database and text != database:
                raise InputError(
                    f"{path}, line {number}: {text}, and above {database}; expected one run"
                )
            database = text
        elif text.startswith("Step: "):
            step = text.removeprefix("Step: ")
        elif (match := _FRAME.match(line)) is not None:
            finite(path, number, match[2])
            if step not in steps:
                steps.append(step)
            key = (steps.index(step), int(match[1]))
            frame = found.setdefault(key, _Frame(number, f"{step} {match[1]}"))
        elif text.startswith("Frame: "):
            frame = None
            others.add(text)
        elif text.startswith("Field Output reported at"):
            match = _REGION.match(line)
            header, pending, table = [], [], None
            if match is None:
                others.add(text)
            elif frame is not None:
                table = _Table(number, match[1])
                frame.tables.append(table)
        elif table is None:
            continue
        elif _DASHES.match(line):
            # A wide table has a second header, over its second lines.
            table.columns += _names(header)
            header = []
        elif not table.rows and not pending and (not table.columns or not text[:1].isdigit()):
            header = [*header, text] if text else []
        elif not text or text[0].isalpha():
            table.whole = table.whole or not pending
            if text.startswith("Total"):
                table.total = [finite(path, number, word) for word in text.split()[1:]]
        elif not table.whole:
            pending += text.split()
            if len(pending) > len(table.columns):
                _add(path, number, table, pending)
                pending = []
    if not reports:
        raise InputError(f"{path}: no {_TITLE!r}; expected a field report of Abaqus/Viewer")
    said = [f"not used: {', '.join(sorted(others))}"] if others else []
    return [found[key] for key in sorted(found)], said


def _names(header: list[str]) -> list[str]:
    """Return the names of a header but that of the nodes' numbers."""
    names = _GAP.split(header[0]) if header else []
    return names[1:] if names and names[0] in ("Node", "Node Label") else names


def _add(path: Path, number: int, table: _Table, words: list[str]) -> None:
    if len(words) != 1 + len(table.columns):
        raise InputError(
            f"{path}, line {number}: {len(words)} values; expected node, {', '.join(table.columns)}"
        )
    if not (words[0].isascii() and words[0].isdigit() and len(words[0]) < 19):
        raise InputError(f"{path}, line {number}: node {words[0][:40]!r}; expected a whole number")
    node = int(words[0])
    if node in table.rows:
        raise InputError(
            f"{path}, line {number}: node {node} again in {table.region}; expected nodal values, "
            "averaged where elements meet"
        )
    table.rows[node] = [finite(path, number, word) for word in words[1:]]
    for word in words[1:]:
        mantissa = re.split("[EeDd]", word)[0]
        table.digits = max(table.digits, len(mantissa.strip("+-").replace(".", "").lstrip("0")))


def _pick(
    path: Path, frame: _Frame, name: str | None, sheet: Deck | None, columns: list[str]
) -> tuple[_Table | None, str]:
    """Return the table of a region that has some columns; or else what is missing."""
    some = [one for one in frame.tables if one.has(*columns) and one.rows and one.whole]
    if name is not None:
        named = [one for one in some if _is_named(one.region, name)]
        inside = sheet is not None and name.upper() in sheet.nsets
        some = named or (some if inside else [])
    if not some:
        cut = [one for one in frame.tables if one.has(*columns) and not one.whole]
        what = f"{', '.join(columns)}" + (f" of {name}" if name else "")
        return None, f"{what} is cut off" if cut else f"no {what}"
    regions = {one.region for one in some}
    if len(regions) > 1:
        raise InputError(
            f"{path}, line {some[-1].line}: {', '.join(columns)} of {', '.join(sorted(regions))}; "
            "expected name one of these regions"
        )
    return some[-1], ""


def _is_named(region: str, name: str) -> bool:
    return region.upper() == name.upper() or region.upper().endswith("." + name.upper())


def _listed(table: _Table, name: str | None, sheet: Deck | None) -> list[int]:
    """Return the nodes asked for: of the deck's set, or all of the region."""
    if sheet is not None and name is not None and name.upper() in sheet.nsets:
        return list(dict.fromkeys(sheet.nsets[name.upper()]))
    return list(table.rows)


def _force(path: Path, table: _Table, name: str | None, sheet: Deck | None) -> float:
    """Return the sum of RF2, checked against a printed total and against nothing at all."""
    nodes = [node for node in _listed(table, name, sheet) if node in table.rows]
    values = table.of(nodes, "RF.RF2")[:, 0]
    force, size = math.fsum(values), math.fsum(np.abs(values))
    if len(table.total) == len(table.columns) and len(nodes) == len(table.rows):
        total = table.total[table.columns.index("RF.RF2")]
        if abs(total - force) > _AGREE * size:
            raise InputError(
                f"{path}, line {table.line}: RF.RF2 of {table.region} adds up to {force:.6g}, and "
                f"the total is {total:.6g}; expected whole tables"
            )
    if size > 0 and abs(force) < _AGREE * size:
        raise InputError(
            f"{path}, line {table.line}: RF.RF2 of {table.region} cancels to {force:.3g}; expected "
            "name a region where the load is read: the driven nodes alone"
        )
    return force


def _undeformed(path: Path, at: FloatArray, moved: FloatArray) -> tuple[FloatArray, str]:
    """Return coordinates that are the same in all frames, and whether COORD is before or after."""
    largest = float(np.abs(moved).max())
    spread = {
        "undeformed": float(np.ptp(at, axis=0).max()),
        "deformed": float(np.ptp(at - moved, axis=0).max()),
    }
    digits = 1e-5 * float(np.abs(at).max())
    how = min(spread, key=lambda name: spread[name])
    if len(at) < 2 or spread[how] > _MOVED * largest + digits or largest < 10 * digits:
        raise InputError(
            f"{path}: COORD changes by {spread['undeformed']:.3g} and COORD - U by "
            f"{spread['deformed']:.3g} between {len(at)} frames; expected one of them does not, or "
            "a deck for the coordinates"
        )
    base = at[0] if how == "undeformed" else np.median(at - moved, axis=0)
    return np.asarray(base, dtype=float), f"COORD: of {how} nodes, as all frames have it"
