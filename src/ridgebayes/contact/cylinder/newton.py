"""Equilibrium of a body pressed on rigid faces, by Newton's method for all unknowns at once.

On each segment of the rigid side either the mean gap or the pressure is zero. With friction, either
the slip is zero or the shear equals the friction. Each step solves a linear complementarity problem
for the pressures. Contact constraints are condensed with a finite stiffness, which affects the
steps but not the solution.

One more equation determines the rise of the ridges: the rise itself, the load, or the distance
between the body and a corner is given. The last makes a transition a point to solve for.
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

# Stiffness of condensed constraints, in E per length of a segment. Its inverse is the error of a
# step; its product with the rounding error is the error of the linear solution.
_PENALTY = 1e4
_MAX_STEPS, _FRICTION_STEPS = 30, 15  # also pivots of a step; with friction segments change kind
_PATIENCE = 6  # steps or pivots in which all wrong segments change; then one at a time
# Shares of the destabilising part of the contact stiffness. With 0.9 most bodies between two places
# on a corner are stable, and soft directions keep most of their step; with 0 they do not.
_CONTACT_SHARES = (1.0, 0.9, 0.0)
# Over R, and over R^2 for an element's volume; it moves the first transition by 2e-8 of its load.
_GAP_TOL = 1e-11
_FORCE_TOL = 1e-9  # of the load; also of the friction, for the shear of sliding segments
_NEAR_TOLERANCES = 1e3  # errors below it, a part in 10^6 of the load, need no line search
_MIN_VOLUME = 0.05  # of an element after a step, over its undeformed volume
_SLIDING_SHARE = 0.9  # of the friction, in one direction, above which the whole body slides


class NotConvergedError(Exception):
    """Raised if no equilibrium is found; the message gives the reason."""


class OutOfStepsError(NotConvergedError):
    """Raised if no equilibrium is found in the maximum number of Newton steps, at full cost."""


@dataclass(frozen=True)
class Control:
    """Equation that determines the rise of the ridges.

    Parameters
    ----------
    kind : {"rise", "load", "corner"}
        Given quantity.
    target : float
        Rise over R, line load over E R of the meshed part, or distance of the corner.
    corner : Corner or None
        Corner of kind "corner".
    """

    kind: str
    target: float
    corner: Corner | None = None

    def left_out(self, faces: Faces) -> np.ndarray:
        """Return a mask of segments without contact: those of the ridge about to be reached."""
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
        """Tolerance of the difference from the target."""
        return _FORCE_TOL * abs(self.target) if self.kind == "load" else _GAP_TOL


def solve(
    problem: ContactProblem, start: State, control: Control, *, enough: float = 1.0
) -> tuple[State, int]:
    """Find the equilibrium that satisfies a control equation.

    Parameters
    ----------
    problem : ContactProblem
        Body and rigid side.
    start : State
        Initial state, from which slip is measured.
    control : Control
        Equation for the rise.
    enough : float, optional
        Largest error, in tolerances.

    Returns
    -------
    State, int
        Equilibrium, and number of Newton steps.

    Raises
    ------
    NotConvergedError
        If no equilibrium is found.
    """
    left_out = control.left_out(problem.faces)
    state = replace(start, pressure=np.where(left_out, 0.0, start.pressure))
    active = state.pressure > 0
    more = _FRICTION_STEPS if problem.friction else 0
    kind, settled = _initial_kinds(problem, start), True
    for step in range(_MAX_STEPS + more):
        gaps = problem.gaps(state, start, left_out)
        if step == 0 and not active.any():
            active = _first_touching(gaps)
        try:
            inner = problem.solid.assemble(state.u, state.p)
        except InvertedError as inverted:
            raise NotConvergedError(str(inverted)) from None
        if problem.friction and step:
            before = kind
            kind = _updated_kinds(problem, state, gaps, kind, one_by_one=step >= _PATIENCE)
            settled = np.array_equal(kind, before)
        newton = NewtonStep(problem, control, state, gaps, inner, kind)
        error = newton.error()
        if error < enough and settled:
            return state, step
        moved, active = newton.solve(active)
        if not (np.isfinite(moved.u).all() and math.isfinite(moved.rise)):
            raise NotConvergedError("the stiffness is singular")
        # The first step changes the controlled quantity, which does external work.
        if step and error > _NEAR_TOLERANCES:
            moved = _line_searched(problem, start, left_out, state, moved)
        state = _limited_step(problem, state, moved)
    raise OutOfStepsError(f"no equilibrium in {_MAX_STEPS + more} Newton steps")


def _line_searched(
    problem: ContactProblem, start: State, left_out: np.ndarray, state: State, moved: State
) -> State:
    """Return the state at the best part of a step, found by a line search.

    The potential uses the pressures and shear after the step, for which the step is a descent
    direction. A short step takes only its part of their change.
    """
    du, free = (moved.u - state.u).ravel()[problem.free], problem.free

    def along(part: float) -> State:
        u = state.u + part * (moved.u - state.u)
        return replace(moved, u=u, rise=state.rise + part * (moved.rise - state.rise))

    def slope(part: float) -> float:
        there = along(part)
        if not _least_volume(problem, there) > _MIN_VOLUME:
            return math.inf
        outside = problem.force(there, problem.gaps(there, start, left_out))
        inside = problem.solid.force(there.u, there.p).ravel()
        return float(du @ (inside - outside)[free])

    part = best_part(slope)
    if not part:
        raise NotConvergedError("a step leads into no valley of the potential")
    return moved if part == 1.0 else along(part) if part > 1 else _interpolated(state, moved, part)


def _first_touching(gaps: Gaps) -> np.ndarray:
    """Return the segments that touch first, as nothing else holds a body without contact."""
    return np.asarray(np.isfinite(gaps.gap) & (gaps.gap <= gaps.gap.min() + _GAP_TOL))


def _initial_kinds(problem: ContactProblem, start: State) -> FloatArray:
    """Return the initial sliding direction of segments: that of `start` if the body slides."""
    length = problem.faces.length
    limit = problem.friction * start.pressure
    if abs(start.shear @ length) <= _SLIDING_SHARE * (limit @ length):
        return np.zeros(len(length))
    return np.where(np.abs(start.shear) >= limit * (1 - _FORCE_TOL), np.sign(start.shear), 0.0)


def _updated_kinds(
    problem: ContactProblem, state: State, gaps: Gaps, kind: FloatArray, *, one_by_one: bool
) -> FloatArray:
    """Return 0 for segments that stick, and the sign of the shear for those that slide.

    Sticking segments slide above the friction; segments that slide against their shear stop.
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


