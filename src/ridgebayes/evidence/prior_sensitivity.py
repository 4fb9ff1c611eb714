"""How far evidences depend on the priors' scales, and on the nugget of a smooth offset.

Draws of every pair are weighed by new over old prior. Where too few of them count, the pair is
weighed anew under the new prior, with the old proposal to begin with.
"""

import math
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes._types import FloatArray
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.evidence.pairs import MAX_GAP, Pair, WeighedPairs, in_parallel, weigh
from ridgebayes.evidence.tables import used_evidence
from ridgebayes.inference.importance import Drawn, Effort, log_mean
from ridgebayes.inference.pareto_smoothing import pareto_k
from ridgebayes.inference.presets import QUICK
from ridgebayes.inference.proposal import Mixture
from ridgebayes.model.default_priors import SLOPES
from ridgebayes.model.model import Model
from ridgebayes.model.noise import SMOOTH
from ridgebayes.runtime.randomness import stream

SENSITIVITY_COLUMNS = ["prior", "factor", "form", "log_evidence"]
NUGGET = "nugget"
COEFFICIENTS = ("c", "c2")  # whose priors hold what is known of mechanics: shrunk less
_FACTORS = (0.1, 0.3, 1.0, 3.0, 10.0)
_NUGGET_FACTORS = (0.1, 1.0, 10.0)
_LEAST_COEFFICIENT = 0.3  # factor of the coefficients' scales
# Pareto k of weights up to which their mean is taken: their variance is finite below 0.5.
MAX_REWEIGHTED_K = 0.5
# In ln evidence below a form's best pair under a change: e^-5 of the form's evidence decides
# nothing. Weights that miss a new mode are too low by less than this, mostly.
_MIN_GAP, _MISSED = 5.0, 3.0
_EFFORT = Effort(n_round=2, n_per_round=256, n_draw=96, n_point=8)
_LATENT_DRAWS = 256  # whose likelihoods are computed again


def prior_of(parameter: str) -> str:
    """Return the name under which a parameter's prior is scaled: c and c1 alike, all K together."""
    return {"c1": "c"}.get(parameter, parameter.partition("[")[0])


def scale_factors(prior: str) -> tuple[float, ...]:
    """Return the multiples of a prior's scale that are looked at."""
    if prior == NUGGET:
        return _NUGGET_FACTORS
    return tuple(f for f in _FACTORS if prior not in COEFFICIENTS or f >= _LEAST_COEFFICIENT)


@dataclass(frozen=True, eq=False)
class _Scaled:
    """A pair whose priors are scaled."""

    pair: Pair
    drawn: Drawn

    @property
    def name(self) -> str:
        return f"prior sensitivity of {self.pair.form.name}, {self.pair.noise.name}"

    @property
    def cost(self) -> float:
        return self.pair.cost


def prior_sensitivity(weighed: WeighedPairs, *, executor: Executor | None = None) -> pd.DataFrame:
    """Return log evidences as each prior's scale is multiplied, error models summed out.

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
        form, log_evidence. One prior is changed at a time, in all pairs that have it. Pairs are
        weighed anew where the Pareto k of the weights is above 0.5 and the pair may hold more than
        e^-5 of its form's evidence, unless it is more than 12 below the best under that change.
    """
    used = used_evidence(weighed.evidence).set_index(["form", "noise"])["log_evidence"]
    tasks = []
    for key in used.index:
        drawn = weighed.weighed[key].drawn
        if drawn is not None:
            tasks.append(_Scaled(weighed.pairs[key], drawn))
    looks = dict(
        zip(
            (task.pair.key for task in tasks),
            in_parallel(_reweighted, tasks, executor),
            strict=True,
        )
    )
    values = {
        (key, change): float(used[key]) + difference
        for key, look in looks.items()
        for change, (difference, _) in look.items()
    }
    again = _open_pairs(used, looks, values)
    pairs = []
    for key, change in again:
        drawn = weighed.weighed[key].drawn
        assert drawn is not None  # it was weighed by its draws
        pairs.append(_changed(weighed.pairs[key], drawn.proposal, change))
    found = in_parallel(weigh, pairs, executor)
    # Where the old proposal leads nowhere, modes are searched for.
    lost = [i for i, one in enumerate(found) if not one.evidence.ok]
    searched = [replace(pairs[i], start=None, effort=QUICK.effort) for i in lost]
    for i, one in zip(lost, in_parallel(weigh, searched, executor), strict=True):
        found[i] = one
    for place, one in zip(again, found, strict=True):
        if math.isfinite(one.evidence.value):
            values[place] = one.evidence.value
    changes = dict.fromkeys(change for look in looks.values() for change in look)
    log_n = math.log(used.index.get_level_values("noise").nunique())
    rows = []
    for prior, factor in changes:
        for form in used.index.get_level_values("form").unique():
            own = [(form, noise) for noise in used.loc[form].index]
            summed = [values.get((key, (prior, factor)), float(used[key])) for key in own]
            rows.append((prior, factor, form, float(logsumexp(summed)) - log_n))
    return pd.DataFrame(rows, columns=SENSITIVITY_COLUMNS)


_Key = tuple[str, str]
_Change = tuple[str, float]


