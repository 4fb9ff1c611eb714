"""Decks of a pressed disk: rigid blocks below it, and how far it is pressed at each level.

Everything is over the radius R and Young's modulus E: R = 1, E = 1. The text of a deck,
CalculiX's or Abaqus's, is that of a template.
"""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ridgebayes._types import NEO_HOOKEAN, FloatArray, IntArray
from ridgebayes.contact import hertz
from ridgebayes.contact.cylinder.faces import first_height
from ridgebayes.contact.cylinder.mesh import DiskMesh, disk_mesh
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import InputError
from ridgebayes.runtime.atomic import write_text
from ridgebayes.runtime.templates import rendered
from ridgebayes.scene.scene import Scene

FORMATS = ("calculix", "abaqus")
SURFACE, REACTION = "NARC", "NTOP"
_PENALTY = 1e5  # pressure over overlap, E/R: an overlap shifts the first transition most
DEPTH = 0.06  # of the blocks that are the ridges, over R
_ARC = 16  # blocks under a round corner
_GROWTH = 0.3  # of edges away from corners
_EACH = 12  # levels while the contact grows by a pitch
_BEYOND = 1.2  # of the smooth body's displacement at the highest load: grooves give way


@dataclass(frozen=True, eq=False)
class PressedDisk:
    """A neo-Hookean quarter disk, x >= 0 and y <= 0, whose mid-plane is driven onto rigid blocks.

    Parameters
    ----------
    mesh : DiskMesh
        Its last node of each element, in the middle, is not for eight-node elements.
    blocks : tuple of ndarray of float, shape (4, 2)
        Corners of each block, counter-clockwise from the bottom left.
    nu, friction : float
        Poisson's and Coulomb's.
    displacements : ndarray of float, shape (n_level,)
        Displacements of the mid-plane over R, downwards, in rising order.
    title : tuple of str
        Lines for a reader.
    """

    mesh: DiskMesh
    blocks: tuple[FloatArray, ...]
    nu: float
    friction: float
    displacements: FloatArray
    title: tuple[str, ...] = ()

    @property
    def cells(self) -> IntArray:
        """Nodes of the eight-node elements, corners then middles, shape (n_element, 8)."""
        return np.asarray(self.mesh.mesh.dofs.element_dofs[:8].T)

    @property
    def numbers(self) -> IntArray:
        """Number from 1 of each node in a deck; 0 of those in the middle of elements."""
        used = np.unique(self.cells)
        numbers = np.zeros(len(self.mesh.points), dtype=np.int64)
        numbers[used] = np.arange(1, len(used) + 1)
        return numbers

    @property
    def rim(self) -> IntArray:
        """Nodes of the rim from its lowest point on."""
        rim = self.mesh.rim
        return np.concatenate([rim[:, :2].ravel(), rim[-1:, 2]])

    @property
    def reach(self) -> float:
        """Distance from the axis of the last block's end."""
        return float(max(block[:, 0].max() for block in self.blocks))


