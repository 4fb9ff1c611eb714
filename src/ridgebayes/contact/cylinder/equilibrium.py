"""Equilibrium of a body pressed on rigid faces: Newton's method on displacements and pressures.

Contact pressure is a multiplier on each segment of the rigid side: its mean gap is zero, or its
pressure is. Which, is decided anew in each step (a primal-dual active set). The linear step condenses
multipliers with a finite stiffness; that enters the step alone, not the answer.

One more equation sets how far the ridges have risen: that rise itself, the load, or the distance
between the body and a corner. The last makes a transition a point to solve for.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.cylinder.faces import Corner, Faces
from ridgebayes.contact.cylinder.material import jacobian
from ridgebayes.contact.cylinder.solid import Assembled, InvertedError, Solid
from ridgebayes.contact.cylinder.surface import Hits, cast, distance, kink

# Stiffness of condensed segments over E per length of a segment: the error of a Newton step is
# its inverse, and the loss of digits in the linear solve its size.
_STIFF = 1e4
_MOST_STEPS = 30
_AHEAD = 0.05  # how far rays look, over R
_GAP_TOL = 1e-11  # over R; transitions shift by a part in 10^7 for it
_FORCE_TOL = 1e-9  # of the load
_VOLUME_TOL = 1e-11  # over R^2, integrated over an element
_LEAST_VOLUME = 0.05  # of a step's result, over the undeformed
_MOST_PIVOTS = 60
DBG = False


@dataclass(frozen=True, eq=False)
class State:
    """A body in equilibrium.

    Parameters
    ----------
    u : ndarray of float, shape (n_node, 2), over R
        Displacements.
    p : ndarray of float, shape (n_element, 3), over E
        Pressures.
    pressure : ndarray of float, shape (n_segment,), over E
        Contact pressure on the segments of the rigid side.
    shear : ndarray of float, shape (n_segment,), over E
        Traction on the body along the segments; zero without friction.
    rise : float, over R
        Of the ridges.
    """

    u: FloatArray
    p: FloatArray
    pressure: FloatArray
    shear: FloatArray
    rise: float


class NotConvergedError(Exception):
    """No equilibrium was found; its message says why."""


@dataclass(frozen=True, eq=False)
class Contact:
    """Gaps of all segments in one state, and what they do to the nodes."""

    hits: Hits
    segment: IntArray  # of each hit
    weight: FloatArray
    gap: FloatArray  # mean over each segment; infinite where a ray misses
    matrix: sparse.csr_array  # derivative of each segment's integrated gap by the nodes
    node: IntArray  # of the rim at kinks of the gap,
    kink_segment: IntArray  # the segments they lie over,
    kinks: FloatArray  # and their part of the second derivative, shape (n, 2, 2)


class Press:
    """A body on rigid faces, held at some nodes.

    Parameters
    ----------
    solid : Solid
        The body.
    faces : Faces
        The rigid side.
    held : ndarray of bool, shape (n_node, 2)
        Displacements that are zero.
    """

    def __init__(self, solid: Solid, faces: Faces, held: np.ndarray) -> None:
        self.solid, self.faces = solid, faces
        self._free = np.flatnonzero(~held.ravel())
        self._rim = solid.mesh.rim
        self._up = np.tile([0.0, 1.0], solid.n_node)

    def unloaded(self) -> State:
        """Return the state before any contact."""
        n = len(self.faces)
        zero = np.zeros(n)
        return State(
            np.zeros((self.solid.n_node, 2)), self.solid.no_pressure(), zero, zero, 0.0
        )

    def rim(self, state: State) -> FloatArray:
        """Return the deformed rim's nodes as the risen ridges see them, (n_edge, 3, 2)."""
        return (self.solid.points + state.u)[self._rim]

    def contact(self, state: State, left_out: np.ndarray | None = None) -> Contact:
        """Measure the gaps of all segments; of those left out they are infinite."""
        rim = self.rim(state)
        rays = self.faces.rays(np.concatenate([rim[:, 0], rim[-1:, 2]]), state.rise)
        hits = cast(rim, rays.point, rays.normal, behind=rays.behind, ahead=_AHEAD)
        n = len(self.faces)
        segment, weight = rays.segment[hits.ray], rays.weight[hits.ray]
        missing = np.bincount(segment, minlength=n) < np.bincount(rays.segment, minlength=n)
        gap = np.bincount(segment, weight * hits.gap, n) / self.faces.length
        gap[missing] = math.inf
        if left_out is not None:
            gap[left_out] = math.inf
        dofs = self._dofs(hits.edge)
        values = weight[:, None] * hits.gradient.reshape(-1, 6)
        rows = np.repeat(segment, 6)
        shape = (n, 2 * self.solid.n_node)
        matrix = sparse.csr_array((values.ravel(), (rows, dofs.ravel())), shape=shape)
        # Where the next ray meets the next edge, the gap has a kink at the node between them.
        after = np.flatnonzero(
            (np.diff(hits.edge) == 1)
            & (np.diff(hits.ray) == 1)
            & (np.diff(rays.face[hits.ray]) == 0)
        )
        edge = hits.edge[after]
        tangent, face = hits.tangent[after], rays.face[hits.ray[after]]
        normal = rays.normal[hits.ray[after]]
        apart = np.where(self.faces.radius[face] > 0, self.faces.radius[face], 1.0)
        at = self.rim(state)[edge, 2]
        for i in np.flatnonzero(self.faces.radius[face] > 0):
            one = self.faces.faces[face[i]]
            out = at[i] - one.origin - [0.0, state.rise * one.rises]
            apart[i] = one.radius / np.hypot(*out)
            normal[i] = out / np.hypot(*out)
            tangent[i] = normal[i, 1], -normal[i, 0]
        jump = kink(rim, edge, tangent, normal) * apart
        kinks = jump[:, None, None] * tangent[:, :, None] * tangent[:, None, :]
        return Contact(
            hits, segment, weight, gap, matrix, self._rim[edge, 2], segment[after], kinks
        )

    def load(self, state: State) -> float:
        """Return the line load over E R of what is meshed: the ridges' force upwards."""
        return self.force(state, self.contact(state))

    def force(self, state: State, found: Contact) -> float:
        """Return the same from gaps already measured."""
        return float((found.matrix.T @ (self.faces.rises * state.pressure)) @ self._up)

    def _dofs(self, edge: IntArray) -> IntArray:
        nodes = self._rim[edge]
        return np.stack([2 * nodes, 2 * nodes + 1], axis=-1).reshape(-1, 6)

    def solve(self, start: State, control: "Control") -> tuple[State, int]:
        """Find the equilibrium in which the control is met.

        Parameters
        ----------
        start : State
            Where to begin.
        control : Control
            The equation for the rise.

        Returns
        -------
        State, int
            And the number of Newton steps.

        Raises
        ------
        NotConvergedError
            If none was found.
        """
        left_out = control.left_out(self.faces)
        state = replace(start, pressure=np.where(left_out, 0.0, start.pressure))
        active, last, part = state.pressure > 0, math.inf, 1.0
        for step in range(_MOST_STEPS):
            try:
                found = self.contact(state, left_out)
                inner = self.solid.assemble(state.u, state.p)
            except InvertedError as inverted:
                raise NotConvergedError(str(inverted)) from None
            error = self._error(state, found, inner, control)
            if DBG:
                print("    ", step, f"{error:.3g}", int(active.sum()))
            if error < 1.0:
                return state, step
            linear = _LinearStep(self, state, found, inner, active, control)
            moved, active = linear.solve()
            if not np.isfinite(moved.u).all():
                raise NotConvergedError("singular stiffness")
            # A node of the rim on its way past a corner may throw full steps to and fro.
            part = 1.0 if step < 4 or error < 0.3 * last else max(0.5 * part, 0.2)
            last = error
            state = self._guarded(state, moved, part)
        raise NotConvergedError(f"no equilibrium in {_MOST_STEPS} Newton steps")

    def _error(
        self, state: State, found: Contact, inner: Assembled, control: "Control"
    ) -> float:
        """Return the largest residual over its tolerance."""
        outside = found.matrix.T @ state.pressure
        residual = (inner.force.ravel() - outside)[self._free]
        total = max(float(np.abs(outside).sum()), 1e-12)
        gap = np.where(state.pressure > 0, found.gap, np.minimum(found.gap, 0.0))
        return max(
            float(np.abs(residual).max()) / (_FORCE_TOL * total),
            float(np.abs(gap).max()) / _GAP_TOL,
            float(np.abs(inner.volume).max()) / _VOLUME_TOL,
            control.error(self, state, found),
        )

    def _guarded(self, state: State, moved: State, part: float) -> State:
        """Take a part of a step, less of it if elements would be turned inside out."""
        for _ in range(6):
            if part == 1.0:
                found = moved
            else:
                found = State(
                    *(
                        (1 - part) * getattr(state, one.name) + part * getattr(moved, one.name)
                        for one in fields(State)
                    )
                )
            if not self.solid.material.finite:
                return found
            if jacobian(self.solid.gradients(found.u)).min() > _LEAST_VOLUME:
                return found
            part *= 0.5
        raise NotConvergedError("an element is turned inside out")

    def bending(
        self, state: State, found: Contact, *, rising: bool = False
    ) -> sparse.csr_array:
        """Return the second derivative of the pressures' work, of all faces or those that rise."""
        pressure = state.pressure * self.faces.rises if rising else state.pressure
        on_hit, on_kink = pressure[found.segment], pressure[found.kink_segment]
        keep, kept = np.flatnonzero(on_hit), np.flatnonzero(on_kink)
        hessian = (found.weight * on_hit)[keep, None, None] * found.hits.hessian[keep]
        dofs = self._dofs(found.hits.edge[keep])
        pair = np.stack([2 * found.node[kept], 2 * found.node[kept] + 1], axis=-1)
        kinks = on_kink[kept, None, None] * found.kinks[kept]
        rows = [np.repeat(dofs, 6, axis=1).ravel(), np.repeat(pair, 2, axis=1).ravel()]
        columns = [np.tile(dofs, (1, 6)).ravel(), np.tile(pair, (1, 2)).ravel()]
        values = np.concatenate([hessian.ravel(), kinks.ravel()])
        n = 2 * self.solid.n_node
        places = (np.concatenate(rows), np.concatenate(columns))
        return sparse.csr_array((values, places), shape=(n, n))


