"""Levels of a run that printed its rim: from forces and positions to a contact table."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.increments import transitions_of
from ridgebayes.fea.record import HUGE, Imported
from ridgebayes.fea.rim import Rim
from ridgebayes.table.table import ContactTable

_FARTHEST = 4.0  # of R: where surface nodes may come to lie


@dataclass(frozen=True, eq=False)
class Levels:
    """Converged increments of a run.

    Parameters
    ----------
    force : ndarray of float, shape (n_level,), force
        What pushes the body down, per unit thickness or as printed; its sign does not matter.
    undeformed : ndarray of float, shape (n_node, 2), length
        Surface nodes.
    position : ndarray of float, shape (n_level, n_node, 2), length
        The same nodes at each level.
    rigid : ndarray of float, shape (n, 2), length
        Nodes of the rigid side, as far as known: corners are looked for among them.
    digits : float, length
        What printed digits leave open of a position.
    said : tuple of str
        What was understood, and what was left out.
    """

    force: FloatArray
    undeformed: FloatArray
    position: FloatArray
    rigid: FloatArray
    digits: float = 0.0
    said: tuple[str, ...] = ()


@dataclass(frozen=True)
class Body:
    """What a run's files do not say, and the user does; lengths and stresses in the run's units.

    Parameters
    ----------
    a_over_R, b_over_R, nu : float
        Texture and Poisson's ratio.
    R : float or None
        Radius; None takes the circle through the surface's nodes.
    E : float
        Young's modulus.
    symmetry : {"half", "full"}
        Whether the mesh is half of the body (x of one sign), and its force half of the load.
    top : float or None
        Height of the ridges' tops; None looks for the rigid side's nodes at their corners.
    thickness : float
        Of the plane-strain slice to which forces belong.
    corner_over_R : float
        Radius of the ridges' top corners; 0 is sharp.
    """

    a_over_R: float
    b_over_R: float
    nu: float = 0.5
    R: float | None = None
    E: float = 1.0
    symmetry: Literal["half", "full"] = "half"
    top: float | None = None
    thickness: float = 1.0
    corner_over_R: float = 0.0

    def __post_init__(self) -> None:
        rules = {
            "texture": self.a_over_R > 0 and self.b_over_R > 0,
            "nu": 0 <= self.nu <= 0.5,
            "R": self.R is None or 0 < self.R < math.inf,
            "E": 0 < self.E < math.inf,
            "symmetry": self.symmetry in ("half", "full"),
            "thickness": 0 < self.thickness < math.inf,
            "corner radius": 0 <= self.corner_over_R <= self.a_over_R / 2,
        }
        if bad := [name for name, holds in rules.items() if not holds]:
            raise InputError(
                f"{', '.join(bad)}: expected --texture, --R, --E and --thickness above 0, --nu "
                "from 0 "
                "to 0.5, --symmetry half or full, --corner from 0 to half a ridge"
            )


def table_of(
    levels: Levels, body: Body, *, where: str, solver: str, source: str, brackets: bool = False
) -> Imported:
    """Follow the rim over each proximal corner, and tell at which load it gets there.

    Parameters
    ----------
    levels : Levels
        What the run printed.
    body : Body
        What it did not.
    where : str
        Name that messages show.
    solver, source : str
        Columns of the table.
    brackets : bool, optional
        As `ridgebayes.fea.increments.transitions_of`.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        If the surface is not round, corners cannot be placed, or none is reached.
    """
    rim = Rim.of(levels.undeformed, where, R=body.R, symmetry=body.symmetry)
    load = 2 if body.symmetry == "half" else 1
    p_over_E = loads_of(levels.force, body, rim.R, where)
    corners, how = _corners(levels, body, rim, where)
    corner = body.corner_over_R * rim.R
    gaps = np.array([rim.gaps(one, corners, corner) for one in levels.position]) / rim.R
    depth = (
        np.array([rim.overlap(one, corners, body.a_over_R * rim.R) for one in levels.position])
        / rim.R
    )
    Q = 4 + 2 * np.arange(len(corners) - 1)
    try:
        frame, odd = transitions_of(
            p_over_E,
            gaps[:, 1:],
            Q,
            brackets=brackets,
            gap_error=np.hypot(depth[:, None], levels.digits / rim.R),
        )
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    frame.insert(0, "a_over_R", body.a_over_R)
    frame.insert(1, "b_over_R", body.b_over_R)
    frame = frame.assign(nu=body.nu, solver=solver, source=source)
    # A few nodes on the other side of a half mesh's axis are no second side: see Rim.of.
    n = len(levels.undeformed) - len(rim.sides[0][0]) if body.symmetry == "half" else 0
    across = [f"{n} surface nodes beyond the axis of a half mesh: left out"] if n else []
    n_bracket = int(frame["p_over_E_lower"].notna().sum())
    said = [
        *levels.said,
        *across,
        f"surface: {len(levels.undeformed)} nodes on a circle of R = {rim.R:.6g}",
        f"texture: a/R = {body.a_over_R:g}, b/R = {body.b_over_R:g}, nu = {body.nu:g}; {how}",
        f"load: force {'times 2 ' if load == 2 else ''}over 2 R E, E = {body.E:g}, "
        f"{len(p_over_E)} increments to p/E = {np.nanmax(p_over_E):.5g}",
        *odd,
        f"kept: {len(frame)} transitions, Q = {frame['Q'].iloc[0]} to {frame['Q'].iloc[-1]}, "
        f"{n_bracket} as brackets",
    ]
    return Imported(ContactTable.from_frame(frame, where=where), tuple(said))


def loads_of(force: FloatArray, body: Body, R: float, where: str) -> FloatArray:
    """Return p/E of forces, whatever their sign.

    Raises
    ------
    InputError
        If one is beyond what can be computed with.
    """
    load = 2 if body.symmetry == "half" else 1
    with np.errstate(over="ignore"):
        p_over_E = np.abs(force) * load / body.thickness / (2 * R * body.E)
    if (bad := p_over_E > HUGE).any():  # of forces that are not numbers: increments are left out
        raise InputError(
            f"{where}: force {force[bad][0]:.6g}, p/E = {p_over_E[bad][0]:.6g}; expected p/E at "
            "most "
            f"{HUGE:g}"
        )
    return np.asarray(p_over_E)


def _corners(levels: Levels, body: Body, rim: Rim, where: str) -> tuple[FloatArray, str]:
    """Return the proximal corners as distance from the axis and height, and how they were found."""
    pitch = (body.a_over_R + body.b_over_R) * rim.R
    farthest = np.abs(levels.position[..., 0] - rim.centre[0]).max()
    if not farthest <= _FARTHEST * rim.R:
        raise InputError(
            f"{where}: a surface node {farthest:.3g} from the axis, R = {rim.R:.6g}; expected "
            "within "
            f"{_FARTHEST:g} R"
        )
    n = max(math.ceil((farthest - body.b_over_R * rim.R / 2) / pitch), 2)
    far = body.b_over_R * rim.R / 2 + pitch * np.arange(n)
    if body.top is not None:
        return np.column_stack([far, np.full(n, body.top)]), f"tops at y = {body.top:g}"
    # Rigid nodes stand at the corners: the highest of those at each distance.
    near, flat = 1e-5 * rim.R, far + body.corner_over_R * rim.R
    away = np.abs(levels.rigid[:, 0] - rim.centre[0]) if len(levels.rigid) else np.zeros(0)
    heights = []
    for one in flat:
        here = levels.rigid[np.abs(away - one) < near, 1] if away.size else np.zeros(0)
        if not here.size:
            break
        heights.append(float(here.max()))
    if len(heights) < 2:
        raise InputError(
            f"{where}: no rigid nodes at the corners, {flat[0]:.6g} and {flat[1]:.6g} from the "
            "axis; expected a deck with the ridges' nodes and the --texture that they make, or "
            "--top, "
            "the height of the ridges' tops"
        )
    tops = f"tops at y = {heights[0]:.6g} in the deck, {len(heights)} ridges a side"
    return np.column_stack([far[: len(heights)], heights]), tops
