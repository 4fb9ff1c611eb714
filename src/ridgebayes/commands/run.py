"""`ridgebayes run`, the main job: calibrate, weigh the evidence, predict, report."""

import io
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pandas as pd

from ridgebayes.checks.cost import accuracy_costs
from ridgebayes.checks.coverage import coverage
from ridgebayes.checks.left_out import left_out_scores
from ridgebayes.checks.report_data import ReportData, report_data
from ridgebayes.commands import BEGAN, options
from ridgebayes.commands.answers import comparison_answer
from ridgebayes.commands.pages import command_line, write_pages
from ridgebayes.commands.parsing import parse_forms
from ridgebayes.commands.request import FitRequest, Inputs
from ridgebayes.commands.run_files import REFERENCE, write_comparison, write_run_json
from ridgebayes.commands.run_folder import new_folder, write_csv
from ridgebayes.commands.terminal import Answer
from ridgebayes.comparison.bands import bands_table, loads_table
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.evidence.pairs import MIN_FORM_PROBABILITY
from ridgebayes.inference.presets import Preset
from ridgebayes.model.forms import FORMS, form_named
from ridgebayes.model.noise import Noise
from ridgebayes.predict.predict import KINDS
from ridgebayes.report.figures.gallery import Gallery
from ridgebayes.runtime.memory import watched_memory
from ridgebayes.runtime.pool import executor_for, n_cpu, submit_or_defer
from ridgebayes.runtime.progress import Progress
from ridgebayes.table.datafiles import reference_fe

EMBEDDED_FE = "finite-element reference rows"


def command(asked: options.Run) -> Answer:
    """Do what the command line asks for."""
    request = FitRequest.of(asked, parse_forms(asked.forms))
    done = run_job(
        asked.out,
        request,
        force=asked.force,
        resume=asked.resume,
        workers=asked.workers,
        scheduler=asked.scheduler,
        began=BEGAN,
    )
    return comparison_answer(done, asked.out, f"read {asked.out / 'report.html'}")


