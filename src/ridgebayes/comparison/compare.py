"""Which form does the evidence support: each is fitted, weighed against the others, and scored."""

import os
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import pandas as pd

from ridgebayes._types import Rng
from ridgebayes.comparison.bayes_factors import bayes_factor_table, summed_bayes_factors
from ridgebayes.comparison.comparison import NEGLIGIBLE, Comparison
from ridgebayes.comparison.deciding_priors import EvidencesAnew, with_deciding_priors
from ridgebayes.comparison.scores import LOO_COLUMNS, loo_table
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.evidence import LogEvidence, laplace_evidence
from ridgebayes.evidence.candidates import Candidate
from ridgebayes.evidence.error_models import (
    WeighedErrorModels,
    error_model_weights,
    printed_error_model,
    weigh_error_models,
)
from ridgebayes.evidence.prior_sensitivity import SENSITIVITY_COLUMNS, prior_sensitivity
from ridgebayes.evidence.savage_dickey import savage_dickey
from ridgebayes.evidence.tables import evidence_table, evidences
from ridgebayes.evidence.weighed_anew import weighed_anew
from ridgebayes.inference.chains import ProgressCallback, SampleSettings
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.posterior import Posterior, drawn_exactly
from ridgebayes.inference.presets import QUICK, STANDARD, Preset
from ridgebayes.inference.sampling import sample_posterior
from ridgebayes.model.forms import Classic, Form, Hybrid, Modified, PowerLaw, as_form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import AUTO, Noise, error_models_for
from ridgebayes.model.observations import Observations, refuse_circular
from ridgebayes.model.prior_files import Priors, priors_of, resolve_priors
from ridgebayes.results import Fit, chain_checkpoint
from ridgebayes.runtime.pool import map_ordered, submit_or_defer
from ridgebayes.runtime.progress import untimed
from ridgebayes.runtime.randomness import seed_of, stream
from ridgebayes.table.table import ContactTable, read_table

DEFAULT_FORMS: tuple[Form, ...] = (Classic(), PowerLaw(), Modified(), Hybrid())
StageTimer = Callable[[str], AbstractContextManager[Callable[[float], None]]]


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
        Runs the fits; one after the other in this process if not given.
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
    table: ContactTable | pd.DataFrame | str | os.PathLike[str],
    forms: Sequence[Form | str] | Form | str = DEFAULT_FORMS,
    *,
    noise: str | Noise = AUTO,
    priors: Priors | None = None,
    rng: Rng = 0,
    settings: SampleSettings | None = None,
    executor: Executor | None = None,
    accuracy: Preset = STANDARD,
) -> Comparison:
    """Fit several forms to one table and compare them.

    Parameters
    ----------
    table : ContactTable, path or pandas.DataFrame
        Rows of role calibration and status ok are fitted.
    forms : sequence of Form or str, optional
        Forms or their names; Classic, power law, Modified and Hybrid if not given.
    noise : str or Noise, optional
        Error model of all forms; ``auto`` weighs all that suit the table, and averages over them.
    priors : mapping of str to mapping of str to Distribution or str, optional
        Replacements for default priors: by form name, or ``noise``, and parameter name; a text is
        as in a file of priors, such as ``lognormal(1.382, 10 %)``.
    rng : int or numpy.random.Generator, optional
        Seed. Each form has its own random stream.
    settings : SampleSettings, optional
        Lengths and thresholds of sampling, instead of those of `accuracy`.
    executor : concurrent.futures.Executor, optional
        Runs the fits; one after the other in this process if not given.
    accuracy : Preset, optional
        Target errors of draws and evidences.

    Returns
    -------
    Comparison
        Fits, evidences, Bayes factors, probabilities, scores, and a graded verdict. A form whose
        fit failed is in `failures` and in no table.

    Raises
    ------
    InputError
        If no form is given, one is given twice, or one may not be fitted to these rows; if a prior
        is for a parameter that no form or error model has.
    ComputationError
        If no form could be fitted.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> cmp = rb.compare(rb.paper_sweep(), [rb.Modified(), rb.Hybrid()], noise="iid", rng=1)
    >>> cmp.best
    'hybrid'
    >>> [round(float(ln_bf), 1) for ln_bf in cmp.bayes_factors["ln_bf"]]
    [-4.5, -4.5]
    >>> cmp.verdict.grade
    'supports'
    """
    execution = Execution(accuracy, settings, executor)
    return compare_with(execution, read_table(table), forms, noise=noise, priors=priors, rng=rng)


