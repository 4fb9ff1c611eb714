"""What many bodies do under many loads, interpolated between contacts that were solved.

Contact of sharp ridges without floors is a function of W/pitch^2, groove over ridge, and the offset
in pitches (the scale law). Loads of one count make an interval, whose ends are the loads that reach
this count and the next. Within it quantities are smooth but where a free end reaches its corner, or
the flat of a round one. Each piece between such loads is a polynomial in the root of its own
coordinate, since a contact that begins grows like one.
"""

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.axes import Axis, Spread
from ridgebayes.contact.contact_solution import ContactSolution, solve_contact
from ridgebayes.contact.edges import edge_forces
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import ComputationError, InputError

_TOL = 1e-8
_N_PIECE, _N_SCAN, _N_BISECTION = 8, 7, 16
# Of an interval, and of a load: at its very ends a contact is only rounding.
_INSIDE, _BEGUN = 1e-5, 5e-6
CLOSEST = 1e-4  # of an interval, by which loads stay away from its ends
_CLOSEST_BETWEEN = 0.01  # where ends are interpolated between offsets
_FROM = 1e-4  # of the load of the first change of the count: where the table begins
MOST_DISTINCT, _MOST_NODES = 32, 400
_LAST_OFFSET = 0.499
_TRIES = 5  # each four times as far from an interval's end
# Columns of `shapes_of`.
_OVER_RIDGE, _OVER_RADIUS = [0, 1, 2, 3, 4], [5, 1, 2, 6, 4]
_N_SMOOTH, _N_OFFSET = 9, 17  # nodes along an axis
_FIXED = 5  # quantities before those of edges: see `ContactValues`


@dataclass(frozen=True, eq=False)
class ContactValues:
    """Contacts of n bodies, each with one count Q; lengths over R.

    Parameters
    ----------
    W : ndarray of float, shape (n,)
        The load nearest to the wanted one at which the mechanics counts Q.
    length : ndarray of float, shape (n,)
        Sum of touching widths.
    extent : ndarray of float, shape (n,)
        Between the outermost ends of contact.
    penetration : ndarray of float, shape (n,)
        Deepest, into any groove; NaN where one ridge alone is touched.
    share, largest_share : ndarray of float, shape (n,)
        Of the load on all ridges (less than 1 where floors are touched), and on one.
    x, K : ndarray of float, shape (n, 2 Q)
        Edges from left to right, as `edges.EdgeForces`; K at nu = 0.
    """

    W: FloatArray
    length: FloatArray
    extent: FloatArray
    penetration: FloatArray
    share: FloatArray
    largest_share: FloatArray
    x: FloatArray
    K: FloatArray


