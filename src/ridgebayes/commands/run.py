"""The commands `ridgebayes run`, `compare` and `fit`, which write a run folder, and `report`.

`compare` and `fit` write a part of the files of `run`. `report` writes the figures and pages of a
finished run folder again.
"""

import io
import os
import shlex
from collections.abc import Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import pandas as pd

from ridgebayes._types import Rng
from ridgebayes.checks.cost import cost
from ridgebayes.checks.coverage import coverage
from ridgebayes.checks.left_out import left_out_scores
from ridgebayes.checks.report_data import ReportData, report_data
from ridgebayes.commands import BEGAN, options
from ridgebayes.commands.answers import comparison_answer, fit_answer
from ridgebayes.commands.parsing import parse_form, parse_forms, parse_odds
from ridgebayes.commands.run_files import (
    EMBEDDED,
    REFERENCE,
    read_command,
    read_run,
    write_comparison,
    write_fits,
    write_run_json,
)
from ridgebayes.commands.run_folder import new_folder, write_csv
from ridgebayes.commands.shared_options import DEFAULT_OUT
from ridgebayes.commands.terminal import Answer, files_in
from ridgebayes.comparison.bands import bands_table, loads_table
from ridgebayes.comparison.compare import compared
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.errors import InputError, expect
from ridgebayes.evidence.pairs import MIN_FORM_PROBABILITY
from ridgebayes.inference.chains import SampleSettings
from ridgebayes.inference.presets import STANDARD, Preset
from ridgebayes.model.forms import FORMS
from ridgebayes.model.noise import AUTO, Noise
from ridgebayes.predict.posterior_loads import N_SHARED
from ridgebayes.predict.predict import KINDS
from ridgebayes.report import write_reports
from ridgebayes.report.figures.gallery import Gallery
from ridgebayes.request import DEFAULT_FORMS, FormsLike, PriorsLike, Request, TableLike
from ridgebayes.runtime.memory import watched_memory
from ridgebayes.runtime.pool import end_unguarded_worker, executor_for, n_cpu, submit_or_defer
from ridgebayes.runtime.progress import Progress
from ridgebayes.runtime.randomness import seed_of
from ridgebayes.table.datafiles import paper_sweep, reference_fe

EMBEDDED_FE = "finite-element reference rows"
# Stages of each command, shown as progress. Walks and the extras of a preset add further stages.
_FIT = ("evidences", "posteriors")
_COMPARE = (*_FIT, "prior sensitivity", "leave-one-out")
_RUN = (*_COMPARE, "files of posteriors", "bands", "what the report shows", "figures and report")
_STAGES = {"fit": _FIT, "compare": _COMPARE, "run": _RUN}
_DEFAULT_OPTIONS = (("noise", AUTO), ("accuracy", STANDARD.name))
_EXTRA_STAGES = ("textures and steps left out", "coverage of the bands", "what accuracy costs")


def command(asked: options.Run | options.Compare | options.FitOne | options.Report) -> Answer:
    """Run `ridgebayes run`, `compare`, `fit` or `report`."""
    if isinstance(asked, options.Report):
        report_job(asked.folder)
        pages = {"report.html", "report.md", "figures"}
        written = [path for path in files_in(asked.folder) if not pages.isdisjoint(path.parts)]
        return Answer((f"read {asked.folder / 'report.html'}",), files=written)
    arguments = vars(asked) | {"prior_odds": parse_odds(getattr(asked, "prior_odds", ""))}
    out, seed = arguments.pop("out"), arguments.pop("seed")
    if isinstance(asked, options.FitOne):
        arguments["forms"] = [parse_form(arguments.pop("form"))]
        return fit_answer(run(folder=out, rng=seed, command="fit", **arguments), out)
    arguments["forms"] = parse_forms(asked.forms)
    if isinstance(asked, options.Compare):
        done = run(folder=out, rng=seed, command="compare", resume=None, **arguments)
        return comparison_answer(done, out)
    done = run(folder=out, rng=seed, began=BEGAN, **arguments)
    return comparison_answer(done, out, f"read {out / 'report.html'}")


