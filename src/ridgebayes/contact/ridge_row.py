"""Interaction of the ridges of a row, through moments of their pressures.

The pressure on a ridge acts on other ridges through its moments (`ridge_contacts`), wherever the
contact ends, so the interaction matrix is the same at all loads. Ridges are ordered as they are
touched. The matrix of the first ridges is therefore a leading block of the full matrix, and the
Cholesky factors are related in the same way.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.linalg import lapack

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.contact.contact_set import N_PLACES
from ridgebayes.contact.intervals import MAX_DECAY, potentials
from ridgebayes.contact.logkernel import cross_blocks, log_ellipse, self_energies
from ridgebayes.contact.rigid_profile import Profile

_N_AHEAD = 2  # ridges that no event touches: the next ridge on either side


@dataclass(frozen=True, eq=False)
class RidgeRow:
    """The first n ridges, and the two ridges that follow.

    Events count from 0. Event n touches the first n + 1 ridges (or pairs of ridges), and reaches
    the next. Moments are arrays (n, m, n_event), with 0 for ridges that an event does not touch. In
    the unit of length of potentials the capacity of all ridges is below 1, so that matrices are
    positive definite.

    Parameters
    ----------
    profile : Profile
        Rigid profile.
    numbers : ndarray of int, shape (n + 2,)
        Numbers of the ridges in the profile.
    half_width : float
        Largest half-width of contact on a ridge.
    unit : float
        Unit of length.
    by_distance : ndarray of float, shape (2 n_distance + 1, m, m)
        Projections on a ridge of the potentials of another ridge's moments, at distances from
        -n_distance to n_distance pitches.
    factor : ndarray of float, shape (n m_far, n m_far)
        Cholesky factor of the scaled matrix of the first moments of fully covered ridges. Higher
        moments hardly act on neighbours.
    """

    profile: Profile
    numbers: IntArray
    half_width: float
    unit: float
    by_distance: FloatArray
    factor: FloatArray

    @classmethod
    def of(cls, profile: Profile, n: int, m: int, half_width: float) -> "RidgeRow":
        """Return the row of n ridges with m moments each.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the matrix is not positive definite, because of rounding.
        """
        numbers = touch_order(profile, n + _N_AHEAD)
        reach = max(abs(profile.ridge(k).start) for k in numbers.tolist())
        free, none = profile.b + (profile.a - 2 * half_width), np.empty((0, 0))
        right = cross_blocks(free / half_width, 2 * int(np.abs(numbers).max()) + 1, m)
        left = right[::-1].transpose(0, 2, 1)
        by_distance = np.concatenate([left, np.zeros((1, m, m)), right])
        row = cls(profile, numbers, half_width, reach + profile.a, by_distance, none)
        by_distance[:, 0, 0] += math.pi * row.shift
        by_distance[len(right)] = 0.0
        m_far = min(math.ceil(MAX_DECAY / float(log_ellipse(free / half_width))) + 1, m)
        m_far = m_far if profile.corner else m  # sharp ridges are solved without iteration
        rows, columns = row._scales(m_far)
        matrix = row._matrix(m_far) / (rows[:, None] * columns)
        matrix[np.arange(n * m_far), np.arange(n * m_far)] += 1.0
        factor, info = lapack.dpotrf(matrix.T, lower=0, clean=0, overwrite_a=1)
        if info != 0:
            raise np.linalg.LinAlgError(f"ridges' matrix is not positive definite (pivot {info})")
        return replace(row, factor=factor)

    @property
    def n(self) -> int:
        """Number of ridges in contact at the last event."""
        return len(self.numbers) - _N_AHEAD

    @property
    def m(self) -> int:
        """Number of moments of a ridge."""
        return int(self.by_distance.shape[1])

    @cached_property
    def has_own_image(self) -> bool:
        """Whether the first ridge is its own mirror image."""
        return abs(self.profile.offset) == 0.5

    @cached_property
    def centre(self) -> FloatArray:
        """Centres of the ridges, (n + 2,)."""
        starts = [self.profile.ridge(k).start for k in self.numbers.tolist()]
        return np.array(starts) + 0.5 * self.profile.a

    @cached_property
    def weight(self) -> FloatArray:
        """Multiplicity of each ridge, (n,): 2 if it has a mirror image, else 1."""
        weight = np.full(self.n, 2.0 if self.profile.mirrored else 1.0)
        if self.has_own_image:
            weight[0] = 1.0
        return weight

    @property
    def shift(self) -> float:
        """Contribution of the unit of length to the potential of a force of pi."""
        return -math.pi * math.log(self.half_width / self.unit)

    @cached_property
    def energies(self) -> FloatArray:
        """Projections on a fully covered ridge of its own potentials, (m,)."""
        by_order = self_energies(self.m)
        by_order[0] += math.pi * self.shift
        return by_order

    @cached_property
    def norms(self) -> FloatArray:
        """Integrals of T_m^2/sqrt(1 - t^2), (m,)."""
        norms = np.full(self.m, 0.5 * math.pi)
        norms[0] = math.pi
        return norms

    @cached_property
    def shape(self) -> FloatArray:
        """Coefficients of the body's parabola on each ridge, (n + 2, m)."""
        w, coefficients = self.half_width, np.zeros((len(self.numbers), self.m))
        coefficients[:, 0] = 0.5 * self.centre**2 + 0.25 * w**2
        coefficients[:, 1] = self.centre * w
        coefficients[:, 2] = 0.25 * w**2
        return coefficients

    @cached_property
    def within(self) -> BoolArray:
        """Whether an event touches a ridge, (n, n_event)."""
        return np.arange(self.n)[:, None] <= np.arange(self.n)

    @cached_property
    def _images(self) -> IntArray:
        """Numbers of the mirror images of ridges, (n,); empty without mirror symmetry."""
        if not self.profile.mirrored:
            return np.empty(0, dtype=np.int64)
        return -self.numbers[: self.n] - (0 if self.has_own_image else 1)

    def _matrix(self, m: int) -> FloatArray:
        """Return projections on each ridge of the other ridges' first moments, (n m, n m)."""
        numbers, n, middle = self.numbers[: self.n], self.n, len(self.by_distance) // 2
        blocks = self.by_distance[numbers[:, None] - numbers + middle, :m, :m]
        if self.profile.mirrored:
            signs = (-1.0) ** np.arange(m)
            blocks += self.by_distance[numbers[:, None] - self._images + middle, :m, :m] * signs
            if self.has_own_image:  # the first ridge is its own image, without odd orders
                blocks[:, 0] = self.by_distance[numbers + middle, :m, :m]
                blocks[:, 0, :, 1::2] = blocks[0, :, 1::2] = 0.0
        value: FloatArray = blocks.transpose(0, 2, 1, 3).reshape(n * m, n * m)
        return value

    def _scales(self, m: int) -> tuple[FloatArray, FloatArray]:
        """Return the divisors of rows and columns of the factor's matrix, (n m,) each."""
        root = np.repeat(np.sqrt(self.weight), m)
        scale = np.sqrt(np.tile(self.energies[:m], self.n))
        return scale / root, scale * root

    def solve(self, potentials: FloatArray) -> FloatArray:
        """Return the moments of fully covered ridges with given projections of potentials.

        Moments above the order of the factor are taken to act on their own ridge only.
        """
        n, m_far = self.n, len(self.factor) // self.n
        rows, columns = self._scales(m_far)
        value: FloatArray = potentials * (self.within[:, None] / self.energies[:, None])
        first = potentials[:, :m_far].reshape(n * m_far, -1) / rows[:, None]
        first, _ = lapack.dtrtrs(self.factor, np.asfortranarray(first), lower=0, trans=1)
        first[~np.repeat(self.within, m_far, axis=0)] = 0.0
        first, _ = lapack.dtrtrs(self.factor, first, lower=0, trans=0, overwrite_b=1)
        value[:, :m_far] = (first / columns[:, None]).reshape(n, m_far, -1)
        return value

    def events_of_covered(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Solve for fully covered ridges, with the surface touching the corner of the next ridge.

        Return the moments at events, (n, m, n_event), their derivatives by the approach, and the
        derivatives of the surface at the corner, (n_event,).
        """
        n = self.n
        x = self.places(np.full(n, -1.0), np.arange(n) + 1)
        charge = np.zeros((n, self.m, n))
        charge[:, 0] = math.pi * self.within
        by_approach = self.solve(charge)
        moments = -self.solve((self.shape[:n] * self.norms)[..., None] * self.within[:, None])
        potentials = self.potentials(x)
        lift = total_potential(potentials, by_approach)
        approach = (0.5 * x**2 + total_potential(potentials, moments)) / (1 - lift)
        return moments + by_approach * approach, by_approach, lift

    @cached_property
    def _spectrum(self) -> tuple[NDArray[np.complex128], int]:
        """Fourier transform of `by_distance` on a periodic row, and the number of its ridges."""
        numbers, middle = self.numbers, len(self.by_distance) // 2
        sources = np.concatenate([numbers, self._images])
        apart = np.arange(numbers.min() - sources.max(), numbers.max() - sources.min() + 1)
        size = int(fft.next_fast_len(len(apart), real=True))
        line = np.zeros((size, self.m, self.m))
        line[apart % size] = self.by_distance[apart + middle] / self.norms[:, None]
        return fft.rfft(line, axis=0), size

    def fields(self, moments: FloatArray) -> FloatArray:
        """Return coefficients of the potentials on each ridge, (n + 2, m, n_event).

        Ridges are evenly spaced, so that the sums over ridges are a convolution.
        """
        spectrum, size = self._spectrum
        numbers, of_first = self.numbers, moments
        if self.has_own_image:
            of_first = moments.copy()
            of_first[0, 1::2] = 0.0
        line = np.zeros((size, *moments.shape[1:]))
        line[numbers[: self.n] % size] = of_first
        if self.profile.mirrored:
            alone = int(self.has_own_image)
            signs = (-1.0) ** np.arange(self.m)[:, None]
            line[self._images[alone:] % size] = of_first[alone:] * signs
        sums = fft.irfft(spectrum @ fft.rfft(line, axis=0), size, axis=0)
        value: FloatArray = sums[numbers % size]
        if self.has_own_image:
            value[0, 1::2] = 0.0
        return value

    def places(self, t: FloatArray, ridges: IntArray) -> FloatArray:
        """Return x at places t on some ridges, (n_ridge,); t increases away from the centre."""
        out = np.where(self.numbers[ridges] < 0, -1.0, 1.0)
        value: FloatArray = self.centre[ridges] + out * self.half_width * t
        return value

    def potentials(self, x: FloatArray) -> FloatArray:
        """Return potentials of all moments at x, (n_x, n, m)."""
        places = x[:, None] - self.centre[: self.n]
        sums = potentials(places / self.half_width, self.half_width, self.m)
        if self.profile.mirrored:  # mirroring alternates the signs of the coefficients
            image = slice(int(self.has_own_image), self.n)
            places = -x[:, None] - self.centre[image]
            sums[:, image] += potentials(places / self.half_width, self.half_width, self.m)
        sums[..., 0] += math.pi * math.log(self.unit) * self.weight
        return sums

    def outward(self, coefficients: FloatArray, ridges: IntArray) -> FloatArray:
        """Return coefficients on some ridges, (n_ridge, m), for t away from the centre."""
        left = self.numbers[ridges] < 0
        signs = np.where(left[:, None], (-1.0) ** np.arange(self.m), 1.0)
        value: FloatArray = coefficients * signs
        return value

    def load(self, moments: FloatArray) -> FloatArray:
        """Return the load of each event, (n_event,)."""
        value: FloatArray = math.pi * (self.weight @ moments[:, 0])
        return value

    def depth(self, moments: FloatArray, approach: FloatArray) -> FloatArray:
        """Return the depth of the surface in the grooves next to the centre, (n_event,)."""
        first = int(self.numbers[0])
        floors = [self.profile.floor_after(k) for k in range(first - 1, first + 1)]
        x = np.concatenate([np.linspace(floor.start, floor.stop, N_PLACES) for floor in floors])
        size = self.n * self.m
        up = self.potentials(x).reshape(len(x), size) @ moments.reshape(size, -1)
        value: FloatArray = (approach - 0.5 * x[:, None] ** 2 - up).max(axis=0)
        return value


def total_potential(potentials: FloatArray, moments: FloatArray) -> FloatArray:
    """Return the potential of the moments (n, m, n_event) of each event at its place."""
    value: FloatArray = np.einsum("knm,nmk->k", potentials, moments)
    return value


def touch_order(profile: Profile, n: int) -> IntArray:
    """Return the numbers of the first n ridges in the order of contact.

    A mirrored profile has its right half only. Other profiles start with the ridge nearest to the
    centre and alternate between the sides.
    """
    k = np.arange(n)
    if profile.mirrored:
        return k
    first = 0 if profile.offset > 0 else 1  # number 0 is nearest, else -1
    return np.where(k % 2 == first, k // 2, -1 - k // 2)
