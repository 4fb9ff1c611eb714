"""Sensitivity of evidences to the scales of priors, and to the nugget of a smooth offset.

The draws of every pair are reweighted by the ratio of new to old prior. Pairs with unreliable
weights are sampled again under the widest or the narrowest prior; for the priors in between, these
draws and the draws under the default prior are reweighted together. Rows hardly inform the degrees
of freedom of Student errors, so that other priors have mass where there are no draws. Degrees of
freedom are therefore integrated out, given each draw's other parameters and offsets.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd
from scipy.special import logsumexp, ndtri

from ridgebayes._types import FloatArray
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.evidence.pairs import (
    MAX_LN_EVIDENCE_GAP,
    Pair,
    WeighedPairs,
    in_parallel,
    weigh,
)
from ridgebayes.evidence.tables import used_evidence
from ridgebayes.inference.importance import MAX_SE, Drawn, Effort
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.inference.pareto_smoothing import have_finite_variance
from ridgebayes.inference.presets import QUICK
from ridgebayes.inference.proposal import log_mean
from ridgebayes.model.default_priors import SLOPES
from ridgebayes.model.model import Model
from ridgebayes.model.noise import SMOOTH
from ridgebayes.runtime.randomness import stream

SENSITIVITY_COLUMNS = ["prior", "factor", "form", "log_evidence"]
NUGGET = "nugget"
COEFFICIENTS = ("c", "c2")  # their priors come from contact mechanics, and are narrowed less
_SCALE_FACTORS = (0.1, 0.3, 1.0, 3.0, 10.0)
# A pair further below the best pair of its form in ln evidence has less than 5 % of the form's
# evidence, the largest accepted standard error. Evidences from weights that miss a new mode are
# too low, mostly by less than this gap, which is 3.
_MAX_LN_EVIDENCE_GAP = -math.log(MAX_SE)
_N_LIKELIHOOD_DRAW = Effort().n_draw  # draws with likelihoods under changed priors
# Values of the degrees of freedom, over all their priors and among those of the draws.
_N_NODE = 24

_Key = tuple[str, str]  # names of form and error model
_Change = tuple[str, float]  # name of a prior, and factor of its scale
_PairChange = tuple[_Key, _Change]


def prior_of(parameter: str) -> str:
    """Return the name of the prior that includes a parameter: c includes c1, K includes all K."""
    return {"c1": "c"}.get(parameter, parameter.partition("[")[0])


def scale_factors(prior: str) -> tuple[float, ...]:
    """Return the factors by which a prior's scale is multiplied."""
    if prior == NUGGET:
        return _SCALE_FACTORS[::2]
    return _SCALE_FACTORS[1:] if prior in COEFFICIENTS else _SCALE_FACTORS


@dataclass(frozen=True, eq=False)
class _Task:
    """A pair, changes of its priors, and draws under its default priors.

    An evidence below `lowest` need not be precise.
    """

    pair: Pair
    changes: Sequence[_Change]
    drawn: Drawn
    lowest: float = -math.inf

    @property
    def name(self) -> str:
        return f"prior sensitivity of {self.pair.form.name}, {self.pair.noise.name}"

    @property
    def cost(self) -> float:
        return self.pair.cost * len(self.changes)


