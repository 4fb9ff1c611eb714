"""Estimate each effect of a scene, and decide whether to simulate it.

The smallest effects are neglected while 1.5 times the sum of their estimates stays within the
required accuracy. An estimate takes one or two solutions at chosen loads, which is cheaper than a
simulation. It is the gap that the effect opens at an event's load without the effect, divided by
the slope of the gap.
"""

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ridgebayes._types import NEO_HOOKEAN, FloatArray
from ridgebayes.contact import halfplane, hertz, two_scale
from ridgebayes.contact.contact_solution import ContactSolution, load_factor, solve_contact
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import InputError
from ridgebayes.runtime.text import percent
from ridgebayes.scene.effects import (
    BEYOND_HALF_PLANE,
    DEFAULT_RELATIVE,
    FINITE_ELEMENT_ERROR,
    HIGHEST_LOAD,
    N_OFFSETS,
    Effect,
    Plan,
    full_profile,
)
from ridgebayes.scene.scene import Scene, Texture, as_scene

_SAFETY = 1.5  # bound of a change over its estimate
# If Poisson's ratio is too small for two-scale loads: finite strain multiplies half-plane loads by
# 1 + 0.3 (w/R)^2, fitted for half-widths w up to 0.26 R (data/fea).
_FINITE_STRAIN_FACTOR = 0.3
# CPU seconds of a contact, and the number of its intervals that doubles them; measured for sharp
# and round ridges, with and without floors, on up to 130 ridges. The loads of all transitions take
# as long as two contacts; over floors, as sixteen and eight more for each transition. Run times are
# right to a factor of three.
_CONTACT_S, _DOUBLING_INTERVALS = 8e-3, 30
_MAX_TRANSITIONS = 64  # transitions per texture
_FE_TRANSITION_S = 5.0  # CPU seconds per transition, by finite elements
_SMOOTH_BODY_S = 15.0  # CPU seconds, of a smooth body by finite elements


def plan(scene: Scene | str | os.PathLike[str]) -> list[Plan]:
    """Decide for each texture of a scene what to simulate.

    Parameters
    ----------
    scene : Scene or path
        Scene with its textures, highest load and required accuracy.

    Returns
    -------
    list of Plan
        One plan per texture, in the scene's order.

    Raises
    ------
    InputError
        If the contact of a texture cannot be solved even roughly, as with grooves under a
        millionth of a ridge.

    Notes
    -----
    *Accuracy.* All neglected effects together change loads by at most the required accuracy.
    Estimates above a tenth of it are within a factor of two of the true change, as checked on
    scenes across the input space (`studies/plan.py`).
    *Cost.* Tens of milliseconds per texture.

    Examples
    --------
    >>> scene = Scene.of([(0.032, 0.01)], p_over_E=0.01, relative=0.02)
    >>> plan(scene)[0].simulated
    ('ridges', "Poisson's ratio")
    """
    scene = as_scene(scene)
    return [_plan_texture(_Base.of(scene, texture)) for texture in scene.textures]


def _too_narrow(texture: Texture, status: str) -> InputError:
    return InputError(
        f"textures: a/R = {texture.a_over_R!r}, b/R = {texture.b_over_R!r}: {status}; "
        "expected a texture that the half-plane equation can solve, or a scene without `accuracy` "
        "and effects"
    )


def _plan_texture(base: "_Base") -> Plan:
    finite_body, solver = _finite_body(base)
    friction, material = _friction(base), _material(base)
    if material.simulated and solver == "half-plane":
        solver = "two-scale" if base.two_scale_error < math.inf else "cylinder-fe"
        finite_body = replace(finite_body, simulated=True)
    neglected = [e.estimate for e in (finite_body, friction, material) if not e.simulated]
    geometric = [_ridges(base), _offset(base), _floor(base), _corner(base)]
    effects = _decide(base, geometric, base.tolerance - _SAFETY * math.fsum(neglected))
    effects.insert(1, _partial_contact(base))
    effects += [_poisson(base), finite_body, material, friction, *_not_modelled()]
    solver = "cylinder-fe" if friction.simulated else solver
    chosen = {effect.name for effect in effects if effect.simulated}
    fields = {"groove floor": "depth", "corner radius": "corner", "offset": "offset"}
    shape = {fields[name]: getattr(base.profile, fields[name]) for name in chosen & fields.keys()}
    profile = replace(base.sharp, **shape) if shape or "ridges" in chosen else None
    return Plan(base.texture, tuple(effects), profile, base.tolerance, solver)