def pressed_disk(scene: Scene, *, edges: float = 12.0) -> PressedDisk:
    """Make the disk that the deck of a scene holds.

    Parameters
    ----------
    scene : Scene
        Scene of one texture, with the body centred over a groove.
    edges : float, optional
        Element edges over a ridge's width; at corners they are a third as long.

    Returns
    -------
    PressedDisk

    Raises
    ------
    InputError
        If the scene has several textures or an offset one, a material other than neo-Hookean, or
        ridges that lie outside the disk.
    """
    texture, n = scene.textures[0], len(scene.textures)
    for is_wrong, why in (
        (n != 1, f"{n} textures; a deck is of one texture"),
        (texture.offset != 0, f"offset = {texture.offset!r}; a deck's body is centred, offset 0"),
        (scene.ogden != NEO_HOOKEAN, f"ogden = {scene.ogden!r}; a deck's material is neo-Hookean"),
        (not 2 <= edges <= 200, f"edges = {edges!r}; expected 2 to 200 on a ridge"),
    ):
        if is_wrong:
            raise InputError(why)
    a, b, r = texture.a_over_R, texture.b_over_R, texture.corner_radius_over_R
    p_max = scene.highest_load(texture)
    widest = 1.1 * float(hertz.half_width(p_max, nu=scene.nu))
    if not widest < 0.9:
        raise InputError(
            f"p/E = {p_max:g}: the contact is {widest:.2g} R wide; expected under 0.9 R"
        )
    n_ridge = max(2, math.ceil((widest - b / 2) / (a + b)) + 2)
    starts = b / 2 + (a + b) * np.arange(n_ridge)
    if not starts[-1] + a < 0.98:
        raise InputError(f"a/R = {a:g}, b/R = {b:g}: ridge {n_ridge} lies outside the disk")
    edge = min(a, 4 * b) / edges
    places = np.concatenate([starts, starts + a])
    size = _size(places, edge, edge / 3, widest + 0.5 * (a + b), 1.5 * r)
    height = first_height(Profile(a, b, corner=r))
    blocks = [block for start in starts for block in _ridge(start, a, r, height)]
    if texture.groove_depth_over_R is not None:
        floor = height - texture.groove_depth_over_R
        end = starts[-1] + a
        blocks.append(
            np.array([[-a, floor - DEPTH], [end, floor - DEPTH], [end, floor], [-a, floor]])
        )
    title = (
        f"soft cylinder on rigid ridges: a/R = {a:g}, b/R = {b:g}, nu = {scene.nu:g}, "
        f"friction = {scene.friction:g}, to p/E = {p_max:g} or beyond",
        "R = 1, E = 1; a quarter disk: the line load is twice the reaction of NTOP, per thickness",
    )
    n = math.ceil(_EACH * widest / (a + b))
    widths = widest * (np.arange(n) + 1) / n
    # How far the mid-plane of a smooth cylinder comes down (Johnson 1985, 5.57).
    down = widths**2 / 4 * (2 * np.log(4 / widths) - 1)
    return PressedDisk(
        disk_mesh(size), tuple(blocks), scene.nu, scene.friction, _BEYOND * down, title
    )


def _size(
    places: FloatArray, edge: float, corner: float, reach: float, window: float
) -> Callable[[FloatArray], FloatArray]:
    corners = np.arcsin(places[places < 1.0])

    def size(theta: FloatArray) -> FloatArray:
        """Return the wanted length of the rim's edges: short at corners, long where all is free."""
        # Points of the rim that meet a corner slide as the load grows: hence the widths.
        apart = np.abs(theta[:, None] - corners) - (0.5 * corner + window + 0.005 * corners)
        near = corner + _GROWTH * np.maximum(apart.min(axis=1), 0.0)
        return np.asarray(np.minimum(near, edge) + _GROWTH * np.maximum(theta - reach, 0.0))

    return size


def _ridge(start: float, a: float, r: float, height: float) -> list[FloatArray]:
    """Return the blocks of a ridge: one, or slices under round corners."""
    if r == 0.0:
        x, y = np.array([start, start + a]), np.array([height, height])
    else:
        turn = np.linspace(0.0, 0.5 * math.pi, _ARC + 1)
        out, up = r * (1 - np.cos(turn)), height - r + r * np.sin(turn)
        x = np.concatenate([start + out, (start + a - out)[::-1]])
        y = np.concatenate([up, up[::-1]])
    bottom = height - DEPTH
    return [
        np.array([[x[i], bottom], [x[i + 1], bottom], [x[i + 1], y[i + 1]], [x[i], y[i]]])
        for i in range(len(x) - 1)
        if x[i + 1] > x[i]
    ]


