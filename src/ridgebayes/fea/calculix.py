"""CalculiX runs: printed displacements and total forces of a ``.dat`` with its deck."""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ridgebayes.errors import InputError
from ridgebayes.fea.calculix_sta import read_sta
from ridgebayes.fea.deck import check_material, read_deck, rigid_nodes
from ridgebayes.fea.levels import Body, Levels, table_of
from ridgebayes.fea.record import Imported, finite, provenance
from ridgebayes.runtime.reading import read_text

_HEAD = re.compile(
    r" ?(total force|forces|displacements|relative contact displacement|contact stress)"
    r" \(([^)]*)\) for (?:set (\S+)|all \S+ ?\S*) and time +(\S+)"
)
_DIGITS = 5e-7  # of a displacement: seven are printed


@dataclass
class Level:
    """What was printed at one time."""

    line: int
    time: float = 0.0
    force: float | None = None
    moved: dict[int, tuple[float, float]] = field(default_factory=dict)


def read_calculix(
    path: Path,
    body: Body,
    *,
    deck: Path,
    surface: str,
    reaction: str,
    sta: Path | None = None,
    brackets: bool = False,
) -> Imported:
    """Read a CalculiX run.

    Parameters
    ----------
    path : pathlib.Path
        The ``.dat`` file: ``*NODE PRINT`` of ``U`` on the surface's set, and of ``RF`` with
        ``TOTALS=ONLY`` or ``YES`` (or of each node) on the driven set, at each level.
    body : Body
        What the files do not say; where its E is 1 and the deck has another, see `Raises`.
    deck : pathlib.Path
        The run's ``.inp`` file: coordinates, sets, and the ridges' nodes.
    surface, reaction : str
        Node sets: the body's rim, and where the load is read.
    sta : pathlib.Path or None, optional
        The run's ``.sta``: levels whose increment it does not have as converged are left out.
    brackets : bool, optional
        As `ridgebayes.fea.increments.transitions_of`.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        If a file cannot be understood, with file and line; if a set is missing.
    """
    sheet = read_deck(deck)
    nodes = sheet.nodes_of(surface, str(deck))
    sheet.nodes_of(reaction, str(deck))
    nodes = list(dict.fromkeys(nodes))
    undeformed = sheet.coordinates(nodes, str(deck))
    levels, said = read_levels(path, surface.upper(), reaction.upper())
    whole = [one for one in levels if one.force is not None and _complete(one, nodes)]
    for one in levels:
        if one.force is None or not _complete(one, nodes):
            has = (
                "no total force" if one.force is None else f"{len(one.moved)} of {len(nodes)} nodes"
            )
            said.append(f"line {one.line}: a level with {has}: left out")
    if sta is not None:
        status = read_sta(sta)
        said.append(status.said())
        sure = status.converged(np.array([one.time for one in whole]))
        if n := int((~sure).sum()):
            said.append(f"{n} levels of no converged increment: left out")
        whole = [one for one, keep in zip(whole, sure, strict=True) if keep]
    if not whole:
        raise InputError(
            f"{path}: no level with displacements of {surface} and a total force of {reaction}; "
            "expected *NODE PRINT of U on the one and of RF, TOTALS=ONLY, on the other"
        )
    moved = np.array([[one.moved[node] for node in nodes] for one in whole])
    rigid = sheet.coordinates(rigid_nodes(sheet, nodes), str(deck))
    taken = Levels(
        np.array([one.force for one in whole], dtype=float),
        undeformed,
        undeformed + moved,
        rigid,
        digits=float(_DIGITS * np.abs(moved).max()),
        said=(f"{path}: {len(whole)} levels with {surface} and {reaction}", *said),
    )
    check_material(sheet, body.E, body.nu, deck)
    source = provenance(
        path, "calculix", f"deck={deck.name}", f"surface={surface}", f"reaction={reaction}"
    )
    return table_of(
        taken, body, where=str(path), solver="calculix", source=source, brackets=brackets
    )


def _complete(level: Level, nodes: list[int]) -> bool:
    return level.moved.keys() >= set(nodes)


def read_levels(path: Path, surface: str, reaction: str) -> tuple[list[Level], list[str]]:
    """Return what was printed of the two sets, by time in the order of the file."""
    found: dict[float, Level] = {}
    repeated, others = 0, set[str]()
    block, level = "", None
    summed: dict[float, float] = {}
    # A line without its end was being written when the run was stopped.
    lines = read_text(path).split("\n")[:-1]
    for number, line in enumerate(lines, start=1):
        head = _HEAD.match(line)
        if head is not None:
            what, _, name, time_text = head.groups()
            block, level = "", None
            name = (name or "").upper()
            time = finite(path, number, time_text)
            if what == "displacements" and name == surface:
                block = "moved"
            elif what in ("total force", "forces") and name == reaction:
                block = what
            else:
                others.add(f"{what} of {name or 'all'}")
                continue
            level = found.get(time)
            again = level is not None and (
                level.moved if block == "moved" else level.force is not None and block != "forces"
            )
            if level is None or again:
                repeated += level is not None
                level = found[time] = Level(number, time)
                summed[time] = 0.0
            continue
        words = line.split()
        if not words or level is None:
            continue
        if block == "moved":
            if len(words) != 4:
                raise InputError(
                    f"{path}, line {number}: {line.strip()[:60]!r}; expected node, vx, vy, vz"
                )
            values = [finite(path, number, word) for word in words]
            node = int(values[0])
            if node != values[0] or node in level.moved:
                raise InputError(
                    f"{path}, line {number}: node {words[0]!r}; expected a whole number, once a "
                    "level"
                )
            level.moved[node] = (values[1], values[2])
        elif block == "total force":
            if len(words) != 3:
                raise InputError(
                    f"{path}, line {number}: {line.strip()[:60]!r}; expected fx, fy, fz"
                )
            level.force = [finite(path, number, word) for word in words][1]
            block = "done"
        elif block == "forces":
            if len(words) != 4:
                raise InputError(
                    f"{path}, line {number}: {line.strip()[:60]!r}; expected node, fx, fy, fz"
                )
            level.force = (level.force or 0.0) + [finite(path, number, w) for w in words][2]
    said = [f"not used: {', '.join(sorted(others))}"] if others else []
    if repeated:
        said.append(f"{repeated} levels of a time printed again: the later one counts")
    return [found[time] for time in sorted(found)], said
