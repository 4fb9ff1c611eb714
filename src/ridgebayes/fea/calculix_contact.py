"""CalculiX's contact print: which faces are pressed, and so in which increment ridges are."""

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.calculix_sta import read_sta
from ridgebayes.fea.deck import Deck, check_material, read_deck
from ridgebayes.fea.increments import transitions_of
from ridgebayes.fea.levels import Body, loads_of
from ridgebayes.fea.record import Imported, finite, provenance
from ridgebayes.fea.rim import Rim
from ridgebayes.runtime.reading import read_text
from ridgebayes.table.table import ContactTable

_HEAD = re.compile(
    r"\s*(contact stress|displacements|total force|forces) \(([^)]*)\) for "
    r"(?:set (\S+)|all \S+ \S+) and time +(\S+)\s*$"
)
_FACES = "slave element+face"
# CalculiX makes a plane element one layer of a solid, whose first two faces are its sides.
_SIDES = 2
_FARTHEST = 4.0  # of R: no body is pressed so wide


@dataclass(eq=False)
class Pressed:
    """What was printed at one time.

    Parameters
    ----------
    time : float
        Total time.
    line : int
        Where it begins.
    faces : set of (int, int), or None
        Element and side, counted from 1 as in the deck, of each slave face with pressure at one of
        its points; None if contact stress was not printed.
    force : float or None
        Vertical force on the driven set.
    moved : dict of int to float, or None
        Horizontal displacement of the surface's nodes; None if it was not printed.
    again : bool
        Whether the time had been printed before.
    """

    time: float
    line: int
    faces: set[tuple[int, int]] | None = None
    force: float | None = None
    moved: dict[int, float] | None = None
    again: bool = False


def read_calculix_contact(
    path: Path,
    body: Body,
    *,
    deck: Path,
    surface: str,
    reaction: str,
    sta: Path | None = None,
    brackets: bool = True,
) -> Imported:
    """Read in which increment each ridge is pressed first.

    Parameters
    ----------
    path : pathlib.Path
        The ``.dat`` file: ``*CONTACT PRINT`` of ``CSTR`` (of faces: ``TYPE=SURFACE TO SURFACE``),
        ``*NODE PRINT`` of ``RF`` on the driven set and, to place faces as they are rather than as
        they were, of ``U`` on the surface, at each increment.
    body : Body
        What the files do not say; `top` is not used.
    deck : pathlib.Path
        The run's ``.inp`` file.
    surface, reaction : str
        Node sets: the body's rim, and where the load is read.
    sta : pathlib.Path or None, optional
        The run's ``.sta``: levels that it does not call converged are left out.
    brackets : bool, optional
        As other readers have it; here increments are all that can be told.

    Returns
    -------
    Imported
        Each load as a bracket.

    Raises
    ------
    InputError
        If a file cannot be understood, with file and line; if a set is missing; if no ridge but
        the first is pressed.

    Notes
    -----
    A face over two ridges leaves open which of them it touches: such an increment is neither end
    of a bracket.
    """
    del brackets
    sheet = read_deck(deck)
    nodes = list(dict.fromkeys(sheet.nodes_of(surface, str(deck))))
    sheet.nodes_of(reaction, str(deck))
    check_material(sheet, body.E, body.nu, deck)
    found = read_pressed(path, surface, reaction)
    said = [f"{path}: {len(found)} levels"]
    if n := sum(one.again for one in found):
        said.append(f"{n} levels of a time printed again: the later one counts")
    if sta is not None:
        status = read_sta(sta)
        sure = status.converged(np.array([one.time for one in found]))
        said.append(status.said())
        if n := int((~sure).sum()):
            said.append(f"{n} levels that did not converge: left out")
        found = [one for one, kept in zip(found, sure, strict=True) if kept]
    lacks = [_lacks(one, nodes) for one in found]
    whole = [one for one, what in zip(found, lacks, strict=True) if not what]
    for one, what in zip(found, lacks, strict=True):
        if what:
            said.append(f"line {one.line}: a level with {what}: left out")
    if not whole:
        raise InputError(
            f"{path}: no level with contact stress and a total force of {reaction}, and "
            f"displacements of {surface} whole or not printed; expected *CONTACT PRINT of CSTR and "
            "*NODE PRINT of RF, TOTALS=ONLY"
        )
    undeformed = sheet.coordinates(nodes, str(deck))
    rim = Rim.of(undeformed, str(deck), R=body.R, symmetry=body.symmetry)
    placed = [_intervals(one, sheet, float(rim.centre[0]), path, deck) for one in whole]
    if n := sum(one.moved is None for one in whole):
        said.append(f"{n} levels without displacements of {surface}: faces where they were")
    farthest = max((float(one[:, 1].max()) for one in placed if len(one)), default=0.0)
    if farthest > _FARTHEST * rim.R:
        raise InputError(
            f"{path}: a face {farthest:.3g} from the axis, R = {rim.R:.6g}; expected within "
            f"{_FARTHEST:g} R"
        )
    gap = _history(placed, body.a_over_R * rim.R, body.b_over_R * rim.R)
    load = 2 if body.symmetry == "half" else 1
    p_over_E = loads_of(np.array([one.force or 0.0 for one in whole]), body, rim.R, str(path))
    try:
        frame, odd = transitions_of(p_over_E, gap, 4 + 2 * np.arange(gap.shape[1]), brackets=True)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    frame.insert(0, "a_over_R", body.a_over_R)
    frame.insert(1, "b_over_R", body.b_over_R)
    source = provenance(
        path, "calculix-contact", f"deck={deck.name}", f"surface={surface}", f"reaction={reaction}"
    )
    frame = frame.assign(nu=body.nu, solver="calculix", source=source)
    said += [
        f"surface: {len(nodes)} nodes on a circle of R = {rim.R:.6g}",
        f"texture: a/R = {body.a_over_R:g}, b/R = {body.b_over_R:g}, nu = {body.nu:g}",
        f"load: force {'times 2 ' if load == 2 else ''}over 2 R E, E = {body.E:g}, "
        f"{len(p_over_E)} increments to p/E = {p_over_E.max():.5g}",
        f"pressed faces: {max(len(one) for one in placed)} at most",
        *odd,
        f"kept: {len(frame)} transitions, Q = {frame['Q'].iloc[0]} to {frame['Q'].iloc[-1]}, "
        "all as brackets",
    ]
    return Imported(ContactTable.from_frame(frame, where=str(path)), tuple(said))


