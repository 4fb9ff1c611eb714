"""The jobs behind the commands: each reads, computes, and fills one run folder."""

import json
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

import pandas as pd

from ridgebayes.checks.coverage import coverage
from ridgebayes.checks.left_out import left_out_scores
from ridgebayes.commands.pages import begin_figures, write_pages
from ridgebayes.commands.run_folder import (
    REFERENCE,
    new_folder,
    read_run,
    versions,
    write_comparison,
    write_csv,
    write_fits,
    write_run_json,
    write_text,
)
from ridgebayes.comparison.bands import bands_table, loads_table
from ridgebayes.comparison.compare import DEFAULT_FORMS, Execution, compare_with
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.errors import InputError
from ridgebayes.inference.chains import SampleSettings
from ridgebayes.inference.presets import STANDARD, Preset
from ridgebayes.model.forms import FORMS, Form, form_named
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations, refuse_circular
from ridgebayes.runtime.pool import executor_for, n_cpu, submit_or_defer
from ridgebayes.runtime.progress import Progress
from ridgebayes.table.datafiles import paper_sweep, reference_fe
from ridgebayes.table.table import ContactTable, read_table

EMBEDDED = "embedded sweep"
EMBEDDED_FE = "finite-element reference rows"
COVERAGE_JSON = "coverage.json"
_LARGEST_SENT = 2**26  # bytes of draws; beyond, sending a comparison to workers costs memory


