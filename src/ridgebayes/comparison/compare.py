"""Which form does the evidence support: each is fitted, weighed against the others, and scored."""

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from ridgebayes._types import Rng
from ridgebayes.comparison.bayes_factors import bayes_factor_table, summed_bayes_factors
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.scores import LOO_COLUMNS, loo_table
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.evidence import LogEvidence
from ridgebayes.evidence.error_models import chosen_error_model, weigh_error_models
from ridgebayes.evidence.prior_sensitivity import SENSITIVITY_COLUMNS, prior_sensitivity
from ridgebayes.evidence.savage_dickey import savage_dickey
from ridgebayes.evidence.tables import EVIDENCE_COLUMNS, evidence_table, evidences
from ridgebayes.inference.chains import ProgressCallback, SampleSettings
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.posterior import drawn_exactly
from ridgebayes.inference.presets import STANDARD, Preset
from ridgebayes.model.forms import Classic, Form, Hybrid, Modified, PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise, as_noise
from ridgebayes.model.observations import Observations, refuse_circular
from ridgebayes.results import Fit, calibrate
from ridgebayes.runtime.pool import map_ordered, submit_or_defer
from ridgebayes.runtime.randomness import seed_of, stream
from ridgebayes.table.table import ContactTable

DEFAULT_FORMS: tuple[Form, ...] = (Classic(), PowerLaw(), Modified(), Hybrid())
_Drawn = tuple[Fit, LogEvidence] | ComputationError | None
StageTimer = Callable[[str], AbstractContextManager[Callable[[float], None]]]


@contextmanager
def untimed(name: str) -> Iterator[Callable[[float], None]]:
    """Do nothing around a stage; commands pass a stopwatch instead."""
    yield lambda seconds: None


@dataclass(frozen=True)
class Execution:
    """How a comparison is computed: how accurately, where, and who is told.

    Parameters
    ----------
    accuracy : Preset, optional
        Target errors of draws and evidences.
    settings : SampleSettings, optional
        Lengths and thresholds of sampling, instead of those of `accuracy`.
    executor : concurrent.futures.Executor, optional
        Weighs the error models where they are chosen by evidence; where `accuracy` takes no walks,
        it draws from the posteriors instead.
    progress : callable, optional
        Called with a line of text now and then.
    stage : callable, optional
        Called with a stage's name, returns a context manager around it.
    checkpoints : Path, optional
        Folder in which the chains are kept as they grow, see `calibrate`.
    scores : bool, optional
        Whether to add leave-one-out scores and prior sensitivity, which take far longer than the
        rest where textures are very many.
    """

    accuracy: Preset = STANDARD
    settings: SampleSettings | None = None
    executor: Executor | None = None
    progress: ProgressCallback | None = None
    stage: StageTimer = untimed
    checkpoints: Path | None = None
    scores: bool = True


def compare(
    table: ContactTable,
    forms: Sequence[Form] = DEFAULT_FORMS,
    *,
    noise: str | Noise | None = "iid",
    rng: Rng = 0,
    settings: SampleSettings | None = None,
    progress: ProgressCallback | None = None,
    executor: Executor | None = None,
    accuracy: Preset = STANDARD,
) -> Comparison:
    """Fit several forms to one table and compare them.

    Parameters
    ----------
    table : ContactTable
        Rows of role calibration and status ok are fitted.
    forms : sequence of Form, optional
        Classic, power law, Modified and Hybrid if not given.
    noise : str or Noise, optional
        Error model of all forms; None for the one with the highest mean evidence over them.
    rng : int or numpy.random.Generator, optional
        Seed. Each form draws from a stream of its own name.
    settings : SampleSettings, optional
        Lengths and thresholds of sampling, instead of those of `accuracy`.
    progress : callable, optional
        Called with a line of text now and then.
    executor : concurrent.futures.Executor, optional
        Weighs the error models where `noise` is None; where `accuracy` takes no walks it draws from
        the posteriors instead.
    accuracy : Preset, optional
        Target errors of draws and evidences.

    Returns
    -------
    Comparison
        Fits, evidences, Bayes factors, probabilities, scores. A form whose fit failed is in
        `failures` and in no table.

    Raises
    ------
    InputError
        If no form is named, one is named twice, or one may not be fitted to these rows.
    ComputationError
        If no form could be fitted.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> cmp = rb.compare(rb.paper_sweep(), [rb.Modified(), rb.Hybrid()], rng=1)
    >>> cmp.best
    'hybrid'
    >>> [round(float(ln_bf), 1) for ln_bf in cmp.bayes_factors["ln_bf"]]
    [-4.5, -4.5]
    """
    execution = Execution(accuracy, settings, executor, progress)
    return compare_with(execution, table, forms, noise=noise, rng=rng)


