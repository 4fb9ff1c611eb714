"""Reader for input decks of Abaqus and CalculiX: nodes, node sets, elements and a material."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.lines import Line, read_lines
from ridgebayes.fea.record import Given
from ridgebayes.table.columns import LARGEST_Q

_MAX_INCLUDE_DEPTH = 4  # refuses *INCLUDE cycles
_MAX_SET_NODES = 1_000_000  # limits the memory that one GENERATE can take


@dataclass
class Deck:
    """Contents of an input deck: nodes, node sets, elements, and E and nu of the body.

    Parameters
    ----------
    path : Path or None
        File; None without a deck.
    nodes : dict of int to (float, float)
        Coordinates x and y by node number.
    nsets : dict of str to list of int
        Node sets by name in capitals, in the order of the deck.
    elements : dict of int to tuple of int
        Nodes of each element by element number.
    E, nu : float or None
        From ``*HYPERELASTIC, NEO HOOKE``, or else from the softest ``*ELASTIC``; None without
        either, and for other hyperelastic materials.
    is_hyperelastic : bool
        Whether the deck has a hyperelastic material.
    depths : dict of int to float
        Coordinate z by node number, if it is not 0.
    thickness : float or None
        From the first ``*SOLID SECTION`` with a thickness.
    printed : dict of str to list of str
        Node sets in ``*NODE PRINT``, by the printed variable ("U", "RF").
    """

    path: Path | None = field(default=None, compare=False)
    nodes: dict[int, tuple[float, float]] = field(default_factory=dict)
    nsets: dict[str, list[int]] = field(default_factory=dict)
    elements: dict[int, tuple[int, ...]] = field(default_factory=dict)
    E: float | None = None
    nu: float | None = None
    is_hyperelastic: bool = False
    depths: dict[int, float] = field(default_factory=dict)
    thickness: float | None = None
    printed: dict[str, list[str]] = field(default_factory=dict)

    @property
    def result_sets(self) -> dict[str, list[str]]:
        """Node sets with printed results that may be the surface, and the driven nodes."""
        moved, driven = self.printed.get("U", []), self.printed.get("RF", [])
        others = [name for name in moved if name not in driven]
        return {"surface": others if len(others) == 1 else moved, "reaction": driven}

    def nodes_of(self, name: str) -> list[int]:
        """Return the nodes of a set without duplicates.

        Raises
        ------
        InputError
            If the deck has no set with this name.
        """
        if name.upper() not in self.nsets:
            names = ", ".join(self.nsets) or "none"
            raise InputError(f"{self.path}: no node set {name!r}; the node sets are {names}")
        return list(dict.fromkeys(self.nsets[name.upper()]))

    def thickness_of(self, name: str) -> float | None:
        """Return the extent along z of a node set or of all nodes, or that of the section."""
        for nodes in (self.nodes_of(name), self.nodes):
            z = [self.depths.get(node, 0.0) for node in nodes]
            if max(z) > min(z):
                return max(z) - min(z)
        return self.thickness

    def coordinates(self, numbers: Sequence[int]) -> FloatArray:
        """Return coordinates of nodes, shape (n, 2).

        Raises
        ------
        InputError
            If a node is not in the deck.
        """
        for number in numbers:
            if number not in self.nodes:
                raise InputError(f"{self.path}: node {number} is not in the deck")
        return np.array([self.nodes[number] for number in numbers], dtype=float).reshape(-1, 2)

    def rigid_nodes(self, body: Sequence[int]) -> list[int]:
        """Return the nodes that no chain of elements connects to the given nodes of the body."""
        links = [(first, node) for first, *others in self.elements.values() for node in others]
        numbers = sorted({*self.nodes, *body, *chain(*links)})
        ends = np.searchsorted(numbers, np.reshape(links, (-1, 2))).T
        graph = coo_array((np.ones(ends.shape[1]), tuple(ends)), (len(numbers), len(numbers)))
        part = dict(zip(numbers, connected_components(graph)[1].tolist(), strict=True))
        bodies = {part[node] for node in body}
        return [node for node in self.nodes if part[node] not in bodies]


@dataclass(frozen=True, eq=False)
class Run:
    """The files of a run and what they do not contain: properties of the body, in its units.

    Parameters
    ----------
    a_over_R, b_over_R, nu : float
        Texture and Poisson's ratio.
    R : float or None
        Radius; None fits a circle to the undeformed surface nodes.
    E : float
        Young's modulus.
    symmetry : {"half", "full"}
        "half" if the mesh is one half of the body, whose force is half of the load.
    top : float or None
        Height of the ridges' tops; None uses the rigid nodes at the corners.
    thickness : float
        Thickness of the plane-strain slice on which the forces act.
    corner_over_R : float or None
        Radius of the ridges' top corners; 0 is sharp, None uses the rigid nodes.
    paths : sequence of Path
        Result files.
    facts : Given
        The user's facts, completed by those of the deck.
    deck : Deck
        The run's deck; without content if there is none.
    """

    a_over_R: float
    b_over_R: float
    nu: float = 0.5
    R: float | None = None
    E: float = 1.0
    symmetry: str = "half"
    top: float | None = None
    thickness: float = 1.0
    corner_over_R: float | None = None
    paths: Sequence[Path] = (Path("run"),)
    facts: Given = field(default_factory=Given)
    deck: Deck = field(default_factory=Deck)

    def __post_init__(self) -> None:
        rules = {
            "texture": self.a_over_R > 0 and self.b_over_R > 0,
            "nu": 0 <= self.nu <= 0.5,
            "R": self.R is None or 0 < self.R < math.inf,
            "E": 0 < self.E < math.inf,
            "symmetry": self.symmetry in ("half", "full"),
            "thickness": 0 < self.thickness < math.inf,
            "corner radius": 0 <= (self.corner_over_R or 0.0) <= self.a_over_R / 2,
        }
        if bad := [name for name, holds in rules.items() if not holds]:
            raise InputError(
                f"{', '.join(bad)}: expected --texture, --R, --E and --thickness above 0, --nu "
                "from 0 to 0.5, --symmetry half or full, --corner from 0 to half a ridge"
            )

    @property
    def path(self) -> Path:
        """First file."""
        return self.paths[0]

    @property
    def sets(self) -> tuple[str, str]:
        """Names of the node sets of the surface and of the driven nodes, or empty."""
        return self.facts.surface or "", self.facts.reaction or ""

    def places(self, nodes: Sequence[int]) -> dict[str, Any]:
        """Return coordinates of surface and ridges, as keyword arguments of `ContactHistory`."""
        rigid = self.deck.coordinates(self.deck.rigid_nodes(nodes))
        return {"undeformed": self.deck.coordinates(nodes), "rigid": rigid}


def read_deck(path: Path) -> Deck:
    """Read an input deck.

    Parameters
    ----------
    path : pathlib.Path
        An ``.inp`` file; included files must lie in its folder.

    Returns
    -------
    Deck

    Raises
    ------
    InputError
        If a node, a set or an include cannot be parsed. The message names file, line and rule.
    """
    deck = Deck(path)
    _read(path, deck, 0)
    if not deck.nodes:
        raise InputError(f"{path}: no *NODE block; expected an Abaqus or CalculiX input deck")
    return deck


@dataclass
class _Block:
    """A keyword with its options and the cells of its data lines."""

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
    numbers = []
    for line, cells in block.rows:
        _, x, y, *z = _numbers(line, cells[:4] if any(cells[3:4]) else cells[:3], 3)
        numbers += _integers(line, cells[:1])
        if any(z):
            deck.depths[numbers[-1]] = z[0]
        if deck.nodes.setdefault(numbers[-1], (x, y)) != (x, y):
            rule = "expected a deck without parts, each node once"
            raise line.error(f"node {numbers[-1]} stands at two places; {rule}")
    if "NSET" in block.options:
        deck.nsets.setdefault(block.options["NSET"].upper(), []).extend(numbers)


def _nset(block: _Block, deck: Deck) -> None:
    if not block.options.get("NSET"):
        raise block.line.error("*NSET without a name; expected NSET=name")
    nodes = deck.nsets.setdefault(block.options["NSET"].upper(), [])
    for line, all_cells in block.rows:
        cells = [cell for cell in all_cells if cell]
        if "GENERATE" in block.options:
            first, last, *step = _integers(line, cells, 2)
            new = range(first, last + 1, *step[:1])
            if len(nodes) + len(new) > _MAX_SET_NODES:
                raise line.error(
                    f"GENERATE of {len(new)} nodes: expected at most {_MAX_SET_NODES} in a set"
                )
            nodes += new
        else:
            for cell in cells:
                nodes += deck.nsets.get(cell.upper()) or _integers(line, [cell])


def _elements(block: _Block, deck: Deck) -> None:
    cells: list[str] = []
    for line, more in block.rows:
        cells += filter(None, more)
        if more[-1]:  # an element continues after a comma at the end of a line
            element, *nodes = _integers(line, cells, 2)
            deck.elements[element] = tuple(nodes)
            cells = []
    if cells:
        raise block.rows[-1][0].error("an element ends in a comma; expected nodes")


def _elastic(block: _Block, deck: Deck) -> None:
    # The body is softer than the ridges, and a hyperelastic material is the body's.
    if not deck.is_hyperelastic and block.rows and any(block.rows[0][1]):
        line, cells = block.rows[0]
        E, nu = _numbers(line, cells[:2], 2)
        if deck.E is None or E < deck.E:
            deck.E, deck.nu = E, nu


def _hyperelastic(block: _Block, deck: Deck) -> None:
    deck.is_hyperelastic, deck.E, deck.nu = True, None, None
    if not block.rows or not {"NEO HOOKE", "NEO-HOOKE"} & block.options.keys():
        return
    line, cells = block.rows[0]
    c10, d1 = _numbers(line, cells[:2], 2)
    if not (c10 > 0 and d1 >= 0):
        raise line.error(f"C10 = {c10:g}, D1 = {d1:g}; expected > 0 and >= 0")
    # mu = 2 C10 and K = 2 / D1, so that mu / K = C10 D1.
    deck.nu = (3 - 2 * c10 * d1) / (6 + 2 * c10 * d1)
    deck.E = 4 * c10 * (1 + deck.nu)


def _section(block: _Block, deck: Deck) -> None:
    if deck.thickness is None and block.rows and block.rows[0][1][0]:
        line, cells = block.rows[0]
        (deck.thickness,) = _numbers(line, cells[:1], 1)


def _node_print(block: _Block, deck: Deck) -> None:
    name = block.options.get("NSET", "").upper()
    for cell in (cell for _, cells in block.rows for cell in cells):
        kind = cell.upper().rstrip("123")
        if name and name not in deck.printed.setdefault(kind, []):
            deck.printed[kind].append(name)


def _include(block: _Block, deck: Deck) -> None:
    name = Path(block.options.get("INPUT", "").strip("\"'"))
    folder = block.line.path.parent
    is_away = name == Path() or name.is_absolute() or ".." in name.parts
    if is_away or not (folder / name).resolve().is_relative_to(folder.resolve()):
        raise block.line.error(
            f"*INCLUDE of {str(name)!r}: expected a file in the deck's own folder"
        )
    if block.depth >= _MAX_INCLUDE_DEPTH:
        raise block.line.error(f"*INCLUDE: expected at most {_MAX_INCLUDE_DEPTH} deep")
    _read(folder / name, deck, block.depth + 1)


_READERS: dict[str, Callable[[_Block, Deck], None]] = {
    "NODE": _nodes,
    "NSET": _nset,
    "NODE PRINT": _node_print,
    "ELEMENT": _elements,
    "HYPERELASTIC": _hyperelastic,
    "ELASTIC": _elastic,
    "SOLID SECTION": _section,
    "INCLUDE": _include,
}


def _numbers(line: Line, cells: Sequence[str], at_least: int) -> list[float]:
    if len(cells) < at_least:
        raise line.error(f"{len(cells)} values; expected at least {at_least}")
    return [line.finite(cell, column) for column, cell in enumerate(cells, start=1)]


def _integers(line: Line, cells: Sequence[str], at_least: int = 1) -> list[int]:
    values = _numbers(line, cells, at_least)
    for value in values:
        if value != int(value) or not 0 < value < LARGEST_Q:
            raise line.error(f"{value:g}: expected a whole number above 0")
    return [int(value) for value in values]
