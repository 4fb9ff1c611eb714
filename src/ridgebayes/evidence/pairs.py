"""Evidences of all pairs of form and error model, and posteriors of the pairs with weight.

The error model is unknown, so that predictions and model probabilities are averaged over all error
models. Reports show the fits under one selected error model: the simplest whose ln evidence,
averaged over forms, is within 1.1 of the highest.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol, TypeVar

import pandas as pd

from ridgebayes.distributions.distribution import Distribution
from ridgebayes.errors import ComputationError
from ridgebayes.evidence.tables import (
    error_model_weights,
    evidence_table,
    selected_error_model,
    used_evidence,
)
from ridgebayes.inference.chains import ProgressCallback
from ridgebayes.inference.diagnostics import MIN_ESS
from ridgebayes.inference.importance import (
    EXACT_DRAW_FACTOR,
    N_REPEAT,
    Drawn,
    Effort,
    at_least,
    importance_sample,
)
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.posterior import Posterior, posterior_of
from ridgebayes.inference.presets import STANDARD, Preset
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.prior_files import ResolvedPriors, priors_of
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.runtime.randomness import stream

MIN_FORM_PROBABILITY = 1e-4  # less probable forms are not walked, and need not converge
MAX_LN_EVIDENCE_GAP = 12.0  # an evidence further below the best need not be precise
# Effective draws of a posterior with weight. With 400 in each of four sets, R-hat of a parameter is
# above 1.01 by chance once in 50,000.
_MIN_EFFECTIVE_DRAWS = N_REPEAT * MIN_ESS
_MIN_EFFECTIVE_SHARE = 0.05  # at most 20 draws are made for each effective draw
_MAX_DOUBLINGS = 2  # maximum number of repetitions with twice the draws and points
_Result = TypeVar("_Result")


@dataclass(frozen=True, eq=False)
class Pair:
    """A form and an error model, with all inputs that a worker process needs.

    Parameters
    ----------
    data : Observations
        Rows.
    form : Form
        Contact form.
    noise : Noise
        Error model.
    priors : mapping of str to Distribution
        Replacements for default priors.
    seed : int
        Seed; the draws of a pair depend on it and on the names of form and error model.
    effort : Effort
        Numbers of draws.
    """

    data: Observations
    form: Form
    noise: Noise
    priors: Mapping[str, Distribution]
    seed: int
    effort: Effort

    @property
    def key(self) -> tuple[str, str]:
        """Names of form and error model."""
        return self.form.name, self.noise.name

    @property
    def name(self) -> str:
        """Name in messages."""
        return f"evidence of {self.form.name}, {self.noise.name}"

    @property
    def cost(self) -> float:
        """Run time relative to other pairs; estimates take longer than exact densities."""
        return len(self.noise.parameter_names) * (1.0 if self.noise.tail == "normal" else 4.0)

    @property
    def own_seed(self) -> int:
        """Seed for this pair only."""
        return int(stream(self.seed, *self.key).integers(2**63))

    def model(self) -> Model:
        """Return the pair's model."""
        return Model(self.data, self.form, self.noise, self.priors)

    def target(self) -> ModelTarget:
        """Return the pair's posterior density."""
        return ModelTarget(self.model(), self.own_seed)


@dataclass(frozen=True, eq=False)
class Weighed:
    """A pair with its evidence.

    Parameters
    ----------
    evidence : LogEvidence
        Log evidence; if sampling failed, NaN with the reason in its status.
    drawn : Drawn, optional
        Draws of the posterior; None if sampling failed.
    """

    evidence: LogEvidence
    drawn: Drawn | None = field(default=None, repr=False)


def weigh(pair: Pair) -> Weighed:
    """Compute a pair's evidence and draws; if sampling fails, the status states the reason."""
    try:
        drawn = importance_sample(pair.target(), pair.effort, pair.own_seed)
    except ComputationError as error:
        return Weighed(LogEvidence("importance", math.nan, math.nan, str(error)))
    return Weighed(drawn.evidence, drawn)


