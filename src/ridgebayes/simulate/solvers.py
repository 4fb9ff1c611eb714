"""Transition loads of one texture: choice of the solver, transitions and their status."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ridgebayes._types import NEO_HOOKEAN, FloatArray, IntArray, Json, Ogden, __version__
from ridgebayes.contact import halfplane, hertz, two_scale
from ridgebayes.contact.contact_solution import DEFAULT_REL_TOL, load_factor
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import InputError
from ridgebayes.runtime import text
from ridgebayes.scene.effects import FINITE_ELEMENT_ERROR, N_OFFSETS, Plan, full_profile
from ridgebayes.scene.scene import Scene, Texture

if TYPE_CHECKING:
    from ridgebayes.contact.cylinder.cylinder import Cylinder, Transition

SOLVERS = ("auto", "hertz", "half-plane", "two-scale", "cylinder-linear", "cylinder-fe")
# More transitions in a texture indicate wrong units; above the solver's cap rows have no load.
_MAX_TRANSITIONS = 65_536


@dataclass(frozen=True)
class LoadPreset:
    """Target errors of generated loads.

    Parameters
    ----------
    load_error : float
        Target relative error of a half-plane load.
    edges : int
        Finite-element edges per ridge.
    mesh_error : float
        Relative error of finite-element loads: docs/validation/cylinder.md.
    """

    load_error: float
    edges: int
    mesh_error: float


LOAD_PRESETS = {
    "quick": LoadPreset(1e-4, 10, 4e-3),
    "standard": LoadPreset(DEFAULT_REL_TOL, 24, 1e-3),
    "reference": LoadPreset(1e-10, 48, 5e-4),
}
ELEMENTS_SE = {preset.edges: preset.mesh_error for preset in LOAD_PRESETS.values()}

# Q, loads and status of a texture's transitions up to p/E.
_Rows: TypeAlias = "tuple[IntArray, FloatArray, NDArray[np.str_]]"
# Returns loads and status of the first n transitions.
_Solver: TypeAlias = "Callable[[TextureTask, int], tuple[FloatArray, tuple[str, ...]]]"
# Called with each cylinder and its transitions.
CylinderVisitor: TypeAlias = "Callable[[Texture, Cylinder, Sequence[Transition]], None]"


# Versions of packages that compute loads; a new version may change the last digits.
versions = cache(partial(text.versions, ("ridgebayes", "numpy", "scipy", "scikit-fem")))


@dataclass(frozen=True)
class TextureTask:
    """Everything that determines the curves of a texture, small enough to send to a process.

    Parameters
    ----------
    number : int
        Number of the texture in its scene, from 1.
    scene : Scene
        Scene of this texture only.
    planned : bool
        Whether to choose the simulated effects; otherwise all effects in the scene are simulated.
    solver : str
        One of `SOLVERS`, as for `ridgebayes.generate`.
    rel_tol : float, scalar, dimensionless
        Requested relative error of each load.
    meshes : tuple of int
        Finite-element edges per ridge, finest first: where a mesh fails, the next continues.
    version : str
        Version of this package that created the task.
    """

    number: int
    scene: Scene
    planned: bool
    solver: str
    rel_tol: float
    meshes: tuple[int, ...]
    version: str = __version__

    @property
    def texture(self) -> Texture:
        """Texture of the task."""
        return self.scene.textures[0]

    @property
    def p_max(self) -> float:
        """Highest load of the texture."""
        return self.scene.highest_load(self.texture)

    def at_half_plane_load(self) -> "TextureTask":
        """Return the task with its highest load converted to that of an equivalent half-plane."""
        nu, ogden = self.scene.nu, self.scene.ogden
        p_max = float(two_scale.half_plane_load(self.p_max, nu, ogden))
        if math.isnan(p_max):
            reach = two_scale.reach(nu, ogden)
            raise InputError(f"load: expected at most p/E = {reach:g}, as far as its material goes")
        texture = self.texture.model_copy(update={"max_p_over_E": p_max})
        return replace(self, scene=self.scene.model_copy(update={"textures": (texture,)}))

    @property
    def where(self) -> str:
        """Name of the texture for messages."""
        a, b = self.texture.a_over_R, self.texture.b_over_R
        return f"scene: textures[{self.number}] = ({a!r}, {b!r})"

    def given(self) -> Json:
        """Return the task as a journal's key, without its number, which may change."""
        return {
            "versions": versions(),
            "scene": self.scene.model_dump(mode="json"),
            "planned": self.planned,
            "solver": self.solver,
            "rel_tol": self.rel_tol,
            "meshes": list(self.meshes),
        }


