"""CalculiX runs: displacements and forces of a ``.dat``, with its deck and its ``.sta``."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.deck import RunDeck
from ridgebayes.fea.lines import Line, read_lines, unused
from ridgebayes.fea.record import Imported
from ridgebayes.fea.surface import Body, Origin, SurfaceHistory, table_from_history

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
# Of a .sta: step, increment, attempt (U where it did not converge), iterations, three times.
_ATTEMPT = re.compile(
    r"\s*(\d{1,9})\s+(\d{1,9})\s+(\d{1,9})(U?)\s+(\d{1,9})\s+(\S+)\s+(\S+)\s+(\S+)\s*$"
)
_HEADS = ("SUMMARY OF JOB INFORMATION", "STEP")
_PRINTED = 2e-6  # of a time: six digits are printed here, seven in the .dat


@dataclass(eq=False)
class Level:
    """What was printed at one time.

    Parameters
    ----------
    line : int
        Where it begins.
    time : float
        Total time.
    rows : dict of str to dict
        Values by kind of block, and by node; a total force has one row, pressed faces have theirs
        by element and side, counted from 1 as in the deck.
    again : bool
        Whether the time had been printed before.
    """

    line: int
    time: float
    rows: dict[str, dict[Any, list[float]]] = field(default_factory=dict)
    again: bool = False

    @property
    def moved(self) -> dict[int, list[float]] | None:
        """Displacements of the surface's nodes; None if they were not printed."""
        return self.rows.get("displacements")

    @property
    def faces(self) -> set[tuple[int, int]] | None:
        """Slave faces with pressure at one of their points; None without contact stress."""
        return set(self.rows[_STRESS]) if _STRESS in self.rows else None

    @property
    def force(self) -> float | None:
        """Vertical force on the driven set: the total, or else the sum over its nodes."""
        forces = self.rows.get("total force", self.rows.get("forces"))
        return sum(y for _, y, _ in forces.values()) if forces else None


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
        The run's ``.sta``: levels of increments that it does not list as converged are ignored.
    brackets : bool, optional
        As `ridgebayes.fea.transitions.transitions_of`.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        If a file cannot be understood, with file and line; if a set is missing.
    """
    run = RunDeck.read(deck, surface, reaction, E=body.E, nu=body.nu)
    levels, messages = whole_levels(path, run, sta, contact=False)
    if not levels:
        raise InputError(
            f"{path}: no level with displacements of {surface} and a total force of {reaction}; "
            "expected *NODE PRINT of U on the one and of RF, TOTALS=ONLY, on the other"
        )
    moved = np.array([[(one.moved or {})[node][:2] for node in run.nodes] for one in levels])
    history = SurfaceHistory(
        np.array([one.force for one in levels], dtype=float),
        run.undeformed,
        run.undeformed + moved,
        run.rigid,
        digits=float(_DIGITS * np.abs(moved).max()),
        messages=(f"{path}: {len(levels)} levels with {surface} and {reaction}", *messages),
    )
    origin = Origin(str(path), "calculix", run.provenance(path, "calculix"))
    return table_from_history(history, body, origin, brackets=brackets)


def whole_levels(
    path: Path, run: RunDeck, sta: Path | None, *, contact: bool
) -> tuple[list[Level], list[str]]:
    """Return the levels of a run that converged and were printed whole, and messages.

    Parameters
    ----------
    path : pathlib.Path
        The ``.dat`` file.
    run : RunDeck
        Its sets.
    sta : pathlib.Path or None
        The ``.sta`` file.
    contact : bool
        Whether contact stress makes a level whole, rather than displacements.
    """
    levels, messages = read_levels(path, run.surface, run.reaction, contact=contact)
    if sta is not None:
        status = read_sta(sta)
        messages.append(status.summary())
        sure = status.converged(np.array([one.time for one in levels]))
        if n := int((~sure).sum()):
            messages.append(f"{n} levels ignored: they did not converge")
        levels = [one for one, keep in zip(levels, sure, strict=True) if keep]
    whole = []
    for one in levels:
        n = sum(node in (one.moved or {}) for node in run.nodes)
        lacks = {
            "total force missing": one.force is None,
            "contact stress missing": contact and one.faces is None,
            f"displacements given for {n} of {len(run.nodes)} nodes": (
                n < len(run.nodes) and not (contact and one.moved is None)
            ),
        }
        if lack := next((what for what, is_so in lacks.items() if is_so), ""):
            messages.append(f"line {one.line}: level ignored, {lack}")
        else:
            whole.append(one)
    return whole, messages


def read_levels(
    path: Path, surface: str, reaction: str, *, contact: bool = False
) -> tuple[list[Level], list[str]]:
    """Read what was printed of two node sets, and of contact.

    Parameters
    ----------
    path : pathlib.Path
        The ``.dat`` file.
    surface, reaction : str
        Node sets whose displacements and forces are read.
    contact : bool, optional
        Whether to read contact stress.

    Returns
    -------
    list of Level
        By time; of a time printed again the later one.
    list of str
        What was not used.

    Raises
    ------
    InputError
        If a line cannot be understood, with its number.
    """
    wanted = {"displacements": surface, "total force": reaction, "forces": reaction}
    wanted |= {_STRESS: ""} if contact else {}
    found: dict[float, Level] = {}
    others: set[str] = set()
    level, block = None, ""
    lines = read_lines(path)
    texts = ["", *(line.text.strip() for line in lines), ""]
    for line, before, text, after in zip(lines, texts, texts[1:], texts[2:], strict=False):
        if text and not text[0].isalpha():
            if level is not None:
                _row(line, block, level.rows[block])
        elif match := _HEAD.match(line.text):
            level, block, columns = None, match[1], match[2]
            name = (match[3] or "").upper()
            if wanted.get(block, "-").upper() != name:
                others.add(f"{block} of {name or 'all'}")
                continue
            if block == _STRESS and not columns.startswith(_FACES):
                raise line.error(
                    f"contact stress by ({columns}); expected of faces, TYPE=SURFACE TO SURFACE"
                )
            time = line.finite(match[4])
            level = found.setdefault(time, Level(line.number, time))
            if block in level.rows:
                level = found[time] = Level(line.number, time, again=True)
            level.rows[block] = {}
        elif text:
            # CalculiX prints headings between blank lines: another line of letters among rows is
            # damage, and rows after it would be lost.
            if level is not None and (before or after):
                raise line.error(
                    f"{text[:60]!r} among rows of {block}; expected rows, a blank line, a heading"
                )
            level = None
    levels = [found[time] for time in sorted(found)]
    messages = unused(others)
    if n := sum(one.again for one in levels):
        messages.append(f"{n} levels of a time printed again: the later one counts")
    return levels, messages


def _row(line: Line, block: str, rows: dict[Any, list[float]]) -> None:
    """Take a row of a block."""
    if block == "total force" and rows:
        raise line.unexpected("one total force a level")
    values = line.values(_COLUMNS[block])
    if block == "total force":
        rows[0] = values
    elif block != _STRESS:
        rows[line.node(line.words[0], rows)] = values[1:]
    else:
        element, face, pressure, *_ = values
        side = int(face) - _SIDES
        is_whole = element == int(element) and face == int(face)
        if not is_whole or (pressure > 0 and side < 1):
            raise line.error(f"face {face:g} of {element:g}; expected a side of a plane element")
        if pressure > 0:
            rows[int(element), side] = values


@dataclass(frozen=True, eq=False)
class Status:
    """What a ``.sta`` says.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    times : ndarray of float, shape (n,)
        Total time at the end of each converged increment.
    cut_backs : int
        Attempts that did not converge and were followed by another.
    tail : int
        Attempts at the end that did not converge: the run stopped there.
    """

    path: Path
    times: FloatArray
    cut_backs: int
    tail: int

    def converged(self, times: FloatArray) -> np.ndarray:
        """Tell which times are those of converged increments.

        Parameters
        ----------
        times : ndarray of float, shape (n_level,)
            Total times, as a ``.dat`` prints them.

        Returns
        -------
        ndarray of bool, shape (n_level,)
        """
        far = np.abs(np.asarray(times, dtype=float)[:, None] - self.times)
        return np.asarray((far <= _PRINTED * np.abs(self.times)).any(axis=1))

    def summary(self) -> str:
        """Return one line about the run."""
        n = len(self.times)
        last = f", the last at time {self.times[-1]:.6g}" if n else ""
        tail = f"; it stopped after {self.tail} attempts without convergence" if self.tail else ""
        return f"{self.path}: {n} converged increments{last}, {self.cut_backs} cut-backs{tail}"


def read_sta(path: Path) -> Status:
    """Read a ``.sta``.

    Parameters
    ----------
    path : pathlib.Path
        The file.

    Returns
    -------
    Status

    Raises
    ------
    InputError
        If a line cannot be understood, with its number, or there is none.

    Notes
    -----
    A last line without an end is that of a run still going on: it is not read.
    """
    found: dict[tuple[int, int], float] = {}
    cut_backs, tail, last = 0, 0, 0.0
    for line in read_lines(path):
        if not line.text.strip() or line.text.strip().startswith(_HEADS):
            continue
        match = _ATTEMPT.match(line.text)
        if match is None:
            raise line.unexpected(
                "STEP, INC, ATT, ITRS and three times, as CalculiX's .sta has them"
            )
        time, *_ = [line.finite(word) for word in match.groups()[5:]]
        if match[4]:
            tail += 1
            continue
        cut_backs, tail = cut_backs + tail, 0
        key = (int(match[1]), int(match[2]))
        if key in found or time < last:
            raise line.error(
                f"step {key[0]}, increment {key[1]} at time {time:g}; expected each once, in the "
                "order of time"
            )
        found[key] = last = time
    if not found and not tail:
        raise InputError(f"{path}: no increments; expected a .sta of CalculiX")
    return Status(path, np.array(list(found.values())), cut_backs, tail)