class ResponseTable:
    """Contacts of many bodies.

    Parameters
    ----------
    seen : Spread
        Of `shapes_of` all of them, that keeps `MOST_DISTINCT`.

    Raises
    ------
    InputError
        If so many of them vary that a table would take more than 400 shapes.

    Notes
    -----
    *Accuracy.* Measured by whoever asks, with `solved`.

    *Cost.* Some 0.1 s for each shape and count: up to 32 distinct shapes are solved each, more
    are interpolated from 9 ratios of groove to ridge, or 17 offsets, or both.
    """

    def __init__(self, seen: Spread) -> None:
        self._seen, self._margin, distinct = seen, CLOSEST, seen.distinct
        self._columns = _OVER_RIDGE
        self._axes: list[Axis] = []
        if distinct is None:
            found = [(columns, _axes(seen, columns)) for columns in (_OVER_RIDGE, _OVER_RADIUS)]
            self._columns, self._axes = min(found, key=lambda one: math.prod(x.n for x in one[1]))
            if math.prod(axis.n for axis in self._axes) > _MOST_NODES:
                raise InputError(
                    "scene: too many values vary at once; expected certain widths and radius where "
                    "corners are round or floors are touched"
                )
            if self._axes[1].n > 1:
                self._margin = _CLOSEST_BETWEEN
            mesh = np.meshgrid(*(axis.nodes for axis in self._axes), indexing="ij")
            rows = np.stack([one.ravel() for one in mesh], axis=1)
        else:
            rows = distinct[:, self._columns]
        over_ridge = self._columns == _OVER_RIDGE
        self._shapes = [_Shape(_profile(row, over_ridge=over_ridge)) for row in rows]

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
        """Return the contacts of some bodies that all have the count Q, at loads near W.

        Parameters
        ----------
        profiles : ndarray of float, shape (n, 5)
            a, b, depth, corner and offset of each, as of `Profile`.
        Q : int
            Even count.
        W : ndarray of float, shape (n,)
            Loads wanted.

        Raises
        ------
        InputError
            If a body never touches Q ridges: over a ridge's centre counts are odd.
        ComputationError
            If a contact cannot be solved.
        """
        weights, unit = self._weights(shapes_of(profiles)), _units(profiles)
        used = np.flatnonzero((weights != 0).any(axis=0))
        weights, shapes = weights[:, used], [self._shapes[i] for i in used]
        ends = np.array([np.log(one.interval(Q)) for one in shapes])
        low, high = (weights @ ends).T
        wanted = np.log(W / unit**2)
        y = (wanted - low) / (high - low)
        kept = np.clip(y, -np.inf if Q == 2 else self._margin, 1 - self._margin)
        near = np.where(kept == y, W, np.exp(low + kept * (high - low)) * unit**2)
        breaks = [one.pieces(Q)[0] for one in shapes]
        alike = len({len(one) for one in breaks}) == 1
        own = weights @ np.array(breaks) if alike else None
        values = np.zeros((len(profiles), _FIXED + 4 * Q))
        for i, one in enumerate(shapes):
            values += weights[:, i, None] * one.values(Q, np.clip(kept, 0.0, 1.0), own)
        x, K = np.split(values[:, _FIXED:], 2, axis=1)
        mirrored = (profiles[:, 4] < 0)[:, None]
        x, K = np.where(mirrored, -x[:, ::-1], x), np.where(mirrored, K[:, ::-1], K)
        length, extent, penetration, share, largest = values[:, :_FIXED].T
        lengths = (length * unit, extent * unit, penetration * unit**2)
        edges = (x * unit[:, None], K * unit[:, None] ** 1.5)
        return ContactValues(near, *lengths, share, largest, *edges)


def solved(profile: FloatArray, Q: int, W: float) -> ContactValues:
    """Return the contact of one body solved on its own, as `ResponseTable.at` returns it."""
    found = solve_contact(Profile(*profile.tolist()), W, rel_tol=_TOL)
    values = _measured(found, Q)
    length, extent, penetration, share, largest = values[:_FIXED, None]
    x, K = np.split(values[None, _FIXED:], 2, axis=1)
    return ContactValues(np.array([W]), length, extent, penetration, share, largest, x, K)


