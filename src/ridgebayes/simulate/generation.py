"""Scenes to contact tables: textures one by one or shared out, now or before, in one table."""

import functools
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

from ridgebayes.contact.many_textures import LoadFunction
from ridgebayes.errors import InputError
from ridgebayes.runtime.journal import Journal
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.scene.effects import Plan, full_profile
from ridgebayes.scene.estimates import plan
from ridgebayes.scene.scene import Scene, Texture
from ridgebayes.simulate.presets import LoadPreset
from ridgebayes.simulate.solvers import (
    SOLVERS,
    CylinderVisitor,
    friction_refused,
    many_loads,
    optional_effects,
    transition_curves,
    versions,
)
from ridgebayes.table.curves import Curve, curves_to_frame
from ridgebayes.table.table import ContactTable


def generate(
    scene: Scene,
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
    scene : Scene
        Textures, Poisson's ratio, highest load.
    solver : {"auto", "hertz", "half-plane", "cylinder-linear", "cylinder-fe"}
        ``"auto"`` simulates the effects that the scene calls for, see `scene.estimates.plan`;
        ``"half-plane"`` all that the scene gives but friction, at small strain; ``"hertz"`` is the
        smooth closed form in ridge units; ``"cylinder-linear"`` the whole cylinder at small
        strain by finite elements, of sharp, centred textures; ``"cylinder-fe"`` all that the scene
        gives on the whole cylinder, neo-Hookean at finite strain, by finite elements.
    rel_tol : float or None, scalar, dimensionless
        Wanted relative error of each load; None is that of `accuracy`, or the scene's if tighter.
    accuracy : str, optional
        ``quick`` (1e-4, and the coarse mesh of finite elements), ``standard`` (1e-8) or
        ``reference`` (1e-10, and a mesh twice as fine), see `ridgebayes.simulate.presets`.
    pressed : callable, optional
        Is given each texture that finite elements simulate: the cylinder, and its transitions with
        the states there, such as `ridgebayes.commands.fields.FieldFiles` writes to files. In this
        process only: not with an executor or a journal.
    executor : concurrent.futures.Executor, optional
        What textures are computed on, such as `ridgebayes.runtime.pool.workers` gives; one after
        another if not given. The result is the same.
    journal : Journal, optional
        Where each texture is kept when it is done. What is there already, of the same texture,
        options and version, is not computed again.
    progress : callable, optional
        Called with a line of text whenever a texture is done.

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
        has no transition, or over 65,536, under the load. All findings in one message. If workers
        have another version of this package.
    ComputationError
        If workers die, so that a texture cannot be computed.

    Notes
    -----
    *Validity.* But for "cylinder-fe" small strain: within 1 % of finite strain up to p/E = 0.015,
    of moderate grooves.

    *Preset.* As `contact.halfplane.transition_loads` and `contact.reaching.reaching_loads`;
    "hertz" is exact for its own question. Rows of "cylinder-fe" carry their mesh's error in
    `rel_se`, and in `edges` how many of its edges lie on a ridge; where finite elements stop
    converging a row says at which load.

    Over 200 sharp, centred textures share one function of b/a on the half-plane, with an error of
    a tenth of the tolerance or of 1e-8, whichever is less. Rows of "cylinder-linear" carry their
    mesh's error in `rel_se`.

    *Cost.* Milliseconds a texture; a second or so with floors, corners or an offset; of finite
    elements several seconds a transition, at small strain as long for all textures of one size.

    Examples
    --------
    >>> table = generate(Scene.of([(0.032, 0.01)], p_over_E=0.005))
    >>> frame = table.frame
    >>> frame["Q"].tolist(), [round(p, 10) for p in frame["p_over_E"].tolist()]
    ([4, 6], [0.0009778101, 0.0037869602])
    """
    if solver not in SOLVERS:
        raise InputError(f"solver = {solver!r}: must be one of {', '.join(SOLVERS)}")
    wanted = LoadPreset.named(accuracy)
    if pressed is not None and (executor is not None or journal is not None):
        raise InputError("pressed: cannot be combined with executor or journal")
    if rel_tol is None:
        rel_tol = min(wanted.load_error, scene.relative or wanted.load_error)
    refused = _not_by(solver, scene) if solver in ("hertz", "cylinder-linear") else []
    if refused:
        raise InputError("\n".join(f"scene: {problem}" for problem in refused))
    curves: list[Curve] = []
    problems: list[str] = []
    for found in _all_found(
        _tasks(scene, solver, rel_tol, wanted.meshes), pressed, executor, journal, progress
    ):
        if isinstance(found, str):
            problems.append(found)
        else:
            curves += found
    if problems:
        raise InputError("\n".join(problems))
    return ContactTable.from_frame(curves_to_frame(curves), where=curves[0].source)


@dataclass(frozen=True)
class _Task:
    """All that decides the curves of one texture; small enough to be sent to a process."""

    number: int
    scene: Scene  # of this texture alone
    planned: bool
    solver: str
    rel_tol: float
    meshes: tuple[int, ...]
    version: str
    loads: LoadFunction | None = None

    @property
    def texture(self) -> Texture:
        return self.scene.textures[0]

    @property
    def where(self) -> str:
        a, b = self.texture.a_over_R, self.texture.b_over_R
        return f"scene: textures[{self.number}] = ({a!r}, {b!r})"

    def given(self) -> dict[str, Any]:
        """Return the same for a journal: not its number, which may change."""
        return {
            "versions": versions(),
            "scene": self.scene.model_dump(mode="json"),
            "planned": self.planned,
            "solver": self.solver,
            "rel_tol": self.rel_tol,
            "meshes": list(self.meshes),
            "loads": None if self.loads is None else list(self.loads.given),
        }


def _tasks(scene: Scene, solver: str, rel_tol: float, meshes: tuple[int, ...]) -> list[_Task]:
    # There is nothing to plan where every effect given is simulated anyway.
    plain = not any(optional_effects(texture) for texture in scene.textures) and not scene.friction
    planned = not (plain and (scene.relative is None or solver != "auto"))
    by_half_plane = plain and not planned and solver in ("auto", "half-plane")
    loads = many_loads(scene, rel_tol) if by_half_plane else None
    return [
        _Task(
            number,
            scene.model_copy(update={"textures": (texture,)}),
            planned,
            solver,
            rel_tol,
            meshes,
            versions()["ridgebayes"],
            loads,
        )
        for number, texture in enumerate(scene.textures, start=1)
    ]


def _all_found(
    tasks: Sequence[_Task],
    pressed: "CylinderVisitor | None",
    executor: Executor | None,
    journal: Journal | None,
    progress: Callable[[str], None] | None,
) -> Iterator[list[Curve] | str]:
    """Yield what is found of each task, in order: from the journal, or computed and put there."""
    kept = {} if journal is None else _kept(tasks, journal)
    n_done = len(kept)

    def done(task: _Task, found: list[Curve] | str) -> None:
        nonlocal n_done
        n_done += 1
        if journal is not None and not isinstance(found, str):
            journal.keep(task.given(), [curve.to_dict() for curve in found])
        if progress is not None:
            progress(f"{n_done} of {len(tasks)} textures")

    solve = _solved if pressed is None else functools.partial(_solved, pressed=pressed)
    others = [task for task in tasks if task.number not in kept]
    computed = map_ordered(solve, others, executor, name=lambda task: task.where, done=done)
    for task in tasks:
        yield kept[task.number] if task.number in kept else next(computed)


def _kept(tasks: Sequence[_Task], journal: Journal) -> dict[int, list[Curve]]:
    """Return the curves that are in the journal, by the texture's number."""
    found = {task.number: journal.find(task.given()) for task in tasks if journal.exists()}
    return {
        number: [Curve.from_dict(values) for values in curves]
        for number, curves in found.items()
        if curves is not None
    }


def _solved(task: _Task, *, pressed: "CylinderVisitor | None" = None) -> list[Curve] | str:
    """Return the curves of a texture, or why it has none."""
    here = versions()["ridgebayes"]
    if task.version != here:
        raise InputError(
            f"a worker has ridgebayes {here}, this process {task.version}; expected the same on all"
        )
    if task.planned:
        (one,) = plan(task.scene)
    else:
        one = Plan(task.texture, (), full_profile(task.texture))
    refused = friction_refused(task.scene, one, task.solver)
    if refused:
        raise InputError(f"scene: {refused}")
    try:
        return list(
            transition_curves(
                one,
                task.scene,
                task.solver,
                task.rel_tol,
                meshes=task.meshes,
                loads=task.loads,
                pressed=pressed,
            )
        )
    except InputError as error:
        return f"{task.where}: {error}"


def _not_by(solver: str, scene: Scene) -> list[str]:
    return [
        f"textures[{number}]: {name}: is not simulated by {solver!r}"
        for number, texture in enumerate(scene.textures, start=1)
        for name in optional_effects(texture)
    ]