def deck_text(disk: PressedDisk, program: str, *, penalty: float = _PENALTY) -> str:
    """Write a deck.

    Parameters
    ----------
    disk : PressedDisk
        Disk to write.
    program : {"calculix", "abaqus"}
        Which reads it.
    penalty : float, optional, E/R
        Stiffness of CalculiX's contact, pressure over overlap.

    Returns
    -------
    str
        Eight-node plane-strain elements; each level a step of its own, at whose end the
        displacements of the rim (node set NARC) and the reaction of the mid-plane (NTOP) are
        printed.

    Raises
    ------
    InputError
        If the program is unknown, or CalculiX is asked for an incompressible body.

    Notes
    -----
    *Validity.* CalculiX leaves a spurious overlap where one step holds several increments: hence
    the steps. Its elements have no separate pressure: Poisson's ratios near 0.5 lock in full
    integration, so that it is reduced.
    """
    if program not in FORMATS:
        raise InputError(f"--format {program}: expected {' or '.join(FORMATS)}")
    calculix = program == "calculix"
    if calculix and disk.nu > 0.499:
        raise InputError(
            f"nu = {disk.nu:g}: expected at most 0.499 for CalculiX, whose elements lock near 0.5; "
            "use 0.49, which changes loads by up to 1.4 %, or --format abaqus"
        )
    number, points, n_cell = disk.numbers, disk.mesh.points, len(disk.cells)
    sets = {REACTION: disk.mesh.mid_plane, "NAX": disk.mesh.axis, SURFACE: disk.rim}
    # Blocks side by side share nodes: CalculiX goes from face to face to find what is pressed, and
    # at the seam of faces that do not know each other the body passes through them.
    rigid: dict[tuple[float, float], int] = {}
    for corner in np.concatenate(disk.blocks).tolist():
        rigid.setdefault(tuple(corner), int(number.max()) + len(rigid) + 1)
    return rendered(
        "ridgebayes.fea",
        "deck.inp.jinja",
        disk=disk,
        calculix=calculix,
        nodes=np.column_stack([number, points])[number > 0].tolist(),
        cells=number[disk.cells].tolist(),
        sets={name: [n for n in number[some].tolist() if n] for name, some in sets.items()},
        rigid=rigid,
        blocks=[_block(disk, k, n_cell, rigid) for k in range(len(disk.blocks))],
        faces=_pressed_faces(disk),
        penalty=penalty,
        surface=SURFACE,
        reaction=REACTION,
    )


def _block(
    disk: PressedDisk, k: int, n_cell: int, nodes: dict[tuple[float, float], int]
) -> dict[str, Any]:
    """Return number, nodes and the sides that may be touched of a block."""
    block = disk.blocks[k]
    # Walls are where no neighbour goes on at the same height.
    left = any(tuple(block[3]) == tuple(other[2]) for other in disk.blocks)
    right = any(tuple(block[2]) == tuple(other[3]) for other in disk.blocks)
    return {
        "number": n_cell + k + 1,
        "nodes": [nodes[tuple(corner)] for corner in block.tolist()],
        "sides": [3, *[2] * (not right), *[4] * (not left)],
    }


def _pressed_faces(disk: PressedDisk) -> list[tuple[int, int]]:
    """Return elements and their sides along the part of the rim that may touch."""
    rim, points = disk.mesh.rim, disk.mesh.points
    middle = np.arctan2(points[:, 0], -points[:, 1])[rim[:, 1]]
    pressed = rim[middle < 2.0 * np.arcsin(min(disk.reach, 0.7)), 1]
    side, element = np.nonzero(np.isin(disk.cells[:, 4:].T, pressed))
    return list(zip((element + 1).tolist(), (side + 1).tolist(), strict=True))


def export_deck(
    scene: Scene | str | os.PathLike[str],
    program: str,
    path: str | os.PathLike[str],
    *,
    edges: float = 12.0,
) -> PressedDisk:
    """Write a scene as an input deck for other finite elements, as ``ridgebayes export-deck``.

    Parameters
    ----------
    scene : Scene or path
        Scene of one texture, with the body centred over a groove, or its file.
    program : {"calculix", "abaqus"}
        Program that reads the deck.
    path : path
        File to write; one that is there is replaced.
    edges : float, optional
        Element edges over a ridge's width.

    Returns
    -------
    PressedDisk
        The disk that was written: nodes, cells, displacements of its levels, in units of R.

    Raises
    ------
    InputError
        If the scene has several textures, or effects that a deck cannot hold.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ridgebayes as rb
    >>> scene = rb.Scene.of([(0.06, 0.03)], p_over_E=0.002, nu=0.49)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     disk = rb.export_deck(scene, "calculix", f"{folder}/run.inp")
    ...     text = Path(folder, "run.inp").read_text()
    >>> "*STEP" in text, len(disk.cells) > 100
    (True, True)
    """
    if isinstance(scene, str | os.PathLike):
        where, scene = f"{scene}: ", Scene.from_toml(scene)
    else:
        where = ""
    try:
        disk = pressed_disk(scene, edges=edges)
        text = deck_text(disk, program)
    except InputError as error:
        raise InputError(f"{where}{error}") from None
    write_text(text, Path(path))
    return disk
