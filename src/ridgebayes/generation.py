"""Scenes to contact tables: which solver, which transitions, what it said of each."""

import importlib.metadata
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact import halfplane, hertz
from ridgebayes.contact.lands import Profile
from ridgebayes.contact.pressed import load_factor
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.effects import FINITE_ELEMENT_ERROR, Plan, given_profile, plan
from ridgebayes.errors import InputError
from ridgebayes.scene import Scene, Texture
from ridgebayes.table import ContactTable

if TYPE_CHECKING:
    from ridgebayes.contact.cylinder.cylinder import Cylinder, Reached

SOLVERS = ("auto", "hertz", "half-plane", "cylinder-fe")
# A texture asking for more is a slip of units; beyond the solver's cap rows have no load anyway.
_MAX_TRANSITIONS = 65_536

# Q, loads and status of one texture's transitions up to p/E.
_Curve: TypeAlias = tuple[IntArray, FloatArray, tuple[str, ...]]


def generate(
    scene: Scene,
    *,
    solver: str = "auto",
    rel_tol: float | None = None,
    pressed: "_Pressed | None" = None,
) -> ContactTable:
    """Compute the transition loads of a scene's textures, up to its load.

    Parameters
    ----------
    scene : Scene
        Textures, Poisson's ratio, highest load.
    solver : {"auto", "hertz", "half-plane", "cylinder-fe"}
        ``"auto"`` simulates the effects that the scene calls for, see `ridgebayes.effects.plan`;
        ``"half-plane"`` all that the scene gives but friction, at small strain; ``"hertz"`` is the
        smooth closed form in ridge units; ``"cylinder-fe"`` all that the scene gives on the whole
        cylinder, neo-Hookean at finite strain, by finite elements.
    rel_tol : float or None, scalar, dimensionless
        Wanted relative error of each load; None is the scene's, and 1e-8 if that is looser.
    pressed : callable, optional
        Is given each texture that finite elements simulate: the cylinder, and its transitions with
        the states there, such as `ridgebayes.field_files.FieldFiles` writes to files.

    Returns
    -------
    ContactTable
        A row per transition with p/E at or below the load; Q counts ridges in contact, so that it
        may be odd where the body is offset. A transition that was not computed but should lie
        below the load, by the growth as k^2 of those before it, stands there without a load, its
        status saying why. An offset ``"uniform"`` is eight curves, at offsets of 1/32, 3/32, ...
        of a pitch. `source` names the effects that were simulated.

    Raises
    ------
    InputError
        If the solver is unknown, the scene asks for what the solver cannot simulate, or a texture
        has no transition, or over 65,536, under the load. All findings in one message.

    Notes
    -----
    *Validity.* But for "cylinder-fe" small strain: within 1 % of finite strain up to p/E = 0.015,
    of moderate grooves.

    *Accuracy.* As `contact.halfplane.transition_loads` and `contact.reaching.reaching_loads`;
    "hertz" is exact for its own question. Rows of "cylinder-fe" carry their mesh's error in
    `rel_se`, and in `edges` how many of its edges lie on a ridge; where finite elements stop
    converging a row says at which load.

    *Cost.* Milliseconds a texture; a second or so with floors, corners or an offset; of finite
    elements several seconds a transition.

    Examples
    --------
    >>> table = generate(Scene.of([(0.032, 0.01)], p_over_E=0.005))
    >>> frame = table.frame
    >>> frame["Q"].tolist(), [round(p, 10) for p in frame["p_over_E"].tolist()]
    ([4, 6], [0.0009778101, 0.0037869602])
    """
    if solver not in SOLVERS:
        raise InputError(f"solver = {solver!r}: must be one of {', '.join(SOLVERS)}")
    plans = _plans(scene, solver)
    problems = _not_simulated(scene, plans, solver)
    if problems:
        raise InputError("\n".join(f"scene: {problem}" for problem in problems))
    if rel_tol is None:
        rel_tol = min(halfplane.DEFAULT_REL_TOL, scene.relative or halfplane.DEFAULT_REL_TOL)
    frames = []
    for number, one in enumerate(plans, start=1):
        texture = one.texture
        where = f"scene: textures[{number}] = ({texture.a_over_R!r}, {texture.b_over_R!r})"
        try:
            frames += list(_curves(one, scene, solver, rel_tol, pressed))
        except InputError as error:
            problems.append(f"{where}: {error}")
    if problems:
        raise InputError("\n".join(problems))
    frame = pd.concat(frames, ignore_index=True)
    columns = [name for name in _COLUMNS if name not in _IF_ANY or frame[name].any()]
    return ContactTable.from_frame(frame[columns], where=str(frame["source"].iloc[0]))