def prior_sensitivity(weighed: WeighedPairs, *, executor: Executor | None = None) -> pd.DataFrame:
    """Return log evidences of forms, averaged over error models, with each prior's scale changed.

    Parameters
    ----------
    weighed : WeighedPairs
        Pairs under the default priors, with their draws.
    executor : concurrent.futures.Executor, optional
        Runs the pairs; one after the other in this process if not given.

    Returns
    -------
    pandas.DataFrame
        Columns prior (c, which is also c1; c2, K, sigma, tau_..., length_..., df; nugget), factor,
        form, log_evidence. One prior is changed at a time, in all pairs that have it. A pair is
        sampled again if its weights may have no finite variance (`have_finite_variance`) and its ln
        evidence may be less than 3 below that of the form's best pair. A new evidence with a
        standard error above 0.1 is computed again with twice the draws, unless it is more than 12
        below the best evidence. Pairs that far below get half of the draws.
    """
    used = used_evidence(weighed.evidence)
    keys = zip(used["form"], used["noise"], strict=True)
    evidence: dict[_Key, float] = dict(zip(keys, used["log_evidence"], strict=True))
    pairs = {key: weighed.pairs[key] for key in evidence}
    draws = {key: drawn for key in pairs if (drawn := weighed.weighed[key].drawn) is not None}
    tasks = [_Task(pairs[key], _changes(pairs[key]), drawn) for key, drawn in draws.items()]
    values: dict[_PairChange, float] = {}
    doubtful: set[_PairChange] = set()
    for task, result in zip(tasks, in_parallel(_reweighted, tasks, executor), strict=True):
        key = task.pair.key
        values |= {(key, change): evidence[key] + value for change, (value, _) in result.items()}
        doubtful |= {(key, change) for change, (_, is_sure) in result.items() if not is_sure}
    # Unreliable weights can be far too large, so that other pairs matter when they are replaced.
    while unreliable := _unreliable_changes(evidence, values, doubtful):
        sides: dict[tuple[_Key, str, bool], list[_Change]] = {}
        for key, change in unreliable:
            sides.setdefault((key, change[0], change[1] > 1), []).append(change)
        again = []
        for (key, *_), changes in sides.items():
            best = min(max(_under(change, evidence, values).values()) for change in changes)
            lowest = best - MAX_LN_EVIDENCE_GAP
            again.append(_Task(pairs[key], changes, draws[key], lowest))
        for task, redrawn in zip(again, in_parallel(_redrawn, again, executor), strict=True):
            values |= {(task.pair.key, change): value for change, value in redrawn.items()}
        doubtful.difference_update(unreliable)
    return _table(evidence, values, len({noise for _, noise in weighed.pairs}))


def _under(
    change: _Change, evidence: Mapping[_Key, float], values: Mapping[_PairChange, float]
) -> dict[_Key, float]:
    """Return the log evidence of each pair under a change; unchanged without this prior."""
    return {key: values.get((key, change), default) for key, default in evidence.items()}


def _table(
    evidence: Mapping[_Key, float], values: Mapping[_PairChange, float], n_noise: int
) -> pd.DataFrame:
    """Return log evidences of forms, averaged over n error models with equal prior odds."""
    rows = []
    for change in dict.fromkeys(change for _, change in values):
        under = _under(change, evidence, values)
        for form in dict.fromkeys(form for form, _ in evidence):
            summed = [value for key, value in under.items() if key[0] == form]
            rows.append((*change, form, float(logsumexp(summed)) - math.log(n_noise)))
    return pd.DataFrame(rows, columns=SENSITIVITY_COLUMNS)


def _unreliable_changes(
    evidence: Mapping[_Key, float],
    values: Mapping[_PairChange, float],
    doubtful: Collection[_PairChange],
) -> list[_PairChange]:
    """Return pairs and changes with unreliable weights whose evidences may matter."""
    unreliable = []
    for change in dict.fromkeys(change for _, change in values):
        best: dict[str, float] = {}
        for (form, _), value in _under(change, evidence, values).items():
            best[form] = max(best.get(form, -math.inf), value)
        for key in evidence:
            # `most` is an upper estimate: weights that miss a mode are too low, and the prior may
            # have no effect on this pair.
            if (key, change) in doubtful:
                most = max(values[key, change] + _MAX_LN_EVIDENCE_GAP, evidence[key])
                if most > best[key[0]] - _MAX_LN_EVIDENCE_GAP:
                    unreliable.append((key, change))
    return unreliable


