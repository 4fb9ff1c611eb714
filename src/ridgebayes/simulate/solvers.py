"""Loads of one texture: which solver, which transitions, what it said of each."""

import importlib.metadata
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact import halfplane, hertz
from ridgebayes.contact.contact_solution import load_factor
from ridgebayes.contact.many_textures import LoadFunction, load_function
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.scene.effects import FINITE_ELEMENT_ERROR, Plan, full_profile
from ridgebayes.scene.scene import Scene, Texture
from ridgebayes.table.curves import Curve

if TYPE_CHECKING:
    from ridgebayes.contact.cylinder.cylinder import Cylinder, Transition

SOLVERS = ("auto", "hertz", "half-plane", "cylinder-linear", "cylinder-fe")
STANDARD_MESHES = (24, 10)
_MANY, _MOST_UNLIKE = 200, 1e3  # textures, and ratios of groove to ridge, that one function serves
# A texture asking for more is a slip of units; beyond the solver's cap rows have no load anyway.
_MAX_TRANSITIONS = 65_536

# Q, loads and status of one texture's transitions up to p/E.
_Rows: TypeAlias = tuple[IntArray, FloatArray, tuple[str, ...]]
# The first n transitions: loads and status.
_Solver: TypeAlias = Callable[[Texture, float, int], tuple[FloatArray, tuple[str, ...]]]
# Is given each cylinder and its transitions.
CylinderVisitor: TypeAlias = "Callable[[Texture, Cylinder, Sequence[Transition]], None]"


@cache
def versions() -> dict[str, str]:
    """Return versions of what computes loads: another one may change their last digits."""
    names = ("ridgebayes", "numpy", "scipy", "scikit-fem")
    return {name: importlib.metadata.version(name) for name in names}


def transition_curves(
    one: Plan,
    scene: Scene,
    solver: str,
    rel_tol: float,
    *,
    meshes: Sequence[int] = STANDARD_MESHES,
    loads: LoadFunction | None = None,
    pressed: "CylinderVisitor | None" = None,
) -> Iterator[Curve]:
    """Yield the curves of a texture: one, or several where its offset is any, or meshes change.

    Parameters
    ----------
    one : Plan
        The texture, and what is simulated of it.
    scene : Scene
        Poisson's ratio, friction, highest load.
    solver : str
        One of `SOLVERS`, as for `ridgebayes.generate`.
    rel_tol : float, scalar, dimensionless
        Wanted relative error of each load.
    meshes : sequence of int, optional
        Edges of finite elements a ridge, finest first: where one stops, the next goes on.
    loads : LoadFunction, optional
        Half-plane loads of sharp, centred textures, as far as it goes.
    pressed : callable, optional
        As for `ridgebayes.generate`.

    Yields
    ------
    Curve

    Raises
    ------
    InputError
        If the texture has no transition, or over 65,536, under the load.
    """
    texture, p_max = one.texture, scene.highest_load(one.texture)
    by_elements = _by_elements(one, solver)
    profile = one.profile if solver == "auto" else full_profile(texture)
    if profile is None and by_elements:
        profile = full_profile(texture)
    if solver == "hertz" or profile is None:
        found = _many(texture, scene, p_max, _hertz)
        yield _curve(found, texture, scene, "hertz", "effects=none")
        return
    names = ["ridges", *optional_effects(texture)]
    if solver == "auto":
        names = [name for name in names if name in one.simulated or not one.effects]
    if by_elements:
        names += ["finite body and large deformation"] + ["friction"] * (scene.friction > 0)
    effects = "effects=" + "+".join(names).replace(" ", "-")
    if solver == "cylinder-linear":
        found = _linear(texture, scene, p_max, meshes[0])
        yield _curve(found, texture, scene, solver, f"{effects}+finite-body", edges=meshes[0])
        return
    offsets = UNIFORM if profile.offset and texture.offset == "uniform" else [profile.offset]
    for offset in offsets:
        here = replace(profile, offset=offset)
        if by_elements:
            for found, edges, body, reached in _elements(here, scene, p_max, meshes):
                yield _curve(found, texture, scene, "cylinder-fe", effects, offset, edges)
                if pressed is not None:
                    pressed(texture, body, reached)
            continue
        if here == Profile(here.a, here.b):
            found = _many(texture, scene, p_max, partial(_half_plane, rel_tol=rel_tol, known=loads))
        else:
            found = _events(here, scene, p_max, rel_tol)
        how = f"{effects} rel_tol={rel_tol:g}"
        yield _curve(found, texture, scene, "half-plane", how, offset)


