"""A run as a contact history, and the one way from a history to transition loads."""

import math
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Any

import numpy as np

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.record import HUGE, Imported
from ridgebayes.fea.rim import Rim
from ridgebayes.fea.transitions import transitions_of
from ridgebayes.table.table import ContactTable

NEAR = 1e-5  # of R: a node so near to a corner, or to the circle, is at it
_REST = 3e-6  # of R: how well the height of a rim at rest on a ridge is known
_INSIDE = 0.1  # of a ridge's width: away from its corners, where meshes sink in
_LOWEST = 0.25  # of a ridge's nodes: where the body rests, if it rests on part of it
_LIFTED = 1e-4  # of R: nodes so far above those do not rest


@dataclass(frozen=True, eq=False)
class ContactHistory:
    """Contact of a run, step by step: the height of its surface, or the places where it is closed.

    Parameters
    ----------
    load : ndarray of float, shape (n_step,)
        What `load_is` says: force on the meshed part, of either sign.
    where, source, solver : str
        The file, for messages; columns of the table.
    x : ndarray of float, shape (n_step, n_node), length
        Across the ridges, of nodes of the body's surface or of the middles of its faces.
    height : ndarray of float, shape (n_step, n_node), length, or None
        The gap, but for the height of the ridges' tops.
    closed : ndarray of bool, shape (n_step, n_node), or None
        Which nodes are in contact, where heights are not known.
    width : ndarray of float, shape (n_node,), length, or None
        Widths of the closed faces; None for points.
    Q : ndarray of int, shape (n_node,), or None
        Counts of nodes at corners, in place of `x`.
    undeformed : ndarray of float, shape (n_node, 2), length, or None
        The same nodes before; None where the file does not tell.
    rigid : ndarray of float, shape (n, 2), length, or None
        Nodes of the ridges: tops and corners are looked for among them. None where a file never
        has them: tops are where the body rests.
    R : float, length, or None
        Radius, where the file tells it.
    digits : float, length
        Half of what the last printed digit of a height is worth.
    load_is : {"force", "line", "p_over_E"}
        "line" and "p_over_E" are the whole body's.
    messages : tuple of str
        Messages: values that were read, and parts that were ignored.
    """

    load: FloatArray
    where: str
    source: str
    solver: str
    x: FloatArray | None = None
    height: FloatArray | None = None
    closed: BoolArray | None = None
    width: FloatArray | None = None
    Q: IntArray | None = None
    undeformed: FloatArray | None = None
    rigid: FloatArray | None = None
    R: float | None = None
    digits: float = 0.0
    load_is: str = "force"
    messages: tuple[str, ...] = ()