def _plans(scene: Scene, solver: str) -> list[Plan]:
    """Plan what there is to decide: nothing where every effect given is simulated anyway."""
    plain = not any(_given(texture) for texture in scene.textures) and not scene.friction
    if plain and (scene.relative is None or solver != "auto"):
        return [Plan(texture, (), given_profile(texture)) for texture in scene.textures]
    return plan(scene)


def _curves(
    one: Plan, scene: Scene, solver: str, rel_tol: float, pressed: "_Pressed | None"
) -> Iterator[pd.DataFrame]:
    """Yield the curves of a texture: one, or several offsets."""
    texture = one.texture
    p_max = scene.highest_load(texture)
    profile = one.profile if solver == "auto" else given_profile(texture)
    if profile is None and one.needs_finite_elements:
        profile = given_profile(texture)
    smooth = solver == "hertz" or profile is None
    by_elements = _by_elements(one, solver)
    names = ["ridges", *_given(texture)]
    if solver == "auto":
        names = [name for name in names if name in one.simulated or not one.effects]
    if by_elements:
        names += ["finite body and large deformation"] + ["friction"] * (scene.friction > 0)
    offsets = [0.0]
    if profile is not None and profile.offset:
        offsets = list(UNIFORM) if texture.offset == "uniform" else [profile.offset]
    for offset in offsets:
        if smooth or profile is None:
            found = _many(texture, scene, p_max, _hertz, rel_tol)
            yield _frame(found, texture, scene, offset, "hertz", "effects=none")
            continue
        effects = "effects=" + "+".join(names).replace(" ", "-")
        here = replace(profile, offset=offset)
        if by_elements:
            for found, edges, body, reached in _elements(here, scene, p_max):
                yield _frame(found, texture, scene, offset, "cylinder-fe", effects, edges)
                if pressed is not None:
                    pressed(texture, body, reached)
            continue
        if here == Profile(here.a, here.b):
            found = _many(texture, scene, p_max, _half_plane, rel_tol)
        else:
            found = _events(here, scene, p_max, rel_tol)
        how = f"{effects} rel_tol={rel_tol:g}"
        yield _frame(found, texture, scene, offset, "half-plane", how)


def _frame(
    found: _Curve,
    texture: Texture,
    scene: Scene,
    offset: float,
    solver: str,
    how: str,
    edges: int = 0,
) -> pd.DataFrame:
    Q, p_over_E, status = found
    return pd.DataFrame(
        {
            "a_over_R": texture.a_over_R,
            "b_over_R": texture.b_over_R,
            "Q": Q,
            "p_over_E": p_over_E,
            "rel_se": _ELEMENTS_SE.get(edges, 0.0),
            "nu": scene.nu,
            "offset_over_R": offset * (texture.a_over_R + texture.b_over_R),
            "role": texture.role,
            "solver": solver,
            "status": list(status),
            "source": f"ridgebayes {importlib.metadata.version('ridgebayes')} {solver} {how}",
            "edges": edges,
        }
    )


UNIFORM = tuple((2 * i + 1) / 32 for i in range(8))  # offsets that stand for any, and their mirrors


def _given(texture: Texture) -> list[str]:
    given = {
        "offset": texture.offset != 0.0,
        "groove floor": texture.groove_depth_over_R is not None,
        "corner radius": texture.corner_radius_over_R != 0.0,
    }
    return [name for name, on in given.items() if on]


_COLUMNS = [
    "a_over_R",
    "b_over_R",
    "Q",
    "p_over_E",
    "rel_se",
    "nu",
    "offset_over_R",
    "role",
    "solver",
    "status",
    "source",
    "edges",
]


_IF_ANY = ("rel_se", "offset_over_R", "edges")
# Edges a ridge of the mesh, and the relative error of its loads: docs/validation/cylinder.md. Where
# the fine one's rim cannot pass a corner a coarser one can: what slides is less than its edge.
_ELEMENTS_SE = {24: 1e-3, 10: 4e-3}


def _by_elements(one: Plan, solver: str) -> bool:
    return solver == "cylinder-fe" or (solver == "auto" and one.needs_finite_elements)


