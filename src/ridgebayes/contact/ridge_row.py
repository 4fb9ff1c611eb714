r"""What the ridges of a row do to each other, through moments of their pressures.

Wherever contact on a ridge ends, its pressure acts on others through its moments alone
(`ridge_contacts`): the matrix between ridges is the same at all loads. Ridges stand in the order in
which they are touched, so that the matrix of the first few is a leading block of that of all, and
so is its Cholesky factor.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import lapack

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.contact.intervals import Intervals, potentials
from ridgebayes.contact.logkernel import cross_blocks, self_energies
from ridgebayes.contact.rigid_profile import Profile

_AHEAD = 2  # ridges that no event touches: the next ones on either side
_LOOKS = np.linspace(0.02, 0.98, 9)  # of a groove's width


@dataclass(frozen=True, eq=False)
class RidgeRow:
    """The first n ridges, and two more that they act on.

    Events are numbered from 0: the n-th touches the first n + 1 ridges (or pairs of them), and
    reaches the next. Moments are arrays (n, m, n_event), 0 where an event does not touch a ridge.
    Potentials are in units in which the capacity of all ridges is below 1: definite matrices.

    Parameters
    ----------
    profile : Profile
        The rigid side.
    numbers : ndarray of int, shape (n + 2,)
        Of ridges.
    half_width : float
        Of what contact may cover of a ridge.
    unit : float
        Of length.
    felt : ndarray of float, shape (n + 2, m, n m)
        Projections on each ridge of the potentials of the moments of all others.
    factor : ndarray of float, shape (n m, n m)
        Cholesky's, of ridges that are covered in full, scaled.
    """

    profile: Profile
    numbers: IntArray
    half_width: float
    unit: float
    felt: FloatArray
    factor: FloatArray

    @classmethod
    def of(cls, profile: Profile, n: int, m: int, half_width: float) -> "RidgeRow":
        """Return that of n ridges, m moments each, of which contact may cover a half-width.

        Raises
        ------
        numpy.linalg.LinAlgError
            If rounding has cost the matrix its positive definiteness.
        """
        numbers = touch_order(profile, n + _AHEAD)
        reach = max(abs(profile.ridge(k).start) for k in numbers.tolist())
        felt, none = np.empty((n + _AHEAD, m, n * m)), np.empty((0, 0))
        row = cls(profile, numbers, half_width, reach + profile.a, felt, none)
        row.felt[:] = row._blocks().transpose(0, 2, 1, 3).reshape(row.felt.shape)
        rows, columns = row._scales
        matrix = row.felt[:n].reshape(n * m, n * m) / (rows[:, None] * columns)
        matrix[np.arange(n * m), np.arange(n * m)] += 1.0
        factor, info = lapack.dpotrf(matrix.T, lower=0, clean=0, overwrite_a=1)
        if info != 0:
            raise np.linalg.LinAlgError(f"ridges' matrix is not positive definite (pivot {info})")
        return replace(row, factor=factor)

    def first(self, n: int) -> "RidgeRow":
        """Return that of the first n ridges alone."""
        size = n * self.m
        felt = self.felt[: n + _AHEAD, :, :size]
        factor = np.asfortranarray(self.factor[:size, :size])
        return replace(self, numbers=self.numbers[: n + _AHEAD], felt=felt, factor=factor)

    @property
    def n(self) -> int:
        """Ridges that are touched at the last event."""
        return len(self.numbers) - _AHEAD

    @property
    def m(self) -> int:
        """Moments of a ridge."""
        return int(self.felt.shape[1])

    @cached_property
    def over_ridge(self) -> bool:
        """Whether the first ridge is its own mirror image."""
        return abs(self.profile.offset) == 0.5

    @cached_property
    def centre(self) -> FloatArray:
        """Middles of ridges, (n + 2,)."""
        starts = [self.profile.ridge(k).start for k in self.numbers.tolist()]
        return np.array(starts) + 0.5 * self.profile.a

    @cached_property
    def weight(self) -> FloatArray:
        """How often each ridge is there, (n,): twice where it has a mirror image."""
        weight = np.full(self.n, 2.0 if self.profile.mirrored else 1.0)
        if self.over_ridge:
            weight[0] = 1.0
        return weight

    @property
    def shift(self) -> float:
        """What the unit of length adds to the potential of a force of pi."""
        return -math.pi * math.log(self.half_width / self.unit)

    @cached_property
    def energies(self) -> FloatArray:
        """Projections on a ridge covered in full of its own potentials, (m,)."""
        own = self_energies(self.m)
        own[0] += math.pi * self.shift
        return own

    @cached_property
    def norms(self) -> FloatArray:
        """Integrals of T_m^2/sqrt(1 - t^2), (m,)."""
        norms = np.full(self.m, 0.5 * math.pi)
        norms[0] = math.pi
        return norms

    @cached_property
    def shape(self) -> FloatArray:
        """Coefficients of the body's parabola on each ridge, (n + 2, m)."""
        w, found = self.half_width, np.zeros((len(self.numbers), self.m))
        found[:, 0] = 0.5 * self.centre**2 + 0.25 * w**2
        found[:, 1] = self.centre * w
        found[:, 2] = 0.25 * w**2
        return found

    @cached_property
    def within(self) -> BoolArray:
        """Which ridges an event touches, (n, n_event)."""
        return np.arange(self.n)[:, None] <= np.arange(self.n)

    def _blocks(self) -> FloatArray:
        """Return projections on each ridge of each other's potentials, (n + 2, n, m, m)."""
        numbers, m, n = self.numbers, self.m, self.n
        span = 2 * int(np.abs(numbers).max()) + 1
        free = self.profile.b + (self.profile.a - 2 * self.half_width)
        right = cross_blocks(free / self.half_width, span, m)
        right[:, 0, 0] += math.pi * self.shift
        by_distance = np.concatenate([right[::-1].transpose(0, 2, 1), np.zeros((1, m, m)), right])
        found: FloatArray = by_distance[numbers[:, None] - numbers[:n] + span]
        if self.profile.mirrored:
            apart = numbers[:, None] + numbers[:n] + (0 if self.over_ridge else 1)
            image = right[np.maximum(apart, 1) - 1] * (-1.0) ** np.arange(m)
            if self.over_ridge:  # the first ridge has none, and nothing of odd order
                image[:, 0] = 0.0
                found[:, 0, :, 1::2] = 0.0
                found[0, :, 1::2] = image[0, :, 1::2] = 0.0
            found += image
        return found

    @cached_property
    def _scales(self) -> tuple[FloatArray, FloatArray]:
        """What rows and columns of the factor's matrix are divided by, (n m,) each."""
        root = np.repeat(np.sqrt(self.weight), self.m)
        scale = np.sqrt(np.tile(self.energies, self.n))
        return scale / root, scale * root

    def covered(self, potentials: FloatArray, events: IntArray) -> FloatArray:
        """Return moments of ridges covered in full that make given potentials' projections."""
        (rows, columns), size = self._scales, self.n * self.m
        within = np.repeat(self.within[:, events], self.m, axis=0)
        found = np.asfortranarray(potentials.reshape(size, -1) / rows[:, None])
        found, _ = lapack.dtrtrs(self.factor, found, lower=0, trans=1, overwrite_b=1)
        found[~within] = 0.0
        found, _ = lapack.dtrtrs(self.factor, found, lower=0, trans=0, overwrite_b=1)
        value: FloatArray = (found / columns[:, None]).reshape(potentials.shape)
        return value

    def fields(self, moments: FloatArray) -> FloatArray:
        """Return coefficients of the potentials felt on each ridge, (n + 2, m, n_event)."""
        size = self.n * self.m
        found: FloatArray = self.felt.reshape(-1, size) @ moments.reshape(size, -1)
        return found.reshape(len(self.numbers), self.m, -1) / self.norms[:, None]

    def places(self, t: FloatArray, ridges: IntArray) -> FloatArray:
        """Return x at t on some ridges, which rises away from the centre, (n_ridge,)."""
        out = np.where(self.numbers[ridges] < 0, -1.0, 1.0)
        value: FloatArray = self.centre[ridges] + out * self.half_width * t
        return value

    def potentials(self, x: FloatArray) -> FloatArray:
        """Return potentials of all moments at x, (n_x, n, m)."""
        middle, half = self.centre[: self.n], self.half_width
        ridges = Intervals(middle - half, middle + half, self.profile.mirrored)
        found = potentials(ridges, x, self.m)
        found[..., 0] += math.pi * math.log(self.unit) * self.weight
        return found

    def outward(self, coefficients: FloatArray, ridges: IntArray) -> FloatArray:
        """Return coefficients on some ridges, (n_ridge, m), by t that rises from the centre."""
        left = self.numbers[ridges] < 0
        signs = np.where(left[:, None], (-1.0) ** np.arange(self.m), 1.0)
        value: FloatArray = coefficients * signs
        return value

    def load(self, moments: FloatArray) -> FloatArray:
        """Return the load of each event, (n_event,)."""
        value: FloatArray = math.pi * (self.weight @ moments[:, 0])
        return value

    def hanging(self, moments: FloatArray, approach: FloatArray) -> FloatArray:
        """Return how deep the surface hangs into the grooves next to the centre, (n_event,)."""
        first = int(self.numbers[0])
        floors = [self.profile.floor_after(k) for k in range(first - 1, first + 1)]
        x = np.concatenate([one.start + _LOOKS * (one.stop - one.start) for one in floors])
        size = self.n * self.m
        up = self.potentials(x).reshape(len(x), size) @ moments.reshape(size, -1)
        value: FloatArray = (approach - 0.5 * x[:, None] ** 2 - up).max(axis=0)
        return value


def touch_order(profile: Profile, n: int) -> IntArray:
    """Return numbers of the first n ridges that are touched; of a mirrored profile its right half.

    Otherwise the nearest to the centre first, then one on either side by turns.
    """
    k = np.arange(n)
    if profile.mirrored:
        return k
    first = 0 if profile.offset > 0 else 1  # whether ridge 0 is the nearest, or -1
    return np.where(k % 2 == first, k // 2, -1 - k // 2)
