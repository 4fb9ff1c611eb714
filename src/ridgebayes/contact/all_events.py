"""Loads that reach one ridge after another, all at once.

Ridges covered in full are a linear problem, with one factor for all events (`ridge_row`). The
changes by round corners and free ends follow by iteration, for all events together
(docs/derivations/contact.md).
"""

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebvander

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.contact.contact_set import SHRINK, TENSION
from ridgebayes.contact.contact_solution import (
    MOST_UNKNOWNS,
    bearing_half_width,
    coefficients_for,
    too_many,
)
from ridgebayes.contact.ridge_contacts import RidgeContacts
from ridgebayes.contact.ridge_row import RidgeRow, felt
from ridgebayes.contact.rigid_profile import Profile

_MOST_ROUNDS = 40
_HISTORY = 5  # rounds that the next round combines
_DEEP = 0.9  # of a groove's depth: deeper surfaces may touch the floor


@dataclass(frozen=True, eq=False)
class Events:
    """Events in rising order: the n-th touches n + 1 ridges, or pairs, and reaches the next.

    Parameters
    ----------
    W : ndarray of float, shape (n,)
        Loads.
    why : str
        Reason why the list ends; empty if it reaches the largest load or the largest number.
    """

    W: FloatArray
    why: str


def all_events(profile: Profile, *, W_max: float, n_max: int, rel_tol: float) -> Events:
    """Find the loads that reach further ridges, up to the first beyond a largest load.

    Parameters
    ----------
    profile : Profile
        The rigid side. Events end where a floor may be touched.
    W_max : float
        Largest load.
    n_max : int
        Most events.
    rel_tol : float
        Wanted relative error of each load.

    Returns
    -------
    Events
        Events up to the first that does not converge, or needs too many unknowns.

    Notes
    -----
    *Cost.* Five to fifteen rounds, each one convolution over the row and the contacts of all
    ridges and events.
    """
    compliance = -math.log(math.sin(0.5 * math.pi * profile.a / profile.pitch))
    n = math.sqrt(2 * W_max) / profile.pitch + 0.1 + 0.5 * compliance
    n = math.ceil(n if profile.mirrored else 2 * n) + 1
    bearing = W_max
    W, ok = np.empty(0), np.empty(0, dtype=bool)
    while True:
        half_width = bearing_half_width(profile, bearing)
        m = max(coefficients_for(profile, rel_tol, half_width), 3)
        most = MOST_UNKNOWNS // m
        if most < max(len(W), 1):
            why = too_many(profile, (len(W) + 1) * m).status
            break
        n = min(n, most, n_max)
        try:
            row = RidgeRow.of(profile, n, m, half_width)
        except np.linalg.LinAlgError as error:
            why = f"not computed: {error}"
            break
        rounds = _Rounds(row, rel_tol)
        W, ok = rounds.events()
        ok &= np.diff(W, prepend=0.0) > 0
        if rounds.cut_off:
            bearing *= 4
        elif n == n_max or not ok[-1] or W[-1] > W_max:
            why = ""
            break
        elif n == most:
            why = too_many(profile, (n + 1) * m).status
            break
        else:
            n += 2 + n // 8
    if not ok.all():
        why = "not converged: the load that reaches a ridge"
    return Events(W[: int(np.argmin(np.append(ok, False)))], why)