class _LinearStep:
    """One Newton step: a linear complementarity problem for the segments' pressures.

    The stiffness is factorised once, with the segments in contact condensed; others that enter or
    leave are rank-one changes of it.
    """

    def __init__(
        self,
        press: Press,
        state: State,
        found: Contact,
        inner: Assembled,
        active: np.ndarray,
        control: "Control",
    ) -> None:
        self.press, self.state, self.found, self.inner = press, state, found, inner
        faces = press.faces
        self.candidate = np.isfinite(found.gap)
        active = active & self.candidate
        self.reference = active.copy()
        self.C = found.matrix
        self.missing = np.where(self.candidate, found.gap, 0.0) * faces.length
        self.scale = _STIFF / faces.length**2
        up = press._up
        bending = press.bending(state, found)
        chosen = np.flatnonzero(active)
        Ca = self.C[chosen]
        K = inner.stiffness - bending + Ca.T @ sparse.diags_array(self.scale[chosen]) @ Ca
        self.free = press._free
        self.factor = splu(
            sparse.csc_array(K)[self.free][:, self.free],
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
        )
        # Rising ridges are the whole rim sinking, for those segments that rise.
        self.lift = -(faces.rises * (self.C @ up))
        self.bent = np.asarray(press.bending(state, found, rising=True) @ up)
        # force + condensed + K du - C^T pressure_new ... = 0; what does not depend on the set:
        self.rest = inner.force.ravel() + inner.condensed.ravel()
        self.columns: dict[int, FloatArray] = {}
        self.control, self.up = control, up
        self.base = self._solve(-self.rest)
        self.base_rise = self._solve(-self.bent)

    def _solve(self, right: FloatArray) -> FloatArray:
        found = np.zeros(len(right))
        found[self.free] = self.factor.solve(right[self.free])
        return found

    def _column(self, j: int) -> FloatArray:
        if j not in self.columns:
            self.columns[j] = self._solve(self.C[[j]].toarray().ravel())
        return self.columns[j]

    def solve(self) -> tuple[State, np.ndarray]:
        """Return the state after the step, and which segments are in contact then."""
        active = self.reference.copy()
        fewest, patience = len(active) + 1, 5
        for _ in range(_MOST_PIVOTS):
            du, rise, pressure, gap = self._of(active)
            tiny = 1e-9 * np.abs(pressure).max(initial=0.0)
            wrong = (active & (pressure < -tiny)) | (
                self.candidate & ~active & (gap < -1e-13)
            )
            n = int(wrong.sum())
            if n == 0:
                break
            if n < fewest:
                fewest, patience = n, 5
                flip = wrong
            elif patience > 0:
                patience -= 1
                flip = wrong
            else:  # one by one, which ends
                flip = np.zeros_like(wrong)
                flip[np.flatnonzero(wrong)[-1]] = True
            active = active ^ flip
        else:
            raise NotConvergedError("no set of segments in contact fits")
        state = self.state
        dp = self.inner.pressure_step(du, self.press.solid.dofs)
        moved = State(
            state.u + du.reshape(-1, 2),
            state.p + dp,
            np.where(active, np.maximum(pressure, 0.0), 0.0),
            state.shear,
            state.rise + rise,
        )
        return moved, active

    def _of(self, active: np.ndarray) -> tuple[FloatArray, float, FloatArray, FloatArray]:
        """Return the step with the given segments in contact: du, rise, pressures and gaps."""
        changed = np.flatnonzero(active ^ self.reference)
        chosen = np.flatnonzero(active)
        Ca, scale = self.C[chosen], self.scale[chosen]
        old = self.state.pressure[chosen]
        push = Ca.T @ (old - scale * self.missing[chosen])
        lifted = Ca.T @ (scale * self.lift[chosen])
        first = self.base + self._solve(push)
        second = self.base_rise - self._solve(lifted)
        if len(changed):
            sign = np.where(active[changed], 1.0, -1.0) / self.scale[changed]
            Z = np.column_stack([self._column(int(j)) for j in changed])
            U = self.C[changed]
            middle = np.diag(sign) + U @ Z
            first = first - Z @ np.linalg.solve(middle, U @ first)
            second = second - Z @ np.linalg.solve(middle, U @ second)
        rise = self._rise(first, second, chosen)
        du = first + rise * second
        moved = self.missing + self.C @ du + rise * self.lift
        pressure = np.zeros(len(active))
        pressure[chosen] = old - scale * moved[chosen]
        return du, rise, pressure, moved / self.press.faces.length

    def _rise(self, first: FloatArray, second: FloatArray, chosen: np.ndarray) -> float:
        """Return the rise with which the control is met, du being first + rise second."""
        control, press, state = self.control, self.press, self.state
        if control.kind == "load":
            # The load is the force of what rises, along the rise: minus lift . pressure.
            on = -self.lift[chosen]
            scale, old = self.scale[chosen], state.pressure[chosen]
            Ca, lift = self.C[chosen], self.lift[chosen]
            now = on @ (old - scale * (self.missing[chosen] + Ca @ first)) + self.bent @ first
            slope = -on @ (scale * (Ca @ second + lift)) + self.bent @ second
            slope -= float(self.bent @ self.up)
            return float((control.target - now) / slope)
        missing, row, by_rise = control.row(press, state)
        return float((missing - row @ first) / (row @ second + by_rise))


