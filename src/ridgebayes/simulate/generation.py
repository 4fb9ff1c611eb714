"""Scenes to contact tables: textures one by one or shared out, now or before, in one table."""

import functools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import pandas as pd

from ridgebayes._types import NEO_HOOKEAN, Json
from ridgebayes.contact.contact_solution import DEFAULT_REL_TOL
from ridgebayes.errors import InputError
from ridgebayes.runtime.journal import Journal
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.scene.effects import HIGHEST_LOAD, Plan, beyond_reach, full_profile
from ridgebayes.scene.estimates import plan
from ridgebayes.scene.scene import Scene, as_scene
from ridgebayes.simulate import solvers
from ridgebayes.simulate.solvers import CylinderVisitor, TextureTask, optional_effects, versions
from ridgebayes.table.table import ContactTable


@dataclass(frozen=True)
class LoadPreset:
    """How far errors of loads are pressed down.

    Parameters
    ----------
    load_error : float
        Promised relative error of a load by the half-plane.
    meshes : tuple of int
        Edges of finite elements a ridge, finest first: where one cannot pass a corner, the next
        goes on.
    """

    load_error: float
    meshes: tuple[int, ...]


_IF_ANY = ("rel_se", "offset_over_R", "edges")  # columns that only some solvers fill
LOAD_PRESETS = {
    "quick": LoadPreset(1e-4, tuple(solvers.ELEMENTS_SE)[2:]),
    "standard": LoadPreset(DEFAULT_REL_TOL, tuple(solvers.ELEMENTS_SE)[1:]),
    "reference": LoadPreset(1e-10, tuple(solvers.ELEMENTS_SE)),
}


def generate(
    scene: Scene | str | os.PathLike[str],
    *,
    solver: str = "auto",
    rel_tol: float | None = None,
    accuracy: str = "standard",
    pressed: "CylinderVisitor | None" = None,
    executor: Executor | None = None,
    journal: Journal | None = None,
    progress: Callable[[str], None] | None = None,
) -> ContactTable:
    """Compute the transition loads of a scene's textures, up to its load.

    Parameters
    ----------
    scene : Scene or path
        Textures, Poisson's ratio, highest load.
    solver : {"auto", "hertz", "half-plane", "two-scale", "cylinder-linear", "cylinder-fe"}
        ``"auto"`` simulates the effects that matter in the scene, see `scene.estimates.plan`.
        ``"half-plane"`` simulates everything in the scene but friction, at small strain;
        ``"two-scale"`` the same ridges under the large deformation of a smooth cylinder.
        ``"hertz"`` is the smooth closed form in ridge units. ``"cylinder-linear"`` computes the
        whole cylinder at small strain by finite elements, for sharp, centred textures;
        ``"cylinder-fe"`` simulates everything in the scene on the whole cylinder, at finite
        strain, by finite elements.
    rel_tol : float or None, scalar, dimensionless
        Required relative error of each load. If None that of `accuracy`, or the scene's if smaller.
    accuracy : str, optional
        ``quick`` (1e-4, and the coarse mesh of finite elements), ``standard`` (1e-8) or
        ``reference`` (1e-10, and a mesh twice as fine), see `LoadPreset`.
    pressed : callable, optional
        Called for each texture that finite elements simulate, with the cylinder, its transitions
        and the states there, as `ridgebayes.commands.fields` writes them to files. Not possible
        with an executor or a journal.
    executor : concurrent.futures.Executor, optional
        Where textures are computed, for example `ridgebayes.runtime.pool.workers`; one after
        another if not given. The result is the same.
    journal : Journal, optional
        Where finished textures are saved. A texture that is already there, with the same options
        and version, is not computed again.
    progress : callable, optional
        Called with a line of text whenever a texture is done.

    Returns
    -------
    ContactTable
        A row per transition with p/E at or below the load. Q counts ridges in contact, so it may be
        odd if the body is offset. A transition that could not be computed but is expected below
        the load (loads grow as k^2) has a row without a load, and its status says why. An offset
        ``"uniform"`` gives eight curves, at offsets of 1/32, 3/32, ... of a pitch. `source` names
        the effects that were simulated, and the uncertain values, whose medians are used.

    Raises
    ------
    InputError
        If the solver is unknown, the scene asks for what the solver cannot simulate, or a texture
        has no transition, or over 65,536, under the load. All findings in one message. If workers
        have another version of this package. If a load is above p/E = 0.5, or 0.1
        where nu is under 0.3, for "auto" and "two-scale".
    ComputationError
        If workers die, so that a texture cannot be computed.

    Notes
    -----
    *Validity.* But for "two-scale" and "cylinder-fe" small strain: within 1 % of finite strain up
    to p/E = 0.015, of moderate grooves. Rows of "two-scale" above the load to which it was held
    against finite elements say so in their status. Without a stated accuracy "auto" is
    "half-plane" up to p/E = 0.1, and "two-scale" above.

    *Preset.* As `contact.halfplane.transition_loads` and `contact.reaching.reaching_loads`;
    "hertz" is exact for its own question. Rows of "two-scale" carry what is neglected in `rel_se`.
    Rows of "cylinder-fe" carry their mesh's error in `rel_se`, and in `edges` how many of its
    edges lie on a ridge; where finite elements stop converging a row says at which load.

    Rows of "cylinder-linear" carry their mesh's error in `rel_se`.

    *Cost.* Milliseconds a texture; a second or so with floors, corners or an offset; of finite
    elements several seconds a transition, at small strain a second a texture.

    Examples
    --------
    >>> table = generate(Scene.of([(0.032, 0.01)], p_over_E=0.005))
    >>> frame = table.frame
    >>> frame["Q"].tolist(), [round(p, 10) for p in frame["p_over_E"].tolist()]
    ([4, 6], [0.0009778101, 0.0037869602])
    """
    if solver not in solvers.SOLVERS:
        raise InputError(f"solver = {solver!r}: must be one of {', '.join(solvers.SOLVERS)}")
    if accuracy not in LOAD_PRESETS:
        raise InputError(f"accuracy: expected one of {', '.join(LOAD_PRESETS)}, got {accuracy!r}")
    scene, wanted = as_scene(scene), LOAD_PRESETS[accuracy]
    if pressed is not None and (executor is not None or journal is not None):
        raise InputError("pressed: cannot be combined with executor or journal")
    if rel_tol is None:
        rel_tol = min(wanted.load_error, scene.relative or wanted.load_error)
    if solver in ("hertz", "cylinder-linear"):
        refused = [
            f"scene: textures[{number}]: {name}: is not simulated by {solver!r}"
            for number, texture in enumerate(scene.textures, start=1)
            for name in optional_effects(texture)
        ]
        if refused:
            raise InputError("\n".join(refused))
    beyond_reach(scene, solver)
    tasks = _tasks(scene.at_medians(), solver, rel_tol, wanted.meshes)
    solve = functools.partial(_solved, pressed=pressed) if pressed is not None else _solved
    results = _all_found(tasks, solve, executor, journal, progress)
    if problems := [text for text in results if isinstance(text, str)]:
        raise InputError("\n".join(problems))
    curves = [curve for some in results if not isinstance(some, str) for curve in some]
    frame = pd.concat([pd.DataFrame(curve) for curve in curves], ignore_index=True)
    frame = frame.drop(columns=[name for name in _IF_ANY if not frame[name].any()])
    if scene.uncertain_names:
        frame["source"] += f" medians={'+'.join(scene.uncertain_names)}"
    return ContactTable.from_frame(frame, where=frame["source"].iloc[0])