class _Rounds:
    """All events of a row on their way to their loads."""

    def __init__(self, row: RidgeRow, rel_tol: float) -> None:
        self._row, self._tol, n = row, rel_tol, row.n
        self._W, self._ok = np.full(n, np.nan), np.zeros(n, dtype=bool)
        self._events, self._left = np.arange(n), np.ones(n, dtype=bool)
        self._ends = np.ones((2, n, n))  # of contact, by ridge and event
        self._nearest = np.full(n, -1.0)  # place over the ridge ahead: t of its corner
        self._mixing = _Mixing()
        w, corner, half = row.half_width, row.profile.corner, 0.5 * row.profile.a
        self._radius, self._flat = corner / w**2, (half - corner) / w
        # Whether contact would go further than it may here, and further on a ridge it could.
        self.cut_off, self._cut = False, w < half
        self._moments = self._begin()

    def _begin(self) -> FloatArray:
        """Return moments of sharp ridges covered in full; none of them pulls."""
        row = self._row
        moments, self._by_approach, _ = row.covered_in_full()
        smooth = 0.5 * (np.abs(row.centre[self._events + 1]) - row.half_width) ** 2
        least = SHRINK * row.within * smooth / (math.pi * row.weight.sum())
        moments[:, 0] = np.maximum(moments[:, 0], least)
        return moments

    def events(self) -> tuple[FloatArray, BoolArray]:
        """Return the load of each event, and whether all conditions hold there."""
        for _ in range(_MOST_ROUNDS):
            self._round()
            if not self._left.any():
                break
        return self._W, self._ok

    def _round(self) -> None:
        """Move all events once; those that arrive are noted."""
        row = self._row
        event, ridge = np.nonzero((row.within & self._left).T)  # others stay as they are
        field = row.fields(self._moments)
        self._nearest, fallen = self._over(field, 1)
        x = row.places(self._nearest, self._events + 1)
        potentials = row.potentials(x)
        approach = 0.5 * x**2 + fallen + felt(potentials, self._moments)
        here = field.transpose(1, 0, 2)[:, ridge, event] + row.shape.T[:, ridge]
        force = self._moments[ridge, 0, event]
        contacts = RidgeContacts(here, force, self._ends[:, ridge, event], self._radius, self._flat)
        self._ends[:, ridge, event] = contacts.ends + contacts.steps
        residual = np.zeros_like(self._moments)
        residual[ridge, 0, event] = math.pi * (contacts.level + row.shift * force - approach[event])
        apart = self._moments[ridge, 1:, event] - contacts.moments[1:].T
        residual[ridge, 1:, event] = row.energies[1:] * apart
        change = -row.covered(residual)
        # By the approach at which the surface at the ridge ahead is as high as its corner.
        lift = 1 - felt(potentials, self._by_approach)
        change += self._by_approach * felt(potentials, change) / lift
        beyond = contacts.ends - self._flat  # beyond a kink pressure falls to zero within it
        scale = np.where(beyond > 0, np.minimum(beyond, contacts.share), contacts.share)
        moving = (np.abs(contacts.steps) > 0.3 * TENSION * math.sqrt(self._tol) * scale).any(axis=0)
        load = row.load(self._moments)
        arrived = self._left & (np.abs(row.load(change)) <= 0.1 * self._tol * load)
        # A load may stand still by chance, so its shares are checked as well.
        arrived &= row.load(np.abs(change)) <= self._tol * load
        arrived &= np.bincount(event, moving, minlength=row.n) == 0
        if arrived.any():
            self._W[arrived] = row.load(self._moments + change)[arrived]
            holds = self._holds(contacts, event, arrived) & self._free(field, approach)
            self._ok[arrived] = holds[arrived]
            self._left &= ~arrived
        self._moments = self._mixing.mixed(self._moments, change)

    def _over(self, field: FloatArray, ahead: int) -> tuple[FloatArray, FloatArray]:
        """Return where surfaces are nearest to ridges ahead, and how deep these are there."""
        row, ridges = self._row, self._events + ahead
        seen = field[ridges, :, np.arange(len(ridges))] + row.shape[ridges]
        return _nearest(row.outward(seen, ridges), self._nearest, self._radius, self._flat)

    def _holds(self, contacts: RidgeContacts, event: IntArray, arrived: BoolArray) -> BoolArray:
        """Return whether pressures of arrived events are resolved, and none is a tension."""
        n, least = len(arrived), -max(TENSION * math.sqrt(self._tol), 1e-6)
        holds = (contacts.tail**2 <= self._tol) & (contacts.smallest_pressure >= least)
        sound: BoolArray = np.bincount(event, ~holds, minlength=n) == 0
        if self._cut:
            inside = np.bincount(event, (contacts.ends >= 1.0).any(axis=0), minlength=n) == 0
            inside &= self._nearest > -1.0
            self.cut_off |= bool((arrived & ~inside).any())
            sound &= inside
        return sound

    def _free(self, field: FloatArray, approach: FloatArray) -> BoolArray:
        """Return whether nothing else is touched, for each live event, (n_live,)."""
        profile, free = self._row.profile, np.ones(self._row.n, dtype=bool)
        if not profile.mirrored:
            t, fallen = self._over(field, 2)
            x = self._row.places(t, self._events + 2)
            up = felt(self._row.potentials(x), self._moments)
            free &= 0.5 * x**2 + fallen + up >= approach
        if math.isfinite(profile.depth):
            free &= self._row.hanging(self._moments, approach) < _DEEP * profile.depth
        return free


@functools.cache
def _derivative(m: int) -> FloatArray:
    """Return the matrix from m Chebyshev coefficients to those of the derivative, (m, m - 1)."""
    matrix = chebder(np.eye(m), axis=1)
    return np.asarray(matrix, dtype=np.float64)


def _nearest(
    seen: FloatArray, t: FloatArray, radius: float, flat: float
) -> tuple[FloatArray, FloatArray]:
    """Return where surfaces are nearest to ridges ahead, (n,), and how deep these are there.

    A surface rises away from the centre, so that it is nearest over the corner: from t nearby on.
    """
    if radius > 0:
        m = seen.shape[1]
        slope: FloatArray = seen @ _derivative(m)
        bend: FloatArray = slope @ _derivative(m - 1)
        for _ in range(2):
            waves = chebvander(t, m - 1)
            rise = (slope * waves[:, :-1]).sum(axis=1) - np.maximum(-flat - t, 0.0) / radius
            # The corner's curvature alone where the surface's is negative.
            by = np.maximum((bend * waves[:, :-2]).sum(axis=1), 0.0) + 1 / radius
            t = np.clip(t - rise / by, -1.0, -flat)
    return t, np.maximum(-flat - t, 0.0) ** 2 / (2 * radius) if radius > 0 else np.zeros_like(t)


class _Mixing:
    """Anderson's method: combine the last rounds so that the next change is least."""

    def __init__(self) -> None:
        self._last: tuple[FloatArray, FloatArray] | None = None
        self._moved: list[FloatArray] = []
        self._changed: list[FloatArray] = []

    def mixed(self, at: FloatArray, change: FloatArray) -> FloatArray:
        """Return the next moments, each event by itself, (n, m, n_event)."""
        if self._last is not None:
            self._moved = [*self._moved, at - self._last[0]][-_HISTORY:]
            self._changed = [*self._changed, change - self._last[1]][-_HISTORY:]
        self._last = at, change
        moments = at + change
        if self._moved:
            changed = np.stack(self._changed)
            gram = np.einsum("anmk,bnmk->kab", changed, changed)
            along = np.einsum("anmk,nmk->ka", changed, change)
            least = 1e-13 * np.trace(gram, axis1=1, axis2=2) + 1e-300
            gram += least[:, None, None] * np.eye(len(changed))
            share = np.linalg.solve(gram, along[..., None])[..., 0]
            moments -= np.einsum("anmk,ka->nmk", np.stack(self._moved) + changed, share)
        moments[:, 0] = np.maximum(moments[:, 0], SHRINK * at[:, 0])
        return moments
