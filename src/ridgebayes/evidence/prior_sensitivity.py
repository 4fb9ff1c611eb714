"""How far evidences depend on the priors' scales, and on the nugget of a smooth offset.

Draws of every pair are weighed by new over old prior. Pairs whose weights do not serve are weighed
again under the new prior.
"""

import math
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes._types import FloatArray
from ridgebayes.evidence.pairs import Pair, WeighedPairs, in_parallel, weigh
from ridgebayes.evidence.tables import used_evidence
from ridgebayes.inference.importance import Drawn, log_mean
from ridgebayes.inference.pareto_smoothing import pareto_k
from ridgebayes.inference.presets import QUICK
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
# In ln evidence below a form's best pair under a change: 5 % of the evidence, the largest standard
# error that is accepted, decides nothing. Weights that miss a new mode are mostly too low by less
# than 3.
_MIN_GAP, _MISSED = 3.0, 3.0
_LATENT_DRAWS = 256  # whose likelihoods are computed again

_Key = tuple[str, str]
_Change = tuple[str, float]


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
        form, log_evidence. One prior is changed at a time, in all pairs that have it. A pair is
        weighed again where the Pareto k of its weights is above 0.5 and it may hold more than e^-3
        of its form's evidence.
    """
    used = used_evidence(weighed.evidence).set_index(["form", "noise"])["log_evidence"]
    tasks = []
    for key in used.index:
        drawn = weighed.weighed[key].drawn
        if drawn is not None:
            tasks.append(_Scaled(weighed.pairs[key], drawn))
    keys = [task.pair.key for task in tasks]
    looks = dict(zip(keys, in_parallel(_reweighted, tasks, executor), strict=True))
    values = {
        (key, change): float(used[key]) + difference
        for key, look in looks.items()
        for change, (difference, _) in look.items()
    }
    again = _open_changes(used, looks, values)
    changed_pairs = [_changed(weighed.pairs[key], change) for key, change in again]
    for place, one in zip(again, in_parallel(weigh, changed_pairs, executor), strict=True):
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


def _open_changes(
    used: pd.Series,
    looks: Mapping[_Key, Mapping[_Change, tuple[float, float]]],
    values: Mapping[tuple[_Key, _Change], float],
) -> list[tuple[_Key, _Change]]:
    """Return the pairs and changes that weights cannot answer, and that may matter."""
    found = []
    for change in dict.fromkeys(change for look in looks.values() for change in look):
        best: dict[str, float] = {}
        for key in looks:
            value = values.get((key, change), float(used[key]))
            best[key[0]] = max(best.get(key[0], -math.inf), value)
        for key in looks:
            # Weights that do not reach a new mode are too low: the old evidence may still hold.
            if _is_open(looks, key, change):
                most = max(values[key, change] + _MISSED, float(used[key]))
                if most > best[key[0]] - _MIN_GAP:
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
            found[prior, factor] = _told(_log_ratio(model, theta, names, factor))
    for prior in latent:
        found |= _by_likelihoods(pair, u, prior)
    return found


def _by_likelihoods(pair: Pair, u: FloatArray, prior: str) -> dict[_Change, tuple[float, float]]:
    """Return changes by a prior of what is integrated out, whose likelihoods are computed again."""
    some = u[:: max(len(u) // _LATENT_DRAWS, 1)]
    densities = {}
    for factor in scale_factors(prior):
        changed = _changed(pair, (prior, factor))
        rng = stream(pair.own_seed, "changed likelihood")  # the same points for every factor
        integral = changed.target().integral
        densities[factor] = integral.estimated(some, rng, QUICK.effort.n_point).log_density
    return {(prior, factor): _told(value - densities[1.0]) for factor, value in densities.items()}


def _log_ratio(model: Model, theta: FloatArray, names: list[str], factor: float) -> FloatArray:
    """Return log of new over old prior density of draws (n, n_outer), shape (n,)."""
    ratio = np.zeros(len(theta))
    for name in names if factor != 1 else ():
        x, old = theta[:, model.outer_names.index(name)], model.priors[name]
        with np.errstate(invalid="ignore"):  # draws beyond both priors
            ratio += old.stretched(factor).log_pdf(x) - old.log_pdf(x)
    return np.where(np.isnan(ratio), -np.inf, ratio)


def _told(ratio: FloatArray) -> tuple[float, float]:
    if not ratio.any():
        return 0.0, -math.inf
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


def _changed(pair: Pair, change: _Change) -> Pair:
    """Return a pair under another prior, to be weighed with little effort."""
    prior, factor = change
    pair = replace(pair, effort=QUICK.effort)
    if prior == NUGGET:
        return replace(pair, noise=replace(pair.noise, nugget=factor * pair.noise.nugget))
    model = Model(pair.data, pair.form, pair.noise, pair.priors)
    scaled = {name: model.priors[name].stretched(factor) for name in _scaled_priors(model)[prior]}
    return replace(pair, priors={**model.given_priors, **scaled})