def _not_simulated(scene: Scene, plans: Sequence[Plan], solver: str) -> list[str]:
    """List what the scene asks for beyond these solvers."""
    problems = []
    for number, one in enumerate(plans, start=1):
        friction = next((effect for effect in one.effects if effect.name == "friction"), None)
        wanted = max(scene.relative or 0.0, FINITE_ELEMENT_ERROR if solver == "auto" else 0.0)
        if (
            friction is not None
            and not _by_elements(one, solver)
            and not friction.estimate <= wanted
        ):
            problems.append(
                f"friction = {scene.friction!r}: changes loads by up to {friction.estimate:.2g}, "
                f"and is not simulated by {solver!r}; rule: at most the wanted accuracy, "
                f"{scene.relative or 0.0:g}, or 'cylinder-fe'"
            )
            break
        if solver == "hertz":
            problems += [
                f"textures[{number}]: {name}: is not simulated by 'hertz'"
                for name in _given(one.texture)
            ]
    return problems


def _many(texture: Texture, scene: Scene, p_max: float, solve: "_Solver", rel_tol: float) -> _Curve:
    """Return the transitions of one texture up to the load, by a solver of the first n of them."""
    pitch = texture.a_over_R + texture.b_over_R
    n_transitions, loads = 8, np.zeros(0)
    while not (loads.size and loads[-1] > p_max):
        if n_transitions > _MAX_TRANSITIONS:
            raise InputError(f"over {_MAX_TRANSITIONS} transitions under p/E = {p_max!r}")
        p_over_E, status = solve(texture, scene.nu, n_transitions, rel_tol)
        loads = _filled(p_over_E, pitch, scene.nu)
        n_transitions *= 2
    k = np.arange(1, loads.size + 1)
    keep = loads <= p_max
    if not keep.any():
        raise InputError(f"no transition under p/E = {p_max!r}: the first is at {loads[0]:.4g}")
    kept = tuple(text for text, under in zip(status, keep, strict=True) if under)
    return 2 + 2 * k[keep], p_over_E[keep], kept


def _events(profile: Profile, scene: Scene, p_max: float, rel_tol: float) -> _Curve:
    """Return the transitions of any profile up to the load: a table holds those from Q = 4 on."""
    factor = load_factor(scene.nu)
    found = reaching_loads(profile, W_max=factor * p_max, n_max=_MAX_TRANSITIONS, rel_tol=rel_tol)
    keep = found.Q >= 4
    if not keep.any():
        raise InputError(f"no transition to 4 edges or more under p/E = {p_max!r}")
    status = tuple(text for text, kept in zip(found.status, keep, strict=True) if kept)
    return found.Q[keep], found.W[keep] / factor, status


def _elements(
    profile: Profile, scene: Scene, p_max: float
) -> "Iterator[tuple[_Curve, int, Cylinder, list[Reached]]]":
    """Yield the transitions by finite elements, mesh by mesh; what was found, and why no more."""
    from ridgebayes.contact.cylinder.cylinder import Cylinder, Fineness, transition_curve

    last = 3  # a table holds transitions from Q = 4 on
    for edges in _ELEMENTS_SE:
        fineness = Fineness(edges)
        body = Cylinder(
            profile, p_max=p_max, nu=scene.nu, friction=scene.friction, fineness=fineness
        )
        reached: list[Reached] = []
        Q, p_over_E, status = transition_curve(body, p_max, seen=reached.append)
        done = all(text == "ok" for text in status)
        keep = last < Q
        if not done and edges != min(_ELEMENTS_SE):
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


def _half_plane(
    texture: Texture, nu: float, n_transitions: int, rel_tol: float
) -> tuple[FloatArray, tuple[str, ...]]:
    a, b = texture.a_over_R, texture.b_over_R
    loads = halfplane.transition_loads(a, b, n_transitions, rel_tol=rel_tol)
    return loads.p_over_E(a + b, nu=nu), loads.status


def _hertz(
    texture: Texture, nu: float, n_transitions: int, rel_tol: float
) -> tuple[FloatArray, tuple[str, ...]]:
    Q = 2 + 2 * np.arange(1, n_transitions + 1)
    loads = hertz.transition_load(Q, texture.a_over_R, texture.b_over_R, nu=nu)
    return loads, ("ok",) * n_transitions


_Solver: TypeAlias = Callable[[Texture, float, int, float], tuple[FloatArray, tuple[str, ...]]]
_Pressed: TypeAlias = "Callable[[Texture, Cylinder, Sequence[Reached]], None]"
