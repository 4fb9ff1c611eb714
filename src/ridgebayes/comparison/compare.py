"""Which form does the evidence support: each is fitted, weighed against the others, and scored."""

import math
import os
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path
from typing import Any

import pandas as pd

from ridgebayes._types import Rng
from ridgebayes.comparison.bayes_factors import bayes_factor_table, summed_bayes_factors
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.scores import LOO_COLUMNS, loo_table
from ridgebayes.errors import InputError
from ridgebayes.evidence.pairs import MIN_FORM_PROBABILITY, Pair, WeighedPairs, weigh_pairs
from ridgebayes.evidence.prior_sensitivity import SENSITIVITY_COLUMNS, prior_sensitivity
from ridgebayes.evidence.tables import error_model_weights, evidence_table
from ridgebayes.evidence.walk_pair import walk_pair
from ridgebayes.inference.chains import ProgressCallback, SampleSettings
from ridgebayes.inference.importance import Drawn
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.posterior import Posterior, failed_walk
from ridgebayes.inference.presets import STANDARD, Preset
from ridgebayes.model.forms import Classic, Form, Hybrid, Modified, PowerLaw, as_form
from ridgebayes.model.noise import AUTO, Noise, error_models_for
from ridgebayes.model.observations import Observations, refuse_circular
from ridgebayes.model.prior_files import Priors, resolve_priors
from ridgebayes.results import Fit, chain_checkpoint
from ridgebayes.runtime.pool import map_ordered, submit_or_defer
from ridgebayes.runtime.progress import untimed
from ridgebayes.runtime.randomness import seed_of
from ridgebayes.table.table import ContactTable, read_table

MOST_APART = 4.0  # joint standard errors of a posterior's two evidences
DEFAULT_FORMS: tuple[Form, ...] = (Classic(), PowerLaw(), Modified(), Hybrid())
StageTimer = Callable[[str], AbstractContextManager[Callable[[float], None]]]


@dataclass(frozen=True)
class Execution:
    """How a comparison is computed: accuracy, executor and progress.

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


def compare(  # noqa: PLR0913  (each names a part of the question, and has a default)
    table: ContactTable | pd.DataFrame | str | os.PathLike[str],
    forms: Sequence[Form | str] | Form | str = DEFAULT_FORMS,
    *,
    noise: str | Noise = AUTO,
    priors: Priors | None = None,
    prior_odds: Mapping[str, float] | None = None,
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
    prior_odds : mapping of str to float, optional
        Prior odds by form name, > 0 and dimensionless; forms that are not named have 1.
        Posterior probabilities and averaged predictions use them, Bayes factors and the verdict do
        not.
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
        is for a parameter that no form or error model has; if prior odds are of another form, or
        not finite and > 0.
    ComputationError
        If no form could be fitted.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> cmp = rb.compare(rb.paper_sweep(), [rb.Modified(), rb.Hybrid()], noise="iid", rng=1)
    >>> cmp.best
    'hybrid'
    >>> [round(float(ln_bf), 1) for ln_bf in cmp.bayes_factors["ln_bf"]]
    [-4.5]
    >>> cmp.verdict.grade
    'supports'
    """
    execution = Execution(accuracy, settings, executor)
    wanted: dict[str, Any] = {"noise": noise, "priors": priors, "prior_odds": prior_odds}
    return compare_with(execution, read_table(table), forms, **wanted, rng=rng)


