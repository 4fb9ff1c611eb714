"""A body against rigid faces: gaps of all segments, and forces of the contact pressures."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.cylinder.elimination import elimination_order
from ridgebayes.contact.cylinder.faces import Corner, Faces
from ridgebayes.contact.cylinder.solid import Solid
from ridgebayes.contact.cylinder.surface import Hits, cast, distance, kink, shapes

_MAX_AHEAD = 0.05  # over R; distance over which rays look for the body
_N_COUPLED = 3  # edges of the rim above a segment, which its pressure couples


@dataclass(frozen=True, eq=False)
class State:
    """State of a body pressed on rigid faces.

    Parameters
    ----------
    u : ndarray of float, shape (n_node, 2), over R
        Displacements.
    p : ndarray of float, shape (n_element, 3), over E
        Pressures inside.
    pressure : ndarray of float, shape (n_segment,), over E
        Contact pressure on the segments of the rigid side.
    shear : ndarray of float, shape (n_segment,), over E
        Traction on the body along the segments, in the direction of their breaks.
    rise : float, over R
        Rise of the ridges.
    """

    u: FloatArray
    p: FloatArray
    pressure: FloatArray
    shear: FloatArray
    rise: float


@dataclass(frozen=True, eq=False)
class Gaps:
    """Gaps of all segments in one state, and their derivatives.

    Parameters
    ----------
    gap : ndarray of float, shape (n_segment,), over R
        Mean over each segment; infinite if one of its rays misses the body.
    normal, along : scipy.sparse.csr_array, shape (n_segment, 2 n_node)
        Derivative of each segment's integrated gap, and of its integrated slip.
    slip : ndarray of float, shape (n_segment,), over R^2
        Integrated slip since the previous state.
    """

    gap: FloatArray
    normal: sparse.csr_array
    along: sparse.csr_array
    slip: FloatArray
    _hits: Hits
    _segment: IntArray  # of each hit
    _weight: FloatArray
    _node: IntArray  # nodes of the rim at kinks of the gap
    _kink_segment: IntArray  # segments below the kinks
    _kinks: FloatArray  # second derivatives at the kinks, shape (n, 2, 2)


class ContactProblem:
    """Body, the rigid faces under it, and its fixed displacements.

    Parameters
    ----------
    solid : Solid
        Body.
    faces : Faces
        Rigid side.
    held : ndarray of bool, shape (n_node, 2)
        Mask of displacements fixed to zero.
    friction : float, optional
        Coulomb's coefficient.
    """

    def __init__(
        self, solid: Solid, faces: Faces, held: np.ndarray, *, friction: float = 0.0
    ) -> None:
        self.solid, self.faces, self.held, self.friction = solid, faces, held, friction
        self.up: FloatArray = np.tile([0.0, 1.0], solid.n_node)
        self._rim = solid.mesh.rim

    @cached_property
    def free(self) -> IntArray:
        """Free degrees of freedom in the order of elimination."""
        n = len(self._rim) - _N_COUPLED + 1
        strips = np.stack([self._rim[i : i + n] for i in range(_N_COUPLED)], axis=1).reshape(n, -1)
        order = elimination_order([self.solid.nodes, strips], self.solid.n_node)
        dofs = np.stack([2 * order, 2 * order + 1], axis=-1).ravel()
        return np.asarray(dofs[~self.held.ravel()[dofs]])

    def unloaded(self) -> State:
        """Return the state before any contact."""
        none = np.zeros(len(self.faces))
        still = np.zeros((self.solid.n_node, 2))
        return State(still, self.solid.no_pressure(), none, none, 0.0)

    def rim(self, state: State) -> FloatArray:
        """Return the node positions of the deformed rim's edges, shape (n_edge, 3, 2)."""
        return (self.solid.points + state.u)[self._rim]

    def gaps(
        self, state: State, before: State, left_out: np.ndarray, *, ahead: float = _MAX_AHEAD
    ) -> Gaps:
        """Measure the gaps of all segments.

        Parameters
        ----------
        state : State
            Current state of the body.
        before : State
            State from which slip is measured.
        left_out : ndarray of bool, shape (n_segment,)
            Segments to ignore, whose gaps are set to infinity.
        ahead : float, optional, over R
            Distance over which rays look for the body.
        """
        rim = self.rim(state)
        rays = self.faces.rays(np.concatenate([rim[:, 0], rim[-1:, 2]]), state.rise)
        hits = cast(rim, rays.point, rays.normal, behind=rays.behind, ahead=ahead)
        n = len(self.faces)
        segment, weight = rays.segment[hits.ray], rays.weight[hits.ray]
        gap = np.bincount(segment, weight * hits.gap, n) / self.faces.length
        missing = np.bincount(segment, minlength=n) < np.bincount(rays.segment, minlength=n)
        gap[missing | left_out] = math.inf
        # The gap has a kink at the node between two edges that are met by consecutive rays.
        face = rays.face[hits.ray]
        next_edge = (np.diff(hits.edge) == 1) & (np.diff(hits.ray) == 1)
        after = np.flatnonzero(next_edge & (np.diff(face) == 0))
        edge = hits.edge[after]
        tangent, normal, per_length = self.faces.frames(rim[edge, 2], face[after], state.rise)
        jump = kink(rim, edge, tangent, normal) * per_length
        along = weight[:, None, None] * shapes(hits.s)[:, :, None] * hits.tangent[:, None, :]
        slip = np.zeros(n)
        if self.friction:
            # Movement of the body's points since the previous state, relative to the ridges.
            there = np.einsum("nk,nki->ni", shapes(hits.s), self.rim(before)[hits.edge])
            there[:, 1] += state.rise - before.rise
            moved = np.einsum("ni,ni->n", hits.tangent, rays.point[hits.ray] - there)
            slip += np.bincount(segment, weight * moved, n)
        normals = self._rows(segment, hits.edge, weight[:, None, None] * hits.gradient)
        tangents = self._rows(segment, hits.edge, along)
        kinks = jump[:, None, None] * tangent[:, :, None] * tangent[:, None, :]
        of_kinks = self._rim[edge, 2], segment[after], kinks
        return Gaps(gap, normals, tangents, slip, hits, segment, weight, *of_kinks)

    def force(self, state: State, gaps: Gaps) -> FloatArray:
        """Return the force of the rigid side on the nodes, shape (2 n_node,)."""
        return np.asarray(gaps.normal.T @ state.pressure + gaps.along.T @ state.shear)

    def load(self, state: State, gaps: Gaps) -> float:
        """Return the upward force: the line load over E R of the meshed part."""
        return float(self.force(state, gaps) @ self.up)

    def contact_stiffness(
        self, state: State, gaps: Gaps, *, share: float = 1.0
    ) -> sparse.csr_array:
        """Return the derivative of the contact force by the nodes.

        The pressures contribute the second derivative of their work, which enters the potential
        with a minus sign. A share below 1 reduces the positive part of this contribution, which
        makes the potential more convex.
        """
        on_hit, on_kink = state.pressure[gaps._segment], state.pressure[gaps._kink_segment]
        if share < 1.0:
            on_kink = on_kink * np.where(np.trace(gaps._kinks, axis1=1, axis2=2) > 0, share, 1.0)
        rubbed = state.shear[gaps._segment]
        keep, kept = np.flatnonzero((on_hit != 0) | (rubbed != 0)), np.flatnonzero(on_kink)
        hessian = (gaps._weight * on_hit)[keep, None, None] * gaps._hits.hessian[keep]
        if share < 1.0:
            value, vector = np.linalg.eigh(hessian)
            value *= np.where(value > 0, share, 1.0)
            hessian = (vector * value[:, None, :]) @ vector.transpose(0, 2, 1)
        if rubbed.any():
            hessian += (gaps._weight * rubbed)[keep, None, None] * gaps._hits.along[keep]
        dofs = self._dofs(gaps._hits.edge[keep])
        pair = np.stack([2 * gaps._node[kept], 2 * gaps._node[kept] + 1], axis=-1)
        kinks = on_kink[kept, None, None] * gaps._kinks[kept]
        rows = [np.repeat(dofs, 6, axis=1).ravel(), np.repeat(pair, 2, axis=1).ravel()]
        columns = [np.tile(dofs, (1, 6)).ravel(), np.tile(pair, (1, 2)).ravel()]
        values = np.concatenate([hessian.ravel(), kinks.ravel()])
        n, places = 2 * self.solid.n_node, (np.concatenate(rows), np.concatenate(columns))
        return sparse.csr_array((values, places), shape=(n, n))

    def corner_distance(self, state: State, corner: Corner) -> tuple[float, FloatArray]:
        """Return the distance of a corner from the body, and its derivative by the nodes."""
        at = np.array([corner.centre[0], corner.centre[1] + state.rise])
        value, edge, gradient = distance(self.rim(state), at)
        row = np.zeros(2 * self.solid.n_node)
        nodes = self._rim[edge]
        row[2 * nodes], row[2 * nodes + 1] = gradient[:, 0], gradient[:, 1]
        return value - corner.radius, row

    def _dofs(self, edge: IntArray) -> IntArray:
        nodes = self._rim[edge]
        return np.stack([2 * nodes, 2 * nodes + 1], axis=-1).reshape(-1, 6)

    def _rows(self, segment: IntArray, edge: IntArray, values: FloatArray) -> sparse.csr_array:
        places = (np.repeat(segment, 6), self._dofs(edge).ravel())
        shape = (len(self.faces), 2 * self.solid.n_node)
        return sparse.csr_array((values.ravel(), places), shape=shape)