@dataclass(frozen=True)
class RunBody:
    """Values that the user gives beside a run's files; lengths and stresses in the run's units.

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
        Thickness of the plane-strain slice to which forces belong.
    corner_over_R : float or None
        Radius of the ridges' top corners; 0 is sharp, and None what the rigid side's nodes say.
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


def table_of(history: ContactHistory, body: RunBody, *, brackets: bool = False) -> Imported:
    """Tell at which load a body reaches each proximal corner beyond the first.

    Parameters
    ----------
    history : ContactHistory
        Contact of the run.
    body : RunBody
        Values that the run's files do not hold.
    brackets : bool, optional
        As `ridgebayes.fea.transitions.transitions_of`.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        If the surface is not round, corners cannot be placed, none is reached, or a load is beyond
        what can be computed with.
    """
    where, load = history.where, np.abs(history.load)
    said: list[str] = []
    errors: dict[str, Any] = {}
    if history.Q is None or history.closed is None:
        body, gaps, errors = _on_rim(history, body, said)
        Q = 4 + 2 * np.arange(gaps.shape[1])
    elif body.R is None and history.load_is != "p_over_E":
        raise InputError(f"{where}: expected --R, the body's radius")
    else:
        gaps, Q = np.where(history.closed, -np.inf, np.inf), history.Q
    is_force, over = history.load_is == "force", 2 * (body.R or 1.0) * body.E
    half = 2 if is_force and body.symmetry == "half" else 1
    how = f"{' times 2' if half == 2 else ''} over 2 R E, E = {body.E:g}"
    if history.load_is == "p_over_E":
        over, how = 1.0, ""
    with np.errstate(over="ignore"):
        p_over_E = load * half / (body.thickness if is_force else 1.0) / over
    if (bad := p_over_E > HUGE).any():  # NaN passes: transitions_of ignores those increments
        too_large = f"force {load[bad][0]:.6g}, p/E = {p_over_E[bad][0]:.6g}"
        raise InputError(f"{where}: {too_large}; expected p/E at most {HUGE:g}")
    try:
        frame, odd = transitions_of(p_over_E, gaps, Q, brackets=brackets, **errors)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    frame.insert(0, "a_over_R", body.a_over_R)
    frame.insert(1, "b_over_R", body.b_over_R)
    frame = frame.assign(nu=body.nu, solver=history.solver, source=history.source)
    n_bracket = int(frame["p_over_E_lower"].notna().sum())
    name = {"line": "line load", "p_over_E": "p/E"}.get(history.load_is, "force")
    messages = (
        *history.messages,
        *said,
        f"texture: a/R = {body.a_over_R:g}, b/R = {body.b_over_R:g}, nu = {body.nu:g}",
        f"load: {name}{how}, {len(load)} increments to p/E = {np.nanmax(p_over_E):.5g}",
        *odd,
        f"kept: {len(frame)} transitions, Q = {frame['Q'].iloc[0]} to {frame['Q'].iloc[-1]}, "
        f"{'all' if n_bracket == len(frame) else n_bracket} as brackets",
    )
    return Imported(ContactTable.from_frame(frame, where=where), messages)


def _on_rim(
    history: ContactHistory, body: RunBody, said: list[str]
) -> tuple[RunBody, FloatArray, dict[str, Any]]:
    """Return the body with its R, gaps over R at corners, shape (n_step, n_corner), and errors."""
    assert history.x is not None
    R, where, n = body.R or history.R, history.where, history.x.shape[1]
    if history.undeformed is None:
        rim = Rim.deformed(history.x[0], where, R=R, symmetry=body.symmetry)
    else:
        rim = Rim.of(history.undeformed, where, R=R, symmetry=body.symmetry)
    body = replace(body, R=rim.R)
    said.append(f"surface: {n} nodes on a circle of R = {rim.R:.6g}")
    if history.height is None:
        return body, _of_closed(history, body, rim), {}
    digits = history.digits
    position = np.stack([history.x, history.height], axis=-1)
    if body.top is None and history.rigid is None:
        position, body = _at_rest(position, body, rim, where), replace(body, top=0.0)
        digits = math.hypot(digits, _REST * rim.R)
        said.append("tops: where the body rests on the first ridge, step by step")
    corners, radius, how = _corners(history, body, rim)
    if body.symmetry == "half" and (beyond := n - len(rim.sides[0][0])):
        # A few nodes beyond a half mesh's axis are no second side: see Rim.of.
        said.append(f"{beyond} surface nodes ignored: beyond the axis of a half mesh")
    said.append(how)
    gaps = np.array([rim.gaps(at, corners, radius)[1:] for at in position]) / rim.R
    # Over round corners a surface below the tops is no overlap: flats tell it.
    flat, width = corners + np.array([radius, 0.0]), body.a_over_R * rim.R - 2 * radius
    depth = np.array([rim.overlap(at, flat, width) for at in position])
    error = np.hypot(depth[:, None], digits) / rim.R
    # A height is a sum of two printed numbers: a coordinate and a displacement.
    return body, gaps, {"gap_error": error, "digits": 2 * history.digits / rim.R}


def _corners(history: ContactHistory, body: RunBody, rim: Rim) -> tuple[FloatArray, float, str]:
    """Return the proximal corners as distance from the axis and height, their radius, and how."""
    assert history.x is not None
    where, R, b = history.where, rim.R, body.b_over_R * rim.R
    pitch = body.a_over_R * R + b
    farthest = np.abs(history.x - rim.centre[0]).max()
    rim.check_reach("surface node", farthest, where)
    n = max(math.ceil((farthest - b / 2) / pitch), 2)
    far = b / 2 + pitch * np.arange(n)
    if body.top is not None:
        corners = np.column_stack([far, np.full(n, body.top)])
        return corners, (body.corner_over_R or 0.0) * R, f"tops at y = {body.top:g}"
    rigid = np.zeros((0, 2)) if history.rigid is None else history.rigid
    away = np.abs(rigid[:, 0] - rim.centre[0])
    radius = body.corner_over_R
    if radius is None:
        radius = _radius(away, rigid[:, 1], b / 2, body.a_over_R * R, R)
    # Rigid nodes stand at the ends of the flats: the highest of those at each distance.
    here = (rigid[np.abs(away - end) < NEAR * R, 1] for end in far + radius * R)
    heights = [float(some.max()) for some in takewhile(len, here)]
    if len(heights) < 2:
        raise InputError(
            f"{where}: no rigid nodes at the corners, {far[0] + radius * R:.6g} and "
            f"{far[1] + radius * R:.6g} from the axis; expected a deck with the ridges and "
            "their --texture, or --top, their height, and --corner where corners are round"
        )
    tops = f"tops at y = {heights[0]:.6g} in the deck, {len(heights)} ridges a side"
    if radius and body.corner_over_R is None:
        tops += f"; corners of radius {radius:.6g} R, by the deck's nodes"
    return np.column_stack([far[: len(heights)], heights]), radius * R, tops


def _radius(away: FloatArray, y: FloatArray, near: float, a: float, R: float) -> float:
    """Return the first ridge's corner radius over R, if its nodes make one; else 0."""
    on = (away >= near - NEAR * R) & (away <= near + a / 2)
    if not on.any():
        return 0.0
    top = float(y[on].max())
    radius = float(away[on & (y >= top - NEAR * R * 1e-3)].min()) - near
    start = np.hypot(away - near, y - (top - radius)) < NEAR * R
    return round(radius / R, 9) if radius > NEAR * R and start.any() else 0.0


