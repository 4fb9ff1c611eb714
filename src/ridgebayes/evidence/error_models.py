"""Every form under every error model: evidences, weights, and draws of what carries weight.

Nobody knows which error model holds, so predictions and model probabilities are averaged over all
of them. Only what is printed is of one: the simplest whose evidence, forms summed out, is within
1.1 of the highest.
"""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes.errors import ComputationError
from ridgebayes.evidence.candidates import GAIN, Candidate, Effort, Weighing, evaluate
from ridgebayes.evidence.tables import evidence_table, used_evidence
from ridgebayes.inference.chains import ProgressCallback
from ridgebayes.inference.posterior import Posterior
from ridgebayes.inference.presets import QUICK, ROUGH, STANDARD, Preset
from ridgebayes.model.forms import Form
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.prior_files import ResolvedPriors, priors_of
from ridgebayes.runtime.pool import map_ordered

LEAST_WEIGHT = 0.01  # of a pair of form and error model that predictions are averaged over
AS_GOOD = 1.1  # in ln evidence: error models so close to the best are told apart by simplicity
# In ln evidence. Laplace's approximation is low by up to two; e^-6.6 is a tenth of the weight that
# counts, e^-1.6 enough to matter in the average of a form that is ruled out.
_CLOSE = 6.6
_HEAVY = 1.6
_LARGE = 0.3  # share of its form's average below which a pair that is not printed takes fewer draws
OUT_OF_REACH = 12.0  # of a form that has less than 1e-4 of the best one's evidence, whatever errs
# Of such a form, where densities are dear estimates: nothing rests on its draws.
_FEWEST = ROUGH.effort | {"n_draw": 128, "n_per_round": 128}
_MORE = STANDARD.effort | {"n_draw": 2_560, "n_round": 5, "n_per_round": 1_024, "n_point": 32}
# Standard error of a ln evidence, times the root of the pair's probability, above which a pair
# whose offsets are drawn takes more draws; of others a walk or quadrature makes sure.
_UNSURE = 0.02


@dataclass(frozen=True, eq=False)
class WeighedErrorModels:
    """Forms under error models, weighed against each other.

    Parameters
    ----------
    candidates : dict of (str, str) to Candidate
        By form and error model.
    """

    candidates: dict[tuple[str, str], Candidate] = field(repr=False)

    @cached_property
    def evidence(self) -> pd.DataFrame:
        """Columns of `evidence.csv`, a row for each pair."""
        return evidence_table({key: [one.evidence] for key, one in self.candidates.items()})

    def form_share(self, form: str) -> float:
        """Return a form's posterior probability, error models summed out."""
        used = self.evidence.query("used")
        return float(used.loc[used["form"] == form, "model_probability"].sum())

    def posteriors(self, form: str) -> dict[str, Posterior]:
        """Return a form's draws by error model; of one left to its normal twin the twin's."""
        own = {n: one for (f, n), one in self.candidates.items() if f == form and one.evidence.ok}
        drawn = {n: own.get(one.left_to, one).posterior for n, one in own.items()}
        return {n: posterior for n, posterior in drawn.items() if posterior is not None}


def error_model_weights(
    evidence: pd.DataFrame, form: str, drawn: Iterable[str]
) -> dict[str, float]:
    """Return the weights of the error models that a form's predictions are averaged over.

    Parameters
    ----------
    evidence : pandas.DataFrame
        `evidence.csv` of a run.
    form : str
        Name.
    drawn : iterable of str
        Error models with draws of their own or of their twin.

    Returns
    -------
    dict of str to float
        Posterior probabilities given the form, of those above one per cent; they sum to 1.
    """
    one = used_evidence(evidence)
    own = one[one["form"] == form].set_index("noise")["log_evidence"]
    own = own[own.index.isin(list(drawn))]
    if own.empty:
        return {}
    share = np.exp(own - logsumexp(one.loc[one["form"] == form, "log_evidence"]))
    heavy = share[share > min(LEAST_WEIGHT, share.max() / 2)]
    return {str(name): float(weight) for name, weight in (heavy / heavy.sum()).items()}


