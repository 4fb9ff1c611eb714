"""Comparison of forms: fit each form, weigh the forms by their evidences and score them."""

import math
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import replace

import pandas as pd

from ridgebayes._types import Rng
from ridgebayes.cautions import cautions
from ridgebayes.comparison.bayes_factors import bayes_factor_table, summed_bayes_factors
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.scores import LOO_COLUMNS, loo_table
from ridgebayes.errors import warn_of
from ridgebayes.evidence.pairs import MIN_FORM_PROBABILITY, Pair, WeighedPairs
from ridgebayes.evidence.prior_sensitivity import SENSITIVITY_COLUMNS, prior_sensitivity
from ridgebayes.evidence.tables import error_model_weights, evidence_table
from ridgebayes.evidence.walk_pair import walk_pair
from ridgebayes.inference.chains import ProgressCallback, SampleSettings
from ridgebayes.inference.importance import Drawn
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.posterior import Posterior, failed_walk
from ridgebayes.inference.presets import STANDARD, Preset
from ridgebayes.model.noise import AUTO, Noise
from ridgebayes.request import DEFAULT_FORMS, FormsLike, PriorsLike, Request, TableLike
from ridgebayes.results import Fit, chain_checkpoint
from ridgebayes.runtime.pool import submit_or_defer
from ridgebayes.runtime.progress import untimed

MAX_EVIDENCE_GAP_SE = 4.0  # in joint standard errors; a larger gap is no Monte Carlo error


def compare(  # noqa: PLR0913  (all but the table have a default)
    table: TableLike,
    forms: FormsLike = DEFAULT_FORMS,
    *,
    noise: str | Noise = AUTO,
    priors: PriorsLike | None = None,
    prior_odds: Mapping[str, float] | None = None,
    rng: Rng = 0,
    settings: SampleSettings | None = None,
    executor: Executor | None = None,
    accuracy: Preset | str = STANDARD,
) -> Comparison:
    """Fit several forms to one table and compare them.

    Parameters
    ----------
    table : ContactTable, path or pandas.DataFrame
        Table; rows with role "calibration" and status "ok" are fitted.
    forms : sequence of Form or str, optional
        Forms or their names; Classic, power law, Modified and Hybrid if not given.
    noise : str or Noise, optional
        Error model of all forms; ``auto`` averages over all error models that suit the table.
    priors : mapping of str to mapping of str to prior, or path, optional
        Replacements for default priors by form name, or ``noise``, and parameter name. A prior is
        a Distribution, a SciPy distribution (`scipy.stats.norm(0, 0.1)`), or a text as in a file
        of priors, such as ``lognormal(1.382, 10 %)``. A path is read as a file of priors.
    prior_odds : mapping of str to float, optional
        Prior odds by form name, > 0 and dimensionless; 1 for forms not named. They enter
        posterior probabilities and averaged predictions, but not Bayes factors and the verdict.
    rng : int or numpy.random.Generator, optional
        Seed. Each form has its own random stream.
    settings : SampleSettings, optional
        Chain lengths and convergence thresholds; those of `accuracy` if not given.
    executor : concurrent.futures.Executor, optional
        Executor of the fits; if not given, they run one after the other in this process.
    accuracy : str or Preset, optional
        Target errors of draws and evidences: ``quick``, ``standard`` or ``reference``.

    Returns
    -------
    Comparison
        Fits, evidences, Bayes factors, probabilities, scores and a graded verdict. A form whose
        fit failed is listed in `failures` and in no table.

    Raises
    ------
    InputError
        If no form is given, a form is given twice or cannot be fitted to these rows, a prior
        names a parameter that no form or error model has, or prior odds name a form that is not
        compared or are not finite and > 0.
    ComputationError
        If no form could be fitted.

    Warns
    -----
    CautionWarning
        For each of the comparison's `cautions`.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> cmp = rb.compare(rb.paper_sweep(), ["modified", "hybrid"], noise="iid", accuracy="quick")
    >>> cmp.best
    'hybrid'
    >>> [round(float(ln_bf), 1) for ln_bf in cmp.bayes_factors["ln_bf"]]
    [-4.5]
    >>> cmp.verdict.grade
    'supports'
    """
    request = Request.of(
        table,
        forms,
        noise=noise,
        priors=priors,
        prior_odds=prior_odds,
        accuracy=accuracy,
        rng=rng,
        settings=settings,
    )
    comparison = compared(replace(request, executor=executor))
    warn_of(comparison.cautions)
    return comparison