def _redrawn(task: _Task) -> dict[_Change, float]:
    """Return log evidences under changed priors; changes whose sampling fails are omitted.

    The changes are scale factors of one prior, all above 1 or all below 1. The furthest prior is
    sampled first.
    """
    values: dict[_Change, float] = {}
    furthest: tuple[_Change, Drawn] | None = None
    for change in sorted(task.changes, key=lambda change: -abs(math.log(change[1]))):
        if furthest is not None:
            value, is_reliable = _between(task, change, *furthest)
            if is_reliable:
                values[change] = value
                continue
        pair = _changed(task.pair, change)
        efforts = [pair.effort, pair.effort.doubled]
        if task.drawn.evidence.value < task.lowest:
            efforts.insert(0, pair.effort.halved)
        for effort in efforts:
            result = weigh(replace(pair, effort=effort))
            evidence = result.evidence
            if evidence.value < task.lowest or evidence.se <= QUICK.evidence_error:
                break
        if result.drawn is not None:
            values[change], furthest = result.evidence.value, (change, result.drawn)
    return values


def _between(task: _Task, change: _Change, outer: _Change, drawn: Drawn) -> tuple[float, bool]:
    """Return a log evidence from draws under default and outer prior, and whether it is reliable.

    The weights are densities relative to the mixture of both posteriors, and have an upper limit if
    the changed prior is nowhere far above both.
    """
    base = task.drawn
    n = min(base.log_density.size, drawn.log_density.size)
    draws = _Draws.of(task.pair, base, n).beside(_Draws.of(_changed(task.pair, outer), drawn, n))
    relative = draws.log_ratio(outer) - (drawn.evidence.value - base.evidence.value)
    ratio = draws.log_ratio(change) - np.logaddexp(relative, 0.0) + math.log(2)
    return base.evidence.value + float(log_mean(ratio)), have_finite_variance(ratio)


def _reweighted(task: _Task) -> dict[_Change, tuple[float, bool]]:
    """Return changes of ln evidence by reweighting, and whether each is reliable."""
    draws = _Draws.of(task.pair, task.drawn)
    ratios = {change: draws.log_ratio(change) for change in task.changes}
    return {
        change: (float(log_mean(ratio)), have_finite_variance(ratio))
        for change, ratio in ratios.items()
    }