def weigh_error_models(
    data: Observations,
    forms: Sequence[Form],
    noises: Sequence[Noise],
    *,
    priors: ResolvedPriors | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    progress: ProgressCallback | None = None,
    accuracy: Preset = STANDARD,
) -> WeighedErrorModels:
    """Weigh every form under every error model.

    Parameters
    ----------
    data : Observations
        Rows.
    forms : sequence of Form
        Contact forms.
    noises : sequence of Noise
        Error models; of one alone there is nothing to average over, and nothing is drawn.
    priors : mapping of str to mapping of str to Distribution, optional
        Replacements for default priors, as `model.prior_files.resolve_priors` returns them.
    seed : int, optional
        Each pair draws from a stream of its own.
    executor : concurrent.futures.Executor, optional
        Runs the pairs; one after the other in this process if not given.
    progress : callable, optional
        Called with a line of text now and then.
    accuracy : Preset, optional
        How many draws importance sampling takes.

    Returns
    -------
    WeighedErrorModels
        Evidences by quadrature where rows are exact and independent, by importance sampling where
        an error model may carry weight in its form's average, by Laplace's approximation otherwise.
        A pair without a usable evidence says why in its status.

    Raises
    ------
    ComputationError
        If workers die, so that an evidence cannot be found; it is named.

    Notes
    -----
    A Student tail with shared offsets is left to its normal twin where it gains less than 1 in ln
    evidence: their predictions then agree. A form that the rows rule out takes few draws, under
    its best error models alone; an error model that is a small part of its form's average takes
    few, too. Where offsets are drawn, more draws are taken if the standard error of the evidence
    times the square root of the pair's probability is above 0.02.
    """
    tasks = [
        Weighing(data, form, noise, priors_of(priors, form, noise), seed)
        for form, noise in itertools.product(forms, noises)
    ]

    def evaluated(tasks: Sequence[Weighing]) -> list[Candidate]:
        if tasks and progress is not None:
            progress(f"{len(tasks)} evidences")
        # Error models of many parameters take longest: begun last they would keep one worker busy.
        tasks = sorted(tasks, key=lambda task: len(task.noise.parameter_names), reverse=True)
        return list(map_ordered(evaluate, tasks, executor, name=lambda task: task.name))

    names = {noise.name for noise in noises}
    later = {task.key for task in tasks if task.twin_name in names}
    found = {one.key: one for one in evaluated([task for task in tasks if task.key not in later])}
    if len(noises) == 1:
        return WeighedErrorModels(found)  # nothing to average over
    beside = [
        replace(
            task, twin=found[task.form.name, str(task.twin_name)], is_tame=_is_tame(found, task)
        )
        for task in tasks
        if task.key in later
    ]
    found |= {one.key: one for one in evaluated(beside)}
    found = {task.key: found[task.key] for task in tasks}
    screened = {key: one.evidence for key, one in found.items()}
    best = max(filter(math.isfinite, (_best(found, f.name) for f in forms)), default=math.inf)
    total = float(logsumexp([-math.inf, *(e.value for e in screened.values() if e.ok)]))
    unsure = max(_UNSURE, accuracy.evidence_error)
    main = _main_pairs(WeighedErrorModels(found).evidence)
    close = [
        replace(
            task,
            screened=one,
            efforts=_efforts(one, _best(found, one.form), best, accuracy, is_main=one.key in main),
            se_most=unsure * math.exp(min(total - one.evidence.value, OUT_OF_REACH) / 2),
            seeks_modes=accuracy != ROUGH,
        )
        for task, one in zip(tasks, found.values(), strict=True)
        if not one.left_to and _counts(one, _best(found, one.form), best)
    ]
    found |= {one.key: one for one in evaluated(close)}
    for key, one in found.items():
        if one.left_to:  # what the twin's draws found is common to both
            twin = found[key[0], one.left_to].evidence
            value = one.evidence.value + twin.value - screened[key[0], one.left_to].value
            status = one.evidence.status if twin.ok else twin.status
            found[key] = replace(one, evidence=replace(one.evidence, value=value, status=status))
    return WeighedErrorModels(found)