def run(
    table: TableLike | None = None,
    folder: str | os.PathLike[str] = DEFAULT_OUT,
    *,
    forms: FormsLike = (),
    noise: str | Noise = AUTO,
    priors: PriorsLike | None = None,
    prior_odds: Mapping[str, float] | None = None,
    rng: Rng = 0,
    settings: SampleSettings | None = None,
    accuracy: str = STANDARD.name,
    time_limit: float | None = None,
    command: str = "run",
    force: bool = False,
    resume: bool | None = False,
    workers: int | None = None,
    scheduler: str | None = None,
    began: float | None = None,
) -> Comparison:
    """Fit and compare forms on a table, predict, and write the results and a report to a folder.

    Parameters
    ----------
    table : ContactTable, path or pandas.DataFrame, optional
        Rows to fit. None fits the embedded sweep, and also compares all forms on the
        finite-element reference rows.
    folder : path, optional
        Run folder to create.
    forms, noise, priors, prior_odds, rng, settings : optional
        As for `compare`.
    accuracy : str, optional
        ``quick``, ``standard`` or ``reference``. A ``quick`` run compares only error models with
        normal tails, leaves out no textures, does no finite-element comparison and no walks, draws
        only the main figures, and keeps 1,024 draws of each form's posterior.
    time_limit : float, optional, s
        Time after which a walk by emcee stops with the draws so far.
    command : {"run", "compare", "fit"}, optional
        Command whose files are written: ``fit`` writes posteriors and evidences, ``compare`` also
        Bayes factors and scores, ``run`` also predictions, scores on left-out rows, and the report.
    force : bool, optional
        Whether to replace an existing run folder.
    resume : bool or None, optional
        Whether to continue the chains of an interrupted run; the results are the same as without
        interruption. None for a run that will not be resumed, so that Ctrl-C removes its files.
    workers : int, optional
        Processes on this machine. If neither `workers` nor `scheduler` is given, ``run`` uses one
        for each processor. Results do not depend on their number. Workers import the script, so
        that its calls have to stand below ``if __name__ == "__main__":``.
    scheduler : str, optional
        Address of a Dask scheduler whose workers compute.
    began : float, optional
        `time.perf_counter` at the start of the program, to report the start-up as a stage.

    Returns
    -------
    Comparison
        Comparison on the table, as `read_run` returns it. If a fit failed or did not converge,
        `complete` is False and the folder contains all finished results.

    Raises
    ------
    InputError
        If an argument or the table breaks a rule. Nothing is written.

    Examples
    --------
    >>> import tempfile
    >>> import ridgebayes as rb
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     out = f"{folder}/out"
    ...     done = rb.run(rb.paper_sweep(), out, forms=["modified", "hybrid"], noise="iid",
    ...                   accuracy="quick", command="compare")
    ...     again = rb.read_run(out)
    >>> again.best == done.best == "hybrid", again.evidence.equals(done.evidence)
    (True, True)
    """
    end_unguarded_worker()
    expect(SampleSettings, None, settings=settings)
    expect(str, command=command)
    if command not in _STAGES:
        raise InputError(f"command: expected one of {', '.join(_STAGES)}, got {command!r}")
    preset, seed = Preset.named(accuracy), seed_of(rng)
    if time_limit is not None and (settings or preset.walks):
        settings = replace(settings or preset.settings, time_limit=time_limit)
    shared: dict[str, Any] = {
        "noise": noise,
        "priors": priors,
        "prior_odds": prior_odds,
        "accuracy": preset,
        "rng": seed,
        "settings": settings,
    }
    rows = replace(paper_sweep(), where=EMBEDDED) if table is None else table
    request = Request.of(rows, forms or DEFAULT_FORMS, **shared)
    extras, second = command == "run" and preset.extras, None
    if table is None and extras:
        second = Request.of(replace(reference_fe(), where=EMBEDDED_FE), [*FORMS], **shared)
    typed: dict[str, Any] = {
        "table": None if table is None else request.table.where,
        "forms": [form.name for form in request.forms] if forms else [],
        "noise": str(noise),
        "accuracy": accuracy,
        "priors": str(priors) if priors else None,
        "prior_odds": dict(request.prior_odds) or None,
        "time_limit": time_limit,
    }
    if command == "fit":
        typed["form"] = ",".join(typed.pop("forms"))
    stages = [*_STAGES[command], *(_EXTRA_STAGES if extras else ()), *request.walked]
    n_stage = len(stages) + bool(began) + bool(second)  # start-up, and the second comparison
    if command == "run" and scheduler is None:
        workers = workers or n_cpu()
    with (
        new_folder(Path(folder), force=force, resume=resume) as partial,
        Progress(n_stage, began=began) as progress,
        watched_memory() as memory,
        ThreadPoolExecutor(1) as thread,
        executor_for(workers, scheduler) as executor,
    ):
        request = replace(request, executor=executor, scores=command != "fit")
        local = None if scheduler else executor  # workers of a cluster may have other files, fonts
        if executor is not None:  # imports matplotlib while this process waits for workers
            thread.submit(import_module, "ridgebayes.drawing.predictions")
        comparison = _compared(request, progress, partial)
        reference, galleries = None, []
        if command == "fit":
            write_fits(comparison, partial, local)
        elif command == "compare":
            write_comparison(comparison, partial, local)
        else:
            if extras:
                comparison = _add_left_out(comparison, request, progress)
                with progress.stage("what accuracy costs"):
                    costs = submit_or_defer(local, cost, comparison.table)
                    comparison = replace(comparison, cost=costs())
            # A quick run draws few figures; workers then need not import matplotlib.
            drawing = local if extras or local is None else thread
            galleries.append(_write(comparison, partial, progress, local, drawing))
            if second is not None:
                with progress.stage("finite-element comparison"):
                    second = replace(second, executor=executor)
                    galleries.append(_second_comparison(second, partial / REFERENCE, local))
                    reference = galleries[1].data.comparison
            with progress.stage("figures and report"):
                write_pages(*galleries, folder=partial, command=command_line(command, typed, seed))
        write_run_json(
            partial,
            comparison,
            command=command,
            seed=seed,
            options=typed,
            stages=progress.stages,
            reference=reference,
            peak_memory=memory.in_bytes,
        )
    if reference is not None and not reference.complete:
        lacking = {name: failures[0] for name, failures in reference.unconverged.items()}
        unfinished = lacking | reference.failures
        prefixed = {f"{REFERENCE}: {name}": why for name, why in unfinished.items()}
        return replace(comparison, failures=comparison.failures | prefixed)
    return comparison


