"""CalculiX runs: what a ``.dat`` or a ``.frd`` prints, with its deck and its ``.sta``."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.calculix_sta import read_sta
from ridgebayes.fea.deck import RunDeck
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import Line, NodeRows, read_lines, unused

_HEAD = re.compile(
    r"\s*(total force|forces|displacements|relative contact displacement|contact stress)"
    r" \(([^)]*)\) for (?:set (\S+)|all \S+ ?\S*) and time +(\S+)\s*$"
)
_STRESS = "contact stress"
_FACES = "slave element+face"
_COLUMNS = {
    "total force": "fx, fy, fz",
    "forces": "node, fx, fy, fz",
    "displacements": "node, vx, vy, vz",
    _STRESS: "element, face, press, tang1, tang2",
}
# CalculiX makes a plane element one layer of a solid, whose first two faces are its sides.
_SIDES = 2
_DIGITS = 5e-7  # of a displacement: seven are printed
_FRD_DIGITS = 5e-6  # six are, in a .frd


@dataclass(eq=False)
class Level:
    """Blocks printed at one time.

    Parameters
    ----------
    line : int
        Where it begins.
    time : float
        Total time.
    blocks : dict of str to NodeRows
        Rows by kind of block.
    again : bool
        Whether the time had been printed before.
    """

    line: int
    time: float
    blocks: dict[str, NodeRows] = field(default_factory=dict)
    again: bool = False

    @property
    def force(self) -> float | None:
        """Vertical force on the driven set: the total, or else the sum over its nodes."""
        rows = self.blocks.get("total force", self.blocks.get("forces"))
        return None if rows is None or not len(rows.values) else float(rows.values[:, -2].sum())

    def moved(self, nodes: Sequence[int]) -> FloatArray | None:
        """Displacements of nodes, shape (n_node, 2), NaN where there are none; None without any."""
        rows = self.blocks.get("displacements")
        return None if rows is None else rows.of(nodes)[:, :2]


def read_calculix(path: Path, *, deck: RunDeck, sta: Path | None = None) -> ContactHistory:
    """Read a CalculiX run.

    Parameters
    ----------
    path : pathlib.Path
        A ``.dat`` file: ``*NODE PRINT`` of ``U`` on the surface's set, and of ``RF`` with
        ``TOTALS=ONLY`` or ``YES`` (or of each node) on the driven set, at each level; or, in place
        of displacements, ``*CONTACT PRINT`` of ``CSTR`` (of faces: ``TYPE=SURFACE TO SURFACE``).
        Or a ``.frd`` file: ``*NODE FILE, OUTPUT=2D`` of ``U`` and ``RF``.
    deck : RunDeck
        The run's ``.inp`` file: coordinates, sets, and the ridges' nodes.
    sta : pathlib.Path or None, optional
        The run's ``.sta``: levels of increments that it does not list as converged are ignored.

    Returns
    -------
    ContactHistory
        Heights of the surface, or which of its faces are pressed: where they were.

    Raises
    ------
    InputError
        If a file cannot be understood, with file and line; if a set is missing.
    """
    is_frd = path.suffix.lower() == ".frd"
    levels, messages = whole_levels(path, deck, sta)
    surface, reaction = deck.surface, deck.reaction
    source = deck.provenance(path, "calculix")
    said = (f"{path}: {len(levels)} levels with {surface} and {reaction}", *messages)
    force = np.array([one.force for one in levels], dtype=float)
    if levels and all("displacements" in one.blocks for one in levels):
        moved = np.array([one.moved(deck.nodes) for one in levels])
        at = deck.undeformed + moved
        return ContactHistory(
            force,
            str(path),
            source,
            "calculix",
            at[..., 0],
            at[..., 1],
            undeformed=deck.undeformed,
            rigid=deck.rigid,
            digits=float((_FRD_DIGITS if is_frd else _DIGITS) * np.abs(moved).max()),
            messages=said,
        )
    if levels:
        pressed = [
            {(int(e), int(f)) for e, f, p, *_ in one.blocks[_STRESS].values if p > 0}
            for one in levels
        ]
        faces = sorted(set().union(*pressed))
        ends = np.array([_ends(element, side - _SIDES, deck) for element, side in faces])
        ends = ends.reshape(-1, 2)
        closed = np.array([[one in here for one in faces] for here in pressed])
        n = max(map(len, pressed))
        return ContactHistory(
            force,
            str(path),
            source,
            "calculix",
            np.broadcast_to(ends.mean(axis=1), closed.shape),
            closed=closed,
            width=np.abs(np.diff(ends)[:, 0]),
            undeformed=deck.undeformed,
            messages=(*said, f"pressed faces: {n} at most, where they were"),
        )
    raise InputError(
        f"{path}: no level with displacements of {surface} or contact stress, and a total force of "
        f"{reaction}; expected "
        + (
            "*NODE FILE, OUTPUT=2D of U and RF"
            if is_frd
            else "*NODE PRINT of U on the one and of RF, TOTALS=ONLY, on the other"
        )
        + "".join(f"; {line}" for line in messages[:3])
    )


def _ends(element: int, side: int, run: RunDeck) -> tuple[float, float]:
    """Return from where to where a side of an element was."""
    nodes = run.deck.elements.get(element)
    if nodes is None:
        raise InputError(
            f"{run.path}: no element {element}, which is pressed; expected the run's deck"
        )
    n = {3: 3, 6: 3, 4: 4, 8: 4}.get(len(nodes))
    places = {run.deck.nodes.get(node) for node in nodes}
    if n is None or None in places or len(places) < len(nodes):
        raise InputError(
            f"{run.path}: element {element} of {len(nodes)} nodes; expected plane triangles and "
            "quadrilaterals"
        )
    if not 0 < side <= n:
        raise InputError(f"{run.path}: element {element} has no side {side}")
    first, last = (run.deck.nodes[nodes[i % n]][0] for i in (side - 1, side))
    return first, last


def whole_levels(path: Path, run: RunDeck, sta: Path | None) -> tuple[list[Level], list[str]]:
    """Return the levels of a run that converged and were printed whole, and messages.

    Parameters
    ----------
    path : pathlib.Path
        The ``.dat`` or ``.frd`` file.
    run : RunDeck
        Its sets.
    sta : pathlib.Path or None
        The ``.sta`` file.
    """
    read = _read_frd if path.suffix.lower() == ".frd" else read_levels
    levels, messages = read(path, run.surface, run.reaction)
    if path.suffix.lower() == ".frd":
        for one in levels:  # all nodes are printed: the load is that of the driven ones
            if (forces := one.blocks.get("forces")) is not None:
                driven = forces.of(run.driven)
                one.blocks["forces"] = NodeRows(np.array(run.driven), driven)
                if np.isnan(driven).any():
                    del one.blocks["forces"]
    if sta is not None:
        sure, said = read_sta(sta, np.array([one.time for one in levels]))
        messages.append(said)
        if n := int((~sure).sum()):
            messages.append(f"{n} levels ignored: they did not converge")
        levels = [one for one, keep in zip(levels, sure, strict=True) if keep]
    # Contact stress alone tells which faces carry; displacements tell more.
    is_moved = any("displacements" in one.blocks for one in levels)
    whole = []
    for one in levels:
        moved = one.moved(run.nodes)
        n = 0 if moved is None else int((~np.isnan(moved[:, 0])).sum())
        lacks = {
            "total force missing": one.force is None,
            f"displacements given for {n} of {len(run.nodes)} nodes": (
                is_moved and n < len(run.nodes)
            ),
            "contact stress missing": not is_moved and _STRESS not in one.blocks,
        }
        if lack := next((what for what, is_so in lacks.items() if is_so), ""):
            messages.append(f"line {one.line}: level ignored, {lack}")
        else:
            whole.append(one)
    return whole, messages


def read_levels(path: Path, surface: str, reaction: str) -> tuple[list[Level], list[str]]:
    """Read what a ``.dat`` has of two node sets, and of contact.

    Parameters
    ----------
    path : pathlib.Path
        The ``.dat`` file.
    surface, reaction : str
        Node sets whose displacements and forces are read.

    Returns
    -------
    list of Level
        By time; of a time printed again the later one.
    list of str
        Messages about blocks that were not used, and about times printed again.

    Raises
    ------
    InputError
        If a line cannot be understood, with its number.
    """
    wanted = {"displacements": surface, "total force": reaction, "forces": reaction, _STRESS: ""}
    found: dict[float, Level] = {}
    others: set[str] = set()
    level, block, rows = None, "", list[Line]()
    lines = read_lines(path)
    texts = ["", *(line.text.strip() for line in lines), ""]
    for line, before, text, after in zip(lines, texts, texts[1:], texts[2:], strict=False):
        if text and not text[0].isalpha():
            if level is not None:
                rows.append(line)
            continue
        if text and level is not None:
            _finish(level, block, rows)
        if match := _HEAD.match(line.text):
            block, rows = match[1], []
            level = _headed(line, match, wanted, found, others)
        elif text:
            # CalculiX prints headings between blank lines: another line of letters among rows is
            # damage, and rows after it would be lost.
            if level is not None and (before or after):
                raise line.error(
                    f"{text[:60]!r} among rows of {block}; expected rows, a blank line, a heading"
                )
            level = None
    if level is not None:
        _finish(level, block, rows)
    levels = [found[time] for time in sorted(found)]
    messages = unused(others)
    if n := sum(one.again for one in levels):
        messages.append(f"{n} levels of a time printed again: the later one counts")
    return levels, messages


def _headed(
    line: Line,
    match: re.Match[str],
    wanted: Mapping[str, str],
    found: dict[float, Level],
    others: set[str],
) -> Level | None:
    """Return the level that a block belongs to; None where it is not wanted."""
    block, columns, name = match[1], match[2], (match[3] or "").upper()
    if wanted.get(block, "-").upper() != name:
        others.add(f"{block} of {name or 'all'}")
        return None
    if block == _STRESS and not columns.startswith(_FACES):
        if not columns.startswith("slave node"):
            raise line.unexpected(f"contact stress ({_FACES},...) or (slave node,...)")
        others.add(f"contact stress by ({columns}); expected of faces, TYPE=SURFACE TO SURFACE")
        return None
    time = line.finite(match[4])
    level = found.setdefault(time, Level(line.number, time))
    if block in level.blocks:
        level = found[time] = Level(line.number, time, again=True)
    return level


def _finish(level: Level, block: str, lines: list[Line]) -> None:
    """Take the rows of a block."""
    is_node = block in ("forces", "displacements")
    rows = NodeRows.of_lines(lines, _COLUMNS[block], is_node=is_node)
    level.blocks[block] = rows
    if block == "total force" and len(lines) > 1:
        raise lines[1].unexpected("one total force a level")
    if block == _STRESS:
        element, face, pressure = rows.values[:, :3].T
        is_face = (element % 1 == 0) & (face % 1 == 0) & ((face > _SIDES) | (pressure <= 0))
        for i in np.flatnonzero(~is_face).tolist()[:1]:
            raise lines[i].error(
                f"face {face[i]:g} of {element[i]:g}; expected a side of a plane element"
            )


def _read_frd(path: Path, surface: str, reaction: str) -> tuple[list[Level], list[str]]:
    """Read displacements and forces of a ``.frd``: of all nodes, in columns of fixed width."""
    found: dict[float, Level] = {}
    names = {"DISP": "displacements", "FORC": "forces"}
    others: set[str] = set()
    time, width, block, n_column, rows = None, 0, "", 0, list[Line]()
    for line in read_lines(path):
        kind, text = line.text[:3], line.text
        if text[2:6] == "100C":
            time = line.finite(text[12:24].strip())
            form = text[73:75].strip()
            if form not in ("0", "1"):
                raise line.error(f"format {form!r}; expected text, 0 or 1, not binary")
            width = 10 if form == "1" else 5
        elif kind == " -4" and time is not None:
            name = text[5:13].strip()
            block, rows, n_column = names.get(name, ""), [], 0
            if not block:
                others.add(name)
        elif kind == " -5" and block:
            n_column += "ALL" not in text
        elif kind == " -1" and block:
            cells = [text[3 : 3 + width]]
            start = 3 + width
            cells += [text[start + 12 * i : start + 12 * i + 12] for i in range(n_column)]
            rows.append(Line(path, line.number, " ".join(cells)))
        elif kind == " -3" and block:
            assert time is not None
            level = found.setdefault(time, Level(line.number, time))
            if block in level.blocks:
                level = found[time] = Level(line.number, time, again=True)
            if n_column != len("xyz"):
                raise line.error(f"{n_column} components above; expected three, x, y and z")
            level.blocks[block] = NodeRows.of_lines(rows, "node, x, y, z")
            block = ""
    if not found and not others:
        raise InputError(f"{path}: no results; expected a .frd of CalculiX, not binary")
    return [found[time] for time in sorted(found)], unused(others)