@dataclass(frozen=True, eq=False)
class _Base:
    """A texture with sharp ridges only, and the loads at which effects are estimated."""

    scene: Scene
    texture: Texture
    sharp: Profile
    W: FloatArray  # loads of the transitions below the scene's load, at least one
    last: ContactSolution  # at the highest load considered
    W_max: float  # load of the scene, or of the first transition if that is higher

    @classmethod
    def of(cls, scene: Scene, texture: Texture) -> "_Base":
        a, b = texture.a_over_R, texture.b_over_R
        sharp = Profile(a, b)
        W_max = load_factor(scene.nu) * scene.highest_load(texture)
        n = min(max(int(math.sqrt(2 * W_max) / (a + b)) + 2, 4), _MAX_TRANSITIONS)
        loads = halfplane.transition_loads(a, b, n, rel_tol=1e-6)
        W = load_factor(0) * loads.F * (a + b) ** 2
        W = W[np.isfinite(W)]
        if not W.size:
            raise _too_narrow(texture, loads.status[0])
        W = W[: max(int(np.searchsorted(W, W_max, side="right")), 1)]
        # Beyond the last transition considered, effects vary little from ridge to ridge.
        top = min(max(W_max, float(W[-1])), 1.2 * float(W[-1]) + sharp.pitch**2)
        last = solve_contact(sharp, top)
        return cls(scene, texture, sharp, W, last, max(W_max, float(W[-1])))

    @property
    def tolerance(self) -> float:
        return self.scene.relative or DEFAULT_RELATIVE

    @property
    def requirement(self) -> str:
        """Required accuracy in words."""
        relative = self.scene.relative
        return f"the required {percent(relative)}" if relative else "0, and no accuracy is stated"

    @property
    def p_max(self) -> float:
        """Highest load considered, over E."""
        return self.W_max / load_factor(self.scene.nu)

    @property
    def loads(self) -> FloatArray:
        """Transition loads over E; the highest load replaces the transitions that `W` omits."""
        all_in_W = len(self.W) < _MAX_TRANSITIONS
        return (self.W if all_in_W else np.append(self.W, self.W_max)) / load_factor(self.scene.nu)

    @cached_property
    def two_scale_error(self) -> float:
        """Largest relative standard error of two-scale loads; infinite where nu is too small."""
        nu = self.scene.nu
        if nu < two_scale.LEAST_NU:
            return math.inf
        loads = np.minimum(self.loads, two_scale.REACH)
        profile = self.profile
        if self.texture.offset == "uniform":  # the error is largest at a quarter pitch
            profile = replace(profile, offset=0.25)
        return float(np.max(two_scale.relative_error(loads, profile, nu, self.scene.ogden)))

    @cached_property
    def profile(self) -> Profile:
        return full_profile(self.texture)

    @cached_property
    def penetration(self) -> float:
        """Largest depth of the surface in a groove at the highest load, with round corners."""
        rounded = self.last
        if self.profile.corner:
            round_profile = replace(self.sharp, corner=self.profile.corner)
            rounded = solve_contact(round_profile, self.last.W)
        solutions = [solution for solution in (self.last, rounded) if solution.status == "ok"]
        if not solutions:
            raise _too_narrow(self.texture, rounded.status)
        deepest = max(max(solution.penetrations.values()) for solution in solutions)
        # On later ridges it grows with the pressure at the centre, proportional to sqrt(W).
        return deepest * math.sqrt(self.W_max / self.last.W)

    @property
    def half_width(self) -> float:
        return math.sqrt(2 * self.W_max)

    @cached_property
    def shifts(self) -> dict[tuple[bool, bool], FloatArray]:
        """Relative shifts of the first, middle and last transition, by (floor, corner).

        Effects interact: the floor carries load that round corners give up.
        """
        n = len(self.W)
        transitions = sorted({1, (n + 1) // 2, n})
        depth, corner = self.profile.depth, self.profile.corner
        shifts = {(False, False): np.zeros(len(transitions))}
        for floor, is_round in ((True, False), (False, True), (True, True)):
            if (floor and self.penetration < depth) or (is_round and not corner):
                continue
            floor_depth, corner_radius = depth if floor else math.inf, corner if is_round else 0.0
            other = replace(self.sharp, depth=floor_depth, corner=corner_radius)
            shifts[floor, is_round] = np.array([self._shift_of(other, k) for k in transitions])
        return shifts

    def change(self, which: int) -> float:
        """Return the largest change by floor (0) or corners (1), with and without the other."""
        sizes = [0.0]
        for key, with_it in self.shifts.items():
            without = (False, key[1]) if which == 0 else (key[0], False)
            if key[which] and without in self.shifts:
                sizes.append(np.abs(with_it - self.shifts[without]).max())
        return float(np.max(sizes))

    def _shift_of(self, other: Profile, k: int) -> float:
        """Return the relative load shift of event k from one Newton step on its gap."""
        W, ridge = float(self.W[k - 1]), other.ridge(k)
        solution = solve_contact(other, W, ridges=range(k))
        if solution.status != "ok":
            return math.nan
        return solution.rise_to_touch([ridge]) / W

    def cost(self, n_contact: float, n_interval: float) -> float:
        """Return the CPU seconds of contacts on a number of intervals, at all offsets."""
        n_curve = N_OFFSETS if self.texture.offset == "uniform" else 1
        return n_curve * n_contact * _CONTACT_S * (1 + (n_interval / _DOUBLING_INTERVALS) ** 2)


def _decide(base: _Base, effects: list[Effect], allowance: float) -> list[Effect]:
    """Neglect the smallest effects while their sum stays within the allowance."""
    decisions = {}
    for effect in sorted(effects, key=lambda item: (math.isnan(item.estimate), item.estimate)):
        if effect.estimate == 0.0:
            decisions[effect.name] = replace(effect, simulated=False)
            continue
        simulated = not _SAFETY * effect.estimate <= allowance
        reason = f"{effect.reason}; {'above' if simulated else 'within'} {base.requirement}"
        if math.isnan(effect.estimate):
            reason = f"{effect.reason}; size not known, simulated to be safe"
        elif simulated and effect.estimate <= base.tolerance:
            reason = f"{effect.reason}; with all neglected effects above {base.requirement}"
        allowance -= 0.0 if simulated else _SAFETY * effect.estimate
        decisions[effect.name] = replace(effect, simulated=simulated, reason=reason)
    return [decisions[effect.name] for effect in effects]


def _ridges(base: _Base) -> Effect:
    a, b, n = base.sharp.a, base.sharp.b, len(base.W)
    smooth = hertz.transition_load(4 + 2 * np.arange(n), a, b, nu=0.0) * load_factor(0)
    estimate = float(np.max(np.abs(smooth / base.W - 1)))
    reason = "b/pitch; against smooth Hertz"
    return Effect("ridges", b / (a + b), estimate, True, reason, base.cost(1, n))


def _partial_contact(base: _Base) -> Effect:
    reason = (
        "contact half-width over pitch; at a transition all touched ridges are fully covered, so "
        "transition loads do not depend on it; counts at a load and pressures include it"
    )
    number = base.half_width / base.sharp.pitch
    return Effect("partial contact", number, 0.0, False, reason, base.cost(3, len(base.W)))


def _offset(base: _Base) -> Effect:
    number = abs(base.profile.offset)
    n, sharp = len(base.W), base.sharp
    # The offset moves one ridge of the first pair away; loads grow with the distance squared.
    first = 0.5 * sharp.b + sharp.pitch
    estimate = (1 + number * sharp.pitch / first) ** 2 - 1
    return Effect("offset", number, estimate, True, "fraction of a pitch", base.cost(2, 2 * n))


def _floor(base: _Base) -> Effect:
    depth, penetration = base.profile.depth, base.penetration
    number = penetration / depth
    n_event = len(base.W) if base.profile.mirrored else 2 * len(base.W)
    cost = base.cost(16 + 8 * n_event, 2 * len(base.W))
    reason = "deepest penetration into a groove over its depth"
    if number < 1:
        reason += "; the floor is not touched"
        return Effect("groove floor", number, 0.0, False, reason, cost)
    # If the floor is touched only beyond these transitions, its effect is unknown.
    return Effect("groove floor", number, base.change(0) or math.nan, True, reason, cost)


def _corner(base: _Base) -> Effect:
    corner, a = base.profile.corner, base.sharp.a
    cost = base.cost(2, len(base.W))
    reason = "radius over a" if corner else "radius over a; corners are sharp"
    return Effect("corner radius", corner / a, base.change(1), corner > 0, reason, cost)


def _poisson(base: _Base) -> Effect:
    nu = base.scene.nu
    estimate = abs(0.75 / (1 - nu**2) - 1)
    reason = "nu; an exact factor 1/(1 - nu^2), against nu = 0.5"
    return Effect("Poisson's ratio", nu, estimate, True, reason, 0.0)


def _finite_body(base: _Base) -> tuple[Effect, str]:
    """Return the effect of the finite body, and the solver that it requires."""
    width, nu, p = base.half_width, base.scene.nu, base.p_max
    count = max(base.last.Q, 2 * width / base.sharp.pitch)
    strain = 2 * p / (count * base.sharp.a)
    depth_over_b = base.penetration / base.sharp.b
    change = np.abs(two_scale.load_of(base.loads, nu) / base.loads - 1)
    estimate = float(np.fmax.reduce(change))  # NaN only if all are
    if math.isnan(estimate):
        # Pressure draws a compressible surface in by (1 - 2 nu)(1 + nu) p, and loads grow with
        # distances squared. The second term is the bending of the surface into a groove.
        draw_in = 2 * (1 - 2 * nu) * (1 + nu) * p / width
        estimate = _FINITE_STRAIN_FACTOR * width**2 + 0.2 * depth_over_b**2 + draw_in
    solver, why = _solver_for(base, estimate)
    reason = f"contact half-width over R; load per ridge over E a is {strain:.2g}, "
    reason += f"penetration over b {depth_over_b:.2g}; {why}"
    cost = _FE_TRANSITION_S * len(base.W) if solver == "cylinder-fe" else 0.0
    simulated = solver != "half-plane"
    return Effect(BEYOND_HALF_PLANE[0], width, estimate, simulated, reason, cost), solver


def _solver_for(base: _Base, estimate: float) -> tuple[str, str]:
    """Return the cheapest solver within the required accuracy, and the reason.

    Parameters
    ----------
    base : _Base
        Texture and its loads.
    estimate : float
        Estimated relative error of half-plane loads.
    """
    error, is_beyond_fe = base.two_scale_error, base.p_max > HIGHEST_LOAD
    if _SAFETY * estimate <= base.tolerance:
        return "half-plane", f"within {base.requirement}"
    if base.scene.relative is None and not (is_beyond_fe and error < math.inf):
        why = f"a scene without a stated accuracy uses the half-plane to p/E = {HIGHEST_LOAD:g}"
        return "half-plane", why
    if estimate <= min(error, FINITE_ELEMENT_ERROR):
        return "half-plane", f"below the error of finite elements, {percent(FINITE_ELEMENT_ERROR)}"
    if error <= max(base.tolerance, FINITE_ELEMENT_ERROR) or (is_beyond_fe and error < math.inf):
        return "two-scale", f"above {base.requirement}: two-scale, right to {percent(error)}"
    return "cylinder-fe", f"above {base.requirement}: finite elements"


def _material(base: _Base) -> Effect:
    """Compare equally loaded smooth bodies of the scene's material and of a neo-Hookean one."""
    ogden, nu = base.scene.ogden, base.scene.nu
    exponent = sum(share * exponent for share, exponent in ogden)
    reason = "Ogden's exponents, weighed by their shares; "
    if ogden == NEO_HOOKEAN:
        return Effect("material", exponent, 0.0, False, f"{reason}the body is neo-Hookean", 0.0)
    estimate = math.nan
    if nu >= two_scale.LEAST_NU:
        p = min(base.p_max, two_scale.REACH)
        stiff, soft = (float(two_scale.width_ratio(p, nu, terms)) for terms in (ogden, NEO_HOOKEAN))
        estimate = abs((soft / stiff) ** 2 - 1)
    reason += "a smooth body's load against a neo-Hookean one's"
    effect = Effect("material", exponent, estimate, True, reason, _SMOOTH_BODY_S)
    return _decide(base, [effect], base.tolerance)[0]


def _friction(base: _Base) -> Effect:
    """Simulate friction if it exceeds the required accuracy and that of finite elements."""
    nu, friction = base.scene.nu, base.scene.friction
    beta = (1 - 2 * nu) / (2 * (1 - nu))
    # Full stick multiplies the stiffness of a flat contact by (1 - nu) ln(3 - 4 nu)/(1 - 2 nu).
    stick = (1 - nu) * math.log(3 - 4 * nu) / (1 - 2 * nu) - 1 if nu < 0.5 else 0.0
    estimate = stick * min(friction / beta, 1.0) if beta > 0 and friction else 0.0
    reason = f"friction coefficient; tangential mismatch (1 - 2 nu)/(2 (1 - nu)) is {beta:.2g}; "
    simulated = estimate > max(base.tolerance, FINITE_ELEMENT_ERROR)
    if estimate <= base.tolerance:
        reason += f"within {base.requirement}"
    elif simulated:
        reason += f"above {base.requirement}: finite elements"
    else:
        reason += f"below the error of finite elements, {percent(FINITE_ELEMENT_ERROR)}"
    cost = _FE_TRANSITION_S * len(base.W)
    return Effect(BEYOND_HALF_PLANE[1], friction, estimate, simulated, reason, cost)


def _not_modelled() -> Iterator[Effect]:
    for name, number in (
        ("adhesion", "work of adhesion over E a"),
        ("viscoelasticity", "loading time over relaxation time"),
        ("compliance of the ridges", "the body's modulus over the ridges'"),
        ("third dimension", "2 R over the cylinder's length"),
    ):
        reason = f"{number}; not modelled; scenes have no input for it"
        yield Effect(name, math.nan, math.nan, False, reason, math.nan)
