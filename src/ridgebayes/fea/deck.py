"""Input decks of Abaqus and CalculiX, as far as nodes, sets and a material go."""

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.record import finite
from ridgebayes.runtime.reading import read_text

_DEEPEST = 4  # *INCLUDEs within *INCLUDEs
_MOST_NODES = 1_000_000  # of a set


@dataclass
class Deck:
    """Nodes, node sets and what the material says of E and nu.

    Parameters
    ----------
    nodes : dict of int to (float, float)
        Coordinates x and y by number.
    nsets : dict of str to list of int
        Node sets by name, in capitals, each in the order in which it is given.
    elements : dict of int to tuple of int
        Nodes of the elements by number.
    E, nu : float or None
        Of ``*HYPERELASTIC, NEO HOOKE``, or else of the first ``*ELASTIC``; None without either.
    """

    nodes: dict[int, tuple[float, float]] = field(default_factory=dict)
    nsets: dict[str, list[int]] = field(default_factory=dict)
    elements: dict[int, tuple[int, ...]] = field(default_factory=dict)
    E: float | None = None
    nu: float | None = None

    def nodes_of(self, name: str, where: str) -> list[int]:
        """Return the nodes of a set.

        Raises
        ------
        InputError
            If there is no such set.
        """
        if name.upper() not in self.nsets:
            there = ", ".join(self.nsets) or "none"
            raise InputError(f"{where}: no node set {name!r}; the node sets are {there}")
        return self.nsets[name.upper()]

    def coordinates(self, numbers: list[int], where: str) -> FloatArray:
        """Return coordinates of nodes, shape (n, 2).

        Raises
        ------
        InputError
            If a node is not in the deck.
        """
        missing = [number for number in numbers if number not in self.nodes]
        if missing:
            raise InputError(f"{where}: node {missing[0]} is not in the deck")
        return np.array([self.nodes[number] for number in numbers], dtype=float).reshape(-1, 2)


def read_deck(path: Path) -> Deck:
    """Read a deck.

    Parameters
    ----------
    path : pathlib.Path
        A ``.inp`` file; files that it includes have to lie in its folder.

    Returns
    -------
    Deck

    Raises
    ------
    InputError
        With file, line and rule, if a node, a set or an include cannot be understood.
    """
    deck = Deck()
    _read(path, deck, 0)
    if not deck.nodes:
        raise InputError(f"{path}: no *NODE block; expected an Abaqus or CalculiX input deck")
    return deck


def check_material(deck: Deck, E: float, nu: float, path: Path) -> None:
    """Refuse an E or nu that is not the deck's.

    Parameters
    ----------
    deck : Deck
        As read.
    E, nu : float
        What the user says.
    path : pathlib.Path
        The deck's, for messages.

    Raises
    ------
    InputError
        If E is off by a thousandth, or nu by 0.001.
    """
    if deck.E is not None and not math.isclose(deck.E, E, rel_tol=1e-3):
        raise InputError(
            f"{path}: the material has E = {deck.E:.6g}, and {E:g} was given; use --E as in "
            "the deck"
        )
    if deck.nu is not None and abs(deck.nu - nu) > 1e-3:
        raise InputError(
            f"{path}: the material has nu = {deck.nu:.6g}, and {nu:g} was given; use --nu "
            "as in the deck"
        )


def rigid_nodes(deck: Deck, body: list[int]) -> list[int]:
    """List the nodes that no chain of elements joins to the body's.

    Parameters
    ----------
    deck : Deck
        As read.
    body : list of int
        Some nodes of the body.

    Returns
    -------
    list of int
    """
    meets: dict[int, list[int]] = {}
    for number, some in deck.elements.items():
        for node in some:
            meets.setdefault(node, []).append(number)
    found, seen, ahead = set(body), set[int](), list(body)
    while ahead:
        for number in meets.get(ahead.pop(), ()):
            if number not in seen:
                seen.add(number)
                new = [node for node in deck.elements[number] if node not in found]
                found.update(new)
                ahead += new
    return [node for node in deck.nodes if node not in found]


def _read(path: Path, deck: Deck, depth: int) -> None:
    keyword, options, rows = "", dict[str, str](), list[tuple[int, list[str]]]()
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        text = line.strip()
        if not text or text.startswith("**"):
            continue
        if text.startswith("*"):
            _block(path, deck, keyword, options, rows, depth)
            keyword, options = _keyword(text)
            rows = [(number, [])] if keyword == "INCLUDE" else []
        elif keyword in _READ:
            rows.append((number, [cell.strip() for cell in text.split(",")]))
    _block(path, deck, keyword, options, rows, depth)


_READ = ("NODE", "NSET", "ELEMENT", "HYPERELASTIC", "ELASTIC", "INCLUDE")


def _keyword(text: str) -> tuple[str, dict[str, str]]:
    name, *rest = text[1:].split(",")
    options = {}
    for one in rest:
        key, _, value = one.partition("=")
        options[key.strip().upper()] = value.strip()
    return name.strip().upper(), options


