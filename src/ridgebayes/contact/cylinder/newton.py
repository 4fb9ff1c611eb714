"""Equilibrium of a body pressed on rigid faces, by Newton's method on all unknowns at once.

On each segment of the rigid side the mean gap is zero, or the pressure is; with friction the slip
is zero, or the shear is the friction's. Each step solves the linear complementarity problem for the
pressures. Multipliers are condensed with a finite stiffness that enters the steps alone, not the
answer.

One more equation sets how far the ridges rise: that rise itself, the load, or the distance between
the body and a corner. The last makes a transition a point to solve for.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np
import scipy.sparse as sparse

from ridgebayes._types import FloatArray
from ridgebayes.contact.cylinder.contact_problem import ContactProblem, Gaps, State
from ridgebayes.contact.cylinder.elimination import factorise
from ridgebayes.contact.cylinder.faces import Corner, Faces
from ridgebayes.contact.cylinder.line_search import best_part
from ridgebayes.contact.cylinder.material import jacobian
from ridgebayes.contact.cylinder.solid import Assembled, InvertedError

# Stiffness of condensed multipliers, in E per length of a segment: its inverse is the error of a
# step, its size times rounding that of the linear solve.
_STIFF = 1e4
_MOST_STEPS, _FRICTION_STEPS = 30, 15  # and pivots of a step; with friction segments change kind
_PATIENCE = 6  # steps or pivots in which all that are wrong change; then one at a time
# Shares of the part that contact takes from the stiffness: at 0.9 most bodies between two places on
# a corner are stable, and soft directions keep most of their length; at 0 they do not.
_SHARES = (1.0, 0.9, 0.0)
# Over R; and over R^2, of an element's volume: the first transition moves by 2e-8 of its load.
_GAP_TOL = 1e-11
_FORCE_TOL = 1e-9  # of the load; and of the friction, by which a shear has to differ from it
_NEAR = 1e3  # tolerances: nearer to equilibrium, a part in 10^6 of the load, steps need no search
_LEAST_VOLUME = 0.05  # of an element after a step, over the undeformed
_WHOLLY = 0.9  # of the friction, in one direction: the body slides


class NotConvergedError(Exception):
    """No equilibrium was found; its message says why."""


class OutOfStepsError(NotConvergedError):
    """None was found in all of Newton's steps: the dearest way to fail."""


@dataclass(frozen=True)
class Control:
    """The equation that the rise of the ridges solves.

    Parameters
    ----------
    kind : {"rise", "load", "corner"}
        Quantity that is given.
    target : float
        The rise over R, the line load over E R of what is meshed, or the distance of the corner.
    corner : Corner or None
        Corner of kind "corner".
    """

    kind: str
    target: float
    corner: Corner | None = None

    def left_out(self, faces: Faces) -> np.ndarray:
        """Return the segments that carry nothing: those of the ridge about to be reached."""
        if self.corner is None:
            return np.zeros(len(faces), dtype=bool)
        return faces.of_ridge(self.corner.ridge)

    def missing(self, problem: ContactProblem, state: State, gaps: Gaps) -> float:
        """Return target minus value."""
        if self.corner is not None:
            return self.target - problem.corner_distance(state, self.corner)[0]
        return self.target - (problem.load(state, gaps) if self.kind == "load" else state.rise)

    @property
    def tolerance(self) -> float:
        """How little may be missing."""
        return _FORCE_TOL * abs(self.target) if self.kind == "load" else _GAP_TOL


def solve(
    problem: ContactProblem, start: State, control: Control, *, enough: float = 1.0
) -> tuple[State, int]:
    """Find the equilibrium in which the control is met.

    Parameters
    ----------
    problem : ContactProblem
        Body and rigid side.
    start : State
        State to start from, and from which slip is counted.
    control : Control
        The equation for the rise.
    enough : float, optional
        Tolerances by which the state may be off.

    Returns
    -------
    State, int
        Equilibrium, and number of Newton steps.

    Raises
    ------
    NotConvergedError
        If none was found.
    """
    left_out = control.left_out(problem.faces)
    state = replace(start, pressure=np.where(left_out, 0.0, start.pressure))
    active = state.pressure > 0
    more = _FRICTION_STEPS if problem.friction else 0
    kind, settled = _sliding(problem, start), True
    for step in range(_MOST_STEPS + more):
        gaps = problem.gaps(state, start, left_out)
        if step == 0 and not active.any():
            active = _nearest(gaps)
        try:
            inner = problem.solid.assemble(state.u, state.p)
        except InvertedError as inverted:
            raise NotConvergedError(str(inverted)) from None
        if problem.friction and step:
            before = kind
            kind = _changed(problem, state, gaps, kind, one_by_one=step >= _PATIENCE)
            settled = np.array_equal(kind, before)
        newton = NewtonStep(problem, control, state, gaps, inner, kind)
        error = newton.error()
        if error < enough and settled:
            return state, step
        moved, active = newton.solve(active)
        if not (np.isfinite(moved.u).all() and math.isfinite(moved.rise)):
            raise NotConvergedError("the stiffness is singular")
        # The first step changes the control, by work of its own.
        if step and error > _NEAR:
            moved = _searched(problem, start, left_out, state, moved)
        state = _guarded(problem, state, moved)
    raise OutOfStepsError(f"no equilibrium in {_MOST_STEPS + more} Newton steps")


