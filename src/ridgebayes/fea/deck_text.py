"""Export of a scene as an input deck of CalculiX or Abaqus: a disk pressed onto rigid blocks.

All quantities are dimensionless, with R = 1 and E = 1. The text of the deck is a Jinja template.
"""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ridgebayes._types import NEO_HOOKEAN, FloatArray, IntArray
from ridgebayes.contact import hertz
from ridgebayes.contact.cylinder.faces import first_height
from ridgebayes.contact.cylinder.mesh import DiskMesh, disk_mesh
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import InputError, expect
from ridgebayes.runtime.atomic import write_text
from ridgebayes.runtime.templates import rendered
from ridgebayes.scene.scene import Scene, as_scene

FORMATS = ("calculix", "abaqus")
SURFACE, REACTION = "NARC", "NTOP"
# Pressure over overlap of CalculiX, in E/R; a smaller value lets overlap shift the first load.
_PENALTY = 1e5
DEPTH = 0.06  # depth of the rigid blocks over R
_BLOCKS_PER_ROUND_CORNER = 16
_EDGE_GROWTH = 0.3  # growth of element edges per distance from a corner
_LEVELS_PER_PITCH = 12  # load levels while the contact grows by one pitch
# A textured body needs a larger displacement than a smooth body for the same load.
_DISPLACEMENT_FACTOR = 1.2


@dataclass(frozen=True, eq=False)
class PressedDisk:
    """A neo-Hookean quarter disk, x >= 0 and y <= 0, whose mid-plane is driven onto rigid blocks.

    Parameters
    ----------
    mesh : DiskMesh
        Mesh of nine-node elements; the centre node of each element is not used.
    blocks : tuple of ndarray of float, shape (4, 2)
        Corners of each block, counter-clockwise from the bottom left.
    nu, friction : float
        Poisson's ratio and Coulomb's coefficient of friction.
    displacements : ndarray of float, shape (n_level,)
        Displacements of the mid-plane over R, downwards, in rising order.
    title : tuple of str
        Comment lines at the top of the deck.
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
        """Number of each node in the deck, from 1; 0 for the unused centre nodes."""
        used = np.unique(self.cells)
        numbers = np.zeros(len(self.mesh.points), dtype=np.int64)
        numbers[used] = np.arange(1, len(used) + 1)
        return numbers

    @property
    def rim(self) -> IntArray:
        """Nodes of the rim, from its lowest point outwards."""
        rim = self.mesh.rim
        return np.concatenate([rim[:, :2].ravel(), rim[-1:, 2]])


def pressed_disk(scene: Scene, *, edges: float = 12.0) -> PressedDisk:
    """Build the pressed disk of a scene.

    Parameters
    ----------
    scene : Scene
        Scene of one texture, with the body centred over a groove.
    edges : float, optional
        Number of element edges over a ridge's width; at corners the edges are a third as long.

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
    n = math.ceil(_LEVELS_PER_PITCH * widest / (a + b))
    widths = widest * (np.arange(n) + 1) / n
    # Displacement of the mid-plane of a smooth cylinder (Johnson 1985, eq. 5.57).
    down = widths**2 / 4 * (2 * np.log(4 / widths) - 1)
    return PressedDisk(
        disk_mesh(size), tuple(blocks), scene.nu, scene.friction, _DISPLACEMENT_FACTOR * down, title
    )


def _size(
    places: FloatArray, edge: float, corner: float, reach: float, window: float
) -> Callable[[FloatArray], FloatArray]:
    corners = np.arcsin(places[places < 1.0])

    def size(theta: FloatArray) -> FloatArray:
        """Return the length of the rim's edges: short at corners, long outside of the contact."""
        # Rim points slide over corners as the load grows: edges are short in windows around them.
        apart = np.abs(theta[:, None] - corners) - (0.5 * corner + window + 0.005 * corners)
        near = corner + _EDGE_GROWTH * np.maximum(apart.min(axis=1), 0.0)
        return np.asarray(np.minimum(near, edge) + _EDGE_GROWTH * np.maximum(theta - reach, 0.0))

    return size


def _ridge(start: float, a: float, r: float, height: float) -> list[FloatArray]:
    """Return the blocks of a ridge: one for sharp corners, several slices for round corners."""
    turn = np.linspace(0.0, 0.5 * math.pi, _BLOCKS_PER_ROUND_CORNER + 1)
    out, up = r * (1 - np.cos(turn)), height - r + r * np.sin(turn)
    x = np.concatenate([start + out, (start + a - out)[::-1]])
    y, bottom = np.concatenate([up, up[::-1]]), height - DEPTH
    return [
        np.array([[x[i], bottom], [x[i + 1], bottom], [x[i + 1], y[i + 1]], [x[i], y[i]]])
        for i in range(len(x) - 1)
        if x[i + 1] > x[i]
    ]


