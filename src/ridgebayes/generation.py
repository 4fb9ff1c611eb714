"""Scenes to contact tables: which solver, which transitions, what it said of each."""

import importlib.metadata
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray
from ridgebayes.contact import halfplane, hertz
from ridgebayes.errors import InputError
from ridgebayes.scene import Scene, Texture
from ridgebayes.table import ContactTable

SOLVERS = ("auto", "hertz", "half-plane")
# A texture asking for more is a slip of units; beyond the solver's cap rows have no load anyway.
_MAX_TRANSITIONS = 8192

# Loads of the transitions 1 ... n of one texture, with a status each.
_Solver: TypeAlias = Callable[[Texture, float, int, float], tuple[FloatArray, tuple[str, ...]]]


def generate(scene: Scene, *, solver: str = "auto", rel_tol: float | None = None) -> ContactTable:
    """Compute the transition loads of a scene's textures, up to its load.

    Parameters
    ----------
    scene : Scene
        Textures, Poisson's ratio, highest load.
    solver : {"auto", "hertz", "half-plane"}
        ``"auto"`` is the half-plane; ``"hertz"`` the smooth closed form in ridge units.
    rel_tol : float or None, scalar, dimensionless
        Wanted relative error of each load; None is the scene's, and 1e-8 if that is looser.

    Returns
    -------
    ContactTable
        A row per transition with p/E at or below the load, Q = 2 + 2k. A transition that was
        not computed but should lie below the load, by the growth as k^2 of those before it, stands
        there without a load, its status saying why.

    Raises
    ------
    InputError
        If the solver is unknown, the scene asks for what it cannot simulate (a finite groove
        depth, round corners, an offset, friction), or a texture has no transition, or over
        8,192, under the load. All findings in one message.

    Notes
    -----
    *Validity.* Small strain: within 1 % of finite strain up to p/E = 0.015, of moderate grooves.

    *Accuracy.* As `contact.halfplane.transition_loads`; "hertz" is exact for its own question.

    *Cost.* Milliseconds a texture.

    Examples
    --------
    >>> table = generate(Scene.of([(0.032, 0.01)], p_over_E=0.005))
    >>> frame = table.frame
    >>> frame["Q"].tolist(), [round(p, 10) for p in frame["p_over_E"].tolist()]
    ([4, 6], [0.0009778101, 0.0037869602])
    """
    if solver not in SOLVERS:
        hint = " is not simulated in this version;" if solver == "cylinder-fe" else ":"
        raise InputError(f"solver = {solver!r}{hint} must be one of {', '.join(SOLVERS)}")
    problems = _not_simulated(scene)
    if problems:
        raise InputError("\n".join(f"scene: {problem}" for problem in problems))
    name = "hertz" if solver == "hertz" else "half-plane"
    if rel_tol is None:
        rel_tol = min(halfplane.DEFAULT_REL_TOL, scene.relative or halfplane.DEFAULT_REL_TOL)
    source = f"ridgebayes {importlib.metadata.version('ridgebayes')} {name}"
    if name == "half-plane":
        source += f" rel_tol={rel_tol:g}"

    frames = []
    for number, texture in enumerate(scene.textures, start=1):
        where = f"scene: textures[{number}] = ({texture.a_over_R!r}, {texture.b_over_R!r})"
        try:
            frames.append(_rows(texture, scene, _SOLVERS[name], rel_tol))
        except InputError as error:
            problems.append(f"{where}: {error}")
    if problems:
        raise InputError("\n".join(problems))
    frame = pd.concat(frames, ignore_index=True)
    return ContactTable.from_frame(frame.assign(solver=name, source=source)[_COLUMNS], where=source)


_COLUMNS = ["a_over_R", "b_over_R", "Q", "p_over_E", "nu", "role", "solver", "status", "source"]


def _not_simulated(scene: Scene) -> list[str]:
    """List what the scene asks for beyond these solvers."""
    asked: list[tuple[str, object, bool]] = [("friction", scene.friction, scene.friction != 0.0)]
    for number, texture in enumerate(scene.textures, start=1):
        depth, corner, offset = (
            texture.groove_depth_over_R,
            texture.corner_radius_over_R,
            texture.offset,
        )
        asked += [
            (f"textures[{number}].groove_depth_over_R", depth, depth is not None),
            (f"textures[{number}].corner_radius_over_R", corner, corner != 0.0),
            (f"textures[{number}].offset", offset, offset != 0.0),
        ]
    return [
        f"{key} = {value!r}: is not simulated in this version" for key, value, on in asked if on
    ]


def _rows(texture: Texture, scene: Scene, solve: _Solver, rel_tol: float) -> pd.DataFrame:
    """Return the transitions of one texture up to the load."""
    p_max = scene.p_over_E if texture.max_p_over_E is None else texture.max_p_over_E
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
    return pd.DataFrame(
        {
            "a_over_R": texture.a_over_R,
            "b_over_R": texture.b_over_R,
            "Q": 2 + 2 * k[keep],
            "p_over_E": p_over_E[keep],
            "nu": scene.nu,
            "role": texture.role,
            "status": [text for text, kept in zip(status, keep, strict=True) if kept],
        }
    )


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


_SOLVERS: dict[str, _Solver] = {"hertz": _hertz, "half-plane": _half_plane}
