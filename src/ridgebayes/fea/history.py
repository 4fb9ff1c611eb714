"""Contact history of a run, and its conversion to transition loads."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Any

import numpy as np

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.deck import Run
from ridgebayes.fea.record import HUGE, Imported
from ridgebayes.fea.rim import NEAR, Rim
from ridgebayes.fea.transitions import half_digit, transitions_of
from ridgebayes.runtime.text import count, percent
from ridgebayes.table.table import ContactTable

_REST_ERROR = 3e-6  # error over R of the height of a rim that rests on a ridge
_CORNER_MARGIN = 0.1  # part of a ridge's width at each corner that is skipped: meshes overlap there
# Quantile of the heights of nodes over a ridge at which the body rests, even if on a part of it.
_RESTING_QUANTILE = 0.25
_LIFTED_HEIGHT = 1e-4  # height over R above resting nodes from which a node does not rest


@dataclass(frozen=True, eq=False)
class ContactHistory:
    """Contact at each step of a run, as heights of the surface or as closed nodes.

    Parameters
    ----------
    load : ndarray of float, shape (n_step,)
        Load of either sign; `load_is` gives its meaning.
    at : ndarray of float, shape (n_step, n_node, 2) or (n_step, n_node, 1), length, or None
        Coordinates of surface nodes across the ridges and, if they are known, heights. The gap is
        the height minus that of the ridges' tops.
    closed : ndarray of bool, shape (n_step, n_node), or None
        Whether each node is in contact, if heights are unknown.
    Q : ndarray of int, shape (n_node,), or None
        Q of nodes at corners, which replaces `at`.
    undeformed : ndarray of float, shape (n_node, 2), length, or None
        Undeformed coordinates of the nodes; None if the file does not contain them.
    rigid : ndarray of float, shape (n, 2), length, or None
        Nodes of the ridges, which give the tops and corners. None for a format without ridge nodes;
        then the height at which the body rests on the first ridge gives the tops.
    R : float, length, or None
        Radius, if the file gives it.
    digits : float, length
        Half of the last printed digit of a height.
    load_is : {"force", "line", "p_over_E"}
        Kind of load: force on the meshed part, or line load or p/E of the whole body.
    messages : sequence of str
        Messages about values that were read and parts that were ignored.
    files : tuple of str
        Names of files and data that the user did not give, for the source of the rows.
    """

    load: FloatArray
    at: FloatArray | None = None
    closed: BoolArray | None = None
    Q: IntArray | None = None
    undeformed: FloatArray | None = None
    rigid: FloatArray | None = None
    R: float | None = None
    digits: float = 0.0
    load_is: str = "force"
    messages: Sequence[str] = ()
    files: tuple[str, ...] = ()


def moved_surface(
    run: Run, nodes: Sequence[int], load: FloatArray, moved: FloatArray, messages: Sequence[str]
) -> ContactHistory:
    """Return the history of nodes of the run's deck from their printed displacements."""
    places, digits = run.places(nodes), half_digit(moved)
    at = places["undeformed"] + moved
    return ContactHistory(load, at, digits=digits, messages=messages, **places)