def compare_with(
    execution: Execution,
    table: ContactTable,
    forms: Sequence[Form | str] | Form | str,
    *,
    noise: str | Noise = AUTO,
    priors: Priors | None = None,
    rng: Rng = 0,
) -> Comparison:
    """Do what `compare` does, with everything about its execution in one record."""
    if isinstance(forms, Form | str) or not isinstance(forms, Iterable):
        forms = [forms]
    known = [as_form(form) for form in forms]
    names = [form.name for form in known]
    if not names or len(set(names)) < len(names):
        raise InputError(
            f"forms: expected at least one, each once, got {', '.join(names) or 'none'}"
        )
    for form in known:
        refuse_circular(table, form)
    data = Observations.from_table(table)
    noises = error_models_for(noise, data.n_series)
    if not execution.accuracy.extras and len(noises) > 1:  # a quick run
        noises = [each for each in noises if each.tail == "normal"]
    known_priors = resolve_priors(priors, known, noises, data)
    seed = seed_of(rng)
    weigh = partial(weigh_error_models, data, noises=noises, seed=seed, executor=execution.executor)
    with execution.stage("error models"):
        weighed = weigh(
            forms=known,
            priors=known_priors,
            progress=execution.progress,
            accuracy=execution.accuracy,
        )
    printed = printed_error_model(weighed.evidence)
    # What tells of progress cannot be sent to another process.
    progress = None if execution.executor else execution.progress
    digest = table.calibration.digest()
    tasks = [
        _PrintedFit(
            model=Model(data, form, printed, priors_of(known_priors, form, printed)),
            candidate=weighed.candidates[form.name, printed.name],
            is_negligible=weighed.form_share(form.name) < NEGLIGIBLE,
            seed=int(stream(seed, form.name).integers(2**63)),
            table_digest=digest,
            execution=replace(execution, executor=None, stage=untimed, progress=progress),
        )
        for form in known
    ]
    drawn, found, failures = _fit_forms(execution, tasks, weighed)
    evidence = evidence_table(found)
    fits = {name: _averaged(fit, weighed, evidence) for name, fit in drawn.items()}
    anew = partial(weighed_anew, partial(weigh, progress=progress), known, known_priors)
    factors, loo, sensitivity = _scored(execution, fits, evidence, printed, anew)
    accuracy = execution.accuracy.name
    return Comparison(
        table, printed, fits, evidence, factors, loo, sensitivity, failures, accuracy=accuracy
    )


