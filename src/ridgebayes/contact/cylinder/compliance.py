"""Small strain: one compliance of the rim serves every texture and every load.

The body is linear and contact is imposed where the surface was before it moved, as half-plane
theory has it. What a force somewhere on the rim does elsewhere is computed once for a mesh and a
Poisson's ratio; a texture is then a small complementarity problem for the pressures on its
segments, and each of its transitions one more equation: the next corner's gap is zero.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact import hertz
from ridgebayes.contact.cylinder.cylinder import CORNER, SEGMENT
from ridgebayes.contact.cylinder.faces import cut
from ridgebayes.contact.cylinder.material import Material
from ridgebayes.contact.cylinder.mesh import disk_mesh
from ridgebayes.contact.cylinder.solid import Solid
from ridgebayes.contact.cylinder.surface import shapes
from ridgebayes.errors import ComputationError, InputError

_GAUSS = 3
_LOOSER = 0.3  # growth of edges beyond the reach
_MOST_CHANGES = 200
_MOST_EDGES = 2_500  # within reach: minutes, and 200 MB


@dataclass(frozen=True, eq=False)
class RimCompliance:
    """What vertical forces on the rim of half a cylinder do to it, its mid-plane being held.

    Parameters
    ----------
    nu : float, scalar, dimensionless
        Poisson's ratio.
    edge : float, over R
        Length of the rim's edges within reach.
    x : ndarray of float, shape (n_node,), over R
        Abscissae of the rim's nodes from the axis outwards, ends and middles of edges in turn.
    compliance : ndarray of float, shape (n_node, n_node)
        Downward displacement of each node, over R, by a unit downward force over E R on each and
        its mirror image.

    Notes
    -----
    *Validity.* Small strain; by the per cent where contact at displaced places differs from that at
    the reference ones: 0.5 % at p/E = 0.004, 3 % at 0.02.
    """

    nu: float
    edge: float
    x: FloatArray
    compliance: FloatArray

    def transitions(self, a: float, b: float, *, p_max: float) -> tuple[IntArray, FloatArray]:
        """Compute the transition loads of a centred texture with sharp corners.

        Parameters
        ----------
        a, b : float, over R
            Ridge and groove width.
        p_max : float, scalar, dimensionless
            Highest load p/E.

        Returns
        -------
        Q : ndarray of int, shape (n,)
            4, 6, ...
        p_over_E : ndarray of float, shape (n,), dimensionless
            Loads, rising.

        Raises
        ------
        InputError
            If a ridge within the load has under eight edges, or the reach is too short.
        ComputationError
            If no set of segments in contact fits.

        Notes
        -----
        *Cost.* Some tens of milliseconds once the compliance is there.
        """
        if min(a, 4 * b) < 8 * self.edge:
            raise InputError(
                f"a = {a!r}, b = {b!r}; expected eight edges of {self.edge:.3g} on each"
            )
        loads: list[float] = []
        segments, pressure = np.zeros((0, len(self.x) + 2)), np.zeros(0)
        while not loads or loads[-1] <= p_max:
            start = 0.5 * b + len(loads) * (a + b)
            corner = start + a + b
            if corner > self.x[-1]:
                raise InputError(f"p_max = {p_max!r}; expected contact within {self.x[-1]:.3g} R")
            segments = np.vstack([segments, self._segments(start, start + a)])
            active = np.append(pressure > 0, np.ones(len(segments) - len(pressure), dtype=bool))
            pressure = self._touching(segments, corner, active)
            loads.append(float(segments[:, -1] @ pressure))
        found = np.array(loads[:-1])
        return 4 + 2 * np.arange(len(found)), found

    def _segments(self, start: float, stop: float) -> FloatArray:
        """Return a ridge's segments, a row each: weights of nodes, integrated gap, length."""
        first = CORNER * self.edge
        breaks = start + cut(stop - start, first, first, SEGMENT * self.edge)
        # Between kinks the surface is smooth.
        inside = self.x[::2]
        inside = inside[(inside > start) & (inside < stop)]
        pieces = np.unique(np.concatenate([breaks, inside]))
        t, w = np.polynomial.legendre.leggauss(_GAUSS)
        half = 0.5 * np.diff(pieces)
        at = ((pieces[:-1] + half)[:, None] + half[:, None] * t).ravel()
        weight = (half[:, None] * w).ravel()
        segment = np.searchsorted(breaks, at) - 1
        rows = np.zeros((len(breaks) - 1, len(self.x)))
        np.add.at(rows, segment, weight[:, None] * self._at(at))
        gap = np.zeros(len(breaks) - 1)
        np.add.at(gap, segment, weight * (1.0 - np.sqrt(1.0 - at**2)))
        return np.column_stack([rows, gap, np.diff(breaks)])

    def _at(self, where: FloatArray) -> FloatArray:
        """Return the rim's shape functions at abscissae, shape (n, n_node)."""
        ends, middle = self.x[::2], self.x[1::2]
        edge = np.clip(np.searchsorted(ends, where) - 1, 0, len(middle) - 1)
        low, bend = ends[edge], 2 * (ends[edge] + ends[edge + 1] - 2 * middle[edge])
        slope = ends[edge + 1] - low - bend
        # low + slope s + bend s^2 = where, the root in [0, 1] without a difference.
        s = 2 * (where - low) / (slope + np.sqrt(slope**2 + 4 * bend * (where - low)))
        rows = np.zeros((len(where), len(self.x)))
        rows[np.arange(len(where))[:, None], 2 * edge[:, None] + np.arange(3)] = shapes(s)
        return rows

    def _touching(self, segments: FloatArray, corner: float, active: np.ndarray) -> FloatArray:
        """Return the pressures at which the body just touches a corner."""
        weights, gap, length = segments[:, :-2], segments[:, -2], segments[:, -1]
        at = self._at(np.array([corner]))[0]
        far = 1.0 - math.sqrt(1.0 - corner**2)
        # A force up on segments moves the rim up: gaps grow, and the rise d closes them.
        among = weights @ self.compliance @ weights.T
        there = weights @ (self.compliance @ at)
        for _ in range(_MOST_CHANGES):
            on = np.flatnonzero(active)
            n = len(on)
            # gap + among p - d length = 0 on segments in contact, and likewise at the corner.
            matrix = np.zeros((n + 1, n + 1))
            matrix[:n, :n], matrix[:n, n] = among[np.ix_(on, on)], -length[on]
            matrix[n, :n], matrix[n, n] = there[on], -1.0
            solution = np.linalg.solve(matrix, -np.append(gap[on], far))
            pressure = np.zeros(len(gap))
            pressure[on] = solution[:n]
            opened = gap + among @ pressure - solution[n] * length
            wrong = (active & (pressure < 0)) | (~active & (opened < -1e-14))
            if not wrong.any():
                return pressure
            active = active ^ wrong
        raise ComputationError("small strain: no set of segments in contact fits")