def _open_pairs(
    used: pd.Series,
    looks: Mapping[_Key, Mapping[_Change, tuple[float, float]]],
    values: Mapping[tuple[_Key, _Change], float],
) -> list[tuple[_Key, _Change]]:
    """Return the pairs and changes that weights cannot tell, and that may matter."""
    found = []
    for change in dict.fromkeys(change for look in looks.values() for change in look):
        least = {key: values.get((key, change), float(used[key])) for key in looks}
        best = max(least.values())
        # Weights that do not reach a new mode are too low: the old evidence may still hold.
        most = {
            key: max(value + _MISSED, float(used[key])) if _is_open(looks, key, change) else value
            for key, value in least.items()
        }
        for key in looks:
            best_of_form = max(value for (form, _), value in least.items() if form == key[0])
            matters = most[key] > max(best_of_form - _MIN_GAP, best - MAX_GAP)
            if _is_open(looks, key, change) and matters:
                found.append((key, change))
    return found


def _is_open(
    looks: Mapping[_Key, Mapping[_Change, tuple[float, float]]], key: _Key, change: _Change
) -> bool:
    """Return whether a pair's weights cannot tell a change."""
    return change in looks[key] and looks[key][change][1] > MAX_REWEIGHTED_K


def _reweighted(task: _Scaled) -> dict[_Change, tuple[float, float]]:
    """Return changes of ln evidence by prior and factor, each with the Pareto k of its weights."""
    pair, drawn = task.pair, task.drawn
    model = Model(pair.data, pair.form, pair.noise, pair.priors)
    u = drawn.u.reshape(-1, drawn.u.shape[-1])
    theta = model.outer_theta(u)
    found: dict[_Change, tuple[float, float]] = {}
    priors = _scaled_priors(model)
    # Log K and smooth offsets are integrated out: there are no draws of them to be weighed.
    latent = [SLOPES] * (priors.pop(SLOPES, None) is not None)
    latent += [NUGGET] * (SMOOTH in pair.noise.factors)
    for prior, names in priors.items():
        for factor in scale_factors(prior):
            if factor == 1:
                found[prior, factor] = 0.0, -math.inf
                continue
            ratio = np.zeros(len(u))
            for name in names:
                place, old = model.outer_names.index(name), model.priors[name]
                x = theta[:, place]
                ratio += old.stretched(factor).log_pdf(x) - old.log_pdf(x)
            found[prior, factor] = _told(ratio)
    for prior in latent:
        found |= _by_likelihoods(pair, u, prior)
    return found


def _by_likelihoods(pair: Pair, u: FloatArray, prior: str) -> dict[_Change, tuple[float, float]]:
    """Return changes by a prior of what is integrated out, whose likelihoods are computed again."""
    some = u[:: max(len(u) // _LATENT_DRAWS, 1)]
    densities = {}
    for factor in scale_factors(prior):
        changed = _changed(pair, None, (prior, factor))
        rng = stream(pair.own_seed, "changed likelihood")  # the same points for every factor
        integral = changed.target().integral
        densities[factor] = integral.estimated(some, rng, _EFFORT.n_point).log_density
    return {(prior, factor): _told(value - densities[1.0]) for factor, value in densities.items()}


def _told(ratio: FloatArray) -> tuple[float, float]:
    if not ratio.any():
        return 0.0, -math.inf
    ratio = np.where(np.isnan(ratio), -np.inf, ratio)
    return log_mean(ratio), pareto_k(ratio)


def _scaled_priors(model: Model) -> dict[str, list[str]]:
    """Return the parameters of each prior that has a scale."""
    owned: dict[str, list[str]] = {}
    for name in model.parameter_names:
        owned.setdefault(prior_of(name), []).append(name)
    return {
        prior: names
        for prior, names in owned.items()
        if all(model.priors[name].scale_name for name in names)
    }


def _changed(pair: Pair, start: Mixture | None, change: _Change) -> Pair:
    """Return a pair under another prior, to be weighed with an old proposal to begin with."""
    prior, factor = change
    pair = replace(pair, effort=_EFFORT, start=start)
    if prior == NUGGET:
        return replace(pair, noise=replace(pair.noise, nugget=factor * pair.noise.nugget))
    model = Model(pair.data, pair.form, pair.noise, pair.priors)
    scaled = {name: model.priors[name].stretched(factor) for name in _scaled_priors(model)[prior]}
    for name, new in scaled.items():
        if start is not None and name in model.outer_names[model.n_outer_coefficient :]:
            place = model.outer_names.index(name)
            start = _moved(start, place, model.priors[name], new)
    return replace(pair, priors={**model.given_priors, **scaled}, start=start)


def _moved(mixture: Mixture, place: int, old: Distribution, new: Distribution) -> Mixture:
    """Return a proposal in the scores of a parameter's new prior.

    Coefficients need no such change: charts measure them in their own posterior units.
    """
    centres, factors = mixture.centres.copy(), mixture.factors.copy()
    at = centres[:, place]
    low, middle, high = (new.score(old.value_at(at + step)) for step in (-0.1, 0.0, 0.1))
    centres[:, place] = middle
    factors[:, place] *= ((high - low) / 0.2)[:, None]
    shapes = factors @ np.swapaxes(factors, 1, 2)
    return replace(mixture, centres=centres, factors=np.asarray(np.linalg.cholesky(shapes), float))
