"""`ridgebayes generate`: compute a table of transition loads, with a journal for resuming."""

import sys
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ridgebayes.commands import table_options as options
from ridgebayes.commands.parsing import medians_taken, refuse_output
from ridgebayes.commands.terminal import Answer, files_in, warn
from ridgebayes.errors import InputError
from ridgebayes.runtime.atomic import exclusive_lock
from ridgebayes.runtime.journal import Journal
from ridgebayes.runtime.pool import executor_for, map_ordered
from ridgebayes.runtime.progress import Progress
from ridgebayes.runtime.text import count
from ridgebayes.scene.effects import beyond_reach
from ridgebayes.scene.estimates import plan
from ridgebayes.scene.scene import Scene
from ridgebayes.scene.typed import parse_texture
from ridgebayes.simulate import generation
from ridgebayes.table.files import check_name
from ridgebayes.table.table import ContactTable


def command(asked: options.Generate) -> Answer:
    """Compute the table of a scene or of typed textures and write it."""
    refuse_output(asked.out, asked.force)
    check_name(asked.out)
    if asked.scene is not None and asked.texture:
        raise InputError("SCENE and --texture: expected only one of the two, got both")
    if asked.R is not None and not asked.texture:
        raise InputError("--R: needs --texture, with widths that have units")
    if asked.scene is not None:
        scene = Scene.from_toml(asked.scene)
    elif asked.texture:
        textures = [parse_texture(text, asked.R) for text in asked.texture]
        scene = Scene.of(textures, p_over_E=asked.p_max, nu=asked.nu)
    else:
        scene = Scene.paper()
    typed = (asked.p_max, asked.nu) != (options.Generate.p_max, options.Generate.nu)
    ignored = ["--p-max and --nu have no effect without --texture"] * (typed and not asked.texture)
    warned = warn(*ignored, *filter(None, [beyond_reach(scene, asked.solver)]))
    solving: Any = {"solver": asked.solver, "rel_tol": asked.tol, "accuracy": asked.accuracy}
    resources = {name: getattr(asked, name) for name in ("workers", "scheduler", "resume")}
    if asked.fields is None:
        table, left_out = sweep_job(asked.out, scene, force=asked.force, **resources, **solving)
    else:
        if any(resources.values()):
            raise InputError("--fields: cannot be combined with --workers, --scheduler or --resume")
        # Imported here because it loads matplotlib and finite elements, which sweeps do not need.
        from ridgebayes.commands.fields import generate_fields

        with exclusive_lock(asked.out):
            table = generate_fields(scene, asked.fields, force=asked.force, **solving)
            table.write(asked.out)
        left_out = _neglected_effects(scene, None, **solving)
    failed = len(table.left_out)
    rows = count(failed, "row is", "rows are")
    summary = f"{asked.out}: {count(len(table), 'row')}, {count(len(table.textures), 'texture')}"
    return Answer(
        (summary, *medians_taken(scene.uncertain_names), *left_out),
        {"rows": len(table), "textures": len(table.textures), "not_ok": failed},
        [asked.out, *(files_in(asked.fields) if asked.fields else ())],
        early=warned,
        problem=f"{rows} not ok, see column status of {asked.out}" if failed else "",
    )


def sweep_job(
    out: Path,
    scene: Scene,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    force: bool = False,
    **solving: Any,
) -> tuple[ContactTable, list[str]]:
    """Write the transition loads of a scene's textures as a table.

    Parameters
    ----------
    out : Path
        File of the table. Until it is written, finished textures are stored in the folder
        ``.<name>.journal`` beside it.
    scene : Scene
        Textures and loads.
    workers, scheduler : optional
        As in `ridgebayes.runtime.pool.executor_for`.
    resume : bool, optional
        Whether to use the textures in the journal of an earlier sweep.
    force : bool, optional
        Whether an existing journal may be deleted.
    **solving
        Solver, rel_tol and accuracy, as in `ridgebayes.generate`.

    Returns
    -------
    table : ContactTable
        Written table, which does not depend on the number of workers or interruptions.
    left_out : list of str
        Descriptions of effects that exceed the scene's accuracy and are not simulated.

    Raises
    ------
    InputError
        If `ridgebayes.generate` or `executor_for` raises it, a journal exists without `resume` or
        `force`, or another process writes the same table. New journals are removed; with
        `resume` finished textures are kept.
    ComputationError
        If worker processes die. Finished textures are kept in the journal.
    OutputError
        If the disk is full. Finished textures are kept in the journal.
    """
    context = executor_for(workers, scheduler)
    journal, n = journal_of(out), len(scene.textures)
    with exclusive_lock(out):
        if journal.exists() and not resume and not force:
            raise InputError(
                f"{journal.folder}: left by an earlier sweep; use --resume to continue it, or "
                "--force to start again"
            )
        with context as executor, _journal_report(journal, n, resume):
            if not resume:
                journal.remove()
            with Progress(1, name="textures"):
                table = generation.generate(scene, executor=executor, journal=journal, **solving)
            _print_resumed(journal, n, resume)
            left_out = _neglected_effects(scene, executor, **solving)
            table.write(out)
        journal.remove()
    return table, left_out


def journal_of(out: Path) -> Journal:
    """Return the journal of a table file."""
    return Journal(out.with_name(f".{out.name}.journal"))


def _neglected_effects(
    scene: Scene, executor: Executor | None, *, solver: str = "auto", **_: Any
) -> list[str]:
    """Describe the effects that exceed a scene's accuracy and are not simulated."""
    if solver != "auto" or scene.relative is None:
        return []
    scenes = [scene.model_copy(update={"textures": (texture,)}) for texture in scene.textures]
    return [
        f"a/R = {planned.texture.a_over_R:g}, b/R = {planned.texture.b_over_R:g}: {effect.name} "
        f"not simulated: estimated load change {effect.estimate:.1e}, accuracy {scene.relative:g}"
        for (planned,) in map_ordered(plan, scenes, executor)
        for effect in planned.left_out
    ]


@contextmanager
def _journal_report(journal: Journal, n_texture: int, resume: bool) -> Iterator[None]:
    """Print the number of textures in the journal if the sweep ends early.

    Invalid input removes the journal, unless it is resumed.
    """
    try:
        yield
    except InputError:
        if not resume:
            journal.remove()
        raise
    except BaseException:
        if n := journal.n_found + journal.n_kept:
            kept = f"{n} of {n_texture} textures are in {journal.folder}"
            print(f"{kept}: continue with --resume", file=sys.stderr, flush=True)
        raise


def _print_resumed(journal: Journal, n_texture: int, resume: bool) -> None:
    if journal.n_damaged:
        damaged = f"{journal.folder}: {journal.n_damaged} damaged textures, computed again"
        print(damaged, file=sys.stderr, flush=True)
    if resume:
        taken = f"{journal.n_found} of {n_texture} textures taken from the journal"
        print(taken, file=sys.stderr, flush=True)
