"""Contacts of many bodies under many loads, interpolated between solved contacts.

By the scale law, contact of sharp ridges without floors depends on W/pitch^2, groove over ridge and
the offset in pitches. The loads of a count are an interval between the loads that reach this count
and the next. Nodes of the grid are shapes and places in the interval. Places are spaced by the root
of the load, because a new contact grows with this root. They are refined where a free end reaches
its corner or the flat of a round corner, and where a floor is touched.
"""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.axes import Axis, Spread
from ridgebayes.contact.contact_solution import (
    DEFAULT_REL_TOL,
    ContactSolution,
    coefficients_for,
    solve_contact,
)
from ridgebayes.contact.edges import edge_forces
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile, RigidSegment
from ridgebayes.errors import ComputationError, InputError

_N_PLACE = 25  # nodes of an interval (or decade of loads)
# Distance of loads from the ends of an interval, over its length. Also the lowest load of the table
# over the load at which the count first changes.
CLOSEST = 1e-4
_CLOSEST_OFFSETS = 0.01  # the same, if ends are interpolated between offsets
MOST_DISTINCT = 32  # shapes without interpolation
_MAX_COEFFICIENTS = 64  # of a ridge in a grid: enough for grooves of 0.6 % of a sharp ridge
# Columns of `shapes_of`. A shape has lengths over the ridge, or over the radius.
_SHAPE = ("groove/ridge", "offset", "depth", "corner/ridge", "ridge")
_COLUMNS = (*_SHAPE, "groove", "corner")
_OVER_RIDGE = [_COLUMNS.index(name) for name in _SHAPE]
_OVER_RADIUS = [_COLUMNS.index(name.removesuffix("/ridge")) for name in _SHAPE]
_N_NODE = 17  # nodes of an axis of shapes


@dataclass(frozen=True, eq=False)
class ContactValues:
    """Contacts of n bodies with a common count Q; lengths are over R.

    Parameters
    ----------
    W : ndarray of float, shape (n,)
        Load at which the mechanics counts Q, nearest to the requested load.
    length : ndarray of float, shape (n,)
        Sum of touching widths.
    extent : ndarray of float, shape (n,)
        Distance between the outermost ends of contact.
    penetration : ndarray of float, shape (n,)
        Largest penetration into a groove; NaN if only one ridge is touched.
    share, largest_share : ndarray of float, shape (n,)
        Share of the load on all ridges (below 1 if floors are touched), and largest share on a
        ridge.
    x, K : ndarray of float, shape (n, 2 Q)
        Edges from left to right, as in `edges.EdgeForces`; K at nu = 0.
    """

    W: FloatArray
    length: FloatArray
    extent: FloatArray
    penetration: FloatArray
    share: FloatArray
    largest_share: FloatArray
    x: FloatArray
    K: FloatArray


_FIXED = len({field.name for field in fields(ContactValues)} - {"W", "x", "K"})  # without edges


