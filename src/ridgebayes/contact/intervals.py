r"""Pressure under a parabola on given contact intervals, and Newton steps of their free ends.

The surface recedes by :math:`u = -\int q \ln|x - \xi| d\xi`, with q the pressure times 2/(pi E*)
and lengths over the body's radius. On an interval of half-width w and local coordinate s,
:math:`q = \sum_n a_n T_n(s)/(w \sqrt{1 - s^2})`; the potential of each term has a closed form:

.. math:: \Phi_0 = \pi (\ln 2 - \ln w + \ln z), \qquad \Phi_n = (\pi/n) z^n \cos n\theta,

with :math:`\cos\theta = s` kept to [-1, 1] and z = 1 inside, :math:`z = |s| - \sqrt{s^2 - 1}`
outside. The equations are collocated at Chebyshev points.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray
from ridgebayes.contact.rigid_profile import Kinks


@dataclass(frozen=True, eq=False)
class Intervals:
    """Contact intervals of a body; lengths over its radius, x = 0 below its centre.

    Parameters
    ----------
    left, right : ndarray of float, shape (n,)
        Ends, in rising order. If `mirrored`, only intervals of the right half are given; the first
        is whole if it straddles the centre (left = -right).
    mirrored : bool
        Whether the left half is the mirror image of the right half.
    """

    left: FloatArray
    right: FloatArray
    mirrored: bool

    @property
    def straddles(self) -> bool:
        """Whether the first interval is its own mirror image."""
        return self.mirrored and len(self.left) > 0 and self.left[0] < 0

    @property
    def centre(self) -> FloatArray:
        """Centres, shape (n,)."""
        return 0.5 * (self.left + self.right)

    @property
    def half_width(self) -> FloatArray:
        """Half-widths, shape (n,)."""
        return 0.5 * (self.right - self.left)

    @property
    def weight(self) -> FloatArray:
        """Multiplicity of each interval, shape (n,): 2 if it has a mirror image."""
        weight = np.full(len(self.left), 2.0 if self.mirrored else 1.0)
        if self.straddles:
            weight[0] = 1.0
        return weight


@dataclass(frozen=True, eq=False)
class PressureSolution:
    """Pressures on given intervals.

    Parameters
    ----------
    intervals : Intervals
        Intervals in contact.
    coefficients : ndarray of float, shape (n, m)
        a_n of each interval; odd orders are zero for an interval that straddles the centre.
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
    def singular(self) -> tuple[FloatArray, FloatArray]:
        """Strength of the edge singularities, left and right, (n,) each; negative is tension."""
        left, right = np.array(_at_ends(self._regular)) - self.kinks.at_ends() / math.pi
        return left, right

    @cached_property
    def outward(self) -> tuple[FloatArray, FloatArray]:
        """Newton step of each end outward to zero pressure, left and right, (n,) each.

        With B = sum n^2 a_n the singular strength changes by B/(2 w) per length. At zero strength
        it does not depend on the other ends, so each end takes an independent step.
        """
        far = self.kinks.slopes() / math.pi
        square = np.arange(self.coefficients.shape[1]) ** 2
        slopes = np.array(_at_ends(self._regular * square)) - far
        reach = 2 * self.intervals.half_width
        with np.errstate(divide="ignore", invalid="ignore"):
            left, right = -reach * np.array(self.singular) / slopes
        return left, right

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

    def _recession(self, series: FloatArray, flat: FloatArray) -> FloatArray:
        """Return the recession at x (n_point,) for pressures with given coefficients."""
        step = max(2_000_000 // series.size, 1)
        parts = np.split(flat, range(step, len(flat), step))
        blocks = (potentials(self.intervals, part, series.shape[1]) for part in parts)
        return np.concatenate([np.einsum("xin,in->x", block, series) for block in blocks])

    def _of_kinks(self, x: FloatArray) -> FloatArray:
        """Return the contribution of all orders of the kinks to the recession at x (n_point,)."""
        centre, half_width = self.intervals.centre, self.intervals.half_width
        mean = self.kinks.few[:, 0]
        added = np.zeros(len(x))
        for sign, has in ((1.0, self.intervals.weight > 0), (-1.0, self.intervals.weight > 1)):
            s = (sign * x[:, None] - centre) / half_width
            added -= (self.kinks.harmonic(s) - mean) @ has
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
    n_coefficients: int,
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
    n_coefficients : int
        Number m of coefficients per interval that depend on the other intervals.

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
    *Cost.* One dense solve of n m + 1 unknowns.
    """
    n, m = len(intervals.left), n_coefficients
    s = _points(intervals, m)
    x = (intervals.centre[:, None] + intervals.half_width[:, None] * s).ravel()
    used = _used(intervals, m)
    functions = potentials(intervals, x, used.shape[1])
    matrix = np.empty((n * m + 1, n * m + 1))
    every = functions.reshape(len(x), -1)
    matrix[:-1, :-1] = every[:, used.ravel()] if intervals.straddles else every
    matrix[:-1, -1] = -1.0
    matrix[-1] = 0.0
    matrix[-1, :-1:m] = math.pi * intervals.weight
    kinks = kinks or Kinks.none(n)
    order = np.arange(used.shape[1])
    whole = kinks.series(len(order))
    whole[:, : height.shape[1]] += height
    waves = np.cos(order * np.arccos(s)[..., None])
    rigid = np.einsum("in,imn->im", np.where(used, whole, 0.0), waves)
    # Relative to the first interval, to avoid cancellation in the parabola at small loads.
    first, depth = intervals.centre[0], whole[0, 0]
    right = np.zeros((n * m + 1, 2))
    right[:-1, 0] = -0.5 * (x - first) * (x + first) - (rigid - depth).ravel()
    right[-1] = load, 1.0
    solved, unit = np.linalg.solve(matrix, right).T
    coefficients, charge = -whole * order / math.pi, np.zeros(used.shape)
    coefficients[used], charge[used] = solved[:-1], unit[:-1]
    ends = np.where(used, order, -1).max(axis=1)
    alone = -ends * whole[np.arange(n), ends] / math.pi  # without neighbours
    last = coefficients[np.arange(n), ends] - alone
    approach = float(solved[-1]) + 0.5 * first**2 + depth
    by_load = charge, float(unit[-1])
    return PressureSolution(intervals, coefficients, approach, last, kinks, by_load)


def _at_ends(coefficients: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return sums of T_n at s = -1 and 1."""
    return coefficients @ (-1.0) ** np.arange(coefficients.shape[1]), coefficients.sum(axis=1)


def _points(intervals: Intervals, m: int) -> FloatArray:
    """Return collocation points in local coordinates; of the right half if straddling."""
    s = np.tile(np.cos((np.arange(m) + 0.5) * (math.pi / m)), (len(intervals.left), 1))
    if intervals.straddles:
        s[0] = np.cos((np.arange(m) + 0.5) * (math.pi / (2 * m)))
    return s


def _used(intervals: Intervals, m: int) -> np.ndarray:
    """Return the mask of each interval's functions, (n, m), or (n, 2m) with even ones first."""
    n = len(intervals.left)
    if not intervals.straddles:
        return np.ones((n, m), dtype=bool)
    used = np.zeros((n, 2 * m), dtype=bool)
    used[:, :m] = True
    used[0] = np.arange(2 * m) % 2 == 0
    return used


def potentials(intervals: Intervals, x: FloatArray, m: int) -> FloatArray:
    """Return the potentials of every function at x, mirror images added, shape (n_x, n, m)."""
    whole = int(intervals.straddles) if intervals.mirrored else len(intervals.left)
    return potentials_around(intervals.centre, intervals.half_width, x, m, alone=whole)


def potentials_around(
    centre: FloatArray, half_width: FloatArray, x: FloatArray, m: int, *, alone: int
) -> FloatArray:
    """Return `potentials` of intervals whose first `alone` have no mirror image."""
    sums = _potentials(centre, half_width, x, m)
    # Mirroring about the centre alternates the signs of the coefficients.
    signs = (-1.0) ** np.arange(m)
    sums[:, alone:] += signs * _potentials(-centre[alone:], half_width[alone:], x, m)
    return sums


def _potentials(centre: FloatArray, half_width: FloatArray, x: FloatArray, m: int) -> FloatArray:
    s = (x[:, None] - centre) / half_width
    size = np.maximum(np.abs(s), 1.0)
    beyond = size - 1.0
    # 1/z without cancellation
    z = 1.0 / (size + np.sqrt(beyond * (2.0 + beyond)))
    order, inside = np.arange(1, m), np.nonzero(size == 1.0)
    values = np.empty((*s.shape, m))
    values[..., 0] = math.pi * (math.log(2.0) - np.log(half_width) + np.log(z))
    waves = values[..., 1:]
    waves[:] = np.copysign(z, s)[..., None]
    np.multiply.accumulate(waves, axis=-1, out=waves)
    waves[inside] = np.cos(order * np.arccos(s[inside])[:, None])
    waves *= math.pi / order
    return values