def _at_rest(position: FloatArray, body: RunBody, rim: Rim, where: str) -> FloatArray:
    """Return positions seen from the ridges: tops at y = 0, where the body rests on the first."""
    parts = np.array([_INSIDE, 1 - _INSIDE])
    near, far = rim.R * (body.b_over_R / 2 + parts * body.a_over_R)
    away = np.abs(position[..., 0] - rim.centre[0])
    position = position.copy()
    for k, x in enumerate(away):
        over = (near <= x) & (x <= far)
        if not over.any():
            raise InputError(
                f"{where}, state {k + 1}: no rim node over the first ridge, {near:.4g} to "
                f"{far:.4g} from the axis; expected its texture and a mesh as fine, or --top"
            )
        # Nodes at rest scatter about the top by what the mesh leaves: their median does not.
        heights = position[k, over, 1]
        low = float(np.quantile(heights, _LOWEST))
        rest = float(np.median(heights[heights <= low + _LIFTED * rim.R]))
        # States at a transition touch by rounding only: a little lower they do.
        position[k, :, 1] -= rest + _REST * rim.R
    return position


def _of_closed(history: ContactHistory, body: RunBody, rim: Rim) -> FloatArray:
    """Return -inf where a ridge is closed, inf where not, NaN where that is open.

    Shape (n_step, n_ridge), from the second ridge on. A face over two ridges leaves open which of
    them it touches.
    """
    assert history.x is not None
    assert history.closed is not None
    a, b = body.a_over_R * rim.R, body.b_over_R * rim.R
    away = np.abs(history.x - rim.centre[0])
    reach = 0.0 if history.width is None else history.width / 2
    farthest = float(np.max((away + reach)[history.closed], initial=0.0))
    rim.check_reach("face", farthest, history.where)
    n = max(math.ceil((farthest - b / 2) / (a + b)), 1) + 1
    near = b / 2 + (a + b) * np.arange(n)
    gap = np.full((len(away), n), math.inf)
    for i, closed in enumerate(history.closed):
        start, end = ((away + way * reach)[i, closed][:, None] for way in (-1, 1))
        # Faces reach over the groove beside the ridge that presses them, at most to its middle.
        over = (end >= near) & (start <= near + a)
        none = ~over.any(axis=1)
        over[none] = (end[none] >= near - b) & (start[none] <= near + a + b)
        sure = over & (over.sum(axis=1, keepdims=True) == 1)
        gap[i, over.any(axis=0)] = math.nan
        gap[i, sure.any(axis=0)] = -math.inf
    return gap[:, 1:]