def transition_curves(
    task: TextureTask, planned: Plan, pressed: "CylinderVisitor | None" = None
) -> Iterator[Json]:
    """Yield the curves of a texture: several for a uniform offset, or if meshes change.

    Parameters
    ----------
    task : TextureTask
        Texture and options of the solver.
    planned : Plan
        Simulated effects.
    pressed : callable, optional
        As for `ridgebayes.generate`.

    Yields
    ------
    dict
        Columns of the contact table as values of JSON: a number or text if all rows are equal,
        else a list.

    Raises
    ------
    InputError
        If the texture has no transition, or over 65,536, below the load.
    """
    texture, scene, solver = task.texture, task.scene, task.solver
    chosen = planned.solver if solver == "auto" else solver
    by_elements, two_scales = chosen == "cylinder-fe", chosen == "two-scale"
    profile = planned.profile if solver == "auto" else full_profile(texture)
    if profile is None and (by_elements or two_scales):
        profile = full_profile(texture)
    if solver == "hertz" or profile is None:
        yield _curve(task, _first_transitions(task, _hertz), "hertz", "effects=none")
        return
    names = _simulated(task, planned, chosen)
    if "material" not in names:
        task = replace(task, scene=scene.model_copy(update={"ogden": NEO_HOOKEAN}))
    effects = "effects=" + "+".join(names).replace(" ", "-")
    if solver == "cylinder-linear":
        edges = task.meshes[0]
        yield _curve(task, _linear(task), solver, f"{effects}+finite-body", edges=edges)
        return
    is_any = profile.offset and texture.offset == "uniform"
    offsets = offsets_between(N_OFFSETS) if is_any else [profile.offset]
    for offset in offsets:
        here = replace(profile, offset=offset)
        if by_elements:
            for rows, edges, body, reached in _elements(here, task):
                rounded = body.profile != here
                how = f"{effects} corners=a/{1 / _CORNER_OVER_A:g}" if rounded else effects
                curve = _curve(task, rows, "cylinder-fe", how, offset, edges)
                if rounded:
                    curve |= {"rel_se": math.hypot(curve["rel_se"], FINITE_ELEMENT_ERROR)}
                yield curve
                if pressed is not None:
                    pressed(texture, body, reached)
            continue
        sharp, how = here == Profile(here.a, here.b), f"{effects} rel_tol={task.rel_tol:g}"
        with_reach = task.at_half_plane_load() if two_scales else task
        rows = _first_transitions(with_reach, _half_plane) if sharp else _events(here, with_reach)
        curve = _curve(task, rows, "half-plane", how, offset)
        yield _two_scale(curve, here, task.scene.ogden) if two_scales else curve


def _simulated(task: TextureTask, planned: Plan, chosen: str) -> list[str]:
    """Return the names of the effects that a solver simulates."""
    scene, large = task.scene, chosen in ("cylinder-fe", "two-scale")
    names = ["ridges", *optional_effects(task.texture)]
    if scene.ogden != NEO_HOOKEAN and large:
        names += ["material"]
    if task.solver == "auto":
        names = [name for name in names if name in planned.simulated or not planned.effects]
    if large:
        names += ["finite body and large deformation"]
    if chosen == "cylinder-fe" and scene.friction > 0:
        names += ["friction"]
    return names