def read_pressed(path: Path, surface: str = "", reaction: str = "") -> list[Pressed]:
    """Read pressed faces, and what else was printed with them.

    Parameters
    ----------
    path : pathlib.Path
        The ``.dat`` file.
    surface, reaction : str, optional
        Node sets whose displacements and forces are read.

    Returns
    -------
    list of Pressed
        By time; of a time printed again the later one.

    Raises
    ------
    InputError
        If a line cannot be understood, with its number.
    """
    found: dict[float, Pressed] = {}
    block, level, seen = "", Pressed(0.0, 0), set[int]()
    lines = read_text(path).split("\n")
    lines.pop()  # nothing, or a last line without an end: half of one
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if not words:
            continue
        if words[0][0].isalpha():
            # CalculiX prints headings between blank lines: another line of letters among rows is
            # damage, and rows after it would be lost.
            if block and _HEAD.match(line) is None and _is_among(lines, number):
                raise InputError(
                    f"{path}, line {number}: {line.strip()[:60]!r} among rows of {block}; expected "
                    "rows, a blank line, a heading"
                )
            block, level = _head(path, number, line, found, level, surface, reaction)
            seen = set()
        elif block == "contact stress":
            values = _values(path, number, words, "element, face, press, tang1, tang2")
            side = int(values[1]) - _SIDES
            whole = values[0] == int(values[0]) and values[1] == int(values[1])
            if not whole or (values[2] > 0 and side < 1):
                raise InputError(
                    f"{path}, line {number}: face {words[1]} of {words[0]}; expected a side of a "
                    "plane element"
                )
            if values[2] > 0 and level.faces is not None:
                level.faces.add((int(values[0]), side))
        elif block == "displacements":
            values = _values(path, number, words, "node, vx, vy, vz")
            if level.moved is not None:
                level.moved[_once(path, number, words[0], values[0], seen)] = values[1]
        elif block == "total force":
            if level.force is not None:
                raise InputError(
                    f"{path}, line {number}: {line.strip()[:60]!r}; expected one total force a "
                    "level"
                )
            level.force = _values(path, number, words, "fx, fy, fz")[1]
        elif block == "forces":
            values = _values(path, number, words, "node, fx, fy, fz")
            _once(path, number, words[0], values[0], seen)
            level.force = (level.force or 0.0) + values[2]
    return [found[time] for time in sorted(found)]


def _is_among(lines: list[str], number: int) -> bool:
    """Return whether a line, counted from 1, has other than blank lines beside it."""
    return any(
        one.strip() for one in (*lines[number - 2 : number - 1], *lines[number : number + 1])
    )


def _once(path: Path, number: int, word: str, value: float, seen: set[int]) -> int:
    """Return a node's number, which is whole and has not stood in the block before."""
    node = int(value)
    if node != value or node in seen:
        raise InputError(
            f"{path}, line {number}: node {word[:40]!r}; expected a whole number, once a level"
        )
    seen.add(node)
    return node