def _block(
    path: Path,
    deck: Deck,
    keyword: str,
    options: dict[str, str],
    rows: list[tuple[int, list[str]]],
    depth: int,
) -> None:
    if keyword == "NODE":
        for number, cells in rows:
            values = _numbers(path, number, cells[:3], at_least=3)
            name = _integer(path, number, values[0])
            new = (values[1], values[2])
            if deck.nodes.setdefault(name, new) != new:
                raise InputError(
                    f"{path}, line {number}: node {name} stands at two places; expected a deck "
                    "without parts, each node once"
                )
        if "NSET" in options:
            some = deck.nsets.setdefault(options["NSET"].upper(), [])
            some += [_integer(path, n, *_numbers(path, n, cells[:1])) for n, cells in rows]
    elif keyword == "NSET":
        _nset(path, deck, options, rows)
    elif keyword == "ELEMENT":
        flat: list[str] = []
        for number, cells in rows:
            # A line that ends in a comma goes on.
            goes_on = cells[-1] == ""
            flat += [cell for cell in cells if cell]
            if not goes_on:
                element, *nodes = (_integer(path, number, v) for v in _numbers(path, number, flat))
                deck.elements[element] = tuple(nodes)
                flat = []
        if flat:
            raise InputError(
                f"{path}, line {rows[-1][0]}: an element ends in a comma; expected nodes"
            )
    elif rows and (keyword == "HYPERELASTIC" or (keyword == "ELASTIC" and deck.E is None)):
        # Rubber is the body even where the ridges' metal stands before it.
        _material(path, deck, keyword, options, *rows[0])
    elif keyword == "INCLUDE":
        given = options.get("INPUT", "").strip("\"'")
        target = Path(given)
        line = rows[0][0]
        if not given or target.is_absolute() or ".." in target.parts:
            raise InputError(
                f"{path}, line {line}: *INCLUDE of {given!r}: expected a file in the deck's own "
                "folder"
            )
        if depth >= _DEEPEST:
            raise InputError(f"{path}, line {line}: *INCLUDE: expected at most {_DEEPEST} deep")
        inside = path.parent / target
        if not inside.resolve().is_relative_to(path.parent.resolve()):
            raise InputError(
                f"{path}, line {line}: *INCLUDE of {given!r}: expected a file in the deck's own "
                "folder"
            )
        _read(inside, deck, depth + 1)


def _nset(
    path: Path, deck: Deck, options: dict[str, str], rows: list[tuple[int, list[str]]]
) -> None:
    name = options.get("NSET", "")
    if not name:
        line = rows[0][0] if rows else 0
        raise InputError(f"{path}, line {line}: *NSET without a name; expected NSET=name")
    some = deck.nsets.setdefault(name.upper(), [])
    for number, cells in rows:
        cells = [cell for cell in cells if cell]
        if "GENERATE" in options:
            values = [_integer(path, number, v) for v in _numbers(path, number, cells, at_least=2)]
            step = values[2] if len(values) > 2 else 1
            new = range(values[0], values[1] + 1, step)
            if len(some) + len(new) > _MOST_NODES:
                raise InputError(
                    f"{path}, line {number}: GENERATE of {len(new)} nodes: expected at most "
                    f"{_MOST_NODES} in a set"
                )
            some += new
            continue
        for cell in cells:
            if cell.upper() in deck.nsets:
                some += deck.nsets[cell.upper()]
            else:
                (value,) = _numbers(path, number, [cell])
                some.append(_integer(path, number, value))


def _material(
    path: Path, deck: Deck, keyword: str, options: dict[str, str], number: int, cells: list[str]
) -> None:
    if keyword == "ELASTIC":
        if any(cell for cell in cells):
            values = _numbers(path, number, cells[:2], at_least=2)
            deck.E, deck.nu = values[0], values[1]
        return
    if not any(name.replace(" ", "-") == "NEO-HOOKE" for name in options):
        return
    c10, d1 = _numbers(path, number, cells[:2], at_least=2)
    if not (c10 > 0 and d1 >= 0):
        raise InputError(
            f"{path}, line {number}: C10 = {c10:g}, D1 = {d1:g}; expected > 0 and >= 0"
        )
    mu = 2 * c10
    if d1 == 0:
        deck.E, deck.nu = 3 * mu, 0.5
    else:
        bulk = 2 / d1
        deck.E = 9 * bulk * mu / (3 * bulk + mu)
        deck.nu = (3 * bulk - 2 * mu) / (2 * (3 * bulk + mu))


def _numbers(path: Path, line: int, cells: list[str], *, at_least: int = 1) -> list[float]:
    found = [finite(path, line, cell, column) for column, cell in enumerate(cells, start=1)]
    if len(found) < at_least:
        raise InputError(f"{path}, line {line}: {len(found)} values; expected at least {at_least}")
    return found


def _integer(path: Path, line: int, value: float) -> int:
    if value != int(value) or not 0 < value < 2**53:
        raise InputError(f"{path}, line {line}: {value:g}: expected a whole number above 0")
    return int(value)