def run_job(
    folder: Path,
    *,
    table: Path | None = None,
    forms: Sequence[str] = (),
    noise: str | None = None,
    seed: int = 0,
    force: bool = False,
    settings: SampleSettings | None = None,
    resume: bool = False,
    accuracy: str = STANDARD.name,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Comparison:
    """Do the main job: calibrate, weigh the evidence, predict, report.

    Parameters
    ----------
    folder : Path
        Run folder to make.
    table : Path, optional
        Contact table; the embedded sweep if not given, and then the finite-element reference rows
        are compared as well, with every form.
    forms : sequence of str, optional
        Form names.
    noise : str, optional
        Error model; the one with the highest mean evidence over the forms if not given.
    seed : int, optional
        Seed.
    force : bool, optional
        Whether an existing run folder may be replaced.
    settings : SampleSettings, optional
        Lengths and thresholds of sampling.
    resume : bool, optional
        Whether to go on with the chains that a killed run left; the end is the same.
    accuracy : str, optional
        Name of one of `inference.presets`. A quick run takes the normal error model with the
        highest evidence by Laplace's approximation, leaves no textures out, compares no finite
        elements and draws the five figures that hold the answer.
    workers, scheduler : optional
        As for `runtime.pool.executor_for`: what weighs error models and refits folds; all
        processors of this machine if neither is given. The numbers do not depend on them.

    Returns
    -------
    Comparison
        Of the table. Where a fit failed or did not converge, `complete` is False and the folder
        holds all that was finished.

    Raises
    ------
    InputError
        If an argument or the table breaks a rule; nothing is written then.
    """
    wanted = Preset.named(accuracy)
    chosen, error_model, data = _checked(table, forms, noise)
    with_reference = table is None and wanted.extras
    n_stage = (
        2 * len(chosen) + 6 + 2 * wanted.extras + (2 * len(FORMS) + 4 if with_reference else 0)
    )
    n_stage += 0 if error_model else 1 + with_reference
    reference = None
    n_worker = n_cpu() if workers is None and scheduler is None else workers
    with (
        new_folder(folder, force=force, resume=resume) as unfinished,
        Progress(n_stage) as progress,
        executor_for(n_worker, scheduler) as executor,
    ):
        comparison = _compared(
            data, chosen, error_model, seed, settings, progress, unfinished, wanted, executor
        )
        if wanted.extras:
            comparison = _with_left_out(comparison, chosen, seed, progress, executor)
        beside = None if scheduler else executor  # a cluster's fonts may be others
        if sum(fit.chains.u.nbytes for fit in comparison.fits.values()) > _LARGEST_SENT:
            beside = None
        with progress.stage("what accuracy costs"):  # with nothing going on beside it
            from ridgebayes.checks.cost.short import short_costs

            cost = submit_or_defer(beside, short_costs, comparison, progress.stages)
            comparison = replace(comparison, cost=cost())
        tables = submit_or_defer(beside, _predictions, comparison)
        begin_figures(comparison, beside)
        write_comparison(comparison, unfinished)
        _write_predictions(tables, unfinished, progress)
        if with_reference:
            rows = replace(reference_fe(), where=EMBEDDED_FE)
            everything, below = [form_named(name) for name in FORMS], unfinished / REFERENCE
            below.mkdir(exist_ok=True)
            reference = _compared(
                rows, everything, error_model, seed, settings, progress, below, wanted, executor
            )
            tables = submit_or_defer(beside, _predictions, reference)
            begin_figures(reference, beside)
            write_comparison(reference, below)
            _write_predictions(tables, below, progress)
            _about(below, reference, "run", seed, {}, [])
        with progress.stage("figures and report"):
            write_pages(comparison, unfinished, reference)
        options = {
            "table": str(table) if table else None,
            "forms": list(forms),
            "noise": noise,
            "accuracy": accuracy,
        }
        _about(unfinished, comparison, "run", seed, options, progress.stages, reference)
    if reference is not None and not reference.complete:
        return replace(comparison, failures=comparison.failures | _prefixed(reference))
    return comparison


def compare_job(
    folder: Path,
    table: Path,
    *,
    forms: Sequence[str] = (),
    noise: str = "iid",
    seed: int = 0,
    force: bool = False,
    settings: SampleSettings | None = None,
    resume: bool = False,
    accuracy: str = STANDARD.name,
) -> Comparison:
    """Compare forms on a table: posteriors, evidences, Bayes factors, scores; see `run_job`."""
    wanted = Preset.named(accuracy)
    chosen, error_model, data = _checked(table, forms, noise)
    with (
        new_folder(folder, force=force, resume=resume) as unfinished,
        Progress(2 * len(chosen) + 3) as progress,
    ):
        comparison = _compared(
            data, chosen, error_model, seed, settings, progress, unfinished, wanted
        )
        write_comparison(comparison, unfinished)
        options = {
            "table": str(table),
            "forms": list(forms),
            "noise": noise,
            "accuracy": accuracy,
        }
        _about(unfinished, comparison, "compare", seed, options, progress.stages)
    return comparison


def fit_job(
    folder: Path,
    table: Path,
    form: str,
    *,
    noise: str = "iid",
    seed: int = 0,
    force: bool = False,
    settings: SampleSettings | None = None,
    resume: bool = False,
    accuracy: str = STANDARD.name,
) -> Comparison:
    """Fit one form to a table: its posterior and evidence; see `run_job`."""
    wanted = Preset.named(accuracy)
    chosen, error_model, data = _checked(table, [form], noise)
    with new_folder(folder, force=force, resume=resume) as unfinished, Progress(3) as progress:
        comparison = _compared(
            data, chosen, error_model, seed, settings, progress, unfinished, wanted, scores=False
        )
        write_fits(comparison, unfinished)
        options = {"table": str(table), "form": form, "noise": noise, "accuracy": accuracy}
        _about(unfinished, comparison, "fit", seed, options, progress.stages)
    return comparison


def coverage_job(
    folder: Path,
    *,
    table: Path | None = None,
    forms: Sequence[str] = (),
    noises: Sequence[str] = (),
    seed: int = 0,
    force: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
) -> pd.DataFrame:
    """Count how often bands contain transitions of textures left out, form by form.

    Parameters
    ----------
    folder : Path
        Folder to make: coverage.csv, its figure as PNG and SVG, coverage.json.
    table : Path, optional
        Contact table; the embedded sweep if not given.
    forms, noises : sequence of str, optional
        Names; the four printed forms and every error model if not given.
    seed : int, optional
        Seed.
    force : bool, optional
        Whether an existing folder of this command may be replaced.
    workers, scheduler : optional
        As for `ridgebayes.runtime.pool.executor_for`; the numbers do not depend on them.

    Returns
    -------
    pandas.DataFrame
        What coverage.csv holds.

    Raises
    ------
    InputError
        If an argument or the table breaks a rule; nothing is written then.
    """
    chosen, _, data = _checked(table, forms, None)
    if len(set(noises)) < len(noises):
        raise InputError(f"noise: expected each once, got {', '.join(noises)}")
    models = [Noise.named(name) for name in noises] or list(Noise.every())
    with (
        new_folder(folder, force=force, about=COVERAGE_JSON) as unfinished,
        Progress(len(chosen) * len(models) + 1) as progress,
        executor_for(workers, scheduler) as executor,
    ):
        found = coverage(data, chosen, models, rng=seed, executor=executor, progress=progress.stage)
        write_csv(found, unfinished / "coverage.csv")
        with progress.stage("figure"):
            from ridgebayes.drawing.style import save
            from ridgebayes.report.figures.coverage import plot_coverage

            save(plot_coverage(found), unfinished / "coverage")
        options = {"table": str(table) if table else None, "forms": list(forms)}
        content = {
            "command": "coverage",
            "versions": versions(),
            "seed": seed,
            "options": options | {"noise": list(noises), "workers": workers},
            "table": data.where,
            "table_digest": data.digest(),
            "stages": progress.stages,
        }
        write_text(json.dumps(content, indent=2) + "\n", unfinished / COVERAGE_JSON)
    return found


def report_job(folder: Path) -> None:
    """Write the figures and the report of a run folder again, from what is in it."""
    comparison = read_run(folder)
    reference = read_run(folder / REFERENCE) if (folder / REFERENCE).is_dir() else None
    write_pages(comparison, folder, reference)


def _checked(
    table: Path | None, forms: Sequence[str], noise: str | None
) -> tuple[list[Form], Noise | None, ContactTable]:
    if len(set(forms)) < len(forms):
        raise InputError(f"forms: expected each once, got {', '.join(forms)}")
    chosen = [form_named(name) for name in forms] or list(DEFAULT_FORMS)
    error_model = None if noise is None else Noise.named(noise)
    data = replace(paper_sweep(), where=EMBEDDED) if table is None else read_table(table)
    for form in chosen:
        refuse_circular(data, form)
    Observations.from_table(data)  # refuses rows that cannot be fitted before anything is written
    return chosen, error_model, data


def _compared(
    table: ContactTable,
    forms: Sequence[Form],
    noise: Noise | None,
    seed: int,
    settings: SampleSettings | None,
    progress: Progress,
    folder: Path,
    accuracy: Preset,
    executor: Executor | None = None,
    scores: bool = True,
) -> Comparison:
    # No daemon: an import that is cut off when the interpreter ends crashes it.
    drawing = Thread(target=import_module, args=("ridgebayes.report.figures",))

    def stage(name: str) -> AbstractContextManager[Callable[[float], None]]:
        # From here on this process waits for workers now and then: time for what figures import.
        if executor is not None and name.startswith("calibrate") and drawing.ident is None:
            drawing.start()
        return progress.stage(name)

    execution = Execution(accuracy, settings, executor, progress.detail, stage, folder, scores)
    return compare_with(execution, table, forms, noise=noise, rng=seed)


def _with_left_out(
    comparison: Comparison,
    forms: Sequence[Form],
    seed: int,
    progress: Progress,
    executor: Executor | None,
) -> Comparison:
    """Add scores on textures and steps left out, and the coverage of the best form's bands."""
    table, noise = comparison.table, comparison.noise
    forms = [form for form in forms if form.name in comparison.fits]
    with progress.stage("textures and steps left out"):
        scores = left_out_scores(table, forms, noise, rng=seed, executor=executor)
    with progress.stage("coverage of the bands"):
        shares = pd.DataFrame()
        if comparison.probabilities and len(table.calibration.textures) > 1:
            noises = dict.fromkeys([noise, Noise()])  # beside it what independent rows promise
            best = [form for form in forms if form.name == comparison.best]
            shares = coverage(table, best, list(noises), rng=seed, executor=executor)
    return replace(comparison, left_out=scores, coverage=shares)


def _predictions(comparison: Comparison) -> dict[str, pd.DataFrame]:
    """Return both tables: what rows tell of shared offsets is then worked out once."""
    bands = bands_table(comparison, compressed=True)
    return {"bands.csv": bands, "loads.csv": loads_table(comparison)}


def _write_predictions(
    tables: Callable[[], dict[str, pd.DataFrame]], folder: Path, progress: Progress
) -> None:
    with progress.stage("bands"):
        for name, table in tables().items():
            write_csv(table, folder / name)


def _about(
    folder: Path,
    comparison: Comparison,
    command: str,
    seed: int,
    options: dict[str, Any],
    stages: list[dict[str, Any]],
    reference: Comparison | None = None,
) -> None:
    write_run_json(
        folder,
        comparison,
        command=command,
        seed=seed,
        options=options,
        stages=stages,
        reference=reference,
    )


def _prefixed(reference: Comparison) -> dict[str, str]:
    unfinished = {
        name: fit.convergence_failures[0]
        for name, fit in reference.fits.items()
        if not fit.converged
    } | reference.failures
    return {f"{REFERENCE}: {name}": why for name, why in unfinished.items()}