def shapes_of(profiles: FloatArray) -> FloatArray:
    """Return what contacts of profiles (n, 5), as of `ResponseTable.at`, depend on, (n, 7).

    Logs of groove, depth, corner and ridge, and the offset. With sharp corners only the groove over
    the ridge, and the depth over the pitch's square, matter. With round ones a groove is taken with
    both its corners: contacts do not change where it closes. Groove and corner are there twice,
    over the ridge and over R: with some lengths certain, fewer of the one or the other vary.
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
    """Return axes over some columns of `shapes_of`, the second of them that of the offset."""
    ranges = list(zip(seen.low[columns], seen.high[columns], strict=True))
    axes = [Axis.over(*ends, _N_SMOOTH) for ends in ranges]
    # Which end is free changes with the offset: no polynomial would do.
    near, far = (min(end, _LAST_OFFSET) for end in ranges[1])
    axes[1] = Axis.over(near, far, _N_OFFSET, is_smooth=False)
    return axes


def _profile(at: FloatArray, *, over_ridge: bool) -> Profile:
    """Return the profile of a shape; of a sharp one that with a pitch of 1."""
    groove, offset, depth, corner, ridge = at.tolist()
    if corner == -math.inf:
        a = 1 / (1 + math.exp(groove))
        return Profile(a, 1 - a, math.exp(depth), 0.0, offset)
    a = math.exp(ridge)
    scale = a if over_ridge else 1.0
    radius = min(scale * math.exp(corner), 0.5 * a)
    b = scale * math.exp(groove) - 2 * radius
    if not b > 0:
        raise InputError(
            "scene: too many values vary at once; expected a certain corner_radius where grooves "
            "may close"
        )
    return Profile(a, b, math.exp(depth), radius, offset)


class _Shape:
    """One profile: its loads of each count, and the polynomials between them."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._events: tuple[FloatArray, IntArray] = np.empty(0), np.empty(0, dtype=np.int64)
        self._kept: dict[int, tuple[FloatArray, list[FloatArray]]] = {}

    def interval(self, Q: int) -> tuple[float, float]:
        """Return the loads between which the count is Q."""
        W, counts = self._events
        while not len(counts) or counts[-1] <= Q:
            top = max(4 * W[-1] if len(W) else 0.0, 0.5 * ((Q / 2 + 2) * self._profile.pitch) ** 2)
            found = reaching_loads(self._profile, W_max=top, rel_tol=_TOL)
            failed = [text for text in found.status if text != "ok"]
            if failed:
                raise ComputationError(f"contact of Q = {Q}: {failed[0]}")
            W, counts = self._events = found.W, found.Q
        i = int(np.searchsorted(counts, Q, side="right"))
        if i == 0:
            if counts[0] - 1 < Q or self._first != Q:
                raise _never(Q, self._profile)
            return float(W[0]) * _FROM, float(W[0])
        if counts[i - 1] != Q:
            raise _never(Q, self._profile)
        return float(W[i - 1]), float(W[i])

    @cached_property
    def _first(self) -> int:
        return solve_contact(self._profile, float(self._events[0][0]) * _FROM, rel_tol=_TOL).Q

    def pieces(self, Q: int) -> tuple[FloatArray, list[FloatArray]]:
        """Return where pieces end in 0 to 1, both ends included, and polynomials on each."""
        if Q not in self._kept:
            breaks = self._breaks(Q)
            parts = [self._fitted(Q, low, high) for low, high in itertools.pairwise(breaks)]
            self._kept[Q] = np.array(breaks), parts
        return self._kept[Q]

    def values(self, Q: int, y: FloatArray, breaks: FloatArray | None) -> FloatArray:
        """Return what `_measured` does at places y; pieces end at own `breaks` (n, n_break)."""
        own, parts = self.pieces(Q)
        ends = np.broadcast_to(own, (len(y), len(own))) if breaks is None else breaks
        piece = np.clip((y[:, None] >= ends).sum(axis=1) - 1, 0, len(parts) - 1)
        rows = np.arange(len(y))
        low, high = ends[rows, piece], ends[rows, piece + 1]
        root = np.sqrt(np.clip((y - low) / (high - low), 0.0, 1.0))
        found = np.empty((len(y), _FIXED + 4 * Q))
        for i, part in enumerate(parts):
            here = piece == i
            found[here] = chebyshev.chebval(2 * root[here] - 1, part).T
        return found

    def _solve(
        self, Q: int, y: float, start: ContactSolution | None = None
    ) -> tuple[float, ContactSolution]:
        """Return the contact at a place y, and the place: farther inside if it has to be."""
        low, high = self.interval(Q)
        inside, place = min(max(_INSIDE, _BEGUN / math.log(high / low)), 0.25), y
        for _ in range(_TRIES):
            W = low * (high / low) ** min(max(place, inside), 1 - inside)
            found = solve_contact(self._profile, W, rel_tol=_TOL, start=start)
            if start is not None and found.status != "ok":  # it may lead round in circles
                found = solve_contact(self._profile, W, rel_tol=_TOL)
            inside *= 4
            further = min(max(y, inside), 1 - inside)
            if (found.status == "ok" and found.Q == Q) or further == y or inside >= 0.25:
                break
            place = further
        return place, found

    def _breaks(self, Q: int) -> list[float]:
        """Return 0, where an end reaches its corner or the flat of a round one, and 1."""
        grid = np.linspace(0.0, 1.0, _N_SCAN).tolist()
        solved = [self._solve(Q, y)[1] for y in grid]
        breaks = [0.0]
        for low, high, first, last in zip(grid, grid[1:], solved, solved[1:], strict=False):
            if _free_ends(first) == _free_ends(last):
                continue
            for _ in range(_N_BISECTION):
                middle = 0.5 * (low + high)
                _, between = self._solve(Q, middle, first)
                if _free_ends(between) == _free_ends(first):
                    low, first = middle, between
                else:
                    high = middle
            breaks.append(0.5 * (low + high))
        bottom, top = self.interval(Q)
        decades = round(math.log10(top / bottom))  # below the first change of the count
        breaks += [i / decades for i in range(1, decades)]
        return sorted([*breaks, 1.0])

    def _fitted(self, Q: int, low: float, high: float) -> FloatArray:
        """Return Chebyshev coefficients of what `_measured` returns, (n_piece, 5 + 4 Q)."""
        t, values, last = chebyshev.chebpts2(_N_PIECE), [], None
        for i, root in enumerate((0.5 * (t + 1)).tolist()):
            y = low + root**2 * (high - low)
            place, last = self._solve(Q, y, last)
            values.append(_measured(last, Q))
            if place != y:
                t[i] = 2 * math.sqrt((place - low) / (high - low)) - 1
        matrix = chebyshev.chebvander(t, _N_PIECE - 1)
        return np.asarray(np.linalg.solve(matrix, np.array(values)), dtype=np.float64)