def _lacks(level: Pressed, nodes: list[int]) -> str:
    """Return what a level has not, in words; nothing if it is whole."""
    if level.force is None:
        return "no total force"
    if level.faces is None:
        return "no contact stress"
    if level.moved is not None and (n := sum(node in level.moved for node in nodes)) < len(nodes):
        return f"displacements of {n} of {len(nodes)} nodes"
    return ""


def _head(
    path: Path,
    number: int,
    line: str,
    found: dict[float, Pressed],
    level: Pressed,
    surface: str,
    reaction: str,
) -> tuple[str, Pressed]:
    """Return which block begins, and the level that it belongs to."""
    match = _HEAD.match(line)
    if match is None:
        return "", level
    what, columns, name, word = match.groups()
    if what == "contact stress" and not columns.startswith(_FACES):
        raise InputError(
            f"{path}, line {number}: contact stress by ({columns}); expected of faces, "
            "TYPE=SURFACE "
            "TO SURFACE"
        )
    name = (name or "").upper()
    wanted = {"contact stress": "", "displacements": surface.upper()}.get(what, reaction.upper())
    if name != wanted:
        return "", level
    time = finite(path, number, word)
    level = found.setdefault(time, Pressed(time, number))
    if (what == "contact stress" and level.faces is not None) or (
        what != "contact stress"
        and (level.moved is not None if what == "displacements" else level.force is not None)
    ):
        level = found[time] = Pressed(time, number, again=True)
    if what == "contact stress":
        level.faces = set()
    elif what == "displacements":
        level.moved = {}
    return what, level


def _values(path: Path, number: int, words: list[str], columns: str) -> list[float]:
    if len(words) != columns.count(",") + 1:
        raise InputError(f"{path}, line {number}: {' '.join(words)[:60]!r}; expected {columns}")
    return [finite(path, number, word) for word in words]


def _intervals(level: Pressed, sheet: Deck, axis: float, path: Path, deck: Path) -> FloatArray:
    """Return from where to where pressed faces are, outwards from the axis, shape (n_face, 2)."""
    found = []
    for element, side in sorted(level.faces or ()):
        corners = _corners_of(element, sheet, deck)
        if side > len(corners):
            raise InputError(f"{deck}: element {element} has no side {side}")
        ends = [corners[side - 1], corners[side % len(corners)]]
        moved = [0.0 if level.moved is None else level.moved.get(node) for node in ends]
        if None in moved:
            raise InputError(
                f"{path}, line {level.line}: side {side} of element {element} is pressed, and node "
                f"{ends[moved.index(None)]} of it was not printed; expected a surface with the "
                "nodes "
                "of all pressed faces"
            )
        x = [sheet.nodes[node][0] + (u or 0.0) - axis for node, u in zip(ends, moved, strict=True)]
        sign = 1.0 if sum(x) >= 0 else -1.0
        found.append(sorted(sign * one for one in x))
    return np.array(found, dtype=float).reshape(-1, 2)


def _corners_of(element: int, sheet: Deck, deck: Path) -> tuple[int, ...]:
    nodes = sheet.elements.get(element)
    if nodes is None:
        raise InputError(f"{deck}: no element {element}, which is pressed; expected the run's deck")
    n = {3: 3, 6: 3, 4: 4, 8: 4}.get(len(nodes))
    places = [sheet.nodes.get(node) for node in nodes]
    if n is None or None in places or len(set(places)) < len(nodes):
        raise InputError(
            f"{deck}: element {element} of {len(nodes)} nodes; expected plane triangles and "
            "quadrilaterals"
        )
    return nodes[:n]


def _history(placed: list[FloatArray], a: float, b: float) -> FloatArray:
    """Return -inf where a ridge is pressed, inf where not, NaN where that is open.

    Shape (n_level, n_ridge), from the second ridge on.
    """
    farthest = max((float(one[:, 1].max()) for one in placed if len(one)), default=0.0)
    n = max(math.ceil((farthest - b / 2) / (a + b)), 1) + 1
    near = b / 2 + (a + b) * np.arange(n)
    gap = np.full((len(placed), n), math.inf)
    for i, faces in enumerate(placed):
        # Faces reach over the groove beside the ridge that presses them, at most to its middle.
        over = (faces[:, 1:] >= near) & (faces[:, :1] <= near + a)
        none = ~over.any(axis=1)
        over[none] = (faces[none, 1:] >= near - b) & (faces[none, :1] <= near + a + b)
        sure = over & (over.sum(axis=1, keepdims=True) == 1)
        gap[i, over.any(axis=0)] = math.nan
        gap[i, sure.any(axis=0)] = -math.inf
    return gap[:, 1:]