def deck_text(disk: PressedDisk, program: str) -> str:
    """Return the text of a deck.

    Parameters
    ----------
    disk : PressedDisk
        Disk to write.
    program : {"calculix", "abaqus"}
        Program that reads the deck.

    Returns
    -------
    str
        Deck with eight-node plane-strain elements and one step per level. At the end of each step,
        the deck prints the displacements of the rim (node set NARC) and the reaction of the
        mid-plane (NTOP).

    Raises
    ------
    InputError
        If the program is unknown, or CalculiX is asked for an incompressible body.

    Notes
    -----
    *Validity.* CalculiX leaves a spurious overlap if one step has several increments, so each level
    is a step. CalculiX has no hybrid elements, and full integration locks for Poisson's ratios near
    0.5, so the deck uses reduced integration.
    """
    if program not in FORMATS:
        raise InputError(f"--format {program}: expected {' or '.join(FORMATS)}")
    calculix = program == "calculix"
    if calculix and disk.nu > 0.499:
        raise InputError(
            f"nu = {disk.nu:g}: expected at most 0.499 for CalculiX, whose elements lock near 0.5; "
            "use 0.49, which changes loads by up to 1.4 %, or --format abaqus"
        )
    number, points = disk.numbers, disk.mesh.points
    sets = {REACTION: disk.mesh.mid_plane, "NAX": disk.mesh.axis, SURFACE: disk.rim}
    # Adjacent blocks share nodes: CalculiX searches contact from face to face, and the body passes
    # through the seam between faces without common nodes.
    rigid: dict[tuple[float, float], int] = {}
    for corner in np.concatenate(disk.blocks).tolist():
        rigid.setdefault(tuple(corner), int(number.max()) + len(rigid) + 1)
    blocks = [[rigid[tuple(corner)] for corner in block.tolist()] for block in disk.blocks]
    # A lateral side is exposed unless a neighbour has the same height there.
    top_right, top_left = ({nodes[corner] for nodes in blocks} for corner in (2, 3))
    return rendered(
        "ridgebayes.fea",
        "deck.inp.jinja",
        disk=disk,
        calculix=calculix,
        nodes=np.column_stack([number, points])[number > 0].tolist(),
        cells=number[disk.cells].tolist(),
        sets={name: [n for n in number[some].tolist() if n] for name, some in sets.items()},
        rigid=rigid,
        blocks=blocks,
        top_left=top_left,
        top_right=top_right,
        faces=_pressed_faces(disk),
        penalty=_PENALTY,
        surface=SURFACE,
        reaction=REACTION,
    )


def _pressed_faces(disk: PressedDisk) -> list[tuple[int, int]]:
    """Return the element and side of each rim edge that can come into contact."""
    rim, points = disk.mesh.rim, disk.mesh.points
    reach = np.concatenate(disk.blocks)[:, 0].max()  # outer end of the last block
    middle = np.arctan2(points[:, 0], -points[:, 1])[rim[:, 1]]
    pressed = rim[middle < 2.0 * np.arcsin(min(reach, 0.7)), 1]
    side, element = np.nonzero(np.isin(disk.cells[:, 4:].T, pressed))
    return list(zip((element + 1).tolist(), (side + 1).tolist(), strict=True))


def export_deck(
    scene: Scene | str | os.PathLike[str],
    program: str,
    path: str | os.PathLike[str],
    *,
    edges: float = 12.0,
) -> PressedDisk:
    """Write a scene as an input deck of CalculiX or Abaqus, as ``ridgebayes export-deck``.

    Parameters
    ----------
    scene : Scene or path
        Scene of one texture, with the body centred over a groove, or its file.
    program : {"calculix", "abaqus"}
        Program that reads the deck.
    path : path
        File to write. An existing file is overwritten.
    edges : float, optional
        Number of element edges over a ridge's width.

    Returns
    -------
    PressedDisk
        Disk in the deck: nodes, elements and displacements, in units of R.

    Raises
    ------
    InputError
        If the scene has several textures, or effects that the deck does not support.

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
    where, scene = ("" if isinstance(scene, Scene) else f"{scene}: "), as_scene(scene)
    expect(int, float, edges=edges)
    expect(str, os.PathLike, path=path)
    try:
        disk = pressed_disk(scene, edges=edges)
        text = deck_text(disk, program)
    except InputError as error:
        raise InputError(f"{where}{error}") from None
    write_text(text, Path(path))
    return disk
