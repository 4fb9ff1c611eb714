"""The surface of a pressed cylinder: its nodes at each increment, and when they reach corners."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile

import numpy as np
from scipy.interpolate import krogh_interpolate

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.record import FARTHEST, HUGE, Imported
from ridgebayes.fea.transitions import transitions_of
from ridgebayes.table.table import ContactTable

_ROUND = 2e-3  # of R: how far surface nodes may lie off a circle
_LEAST_NODES = 5
_TINY = 1e-9  # radians: nodes so near to the axis are on both sides


@dataclass(frozen=True)
class CylinderSurface:
    """The surface's nodes from the bottom outwards, each side by itself, x counted outwards.

    Parameters
    ----------
    R : float, length
        Radius.
    centre : ndarray of float, shape (2,), length
        Of the undeformed circle.
    sides : tuple of (ndarray of int, float)
        Numbers of a side's nodes, and the sign of its x.
    """

    R: float
    centre: FloatArray
    sides: tuple[tuple[IntArray, float], ...] = field(repr=False)  # node numbers, sign of x

    @classmethod
    def of(
        cls, undeformed: FloatArray, where: str, *, R: float | None, symmetry: str
    ) -> "CylinderSurface":
        """Find centre, radius and sides of nodes, shape (n_node, 2).

        Raises
        ------
        InputError
            If they are few, are not on a circle, or not on the sides that the symmetry says.
        """
        at = undeformed
        if len(at) < _LEAST_NODES:
            raise InputError(f"{where}: {len(at)} surface nodes; expected at least {_LEAST_NODES}")
        if not (np.abs(at) <= HUGE).all():
            raise InputError(f"{where}: surface nodes; expected coordinates within {HUGE:g}")
        matrix = np.column_stack([2 * at, np.ones(len(at))])
        (x, y, c), *_ = np.linalg.lstsq(matrix, (at**2).sum(axis=1), rcond=None)
        if symmetry == "half":
            # The axis is where the mesh ends: nodes on it tell it better than a circle does.
            x = at[np.argmin(np.abs(at[:, 0] - x)), 0]
        centre = np.array([x, y])
        found = math.sqrt(max(c + x * x + y * y, 0.0))
        R = found if R is None else R
        off = np.abs(np.hypot(*(at - centre).T) - R)
        if not off.max() <= _ROUND * R:
            raise InputError(
                f"{where}: surface nodes lie up to {off.max():.3g} off a circle of R = {R:.6g} "
                f"about ({x:.4g}, {y:.4g}); expected the undeformed surface of a cylinder, within "
                f"{_ROUND:g} R (the circle through them has R = {found:.6g})"
            )
        angle = np.arctan2(at[:, 0] - x, y - at[:, 1])
        outwards = {sign: np.argsort(sign * angle) for sign in (1.0, -1.0)}
        halves = [(some[sign * angle[some] >= -_TINY], sign) for sign, some in outwards.items()]
        sides = tuple(half for half in halves if len(half[0]) >= _LEAST_NODES)
        if len(sides) != (1 if symmetry == "half" else 2):
            there, use = ("one side of the axis only", "half")
            if len(sides) > 1:
                there, use = "both sides of the axis", "full"
            raise InputError(f"{where}: surface nodes on {there}; use --symmetry {use}")
        return cls(float(R), centre, sides)

    def check_reach(self, what: str, distance: float, where: str) -> None:
        """Refuse what is so far from the axis as no body is.

        Raises
        ------
        InputError
        """
        if not distance <= FARTHEST * self.R:
            raise InputError(
                f"{where}: a {what} {distance:.3g} from the axis, R = {self.R:.6g}; expected "
                f"within {FARTHEST:g} R"
            )

    def _outwards(self, position: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Return each side's x, counted outwards from the axis, and y."""
        x, y = position[:, 0] - self.centre[0], position[:, 1]
        return [(sign * x[nodes], y[nodes]) for nodes, sign in self.sides]

    def gaps(self, position: FloatArray, corners: FloatArray, radius: float) -> FloatArray:
        """Return how far the rim is from each corner, the nearer side's: above sharp ones."""
        sides = []
        for x, y in self._outwards(position):
            if radius == 0:
                sides.append([_height(x, y, far) - high for far, high in corners])
            else:
                centres = corners + np.array([radius, -radius])
                sides.append([_distance(x, y, *centre) - radius for centre in centres])
        value: FloatArray = np.min(np.array(sides), axis=0)
        return value

    def overlap(self, position: FloatArray, corners: FloatArray, width: float) -> float:
        """Return how deep the rim is inside ridges, on the mean of where it is: a penalty's."""
        deep = []
        for x, y in self._outwards(position):
            on = (corners[:, :1] <= x) & (x <= corners[:, :1] + width)
            inside = corners[:, 1:] - y
            deep.append(inside[on & (inside > 0)])
        found = np.concatenate(deep)
        return float(found.mean()) if found.size else 0.0