@dataclass(frozen=True, eq=False)
class _Draws:
    """Draws at which densities under changed priors are compared with the default density.

    Parameters
    ----------
    pair : Pair
        Pair with its default priors.
    u : ndarray of float, shape (n, n_outer)
        Normal scores of the draws, under the priors with which they were drawn.
    theta : ndarray of float, shape (n, n_outer)
        Outer parameters.
    scores : ndarray of float, shape (n, n_level)
        Scores of the offsets; empty for normal rows.
    """

    pair: Pair
    u: FloatArray
    theta: FloatArray
    scores: FloatArray

    @classmethod
    def of(cls, pair: Pair, drawn: Drawn, n: int | None = None) -> "_Draws":
        """Return a pair's draws, at most n of them if given."""
        u, scores = map(np.concatenate, (drawn.u, drawn.scores))
        if n is not None:
            step = len(u) // n
            u, scores = u[::step][:n], scores[::step][:n]
        return cls(pair, u, pair.model().outer_theta(u), scores)

    def beside(self, other: "_Draws") -> "_Draws":
        """Return these draws and as many draws of the pair under other priors."""
        sets = (self.u, other.u), (self.theta, other.theta), (self.scores, other.scores)
        return _Draws(self.pair, *(np.concatenate(arrays) for arrays in sets))

    def log_ratio(self, change: _Change) -> FloatArray:
        """Return the log ratio of changed to default density at the draws."""
        prior, factor = change
        ratio = np.zeros(len(self.theta))
        if factor == 1:
            return ratio
        if prior in (SLOPES, NUGGET):
            return self._likelihood(_changed(self.pair, change)) - self._default_likelihood
        model = self._model
        if prior in model.tail.parameter_names:
            return self._log_ratio_of_tails(model.priors[prior], factor)
        for name in _scaled_priors(model)[prior]:
            x, default = self.theta[:, model.outer_names.index(name)], model.priors[name]
            with np.errstate(invalid="ignore"):  # inf - inf for draws outside both supports
                ratio += default.stretched(factor).log_pdf(x) - default.log_pdf(x)
        return np.where(np.isnan(ratio), -np.inf, ratio)

    @cached_property
    def _model(self) -> Model:
        return self.pair.model()

    def _log_ratio_of_tails(self, default: Distribution, factor: float) -> FloatArray:
        """Return the log ratio at about 256 draws, with the degrees of freedom integrated out."""
        nodes, log_likelihood = self._at_nodes
        # The trapezoidal rule in log df.
        log_terms = log_likelihood + np.log(np.gradient(np.log(nodes)) * nodes)
        priors = default.stretched(factor), default
        with np.errstate(divide="ignore"):
            changed, unchanged = (
                logsumexp(log_terms + prior.log_pdf(nodes), axis=1) for prior in priors
            )
        ratio = np.asarray(changed - unchanged)
        return np.where(np.isnan(ratio), -np.inf, ratio)

    @cached_property
    def _at_nodes(self) -> tuple[FloatArray, FloatArray]:
        """Degrees of freedom, and log-likelihoods of about 256 draws with each, (n, n_node)."""
        model, step = self._model, max(len(self.theta) // _N_LIKELIHOOD_DRAW, 1)
        theta, scores = self.theta[::step], self.scores[::step]
        (name,) = model.tail.parameter_names
        end = float(ndtri(1 / len(theta)))  # one of the draws from a prior is expected beyond
        low, high = (
            model.priors[name].stretched(factor).value_at(sign * end)
            for factor, sign in ((_SCALE_FACTORS[0], 1), (_SCALE_FACTORS[-1], -1))
        )
        drawn = theta[:, model.outer_names.index(name)]
        among_draws = np.quantile(drawn, np.linspace(0, 1, _N_NODE))
        nodes = np.unique(np.concatenate([np.geomspace(low, high, _N_NODE), among_draws]))
        return nodes, LatentIntegral(model).log_likelihoods(theta, scores, nodes)

    @cached_property
    def _default_likelihood(self) -> FloatArray:
        return self._likelihood(self.pair)

    def _likelihood(self, pair: Pair) -> FloatArray:
        """Return log densities under a pair with changed priors, at about 256 draws.

        Log K and smooth offsets are integrated out, so that their priors enter the likelihood. The
        random points are the same for all changes.
        """
        u = self.u[:: max(len(self.u) // _N_LIKELIHOOD_DRAW, 1)]
        rng = stream(self.pair.own_seed, "changed likelihood")
        integral = LatentIntegral(pair.model())
        return integral.estimated(u, rng, QUICK.effort.n_point).log_density


def _changes(pair: Pair) -> list[_Change]:
    """Return the changes of a pair's priors to be evaluated."""
    model = pair.model()
    priors = [*_scaled_priors(model)] + [NUGGET] * (SMOOTH in pair.noise.factors)
    return [(prior, factor) for prior in priors for factor in scale_factors(prior)]


def _scaled_priors(model: Model) -> dict[str, list[str]]:
    """Return the parameters of each prior that has a scale."""
    parameters: dict[str, list[str]] = {}
    for name in model.parameter_names:
        parameters.setdefault(prior_of(name), []).append(name)
    return {
        prior: names
        for prior, names in parameters.items()
        if all(model.priors[name].scale_name for name in names)
    }


def _changed(pair: Pair, change: _Change) -> Pair:
    """Return a pair with a changed prior, and with the effort of the quick preset."""
    prior, factor = change
    pair = replace(pair, effort=QUICK.effort)
    if prior == NUGGET:
        return replace(pair, noise=replace(pair.noise, nugget=factor * pair.noise.nugget))
    model = pair.model()
    scaled = {name: model.priors[name].stretched(factor) for name in _scaled_priors(model)[prior]}
    return replace(pair, priors={**model.given_priors, **scaled})