@dataclass(frozen=True, eq=False)
class WeighedPairs:
    """Evidences and draws of all pairs of form and error model.

    Parameters
    ----------
    pairs : dict of (str, str) to Pair
        Pairs by names of form and error model.
    weighed : dict of (str, str) to Weighed
        Evidences and draws of the pairs.
    prior_odds : mapping of str to float, optional
        Prior odds of forms; 1 for forms that are not given.
    """

    pairs: dict[tuple[str, str], Pair] = field(repr=False)
    weighed: dict[tuple[str, str], Weighed] = field(repr=False)
    prior_odds: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def evidence(self) -> pd.DataFrame:
        """Table with the columns of `evidence.csv` and a row for each pair."""
        evidences = {key: [pair.evidence] for key, pair in self.weighed.items()}
        return evidence_table(evidences, self.prior_odds)

    def selected(self) -> Noise:
        """Return the selected error model.

        If no evidence is usable, the error model with the highest evidence among pairs with draws
        is selected; the fit's status states the reason.

        Raises
        ------
        ComputationError
            If no pair has draws.
        """
        drawn = {key: pair.evidence.value for key, pair in self.weighed.items() if pair.drawn}
        if used_evidence(self.evidence).empty and drawn:
            return self.pairs[max(drawn, key=lambda key: drawn[key])].noise
        return selected_error_model(self.evidence)

    def form_share(self, form: str) -> float:
        """Return a form's posterior probability, summed over error models."""
        used = used_evidence(self.evidence)
        return float(used.loc[used["form"] == form, "model_probability"].sum())

    def weights(self, form: str) -> dict[str, float]:
        """Return the weights of error models in a form's averaged predictions."""
        return error_model_weights(self.evidence, form)

    def posteriors(
        self,
        forms: Sequence[str],
        selected: str,
        n_kept: int,
        executor: Executor | None = None,
    ) -> dict[str, dict[str, Posterior]]:
        """Return posteriors of pairs with weight or the selected error model, by form and noise.

        Parameters
        ----------
        forms : sequence of str
            Names of forms.
        selected : str
            Selected error model.
        n_kept : int
            Total number of draws for a form, divided among error models in proportion to their
            weights. If the evidence took fewer draws, more are made, unless the form's probability
            is at most 1e-4. If a posterior does not converge, twice the draws are made.
        executor : concurrent.futures.Executor, optional
            Runs the pairs; one after the other in this process if not given.
        """
        tasks = []
        for form in forms:
            weights = {selected: 0.0} | self.weights(form)
            share = self.form_share(form)
            for noise, weight in weights.items():
                weight = weight if share > MIN_FORM_PROBABILITY else 0.0
                drawn = self.weighed[form, noise].drawn
                if drawn is None:
                    continue
                tasks.append(_PosteriorTask(self.pairs[form, noise], drawn, round(weight * n_kept)))
        by_form: dict[str, dict[str, Posterior]] = {form: {} for form in forms}
        for task, posterior in zip(tasks, in_parallel(_posterior, tasks, executor), strict=True):
            form, noise = task.pair.key
            by_form[form][noise] = posterior
        return by_form


@dataclass(frozen=True, eq=False)
class _PosteriorTask:
    """A pair, its draws, and the required number of draws of its posterior."""

    pair: Pair
    drawn: Drawn
    n_draw: int

    @property
    def name(self) -> str:
        return f"posterior of {self.pair.form.name}, {self.pair.noise.name}"

    @property
    def cost(self) -> float:
        return self.n_draw * self.pair.cost


def _posterior(task: _PosteriorTask) -> Posterior:
    """Return a pair's posterior, with additional draws if there are too few."""
    target, drawn, seed = task.pair.target(), task.drawn, task.pair.own_seed
    n = task.n_draw if target.is_exact else task.n_draw // EXACT_DRAW_FACTOR
    if task.n_draw:
        n = max(n, round(_MIN_EFFECTIVE_DRAWS / max(drawn.share, _MIN_EFFECTIVE_SHARE)))
    drawn = at_least(drawn, target, n, task.pair.effort, seed)
    posterior = posterior_of(target.model, drawn, seed)
    if drawn.evidence.ok and not posterior.converged:  # one draw with a large weight can do this
        drawn = at_least(drawn, target, 2 * drawn.log_density.size, task.pair.effort, seed)
        posterior = posterior_of(target.model, drawn, seed)
    return posterior