def _tasks(scene: Scene, solver: str, rel_tol: float, meshes: tuple[int, ...]) -> list[TextureTask]:
    # There is nothing to plan where every effect given is simulated anyway.
    plain = not any(optional_effects(texture) for texture in scene.textures)
    plain = plain and not scene.friction and scene.ogden == NEO_HOOKEAN
    high = max(scene.highest_load(texture) for texture in scene.textures) > HIGHEST_LOAD
    planned = not (plain and ((scene.relative is None and not high) or solver != "auto"))
    tasks = []
    for number, texture in enumerate(scene.textures, start=1):
        alone = scene.model_copy(update={"textures": (texture,)})
        tasks.append(TextureTask(number, alone, planned, solver, rel_tol, meshes))
    return tasks


def _all_found(
    tasks: Sequence[TextureTask],
    solve: "Callable[[TextureTask], list[Json] | str]",
    executor: Executor | None,
    journal: Journal | None,
    progress: Callable[[str], None] | None,
) -> "list[list[Json] | str]":
    """Return the result of each task, in order: from the journal, or computed and put there."""
    all_found: dict[int, list[Json] | str] = {}
    for task in tasks:
        if journal is not None and (kept := journal.find(task.given())) is not None:
            all_found[task.number] = kept

    def done(task: TextureTask, result: list[Json] | str) -> None:
        all_found[task.number] = result
        if journal is not None and not isinstance(result, str):
            journal.keep(task.given(), result)
        if progress is not None:
            progress(f"{len(all_found)} of {len(tasks)} textures")

    others = [task for task in tasks if task.number not in all_found]
    for _ in map_ordered(solve, others, executor, name=lambda task: task.where, done=done):
        pass
    return [all_found[task.number] for task in tasks]


def _solved(task: TextureTask, *, pressed: "CylinderVisitor | None" = None) -> list[Json] | str:
    """Return the curves of a texture, or why it has none."""
    here = versions()["ridgebayes"]
    if task.version != here:
        other = f"a worker has ridgebayes {here}, this process {task.version}"
        raise InputError(f"{other}; expected the same on all")
    as_given = Plan(task.texture, (), full_profile(task.texture))
    effects = plan(task.scene)[0] if task.planned else as_given
    if refused := solvers.friction_refused(task.scene, effects, task.solver):
        raise InputError(f"scene: {refused}")
    try:
        return list(solvers.transition_curves(task, effects, pressed))
    except InputError as error:
        return f"{task.where}: {error}"