class ResponseTable:
    """Table of the contacts of many bodies.

    Parameters
    ----------
    seen : Spread
        `shapes_of` all bodies, with up to `MOST_DISTINCT` distinct rows.

    Raises
    ------
    InputError
        If more than two values of shapes vary.

    Notes
    -----
    *Accuracy.* The caller measures errors with `solved`.

    *Cost.* About 0.1 s per shape and count. Up to 32 distinct shapes are solved; more shapes are
    interpolated from 17 ratios of groove to ridge, or 17 offsets, or both.
    """

    def __init__(self, seen: Spread) -> None:
        self._seen, self._margin, distinct = seen, CLOSEST, seen.distinct
        self._columns = _OVER_RIDGE
        self._axes: list[Axis] = []
        if distinct is None:
            choices = [(columns, _axes(seen, columns)) for columns in (_OVER_RIDGE, _OVER_RADIUS)]
            sizes = [math.prod(axis.n for axis in axes) for _, axes in choices]
            self._columns, self._axes = choices[sizes.index(min(sizes))]
            if sum(axis.n > 1 for axis in self._axes) > 2:
                rule = "certain widths and radius where corners are round or floors are touched"
                raise InputError(f"scene: too many values vary at once; expected {rule}")
            if self._axes[1].n > 1:
                self._margin = _CLOSEST_OFFSETS
            mesh = np.meshgrid(*(axis.nodes for axis in self._axes), indexing="ij")
            rows = np.stack([coordinate.ravel() for coordinate in mesh], axis=1)
        else:
            rows = distinct[:, self._columns]
        over_ridge = self._columns == _OVER_RIDGE
        profiles = [_profile(row, over_ridge=over_ridge) for row in rows]
        if self._axes:
            _refuse_narrow(profiles)
        self._shapes = [_Shape(profile, self._margin) for profile in profiles]

    def _weights(self, shapes: FloatArray) -> FloatArray:
        """Return the weight of each shape, (n, n_shape)."""
        if not self._axes:
            return np.asarray(np.eye(len(self._shapes))[self._seen.place(shapes)])
        weights = np.ones((len(shapes), 1))
        for axis, column in zip(self._axes, shapes[:, self._columns].T, strict=True):
            weights = weights[:, :, None] * axis.weights(column)[:, None, :]
            weights = weights.reshape(len(shapes), -1)
        return weights

    def at(self, profiles: FloatArray, Q: int, W: FloatArray) -> ContactValues:
        """Return the contacts of bodies that have the count Q, at loads near W.

        Parameters
        ----------
        profiles : ndarray of float, shape (n, 5)
            a, b, depth, corner and offset of each body, as in `Profile`.
        Q : int
            Even count.
        W : ndarray of float, shape (n,)
            Requested loads.

        Raises
        ------
        InputError
            If a body never touches Q ridges, as for even counts over the centre of a ridge.
        ComputationError
            If a contact cannot be solved.
        """
        weights, unit = self._weights(shapes_of(profiles)), _units(profiles)
        used = np.flatnonzero((weights != 0).any(axis=0))
        weights, shapes = weights[:, used], [self._shapes[i] for i in used]
        ends = np.array([np.log(shape.interval(Q)) for shape in shapes])
        low, high = (weights @ ends).T
        log_load = np.log(W / unit**2)
        y = (log_load - low) / (high - low)
        inside = np.clip(y, -np.inf if Q == 2 else self._margin, 1 - self._margin)
        loads = np.where(inside == y, W, np.exp(low + inside * (high - low)) * unit**2)
        root = np.sqrt(np.maximum(inside, 0.0))
        values = np.zeros((len(profiles), _FIXED + 4 * Q))
        for weight, shape in zip(weights.T, shapes, strict=True):
            of_shape = shape.values(Q)
            values += weight[:, None] * of_shape(np.clip(root, of_shape.x[0], of_shape.x[-1]))
        power = np.repeat([1.0, 1.0, 2.0, 0.0, 0.0, 1.0, 1.5], [1] * _FIXED + [2 * Q] * 2)
        contact = _contacts(loads, values * unit[:, None] ** power)
        mirrored, x, K = (profiles[:, 4] < 0)[:, None], contact.x, contact.K
        x, K = np.where(mirrored, -x[:, ::-1], x), np.where(mirrored, K[:, ::-1], K)
        return replace(contact, x=x, K=K)


def solved(profile: FloatArray, Q: int, W: float) -> ContactValues:
    """Solve the contact of a single body, in the format of `ResponseTable.at`."""
    solution = solve_contact(Profile(*profile.tolist()), W)
    return _contacts(np.array([W]), _flat_values(solution, Q)[None])


def _contacts(W: FloatArray, values: FloatArray) -> ContactValues:
    return ContactValues(W, *values[:, :_FIXED].T, *np.split(values[:, _FIXED:], 2, axis=1))


def shapes_of(profiles: FloatArray) -> FloatArray:
    """Return the quantities (n, 7) on which contacts of profiles (n, 5) depend.

    These are the logs of groove, depth, corner and ridge, and the offset. Contacts of sharp ridges
    depend on groove over ridge and on depth over the square of the pitch. A groove with round
    corners is measured with both corners, because contacts do not change when it closes. Groove and
    corner are given over the ridge and over R; if some lengths are certain, fewer columns of one of
    the two vary.
    """
    a, b, depth, corner, offset = profiles.T
    unit, groove, is_sharp = _units(profiles), b + 2 * corner, corner == 0
    with np.errstate(divide="ignore"):
        over_ridge = np.log(groove / a), np.log(corner / a)
        over_radius = (np.where(is_sharp, over_ridge[0], np.log(groove)), np.log(corner))
        columns = [over_ridge[0], np.abs(offset), np.log(depth / unit**2), over_ridge[1]]
    columns += [np.where(is_sharp, 0.0, np.log(a)), *over_radius]
    return np.stack(columns, axis=1).round(12)