def _limited_step(problem: ContactProblem, state: State, moved: State) -> State:
    """Return the state after a step, shortened until no element is turned inside out."""
    part, tried = 1.0, moved
    for _ in range(6):
        if _least_volume(problem, tried) > _MIN_VOLUME:
            return tried
        part *= 0.5
        tried = _interpolated(state, moved, part)
    raise NotConvergedError("an element is turned inside out")


def _interpolated(state: State, other: State, part: float) -> State:
    """Return the linear interpolation between two states."""
    names = (field.name for field in fields(State))
    return State(*((1 - part) * getattr(state, n) + part * getattr(other, n) for n in names))


def _least_volume(problem: ContactProblem, state: State) -> float:
    """Return the smallest ratio of deformed to undeformed volume."""
    return float(jacobian(problem.solid.gradients(state.u)).min())


@dataclass(eq=False)
class NewtonStep:
    """Newton step: a linear complementarity problem for the segments' pressures.

    The stiffness is factorised once, with the segments in contact condensed. Segments that enter or
    leave contact are rank-one changes.
    """

    problem: ContactProblem
    control: Control
    state: State
    gaps: Gaps
    inner: Assembled
    kind: FloatArray  # of each segment: 0 if it sticks, the sign of its shear if it slides

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
        """Factorise the stiffness with contact condensed, and solve for the fixed parts."""
        problem, gaps, inner = self.problem, self.gaps, self.inner
        length = problem.faces.length
        self._candidate = np.isfinite(gaps.gap)
        self._reference = active & self._candidate
        self._gap = np.where(self._candidate, gaps.gap, 0.0) * length
        self._scale = _PENALTY / length**2
        self._C = gaps.normal
        # A rise of the ridges equals a downward movement of the whole rim.
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
            stiffness, force, rubbed = self._friction_terms()
            K, rest, by_rise = K + stiffness, rest + force, by_rise + rubbed
        try:
            self._factor = factorise(K, problem.free, pivoting=problem.friction > 0)
        except RuntimeError:  # raised by SuperLU for a zero pivot
            raise NotConvergedError("the stiffness is singular") from None
        self._columns: dict[int, FloatArray] = {}
        self._still, self._risen = self._solved(np.stack([rest, -by_rise]))

    def _friction_terms(self) -> tuple[sparse.csr_array, FloatArray, FloatArray]:
        """Return friction's stiffness, its nodal force, and the derivative of that by the rise."""
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
        """Return the state after the step, and the segments that are then in contact.

        Block principal pivoting changes all wrong segments at once, or one at a time if this makes
        no progress. Far from equilibrium no consistent set may exist; then the best set is used.
        """
        # With negative curvature a full step would lead up. With friction there is no potential.
        for share in _CONTACT_SHARES:
            self._factorise(active, share=share)
            if self.problem.friction or not (self._factor.U.diagonal() < 0).any():
                break
        problem, state = self.problem, self.state
        active = best = self._reference.copy()
        fewest, patience = len(active) + 1, _PATIENCE
        for _ in range(_MAX_STEPS):
            du, rise, pressure, gap = self._step_with(active)
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
            du, rise, pressure, _ = self._step_with(best)
        pressure, shear = np.maximum(pressure, 0.0), np.zeros_like(pressure)
        if problem.friction:
            slip = self.gaps.slip + self.gaps.along @ du + rise * self._slip_lift
            stuck, slid = state.shear - self._scale * slip, self.kind * problem.friction * pressure
            shear = np.where(best & self._reference, np.where(self.kind == 0, stuck, slid), 0.0)
        p = state.p + self.inner.pressure_step(du, problem.solid.dofs)
        return State(state.u + du.reshape(-1, 2), p, pressure, shear, state.rise + rise), best

    def _step_with(self, active: np.ndarray) -> tuple[FloatArray, float, FloatArray, FloatArray]:
        """Return the step for given segments in contact: du, rise, pressures and gaps."""
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
        """Return the rise that satisfies the control equation, for du = first + rise second."""
        control, problem, state = self.control, self.problem, self.state
        if control.corner is not None:
            value, row = problem.corner_distance(state, control.corner)
            slope = row @ second - row @ problem.up
            return float((control.target - value - row @ first) / slope)
        if control.kind == "rise":
            return control.target - state.rise
        # The load is the force on the ridges along the rise: minus lift . pressure.
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
