"""Input decks of Abaqus and CalculiX, as far as nodes, sets and a material go."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np
from scipy.cluster.hierarchy import DisjointSet

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.lines import Line, read_lines
from ridgebayes.fea.record import provenance

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
    printed : dict of str to list of str
        Node sets by what ``*NODE PRINT`` writes of them: "U" and "RF".
    """

    nodes: dict[int, tuple[float, float]] = field(default_factory=dict)
    nsets: dict[str, list[int]] = field(default_factory=dict)
    elements: dict[int, tuple[int, ...]] = field(default_factory=dict)
    E: float | None = None
    nu: float | None = None
    printed: dict[str, list[str]] = field(default_factory=dict)

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

    def check_material(self, E: float, nu: float, path: Path) -> None:
        """Refuse an E off by a thousandth, or a nu off by 0.001.

        Parameters
        ----------
        E, nu : float
            Young's modulus, in the deck's unit, and Poisson's ratio, as the user gives them.
        path : pathlib.Path
            The deck's, for messages.

        Raises
        ------
        InputError
        """
        for name, own, given, off in (
            ("E", self.E, E, {"rel_tol": 1e-3}),
            ("nu", self.nu, nu, {"rel_tol": 0.0, "abs_tol": 1e-3}),
        ):
            if own is not None and not math.isclose(own, given, **off):
                raise InputError(
                    f"{path}: the material has {name} = {own:.6g}, and {given:g} was given; use "
                    f"--{name} as in the deck"
                )

    def rigid_nodes(self, body: list[int]) -> list[int]:
        """List the nodes that no chain of elements joins to some nodes of the body."""
        joined = DisjointSet({*self.nodes, *body, *chain(*self.elements.values())})
        for first, *others in self.elements.values():
            for node in others:
                joined.merge(first, node)
        bodies = {joined[node] for node in body}
        return [node for node in self.nodes if joined[node] not in bodies]


@dataclass(frozen=True, eq=False)
class RunDeck:
    """The deck of a run, with the node sets that its results are printed for.

    Parameters
    ----------
    path : pathlib.Path
        The ``.inp`` file.
    deck : Deck
        As read.
    surface, reaction : str
        Node sets: the body's surface, and where the load is read.
    nodes, driven : list of int
        Their nodes, each once.
    """

    path: Path
    deck: Deck
    surface: str
    reaction: str
    nodes: list[int]
    driven: list[int]

    @classmethod
    def read(cls, path: Path, surface: str, reaction: str, *, E: float, nu: float) -> "RunDeck":
        """Read a deck whose material is of E and nu.

        Raises
        ------
        InputError
            If it cannot be understood, has other sets, or another material.
        """
        deck = read_deck(path)
        nodes, driven = (
            list(dict.fromkeys(deck.nodes_of(name, str(path)))) for name in (surface, reaction)
        )
        deck.check_material(E, nu, path)
        return cls(path, deck, surface, reaction, nodes, driven)

    @property
    def undeformed(self) -> FloatArray:
        """Coordinates of the surface's nodes, shape (n_node, 2)."""
        return self.deck.coordinates(self.nodes, str(self.path))

    @property
    def rigid(self) -> FloatArray:
        """Coordinates of nodes that are not the body's, shape (n, 2)."""
        return self.deck.coordinates(self.deck.rigid_nodes(self.nodes), str(self.path))

    def provenance(self, path: Path, importer: str) -> str:
        """Return where rows of a run's results come from."""
        names = (f"surface={self.surface}", f"reaction={self.reaction}")
        return provenance(path, importer, f"deck={self.path.name}", *names)


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


@dataclass
class _Block:
    """A keyword with its options, and the cells of each line below it."""

    line: Line
    keyword: str
    options: dict[str, str]
    depth: int
    rows: list[tuple[Line, list[str]]] = field(default_factory=list)


def _read(path: Path, deck: Deck, depth: int) -> None:
    blocks: list[_Block] = []
    for line in read_lines(path, unfinished=True):
        text = line.text.strip()
        if not text or text.startswith("**"):
            continue
        cells = [cell.strip() for cell in text.split(",")]
        if text.startswith("*"):
            parts = (cell.partition("=") for cell in cells[1:])
            options = {key.strip().upper(): value.strip() for key, _, value in parts}
            blocks.append(_Block(line, cells[0][1:].strip().upper(), options, depth))
        elif blocks and blocks[-1].keyword in _READERS:
            blocks[-1].rows.append((line, cells))
    for block in blocks:
        if block.keyword in _READERS:
            _READERS[block.keyword](block, deck)