def _curve(
    found: _Rows,
    texture: Texture,
    scene: Scene,
    solver: str,
    how: str,
    offset: float = 0.0,
    edges: int = 0,
) -> Curve:
    Q, p_over_E, status = found
    return Curve(
        a_over_R=texture.a_over_R,
        b_over_R=texture.b_over_R,
        Q=tuple(Q.tolist()),
        p_over_E=tuple(p_over_E.tolist()),
        rel_se=_ELEMENTS_SE.get(edges, 0.0),
        nu=scene.nu,
        offset_over_R=offset * (texture.a_over_R + texture.b_over_R),
        role=texture.role,
        solver=solver,
        status=status,
        source=f"ridgebayes {versions()['ridgebayes']} {solver} {how}",
        edges=edges,
    )


UNIFORM = tuple((2 * i + 1) / 32 for i in range(8))  # offsets that stand for any, and their mirrors


def optional_effects(texture: Texture) -> list[str]:
    """Return the effects that a texture gives beyond its ridges."""
    given = {
        "offset": texture.offset != 0.0,
        "groove floor": texture.groove_depth_over_R is not None,
        "corner radius": texture.corner_radius_over_R != 0.0,
    }
    return [name for name, on in given.items() if on]


# Edges a ridge of the mesh, and the relative error of its loads: docs/validation/cylinder.md. Where
# the fine one's rim cannot pass a corner a coarser one can: what slides is less than its edge.
_ELEMENTS_SE = {48: 5e-4, 24: 1e-3, 10: 4e-3}


def _by_elements(one: Plan, solver: str) -> bool:
    return solver == "cylinder-fe" or (solver == "auto" and one.needs_finite_elements)


def friction_refused(scene: Scene, one: Plan, solver: str) -> str:
    """Say what is wrong with leaving out friction; nothing if it may be."""
    friction = next((effect for effect in one.effects if effect.name == "friction"), None)
    wanted = max(scene.relative or 0.0, FINITE_ELEMENT_ERROR if solver == "auto" else 0.0)
    if friction is None or _by_elements(one, solver) or friction.estimate <= wanted:
        return ""
    return (
        f"friction = {scene.friction!r}: changes loads by up to {friction.estimate:.2g}, "
        f"and is not simulated by {solver!r}; expected at most the wanted accuracy, "
        f"{scene.relative or 0.0:g}, or 'cylinder-fe'"
    )


def _many(texture: Texture, scene: Scene, p_max: float, solve: _Solver) -> _Rows:
    """Return the transitions of one texture up to the load, by a solver of the first n of them."""
    pitch = texture.a_over_R + texture.b_over_R
    n_transitions, loads = 8, np.zeros(0)
    while not (loads.size and loads[-1] > p_max):
        if n_transitions > _MAX_TRANSITIONS:
            raise InputError(f"over {_MAX_TRANSITIONS} transitions under p/E = {p_max!r}")
        p_over_E, status = solve(texture, scene.nu, n_transitions)
        loads = _filled(p_over_E, pitch, scene.nu)
        n_transitions *= 2
    k = np.arange(1, loads.size + 1)
    keep = loads <= p_max
    if not keep.any():
        raise InputError(f"no transition under p/E = {p_max!r}: the first is at {loads[0]:.4g}")
    kept = tuple(text for text, under in zip(status, keep, strict=True) if under)
    return 2 + 2 * k[keep], p_over_E[keep], kept


def _events(profile: Profile, scene: Scene, p_max: float, rel_tol: float) -> _Rows:
    """Return the transitions of any profile up to the load: a table holds those from Q = 4 on."""
    factor = load_factor(scene.nu)
    found = reaching_loads(profile, W_max=factor * p_max, n_max=_MAX_TRANSITIONS, rel_tol=rel_tol)
    failed = np.array([text != "ok" for text in found.status], dtype=bool)
    keep = (found.Q >= 4) | failed
    if not keep.any():
        raise InputError(f"no transition to 4 edges or more under p/E = {p_max!r}")
    status = tuple(text for text, kept in zip(found.status, keep, strict=True) if kept)
    return np.maximum(found.Q, 4)[keep], found.W[keep] / factor, status