def _height(x: FloatArray, y: FloatArray, at: float) -> float:
    """Return the lowest y of a curve through nodes where x = at; NaN where it does not get there.

    Through four nodes around, where x rises through them; straight between two else.
    """
    crossing = np.flatnonzero((x[:-1] - at) * (x[1:] - at) <= 0)
    if not crossing.size:
        return math.nan
    heights = []
    for i in crossing:
        some = slice(max(i - 1, 0), i + 3)
        xs, ys = x[some], y[some]
        if len(xs) < 4 or not (np.diff(xs) > 0).all():
            xs, ys = x[i : i + 2], y[i : i + 2]
            if xs[0] == xs[1]:
                heights.append(float(ys.min()))
                continue
        heights.append(float(krogh_interpolate(xs, ys, at)))
    return min(heights)


def _distance(x: FloatArray, y: FloatArray, at: float, height: float) -> float:
    """Return how far a point below is from a curve through nodes, straight between them."""
    start, along = np.column_stack([x, y])[:-1], np.diff(np.column_stack([x, y]), axis=0)
    from_start = np.array([at, height]) - start
    length = np.maximum((along**2).sum(axis=1), 1e-300)
    part = np.clip((from_start * along).sum(axis=1) / length, 0.0, 1.0)
    return float(np.hypot(*(from_start - part[:, None] * along).T).min())


