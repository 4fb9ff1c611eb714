"""Generation of contact tables from scenes, texture by texture, with a journal of results."""

import functools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor

import pandas as pd

from ridgebayes._types import NEO_HOOKEAN, Json, __version__
from ridgebayes.contact.halfplane import check_tolerance
from ridgebayes.errors import InputError, expect
from ridgebayes.runtime.journal import Journal
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.scene.effects import HIGHEST_LOAD, Plan, beyond_reach, full_profile
from ridgebayes.scene.estimates import plan
from ridgebayes.scene.scene import Scene, as_scene
from ridgebayes.simulate import solvers
from ridgebayes.simulate.solvers import LOAD_PRESETS, CylinderVisitor, TextureTask, optional_effects
from ridgebayes.table.table import ContactTable

_IF_ANY = ("rel_se", "offset_over_R", "edges")  # columns dropped if all values are zero


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
        Textures, Poisson's ratio and highest load.
    solver : {"auto", "hertz", "half-plane", "two-scale", "cylinder-linear", "cylinder-fe"}
        ``"auto"`` simulates the effects that matter in the scene, see `scene.estimates.plan`.
        ``"half-plane"`` simulates everything in the scene except friction, at small strain;
        ``"two-scale"`` the same ridges under the large deformation of a smooth cylinder.
        ``"hertz"`` is the smooth closed form in ridge units. ``"cylinder-linear"`` computes the
        whole cylinder at small strain by finite elements, for sharp, centred textures;
        ``"cylinder-fe"`` simulates everything in the scene on the whole cylinder, at finite
        strain, by finite elements.
    rel_tol : float or None, scalar, dimensionless
        Requested relative error of each load. If None, that of `accuracy`, or the scene's if
        smaller.
    accuracy : str, optional
        ``quick`` (1e-4, and the coarse mesh of finite elements), ``standard`` (1e-8) or
        ``reference`` (1e-10, and a mesh twice as fine), see `solvers.LoadPreset`.
    pressed : callable, optional
        Called for each texture simulated by finite elements, with the cylinder and its
        transitions, such as `ridgebayes.commands.fields`, which writes their states to files. It
        cannot be combined with an executor or a journal.
    executor : concurrent.futures.Executor, optional
        Executor of the textures, such as `ridgebayes.runtime.pool.workers`; they run in turn if
        not given. The result is the same.
    journal : Journal, optional
        Journal of finished textures. A texture in it, with the same options and version, is not
        computed again.
    progress : callable, optional
        Called with a line of text whenever a texture is finished.

    Returns
    -------
    ContactTable
        One row per transition with p/E at or below the load. Q counts ridges in contact, so it may
        be odd if the body is offset. A transition that could not be computed but is expected below
        the load (loads grow as k^2) has a row without a load, whose status gives the reason. An
        offset ``"uniform"`` gives eight curves, at offsets of 1/32, 3/32, ... of a pitch. `source`
        names the simulated effects, and the uncertain values, which are set to their medians.

    Raises
    ------
    InputError
        If the solver is unknown, the scene has effects that the solver cannot simulate, or a
        texture has no transition, or over 65,536, below the load; one message lists all errors. If
        workers have another version of this package. If a load is above p/E = 0.5, or above 0.1
        with nu below 0.3, for "auto" and "two-scale".
    ComputationError
        If workers die, so that a texture cannot be computed.

    Notes
    -----
    *Validity.* All solvers except "two-scale" and "cylinder-fe" are for small strain: within 1 % of
    finite strain up to p/E = 0.015, for moderate grooves. The status of "two-scale" rows marks
    loads above those compared with finite elements. Without a stated accuracy "auto" is
    "half-plane" up to p/E = 0.1, and "two-scale" above.

    *Accuracy.* See `contact.halfplane.transition_loads` and `contact.reaching.reaching_loads`;
    "hertz" is exact for a smooth body. For "two-scale", `rel_se` is the error of the separation of
    scales. For "cylinder-fe" and "cylinder-linear" it is the mesh's error, and `edges` is the
    number of edges on a ridge. If finite elements stop converging, a row gives the load.

    *Cost.* Milliseconds for a texture, about a second with floors, corners or an offset. Finite
    elements take several seconds for a transition, at small strain a second for a texture.

    Examples
    --------
    >>> table = generate(Scene.of([(0.032, 0.01)], p_over_E=0.005))
    >>> frame = table.frame
    >>> frame["Q"].tolist(), [round(p, 10) for p in frame["p_over_E"].tolist()]
    ([4, 6], [0.0009778101, 0.0037869602])
    """
    expect(str, solver=solver, accuracy=accuracy)
    expect(Journal, None, journal=journal)
    expect(Callable, None, progress=progress, pressed=pressed)
    if solver not in solvers.SOLVERS:
        raise InputError(f"solver = {solver!r}: must be one of {', '.join(solvers.SOLVERS)}")
    if accuracy not in LOAD_PRESETS:
        raise InputError(f"accuracy: expected one of {', '.join(LOAD_PRESETS)}, got {accuracy!r}")
    scene, preset = as_scene(scene), LOAD_PRESETS[accuracy]
    if pressed is not None and (executor is not None or journal is not None):
        raise InputError("pressed: cannot be combined with executor or journal")
    if rel_tol is None:
        rel_tol = min(preset.load_error, scene.relative or preset.load_error)
    check_tolerance(rel_tol)
    if solver in ("hertz", "cylinder-linear"):
        refused = [
            f"scene: textures[{number}]: {name}: is not simulated by {solver!r}"
            for number, texture in enumerate(scene.textures, start=1)
            for name in optional_effects(texture)
        ]
        if refused:
            raise InputError("\n".join(refused))
    beyond_reach(scene, solver)
    # If a mesh cannot pass a corner, a coarser one may: its rim slides by less than an edge.
    meshes = tuple(edges for edges in reversed(solvers.ELEMENTS_SE) if edges <= preset.edges)
    tasks = _tasks(scene.at_medians(), solver, rel_tol, meshes)
    solve = functools.partial(_solved, pressed=pressed) if pressed is not None else _solved
    results = _results_of(tasks, solve, executor, journal, progress)
    if problems := [text for text in results if isinstance(text, str)]:
        raise InputError("\n".join(problems))
    curves = [curve for some in results if not isinstance(some, str) for curve in some]
    frame = pd.concat([pd.DataFrame(curve) for curve in curves], ignore_index=True)
    frame = frame.drop(columns=[name for name in _IF_ANY if not frame[name].any()])
    if scene.uncertain_names:
        frame["source"] += f" medians={'+'.join(scene.uncertain_names)}"
    return ContactTable.from_frame(frame, where=frame["source"].iloc[0])


def _tasks(scene: Scene, solver: str, rel_tol: float, meshes: tuple[int, ...]) -> list[TextureTask]:
    # Nothing has to be planned if every effect in the scene is simulated anyway.
    plain = not any(optional_effects(texture) for texture in scene.textures)
    plain = plain and not scene.friction and scene.ogden == NEO_HOOKEAN
    high = max(scene.highest_load(texture) for texture in scene.textures) > HIGHEST_LOAD
    planned = not (plain and ((scene.relative is None and not high) or solver != "auto"))
    tasks = []
    for number, texture in enumerate(scene.textures, start=1):
        alone = scene.model_copy(update={"textures": (texture,)})
        tasks.append(TextureTask(number, alone, planned, solver, rel_tol, meshes))
    return tasks


def _results_of(
    tasks: Sequence[TextureTask],
    solve: "Callable[[TextureTask], list[Json] | str]",
    executor: Executor | None,
    journal: Journal | None,
    progress: Callable[[str], None] | None,
) -> "list[list[Json] | str]":
    """Return the result of each task, from the journal, or computed and added to it."""
    results: dict[int, list[Json] | str] = {}
    for task in tasks:
        if journal is not None and (kept := journal.find(task.given())) is not None:
            results[task.number] = kept

    def done(task: TextureTask, result: list[Json] | str) -> None:
        results[task.number] = result
        if journal is not None and not isinstance(result, str):
            journal.keep(task.given(), result)
        if progress is not None:
            progress(f"{len(results)} of {len(tasks)} textures")

    others = [task for task in tasks if task.number not in results]
    for _ in map_ordered(solve, others, executor, name=lambda task: task.where, done=done):
        pass
    return [results[task.number] for task in tasks]


def _solved(task: TextureTask, *, pressed: "CylinderVisitor | None" = None) -> list[Json] | str:
    """Return the curves of a texture, or the reason why it has none."""
    if task.version != __version__:
        other = f"a worker has ridgebayes {__version__}, this process {task.version}"
        raise InputError(f"{other}; expected the same on all")
    as_given = Plan(task.texture, (), full_profile(task.texture))
    effects = plan(task.scene)[0] if task.planned else as_given
    if refused := solvers.friction_refused(task.scene, effects, task.solver):
        raise InputError(f"scene: {refused}")
    try:
        return list(solvers.transition_curves(task, effects, pressed))
    except InputError as error:
        return f"{task.where}: {error}"