def weigh_pairs(
    data: Observations,
    forms: Sequence[Form],
    noises: Sequence[Noise],
    *,
    priors: ResolvedPriors | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    progress: ProgressCallback | None = None,
    accuracy: Preset = STANDARD,
) -> WeighedPairs:
    """Compute the evidence of every form under every error model, with equal effort.

    Parameters
    ----------
    data : Observations
        Rows.
    forms : sequence of Form
        Contact forms.
    noises : sequence of Noise
        Error models.
    priors : mapping of str to mapping of str to Distribution, optional
        Replacements for default priors, as `model.prior_files.resolve_priors` returns them.
    seed : int, optional
        Seed of the pairs' random streams.
    executor : concurrent.futures.Executor, optional
        Runs the pairs; one after the other in this process if not given.
    progress : callable, optional
        Called with a line of text at each pass.
    accuracy : Preset, optional
        Preset with the numbers of draws of importance sampling.

    Returns
    -------
    WeighedPairs
        Evidences and draws; the status of a pair without a usable evidence states the reason.

    Raises
    ------
    ComputationError
        If worker processes die; the message names the evidence that is missing.

    Notes
    -----
    If the weights of a pair fail a check, the pair is sampled again with twice the draws and
    points, at most twice. Pairs with a ln evidence of more than 12 below the best keep the result
    of the first pass; their status begins with "first pass".
    """
    pairs = {
        pair.key: pair
        for form, noise in itertools.product(forms, noises)
        for pair in [Pair(data, form, noise, priors_of(priors, form, noise), seed, accuracy.effort)]
    }
    if progress is not None:
        progress(f"{len(pairs)} evidences")
    weighed = dict(zip(pairs, in_parallel(weigh, list(pairs.values()), executor), strict=True))
    for _ in range(_MAX_DOUBLINGS):
        again = [key for key in pairs if not weighed[key].evidence.ok and _matters(weighed, key)]
        if not again:
            break
        if progress is not None:
            progress(f"{len(again)} evidences again, with more draws")
        for key in again:
            pairs[key] = replace(pairs[key], effort=pairs[key].effort.doubled)
        results = in_parallel(weigh, [pairs[key] for key in again], executor)
        weighed |= dict(zip(again, results, strict=True))
    for key, result in weighed.items():
        if result.drawn is not None and not result.evidence.ok and not _matters(weighed, key):
            weighed[key] = replace(result, evidence=result.evidence.kept())
    return WeighedPairs(pairs, weighed)


def _matters(weighed: Mapping[tuple[str, str], Weighed], key: tuple[str, str]) -> bool:
    """Return whether a pair's evidence is so close to the best that its error matters."""
    values = [result.evidence.value for result in weighed.values()]
    best = max((value for value in values if math.isfinite(value)), default=math.nan)
    return bool(weighed[key].evidence.value > best - MAX_LN_EVIDENCE_GAP)


class Task(Protocol):
    """A task of a worker process."""

    @property
    def name(self) -> str:
        """Name in messages."""
        ...

    @property
    def cost(self) -> float:
        """Run time relative to other tasks."""
        ...


_Task = TypeVar("_Task", bound=Task)


def in_parallel(
    function: Callable[[_Task], _Result], tasks: Sequence[_Task], executor: Executor | None
) -> list[_Result]:
    """Run tasks and return their results in the order of the tasks.

    Tasks with the highest cost start first, because a long task that starts last would keep one
    worker busy while the others are idle.
    """
    order = sorted(range(len(tasks)), key=lambda i: tasks[i].cost, reverse=True)
    started = [tasks[i] for i in order]
    results = map_ordered(function, started, executor, name=lambda task: task.name)
    by_place = dict(zip(order, results, strict=True))
    return [by_place[i] for i in range(len(tasks))]