def _second_comparison(request: Request, folder: Path, local: Executor | None) -> Gallery:
    """Run the second comparison and write its files; its stages go into its own run.json."""
    folder.mkdir(exist_ok=True)
    with Progress(0, io.StringIO()) as progress:
        comparison = _compared(request, progress, folder)
        gallery = _write(comparison, folder, progress, local, local)
    about: dict[str, Any] = {"seed": request.seed, "options": {}, "stages": progress.stages}
    write_run_json(folder, comparison, command="run", **about)
    return gallery


def _add_left_out(comparison: Comparison, request: Request, progress: Progress) -> Comparison:
    """Add scores on left-out textures and steps, and the coverage of the best form's bands."""
    table, noise = comparison.table, comparison.noise
    how: dict[str, Any] = {
        "rng": request.seed,
        "executor": request.executor,
        "priors": request.priors,
    }
    fits = list(comparison.fits.values())  # reweighting their draws saves most refits
    with progress.stage("textures and steps left out"):
        scores = left_out_scores(table, fits, noise, **how)
    with progress.stage("coverage of the bands"):
        shares = pd.DataFrame()
        probabilities, textures = comparison.probabilities, table.calibration.textures
        if probabilities and len(textures) > 1:
            best = [comparison.fits[comparison.best]]
            noises = dict.fromkeys([noise, Noise()])  # independent rows for comparison
            shares = coverage(table, best, list(noises), **how)
    return replace(comparison, left_out=scores, coverage=shares)


def _compared(request: Request, progress: Progress, folder: Path) -> Comparison:
    request = replace(request, progress=progress.detail, stage=progress.stage, checkpoints=folder)
    return _thinned(compared(request))