# Textures of one scene share it: bounded, and a function of its arguments alone.
@lru_cache(maxsize=4)
def rim_compliance(nu: float = 0.5, *, reach: float = 0.3, edge: float = 5e-4) -> RimCompliance:
    """Compute the compliance of a cylinder's rim.

    Parameters
    ----------
    nu : float, scalar, dimensionless
        Poisson's ratio, 0 to 0.5.
    reach : float, over R
        How far from the axis contact may come.
    edge : float, over R
        Length of edges there.

    Returns
    -------
    RimCompliance
        Kept for the next call with the same arguments.

    Notes
    -----
    *Cost.* Seconds: a solution of the whole body for each node of the rim within reach.
    """
    mesh = disk_mesh(lambda at: edge + _LOOSER * np.maximum(at - math.asin(reach), 0.0))
    solid = Solid(mesh, Material(nu, finite=False))
    inside = mesh.rim[mesh.points[mesh.rim[:, 0], 0] < reach]
    nodes = np.append(inside[:, :2].ravel(), inside[-1, 2])  # an odd number, in order
    still = np.zeros((solid.n_node, 2))
    stiffness = solid.assemble(still, solid.no_pressure()).stiffness
    held = np.zeros((solid.n_node, 2), dtype=bool)
    held[mesh.axis, 0] = True
    held[mesh.mid_plane, 1] = True
    free = np.flatnonzero(~held.ravel())
    factor = splu(
        sparse.csc_array(stiffness[free][:, free]),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
    )
    number = np.full(2 * solid.n_node, -1)
    number[free] = np.arange(len(free))
    rows = number[2 * nodes + 1]
    found = np.empty((len(nodes), len(nodes)))
    for i, row in enumerate(rows):
        found[:, i] = factor.solve(np.eye(1, len(free), row)[0])[rows]
    return RimCompliance(nu, edge, solid.points[nodes, 0], 0.5 * (found + found.T))


def small_strain_transitions(
    a: float, b: float, *, nu: float = 0.5, p_max: float = 0.02, edges: float = 24.0
) -> tuple[IntArray, FloatArray]:
    """Compute transition loads of a centred cylinder at small strain, by finite elements.

    Parameters
    ----------
    a, b : float, over R
        Ridge and groove width.
    nu : float, scalar, dimensionless
        Poisson's ratio, 0 to 0.5.
    p_max : float, scalar, dimensionless
        Highest load p/E.
    edges : float, scalar, count
        Least number of the rim's edges over a ridge's width.

    Returns
    -------
    Q : ndarray of int, shape (n,)
        4, 6, ...
    p_over_E : ndarray of float, shape (n,), dimensionless
        Loads, rising.

    Raises
    ------
    InputError
        As `RimCompliance.transitions`, or if that takes over 2,500 edges within reach.
    ComputationError
        As there.

    Examples
    --------
    >>> Q, loads = small_strain_transitions(0.032, 0.01, nu=0.49, p_max=0.002)
    >>> Q.tolist(), round(float(loads[0]), 6)
    ([4], 0.000966)
    """
    reach = min(0.1 * math.ceil(10 * (float(hertz.half_width(p_max, nu=nu)) + a + 2 * b)), 0.9)
    edge = 2.0 ** math.floor(math.log2(min(a, 4 * b) / edges))  # the same for similar textures
    if reach > _MOST_EDGES * edge:
        raise InputError(
            f"a = {a!r}, b = {b!r}: {reach / edge:.2g} edges within reach; expected at most "
            f"{_MOST_EDGES}, as wider ridges or a lower load need"
        )
    return rim_compliance(nu, reach=reach, edge=edge).transitions(a, b, p_max=p_max)