def compare_with(
    execution: Execution,
    table: ContactTable,
    forms: Sequence[Form | str] | Form | str,
    *,
    noise: str | Noise = AUTO,
    priors: Priors | None = None,
    prior_odds: Mapping[str, float] | None = None,
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
    odds = check_odds(prior_odds, names)
    data = Observations.from_table(table)
    noises = error_models_for(noise, data.n_series)
    if not execution.accuracy.extras and len(noises) > 1:  # a quick run
        noises = [each for each in noises if each.tail == "normal"]
    known_priors = resolve_priors(priors, known, noises, data)
    seed = seed_of(rng)
    executor, stage = execution.executor, execution.stage
    with stage("evidences"):
        weighed = weigh_pairs(
            data,
            known,
            noises,
            priors=known_priors,
            seed=seed,
            executor=executor,
            progress=execution.progress,
            accuracy=execution.accuracy,
        )
        weighed = replace(weighed, prior_odds=odds)
        selected = weighed.selected()
    with stage("posteriors"):
        posteriors = weighed.posteriors(names, selected.name, execution.accuracy.n_kept, executor)
    found = {key: [one.evidence] for key, one in weighed.weighed.items()}
    failures = {
        name: weighed.weighed[name, selected.name].evidence.status
        for name in names
        if selected.name not in posteriors[name]
    }
    for key in [key for key in found if key[0] in failures]:
        del found[key]
    checked = _walked(execution, weighed, posteriors, selected, table.calibration.digest())
    for name, (posterior, bridge) in checked.items():
        posteriors[name][selected.name] = posterior
        found[name, selected.name].append(bridge)
    evidence = evidence_table(found, odds)
    fits = {
        name: Fit.of(own[selected.name], error_model_weights(evidence, name), own)
        for name, own in posteriors.items()
        if name not in failures
    }
    factors = bayes_factor_table(evidence, list(fits), selected)
    summed = summed_bayes_factors(evidence)
    if len(summed):
        factors = pd.concat([factors, summed], ignore_index=True)
    loo = pd.DataFrame(columns=LOO_COLUMNS)
    sensitivity = pd.DataFrame(columns=SENSITIVITY_COLUMNS)
    if execution.scores:
        loo_later = submit_or_defer(executor, loo_table, fits)
        with stage("prior sensitivity"):
            sensitivity = prior_sensitivity(weighed, executor=executor)
        with stage("leave-one-out"):
            loo = loo_later()
    accuracy = execution.accuracy.name
    return Comparison(
        table, selected, fits, evidence, factors, loo, sensitivity, failures, accuracy=accuracy
    )


def check_odds(
    prior_odds: Mapping[str, float] | None, forms: Collection[str], where: str = "prior_odds"
) -> dict[str, float]:
    """Return prior odds of forms, or raise InputError that names the form, the value, the rule."""
    found = dict(prior_odds or {})
    for name, odds in found.items():
        if name not in forms:
            raise InputError(
                f"{where}: expected forms that are compared ({', '.join(forms)}), got {name!r}"
            )
        if isinstance(odds, bool) or not isinstance(odds, Real) or not 0 < odds < math.inf:
            raise InputError(f"{where}: {name}: expected a finite number > 0, got {odds!r}")
    return {name: float(odds) for name, odds in found.items()}


@dataclass(frozen=True, eq=False)
class _Check:
    """A walk of a posterior that is printed; holds all that a process of its own needs."""

    pair: Pair
    drawn: Drawn
    posterior: Posterior
    table_digest: str
    execution: Execution

    @property
    def name(self) -> str:
        return f"walk of {self.pair.form.name}"


def _walked(
    execution: Execution,
    weighed: WeighedPairs,
    posteriors: Mapping[str, Mapping[str, Posterior]],
    selected: Noise,
    table_digest: str,
) -> dict[str, tuple[Posterior, LogEvidence]]:
    """Walk what is printed and not negligible; return posteriors and evidences by form."""
    if not (execution.accuracy.walks or execution.settings):
        return {}
    # A progress callback cannot be sent to another process.
    progress = None if execution.executor else execution.progress
    alone = replace(execution, executor=None, stage=untimed, progress=progress)
    tasks = []
    for form, own in posteriors.items():
        drawn = weighed.weighed[form, selected.name].drawn
        if drawn is None or weighed.form_share(form) < MIN_FORM_PROBABILITY:
            continue
        pair = weighed.pairs[form, selected.name]
        tasks.append(_Check(pair, drawn, own[selected.name], table_digest, alone))
    found = {}
    results = map_ordered(_check, tasks, execution.executor, name=lambda task: task.name)
    for task in tasks:
        form = task.pair.form.name
        with execution.stage(f"walk {form}") as add_cpu:
            (posterior, evidence), seconds = next(results)
            if execution.executor is not None:
                add_cpu(seconds)
        found[form] = posterior, evidence
    return found


def _check(task: _Check) -> tuple[tuple[Posterior, LogEvidence], float]:
    """Walk a posterior and bridge it, with the CPU seconds it took.

    The posterior keeps its importance draws. It does not count as converged if the walk did not
    meet its rules, or if both evidences differ by more than four joint standard errors.
    """
    began, execution, form = time.process_time(), task.execution, task.pair.form.name
    settings = execution.settings or execution.accuracy.settings
    path = execution.checkpoints and execution.checkpoints / chain_file(form)
    model, progress = task.posterior.model, execution.progress
    checkpoint = chain_checkpoint(path, task.table_digest, model, task.pair.own_seed, settings)
    walked, bridge = walk_pair(
        task.pair,
        task.drawn,
        settings,
        progress=progress and _labelled(progress, form),
        checkpoint=checkpoint,
    )
    failures = [f"walk: {failure}" for failure in failed_walk(model, walked)]
    own = task.drawn.evidence
    apart = abs(bridge.value - own.value) / math.hypot(bridge.se, own.se)
    if bridge.ok and apart > MOST_APART:
        failures.append(
            f"evidences of the walk and of importance sampling differ by {apart:.1f} joint "
            f"standard errors, above {MOST_APART:g}"
        )
    elif not bridge.ok:
        failures.append(f"bridge: {bridge.status}")
    both = task.posterior.convergence_failures + tuple(failures)
    checked = replace(task.posterior, convergence_failures=both)
    if execution.scores:  # and for the fit's file, which is written elsewhere
        checked = checked.with_log_likelihood()
    return (checked, bridge), time.process_time() - began


def chain_file(form: str) -> str:
    """Return the name of the file that a form's growing chains are kept in."""
    return f"chains-{form}.h5"


def _labelled(progress: ProgressCallback, name: str) -> ProgressCallback:
    return lambda text: progress(f"{name}: {text}")
