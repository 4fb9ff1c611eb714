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

from ridgebayes.distributions.distribution import Distribution
from ridgebayes.errors import ComputationError
from ridgebayes.evidence import (
    LogEvidence,
    laplace_evidence,
    power_law_evidence,
    quadrature_evidence,
)
from ridgebayes.evidence.tables import evidence_table, used_evidence
from ridgebayes.inference.chains import ProgressCallback
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import Laplace, fit_laplace, no_mode, several_modes
from ridgebayes.inference.posterior import Posterior, drawn_exactly
from ridgebayes.inference.power_law_exact import is_conjugate
from ridgebayes.inference.presets import STANDARD, Preset
from ridgebayes.inference.sampling import sample_posterior
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise, as_noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.prior_files import OF_ERRORS, Priors, ResolvedPriors, resolve_priors
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.runtime.randomness import stream

AUTO = "auto"
LEAST_WEIGHT = 0.01  # of a pair of form and error model that predictions are averaged over
AS_GOOD = 1.1  # in ln evidence: error models so close to the best are told apart by simplicity
# Laplace's approximation is low by up to two; e^-6.6 is a tenth of the weight that counts.
_CLOSE = 6.6


@dataclass(frozen=True, eq=False)
class Candidate:
    """A form under an error model: what its weight in an average follows from.

    Parameters
    ----------
    form, noise : str
        Names.
    evidence : LogEvidence
        Its log evidence; the status tells if there is none.
    laplace : Laplace, optional
        The normal approximation of its posterior.
    posterior : Posterior, optional
        Draws by importance sampling, where the pair carries weight.
    left_to : str
        Error model of normal tail whose draws stand for those of a Student tail; else empty.
    """

    form: str
    noise: str
    evidence: LogEvidence
    laplace: Laplace | None = None
    posterior: Posterior | None = None
    left_to: str = ""


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
    priors: Priors | None = None,
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
    priors : mapping of str to mapping of str to Distribution or str, optional
        Replacements for default priors: by form name, or ``noise``, and parameter name.
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
    InputError
        If a prior is given that no form or error model has.
    ComputationError
        If workers die, so that an evidence cannot be found; it is named.

    Notes
    -----
    A Student tail with shared offsets is left to its normal twin where Laplace's approximation
    finds no gain in it: their predictions then agree.
    """
    known = resolve_priors(priors, forms, noises, data)
    pairs = list(itertools.product(forms, noises))
    tasks = [
        _Weighing(data, form, noise, priors_of(known, form, noise), seed, accuracy)
        for form, noise in pairs
    ]

    def evaluated(tasks: Sequence["_Weighing"]) -> list[Candidate]:
        if tasks and progress is not None:
            progress(f"{len(tasks)} evidences")
        return list(map_ordered(_evaluate, tasks, executor, name=lambda task: task.name))

    found = {(one.form, one.noise): one for one in evaluated(tasks)}
    if len(noises) == 1:
        return WeighedErrorModels(found)  # nothing to average over
    found = {key: _left_to_twin(one, found) for key, one in found.items()}
    close = [
        replace(task, screened=one, draws=True)
        for task, one in zip(tasks, found.values(), strict=True)
        if not one.left_to and one.evidence.value > _best(found, one.form) - _CLOSE
    ]
    for one in evaluated(close):
        found[one.form, one.noise] = one
    return WeighedErrorModels(found)


def error_models_for(noise: str | Noise, data: Observations) -> list[Noise]:
    """Return the error models to weigh: all that suit the rows for ``auto``, else the named."""
    if noise != AUTO:
        return [as_noise(noise)]
    return list(Noise.candidates(data.n_series))


def priors_of(priors: ResolvedPriors | None, form: Form, noise: Noise) -> dict[str, Distribution]:
    """Return the replaced priors that a form under an error model has."""
    given = priors or {}
    shared = given.get(OF_ERRORS, {})
    own = {name: prior for name, prior in shared.items() if name in noise.parameter_names}
    return {**given.get(form.name, {}), **own}


def _best(found: Mapping[tuple[str, str], Candidate], form: str) -> float:
    values = [one.evidence.value for (name, _), one in found.items() if name == form]
    return float(np.nanmax(values)) if np.isfinite(values).any() else math.inf


def _left_to_twin(one: Candidate, found: Mapping[tuple[str, str], Candidate]) -> Candidate:
    noise = Noise.named(one.noise)
    twin = found.get((one.form, replace(noise, tail="normal").name))
    if noise.tail == "normal" or not noise.factors or twin is None:
        return one
    gain = one.evidence.value - twin.evidence.value
    return replace(one, left_to=twin.noise) if gain < 0 else one


@dataclass(frozen=True, eq=False)
class _Weighing:
    """One evidence to be found; holds all that a process of its own needs.

    With what its screening found, the posterior is drawn if it is asked for.
    """

    data: Observations
    form: Form
    noise: Noise
    priors: Mapping[str, Distribution]
    seed: int
    accuracy: Preset
    screened: Candidate | None = None
    draws: bool = False

    @property
    def name(self) -> str:
        return f"evidence of {self.form.name}, {self.noise.name}"

    @property
    def own_seed(self) -> int:
        return int(stream(self.seed, self.form.name, self.noise.name).integers(2**63))


def _evaluate(task: _Weighing) -> Candidate:
    """Screen a pair, or draw from its posterior."""
    names = task.form.name, task.noise.name
    try:
        model = Model(task.data, task.form, task.noise, task.priors)
        if task.screened is not None and task.screened.laplace is not None:
            return _drawn(task, model, task.screened.evidence, task.screened.laplace)
        if drawn_exactly(model):
            return _exact(task, model)
        laplace = fit_laplace(model)
        return Candidate(*names, _screened(model, laplace), laplace)
    except ComputationError as error:
        return Candidate(*names, LogEvidence("laplace", math.nan, math.nan, str(error)))


def _exact(task: _Weighing, model: Model) -> Candidate:
    evidence = power_law_evidence(model)
    if not evidence.ok:
        raise no_mode(model)
    posterior = sample_posterior(model, seed=task.own_seed) if task.draws else None
    return Candidate(model.form.name, model.noise.name, evidence, posterior=posterior)


def _screened(model: Model, laplace: Laplace) -> LogEvidence:
    if is_conjugate(model):
        return power_law_evidence(model)
    if model.is_iid_gaussian:
        found = quadrature_evidence(model.log_density, laplace)
        if found.ok:
            return found
    return laplace_evidence(laplace)


def _drawn(task: _Weighing, model: Model, screened: LogEvidence, laplace: Laplace) -> Candidate:
    laplace = replace(laplace, other_modes=several_modes(model, laplace))
    effort = task.accuracy.effort
    posterior, evidence = importance_posterior(model, laplace, seed=task.own_seed, **effort)
    if not evidence.ok:  # more draws, and more rounds of fitting proposals
        posterior, evidence = importance_posterior(model, laplace, seed=task.own_seed)
    if screened.method == "quadrature" or not evidence.ok:
        evidence = screened
    return Candidate(model.form.name, model.noise.name, evidence, laplace, posterior)


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