@dataclass(frozen=True)
class Control:
    """The equation that the rise of the ridges solves.

    Parameters
    ----------
    kind : {"rise", "load", "corner"}
        What is given.
    target : float
        The rise over R, the line load over E R of what is meshed, or the distance of the corner.
    corner : Corner or None
        Of "corner".
    """

    kind: str
    target: float
    corner: Corner | None = None

    def left_out(self, faces: Faces) -> np.ndarray:
        """Return the segments that carry nothing: those of the ridge about to be reached."""
        if self.corner is None:
            return np.zeros(len(faces), dtype=bool)
        return faces.of_ridge(self.corner.ridge)

    def error(self, press: Press, state: State, found: Contact) -> float:
        """Return what is missing over its tolerance."""
        if self.kind == "load":
            now = press.force(state, found)
            return abs(self.target - now) / (_FORCE_TOL * abs(self.target) + 1e-300)
        return abs(self.row(press, state)[0]) / _GAP_TOL

    def row(self, press: Press, state: State) -> tuple[float, FloatArray, float]:
        """Return what is missing, and the derivatives by displacements and rise."""
        row = np.zeros(2 * press.solid.n_node)
        if self.corner is None:
            return self.target - state.rise, row, 1.0
        value, edge, gradient = corner_distance(press, state, self.corner)
        nodes = press._rim[edge]
        row[2 * nodes], row[2 * nodes + 1] = gradient[:, 0], gradient[:, 1]
        return self.target - value, row, -float(gradient[:, 1].sum())


def corner_distance(press: Press, state: State, corner: Corner) -> tuple[float, int, FloatArray]:
    """Return the distance of a corner from the body, the rim's edge, and the derivative."""
    at = np.array(corner.centre) + [0.0, state.rise]
    value, edge, gradient = distance(press.rim(state), at)
    return value - corner.radius, edge, gradient