def compare_with(
    execution: Execution,
    table: ContactTable,
    forms: Sequence[Form],
    *,
    noise: str | Noise | None = "iid",
    rng: Rng = 0,
) -> Comparison:
    """Do what `compare` does, with everything about its execution in one record."""
    names = [form.name for form in forms]
    if not names or len(set(names)) < len(names):
        raise InputError(
            f"forms: expected at least one, each once, got {', '.join(names) or 'none'}"
        )
    for form in forms:
        refuse_circular(table, form)
    noise = None if noise is None else as_noise(noise)
    seed, stage, accuracy = seed_of(rng), execution.stage, execution.accuracy
    others = pd.DataFrame(columns=EVIDENCE_COLUMNS)
    if noise is None:
        with stage("error models"):
            others = weigh_error_models(
                table,
                forms,
                [n for n in Noise.every() if accuracy.walks or n.tail == "normal"],
                seed=seed,
                # First looks are done before workers have started.
                executor=execution.executor if accuracy.walks else None,
                progress=execution.progress,
                laplace_only=not accuracy.walks,
            )
            noise = as_noise(chosen_error_model(others))
    fits, found, failures = _fit_forms(execution, table, forms, noise, seed)
    evidence = _with_other_noises(evidence_table(found, noise), others, noise)
    own = evidence[evidence["used"] & (evidence["noise"] == noise.name)]
    log_evidence = dict(zip(own["form"], own["log_evidence"].astype(float), strict=True))
    # Walks leave so much that sending it costs more than it gains.
    executor = None if accuracy.walks else execution.executor
    loo = pd.DataFrame(columns=LOO_COLUMNS)
    sensitivity = pd.DataFrame(columns=SENSITIVITY_COLUMNS)
    if execution.scores:
        loo_later = submit_or_defer(executor, loo_table, fits)
        sensitivity_later = submit_or_defer(
            executor, prior_sensitivity, fits, log_evidence=log_evidence
        )
    nested_later = None  # begun beside the scores, where there are workers
    if {"modified", "hybrid"} <= set(fits):
        nested_later = submit_or_defer(executor, savage_dickey, fits["hybrid"])
    if execution.scores:
        with stage("prior sensitivity"):
            sensitivity = sensitivity_later()
    with stage("savage-dickey and Bayes factors"):
        nested = None if nested_later is None else nested_later()
        factors = bayes_factor_table(evidence, list(fits), noise, nested)
        summed = summed_bayes_factors(evidence)
        if len(summed):
            factors = pd.concat([factors, summed], ignore_index=True)
    if execution.scores:
        with stage("leave-one-out"):
            loo = loo_later()
    return Comparison(
        table, noise, fits, evidence, factors, loo, sensitivity, failures, accuracy=accuracy.name
    )


def chain_file(form: str) -> str:
    """Return the name of the file that a form's growing chains are kept in."""
    return f"chains-{form}.h5"


def _fit_forms(
    execution: Execution, table: ContactTable, forms: Sequence[Form], noise: Noise, seed: int
) -> tuple[dict[str, Fit], dict[str, list[LogEvidence]], dict[str, str]]:
    """Return fits, their evidences, and why the other forms could not be fitted, by form."""
    accuracy, folder, progress = execution.accuracy, execution.checkpoints, execution.progress
    fits: dict[str, Fit] = {}
    found: dict[str, list[LogEvidence]] = {}
    failures: dict[str, str] = {}
    seeds = {form.name: int(stream(seed, form.name).integers(2**63)) for form in forms}
    tasks = [(table, form, noise, seeds[form.name], accuracy.n_draw) for form in forms]
    results: Iterator[tuple[_Drawn, float]] = (
        itertools.repeat((None, 0.0))
        if accuracy.walks
        else map_ordered(
            _draw_by_importance,
            tasks,
            execution.executor,
            name=lambda task: f"posterior of {task[1].name}",
        )
    )
    for form in forms:
        with execution.stage(f"calibrate {form.name}") as add_cpu:
            drawn, seconds = next(results)
            if execution.executor is not None:
                add_cpu(seconds)
            if isinstance(drawn, ComputationError):
                failures[form.name] = str(drawn)
                continue
            try:
                fits[form.name] = (
                    drawn[0]
                    if drawn
                    else calibrate(
                        table,
                        form,
                        noise=noise,
                        rng=seeds[form.name],
                        settings=execution.settings or accuracy.settings,
                        progress=progress and _labelled(progress, form.name),
                        checkpoint=folder and folder / chain_file(form.name),
                    )
                )
            except ComputationError as error:
                failures[form.name] = str(error)
                continue
        with execution.stage(f"evidence {form.name}"):
            found[form.name] = (
                [drawn[1]] if drawn else evidences(fits[form.name], n_bridge=accuracy.n_bridge)
            )
    if not fits:
        raise ComputationError("no form could be fitted: " + "; ".join(failures.values()))
    return fits, found, failures


def _draw_by_importance(task: tuple[ContactTable, Form, Noise, int, int]) -> tuple[_Drawn, float]:
    """Draw without a walk, and say how many CPU seconds it took.

    None where the draws' weights are not to be trusted; an error is one form's, not the others'.
    """
    table, form, noise, seed, n_draw = task
    began = time.process_time()
    drawn: _Drawn = None
    try:
        model = Model(Observations.from_table(table), form, noise)
        if not drawn_exactly(model):
            fit, evidence = importance_posterior(
                model, seed=seed, n_draw=n_draw, n_round=2, n_per_round=500
            )
            drawn = (Fit.of(fit), evidence) if fit.converged and evidence.ok else None
    except ComputationError as error:
        drawn = error
    return drawn, time.process_time() - began


def _with_other_noises(evidence: pd.DataFrame, others: pd.DataFrame, noise: Noise) -> pd.DataFrame:
    """Add the evidences under every error model; of the chosen one they are only a first look."""
    if others.empty:
        return evidence
    # A first look by a method that the fit's own evidences have is the same number again.
    key = ["form", "noise", "method"]
    known = pd.MultiIndex.from_frame(others[key]).isin(pd.MultiIndex.from_frame(evidence[key]))
    others = others[~known]
    first_look = others["noise"] == noise.name
    others = others.assign(
        used=others["used"] & ~first_look,
        model_probability=others["model_probability"].mask(first_look),
    )
    return pd.concat([evidence, others], ignore_index=True)


def _labelled(progress: ProgressCallback, name: str) -> ProgressCallback:
    return lambda text: progress(f"{name}: {text}")