@dataclass(frozen=True, eq=False)
class SurfaceHistory:
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
        What printed digits leave open of a position: half of the last one.
    messages : tuple of str
        What was understood, and what was ignored.
    """

    force: FloatArray
    undeformed: FloatArray
    position: FloatArray
    rigid: FloatArray
    digits: float = 0.0
    messages: tuple[str, ...] = ()


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
    symmetry: str = "half"
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
                "from 0 to 0.5, --symmetry half or full, --corner from 0 to half a ridge"
            )


@dataclass(frozen=True)
class Origin:
    """Where rows come from.

    Parameters
    ----------
    where : str
        Name that messages show.
    solver, source : str
        Columns of the table.
    """

    where: str
    solver: str
    source: str


def table_from_history(
    history: SurfaceHistory, body: Body, origin: Origin, *, brackets: bool = False
) -> Imported:
    """Follow the surface over each proximal corner, and tell at which load it gets there.

    Parameters
    ----------
    history : SurfaceHistory
        What the run printed.
    body : Body
        What it did not.
    origin : Origin
        Where it comes from.
    brackets : bool, optional
        As `ridgebayes.fea.transitions.transitions_of`.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        If the surface is not round, corners cannot be placed, or none is reached.
    """
    where, n = origin.where, len(history.undeformed)
    surface = CylinderSurface.of(history.undeformed, where, R=body.R, symmetry=body.symmetry)
    corners, how = _corners(history, body, surface, where)
    radius, width = body.corner_over_R * surface.R, body.a_over_R * surface.R
    gaps = np.array([surface.gaps(one, corners, radius) for one in history.position])
    # Over round corners a surface below the tops is no overlap: flats tell it.
    flat = corners + np.array([radius, 0.0])
    depth = np.array([surface.overlap(one, flat, width - 2 * radius) for one in history.position])
    # A few nodes beyond a half mesh's axis are no second side: see CylinderSurface.of.
    beyond = n - len(surface.sides[0][0]) if body.symmetry == "half" else 0
    across = [f"{beyond} surface nodes ignored: beyond the axis of a half mesh"] if beyond else []
    return table_from_gaps(
        history.force,
        gaps[:, 1:] / surface.R,
        replace(body, R=surface.R),
        origin,
        messages=(
            *history.messages,
            *across,
            f"surface: {n} nodes on a circle of R = {surface.R:.6g}",
            how,
        ),
        brackets=brackets,
        gap_error=np.hypot(depth[:, None], history.digits) / surface.R,
        digits=2 * history.digits / surface.R,
    )


def table_from_gaps(
    force: FloatArray,
    gaps: FloatArray,
    body: Body,
    origin: Origin,
    *,
    messages: Sequence[str],
    brackets: bool,
    gap_error: FloatArray | float = 0.0,
    digits: float = 0.0,
) -> Imported:
    """Tell at which load the surface gets to each corner beyond the first.

    Parameters
    ----------
    force : ndarray of float, shape (n_level,), force
        As `SurfaceHistory`.
    gaps : ndarray of float, shape (n_level, n_corner), over R
        As `ridgebayes.fea.transitions.transitions_of`.
    body : Body
        With its R.
    origin : Origin
        Where rows come from.
    messages : sequence of str
        What was understood so far.
    brackets, gap_error, digits
        As `ridgebayes.fea.transitions.transitions_of`.

    Raises
    ------
    InputError
        If a load is beyond what can be computed with, or no corner is reached.
    """
    where = origin.where
    assert body.R is not None
    half = 2 if body.symmetry == "half" else 1
    with np.errstate(over="ignore"):
        p_over_E = np.abs(force) * half / body.thickness / (2 * body.R * body.E)
    if (bad := p_over_E > HUGE).any():  # NaN passes: transitions_of ignores those increments
        raise InputError(
            f"{where}: force {force[bad][0]:.6g}, p/E = {p_over_E[bad][0]:.6g}; expected p/E at "
            f"most {HUGE:g}"
        )
    Q = 4 + 2 * np.arange(gaps.shape[1])
    try:
        frame, odd = transitions_of(
            p_over_E, gaps, Q, brackets=brackets, gap_error=gap_error, digits=digits
        )
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    frame.insert(0, "a_over_R", body.a_over_R)
    frame.insert(1, "b_over_R", body.b_over_R)
    frame = frame.assign(nu=body.nu, solver=origin.solver, source=origin.source)
    n_bracket = int(frame["p_over_E_lower"].notna().sum())
    messages = (
        *messages,
        f"texture: a/R = {body.a_over_R:g}, b/R = {body.b_over_R:g}, nu = {body.nu:g}",
        f"load: force {'times 2 ' if half == 2 else ''}over 2 R E, E = {body.E:g}, "
        f"{len(p_over_E)} increments to p/E = {np.nanmax(p_over_E):.5g}",
        *odd,
        f"kept: {len(frame)} transitions, Q = {frame['Q'].iloc[0]} to {frame['Q'].iloc[-1]}, "
        f"{'all' if n_bracket == len(frame) else n_bracket} as brackets",
    )
    return Imported(ContactTable.from_frame(frame, where=where), messages)


def _corners(
    history: SurfaceHistory, body: Body, surface: CylinderSurface, where: str
) -> tuple[FloatArray, str]:
    """Return the proximal corners as distance from the axis and height, and how they were found."""
    pitch = (body.a_over_R + body.b_over_R) * surface.R
    farthest = np.abs(history.position[..., 0] - surface.centre[0]).max()
    surface.check_reach("surface node", farthest, where)
    n = max(math.ceil((farthest - body.b_over_R * surface.R / 2) / pitch), 2)
    far = body.b_over_R * surface.R / 2 + pitch * np.arange(n)
    if body.top is not None:
        return np.column_stack([far, np.full(n, body.top)]), f"tops at y = {body.top:g}"
    # Rigid nodes stand at the corners: the highest of those at each distance.
    near, flat = 1e-5 * surface.R, far + body.corner_over_R * surface.R
    away = np.abs(history.rigid[:, 0] - surface.centre[0])
    here = (history.rigid[np.abs(away - one) < near, 1] for one in flat)
    heights = [float(some.max()) for some in takewhile(len, here)]
    if len(heights) < 2:
        raise InputError(
            f"{where}: no rigid nodes at the corners, {flat[0]:.6g} and {flat[1]:.6g} from the "
            "axis; expected a deck with the ridges' nodes and the --texture that they make, or "
            "--top, the height of the ridges' tops"
        )
    tops = f"tops at y = {heights[0]:.6g} in the deck, {len(heights)} ridges a side"
    return np.column_stack([far[: len(heights)], heights]), tops
