"""The job behind `cost`: what each accuracy costs on this machine, with this table."""

import platform
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import pandas as pd
from markupsafe import escape

from ridgebayes.checks.cost.bands import band_settings
from ridgebayes.checks.cost.loads import load_settings
from ridgebayes.checks.cost.measured import COST_COLUMNS, Setting, cheapest, measure, pareto
from ridgebayes.checks.cost.posteriors import evidence_settings, posterior_settings
from ridgebayes.commands.run_folder import new_folder, write_csv, write_text
from ridgebayes.drawing.style import save
from ridgebayes.errors import InputError
from ridgebayes.model.forms import Hybrid
from ridgebayes.report.figures.costs import plot_cost
from ridgebayes.runtime.pool import executor_for, map_ordered
from ridgebayes.runtime.progress import Progress
from ridgebayes.table.table import ContactTable

COST_CSV = "cost.csv"
_Row: TypeAlias = dict[str, float | int | str]


@dataclass(frozen=True)
class _Part:
    """What one worker measures."""

    name: str
    table: ContactTable
    texture: tuple[float, float]
    p_max: float
    elements: bool
    repeats: int
    seed: int


def cost_job(
    folder: Path,
    table: ContactTable,
    *,
    texture: tuple[float, float] | None = None,
    p_max: float = 0.02,
    elements: bool = True,
    repeats: int = 3,
    seed: int = 0,
    force: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
) -> pd.DataFrame:
    """Measure what loads, posteriors, evidences and bands cost.

    Parameters
    ----------
    folder : Path
        Folder to make: ``cost.csv``, ``cost.html``, and a figure for each task.
    table : ContactTable
        What forms are calibrated on, and Hybrid's posterior is of.
    texture : (float, float) or None
        Whose loads are computed; None is the middle one of the table.
    p_max : float, optional
        Highest load p/E.
    elements : bool, optional
        Whether finite elements run: a minute, and the best reference.
    repeats, seed, force
        Timed runs of each quick setting, seed of all draws, whether a folder may be replaced.
    workers, scheduler : optional
        As for `runtime.pool.executor_for`: who measures loads, posteriors, evidences, bands.
        What is measured side by side takes longer than alone.

    Returns
    -------
    pandas.DataFrame
        Columns `ridgebayes.checks.cost.measured.COST_COLUMNS`, and ``pareto``.
    """
    if not repeats >= 1:
        raise InputError(f"--repeats {repeats}: expected at least 1")
    if texture is None:
        textures = table.calibration.textures
        texture = textures[len(textures) // 2]
    parts = [
        _Part(name, table, texture, p_max, elements, repeats, seed)
        for name in ("loads", "posteriors", "evidences", "bands")
    ]
    rows: list[_Row] = []
    with (
        new_folder(folder, force=force, about=COST_CSV) as partial,
        Progress(len(parts) + 1) as progress,
        executor_for(workers, scheduler) as executor,
    ):
        found = map_ordered(_measured, parts, executor, name=lambda part: part.name)
        for part in parts:
            with progress.stage(part.name):
                rows += next(found)
        frame = pd.DataFrame(rows, columns=list(COST_COLUMNS))
        frame["pareto"] = pareto(frame)
        with progress.stage("figures"):
            write_csv(frame, partial / COST_CSV)
            tasks = list(dict.fromkeys(frame["task"]))
            for task in tasks:
                save(plot_cost(frame, task), partial / f"cost-{task.replace(' ', '-')}")
            write_text(_page(frame, tasks, table, texture), partial / "cost.html")
    return frame


def _measured(part: _Part) -> list[_Row]:
    """Measure one part; elsewhere too, since a part holds all that it takes."""
    settings: list[Setting]
    if part.name == "loads":
        settings = load_settings(part.table, part.texture, part.p_max, elements=part.elements)
    elif part.name == "posteriors":
        settings = posterior_settings(part.table, Hybrid(), seed=part.seed)
    elif part.name == "evidences":
        settings = evidence_settings(part.table, Hybrid(), seed=part.seed)
    else:
        settings = band_settings(part.table, Hybrid(), part.texture, seed=part.seed)
    return [row for one in settings for row in measure(one, repeats=part.repeats)]


def _page(
    frame: pd.DataFrame, tasks: Sequence[str], table: ContactTable, texture: tuple[float, float]
) -> str:
    """Return a page: what reaches which error most cheaply, figures, and the table."""
    machine = f"{platform.machine()}, {platform.system()}, Python {platform.python_version()}"
    parts = [
        "<!doctype html><html lang='en'><meta charset='utf-8'><title>What accuracy costs</title>",
        "<style>body{font:15px/1.5 sans-serif;max-width:64em;margin:2em auto;padding:0 1em}"
        "img{max-width:100%}table{border-collapse:collapse;font-size:13px}"
        "td,th{padding:.15em .6em;text-align:left;border-bottom:1px solid #ddd}</style>",
        "<h1>What accuracy costs in time</h1>",
        f"<p>Table {escape(table.where)}, {len(table.calibration)} rows; loads of a/R = "
        f"{texture[0]:g}, b/R = {texture[1]:g}; {escape(machine)}, one process. CPU seconds are "
        "medians of repeated runs. Errors of loads are relative, of posteriors over the posterior "
        "sd, of evidences in ln Z, of bands in probability; the line joins the settings that no "
        "other beats in both.</p>",
        "<ul>",
        *(f"<li>{escape(text)}</li>" for text in cheapest(frame)),
        "</ul>",
    ]
    for task in tasks:
        name = f"cost-{task.replace(' ', '-')}"
        parts.append(f"<h2>{escape(task.capitalize())}</h2><img src='{name}.svg' alt='{name}'>")
    shown = frame.drop(columns=["reference", "repeats"])
    parts.append(shown.to_html(index=False, float_format="{:.3g}".format, border=0))
    return "\n".join([*parts, "</html>", ""])