def _scored(
    execution: Execution,
    fits: dict[str, Fit],
    evidence: pd.DataFrame,
    printed: Noise,
    anew: EvidencesAnew,
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Return Bayes factors, and where they are asked for leave-one-out scores and sensitivity."""
    executor, stage = execution.executor, execution.stage
    nested_later = None  # begun beside the scores, where there are workers
    if {"modified", "hybrid"} <= set(fits):
        nested_prior = fits["modified"].model.priors["c"]
        nested_later = submit_or_defer(executor, savage_dickey, fits["hybrid"], nested_prior)
    loo = pd.DataFrame(columns=LOO_COLUMNS)
    sensitivity = pd.DataFrame(columns=SENSITIVITY_COLUMNS)
    if execution.scores:
        loo_later = submit_or_defer(executor, loo_table, fits)
        with stage("prior sensitivity"):
            posteriors = {name: fit.posteriors for name, fit in fits.items()}
            by_draws = prior_sensitivity(posteriors, evidence, executor=executor)
            sensitivity = with_deciding_priors(evidence, by_draws, anew)
    with stage("savage-dickey and Bayes factors"):
        nested = None if nested_later is None else nested_later()
        factors = bayes_factor_table(evidence, list(fits), printed, nested)
        summed = summed_bayes_factors(evidence)
        if len(summed):
            factors = pd.concat([factors, summed], ignore_index=True)
    if execution.scores:
        with stage("leave-one-out"):
            loo = loo_later()
    return factors, loo, sensitivity


def chain_file(form: str) -> str:
    """Return the name of the file that a form's growing chains are kept in."""
    return f"chains-{form}.h5"


@dataclass(frozen=True, eq=False)
class _PrintedFit:
    """A fit under the printed error model; holds all that a process of its own needs."""

    model: Model
    candidate: Candidate
    is_negligible: bool
    seed: int
    table_digest: str
    execution: Execution

    @property
    def name(self) -> str:
        return f"posterior of {self.model.form.name}"


_LONG_WALK = 4_000_000  # numbers of a walk that is thinned to what files keep, 32 MB
_Drawn = tuple[Posterior, list[LogEvidence]]


def _fit_forms(
    execution: Execution, tasks: Sequence[_PrintedFit], weighed: WeighedErrorModels
) -> tuple[dict[str, Posterior], dict[tuple[str, str], list[LogEvidence]], dict[str, str]]:
    """Return posteriors, evidences of every pair, and why forms could not be fitted."""
    posteriors: dict[str, Posterior] = {}
    failures: dict[str, str] = {}
    found = {key: [one.evidence] for key, one in weighed.candidates.items()}
    results = map_ordered(_printed_fit, tasks, execution.executor, name=lambda task: task.name)
    for task in tasks:
        form, noise = task.model.form.name, task.model.noise.name
        with execution.stage(f"calibrate {form}") as add_cpu:
            drawn, seconds = next(results)
            if execution.executor is not None:
                add_cpu(seconds)
        if isinstance(drawn, str):
            failures[form] = drawn
            for key in [key for key in found if key[0] == form]:
                del found[key]
            continue
        posteriors[form], own = drawn
        # What a first look found by the same method is the same number again.
        first = [e for e in found[form, noise] if e.method not in {one.method for one in own}]
        found[form, noise] = own + first
    if not posteriors:
        raise ComputationError("no form could be fitted: " + "; ".join(failures.values()))
    return posteriors, found, failures


def _averaged(printed: Posterior, weighed: WeighedErrorModels, evidence: pd.DataFrame) -> Fit:
    """Return a fit with the posteriors that its predictions are averaged over."""
    name, noise = printed.form.name, printed.noise.name
    drawn = weighed.posteriors(name)
    return Fit.of(printed, error_model_weights(evidence, name, {noise, *drawn}), drawn)


def _printed_fit(task: _PrintedFit) -> tuple[_Drawn | str, float]:
    """Draw and weigh, with the CPU seconds it took; an error is one form's, not the others'."""
    began = time.process_time()
    try:
        posterior, found = _draw(task)
        # What evidence needed whole is not carried from process to process where it is long, or
        # where nothing asks for it again: Savage and Dickey's ratio, of independent rows, does.
        if posterior.chains.u.size > _LONG_WALK or not task.model.is_iid_gaussian:
            posterior = replace(posterior, chains=posterior.kept_chains)
        if task.execution.scores:  # and for the fit's file, which is written elsewhere
            posterior = posterior.with_log_likelihood()
        drawn: _Drawn | str = posterior, found
    except ComputationError as error:
        drawn = str(error)
    return drawn, time.process_time() - began


def _draw(task: _PrintedFit) -> _Drawn:
    """Walk where the form counts; a negligible form, and any in a quick run, is only sampled.

    So is one whose offsets are drawn beside the parameters: nothing walks over these.
    """
    model, accuracy, found = task.model, task.execution.accuracy, task.candidate
    laplace, walks = found.laplace, accuracy.walks and not task.model.is_latent
    if drawn_exactly(model):
        return found.posterior or sample_posterior(model, seed=task.seed), [found.evidence]
    if task.is_negligible or not walks:
        posterior, evidence = found.posterior, found.evidence
        if posterior is None or not (posterior.converged or task.is_negligible):
            is_dear = model.is_latent and task.is_negligible
            effort = (QUICK if is_dear else STANDARD).effort
            posterior, evidence = importance_posterior(model, laplace, seed=task.seed, **effort)
        if found.evidence.method == "quadrature":
            evidence = found.evidence
        if task.is_negligible or (posterior.converged and evidence.ok):
            return posterior, [evidence, laplace_evidence(posterior.laplace)]
    settings = task.execution.settings or accuracy.settings
    folder = task.execution.checkpoints
    path = folder and folder / chain_file(model.form.name)
    posterior = sample_posterior(
        model,
        seed=task.seed,
        settings=settings,
        laplace=laplace,
        progress=task.execution.progress and _labelled(task.execution.progress, model.form.name),
        checkpoint=chain_checkpoint(path, task.table_digest, model, task.seed, settings),
    )
    return posterior, evidences(posterior, n_bridge=accuracy.n_bridge)


def _labelled(progress: ProgressCallback, name: str) -> ProgressCallback:
    return lambda text: progress(f"{name}: {text}")
