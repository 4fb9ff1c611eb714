r"""Pressure under a parabola on given contact intervals, and Newton steps of their free ends.

The surface recedes by :math:`u = -\int q \ln|x - \xi| d\xi`, with q the pressure times 2/(pi E*)
and lengths over the body's radius. On an interval of half-width w and local coordinate s,
:math:`q = \sum_n a_n T_n(s)/(w \sqrt{1 - s^2})`; the potential of each term has a closed form:

.. math:: \Phi_0 = \pi (\ln 2 - \ln w + \ln z), \qquad \Phi_n = (\pi/n) z^n \cos n\theta,

with :math:`\cos\theta = s` kept to [-1, 1] and z = 1 inside, :math:`z = |s| - \sqrt{s^2 - 1}`
outside. `intervals` has the equations.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.intervals import Interaction, Intervals
from ridgebayes.contact.logkernel import inverse_rho
from ridgebayes.contact.rigid_profile import Kinks


@dataclass(frozen=True, eq=False)
class PressureSolution:
    """Pressures on given intervals.

    Parameters
    ----------
    intervals : Intervals
        Intervals in contact.
    coefficients : ndarray of float, shape (n, m)
        a_n of each interval; odd orders vanish if it straddles the centre of a mirrored half.
    approach : float
        Downward movement of the body, relative to its surface at a distance R, over R.
    last : ndarray of float, shape (n,)
        Contribution of the other intervals to the last coefficient.
    kinks : Kinks
        Kinks of the rigid surface. Orders beyond m come only from kinks: -n h_n/pi.
    by_load : tuple of (ndarray of float, shape (n, m), float)
        Derivatives of coefficients and approach by the load for fixed intervals; converged free
        ends do not contribute to first order.
    """

    intervals: Intervals
    coefficients: FloatArray
    approach: float
    last: FloatArray
    kinks: Kinks
    by_load: tuple[FloatArray, float]

    @property
    def forces(self) -> FloatArray:
        """Integral of q over each interval, shape (n,)."""
        return math.pi * self.coefficients[:, 0]

    @property
    def load(self) -> float:
        """Integral of q over all intervals, mirror images included."""
        return float(self.forces @ self.intervals.weight)

    @cached_property
    def singular(self) -> FloatArray:
        """Strength of the edge singularities, left and right, (2, n); negative is tension."""
        return _at_ends(self._regular) - self.kinks.at_ends() / math.pi

    @cached_property
    def outward(self) -> FloatArray:
        """Newton step of each end outward to zero pressure, left and right, (2, n).

        With B = sum n^2 a_n the singular strength changes by B/(2 w) per length. At zero strength
        it does not depend on the other ends, so each end takes an independent step.
        """
        far = self.kinks.slopes() / math.pi
        square = np.arange(self.coefficients.shape[1]) ** 2
        slopes = _at_ends(self._regular * square) - far
        reach = 2 * self.intervals.half_width
        with np.errstate(divide="ignore", invalid="ignore"):
            steps: FloatArray = -reach * self.singular / slopes
        return steps

    @cached_property
    def _regular(self) -> FloatArray:
        """Coefficients without the contribution of kinks, which have closed sums."""
        m = self.coefficients.shape[1]
        value: FloatArray = self.coefficients + np.arange(m) / math.pi * self.kinks.series(m)
        return value

    @property
    def tail(self) -> float:
        """Largest contribution of neighbours to the last coefficients, over the mean first."""
        return float(np.abs(self.last).max(initial=0.0) / np.abs(self.coefficients[:, 0]).mean())

    def recession(self, x: ArrayLike) -> FloatArray:
        """Return the recession of the body's surface at x, of any shape."""
        points = np.asarray(x, dtype=np.float64)
        flat = points.ravel()
        height = self._recession(self._regular, flat)
        if self.kinks.angle.any():
            height += self._of_kinks(flat)
        return height.reshape(points.shape)

    def _recession(self, series: FloatArray, x: FloatArray) -> FloatArray:
        """Return the recession at x (n_point,) for pressures with given coefficients."""
        height, order = np.zeros(len(x)), np.arange(1, series.shape[1])
        powers = np.concatenate([np.zeros((1, len(series))), series.T[1:] / order[:, None]])
        for sign, has in self.intervals.images:
            half_width = self.intervals.half_width[has]
            s = (sign * x[:, None] - self.intervals.centre[has]) / half_width
            z = inverse_rho(np.maximum(np.abs(s) - 1.0, 0.0))
            place = np.copysign(z, s)
            if (z == 1.0).any():  # cos n theta is the real part of exp(i theta)^n
                place = z * np.exp(1j * np.arccos(np.clip(s, -1.0, 1.0)))
            height += np.log(2.0 * z / half_width) @ series[has, 0]
            height += polyval(place, powers[:, has], tensor=False).real.sum(axis=1)
        return math.pi * height

    def _of_kinks(self, x: FloatArray) -> FloatArray:
        """Return the contribution of all orders of the kinks to the recession at x (n_point,)."""
        centre, half_width = self.intervals.centre, self.intervals.half_width
        mean = self.kinks.few[:, 0]
        added = np.zeros(len(x))
        for sign, has in self.intervals.images:
            s = (sign * x[:, None] - centre) / half_width
            added -= (self.kinks.harmonic(s) - mean)[:, has].sum(axis=1)
        return added

    def surface(self, x: ArrayLike) -> FloatArray:
        """Return the height of the body's surface above the ridges' tops at x."""
        points = np.asarray(x, dtype=np.float64)
        return 0.5 * points**2 - self.approach + self.recession(points)

    def surface_by_load(self, x: FloatArray) -> FloatArray:
        """Return the derivative of `surface` by the load at x (n_point,)."""
        series, approach = self.by_load
        return self._recession(series, x) - approach

    def pressure(self, s: ArrayLike) -> FloatArray:
        """Return q sqrt(1 - s^2) at local coordinates s (n_point,), shape (n, n_point)."""
        theta = np.arccos(np.asarray(s, dtype=np.float64))
        shapes = np.cos(np.arange(self.coefficients.shape[1])[:, None] * theta)
        strength = self._regular @ shapes - self.kinks.strengths(theta) / math.pi
        return strength / self.intervals.half_width[:, None]

    def pressure_at_points(self) -> FloatArray:
        """Return q sqrt(1 - s^2) at twice as many Chebyshev points as coefficients, at least 64."""
        n = max(2 * self.coefficients.shape[1], 64)
        return self.pressure(np.cos((np.arange(n) + 0.5) * (math.pi / n)))