def _thinned(comparison: Comparison) -> Comparison:
    """Thin the posteriors to the draws that files keep, since every task gets a copy of them.

    The preset gives the total number of draws of a form, which its posteriors share in proportion
    to their weights; the selected error model, which is shown, keeps at least an equal share. A
    form with shared offsets, which are parameters as well, keeps at most the number that
    predictions use. A form with negligible probability, whose bands enter no average, keeps a
    quarter.
    """
    n_kept, fits = Preset.named(comparison.accuracy).n_kept, {}
    for name, fit in comparison.fits.items():
        posteriors = fit.posteriors.values()
        share_offsets = any(posterior.noise.factors for posterior in posteriors)
        n = min(n_kept, N_SHARED) if share_offsets else n_kept
        if comparison.probabilities.get(name, 1.0) < MIN_FORM_PROBABILITY:
            n //= 4
        weights = fit.error_model_weights
        others = {
            noise: other.thinned(round(n * weights[noise])) for noise, other in fit.others.items()
        }
        selected = max(weights.get(fit.noise.name, 0.0), 1 / len(posteriors))
        fits[name] = replace(fit.thinned(round(n * selected)), others=others)
    return replace(comparison, fits=fits)


def _write(
    comparison: Comparison,
    folder: Path,
    progress: Progress,
    executor: Executor | None,
    drawing: Executor | None,
) -> Gallery:
    """Write a comparison and its predictions; return its figures, which are being drawn."""
    data = submit_or_defer(executor, _report_data, comparison)
    loads = [submit_or_defer(executor, loads_table, comparison, kinds=[kind]) for kind in KINDS]
    with progress.stage("files of posteriors"):  # first, to keep them if the disk becomes full
        write_comparison(comparison, folder, executor)
    with progress.stage("bands"):
        bands = bands_table(comparison, executor=executor)
        write_csv(bands, folder / "bands.csv", executor)
        write_csv(pd.concat([kind() for kind in loads], ignore_index=True), folder / "loads.csv")
    with progress.stage("what the report shows"):
        return Gallery(replace(data(), comparison=comparison), drawing)


def _report_data(comparison: Comparison) -> ReportData:
    """Return the data of the report without the fits, which the caller adds again."""
    return replace(report_data(comparison), comparison=replace(comparison, fits={}))


def report_job(folder: Path) -> None:
    """Write the figures and the report of a run folder again, from its files."""
    folders = [folder, *filter(Path.is_dir, [folder / REFERENCE])]
    runs = [read_run(path) for path in folders]  # reads all first, since a file may be damaged
    galleries = [Gallery(report_data(run)) for run in runs]
    write_pages(*galleries, folder=folder, command=command_line(*read_command(folder)))


def write_pages(
    gallery: Gallery, second: Gallery | None = None, *, folder: Path, command: str = ""
) -> None:
    """Write figures, report.html and report.md into a folder.

    Parameters
    ----------
    gallery : Gallery
        Comparison to report, with its figures.
    second : Gallery, optional
        Second comparison, whose own pages go into the sub-folder ``reference-fe``.
    folder : Path
        Folder to write to.
    command : str, optional
        Command line to show, as `command_line` returns it.
    """
    if second is not None:
        second.save(folder / REFERENCE / "figures")
        write_reports(second, folder / REFERENCE, command=command)
    gallery.save(folder / "figures")
    write_reports(gallery, folder, reference=second, command=command)


def command_line(command: str, options: Mapping[str, Any], seed: int) -> str:
    """Return a command line that reproduces the results, with file names without folders.

    Examples
    --------
    >>> command_line("run", {"table": "/home/me/a.csv", "forms": [], "noise": "auto"}, 3)
    'ridgebayes run --table a.csv --seed 3'
    >>> command_line("run", {"prior_odds": {"hybrid": 2.0, "classic": 0.5}}, 0)
    'ridgebayes run --prior-odds hybrid=2,classic=0.5 --seed 0'
    """
    words = ["ridgebayes", command]
    for name, value in options.items():
        if value and (name, value) not in _DEFAULT_OPTIONS:
            if isinstance(value, dict):  # prior odds
                value = [f"{key}={odds:.15g}" for key, odds in value.items()]
            text = ",".join(map(str, value)) if isinstance(value, list) else str(value)
            word = Path(text).name if name in ("table", "priors") else text
            words += [f"--{name.replace('_', '-')}", word]
    return shlex.join([*words, "--seed", str(seed)])
