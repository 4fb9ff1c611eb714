"""`ridgebayes cost`: what each accuracy costs on this machine, with this table."""

import platform
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from ridgebayes.checks.cost.loads import load_settings
from ridgebayes.checks.cost.measured import COST_COLUMNS, LEVELS, Setting, cheapest, measure, pareto
from ridgebayes.checks.cost.posteriors import posterior_settings
from ridgebayes.commands import table_options as options
from ridgebayes.commands.run_folder import new_folder, write_csv, write_page
from ridgebayes.commands.terminal import Answer, files_in
from ridgebayes.drawing.costs import plot_cost
from ridgebayes.drawing.style import save
from ridgebayes.model.forms import Hybrid
from ridgebayes.runtime.pool import executor_for, map_ordered
from ridgebayes.runtime.progress import Progress
from ridgebayes.scene.scene import Scene
from ridgebayes.simulate.generation import generate
from ridgebayes.table.datafiles import paper_sweep
from ridgebayes.table.table import ContactTable, read_table

COST_CSV = "cost.csv"
_Row = dict[str, float | int | str]


@dataclass(frozen=True)
class CostRequest:
    """Inputs of a measurement of costs.

    Parameters
    ----------
    table : ContactTable
        Table that forms and Hybrid's posterior are fitted to.
    given_texture : (float, float), optional
        Texture whose loads are computed; the middle one of the table if not given.
    p_max : float, optional
        Highest load p/E.
    elements : bool, optional
        Whether finite elements run: a minute, and the best reference.
    repeats : int, optional
        Timed runs of each quick setting.
    seed : int, optional
        Seed of all draws.
    """

    table: ContactTable
    given_texture: tuple[float, float] | None = None
    p_max: float = 0.02
    elements: bool = True
    repeats: int = 3
    seed: int = 0

    @property
    def texture(self) -> tuple[float, float]:
        """Texture whose loads are computed."""
        textures = self.table.calibration.textures
        return self.given_texture or textures[len(textures) // 2]


# Tasks to measure, each by a worker if there are any.
_TASKS: dict[str, Callable[[CostRequest], list[Setting]]] = {
    "loads": lambda q: load_settings(q.table, q.texture, q.p_max, elements=q.elements),
    "posteriors": lambda q: posterior_settings(q.table, Hybrid(), seed=q.seed),
}


def command(asked: options.Cost) -> Answer:
    """Do what the command line asks for."""
    if asked.source is not None and asked.source.suffix == ".toml":
        scene = Scene.from_toml(asked.source)
        first, table = scene.textures[0], generate(scene, solver="half-plane")
        known = CostRequest(table, (first.a_over_R, first.b_over_R), scene.highest_load(first))
    else:
        known = CostRequest(paper_sweep() if asked.source is None else read_table(asked.source))
    request = replace(known, elements=asked.elements, repeats=asked.repeats, seed=asked.seed)
    workers, scheduler = asked.workers, asked.scheduler
    found = cost_job(asked.out, request, force=asked.force, workers=workers, scheduler=scheduler)
    told = f"{asked.out}: {len(found)} rows; look at {asked.out / 'cost.html'}"
    return Answer((*cheapest(found), told), found, files_in(asked.out))


def cost_job(
    folder: Path,
    request: CostRequest,
    *,
    force: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
) -> pd.DataFrame:
    """Measure what loads, and posteriors with their evidences, cost.

    Parameters
    ----------
    folder : Path
        Folder to make: ``cost.csv``, ``cost.html``, and a figure for each task.
    request : CostRequest
        Inputs of the measurement.
    force : bool, optional
        Whether a folder of this command may be replaced.
    workers, scheduler : optional
        As for `runtime.pool.executor_for`: workers that measure loads and
        posteriors. Tasks measured side by side take longer than alone.

    Returns
    -------
    pandas.DataFrame
        Columns `ridgebayes.checks.cost.measured.COST_COLUMNS`, and ``pareto``.
    """
    rows: list[_Row] = []
    with (
        new_folder(folder, force=force, about=COST_CSV) as partial,
        Progress(len(_TASKS) + 1) as progress,
        executor_for(workers, scheduler) as executor,
    ):
        tasks = [(task, request) for task in _TASKS]
        found = map_ordered(_measured, tasks, executor, name=lambda task: task[0])
        for task in _TASKS:
            with progress.stage(task):
                rows += next(found)
        frame = pd.DataFrame(rows, columns=list(COST_COLUMNS))
        frame["pareto"] = pareto(frame)
        with progress.stage("figures"):
            write_csv(frame, partial / COST_CSV)
            shown = frame["task"].unique().tolist()
            figures = {one: f"cost-{one.replace(' ', '-')}" for one in shown}
            for one, name in figures.items():
                save(plot_cost(frame, one, LEVELS), partial / name)
            _write_page(frame, request, figures, partial / "cost.html")
    return frame


def _measured(task: tuple[str, CostRequest]) -> list[_Row]:
    """Measure one of `_TASKS`; in another process too, since a task holds all that it takes."""
    name, asked = task
    settings = _TASKS[name](asked)
    return [row for one in settings for row in measure(one, repeats=asked.repeats)]


def _write_page(
    frame: pd.DataFrame, request: CostRequest, figures: dict[str, str], path: Path
) -> None:
    """Write what reaches which error most cheaply, figures, and the table."""
    shown = frame.drop(columns=["reference", "repeats"])
    write_page(
        path,
        "cost.html.jinja",
        table=request.table,
        texture=request.texture,
        machine=f"{platform.machine()}, {platform.system()}, Python {platform.python_version()}",
        cheapest=cheapest(frame),
        figures=figures,
        rows=shown.to_html(index=False, float_format="{:.3g}".format, border=0),
    )
