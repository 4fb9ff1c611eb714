"""Sensitivity of evidences to the scales of priors, and to the nugget of a smooth offset.

The draws of every pair are reweighted by the ratio of new to old prior. Pairs with unreliable
weights are sampled again under the new prior, the widest and the narrowest prior first, because
these draws can often be reweighted for the priors in between.
"""

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes._types import FloatArray
from ridgebayes.evidence.pairs import Pair, WeighedPairs, in_parallel, weigh
from ridgebayes.evidence.tables import used_evidence
from ridgebayes.inference.importance import Drawn
from ridgebayes.inference.pareto_smoothing import MAX_FINITE_VARIANCE_K, pareto_k
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
# too low, mostly by less than 3 in ln evidence.
_MAX_LN_EVIDENCE_GAP, _MAX_LN_MISSED = 3.0, 3.0
_N_LIKELIHOOD_DRAW = 256  # draws at which the likelihood is computed under changed priors

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
    """A pair, changes of its priors, and draws under its default priors."""

    pair: Pair
    changes: Sequence[_Change]
    drawn: Drawn | None

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
        sampled again if the Pareto k of its weights is above 0.5 and its ln evidence may be less
        than 3 below that of the form's best pair.
    """
    used = used_evidence(weighed.evidence)
    keys = zip(used["form"], used["noise"], strict=True)
    evidence: dict[_Key, float] = dict(zip(keys, used["log_evidence"], strict=True))
    pairs = {key: weighed.pairs[key] for key in evidence}
    tasks = [_Task(pair, _changes(pair), weighed.weighed[key].drawn) for key, pair in pairs.items()]
    values: dict[_PairChange, float] = {}
    pareto_ks: dict[_PairChange, float] = {}
    for task, result in zip(tasks, in_parallel(_reweighted, tasks, executor), strict=True):
        key = task.pair.key
        for change, (difference, k) in result.items():
            values[key, change], pareto_ks[key, change] = evidence[key] + difference, k
    sides: dict[tuple[_Key, str, bool], list[_Change]] = {}
    for key, change in _unreliable_changes(evidence, values, pareto_ks):
        sides.setdefault((key, change[0], change[1] > 1), []).append(change)
    again = [_Task(pairs[key], changes, None) for (key, *_), changes in sides.items()]
    for task, redrawn in zip(again, in_parallel(_redrawn, again, executor), strict=True):
        values |= {(task.pair.key, change): value for change, value in redrawn.items()}
    return _table(evidence, values)


def _table(evidence: Mapping[_Key, float], values: Mapping[_PairChange, float]) -> pd.DataFrame:
    """Return log evidences of forms, averaged over error models with equal prior odds."""
    log_n = math.log(len({noise for _, noise in evidence}))
    rows = []
    for change in dict.fromkeys(change for _, change in values):
        for form in dict.fromkeys(form for form, _ in evidence):
            summed = [
                values.get((key, change), evidence[key]) for key in evidence if key[0] == form
            ]
            rows.append((*change, form, float(logsumexp(summed)) - log_n))
    return pd.DataFrame(rows, columns=SENSITIVITY_COLUMNS)


def _unreliable_changes(
    evidence: Mapping[_Key, float],
    values: Mapping[_PairChange, float],
    pareto_ks: Mapping[_PairChange, float],
) -> list[_PairChange]:
    """Return pairs and changes with unreliable weights whose evidences may matter."""
    unreliable = []
    for change in dict.fromkeys(change for _, change in values):
        best: dict[str, float] = {}
        for key in evidence:
            value = values.get((key, change), evidence[key])
            best[key[0]] = max(best.get(key[0], -math.inf), value)
        for key in evidence:
            # `most` is an upper estimate: weights that miss a mode are too low, and the prior may
            # have no effect on this pair.
            if pareto_ks.get((key, change), -math.inf) > MAX_FINITE_VARIANCE_K:
                most = max(values[key, change] + _MAX_LN_MISSED, evidence[key])
                if most > best[key[0]] - _MAX_LN_EVIDENCE_GAP:
                    unreliable.append((key, change))
    return unreliable


def _redrawn(task: _Task) -> dict[_Change, float]:
    """Return log evidences under changed priors; changes whose sampling fails are omitted.

    The furthest prior is sampled first; its draws can often be reweighted for the priors between it
    and the default.
    """
    values: dict[_Change, float] = {}
    furthest: tuple[Pair, Drawn, float] | None = None
    for prior, factor in sorted(task.changes, key=lambda change: -abs(math.log(change[1]))):
        if furthest is not None:
            pair, drawn, outer_factor = furthest
            relative = (prior, factor / outer_factor)
            difference, k = _reweighted(_Task(pair, [relative], drawn))[relative]
            if k <= MAX_FINITE_VARIANCE_K:
                values[prior, factor] = drawn.evidence.value + difference
                continue
        pair = _changed(task.pair, (prior, factor))
        result = weigh(pair)
        if math.isfinite(result.evidence.value):
            values[prior, factor] = result.evidence.value
        if furthest is None and result.drawn is not None and result.evidence.ok:
            furthest = pair, result.drawn, factor
    return values


def _reweighted(task: _Task) -> dict[_Change, tuple[float, float]]:
    """Return changes of ln evidence by reweighting, each with the Pareto k of its weights."""
    pair, drawn = task.pair, task.drawn
    if drawn is None:
        return {}
    model = Model(pair.data, pair.form, pair.noise, pair.priors)
    u = drawn.u.reshape(-1, drawn.u.shape[-1])
    theta, names = model.outer_theta(u), _scaled_priors(model)
    # Log K and smooth offsets are integrated out, so that their priors enter the likelihood, which
    # is computed again at some draws.
    thinned = u[:: max(len(u) // _N_LIKELIHOOD_DRAW, 1)]
    likelihood: FloatArray | None = None
    results: dict[_Change, tuple[float, float]] = {}
    for prior, factor in task.changes:
        if factor == 1:
            results[prior, factor] = 0.0, -math.inf
            continue
        if prior in (SLOPES, NUGGET):
            if likelihood is None:
                likelihood = _likelihood(pair, pair, thinned)
            ratio = _likelihood(_changed(pair, (prior, factor)), pair, thinned) - likelihood
        else:
            ratio = _log_ratio(model, theta, names[prior], factor)
        results[prior, factor] = (
            (float(log_mean(ratio)), pareto_k(ratio)) if ratio.any() else (0.0, -math.inf)
        )
    return results


def _likelihood(changed: Pair, pair: Pair, u: FloatArray) -> FloatArray:
    """Return log densities of draws (n, n_outer) under a changed pair.

    The random points are the same for all changes of a pair.
    """
    rng = stream(pair.own_seed, "changed likelihood")
    return changed.target().integral.estimated(u, rng, QUICK.effort.n_point).log_density


def _log_ratio(model: Model, theta: FloatArray, names: list[str], factor: float) -> FloatArray:
    """Return the log ratio of new to old prior density at draws (n, n_outer), shape (n,)."""
    ratio = np.zeros(len(theta))
    for name in names:
        x, old = theta[:, model.outer_names.index(name)], model.priors[name]
        with np.errstate(invalid="ignore"):  # inf - inf for draws outside both priors' supports
            ratio += old.stretched(factor).log_pdf(x) - old.log_pdf(x)
    return np.where(np.isnan(ratio), -np.inf, ratio)


def _changes(pair: Pair) -> list[_Change]:
    """Return the changes of a pair's priors to be evaluated."""
    model = Model(pair.data, pair.form, pair.noise, pair.priors)
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
    model = Model(pair.data, pair.form, pair.noise, pair.priors)
    scaled = {name: model.priors[name].stretched(factor) for name in _scaled_priors(model)[prior]}
    return replace(pair, priors={**model.given_priors, **scaled})