def table_of(history: ContactHistory, run: Run, **columns: str) -> Imported:
    """Return a table of the loads at which the body reaches each proximal corner after the first.

    Parameters
    ----------
    history : ContactHistory
        Contact of the run.
    run : Run
        Properties of the body, and options.
    **columns : str
        Values of further columns of the table: `solver` and `source`.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        If the surface is not circular, corners cannot be located, no corner is reached, or a load
        is too large.
    """
    where, load = str(run.path), np.abs(history.load)
    remarks: list[str] = []
    errors: dict[str, Any] = {}
    if history.Q is None or history.closed is None:
        run, gaps, errors, past = _on_rim(history, run, remarks)
        Q = 4 + 2 * np.arange(gaps.shape[1])
    elif run.R is None and history.load_is != "p_over_E":
        raise InputError(f"{where}: expected --R, the body's radius")
    else:
        gaps, Q = np.where(history.closed, -np.inf, np.inf), history.Q
        past = np.zeros(int(Q.max()) // 2)
    half, line = 2 if run.symmetry == "half" else 1, 2 * (run.R or 1.0) * run.E
    over, twice = f" over 2 R E, E = {run.E:g}", " times 2" * (half == 2)
    divisor, name = {
        "p_over_E": (1.0, "p/E"),
        "line": (line, f"line load{over}"),
        "force": (line * run.thickness / half, f"force{twice}{over}, thickness {run.thickness:g}"),
    }[history.load_is]
    with np.errstate(over="ignore"):
        p_over_E = load / divisor
    if (bad := p_over_E > HUGE).any():  # NaN passes: transitions_of ignores those increments
        too_large = f"force {load[bad][0]:.6g}, p/E = {p_over_E[bad][0]:.6g}"
        raise InputError(f"{where}: {too_large}; expected p/E at most {HUGE:g}")
    try:
        frame, odd = transitions_of(p_over_E, gaps, Q, brackets=run.facts.brackets, **errors)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    texture = {"a_over_R": run.a_over_R, "b_over_R": run.b_over_R}
    frame = frame.assign(**texture, nu=run.nu, **columns)
    n_bracket = int(frame["p_over_E_lower"].notna().sum())
    messages = (
        *history.messages,
        *remarks,
        f"texture: a/R = {run.a_over_R:g}, b/R = {run.b_over_R:g}, nu = {run.nu:g}",
        f"load: {name}, {count(len(load), 'increment')} to p/E = {np.nanmax(p_over_E):.5g}",
        *odd,
        f"kept: {count(len(frame), 'transition')}, "
        f"Q = {frame['Q'].iloc[0]} to {frame['Q'].iloc[-1]}, "
        f"{'all' if n_bracket == len(frame) else n_bracket} as brackets",
    )
    doubts, pitches = [], 1 + run.b_over_R / run.a_over_R
    for Q_row, high, low in frame[["Q", "p_over_E", "p_over_E_lower"]].itertuples(index=False):
        # The load of a smooth contact grows as the square of its half-width. On a ridge it grows by
        # the load of a whole pitch while the half-width grows by the ridge's width.
        share = 1 - (1 + past[int(Q_row) // 2 - 2]) ** (-2 * pitches)
        if share > 1 - low / high:
            doubts.append(f"Q = {Q_row}: load about {percent(share)} too high")
    if doubts:
        rule = "the first node beyond a corner closes late; refine the mesh there, or give heights"
        doubts = [f"{'; '.join(doubts)}: {rule}"]
    return Imported(ContactTable.from_frame(frame, where=where), messages, doubts=tuple(doubts))


def _on_rim(
    history: ContactHistory, run: Run, remarks: list[str]
) -> tuple[Run, FloatArray, dict[str, Any], FloatArray]:
    """Return the body with R, gaps over R, shape (n_step, n_corner), and their errors.

    The last result is the distance of the first node past each corner, over the corner's from the
    axis, if only contact is known, else 0.
    """
    assert history.at is not None
    R, where, position, n = run.R or history.R, str(run.path), history.at, history.at.shape[1]
    if history.undeformed is None:
        rim = Rim.deformed(position[0], where, R=R, symmetry=run.symmetry)
    else:
        rim = Rim.of(history.undeformed, where, R=R, symmetry=run.symmetry)
    run = replace(run, R=rim.R)
    remarks.append(f"surface: {n} nodes on a circle of R = {rim.R:.6g}")
    away = np.abs(position[..., 0] - rim.centre[0])
    if position.shape[-1] == 1:
        return run, *_closed_gaps(history, away, run, rim)
    digits = history.digits
    if run.top is None and history.rigid is None:
        position, run = _relative_to_tops(position, away, run, rim), replace(run, top=0.0)
        digits = math.hypot(digits, _REST_ERROR * rim.R)
        remarks.append("tops: where the body rests on the first ridge, step by step")
    corners, radius, how = _corners(history.rigid, float(away.max()), run, rim)
    if run.symmetry == "half" and (beyond := n - len(rim.sides[0][0])):
        # Rim ignores a side with few nodes, such as nodes just beyond the axis of a half mesh.
        remarks.append(f"{beyond} surface nodes ignored: beyond the axis of a half mesh")
    remarks.append(how)
    gaps = np.array([rim.gaps(at, corners, radius)[1:] for at in position]) / rim.R
    if history.undeformed is None and np.isnan(gaps[:, 0]).all():
        at = f"x = {corners[1, 0]:.4g}, where the second ridge begins"
        raise InputError(f"{where}: no surface nodes about {at}; expected x from the body's axis")
    # Beside the flat tops the rim may dip into round corners without overlap.
    flat, width = corners + np.array([radius, 0.0]), run.a_over_R * rim.R - 2 * radius
    depth = np.array([rim.overlap(at, flat, width) for at in position])
    error = np.hypot(depth[:, None], digits) / rim.R
    # A height is the sum of two printed numbers, a coordinate and a displacement.
    errors = {"gap_error": error, "digits": 2 * history.digits / rim.R}
    return run, gaps, errors, np.zeros(gaps.shape[1])


def _corners(
    rigid: FloatArray | None, farthest: float, run: Run, rim: Rim
) -> tuple[FloatArray, float, str]:
    """Return the proximal corners (distance from the axis, height), their radius and a message."""
    R, b = rim.R, run.b_over_R * rim.R
    pitch = run.a_over_R * R + b
    rim.check_reach("surface node", farthest, str(run.path))
    n = max(math.ceil((farthest - b / 2) / pitch), 2)
    far = b / 2 + pitch * np.arange(n)
    if run.top is not None:
        corners = np.column_stack([far, np.full(n, run.top)])
        return corners, (run.corner_over_R or 0.0) * R, f"tops at y = {run.top:g}"
    assert rigid is not None
    away = np.abs(rigid[:, 0] - rim.centre[0])
    radius = run.corner_over_R
    if radius is None:
        radius = _corner_radius(away, rigid[:, 1], b / 2, run.a_over_R * R, R)
    # The highest rigid node at the end of each flat top gives the height of the ridge.
    at_ends = (rigid[np.abs(away - end) < NEAR * R, 1] for end in far + radius * R)
    heights = [float(y.max()) for y in takewhile(len, at_ends)]
    if len(heights) < 2:
        raise InputError(
            f"{run.path}: no rigid nodes at the corners, {far[0] + radius * R:.6g} and "
            f"{far[1] + radius * R:.6g} from the axis; expected a deck with the ridges and "
            "their --texture, or --top, their height, and --corner where corners are round"
        )
    tops = f"tops at y = {heights[0]:.6g} in the deck, {len(heights)} ridges a side"
    if radius and run.corner_over_R is None:
        tops += f"; corners of radius {radius:.6g} R, by the deck's nodes"
    return np.column_stack([far[: len(heights)], heights]), radius * R, tops


def _corner_radius(away: FloatArray, y: FloatArray, near: float, a: float, R: float) -> float:
    """Return the corner radius over R of the first ridge from its nodes; 0 for a sharp corner."""
    on = (away >= near - NEAR * R) & (away <= near + a / 2)
    if not on.any():
        return 0.0
    top = float(y[on].max())
    radius = float(away[on & (y >= top - NEAR * R * 1e-3)].min()) - near
    start = np.hypot(away - near, y - (top - radius)) < NEAR * R
    return round(radius / R, 9) if radius > NEAR * R and start.any() else 0.0


def _relative_to_tops(position: FloatArray, away: FloatArray, run: Run, rim: Rim) -> FloatArray:
    """Return positions with y = 0 at the height at which the body rests on the first ridge."""
    parts = np.array([_CORNER_MARGIN, 1 - _CORNER_MARGIN])
    near, far = rim.R * (run.b_over_R / 2 + parts * run.a_over_R)
    position = position.copy()
    for k, x in enumerate(away):
        over = (near <= x) & (x <= far)
        if not over.any():
            raise InputError(
                f"{run.path}, state {k + 1}: no rim node over the first ridge, {near:.4g} to "
                f"{far:.4g} from the axis; expected its texture and a mesh as fine, or --top"
            )
        # Heights of resting nodes scatter about the top by the mesh error; their median is robust.
        heights = position[k, over, 1]
        low = float(np.quantile(heights, _RESTING_QUANTILE))
        rest = float(np.median(heights[heights <= low + _LIFTED_HEIGHT * rim.R]))
        # At a transition a corner touches within rounding only; the shift makes it closed.
        position[k, :, 1] -= rest + _REST_ERROR * rim.R
    return position


def _closed_gaps(
    history: ContactHistory, away: FloatArray, run: Run, rim: Rim
) -> tuple[FloatArray, dict[str, Any], FloatArray]:
    """Return gaps of -inf (ridge in contact), inf (not in contact) or NaN (ambiguous).

    The shape is (n_step, n_ridge), from the second ridge on. A ridge is ambiguous if its only
    closed nodes lie over a groove, and thus may belong to another ridge.
    """
    assert history.closed is not None
    a, b = run.a_over_R * rim.R, run.b_over_R * rim.R
    farthest = float(np.max(away[history.closed], initial=0.0))
    rim.check_reach("closed node", farthest, str(run.path))
    n = max(math.ceil((farthest - b / 2) / (a + b)), 1) + 1
    near = b / 2 + (a + b) * np.arange(n)
    gap = np.full((len(away), n), math.inf)
    for i, closed in enumerate(history.closed):
        x = away[i, closed][:, None]
        over = (x >= near) & (x <= near + a)
        none = ~over.any(axis=1)
        over[none] = (x[none] >= near - b) & (x[none] <= near + a + b)
        sure = over & (over.sum(axis=1, keepdims=True) == 1)
        gap[i, over.any(axis=0)] = math.nan
        gap[i, sure.any(axis=0)] = -math.inf
    beyond = np.where(away[:, :, None] >= near, away[:, :, None], math.inf).min(axis=1)
    past = np.where(np.isfinite(beyond), beyond / near - 1, 0.0).max(axis=0)
    return gap[:, 1:], {}, past[1:]
