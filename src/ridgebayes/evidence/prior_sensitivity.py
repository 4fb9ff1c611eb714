"""How far evidences depend on the priors' scales, and on the nugget of a smooth offset."""

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import TypeVar

import pandas as pd
from scipy.special import logsumexp

from ridgebayes.evidence.changed_prior import (
    Change,
    Changed,
    Scaling,
    found_anew,
    weighted_draws,
)
from ridgebayes.evidence.tables import used_evidence
from ridgebayes.inference.chains import N_KEPT
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.noise import Noise
from ridgebayes.runtime.pool import map_ordered

SENSITIVITY_COLUMNS = ["prior", "factor", "form", "log_evidence"]
BOUNDS = ["lower", "upper"]  # without error models that have no draws, and if nothing changed these
_SURE, _LEAST_SURE = 0.1, 0.4  # standard errors of ln evidence: of a form's, of a pair's at most
_ROUGH = 1.0  # of a form that is ruled out
_RULED_OUT = math.log(1e4)  # behind the best
# Pareto k above which weights have no mean; below it they are enough for a rough answer. Those of a
# wider half-normal have a k near 1, but draws that do not reach its tail do not show that, and ln
# evidences come out low by tenths. So unless k is small, this share of the draws has to count.
_K_MEAN, _K_LIGHT, _LEAST_SHARE = 1.0, 0.3, 0.5
_LOW = 1.0  # in ln evidence: by which draws that do not reach a prior may be low

_Task = TypeVar("_Task", Scaling, Changed)
_Found = TypeVar("_Found")


def prior_sensitivity(
    posteriors: Mapping[str, Mapping[str, Posterior]],
    evidence: pd.DataFrame,
    *,
    executor: Executor | None = None,
) -> pd.DataFrame:
    """Return log evidences as each prior's scale is multiplied, error models summed out.

    Parameters
    ----------
    posteriors : mapping of str to mapping of str to Posterior
        By names of form and error model.
    evidence : pandas.DataFrame
        `evidence.csv`, under the default priors.
    executor : concurrent.futures.Executor, optional
        Runs the posteriors; one after the other in this process if not given.

    Returns
    -------
    pandas.DataFrame
        Columns prior (c, which is also c1; c2, K, sigma, tau_..., length_..., df; nugget), factor,
        form, log_evidence, and bounds on it, lower and upper. One prior is changed at a time: a
        posterior's draws are weighted by new over old prior (for the nugget: likelihood). Where too
        few of them count (under half, unless weights have a light tail: Pareto k up to 0.3)
        independent normal rows are integrated anew, and others sampled by importance from where
        these draws lead. An error model without draws keeps its evidence; a Student tail without
        any changes as its normal twin does. The lower bound is without the former, in the upper one
        all without draws keep their evidence.
    """
    used = used_evidence(evidence).set_index(["form", "noise"])["log_evidence"]
    tasks = [
        Scaling(form, noise, posterior.thinned(N_KEPT))  # what `draws` are of
        for form, by_noise in posteriors.items()
        for noise, posterior in by_noise.items()
        if (form, noise) in used.index
    ]
    looks = _in_parallel(weighted_draws, tasks, executor)
    found = {
        task.key: {change: look.value for change, look in one.items()}
        for task, one in zip(tasks, looks, strict=True)
    }
    again = []
    for task, one in zip(tasks, looks, strict=True):
        for change, look in one.items():
            se = _sure_enough(used, found, task.key, change)
            if not _is_told(look, se):
                again.append(Changed(task, *change, float(used[task.key]), se))
    for changed, value in zip(again, _in_parallel(found_anew, again, executor), strict=True):
        found[changed.scaling.key][changed.prior, changed.factor] = value
    factors: dict[str, dict[float, None]] = {}
    for prior, factor in (change for one in looks for change in one):
        factors.setdefault(prior, {})[factor] = None
    rows = [
        (prior, factor, form, *_summed(used, found, form, (prior, factor)))
        for prior, looked_at in factors.items()
        for form in posteriors
        if any(one == form for one, _ in found)
        for factor in looked_at
    ]
    return pd.DataFrame(rows, columns=SENSITIVITY_COLUMNS + BOUNDS)


def _in_parallel(
    function: Callable[[_Task], _Found], tasks: Sequence[_Task], executor: Executor | None
) -> list[_Found]:
    # Posteriors of many parameters take longest: begun last they would keep one worker busy.
    longest = sorted(range(len(tasks)), key=lambda i: tasks[i].n_parameter, reverse=True)
    begun = [tasks[i] for i in longest]
    results = map_ordered(function, begun, executor, name=lambda task: task.name)
    by_place = dict(zip(longest, results, strict=True))
    return [by_place[i] for i in range(len(tasks))]


def _sure_enough(
    used: pd.Series,
    found: Mapping[tuple[str, str], Mapping[tuple[str, float], float]],
    key: tuple[str, str],
    change: tuple[str, float],
) -> float:
    """Return the standard error that a pair bears: the larger, the less of its form it is.

    The largest where the form is ruled out.
    """
    form, noise = key
    if used.loc[form].max() < used.max() - _RULED_OUT:
        return _ROUGH
    highest = max(
        value + _changes(found, form, str(other)).get(change, 0.0)
        for other, value in used.loc[form].items()
    )
    # Draws that do not reach a prior tell too little: no pair counts for less than this says.
    own = used[form, noise] + found[key][change] + _LOW
    share = math.exp(min(own - highest, 0.0))
    return _SURE / max(share, _SURE / _LEAST_SURE)


def _is_told(look: Change, se: float) -> bool:
    """Return whether weighted draws tell a change as surely as its form's evidence asks for."""
    if se == _ROUGH:
        return look.k <= _K_MEAN
    is_even = look.k <= _K_LIGHT or (look.k <= _K_MEAN and look.share >= _LEAST_SHARE)
    return is_even and look.se < se


def _summed(
    used: pd.Series,
    found: Mapping[tuple[str, str], Mapping[tuple[str, float], float]],
    form: str,
    change: tuple[str, float],
) -> tuple[float, float, float]:
    """Return a form's ln evidence under another prior, and its bounds."""
    told, lower, upper = [], [-math.inf], []
    for noise, value in used.loc[form].items():
        changes = _changes(found, form, str(noise))
        changed = value + changes.get(change, 0.0)
        told.append(changed)
        if changes:
            lower.append(changed)
        upper.append(changed if (form, noise) in found else max(changed, value))
    n_noise = used.index.get_level_values("noise").nunique()
    log_n = math.log(n_noise)
    return float(logsumexp(told)) - log_n, logsumexp(lower) - log_n, logsumexp(upper) - log_n


def _changes(
    found: Mapping[tuple[str, str], Mapping[tuple[str, float], float]], form: str, noise: str
) -> Mapping[tuple[str, float], float]:
    twin = replace(Noise.named(noise), tail="normal").name
    return found.get((form, noise), found.get((form, twin), {}))