def compared(request: Request) -> Comparison:
    """Compare the forms of a request, without warnings.

    Raises
    ------
    ComputationError
        If no form could be fitted.
    """
    executor, stage, accuracy = request.executor, request.stage, request.accuracy
    names = [form.name for form in request.forms]
    with stage("evidences"):
        weighed = replace(request.weigh(), prior_odds=request.prior_odds)
        selected = weighed.selected()
    with stage("posteriors"):
        posteriors = weighed.posteriors(names, selected.name, accuracy.n_kept, executor)
    failures = {
        name: weighed.weighed[name, selected.name].evidence.status
        for name in names
        if selected.name not in posteriors[name]
    }
    evidences = {
        key: [pair.evidence] for key, pair in weighed.weighed.items() if key[0] not in failures
    }
    shown = {name: posteriors[name][selected.name] for name in names if name not in failures}
    walks = _submit_walks(request, weighed, posteriors, selected)
    wait_for_loo = submit_or_defer(executor if request.scores else None, loo_table, shown)
    sensitivity, loo = (pd.DataFrame(columns=x) for x in (SENSITIVITY_COLUMNS, LOO_COLUMNS))
    if request.scores:  # computed on workers that the few walks and the scores leave idle
        with stage("prior sensitivity"):
            sensitivity = prior_sensitivity(weighed, executor=executor)
    for name, walk in walks.items():
        with stage(f"walk {name}") as add_cpu:
            (posterior, bridge), seconds = walk()
            if executor is not None:
                add_cpu(seconds)
        shown[name] = posteriors[name][selected.name] = posterior
        evidences[name, selected.name].append(bridge)
    evidence = evidence_table(evidences, request.prior_odds)
    sentences = cautions(request.table, [noise.name for noise in request.noises], selected, shown)
    fits = {
        name: Fit.of(
            replace(posterior, cautions=sentences[name]),
            error_model_weights(evidence, name),
            posteriors[name],
        )
        for name, posterior in shown.items()
    }
    factors = bayes_factor_table(evidence, list(fits), selected)
    summed = summed_bayes_factors(evidence)
    if len(summed):
        factors = pd.concat([factors, summed], ignore_index=True)
    if request.scores:
        with stage("leave-one-out"):
            loo = wait_for_loo()
    tables = (evidence, factors, loo, sensitivity)
    return Comparison(
        request.table, selected, fits, *tables, failures=failures, accuracy=accuracy.name
    )


def _submit_walks(
    request: Request,
    weighed: WeighedPairs,
    posteriors: Mapping[str, Mapping[str, Posterior]],
    selected: Noise,
) -> dict[str, Callable[[], tuple[tuple[Posterior, LogEvidence], float]]]:
    """Submit the walks of forms that are not negligible; return functions that wait for them."""
    # Executors and progress callbacks cannot be sent to another process.
    job = replace(request, executor=None, stage=untimed)
    if request.executor is not None:
        job = replace(job, progress=None)
    walks = {}
    for form in (form.name for form in request.walked):
        pair, drawn = weighed.pairs[form, selected.name], weighed.weighed[form, selected.name].drawn
        if drawn is not None and weighed.form_share(form) >= MIN_FORM_PROBABILITY:
            posterior = posteriors[form][selected.name]
            walks[form] = submit_or_defer(request.executor, _check, job, pair, drawn, posterior)
    return walks


def _check(
    request: Request, pair: Pair, drawn: Drawn, posterior: Posterior
) -> tuple[tuple[Posterior, LogEvidence], float]:
    """Check a posterior by MCMC and bridge sampling; return it, its evidence and the CPU seconds.

    The posterior keeps its importance draws. It is marked as not converged if the walk did not
    converge, or if the two evidences differ by more than four joint standard errors.
    """
    began, form, model, progress = time.process_time(), pair.form.name, posterior.model, None
    settings, folder = request.settings or request.accuracy.settings, request.checkpoints
    path, digest = folder and folder / f"chains-{form}.npz", request.table.calibration.digest()
    if request.progress is not None:
        progress = _prefixed(request.progress, form)
    checkpoint = chain_checkpoint(path, digest, model, pair.own_seed, settings)
    walked, bridge = walk_pair(pair, drawn, settings, progress=progress, checkpoint=checkpoint)
    failures = [f"walk: {failure}" for failure in failed_walk(model, walked)]
    by_draws = drawn.evidence
    gap = abs(bridge.value - by_draws.value) / math.hypot(bridge.se, by_draws.se)
    if bridge.ok and gap > MAX_EVIDENCE_GAP_SE:
        failures.append(
            f"evidences of the walk and of importance sampling differ by {gap:.1f} joint "
            f"standard errors, above {MAX_EVIDENCE_GAP_SE:g}"
        )
    elif not bridge.ok:
        failures.append(f"bridge: {bridge.status}")
    checked = replace(
        posterior, convergence_failures=posterior.convergence_failures + tuple(failures)
    )
    return (checked, bridge), time.process_time() - began


def _prefixed(progress: ProgressCallback, name: str) -> ProgressCallback:
    return lambda text: progress(f"{name}: {text}")