def _nodes(block: _Block, deck: Deck) -> None:
    found = []
    for line, cells in block.rows:
        _, x, y = _numbers(line, cells[:3], at_least=3)
        (node,) = _integers(line, cells[:1])
        if deck.nodes.setdefault(node, (x, y)) != (x, y):
            raise line.error(
                f"node {node} stands at two places; expected a deck without parts, each node once"
            )
        found.append(node)
    if "NSET" in block.options:
        deck.nsets.setdefault(block.options["NSET"].upper(), []).extend(found)


def _nset(block: _Block, deck: Deck) -> None:
    name = block.options.get("NSET", "")
    if not name:
        raise block.line.error("*NSET without a name; expected NSET=name")
    some = deck.nsets.setdefault(name.upper(), [])
    for line, all_cells in block.rows:
        cells = [cell for cell in all_cells if cell]
        if "GENERATE" in block.options:
            first, last, *step = _integers(line, cells, at_least=2)
            new = range(first, last + 1, step[0] if step else 1)
            if len(some) + len(new) > _MOST_NODES:
                raise line.error(
                    f"GENERATE of {len(new)} nodes: expected at most {_MOST_NODES} in a set"
                )
            some += new
            continue
        for cell in cells:
            known = deck.nsets.get(cell.upper())
            some += _integers(line, [cell]) if known is None else known


def _elements(block: _Block, deck: Deck) -> None:
    flat: list[str] = []
    for line, cells in block.rows:
        flat += [cell for cell in cells if cell]
        if cells[-1]:  # a line that ends in a comma goes on
            element, *nodes = _integers(line, flat)
            deck.elements[element] = tuple(nodes)
            flat = []
    if flat:
        raise block.rows[-1][0].error("an element ends in a comma; expected nodes")


def _elastic(block: _Block, deck: Deck) -> None:
    # Rubber is the body even where the ridges' metal stands before it.
    if deck.E is None and block.rows and any(block.rows[0][1]):
        line, cells = block.rows[0]
        deck.E, deck.nu = _numbers(line, cells[:2], at_least=2)


def _hyperelastic(block: _Block, deck: Deck) -> None:
    if not block.rows or not any(n.replace(" ", "-") == "NEO-HOOKE" for n in block.options):
        return
    line, cells = block.rows[0]
    c10, d1 = _numbers(line, cells[:2], at_least=2)
    if not (c10 > 0 and d1 >= 0):
        raise line.error(f"C10 = {c10:g}, D1 = {d1:g}; expected > 0 and >= 0")
    mu = 2 * c10
    bulk = 2 / d1 if d1 else math.inf
    deck.nu = (3 * bulk - 2 * mu) / (2 * (3 * bulk + mu)) if d1 else 0.5
    deck.E = 2 * mu * (1 + deck.nu)


def _node_print(block: _Block, deck: Deck) -> None:
    name = block.options.get("NSET", "").upper()
    for cell in (cell for _, cells in block.rows for cell in cells):
        kind = cell.upper().rstrip("123")
        if name and name not in deck.printed.setdefault(kind, []):
            deck.printed[kind].append(name)


def _include(block: _Block, deck: Deck) -> None:
    given = block.options.get("INPUT", "").strip("\"'")
    folder = block.line.path.parent
    target = folder / given
    is_away = not given or Path(given).is_absolute() or ".." in Path(given).parts
    if is_away or not target.resolve().is_relative_to(folder.resolve()):
        raise block.line.error(f"*INCLUDE of {given!r}: expected a file in the deck's own folder")
    if block.depth >= _DEEPEST:
        raise block.line.error(f"*INCLUDE: expected at most {_DEEPEST} deep")
    _read(target, deck, block.depth + 1)


_READERS: dict[str, Callable[[_Block, Deck], None]] = {
    "NODE": _nodes,
    "NSET": _nset,
    "NODE PRINT": _node_print,
    "ELEMENT": _elements,
    "HYPERELASTIC": _hyperelastic,
    "ELASTIC": _elastic,
    "INCLUDE": _include,
}


def _numbers(line: Line, cells: list[str], *, at_least: int = 1) -> list[float]:
    found = [line.finite(cell, column) for column, cell in enumerate(cells, start=1)]
    if len(found) < at_least:
        raise line.error(f"{len(found)} values; expected at least {at_least}")
    return found


def _integers(line: Line, cells: list[str], *, at_least: int = 1) -> list[int]:
    values = _numbers(line, cells, at_least=at_least)
    for value in values:
        if value != int(value) or not 0 < value < 2**53:
            raise line.error(f"{value:g}: expected a whole number above 0")
    return [int(value) for value in values]