def _curve(
    task: TextureTask, rows: _Rows, solver: str, how: str, offset: float = 0.0, edges: int = 0
) -> Json:
    texture, (Q, p_over_E, status) = task.texture, rows
    return {
        "a_over_R": texture.a_over_R,
        "b_over_R": texture.b_over_R,
        "Q": Q.tolist(),
        "p_over_E": p_over_E.tolist(),
        "rel_se": ELEMENTS_SE.get(edges, 0.0),
        "nu": task.scene.nu,
        "offset_over_R": offset * (texture.a_over_R + texture.b_over_R),
        "role": texture.role,
        "solver": solver,
        "status": status.tolist(),
        "source": f"ridgebayes {task.version} {solver} {how}",
        "edges": edges,
    }


def offsets_between(n: int) -> list[float]:
    """Return n offsets in pitches that represent all offsets; the others are mirror images."""
    return [(i + 0.5) / (2 * n) for i in range(n)]


def optional_effects(texture: Texture) -> list[str]:
    """Return the effects of a texture other than its ridges."""
    effects = {
        "offset": texture.offset != 0.0,
        "groove floor": texture.groove_depth_over_R is not None,
        "corner radius": texture.corner_radius_over_R != 0.0,
    }
    return [name for name, on in effects.items() if on]


# If the last mesh stops at a sharp corner, it continues with round ones: an error of some 0.1 %,
# within `FINITE_ELEMENT_ERROR`.
_CORNER_OVER_A = 0.05


def _two_scale(curve: Json, profile: Profile, ogden: Ogden) -> Json:
    """Return a curve of half-plane loads converted to large deformation by two scales."""
    nu = curve["nu"]
    loads = two_scale.load_of(curve["p_over_E"], nu, ogden)
    error = two_scale.relative_error(loads, profile, nu, ogden)
    statuses = [
        two_scale.UNCHECKED if status == "ok" and p > two_scale.checked(ogden) else status
        for status, p in zip(curve["status"], loads.tolist(), strict=True)
    ]
    rows = {"p_over_E": loads.tolist(), "rel_se": np.nan_to_num(error).tolist(), "status": statuses}
    source = curve["source"].replace(" half-plane ", " two-scale ", 1)
    return curve | rows | {"solver": "two-scale", "source": source}


def friction_refused(scene: Scene, planned: Plan, solver: str) -> str:
    """Return a message if friction must not be neglected, or an empty text if it may be."""
    friction = next((effect for effect in planned.effects if effect.name == "friction"), None)
    limit = max(scene.relative or 0.0, FINITE_ELEMENT_ERROR if solver == "auto" else 0.0)
    by_elements = (planned.solver if solver == "auto" else solver) == "cylinder-fe"
    if friction is None or by_elements or friction.estimate <= limit:
        return ""
    return (
        f"friction = {scene.friction!r}: changes loads by up to {friction.estimate:.2g}, "
        f"and is not simulated by {solver!r}; expected at most the required accuracy, "
        f"{scene.relative or 0.0:g}, or 'cylinder-fe'"
    )


def _first_transitions(task: TextureTask, solve: _Solver) -> _Rows:
    """Return a texture's transitions up to the load, by a solver of the first n transitions."""
    pitch, p_max = task.texture.a_over_R + task.texture.b_over_R, task.p_max
    n_transitions, loads = 8, np.zeros(0)
    while not (loads.size and loads[-1] > p_max):
        if n_transitions > _MAX_TRANSITIONS:
            raise InputError(f"over {_MAX_TRANSITIONS} transitions under p/E = {p_max!r}")
        p_over_E, status = solve(task, n_transitions)
        loads = _filled(p_over_E, pitch, task.scene.nu)
        n_transitions *= 2
    keep = loads <= p_max
    if not keep.any():
        raise InputError(f"no transition under p/E = {p_max!r}: the first is at {loads[0]:.4g}")
    return 4 + 2 * np.flatnonzero(keep), p_over_E[keep], np.array(status)[keep]


def _events(profile: Profile, task: TextureTask) -> _Rows:
    """Return the transitions of any profile up to the load; a table starts at Q = 4."""
    from ridgebayes.contact.reaching import reaching_loads  # loaded on use

    factor, W_max = load_factor(task.scene.nu), load_factor(task.scene.nu) * task.p_max
    events = reaching_loads(profile, W_max=W_max, n_max=_MAX_TRANSITIONS, rel_tol=task.rel_tol)
    status = np.array(events.status, dtype=np.str_)
    keep = (events.Q >= 4) | (status != "ok")
    if not keep.any():
        raise InputError(f"no transition to 4 edges or more under p/E = {task.p_max!r}")
    return np.maximum(events.Q, 4)[keep], events.W[keep] / factor, status[keep]


