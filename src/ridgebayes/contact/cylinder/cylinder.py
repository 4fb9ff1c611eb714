"""Soft cylinder on parallel ridges: its transitions in order of load.

The ridges rise towards the body. Each transition is the rise at which the corner of the next ridge
touches the body, so no load increment enters its load. On the way the distance of this corner is
reduced in steps whose length is adapted to the number of Newton steps.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from ridgebayes._types import NEO_HOOKEAN, FloatArray, IntArray, Ogden
from ridgebayes.contact import hertz
from ridgebayes.contact.cylinder.contact_problem import ContactProblem, State
from ridgebayes.contact.cylinder.faces import (
    Corner,
    Faces,
    Resolution,
    first_height,
    plate,
    proximal_corner,
    ridge_faces,
)
from ridgebayes.contact.cylinder.material import Material
from ridgebayes.contact.cylinder.mesh import disk_mesh
from ridgebayes.contact.cylinder.newton import Control, NotConvergedError, OutOfStepsError, solve
from ridgebayes.contact.cylinder.solid import Solid
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import InputError

# Length of the segment at a sharp corner, in edges, because the body's edge cannot follow the turn.
# Shorter segments hold the body on the corner, and longer segments let it sink in. The error of a
# load is 0.05 %.
CORNER = 0.4
SEGMENT = 1.25  # length of other segments, in edges, which do not resolve shorter segments
_ARC_SEGMENTS = 8  # segments of a round corner
_FIRST_SHARE, _MIN_SHARE = 0.1, 1e-3  # step as a share of the corner's distance
# A long step, as a share of the corner's distance. With friction first steps are at most this long,
# because loads depend on the path; without friction they are twice as long. Shorter steps do not
# save Newton steps where the rim snaps past sharp corners.
_LONG_SHARE = 0.25
# Fewer Newton steps than the first number double the share; more than the second halve a long one.
_FEW_STEPS, _MANY_STEPS = 6, 10
# Error of states between transitions, in tolerances: 1e-5 of the load.
_LOOSE_TOLERANCES = 1e4
# Failed solves on the way to a transition. A solve that takes all Newton steps counts twice,
# because it costs as much as five successful solves.
MOST_FAILURES = 16
_MAX_ELEMENTS = 40_000
_GROWTH = 0.3  # of edge lengths with distance from the ridges


@dataclass(frozen=True, eq=False)
class Transition:
    """Transition at which the body just touches another ridge.

    Parameters
    ----------
    ridge : int
        Number of the ridge.
    Q : int
        Number of ridges touched from this load on.
    p_over_E : float
        Load.
    state : State
        State of the body at the transition.
    """

    ridge: int
    Q: int
    p_over_E: float
    state: State


class Cylinder:
    """Soft cylinder on rigid ridges; lengths over its radius, stresses over Young's modulus.

    Parameters
    ----------
    profile : Profile or None
        Rigid profile; None for a flat.
    nu : float, optional
        Poisson's ratio.
    p_max : float
        Largest load p/E for which the mesh is made.
    friction : float, optional
        Coulomb's coefficient.
    edges : float, optional
        Number of edges of the rim over a ridge's width.
    ogden : tuple of (float, float), optional
        Terms of `Material`; neo-Hookean if not given.

    Raises
    ------
    InputError
        If a value is out of range, or the mesh would have over 40,000 elements.
    """

    def __init__(
        self,
        profile: Profile | None,
        *,
        p_max: float,
        nu: float = 0.5,
        friction: float = 0.0,
        edges: float = 24.0,
        ogden: Ogden = NEO_HOOKEAN,
    ) -> None:
        if not friction >= 0:
            raise InputError(f"friction = {friction!r}; expected >= 0")
        if not 0 < p_max <= 1:
            raise InputError(f"p_max = {p_max!r}; expected over 0 and at most 1")
        self.profile = profile
        self.mirrored = profile is None or profile.mirrored
        material = Material(nu, ogden)
        # Wider than on a half-plane: a body on ridges reaches farther, and extra mesh is cheap.
        self._reach = min(1.2 * float(hertz.half_width(p_max, nu=nu)) + 0.02, 1.2)
        sizes = _Sizes.of(profile, self._reach, edges, p_max)
        mesh = disk_mesh(sizes.at, both_sides=not self.mirrored)
        n = mesh.mesh.t.shape[1]
        if n > _MAX_ELEMENTS:
            raise InputError(
                f"{n} elements at {edges:g} edges a ridge; expected at most "
                f"{_MAX_ELEMENTS}: fewer edges, a lower load or rounder corners need less"
            )
        if profile is None:
            self._height = -1.0
            faces = [plate(min(self._reach, 1.0), sizes.resolution.most)]
        else:
            self._height = first_height(profile)
            numbers = _ridges_within(profile, self._reach)
            faces = ridge_faces(profile, numbers, self._height, sizes.resolution)
        solid = Solid(mesh, material)
        held = np.zeros((solid.n_node, 2), dtype=bool)
        # The mid-plane of a whole body may widen, but its middle is fixed.
        middle = np.intersect1d(mesh.axis, mesh.mid_plane)
        held[mesh.axis if self.mirrored else middle, 0] = True
        held[mesh.mid_plane, 1] = True
        self.problem = ContactProblem(solid, Faces(faces), held, friction=friction)
        # A half model carries half the load; p is the line load over 2 R.
        self._per_load = 1.0 if self.mirrored else 0.5

    def unloaded(self) -> State:
        """Return the state in which the ridges just touch the undeformed body."""
        return self.problem.unloaded()

    def p_over_E(self, state: State) -> float:
        """Return the load of a state."""
        gaps = self.problem.gaps(state, state, np.zeros(len(self.problem.faces), dtype=bool))
        return self._per_load * self.problem.load(state, gaps)

    @property
    def first_count(self) -> int:
        """Number of ridges touched at the smallest load."""
        over_a_groove = self.profile is not None and self.profile.offset == 0.0
        return 2 if over_a_groove else 1

    def at_load(self, p_over_E: float, start: State) -> State:
        """Return the state at a load, starting from the state at another load.

        Raises
        ------
        NotConvergedError
            If no equilibrium is found; the message has the load.
        """
        now, state = self.p_over_E(start), start
        step = p_over_E - now
        while now != p_over_E:
            goal = now + step if abs(p_over_E - now - step) > 1e-12 else p_over_E
            try:
                there, n = solve(self.problem, state, Control("load", goal / self._per_load))
            except NotConvergedError as failed:
                step /= 3
                if abs(step) < 1e-3 * p_over_E:
                    raise NotConvergedError(f"at p/E = {now:.5g}: {failed}") from None
                continue
            state, now = there, goal
            step = min(step * (2.0 if n < 7 else 1.0), p_over_E - now, key=abs)
        return state

    def transitions(
        self, p_max: float, *, most_failures: int = MOST_FAILURES, after: Transition | None = None
    ) -> Iterator[Transition]:
        """Yield the transitions up to a load, in order.

        Parameters
        ----------
        p_max : float, scalar, dimensionless
            Largest load over E.
        most_failures : int, optional
            Number of failed solves on the way to a transition after which it is given up. A solve
            that takes all Newton steps counts twice.
        after : Transition, optional
            Transition found on another mesh. Only later transitions are yielded, and the solver
            does not stop at earlier ones.

        Raises
        ------
        NotConvergedError
            If the next ridge is not reached; the message has the load and the reason.
        """
        profile = self.profile
        if profile is None:
            return
        state, step = self.unloaded(), _FIRST_SHARE
        low = high = 0
        if not profile.mirrored:
            low = high = min((0, -1), key=lambda k: abs(proximal_corner(profile, k, 0).centre[0]))
        if after is not None:
            others = after.ridge if self.mirrored else after.Q - self.first_count
            low = after.ridge - (others if after.ridge >= 0 else 0)
            high = low + others
        corners = self._ahead(profile, low, high)
        while reached := self._next(state, corners, p_max, step, most_failures):
            state, corner, step = reached
            low, high = min(low, corner.ridge), max(high, corner.ridge)
            count = self.first_count + (2 * high if self.mirrored else high - low)
            load = self.p_over_E(state)
            yield Transition(corner.ridge, count, load, state)
            # Loads grow at least as the square of the corners' distance: as the square for a smooth
            # body, faster with grooves, and still 1 % faster at finite strain and p/E = 0.06.
            corners = self._ahead(profile, low, high)
            further = min(abs(next_corner.centre[0]) for next_corner in corners)
            if 0.99 * load * (further / abs(corner.centre[0])) ** 2 > p_max:
                return

    def _ahead(self, profile: Profile, low: int, high: int) -> list[Corner]:
        """Return the corners that may be reached next while ridges low to high are touched."""
        numbers = [high + 1] if self.mirrored else [low - 1, high + 1]
        return [proximal_corner(profile, number, self._height) for number in numbers]

    def _next(
        self, state: State, corners: list[Corner], p_max: float, step: float, most_failures: int
    ) -> tuple[State, Corner, float] | None:
        """Return the state that touches the first of some corners; None above the largest load.

        `step` is the first step, as a share of the corner's distance. The result has the next.
        """
        frictional = self.problem.friction > 0
        distances = [self.problem.corner_distance(state, corner)[0] for corner in corners]
        i = int(np.argmin(distances))
        distance, share = distances[i], 1.0
        failures = 0
        while True:
            goal = share - step if share - step > _MIN_SHARE else 0.0
            control = Control("corner", goal * distance, corners[i])
            try:
                enough = _LOOSE_TOLERANCES if goal and not frictional else 1.0
                reached, n = solve(self.problem, state, control, enough=enough)
            except NotConvergedError as failed:
                step /= 3
                failures += 2 if isinstance(failed, OutOfStepsError) else 1
                if step < _MIN_SHARE or failures >= most_failures:
                    why = f"at p/E = {self.p_over_E(state):.5g}: {failed}"
                    raise NotConvergedError(why) from None
                continue
            distances = [self.problem.corner_distance(reached, corner)[0] for corner in corners]
            nearest = int(np.argmin(distances))
            if nearest != i and distances[nearest] < 0:
                # Another corner came first: go towards it from the previous state.
                i = nearest
                distance, share = self.problem.corner_distance(state, corners[i])[0], 1.0
                continue
            state, share = reached, goal
            if self.p_over_E(state) > p_max:
                return None
            step *= (
                2.0 if n < _FEW_STEPS else 0.5 if n > _MANY_STEPS and step >= _LONG_SHARE else 1.0
            )
            if share == 0.0:
                return state, corners[i], min(step, _LONG_SHARE if frictional else 2 * _LONG_SHARE)


def transition_curve(
    body: Cylinder,
    p_max: float,
    *,
    seen: Callable[[Transition], None] | None = None,
    most_failures: int = MOST_FAILURES,
    after: Transition | None = None,
) -> tuple[IntArray, FloatArray, tuple[str, ...]]:
    """Return all transitions up to a load as a curve.

    Parameters
    ----------
    body : Cylinder
        Body on ridges.
    p_max : float, scalar, dimensionless
        Largest load over E.
    seen : callable, optional
        Called with each transition when it is found.
    most_failures, after : optional
        See `Cylinder.transitions`.

    Returns
    -------
    Q : ndarray of int, shape (n,)
        Number of ridges touched from each load on.
    p_over_E : ndarray of float, shape (n,), dimensionless
        Loads, rising; NaN if none was found.
    status : tuple of str
        ``ok``. If no equilibrium is found, a last row gives the load and the reason.
    """
    rows: list[tuple[int, float, str]] = []
    try:
        for transition in body.transitions(p_max, most_failures=most_failures, after=after):
            rows.append((transition.Q, transition.p_over_E, "ok"))
            if seen is not None:
                seen(transition)
    except NotConvergedError as failed:
        before = after.Q if after is not None else body.first_count
        count = (rows[-1][0] if rows else before) + (2 if body.mirrored else 1)
        rows.append((count, math.nan, f"not converged: {failed}"))
    counts, loads, status = zip(*rows, strict=True) if rows else ((), (), ())
    return np.array(counts, dtype=np.int64), np.array(loads), status


@dataclass(frozen=True)
class _Sizes:
    """Target lengths of the rim's edges, and of the segments of the rigid side."""

    at_corner: float
    resolution: Resolution
    spans: FloatArray = field(repr=False)  # intervals of ridges on the right half, (n, 2)
    windows: FloatArray = field(repr=False)  # parts of the rim that meet their corners, (n, 2)

    @classmethod
    def of(cls, profile: Profile | None, reach: float, edges: float, p_max: float) -> "_Sizes":
        if profile is None:
            edge = reach / (6 * edges)
            spans = np.array([[0.0, reach]])
            return cls(edge, Resolution(edge, _ARC_SEGMENTS, SEGMENT * edge, edge), spans, spans)
        edge = min(profile.a, 4 * profile.b, 0.5 * reach) / edges
        segments = [profile.ridge(k) for k in _ridges_within(profile, reach)]
        spans = np.array([sorted((abs(segment.start), abs(segment.stop))) for segment in segments])
        at_corner, arc = edge, _ARC_SEGMENTS
        if profile.corner:
            quarter = profile.corner * math.pi / 2
            arc = max(round(_ARC_SEGMENTS * edges / 24), 2, math.ceil(quarter / (SEGMENT * edge)))
            at_corner = min(quarter / arc / SEGMENT, edge)
        resolution = Resolution(CORNER * edge, arc, SEGMENT * edge, edge)
        # Points on a corner under load were nearer the axis before, by some 0.25 to 0.5 p/E of
        # their distance; while the load is small, they were slightly farther out.
        far = spans.ravel()
        around = 1.5 * profile.corner + 3 * at_corner
        outside = 0.1 * np.minimum(far, 1.0) ** 3
        windows = np.column_stack([far - around - 0.6 * p_max * far, far + around + outside])
        return cls(at_corner, resolution, spans, windows)

    def at(self, theta: FloatArray) -> FloatArray:
        """Return target lengths at angles: short on ridges, shorter at their corners."""
        # A point of the rim moves between its arc length and its abscissa, or slightly farther.
        edge = self.resolution.edge
        slack = 0.3 * np.minimum(theta, 1.0) ** 3 + 2 * edge
        length = edge + _GROWTH * np.maximum(_outside(self.spans, theta) - slack, 0.0)
        if self.at_corner < edge:
            length = np.minimum(length, self.at_corner + _GROWTH * _outside(self.windows, theta))
        return np.asarray(length)


def _outside(spans: FloatArray, theta: FloatArray) -> FloatArray:
    """Return the distance of angles from the nearest of some intervals, 0 inside."""
    away = np.maximum(spans[:, :1] - theta, theta - spans[:, 1:])
    return np.asarray(np.maximum(away, 0.0).min(axis=0))


def _ridges_within(profile: Profile, reach: float) -> range:
    """Return the numbers of the ridges that begin within a distance of the axis."""
    first, last = 0 if profile.mirrored else -1, 0
    while profile.ridge(last + 1).start < reach:
        last += 1
    while first < 0 and profile.ridge(first - 1).stop > -reach:
        first -= 1
    return range(first, last + 1)