def _free_ends(found: ContactSolution) -> tuple[bool, ...]:
    """Return of each end whether it lies on its segment's flat part."""
    flats = ((segment.flat, ends) for segment, ends in found.covered.items())
    return tuple(x for flat, (a, b) in flats for x in (a > flat[0], b < flat[1]))


def _measured(found: ContactSolution, Q: int) -> FloatArray:
    """Return what `ContactValues` has from its length on, as one array, shape (5 + 4 Q,)."""
    if found.status != "ok" or found.Q != Q:
        one = found.profile
        raise ComputationError(
            f"scene: groove_width {one.b / one.a:.3g}, corner_radius {one.corner / one.a:.3g} of "
            f"ridge_width, offset {one.offset:.3g}: expected a contact that can be solved, got "
            f"Q = {found.Q} for {Q}, {found.status}; a truncated distribution keeps to values "
            "whose contact can be"
        )
    first, last = found.ends
    on_ridges = np.array([segment.ridge is not None for segment in found.segments])
    share = (found.pressing.forces / found.pressing.load)[on_ridges]
    times = found.pressing.intervals.weight[on_ridges]
    deepest = max(found.penetrations.values(), default=math.nan)
    edges = edge_forces(found, 0.0)
    kept = ~edges.is_floor
    fixed = [found.contact_fraction * (last - first), last - first, deepest]
    fixed += [share @ times, share.max()]
    return np.concatenate([fixed, edges.x[kept], edges.K[kept]])


def _never(Q: int, profile: Profile) -> InputError:
    return InputError(
        f"offset: expected one at which {Q} ridges are touched under some load, got "
        f"{profile.offset!r} (over a ridge's centre counts are odd)"
    )