def _searched(
    problem: ContactProblem, start: State, left_out: np.ndarray, state: State, moved: State
) -> State:
    """Return the state a part of the way to another, or beyond it.

    The potential is that of the other's pressures and shear: under them the step leads down. A
    small part of the way takes as little of their change, which is as far too long as the step.
    """
    du, free = (moved.u - state.u).ravel()[problem.free], problem.free

    def along(part: float) -> State:
        u = state.u + part * (moved.u - state.u)
        return replace(moved, u=u, rise=state.rise + part * (moved.rise - state.rise))

    def slope(part: float) -> float:
        there = along(part)
        if not _least_volume(problem, there) > _LEAST_VOLUME:
            return math.inf
        outside = problem.force(there, problem.gaps(there, start, left_out))
        inside = problem.solid.force(there.u, there.p).ravel()
        return float(du @ (inside - outside)[free])

    part = best_part(slope)
    if not part:
        raise NotConvergedError("a step leads into no valley of the potential")
    return moved if part == 1.0 else along(part) if part > 1 else _between(state, moved, part)


def _nearest(gaps: Gaps) -> np.ndarray:
    """Return the segments that touch first: nothing else holds a loose body."""
    return np.asarray(np.isfinite(gaps.gap) & (gaps.gap <= gaps.gap.min() + _GAP_TOL))


def _sliding(problem: ContactProblem, start: State) -> FloatArray:
    """Return which segments slide at first: those that did, where the body slides as a whole."""
    length = problem.faces.length
    limit = problem.friction * start.pressure
    if abs(start.shear @ length) <= _WHOLLY * (limit @ length):
        return np.zeros(len(length))
    return np.where(np.abs(start.shear) >= limit * (1 - _FORCE_TOL), np.sign(start.shear), 0.0)


def _changed(
    problem: ContactProblem, state: State, gaps: Gaps, kind: FloatArray, *, one_by_one: bool
) -> FloatArray:
    """Return which segments stick, 0, or slide, with the sign of their shear.

    Sticking segments slide beyond the friction; segments that slide against their shear stop.
    """
    limit = problem.friction * state.pressure
    excess = np.abs(state.shear) - limit * (1 + _FORCE_TOL)
    along = kind * gaps.slip / problem.faces.length
    slides = (kind == 0) & (excess > 0)
    stops = (kind != 0) & (along > _GAP_TOL)
    on = state.pressure > 0
    fresh = np.where(slides, np.sign(state.shear), np.where(stops, 0.0, kind)) * on
    wrong = np.flatnonzero((fresh != kind) & on)
    if one_by_one and len(wrong):
        by = np.where(slides, excess / np.maximum(limit, 1e-300), along / problem.faces.length)
        fresh = np.where(np.arange(len(kind)) == wrong[np.argmax(by[wrong])], fresh, kind * on)
    return fresh


def _guarded(problem: ContactProblem, state: State, moved: State) -> State:
    """Take a step, or the part of it that turns no element inside out."""
    part, tried = 1.0, moved
    for _ in range(6):
        if _least_volume(problem, tried) > _LEAST_VOLUME:
            return tried
        part *= 0.5
        tried = _between(state, moved, part)
    raise NotConvergedError("an element is turned inside out")


def _between(state: State, other: State, part: float) -> State:
    """Return the state a part of the way from one to another."""
    names = (field.name for field in fields(State))
    return State(*((1 - part) * getattr(state, n) + part * getattr(other, n) for n in names))