def _elements(
    profile: Profile, task: TextureTask
) -> "Iterator[tuple[_Rows, int, Cylinder, list[Transition]]]":
    """Yield transitions by finite elements, mesh by mesh; the last status gives a failure."""
    # scikit-fem takes long to import.
    from ridgebayes.contact.cylinder.cylinder import MOST_FAILURES, Cylinder, transition_curve

    last, scene, p_max = 3, task.scene, task.p_max  # a table starts at Q = 4
    after: Transition | None = None
    for edges in task.meshes:
        final = edges == task.meshes[-1]
        rounds = final and edges != task.meshes[0] and not profile.corner
        here = replace(profile, corner=_CORNER_OVER_A * profile.a) if rounds else profile
        body = Cylinder(
            here, p_max=p_max, nu=scene.nu, friction=scene.friction, edges=edges, ogden=scene.ogden
        )
        reached: list[Transition] = []
        # A mesh that takes all Newton steps at a sharp corner will not pass it: see
        # docs/validation/cylinder.md.
        tries = MOST_FAILURES if final or profile.corner else 2
        curve = transition_curve(body, p_max, seen=reached.append, most_failures=tries, after=after)
        # With friction loads depend on the path, so the next mesh has to stop at every transition.
        after = reached[-1] if reached and not scene.friction else after
        (Q, p_over_E), status = curve[:2], np.array(curve[2], dtype=np.str_)
        done = bool(np.all(status == "ok"))
        keep = (last < Q) & (final | ~np.isnan(p_over_E))
        if keep.any():
            rows = Q[keep], p_over_E[keep], status[keep]
            yield rows, edges, body, [transition for transition in reached if last < transition.Q]
            last = int(Q[keep][-1])
        if done:
            break
    if last == 3:
        raise InputError(f"no transition to 4 edges or more under p/E = {p_max!r}")


def _filled(p_over_E: FloatArray, pitch_over_R: float, nu: float) -> FloatArray:
    """Return loads with estimates for missing ones, to decide which rows are below the load.

    Loads grow nearly as k^2 from the last computed load. If none was computed, grooves are too
    narrow to matter, and the half-width of the smooth body is k pitches.
    """
    k = np.arange(1, p_over_E.size + 1)
    computed = np.flatnonzero(~np.isnan(p_over_E))
    if computed.size:
        estimate = p_over_E[computed[-1]] * (k / k[computed[-1]]) ** 2
    else:
        estimate = hertz.load_of_half_width(k * pitch_over_R, nu=nu)
    return np.where(np.isnan(p_over_E), estimate, p_over_E)


def _linear(task: TextureTask) -> _Rows:
    """Return the transitions at small strain, by finite elements."""
    # scikit-fem takes long to import.
    from ridgebayes.contact.cylinder.small_strain import small_strain_transitions

    a, b, p_max = task.texture.a_over_R, task.texture.b_over_R, task.p_max
    edges = task.meshes[0]
    Q, loads = small_strain_transitions(a, b, nu=task.scene.nu, p_max=p_max, edges=edges)
    if not Q.size:
        raise InputError(f"no transition under p/E = {p_max!r}")
    return Q, loads, np.full(len(Q), "ok")


def _half_plane(task: TextureTask, n: int) -> tuple[FloatArray, tuple[str, ...]]:
    a, b, nu = task.texture.a_over_R, task.texture.b_over_R, task.scene.nu
    loads = halfplane.transition_loads(a, b, n, rel_tol=task.rel_tol)
    return loads.p_over_E(a + b, nu=nu), loads.status


def _hertz(task: TextureTask, n: int) -> tuple[FloatArray, tuple[str, ...]]:
    a, b, Q = task.texture.a_over_R, task.texture.b_over_R, 4 + 2 * np.arange(n)
    return hertz.transition_load(Q, a, b, nu=task.scene.nu), ("ok",) * n
