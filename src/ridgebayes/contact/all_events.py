"""Loads of all events of a profile, computed together.

Fully covered ridges are a linear problem with one Cholesky factor for all events (`ridge_row`). The
effects of round corners and free ends follow by iteration over all events at the same time
(docs/derivations/contact.md).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebvander

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.contact.contact_set import N_PLACES, SHRINK, TENSION
from ridgebayes.contact.contact_solution import (
    MAX_ITERATIONS,
    MOST_UNKNOWNS,
    bearing_half_width,
    coefficients_for,
    too_many,
)
from ridgebayes.contact.ridge_contacts import RidgeContacts
from ridgebayes.contact.ridge_row import RidgeRow, total_potential
from ridgebayes.contact.rigid_profile import Profile


@dataclass(frozen=True, eq=False)
class Events:
    """Events in rising order.

    Parameters
    ----------
    W : ndarray of float, shape (n,)
        Loads. At event n (from 0), n + 1 ridges or pairs are in contact, and the next is reached.
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
        Rigid profile. Events end at the load at which a floor may be touched.
    W_max : float
        Largest load.
    n_max : int
        Largest number of events.
    rel_tol : float
        Required relative error of each load.

    Returns
    -------
    Events
        Events up to the first that does not converge, or needs too many unknowns.

    Notes
    -----
    *Cost.* Five to fifteen rounds. Each round has one convolution over the row, and the contacts of
    all ridges and events.
    """
    compliance = -math.log(math.sin(0.5 * math.pi * profile.a / profile.pitch))
    # First guess of the number of ridges or pairs, from the half-width under a smooth body.
    n = math.sqrt(2 * W_max) / profile.pitch + 0.1 + 0.5 * compliance
    n = math.ceil(n if profile.mirrored else 2 * n) + 1
    row_load = W_max  # sets the half-width of contact that the row can describe
    W, ok = np.empty(0), np.empty(0, dtype=bool)
    while True:
        half_width = bearing_half_width(profile, row_load)
        m = max(coefficients_for(profile, rel_tol, half_width), 3)
        most_events = MOST_UNKNOWNS // m
        if most_events < max(len(W), 1):
            why = too_many(profile, (len(W) + 1) * m).status
            break
        n = min(n, most_events, n_max)
        try:
            row = RidgeRow.of(profile, n, m, half_width)
        except np.linalg.LinAlgError as error:
            why = f"not computed: {error}"
            break
        rounds = _Rounds(row, rel_tol)
        W, ok = rounds.events()
        ok &= np.diff(W, prepend=0.0) > 0
        if rounds.cut_off:
            row_load *= 4
        elif n == n_max or not ok[-1] or W[-1] > W_max:
            why = ""
            break
        elif n == most_events:
            why = too_many(profile, (n + 1) * m).status
            break
        else:
            n += 2 + n // 8
    if not ok.all():
        why = "not converged: the load that reaches a ridge"
    return Events(W[: int(np.argmin(np.append(ok, False)))], why)


class _Rounds:
    """Iteration for the loads of all events of a row."""

    def __init__(self, row: RidgeRow, rel_tol: float) -> None:
        self._row, self._tol, n = row, rel_tol, row.n
        self._W, self._ok = np.full(n, np.nan), np.zeros(n, dtype=bool)
        self._events, self._active = np.arange(n), np.ones(n, dtype=bool)
        self._ends = np.ones((2, n, n))  # ends of contact, by ridge and event
        self._nearest = np.full(n, -1.0)  # t of the nearest point on the ridge ahead
        w, corner, half = row.half_width, row.profile.corner, 0.5 * row.profile.a
        # On a ridge x = w t: x^2/(2 corner) = t^2/(2 radius), and the flat top ends at t = flat.
        self._radius, self._flat = corner / w**2, (half - corner) / w
        # Whether contact exceeds the half-width of the row, and whether ridges are wider than it.
        self.cut_off, self._cut = False, w < half
        self._moments = self._begin()
        self._last: tuple[FloatArray, FloatArray] | None = None  # moments and their change

    def _begin(self) -> FloatArray:
        """Return moments of fully covered sharp ridges; forces are kept above 0."""
        row = self._row
        moments, self._by_approach, _ = row.events_of_covered()
        smooth = 0.5 * (np.abs(row.centre[self._events + 1]) - row.half_width) ** 2
        least = SHRINK * row.within * smooth / (math.pi * row.weight.sum())
        moments[:, 0] = np.maximum(moments[:, 0], least)
        return moments

    def events(self) -> tuple[FloatArray, BoolArray]:
        """Return the load of each event, and whether all conditions hold at this load."""
        for _ in range(MAX_ITERATIONS):  # usually five to fifteen suffice
            self._round()
            if not self._active.any():
                break
        return self._W, self._ok

    def _round(self) -> None:
        """Update all events once, and record converged events."""
        row = self._row
        event, ridge = np.nonzero((row.within & self._active).T)  # converged events are not updated
        field = row.fields(self._moments)
        self._nearest, fall = self._nearest_on(field, 1)
        x = row.places(self._nearest, self._events + 1)
        potentials = row.potentials(x)
        approach = 0.5 * x**2 + fall + total_potential(potentials, self._moments)
        here = field.transpose(1, 0, 2)[:, ridge, event] + row.shape.T[:, ridge]
        force = self._moments[ridge, 0, event]
        contacts = RidgeContacts(here, force, self._ends[:, ridge, event], self._radius, self._flat)
        self._ends[:, ridge, event] = contacts.ends + contacts.steps
        residual = np.zeros_like(self._moments)
        residual[ridge, 0, event] = math.pi * (contacts.level + row.shift * force - approach[event])
        mismatch = self._moments[ridge, 1:, event] - contacts.moments[1:].T
        residual[ridge, 1:, event] = row.energies[1:] * mismatch
        change = self._newton(residual, contacts, potentials)
        beyond = contacts.ends - self._flat  # beyond a kink, pressure falls to 0 over this length
        scale = np.where(beyond > 0, np.minimum(beyond, contacts.share), contacts.share)
        moving = (np.abs(contacts.steps) > 0.3 * TENSION * math.sqrt(self._tol) * scale).any(axis=0)
        load = row.load(self._moments)
        converged = self._active & (np.abs(row.load(change)) <= 0.1 * self._tol * load)
        # Changes of single forces may cancel, so their sizes are checked as well.
        converged &= row.load(np.abs(change)) <= self._tol * load
        converged &= np.bincount(event, moving, minlength=row.n) == 0
        if converged.any():
            self._W[converged] = row.load(self._moments + change)[converged]
            holds = self._valid(contacts, event, converged) & self._free(field, approach)
            self._ok[converged] = holds[converged]
            self._active &= ~converged
        self._moments = self._mixed(change)

    def _newton(
        self, residual: FloatArray, contacts: RidgeContacts, potentials: FloatArray
    ) -> FloatArray:
        """Return the change of moments that removes the residual, (n, m, n_event).

        The matrix is that of fully covered ridges. A small contact on the ridge touched last is
        stiffer, and its force moves its other moments: one column of the matrix of each event.
        """
        row = self._row
        event, ridge = np.nonzero((row.within & self._active).T)
        last = event == ridge
        column = np.zeros_like(residual)
        column[ridge[last], :, event[last]] = -row.energies * contacts.by_force[:, last].T
        column[ridge[last], 0, event[last]] = -(math.pi**2) * np.log(contacts.share[last])
        column, force = row.solve(column), (self._events, 0, self._events)
        softer = column / (1 + column[force])
        by_approach = self._by_approach - softer * self._by_approach[force]
        change: FloatArray = -row.solve(residual)
        change -= softer * change[force]
        # The change of the approach keeps the surface in touch with the ridge ahead.
        lift = 1 - total_potential(potentials, by_approach)
        change += by_approach * total_potential(potentials, change) / lift
        return change

    def _mixed(self, change: FloatArray) -> FloatArray:
        """Return the next moments: a secant step through the last two rounds of each event."""
        at = self._moments
        moments: FloatArray = at + change
        if self._last is not None:
            moved, changed = at - self._last[0], change - self._last[1]
            size, along = (changed**2).sum(axis=(0, 1)), (changed * change).sum(axis=(0, 1))
            share = np.divide(along, size, out=np.zeros_like(size), where=size > 0)
            moments -= share * (moved + changed)
        self._last = at, change
        moments[:, 0] = np.maximum(moments[:, 0], SHRINK * at[:, 0])
        return moments

    def _nearest_on(self, field: FloatArray, ahead: int) -> tuple[FloatArray, FloatArray]:
        """Return the nearest points of surfaces on ridges ahead, and the falls of ridges there."""
        row, ridges = self._row, self._events + ahead
        surface = field[ridges, :, np.arange(len(ridges))] + row.shape[ridges]
        return _nearest(row.outward(surface, ridges), self._nearest, self._radius, self._flat)

    def _valid(self, contacts: RidgeContacts, event: IntArray, converged: BoolArray) -> BoolArray:
        """Return whether the pressures of converged events are resolved and not negative."""
        n, least = len(converged), -max(TENSION * math.sqrt(self._tol), 1e-6)
        holds = (contacts.tail**2 <= self._tol) & (contacts.smallest_pressure >= least)
        sound: BoolArray = np.bincount(event, ~holds, minlength=n) == 0
        if self._cut:
            inside = np.bincount(event, (contacts.ends >= 1.0).any(axis=0), minlength=n) == 0
            inside &= self._nearest > -1.0
            self.cut_off |= bool((converged & ~inside).any())
            sound &= inside
        return sound

    def _free(self, field: FloatArray, approach: FloatArray) -> BoolArray:
        """Return whether no other ridge or floor is touched, for each event, (n_event,)."""
        profile, free = self._row.profile, np.ones(self._row.n, dtype=bool)
        if not profile.mirrored:
            t, fall = self._nearest_on(field, 2)
            x = self._row.places(t, self._events + 2)
            up = total_potential(self._row.potentials(x), self._moments)
            free &= 0.5 * x**2 + fall + up >= approach
        if math.isfinite(profile.depth):
            # Penetration is concave, so places miss at most the share of a spacing in its maximum.
            most = (1 - 1 / (N_PLACES - 1)) * profile.depth
            free &= self._row.depth(self._moments, approach) < most
        return free


def _nearest(
    surface: FloatArray, t: FloatArray, radius: float, flat: float
) -> tuple[FloatArray, FloatArray]:
    """Return the nearest points of surfaces on ridges ahead, and the falls of ridges there, (n,).

    The gap of a surface grows away from the centre, so the nearest point is on the inner corner.
    Newton's method starts from the previous points t.
    """
    if radius > 0:
        m = surface.shape[1]
        slope = chebder(surface, axis=1)
        bend = chebder(slope, axis=1)
        for _ in range(2):
            waves = chebvander(t, m - 1)
            rise = (slope * waves[:, :-1]).sum(axis=1) - np.maximum(-flat - t, 0.0) / radius
            # A negative curvature of the surface is ignored.
            curvature = np.maximum((bend * waves[:, :-2]).sum(axis=1), 0.0) + 1 / radius
            t = np.clip(t - rise / curvature, -1.0, -flat)
    return t, np.maximum(-flat - t, 0.0) ** 2 / (2 * radius) if radius > 0 else np.zeros_like(t)
