r"""Contact intervals, and the equations between the pressures on them.

The potentials of the pressure on one interval (`pressure`) are, on another interval, a Chebyshev
series. Between neighbours all orders act. Farther away a few suffice, because pressures of high
order are small and hardly act there. The few orders of all intervals are solved by one
factorisation, the others by iteration (docs/derivations/contact.md).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.logkernel import influence, log_ellipse

# Pressures of order m act on neighbours by rho^-2m. Beyond e^-6 an iteration suffices.
MAX_DECAY = 3.0  # m ln(rho) of the highest orders in a factorisation


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

    def distances(self, k: int) -> FloatArray:
        """Return each interval's distance to its nearer k-th neighbour, over its half-width, (n,).

        Distances are kept within the rounding error and its inverse.
        """
        left, right = self.left, self.right
        if self.mirrored:
            image = slice(None, 0 if self.straddles else None, -1)
            left, right = np.append(-right[image], left), np.append(-left[image], right)
        gaps, none = left[k:] - right[:-k], [math.inf] * k
        nearest = np.minimum(np.append(none, gaps), np.append(gaps, none))
        tiny = np.finfo(np.float64).eps
        near: FloatArray = nearest[-len(self.left) :] / self.half_width
        return np.clip(near, tiny, 1 / tiny)

    @property
    def images(self) -> tuple[tuple[float, slice], ...]:
        """Sign of x and selected intervals, for intervals and for their mirror images."""
        both = (1.0, slice(None)), (-1.0, slice(int(self.straddles), None))
        return both if self.mirrored else both[:1]

    @property
    def weight(self) -> FloatArray:
        """Multiplicity of each interval, shape (n,): 2 if it has a mirror image."""
        weight = np.full(len(self.left), 2.0 if self.mirrored else 1.0)
        if self.straddles:
            weight[0] = 1.0
        return weight


class Interaction:
    """Equations for the coefficients of pressures on intervals.

    Parameters
    ----------
    intervals : Intervals
        Intervals.
    m : ndarray of int, shape (n,)
        Number of coefficients of each interval.
    """

    def __init__(self, intervals: Intervals, m: IntArray) -> None:
        self._intervals, n = intervals, len(m)
        self._used = np.arange(m.max()) < m[:, None]
        # Potentials of an interval's own pressure are diagonal.
        self._own = np.where(self._used, math.pi / np.maximum(np.arange(m.max()), 1), 1.0)
        self._own[:, 0] = math.pi * np.log(2.0 / intervals.half_width)
        near, far = (log_ellipse(intervals.distances(k)) for k in (1, 2))
        # Few orders are as accurate far away as m orders are between neighbours.
        few = np.maximum(2 * m / (1 + far / near), MAX_DECAY / near)
        self._few = math.ceil(np.minimum(few, m).max())
        i = np.arange(n)
        is_next = np.abs(i[:, None] - i) == 1
        is_next_image = (i[:, None] == 0) & (i == int(intervals.straddles))
        neighbours = np.stack([is_next, is_next_image])[: len(intervals.images)]
        image, self._row, self._column = np.nonzero(neighbours)
        self._sign = np.where(image == 1, -1.0, 1.0)
        x, project = self._points(len(self._own[0]))
        centre, half_width = intervals.centre[:, None], intervals.half_width[:, None]
        centre, half_width = centre[self._column], half_width[self._column]
        s = (self._sign[:, None] * x[self._row] - centre) / half_width
        near_blocks = project @ potentials(s, half_width, len(project))
        used = self._used[self._row][:, :, None] & self._used[self._column][:, None]
        self._near: FloatArray = np.where(used, near_blocks, 0.0)

    def _points(self, m: int) -> tuple[FloatArray, FloatArray]:
        """Return m Chebyshev points on each interval, (n, m), and the projection on T_n, (m, m)."""
        angle = (np.arange(m) + 0.5) * (math.pi / m)
        project = np.cos(np.arange(m)[:, None] * angle) * (2.0 / m)
        project[0] *= 0.5
        centre, half_width = self._intervals.centre[:, None], self._intervals.half_width[:, None]
        return centre + half_width * np.cos(angle), project

    def _far(self, few: int) -> FloatArray:
        """Return the blocks of all pairs that are not neighbours, (n, few, n, few)."""
        intervals, n = self._intervals, len(self._own)
        x, project = self._points(few)
        far = np.zeros((n, few, n, few))
        for sign, has in intervals.images:
            s = (sign * x[..., None] - intervals.centre) / intervals.half_width
            values = potentials(s, intervals.half_width, few)
            blocks = np.tensordot(project, values, axes=(1, 1)).swapaxes(0, 1)
            near = self._sign == sign
            blocks[self._row[near], :, self._column[near]] = 0.0
            if sign > 0:
                blocks[np.arange(n), :, np.arange(n)] = 0.0
            far[:, :, has] += blocks[:, :, has]
        few_used = self._used[:, :few]
        far *= few_used[:, :, None, None] & few_used
        return far

    def solve(
        self, heights: FloatArray, loads: FloatArray, few: int | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return coefficients, (n_case, n, m), and approaches, (n_case,).

        Parameters
        ----------
        heights : ndarray of float, shape (n_case, n, m)
            Chebyshev coefficients of the potentials less the approach.
        loads : ndarray of float, shape (n_case,)
            Loads.
        few : int, optional
            Number of orders in the factorisation.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the equations are singular.
        """
        few, n_case, (n, most) = few or self._few, len(loads), self._own.shape
        far, weight = self._far(few), math.pi * self._intervals.weight
        blocks = far.copy()
        for row, column, block in zip(self._row, self._column, self._near, strict=True):
            blocks[row, :, column] += block[:few, :few]
        core = np.zeros((n * few + 1, n * few + 1))
        core[:-1, :-1] = blocks.reshape(n * few, -1)
        core[np.arange(n * few), np.arange(n * few)] += self._own[:, :few].ravel()
        core[:-1:few, -1], core[-1, :-1:few] = -1.0, weight
        factor, pivots, info = lapack.dgetrf(core, overwrite_a=1)
        if info != 0:
            raise np.linalg.LinAlgError("singular equations")
        by_far = far.reshape(n * few, -1).T
        found, approaches = np.zeros(heights.shape), np.zeros(n_case)
        last = math.inf
        while True:
            rest = heights - self._own * found
            rest[..., 0] += approaches[:, None]
            rest[..., :few] -= (found[..., :few].reshape(n_case, -1) @ by_far).reshape(-1, n, few)
            acting = (self._near @ found[:, self._column, :, None])[..., 0]
            for case, act in zip(rest, acting, strict=True):
                np.subtract.at(case, self._row, act)
            lacking = loads - found[..., 0] @ weight
            right = np.column_stack([rest[..., :few].reshape(n_case, -1), lacking])
            solved = lapack.dgetrs(factor, pivots, right.T)[0].T
            step = rest / self._own
            step[..., :few] = solved[:, :-1].reshape(-1, n, few)
            found += step
            approaches += solved[:, -1]
            size = float((np.abs(step).max(axis=(1, 2)) / np.abs(found).max(axis=(1, 2))).max())
            if size < np.finfo(np.float64).eps ** 0.75 or (few == most and not size < 0.5 * last):
                return found, approaches
            if not size < 0.5 * last:
                return self.solve(heights, loads, min(2 * few, most))
            last = size


def potentials(s: FloatArray, half_width: FloatArray | float, m: int) -> FloatArray:
    """Return m potentials of intervals at local coordinates s outside, shape (*s.shape, m)."""
    values = influence(np.maximum(np.abs(s) - 1.0, 0.0), m)
    values[..., 0] -= math.pi * np.log(half_width)
    values[..., 1::2] *= np.sign(s)[..., None]
    return values
