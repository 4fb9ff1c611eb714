"""How far evidences depend on the priors' scales, and on the nugget of a smooth offset."""

import math
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes._types import FloatArray
from ridgebayes.errors import ComputationError
from ridgebayes.evidence import power_law_evidence, quadrature_evidence
from ridgebayes.evidence.tables import used_evidence
from ridgebayes.inference.chains import N_KEPT
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.pareto_smoothing import K_MAX, pareto_k
from ridgebayes.inference.posterior import Posterior
from ridgebayes.inference.power_law_exact import is_conjugate
from ridgebayes.model.model import Model
from ridgebayes.model.noise import SMOOTH, Noise
from ridgebayes.runtime.pool import map_ordered

SENSITIVITY_COLUMNS = ["prior", "factor", "form", "log_evidence"]
NUGGET = "nugget"
COEFFICIENTS = ("c", "c2")  # priors that hold what is known of mechanics: shrunk less
_FACTORS = (0.1, 0.18, 0.3, 0.55, 1.0, 1.8, 3.0, 5.5, 10.0)
_FEW_FACTORS = _FACTORS[::2]
_OF_NUGGET = (0.1, 1.0, 10.0)
_LEAST = 0.3  # factor of the coefficients' scales
_N_LIKELIHOOD = 512  # draws that are weighted by a ratio of likelihoods


def prior_of(parameter: str) -> str:
    """Return the name under which a parameter's prior is scaled: c and c1 alike, all K together."""
    return {"c1": "c"}.get(parameter, parameter.partition("[")[0])


def scale_factors(prior: str, *, few: bool = False) -> tuple[float, ...]:
    """Return the multiples of a prior's scale that are looked at."""
    if prior == NUGGET:
        return _OF_NUGGET
    return tuple(
        f for f in (_FEW_FACTORS if few else _FACTORS) if prior not in COEFFICIENTS or f >= _LEAST
    )


def prior_sensitivity(
    posteriors: Mapping[str, Mapping[str, Posterior]],
    evidence: pd.DataFrame,
    *,
    executor: Executor | None = None,
    few: bool = False,
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
    few : bool, optional
        Whether every other factor is left out; the least and the largest are not.

    Returns
    -------
    pandas.DataFrame
        Columns prior (c, which is also c1; c2, K, sigma, tau_..., length_..., df; nugget), factor,
        form, log_evidence. One prior is changed at a time: a posterior's draws are weighted by new
        over old prior (for the nugget: likelihood). Where too few of them count (Pareto k above
        0.7) independent normal rows are integrated anew, and others by Laplace's approximation of
        both. An error model without draws keeps its evidence; a Student tail without any changes
        as its normal twin does.
    """
    used = used_evidence(evidence).set_index(["form", "noise"])["log_evidence"]
    tasks = [
        _Scaling(form, noise, posterior.thinned(N_KEPT), few)  # what `draws` are of
        for form, by_noise in posteriors.items()
        for noise, posterior in by_noise.items()
        if (form, noise) in used.index
    ]
    # Posteriors of many parameters take longest: begun last they would keep one worker busy.
    longest = sorted(tasks, key=lambda task: task.posterior.model.n_parameter, reverse=True)
    changed = map_ordered(_scaled, longest, executor, name=lambda task: task.name)
    by_task = dict(zip(longest, changed, strict=True))
    found = {(task.form, task.noise): by_task[task] for task in tasks}
    priors = dict.fromkeys(prior for changes in found.values() for prior, _ in changes)
    rows = [
        (prior, factor, form, _summed(used, found, form, prior, factor))
        for prior in priors
        for form in posteriors
        if any(one == form for one, _ in found)
        for factor in scale_factors(prior, few=few)
    ]
    return pd.DataFrame(rows, columns=SENSITIVITY_COLUMNS)


def _summed(
    used: pd.Series,
    found: Mapping[tuple[str, str], Mapping[tuple[str, float], float]],
    form: str,
    prior: str,
    factor: float,
) -> float:
    values = [
        value + _changes(found, form, str(noise)).get((prior, factor), 0.0)
        for noise, value in used.loc[form].items()
    ]
    n_noise = used.index.get_level_values("noise").nunique()
    return float(logsumexp(values)) - math.log(n_noise)


def _changes(
    found: Mapping[tuple[str, str], Mapping[tuple[str, float], float]], form: str, noise: str
) -> Mapping[tuple[str, float], float]:
    twin = replace(Noise.named(noise), tail="normal").name
    return found.get((form, noise), found.get((form, twin), {}))


@dataclass(frozen=True, eq=False)
class _Scaling:
    """The changes of one posterior's evidence; holds all that a process of its own needs."""

    form: str
    noise: str
    posterior: Posterior
    few: bool

    @property
    def name(self) -> str:
        return f"prior sensitivity of {self.form}, {self.noise}"


def _scaled(task: _Scaling) -> dict[tuple[str, float], float]:
    """Return the change of ln evidence by prior and factor."""
    posterior, model = task.posterior, task.posterior.model
    owned: dict[str, list[str]] = {}
    for name in model.parameter_names:
        owned.setdefault(prior_of(name), []).append(name)
    found = {}
    for prior, names in owned.items():
        if not all(model.priors[name].scale_name for name in names):
            continue
        for factor in scale_factors(prior, few=task.few):
            stretched = {name: model.priors[name].stretched(factor) for name in names}
            other = model.with_priors(stretched)
            found[prior, factor] = 0.0 if factor == 1 else _change(posterior, other, names)
    if SMOOTH in model.noise.factors:
        for factor in scale_factors(NUGGET):
            noise = replace(model.noise, nugget=factor * model.noise.nugget)
            other = Model(model.data, model.form, noise, model.priors)
            found[NUGGET, factor] = 0.0 if factor == 1 else _change(posterior, other, ())
    return found


def _change(posterior: Posterior, other: Model, names: Iterable[str]) -> float:
    """Return ln evidence of another model less that of a posterior's own."""
    log_weight = _log_weights(posterior, other, list(names))
    if pareto_k(log_weight) <= K_MAX:
        return float(logsumexp(log_weight)) - math.log(len(log_weight))
    if other.is_iid_gaussian:
        change = _integrated(other) - _integrated(posterior.model)
        if math.isfinite(change):
            return change
    try:
        near = posterior.model.to_theta(posterior.laplace.mode)
        return fit_laplace(other, near=near).log_evidence - posterior.laplace.log_evidence
    except ComputationError:
        return math.nan


def _log_weights(posterior: Posterior, other: Model, names: list[str]) -> FloatArray:
    model = posterior.model
    if names:
        columns = [model.parameter_names.index(name) for name in names]
        pairs = [(other.priors[name], model.priors[name]) for name in names]
        values = [posterior.draws[:, column] for column in columns]
        changes = [
            new.log_pdf(x) - old.log_pdf(x) for x, (new, old) in zip(values, pairs, strict=True)
        ]
        value: FloatArray = np.sum(changes, axis=0)
        return value
    every = slice(None, None, max(len(posterior.coordinates) // _N_LIKELIHOOD, 1))
    before = posterior.kept_chains.log_density.ravel()[every]
    return other.log_density(posterior.coordinates[every]) - before


def _integrated(model: Model) -> float:
    if is_conjugate(model):
        return power_law_evidence(model).value
    try:
        laplace = fit_laplace(model)
    except ComputationError:
        return math.nan
    return quadrature_evidence(model.log_density, laplace, tol=1e-3, points_max=1_000_000).value
