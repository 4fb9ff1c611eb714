r"""Contacts on many single ridges, each under a smooth field and a given force.

A ridge has half-width w, and t = -1 ... 1 over it. The other contacts and the body's shape raise
the surface by :math:`\sum e_n T_n(t)`. The pressure of the ridge's contact acts elsewhere through
its moments, which are those of :math:`\sum A_n T_n(t)/(w \sqrt{1 - t^2})`, wherever it ends.
Pressures follow from the surface order by order (`intervals`), without solving equations.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from ridgebayes._types import FloatArray
from ridgebayes.contact.contact_set import end_steps
from ridgebayes.contact.rigid_profile import Kinks, falls


@dataclass(frozen=True, eq=False)
class RidgeContacts:
    """Contacts on n ridges.

    Parameters
    ----------
    field : ndarray of float, shape (m, n)
        Coefficients e_n, over R.
    force : ndarray of float, shape (n,)
        Forces over pi, A_0.
    ends : ndarray of float, shape (2, n)
        Extent of contact to the left and right of the centre, in half-widths, at most 1.
    radius : float
        Radius of the corners over the square of the half-width; 0 for sharp corners.
    flat : float
        Distance from the centre to the end of the flat top, in half-widths.
    """

    field: FloatArray
    force: FloatArray
    ends: FloatArray
    radius: float
    flat: float

    @cached_property
    def share(self) -> FloatArray:
        """Half-width of contact over that of the ridge, shape (n,)."""
        share: FloatArray = 0.5 * self.ends.sum(axis=0)
        return share

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray]:
        """Chebyshev polynomials of t, (m, m, n), and of s, (m, m), at the nodes of contacts."""
        m = len(self.field)
        angle = (np.arange(m) + 0.5) * (np.pi / m)
        t = 0.5 * (self.ends[1] - self.ends[0]) + self.share * np.cos(angle)[:, None]
        return np.moveaxis(chebvander(t, m - 1), -1, 0), np.cos(np.arange(m)[:, None] * angle)

    @cached_property
    def kinks(self) -> Kinks:
        """Ends of the flat tops within the contacts."""
        return self._surfaces[1]

    @cached_property
    def _surfaces(self) -> tuple[FloatArray, Kinks]:
        """Coefficients in T_n(s) of field and rigid surface without kinks, (m, n), and kinks."""
        of_t, of_s = self._places
        m = len(of_s)
        smooth = of_s @ np.einsum("nk,njk->jk", self.field, of_t) * (2.0 / m)
        smooth[0] *= 0.5
        radius = np.full(len(self.force), self.radius)
        height, kinks = falls(self.ends - self.flat, self.share, radius)
        smooth[:3] += height.T
        return smooth, kinks

    @cached_property
    def _regular(self) -> FloatArray:
        """Coefficients of the pressure without kinks, (m, n)."""
        smooth = self._surfaces[0]
        regular = smooth * (-np.arange(len(smooth)) / np.pi)[:, None]
        regular[0] = self.force
        return regular

    @cached_property
    def _series(self) -> FloatArray:
        """Coefficients in T_n(s) of the kinks of the rigid surface, (m, n)."""
        return self.kinks.series(len(self.field)).T

    @cached_property
    def moments(self) -> FloatArray:
        """Moments A_n, shape (m, n)."""
        of_t, of_s = self._places
        m = len(of_s)
        a = self._regular - (np.arange(m) / np.pi)[:, None] * self._series
        of_ridge: FloatArray = np.einsum("jk,njk->nk", of_s.T @ a, of_t) * (2.0 / m)
        of_ridge[0] = self.force
        return of_ridge

    @cached_property
    def by_force(self) -> FloatArray:
        """Derivatives of the moments by the force, shape (m, n), in a given field."""
        by_force: FloatArray = 2.0 * self._places[0].mean(axis=1)
        by_force[0] = 1.0
        return by_force

    @cached_property
    def level(self) -> FloatArray:
        """Mean height under each contact, (n,), with lengths in half-widths of a ridge."""
        by_force = np.pi * self.force * (np.log(2.0) - np.log(self.share))
        level: FloatArray = by_force + self._surfaces[0][0] + self._series[0]
        return level

    @cached_property
    def steps(self) -> FloatArray:
        """Newton steps of the ends outward, shape (2, n), limited by the size of the contact.

        Equations (5) to (9) of docs/derivations/contact.md.
        """
        order = np.arange(len(self.field))
        at_ends = np.stack([(-1.0) ** order, np.ones(len(order))])
        # Strengths of the edge singularities; tension is negative.
        strength = at_ends @ self._regular - self.kinks.at_ends() / np.pi
        slopes = (at_ends * order**2) @ self._regular - self.kinks.slopes() / np.pi
        width = 2 * self.share
        step = np.divide(-width * strength, slopes, out=np.zeros_like(slopes), where=slopes != 0.0)
        stuck = self.ends >= 1.0
        step = end_steps(strength, step, width, stuck)
        step = np.where(stuck & (strength >= 0), 0.0, step)
        return np.minimum(self.ends + step, 1.0) - self.ends

    @property
    def tail(self) -> FloatArray:
        """Last coefficient of the field's pressure over the mean pressure, (n,)."""
        m = len(self.field)
        tail: FloatArray = (m - 1) / np.pi * np.abs(self._surfaces[0][-1] / self.force)
        return tail

    @property
    def smallest_pressure(self) -> FloatArray:
        """Smallest pressure times sqrt(1 - s^2), over its mean, (n,)."""
        m = len(self.field)
        angle = np.linspace(0.0, np.pi, 2 * m + 1)
        waves = np.cos(np.arange(m) * angle[:, None])
        pressures = (waves @ self._regular).T - self.kinks.strengths(angle) / np.pi
        smallest: FloatArray = pressures.min(axis=1) / self.force
        return smallest
