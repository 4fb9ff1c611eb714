"""Every form under every error model, weighed alike, and draws of the pairs that carry weight.

The error model is unknown, so predictions and model probabilities are averaged over all of them.
One error model is selected for the fits that are shown: the simplest whose evidence, forms summed
out, is within 1.1 of the highest.
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
from ridgebayes.inference.importance import (
    EXACT_DRAW_FACTOR,
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

MIN_FORM_PROBABILITY = 1e-4  # forms below it are not walked, and need not converge
MAX_LN_EVIDENCE_GAP = 12.0  # below the best: evidences further down decide nothing
# Effective draws of a posterior with weight: with 400 in each of four sets R-hat of a parameter is
# above 1.01 by chance once in 50,000. A poor proposal makes at most 20 draws for each.
_MIN_EFFECTIVE_DRAWS, _MIN_EFFECTIVE_SHARE = 1_600, 0.05
_MAX_DOUBLINGS = 2  # of draws and points
_Result = TypeVar("_Result")


@dataclass(frozen=True, eq=False)
class Pair:
    """A form under an error model, with everything that a worker process needs.

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
        Seed; a pair's draws depend on it and on the pair's names.
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
        """Name for messages."""
        return f"evidence of {self.form.name}, {self.noise.name}"

    @property
    def cost(self) -> float:
        """How long it takes next to other pairs; estimates take longer than exact densities."""
        return len(self.noise.parameter_names) * (1.0 if self.noise.tail == "normal" else 4.0)

    @property
    def own_seed(self) -> int:
        """Seed of this pair alone."""
        return int(stream(self.seed, *self.key).integers(2**63))

    def target(self) -> ModelTarget:
        """Return the pair's posterior density."""
        model = Model(self.data, self.form, self.noise, self.priors)
        return ModelTarget(model, self.own_seed)


@dataclass(frozen=True, eq=False)
class Weighed:
    """A pair with its evidence.

    Parameters
    ----------
    evidence : LogEvidence
        Log evidence; NaN with the reason in its status where the posterior could not be drawn from.
    drawn : Drawn, optional
        Draws of its posterior.
    """

    evidence: LogEvidence
    drawn: Drawn | None = field(default=None, repr=False)


def weigh(pair: Pair) -> Weighed:
    """Return a pair's evidence and draws; the reason where there are none."""
    try:
        drawn = importance_sample(pair.target(), pair.effort, pair.own_seed)
    except ComputationError as error:
        return Weighed(LogEvidence("importance", math.nan, math.nan, str(error)))
    return Weighed(drawn.evidence, drawn)