def _units(profiles: FloatArray) -> FloatArray:
    return np.where(profiles[:, 3] > 0, 1.0, profiles[:, 0] + profiles[:, 1])


def _axes(seen: Spread, columns: list[int]) -> list[Axis]:
    """Return axes for some columns of `shapes_of`; the second is the offset."""
    ranges = list(zip(seen.low[columns], seen.high[columns], strict=True))
    axes = [Axis.over(*ends, _n_node(*ends)) for ends in ranges]
    # Free ends change with the offset, so cubic splines would oscillate.
    # At 0.5 counts are odd.
    near, far = (min(end, 0.5 * (1 - _CLOSEST_OFFSETS)) for end in ranges[1])
    axes[1] = Axis.over(near, far, _N_NODE, degree=1)
    return axes


def _n_node(low: float, high: float) -> int:
    """Return the number of nodes of an axis of logarithms: as dense as needed for a factor e."""
    with np.errstate(invalid="ignore"):  # both ends may be infinite
        dense = np.nan_to_num((high - low) * (_N_NODE - 1))
    return int(np.clip(np.ceil(dense) + 1, _N_NODE // 4 + 1, _N_NODE))


def _profile(shape: FloatArray, *, over_ridge: bool) -> Profile:
    """Return the profile of a shape; sharp profiles have a pitch of 1."""
    groove, offset, depth, corner, ridge = shape.tolist()
    if corner == -math.inf:
        a = 1 / (1 + math.exp(groove))
        return Profile(a, 1 - a, math.exp(depth), 0.0, offset)
    a = math.exp(ridge)
    scale = a if over_ridge else 1.0
    radius = min(scale * math.exp(corner), 0.5 * a)
    floor = 0.5 * radius if math.isclose(math.exp(depth), 0.5 * radius) else math.exp(depth)
    b = scale * math.exp(groove) - 2 * radius
    if not b > 0:
        rule = "expected a certain corner_radius where grooves may close"
        raise InputError(f"scene: too many values vary at once; {rule}")
    return Profile(a, b, floor, radius, offset)


def _refuse_narrow(profiles: list[Profile]) -> None:
    """Refuse sharp grooves so narrow that a grid would take hours."""
    for profile in profiles:
        needed = coefficients_for(profile, DEFAULT_REL_TOL, 0.5 * profile.a)
        if profile.corner == 0 and needed > _MAX_COEFFICIENTS:
            rule = "expected sharp grooves that vary to be wider than 0.6 % of ridge_width"
            share = f"{100 * profile.b / profile.a:.2g} %; truncated(..) keeps draws above"
            raise InputError(f"scene: groove_width: {rule}, got {share}")


class _Shape:
    """Loads and interpolated contacts of a profile, for each count.

    Places in an interval are inside it by a margin.
    """

    def __init__(self, profile: Profile, margin: float) -> None:
        self._profile, self._margin = profile, margin
        self._events: tuple[FloatArray, IntArray] = np.empty(0), np.empty(0, dtype=np.int64)
        self._cache: dict[int, PchipInterpolator] = {}

    def interval(self, Q: int) -> tuple[float, float]:
        """Return the smallest and largest load with count Q."""
        W, counts = self._events
        while not len(counts) or counts[-1] <= Q:
            top = max(4 * W[-1] if len(W) else 0.0, 0.5 * ((Q / 2 + 2) * self._profile.pitch) ** 2)
            reaching = reaching_loads(self._profile, W_max=top)
            failed = [text for text in reaching.status if text != "ok"]
            if failed:
                raise ComputationError(f"contact of Q = {Q}: {failed[0]}")
            W, counts = self._events = reaching.W, reaching.Q
        i = int(np.searchsorted(counts, Q, side="right"))
        if i == 0:
            if counts[0] - 1 < Q or self._first != Q:
                raise _impossible_count(Q, self._profile)
            return float(W[0]) * CLOSEST, float(W[0])
        if counts[i - 1] != Q:
            raise _impossible_count(Q, self._profile)
        return float(W[i - 1]), float(W[i])

    @cached_property
    def _first(self) -> int:
        return solve_contact(self._profile, float(self._events[0][0]) * CLOSEST).Q

    def values(self, Q: int) -> PchipInterpolator:
        """Return an interpolator of `_flat_values` by the root of the place in the interval."""
        if Q not in self._cache:
            low, high = self.interval(Q)
            # The first interval covers decades of loads and has more nodes. Between offsets the
            # linear interpolation errs as much as that between a third of the nodes.
            n = _N_PLACE if self._margin == CLOSEST else _N_PLACE // 3
            n *= max(round(math.log10(high / low)), 1)
            nodes: dict[float, ContactSolution] = {}
            start: Mapping[RigidSegment, tuple[float, float]] = {}
            ends = math.sqrt(self._margin), math.sqrt(1 - self._margin)
            for root in np.linspace(*ends, n).tolist():
                place, solution = self._solve(Q, root**2, start)
                nodes[place], start = solution, solution.covered
            apart = 1.0 / n
            while apart > self._margin:  # bisect towards the places where free ends change
                apart *= 0.5
                for first, last in itertools.pairwise(sorted(nodes)):
                    if _free_ends(nodes[first]) != _free_ends(nodes[last]):
                        root = 0.5 * (math.sqrt(first) + math.sqrt(last))
                        nodes |= [self._solve(Q, root**2, nodes[first].covered)]
            places = sorted(nodes)
            values = np.array([_flat_values(nodes[place], Q) for place in places])
            self._cache[Q] = PchipInterpolator(np.sqrt(places), values)
        return self._cache[Q]

    def _solve(
        self, Q: int, y: float, start: Mapping[RigidSegment, tuple[float, float]]
    ) -> tuple[float, ContactSolution]:
        """Return a place at y, or farther inside if that cannot be solved, and its contact."""
        low, high = self.interval(Q)
        inside = CLOSEST * max(1.0, 0.5 / math.log(high / low))
        while True:
            inside = min(inside, 0.25)
            place = min(max(y, inside), 1 - inside)
            W = low * (high / low) ** place
            solution = solve_contact(self._profile, W, start=start)
            if start and solution.status != "ok":  # the start may cause a cycle
                solution = solve_contact(self._profile, W)
            inside *= 4
            is_solved = solution.status == "ok" and solution.Q == Q
            if is_solved or inside > 0.25 or inside <= y <= 1 - inside:
                return place, solution


def _free_ends(solution: ContactSolution) -> tuple[bool, ...]:
    """Return whether each end of contact is on the flat part of its segment."""
    flats = ((segment.flat, ends) for segment, ends in solution.covered.items())
    return tuple(x for flat, (a, b) in flats for x in (a > flat[0], b < flat[1]))


def _flat_values(solution: ContactSolution, Q: int) -> FloatArray:
    """Return the fields of `ContactValues` after W as one array, shape (5 + 4 Q,)."""
    if solution.status != "ok" or solution.Q != Q:
        body = solution.profile
        shape = f"groove_width {body.b / body.a:.3g}, corner_radius {body.corner / body.a:.3g}"
        state = f"Q = {solution.Q} for {Q}, {solution.status}"
        raise ComputationError(
            f"scene: {shape} of ridge_width, offset {body.offset:.3g}: expected a contact that can "
            f"be solved, got {state}; a truncated distribution keeps to values whose contact can be"
        )
    first, last = solution.ends
    on_ridges = np.array([segment.ridge is not None for segment in solution.segments])
    share = (solution.pressing.forces / solution.pressing.load)[on_ridges]
    times = solution.pressing.intervals.weight[on_ridges]
    deepest = max(solution.penetrations.values(), default=math.nan)
    edges = edge_forces(solution, 0.0)
    on_ridge = ~edges.is_floor
    fixed = [solution.contact_fraction * (last - first), last - first, deepest]
    fixed += [share @ times, share.max()]
    return np.concatenate([fixed, edges.x[on_ridge], edges.K[on_ridge]])


def _impossible_count(Q: int, profile: Profile) -> InputError:
    return InputError(
        f"offset: expected one at which {Q} ridges are touched under some load, got "
        f"{profile.offset!r} (over a ridge's centre counts are odd)"
    )
