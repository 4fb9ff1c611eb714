r"""Contacts on single ridges, many at once: each under a smooth field and a given force.

On a ridge of half-width w, with t = -1 ... 1 over it, what all other contacts and the body's shape
raise there is :math:`\sum e_n T_n(t)`. The pressure of the ridge's own contact is felt elsewhere
through its moments, those of :math:`\sum A_n T_n(t)/(w \sqrt{1 - t^2})`, wherever it ends. Inside
an interval pressures follow from the surface order by order (`intervals`): nothing is solved.
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
        e_n, over R.
    force : ndarray of float, shape (n,)
        Over pi: A_0.
    ends : ndarray of float, shape (2, n)
        How far contact goes to the left and right of the middle, in half-widths, at most 1.
    radius : float
        Radius of the corners, over the square of the half-width; 0 is sharp.
    flat : float
        Where the flat ends, in half-widths.
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
        """Chebyshev polynomials of t, shape (m, m, n), and of s, (m, m), at a contact's points."""
        m = len(self.field)
        angle = (np.arange(m) + 0.5) * (np.pi / m)
        t = 0.5 * (self.ends[1] - self.ends[0]) + self.share * np.cos(angle)[:, None]
        return np.moveaxis(chebvander(t, m - 1), -1, 0), np.cos(np.arange(m)[:, None] * angle)

    @cached_property
    def kinks(self) -> Kinks:
        """Where the flats end, within the contacts."""
        return self._surfaces[1]

    @cached_property
    def _surfaces(self) -> tuple[FloatArray, Kinks]:
        """Coefficients by T_n(s) of field and rigid surface, without kinks, (m, n); and these."""
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
        """Coefficients of the pressure without those of kinks, (m, n)."""
        smooth = self._surfaces[0]
        regular = smooth * (-np.arange(len(smooth)) / np.pi)[:, None]
        regular[0] = self.force
        return regular

    @cached_property
    def _series(self) -> FloatArray:
        """Coefficients by T_n(s) of the rigid surface beyond kinks, (m, n)."""
        return self.kinks.series(len(self.field)).T

    @cached_property
    def moments(self) -> FloatArray:
        """A_n, shape (m, n)."""
        of_t, of_s = self._places
        m = len(of_s)
        a = self._regular - (np.arange(m) / np.pi)[:, None] * self._series
        of_ridge: FloatArray = np.einsum("jk,njk->nk", of_s.T @ a, of_t) * (2.0 / m)
        of_ridge[0] = self.force
        return of_ridge

    @cached_property
    def level(self) -> FloatArray:
        """Mean height under the contact, lengths in half-widths of a ridge; the same for all."""
        by_force = np.pi * self.force * (np.log(2.0) - np.log(self.share))
        level: FloatArray = by_force + self._surfaces[0][0] + self._series[0]
        return level

    @cached_property
    def steps(self) -> FloatArray:
        """Return how far ends move outward, shape (2, n): Newton's step, kept to a contact's size.

        Equations (5) to (9) of docs/derivations/contact.md.
        """
        order = np.arange(len(self.field))
        at_ends = np.stack([(-1.0) ** order, np.ones(len(order))])
        # Strengths of the edge singularity: negative is tension.
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
        """Last coefficient of what a field adds to the pressure, over the mean pressure, (n,)."""
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