@dataclass(frozen=True, eq=False)
class WeighedPairs:
    """Forms under error models, weighed against each other.

    Parameters
    ----------
    pairs : dict of (str, str) to Pair
        By names of form and error model.
    weighed : dict of (str, str) to Weighed
        The same, with their evidences.
    prior_odds : mapping of str to float, optional
        Prior odds of forms; forms that are not named have 1.
    """

    pairs: dict[tuple[str, str], Pair] = field(repr=False)
    weighed: dict[tuple[str, str], Weighed] = field(repr=False)
    prior_odds: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def evidence(self) -> pd.DataFrame:
        """Columns of `evidence.csv`, a row for each pair."""
        evidences = {key: [pair.evidence] for key, pair in self.weighed.items()}
        return evidence_table(evidences, self.prior_odds)

    def selected(self) -> Noise:
        """Return the selected error model.

        Where no evidence can be used, that of the highest evidence with draws: its fit says what it
        lacks.

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
        """Return a form's posterior probability, error models summed out."""
        used = used_evidence(self.evidence)
        return float(used.loc[used["form"] == form, "model_probability"].sum())

    def weights(self, form: str) -> dict[str, float]:
        """Return the weights of the error models that a form's predictions are averaged over."""
        return error_model_weights(self.evidence, form)

    def posteriors(
        self,
        forms: Sequence[str],
        selected: str,
        n_kept: int,
        executor: Executor | None = None,
    ) -> dict[str, dict[str, Posterior]]:
        """Return posteriors of pairs that carry weight or are selected, by form and error model.

        Parameters
        ----------
        forms : sequence of str
            Names of forms.
        selected : str
            Selected error model.
        n_kept : int
            Draws of a form's posteriors together, shared out by their weights. More are drawn where
            the evidence took fewer, unless the form is negligible.
        executor : concurrent.futures.Executor, optional
            Where they are drawn.
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
                tasks.append(_Completion(self.pairs[form, noise], drawn, round(weight * n_kept)))
        by_form: dict[str, dict[str, Posterior]] = {form: {} for form in forms}
        for task, posterior in zip(tasks, in_parallel(_completed, tasks, executor), strict=True):
            form, noise = task.pair.key
            by_form[form][noise] = posterior
        return by_form


@dataclass(frozen=True, eq=False)
class _Completion:
    """A pair whose posterior is wanted, and the number of draws."""

    pair: Pair
    drawn: Drawn
    n_draw: int

    @property
    def name(self) -> str:
        return f"posterior of {self.pair.form.name}, {self.pair.noise.name}"

    @property
    def cost(self) -> float:
        return self.n_draw * self.pair.cost


def _completed(task: _Completion) -> Posterior:
    """Return a posterior, with more draws where there are too few."""
    target, drawn, seed = task.pair.target(), task.drawn, task.pair.own_seed
    n = task.n_draw if target.is_exact else task.n_draw // EXACT_DRAW_FACTOR
    if task.n_draw:
        n = max(n, round(_MIN_EFFECTIVE_DRAWS / max(drawn.share, _MIN_EFFECTIVE_SHARE)))
    drawn = at_least(drawn, target, n, task.pair.effort, seed)
    return posterior_of(target.model, drawn, seed)


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
    """Weigh every form under every error model, with the same effort.

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
        Each pair draws from a stream of its own.
    executor : concurrent.futures.Executor, optional
        Runs the pairs; one after the other in this process if not given.
    progress : callable, optional
        Called with a line of text now and then.
    accuracy : Preset, optional
        How many draws importance sampling takes.

    Returns
    -------
    WeighedPairs
        A pair without a usable evidence says why in its status.

    Raises
    ------
    ComputationError
        If workers die, so that an evidence cannot be found; it is named.

    Notes
    -----
    A pair whose weights fail a check is drawn again with twice the draws and points, at most twice.
    Pairs more than 12 in ln evidence below the best keep the first pass, and are marked so.
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
        again = [key for key in pairs if not weighed[key].evidence.ok and _counts(weighed, key)]
        if not again:
            break
        if progress is not None:
            progress(f"{len(again)} evidences again, with more draws")
        for key in again:
            pairs[key] = replace(pairs[key], effort=pairs[key].effort.doubled)
        results = in_parallel(weigh, [pairs[key] for key in again], executor)
        weighed |= dict(zip(again, results, strict=True))
    for key, result in weighed.items():
        if result.drawn is not None and not result.evidence.ok and not _counts(weighed, key):
            weighed[key] = replace(result, evidence=result.evidence.kept())
    return WeighedPairs(pairs, weighed)


def _counts(weighed: Mapping[tuple[str, str], Weighed], key: tuple[str, str]) -> bool:
    """Return whether a pair's evidence is near enough to the best for its error to matter."""
    values = [result.evidence.value for result in weighed.values()]
    best = max((value for value in values if math.isfinite(value)), default=math.nan)
    return bool(weighed[key].evidence.value > best - MAX_LN_EVIDENCE_GAP)


class Task(Protocol):
    """Task of a worker."""

    @property
    def name(self) -> str:
        """Name for messages."""
        ...

    @property
    def cost(self) -> float:
        """How long it takes, next to others."""
        ...


_Task = TypeVar("_Task", bound=Task)


def in_parallel(
    function: Callable[[_Task], _Result], tasks: Sequence[_Task], executor: Executor | None
) -> list[_Result]:
    """Return results in the order of the tasks; tasks of many parameters start first.

    A long task that starts last keeps one worker busy while the others have nothing to do.
    """
    order = sorted(range(len(tasks)), key=lambda i: tasks[i].cost, reverse=True)
    started = [tasks[i] for i in order]
    results = map_ordered(function, started, executor, name=lambda task: task.name)
    by_place = dict(zip(order, results, strict=True))
    return [by_place[i] for i in range(len(tasks))]