def _least_volume(problem: ContactProblem, state: State) -> float:
    """Return the least volume over the undeformed one."""
    return float(jacobian(problem.solid.gradients(state.u)).min())


@dataclass(eq=False)
class NewtonStep:
    """One Newton step: a linear complementarity problem for the segments' pressures.

    The stiffness is factorised once, with the segments in contact condensed; others that enter or
    leave are rank-one changes of it.
    """

    problem: ContactProblem
    control: Control
    state: State
    gaps: Gaps
    inner: Assembled
    kind: FloatArray  # of each segment: 0 sticks, the sign of its shear slides

    def error(self) -> float:
        """Return the largest residual over its tolerance."""
        problem, state, gaps, kind = self.problem, self.state, self.gaps, self.kind
        outside = problem.force(state, gaps)
        residual = (self.inner.force.ravel() - outside)[problem.free]
        force_tol = _FORCE_TOL * max(float(np.abs(outside).sum()), 1e-12)
        on = state.pressure > 0
        parts: list[tuple[FloatArray | float, float]] = [
            (residual, force_tol),
            (np.where(on, gaps.gap, np.minimum(gaps.gap, 0.0)), _GAP_TOL),
            (self.inner.volume, _GAP_TOL),
            (self.control.missing(problem, state, gaps), max(self.control.tolerance, 1e-300)),
        ]
        if problem.friction:
            length = problem.faces.length
            off = np.where(kind == 0, 0.0, state.shear - kind * problem.friction * state.pressure)
            parts.append((np.where(on & (kind == 0), gaps.slip, 0.0) / length, _GAP_TOL))
            parts.append((off * length, force_tol))
        return max(float(np.abs(part).max()) / tolerance for part, tolerance in parts)

    def _factorise(self, active: np.ndarray, *, share: float) -> None:
        """Condense the segments in contact into the stiffness, and solve for what never changes."""
        problem, gaps, inner = self.problem, self.gaps, self.inner
        length = problem.faces.length
        self._candidate = np.isfinite(gaps.gap)
        self._reference = active & self._candidate
        self._gap = np.where(self._candidate, gaps.gap, 0.0) * length
        self._scale = _STIFF / length**2
        self._C = gaps.normal
        # Rising ridges are the whole rim sinking.
        self._lift = -(self._C @ problem.up)
        self._slip_lift = -(gaps.along @ problem.up)
        bending = problem.contact_stiffness(self.state, gaps, share=share)
        self._bent, self._carried = bending @ problem.up, bending.T @ problem.up
        K = inner.stiffness - bending
        Ca, scale = self._C[self._reference], self._scale[self._reference]
        K = K + Ca.T @ sparse.diags_array(scale) @ Ca
        rest = -(inner.force.ravel() + inner.condensed.ravel())
        by_rise = self._bent
        if problem.friction:
            stiffness, force, rubbed = self._rubbing()
            K, rest, by_rise = K + stiffness, rest + force, by_rise + rubbed
        try:
            self._factor = factorise(K, problem.free, pivoting=problem.friction > 0)
        except RuntimeError:  # as SuperLU has it where a pivot is exactly zero
            raise NotConvergedError("the stiffness is singular") from None
        self._columns: dict[int, FloatArray] = {}
        self._still, self._risen = self._solved(np.stack([rest, -by_rise]))

    def _rubbing(self) -> tuple[sparse.csr_array, FloatArray, FloatArray]:
        """Return friction's stiffness, its force on the nodes, and that by the rise."""
        problem, state, gaps = self.problem, self.state, self.gaps
        kind, scale, on = self.kind, self._scale, self._reference
        stuck, slid = np.flatnonzero(on & (kind == 0)), np.flatnonzero(on & (kind != 0))
        T, Ts = gaps.along[stuck], gaps.along[slid]
        lift = self._slip_lift
        stiffness = T.T @ sparse.diags_array(scale[stuck]) @ T
        shear = state.shear[stuck] - scale[stuck] * gaps.slip[stuck]
        by_rise = T.T @ (scale[stuck] * lift[stuck])
        rate = problem.friction * kind[slid]
        Cs, normal = self._C[slid], self._scale[slid]
        stiffness = stiffness + Ts.T @ sparse.diags_array(rate * normal) @ Cs
        pressed = rate * (state.pressure[slid] - normal * self._gap[slid])
        by_rise = by_rise + Ts.T @ (rate * normal * self._lift[slid])
        return stiffness, np.asarray(T.T @ shear + Ts.T @ pressed), np.asarray(by_rise)

    def solve(self, active: np.ndarray) -> tuple[State, np.ndarray]:
        """Return the state after the step, and which segments are in contact then.

        Block principal pivoting: all that are wrong change sides, and one at a time where that
        does not lead on. Far from equilibrium there may be no such set; then the best one serves.
        """
        # Where the potential curves down a full step leads up. With friction there is none.
        for share in _SHARES:
            self._factorise(active, share=share)
            if self.problem.friction or not (self._factor.U.diagonal() < 0).any():
                break
        problem, state = self.problem, self.state
        active = best = self._reference.copy()
        fewest, patience = len(active) + 1, _PATIENCE
        for _ in range(_MOST_STEPS):
            du, rise, pressure, gap = self._of(active)
            tiny = 1e-9 * np.abs(pressure).max(initial=0.0)
            leaving = active & (pressure < -tiny)
            wrong = leaving | (self._candidate & ~active & (gap < -1e-13))
            n = int(wrong.sum())
            if n < fewest:
                fewest, patience, best = n, _PATIENCE, active
            else:
                patience -= 1
            if n == 0:
                break
            if patience < 0:
                wrong[: np.flatnonzero(wrong)[-1]] = False
            active = active ^ wrong
        else:
            du, rise, pressure, _ = self._of(best)
        pressure, shear = np.maximum(pressure, 0.0), np.zeros_like(pressure)
        if problem.friction:
            slip = self.gaps.slip + self.gaps.along @ du + rise * self._slip_lift
            stuck, slid = state.shear - self._scale * slip, self.kind * problem.friction * pressure
            shear = np.where(best & self._reference, np.where(self.kind == 0, stuck, slid), 0.0)
        p = state.p + self.inner.pressure_step(du, problem.solid.dofs)
        return State(state.u + du.reshape(-1, 2), p, pressure, shear, state.rise + rise), best

    def _of(self, active: np.ndarray) -> tuple[FloatArray, float, FloatArray, FloatArray]:
        """Return the step with the given segments in contact: du, rise, pressures and gaps."""
        changed = np.flatnonzero(active ^ self._reference)
        on = np.flatnonzero(active)
        C, scale, lift = self._C[on], self._scale[on], self._lift[on]
        old = self.state.pressure[on]
        sides = np.stack([old - scale * self._gap[on], scale * lift])
        pressed, lifted = self._solved(sides @ C)
        first, second = self._still + pressed, self._risen - lifted
        if len(changed):
            sign = np.where(active[changed], 1.0, -1.0) / self._scale[changed]
            Z = np.column_stack([self._column(int(j)) for j in changed])
            U = self._C[changed]
            middle = np.diag(sign) + U @ Z
            first = first - Z @ np.linalg.solve(middle, U @ first)
            second = second - Z @ np.linalg.solve(middle, U @ second)
        rise = self._rise(first, second, on)
        du = first + rise * second
        moved = self._gap + self._C @ du + rise * self._lift
        pressure = np.zeros(len(active))
        pressure[on] = old - scale * moved[on]
        return du, rise, pressure, moved / self.problem.faces.length

    def _rise(self, first: FloatArray, second: FloatArray, on: np.ndarray) -> float:
        """Return the rise with which the control is met, du being first + rise second."""
        control, problem, state = self.control, self.problem, self.state
        if control.corner is not None:
            value, row = problem.corner_distance(state, control.corner)
            slope = row @ second - row @ problem.up
            return float((control.target - value - row @ first) / slope)
        if control.kind == "rise":
            return control.target - state.rise
        # The load is the force of what rises, along the rise: minus lift . pressure.
        C, scale, lift = self._C[on], self._scale[on], self._lift[on]
        pressure = state.pressure[on] - scale * (self._gap[on] + C @ first)
        rubbing = problem.up @ (self.gaps.along.T @ state.shear)
        now = -lift @ pressure + self._carried @ first + rubbing
        slope = lift @ (scale * (C @ second + lift)) + self._carried @ (second - problem.up)
        return float((control.target - now) / slope)

    def _solved(self, right: FloatArray) -> FloatArray:
        solved = np.zeros_like(right)
        solved[..., self.problem.free] = self._factor.solve(right[..., self.problem.free].T).T
        return solved

    def _column(self, j: int) -> FloatArray:
        if j not in self._columns:
            self._columns[j] = self._solved(self._C[[j]].toarray().ravel())
        return self._columns[j]