def _elements(
    profile: Profile, scene: Scene, p_max: float, meshes: Sequence[int]
) -> "Iterator[tuple[_Rows, int, Cylinder, list[Transition]]]":
    """Yield the transitions by finite elements, mesh by mesh; what was found, and why no more."""
    # scikit-fem takes its time to load: only where it is used.
    from ridgebayes.contact.cylinder.cylinder import Cylinder, transition_curve

    last = 3  # a table holds transitions from Q = 4 on
    for edges in meshes:
        body = Cylinder(profile, p_max=p_max, nu=scene.nu, friction=scene.friction, edges=edges)
        reached: list[Transition] = []
        Q, p_over_E, status = transition_curve(body, p_max, seen=reached.append)
        done = all(text == "ok" for text in status)
        keep = last < Q
        if not done and edges != meshes[-1]:
            keep &= ~np.isnan(p_over_E)
        kept = tuple(text for text, on in zip(status, keep, strict=True) if on)
        if keep.any():
            yield (Q[keep], p_over_E[keep], kept), edges, body, [r for r in reached if last < r.Q]
            last = int(Q[keep][-1])
        if done:
            break
    if last == 3:
        raise InputError(f"no transition to 4 edges or more under p/E = {p_max!r}")


def _filled(p_over_E: FloatArray, pitch_over_R: float, nu: float) -> FloatArray:
    """Estimate missing loads, to know which rows without one belong under the scene's load.

    They grow nearly as k^2 from the last that was computed; without any, grooves are too narrow
    to matter and the smooth body's half-width is k pitches.
    """
    k = np.arange(1, p_over_E.size + 1)
    known = np.flatnonzero(~np.isnan(p_over_E))
    if known.size:
        estimate = p_over_E[known[-1]] * (k / k[known[-1]]) ** 2
    else:
        estimate = hertz.load_of_half_width(k * pitch_over_R, nu=nu)
    return np.where(np.isnan(p_over_E), estimate, p_over_E)


def _linear(texture: Texture, scene: Scene, p_max: float, edges: int) -> _Rows:
    """Return the transitions at small strain, by finite elements."""
    # scikit-fem takes its time to load: only where it is used.
    from ridgebayes.contact.cylinder.compliance import small_strain_transitions

    a, b = texture.a_over_R, texture.b_over_R
    Q, loads = small_strain_transitions(a, b, nu=scene.nu, p_max=p_max, edges=edges)
    if not Q.size:
        raise InputError(f"no transition under p/E = {p_max!r}")
    return Q, loads, ("ok",) * len(Q)


def _half_plane(
    texture: Texture, nu: float, n_transitions: int, *, rel_tol: float, known: LoadFunction | None
) -> tuple[FloatArray, tuple[str, ...]]:
    a, b = texture.a_over_R, texture.b_over_R
    if known is not None and n_transitions <= known.n_transitions:
        F = known(a, b)[0, :n_transitions]
        return F * (a + b) ** 2 / (1 - nu**2), ("ok",) * n_transitions
    loads = halfplane.transition_loads(a, b, n_transitions, rel_tol=rel_tol)
    return loads.p_over_E(a + b, nu=nu), loads.status


def _hertz(texture: Texture, nu: float, n_transitions: int) -> tuple[FloatArray, tuple[str, ...]]:
    Q = 2 + 2 * np.arange(1, n_transitions + 1)
    loads = hertz.transition_load(Q, texture.a_over_R, texture.b_over_R, nu=nu)
    return loads, ("ok",) * n_transitions


def many_loads(scene: Scene, rel_tol: float) -> LoadFunction | None:
    """Return half-plane loads as one function where a scene's textures are many.

    Its error is under a tenth of the tolerance, and of 1e-8. None where the textures are too few,
    or too unlike each other, to save time, or where the function cannot be made to that error.
    """
    a, b = np.array([(texture.a_over_R, texture.b_over_R) for texture in scene.textures]).T
    if len(a) <= _MANY or (b / a).max() > _MOST_UNLIKE * (b / a).min():
        return None
    p_max = np.array([scene.highest_load(texture) for texture in scene.textures])
    n = float((hertz.half_width(p_max, nu=scene.nu) / (a + b)).max())
    n_transitions = next((k for k in (8, 16, 32) if k > 1.5 * n + 2), 64)
    try:
        return load_function(
            float((b / a).min()),
            float((b / a).max()),
            n_transitions,
            rel_tol=0.1 * min(rel_tol, 1e-8),
        )
    except ComputationError:
        return None