def _best(found: Mapping[tuple[str, str], Candidate], form: str) -> float:
    values = [one.evidence.value for (name, _), one in found.items() if name == form]
    return float(np.nanmax(values)) if np.isfinite(values).any() else math.inf


def _is_tame(found: Mapping[tuple[str, str], Candidate], task: Weighing) -> bool:
    """Return whether independent rows of a form show no sign of outliers."""
    pair = [found.get((task.form.name, name)) for name in ("iid:student", "iid")]
    student, normal = (math.nan if one is None else one.evidence.value for one in pair)
    return student - normal < GAIN


def _counts(one: Candidate, own: float, best: float) -> bool:
    """Return whether a pair is drawn: near the best of its form, nearer if that is ruled out."""
    within = _HEAVY if own < best - OUT_OF_REACH else _CLOSE
    return one.evidence.value > own - within


def _main_pairs(evidence: pd.DataFrame) -> set[tuple[str, str]]:
    """Return the pairs that are printed, or are much of their form's average."""
    used = used_evidence(evidence)
    if used.empty:
        return set()
    share = used["model_probability"] / used.groupby("form")["model_probability"].transform("sum")
    main = used[(share > _LARGE) | (used["noise"] == printed_error_model(evidence).name)]
    return set(zip(main["form"], main["noise"], strict=True))


def _efforts(
    one: Candidate, own: float, best: float, accuracy: Preset, *, is_main: bool
) -> tuple[Effort, ...]:
    """Return how many draws to take, and how many if weights turn out too uneven."""
    if accuracy == ROUGH:
        return (ROUGH.effort,)
    if own < best - OUT_OF_REACH:
        return (_FEWEST if one.is_latent else ROUGH.effort,)
    if not is_main or own < best - _CLOSE:
        return (QUICK.effort, STANDARD.effort)
    return (accuracy.effort, _MORE if accuracy.walks else STANDARD.effort)


def mean_evidence(evidence: pd.DataFrame) -> pd.DataFrame:
    """Return the log of the mean evidence over the forms, by error model, highest first.

    Parameters
    ----------
    evidence : pandas.DataFrame
        `evidence.csv` of a run.

    Returns
    -------
    pandas.DataFrame
        Columns noise, log_mean_evidence, probability (at equal prior), n_form. A form without an
        evidence under an error model counts there as evidence zero.

    Examples
    --------
    >>> rows = pd.DataFrame({"form": ["a", "b"] * 2, "noise": ["iid", "iid", "step", "step"],
    ...     "method": "quadrature", "log_evidence": [0.0, 0.0, 1.0, 1.0], "used": True})
    >>> mean_evidence(rows)["noise"].tolist()
    ['step', 'iid']
    """
    one = used_evidence(evidence)
    n_form = one["form"].nunique()
    rows = [
        (noise, float(logsumexp(part["log_evidence"])) - math.log(n_form), len(part))
        for noise, part in one.groupby("noise", sort=False)
    ]
    frame = pd.DataFrame(rows, columns=["noise", "log_mean_evidence", "n_form"])
    share = np.exp(frame["log_mean_evidence"] - logsumexp(frame["log_mean_evidence"]))
    frame.insert(2, "probability", share)
    return frame.sort_values("log_mean_evidence", ascending=False, kind="stable", ignore_index=True)


def printed_error_model(evidence: pd.DataFrame) -> Noise:
    """Return the simplest error model whose mean evidence is as good as the highest.

    Parameters
    ----------
    evidence : pandas.DataFrame
        `evidence.csv` of a run.

    Returns
    -------
    Noise
        Of the fewest parameters within `AS_GOOD`; of several the one with the most evidence.

    Raises
    ------
    ComputationError
        If no form has an evidence under any.
    """
    if used_evidence(evidence).empty:
        why = "; ".join(dict.fromkeys(evidence["status"]))
        raise ComputationError(f"no form has an evidence under any error model: {why}")
    means = mean_evidence(evidence)
    good = means[means["log_mean_evidence"] >= means["log_mean_evidence"].max() - AS_GOOD]
    noises = [Noise.named(name) for name in good["noise"]]
    return min(noises, key=lambda noise: len(noise.parameter_names))