def run_job(
    folder: Path,
    request: FitRequest,
    *,
    force: bool = False,
    resume: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
    began: float | None = None,
) -> Comparison:
    """Do the main job: calibrate, weigh the evidence, predict, report.

    Parameters
    ----------
    folder : Path
        Run folder to make.
    request : FitRequest
        Table and forms to fit, with their options. Without a table the finite-element reference
        rows are compared as well, with every form. With accuracy quick only error models of normal
        tails are weighed, no textures are left out, no finite elements compared, nothing is walked,
        only figures of the answer are drawn, and 1,024 draws of each form's posterior kept.
    force : bool, optional
        Whether an existing run folder may be replaced.
    resume : bool, optional
        Whether to go on with the chains that a killed run left; the end is the same.
    workers, scheduler : optional
        As for `runtime.pool.executor_for`: what weighs error models and refits folds; all
        processors of this machine if neither is given. The numbers do not depend on them.
    began : float, optional
        `time.perf_counter` at which the program began, where that is to be a stage.

    Returns
    -------
    Comparison
        Comparison on the table. Where a fit failed or did not converge, `complete` is False and
        the folder holds all that was finished.

    Raises
    ------
    InputError
        If an argument or the table breaks a rule; nothing is written then.
    """
    inputs = request.resolve()
    extras = inputs.accuracy.extras
    reference_inputs, reference = None, None
    if request.table is None and extras:
        rows = replace(reference_fe(), where=EMBEDDED_FE)
        reference_inputs = request.on(rows, [form_named(name) for name in FORMS])
    # Eight of every run, three that a quick one leaves out, and where there are: walks, start and
    # rows.
    n_stage = 8 + len(inputs.walked) + 3 * extras + bool(began) + bool(reference_inputs)
    n_worker = n_cpu() if workers is None and scheduler is None else workers
    with (
        new_folder(folder, force=force, resume=resume) as partial,
        Progress(n_stage, began=began) as progress,
        watched_memory() as memory,
        ThreadPoolExecutor(1) as thread,
        executor_for(n_worker, scheduler) as executor,
    ):
        local = None if scheduler else executor  # a cluster's files and fonts may be others
        comparison = _compared(inputs, progress, partial, executor)
        if extras:
            comparison = _add_left_out(comparison, inputs, progress, executor)
            with progress.stage("what accuracy costs"):
                cost = submit_or_defer(local, accuracy_costs, comparison.table)
                comparison = replace(comparison, cost=cost())
        # The few figures of a quick run are drawn here, and workers need no library for them.
        drawing = local if extras or local is None else thread
        galleries = [_write(comparison, partial, progress, local, drawing)]
        if reference_inputs is not None:
            below = partial / REFERENCE
            below.mkdir(exist_ok=True)
            with progress.stage("finite-element comparison"):
                reference, gallery = _second(reference_inputs, below, request.seed, executor, local)
                galleries.append(gallery)
        with progress.stage("figures and report"):
            typed = command_line("run", request.options, request.seed)
            write_pages(comparison, partial, reference, galleries, command=typed)
        write_run_json(
            partial,
            comparison,
            command="run",
            seed=request.seed,
            options=request.options,
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


def _second(
    inputs: Inputs, folder: Path, seed: int, executor: Executor | None, local: Executor | None
) -> tuple[Comparison, Gallery | None]:
    """Make the second comparison and its files; its stages are in its own run.json."""
    with Progress(0, io.StringIO()) as progress:
        comparison = _compared(inputs, progress, folder, executor)
        begun = _write(comparison, folder, progress, local, local)
    write_run_json(folder, comparison, command="run", seed=seed, options={}, stages=progress.stages)
    return comparison, begun


def _add_left_out(
    comparison: Comparison, inputs: Inputs, progress: Progress, executor: Executor | None
) -> Comparison:
    """Add scores on textures and steps left out, and the coverage of the best form's bands."""
    table, noise, seed, priors = comparison.table, comparison.noise, inputs.seed, inputs.priors
    fits = list(comparison.fits.values())  # whose draws save most refits
    with progress.stage("textures and steps left out"):
        scores = left_out_scores(table, fits, noise, rng=seed, executor=executor, priors=priors)
    with progress.stage("coverage of the bands"):
        shares = pd.DataFrame()
        probabilities, textures = comparison.probabilities, table.calibration.textures
        best = [comparison.fits[comparison.best]] if probabilities and len(textures) > 1 else []
        if best:
            noises = dict.fromkeys([noise, Noise()])  # and what independent rows promise
            shares = coverage(table, best, list(noises), rng=seed, executor=executor, priors=priors)
    return replace(comparison, left_out=scores, coverage=shares)


def _compared(
    inputs: Inputs, progress: Progress, folder: Path, executor: Executor | None
) -> Comparison:
    return _thinned(inputs.compare(progress, folder, executor))


def _thinned(comparison: Comparison) -> Comparison:
    """Keep the draws that files keep: they go to every task, and summaries are there already.

    A form that the rows rule out, whose bands are in no average, keeps an eighth.
    """
    n = Preset.named(comparison.accuracy).n_kept
    fits, shares = {}, comparison.probabilities
    for name, fit in comparison.fits.items():
        own = n if shares.get(name, 1.0) >= MIN_FORM_PROBABILITY else n // 8
        others = {noise: one.thinned(own) for noise, one in fit.others.items()}
        fits[name] = replace(fit.thinned(own), others=others)
    return replace(comparison, fits=fits)


def _write(
    comparison: Comparison,
    folder: Path,
    progress: Progress,
    executor: Executor | None,
    drawing: Executor | None,
) -> Gallery | None:
    """Write a comparison and its predictions; return its figures, whose drawing has started."""
    data, begun = submit_or_defer(executor, _shown, comparison), None
    loads = [submit_or_defer(executor, loads_table, comparison, kinds=[kind]) for kind in KINDS]
    with progress.stage("bands"):
        bands = bands_table(comparison, executor=executor)
        write_csv(bands, folder / "bands.csv", executor)
        write_csv(pd.concat([kind() for kind in loads], ignore_index=True), folder / "loads.csv")
    with progress.stage("what the report shows"):
        if drawing is not None:  # else it is computed when it is drawn
            begun = Gallery(replace(data(), comparison=comparison), drawing)
    with progress.stage("files of posteriors"):
        write_comparison(comparison, folder, executor)
    return begun


def _shown(comparison: Comparison) -> ReportData:
    """Return what the report shows without the fits, which the caller has."""
    return replace(report_data(comparison), comparison=replace(comparison, fits={}))