def solve_pressure(
    intervals: Intervals,
    height: FloatArray,
    load: float,
    n_coefficients: IntArray | int,
    kinks: Kinks | None = None,
) -> PressureSolution:
    """Solve for the pressures that press the body's surface onto the rigid surface.

    Parameters
    ----------
    intervals : Intervals
        Intervals where the surfaces touch.
    height : ndarray of float, shape (n, n_height)
        Chebyshev coefficients of the depth of the rigid surface below the ridges' tops on each
        interval, without the parts beyond kinks.
    load : float
        Integral of q over all intervals.
    n_coefficients : int or ndarray of int, shape (n,)
        Number of coefficients of each interval that depend on the other intervals, at least 3.

    Returns
    -------
    PressureSolution

    Raises
    ------
    numpy.linalg.LinAlgError
        If the equations are singular.

    Notes
    -----
    *Accuracy.* The error falls exponentially with m, faster if the next interval is far away.
    *Cost.* One dense solve for the few orders that act beyond neighbours, see `Interaction`.
    """
    m, n = np.broadcast_to(n_coefficients, intervals.left.shape), len(intervals.left)
    orders = np.arange(m.max())
    used = orders < m[:, None]
    kinks = kinks or Kinks.none(n)
    rigid = kinks.series(len(orders))
    rigid[:, : height.shape[1]] += height
    # Relative to the first interval, to avoid cancellation in the parabola at small loads.
    centre, half_width, first = intervals.centre, intervals.half_width, intervals.centre[0]
    depth, fall = rigid[0, 0], rigid.copy()
    fall[:, 0] += 0.5 * (centre - first) * (centre + first) + 0.25 * half_width**2 - depth
    fall[:, 1] += centre * half_width
    fall[:, 2] += 0.25 * half_width**2
    potentials = np.stack([np.where(used, -fall, 0.0), np.zeros(used.shape)])
    solved, approaches = Interaction(intervals, m).solve(potentials, np.array([load, 1.0]))
    alone = -rigid * orders / math.pi  # without neighbours
    coefficients = np.where(used, solved[0], alone)
    ends = np.arange(n), m - 1
    last = coefficients[ends] - alone[ends]
    approach = float(approaches[0]) + 0.5 * first**2 + depth
    by_load = solved[1], float(approaches[1])
    return PressureSolution(intervals, coefficients, approach, last, kinks, by_load)


def _at_ends(coefficients: FloatArray) -> FloatArray:
    """Return sums of T_n at s = -1 and 1, shape (2, n)."""
    signs = (-1.0) ** np.arange(coefficients.shape[1])
    return np.stack([coefficients @ signs, coefficients.sum(axis=1)])
