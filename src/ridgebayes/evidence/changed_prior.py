"""The change of an evidence where a prior has another scale, or a smooth offset another nugget."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from ridgebayes._types import FloatArray
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.evidence import power_law_evidence, quadrature_evidence
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.moves import Weighted, adapted
from ridgebayes.inference.pareto_smoothing import pareto_k
from ridgebayes.inference.posterior import Posterior
from ridgebayes.inference.power_law_exact import is_conjugate
from ridgebayes.model.model import Model
from ridgebayes.model.noise import SMOOTH
from ridgebayes.runtime.randomness import stream

NUGGET = "nugget"
COEFFICIENTS = ("c", "c2")  # priors that hold what is known of mechanics: shrunk less
_FACTORS = (0.1, 0.3, 1.0, 3.0, 10.0)
_OF_NUGGET = (0.1, 1.0, 10.0)
_LEAST = 0.3  # factor of the coefficients' scales
_N_LIKELIHOOD = 512  # draws that are weighted by a ratio of likelihoods
_REACHED = 0.1  # share of a posterior's draws that count: of fewer a new mode is searched for
_N_DRAW, _N_POINT, _ENOUGH = 256, 8, 0.5  # of importance sampling anew; half of a rough one
_N_ROUND = 12  # of that, at most


def prior_of(parameter: str) -> str:
    """Return the name under which a parameter's prior is scaled: c and c1 alike, all K together."""
    return {"c1": "c"}.get(parameter, parameter.partition("[")[0])


def scale_factors(prior: str) -> tuple[float, ...]:
    """Return the multiples of a prior's scale that are looked at."""
    if prior == NUGGET:
        return _OF_NUGGET
    return tuple(f for f in _FACTORS if prior not in COEFFICIENTS or f >= _LEAST)


@dataclass(frozen=True, eq=False)
class Scaling:
    """A posterior whose priors are scaled; holds all that a process of its own needs."""

    form: str
    noise: str
    posterior: Posterior

    @property
    def key(self) -> tuple[str, str]:
        return self.form, self.noise

    @property
    def name(self) -> str:
        return f"prior sensitivity of {self.form}, {self.noise}"

    @property
    def n_parameter(self) -> int:
        return self.posterior.model.n_parameter

    @property
    def priors(self) -> dict[str, list[str]]:
        """Names of the parameters of each prior that has a scale."""
        owned: dict[str, list[str]] = {}
        for name in self.posterior.model.parameter_names:
            owned.setdefault(prior_of(name), []).append(name)
        of = self.posterior.model.priors
        return {prior: own for prior, own in owned.items() if all(of[n].scale_name for n in own)}

    def model(self, prior: str, factor: float) -> Model:
        """Return the posterior's model under another scale."""
        model = self.posterior.model
        if prior == NUGGET:
            noise = replace(model.noise, nugget=factor * model.noise.nugget)
            return Model(model.data, model.form, noise, model.priors)
        names = self.priors[prior]
        return model.with_priors({name: model.priors[name].stretched(factor) for name in names})


@dataclass(frozen=True, eq=False)
class Changed:
    """A change that a posterior's own draws do not tell.

    With the ln evidence without it, and the standard error that its form's evidence bears.
    """

    scaling: Scaling
    prior: str
    factor: float
    log_evidence: float
    se: float

    @property
    def name(self) -> str:
        return f"{self.scaling.name}, {self.prior} times {self.factor:g}"

    @property
    def n_parameter(self) -> int:
        return self.scaling.n_parameter


class Change(NamedTuple):
    """A change of ln evidence by weighted draws, and how far these tell it.

    With the Pareto shape of the weights, the standard error that their spread promises, and the
    share of the draws that count.
    """

    value: float
    k: float
    se: float
    share: float


def weighted_draws(task: Scaling) -> dict[tuple[str, float], Change]:
    """Return changes of ln evidence by prior and factor, as a posterior's draws tell them."""
    posterior, found = task.posterior, {}
    for prior in task.priors:
        for factor in scale_factors(prior):
            ratio = _log_ratio(task.model(prior, factor), posterior.model, posterior.draws)
            found[prior, factor] = _change(ratio)
    if SMOOTH in posterior.noise.factors:
        every = slice(None, None, max(len(posterior.coordinates) // _N_LIKELIHOOD, 1))
        u, before = posterior.coordinates[every], posterior.kept_chains.log_density.ravel()[every]
        for factor in scale_factors(NUGGET):
            after = before if factor == 1 else task.model(NUGGET, factor).log_density(u)
            found[NUGGET, factor] = _change(after - before)
    return found


def found_anew(task: Changed) -> float:
    """Return a change by an integral, or by importance sampling from where draws lead."""
    posterior, other = task.scaling.posterior, task.scaling.model(task.prior, task.factor)
    if other.is_iid_gaussian:
        change = _integrated(other) - _integrated(posterior.model)
        if math.isfinite(change):
            return change
    try:
        return _sampled(task, other) - task.log_evidence
    except (ComputationError, InputError):  # no mode, or no draw of positive density
        return math.nan


def _sampled(task: Changed, other: Model) -> float:
    """Return ln evidence by importance sampling, from the draws that count or from the new mode."""
    posterior, model = task.scaling.posterior, task.scaling.posterior.model
    rng = stream(posterior.seed, task.name)
    ratio = _log_ratio(other, model, posterior.draws)
    laplace, draws = posterior.laplace, None
    reached = Weighted(posterior.draws, ratio, ratio)
    is_near, u = reached.effective > _REACHED, posterior.coordinates[:, : model.n_parameter]
    if is_near:  # in coordinates of the posterior as it was
        draws = replace(reached, z=laplace.whiten(u)[0])
    else:
        # The nearer draws come, the shorter is the search.
        lead = reached.relative @ u / len(u) if np.isfinite(ratio).any() else laplace.mode
        laplace = fit_laplace(other, near=model.to_theta(lead))

    def log_density(u: FloatArray) -> FloatArray:
        if task.prior == NUGGET or not is_near:
            return other.estimated(u, rng, _N_POINT).log_density
        ratio = _log_ratio(other, model, model.to_theta(u))
        return ratio + model.estimated(u, rng, _N_POINT).log_density

    in_z, k = laplace.whitened(log_density), laplace.n_curved
    n = _N_DRAW if task.se < 1 else _N_DRAW // 2
    rounds: list[tuple[float, float]] = []
    for _ in range(_N_ROUND):
        _, draws = adapted(
            in_z, k, model.n_parameter - k, rng, n_round=1, n=n, start=draws, enough=_ENOUGH
        )
        rounds.append((draws.log_mean, (1 / draws.effective - 1) / n))
        log_evidence, variance = _of_rounds(rounds)
        if variance < task.se**2:
            break
    return log_evidence


def _of_rounds(rounds: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the log of the mean evidence of the last rounds, and its relative variance.

    Each round's mean of weights is unbiased. So many are taken as leave the least variance.
    """
    values, variances = np.array(rounds)[::-1].T
    n = np.arange(1, len(values) + 1)
    of_last = np.cumsum(variances) / n**2
    most = int(np.argmin(of_last)) + 1
    return float(logsumexp(values[:most])) - math.log(most), float(of_last[most - 1])


def _change(log_weight: FloatArray) -> Change:
    if not log_weight.any():
        return Change(0.0, -math.inf, 0.0, 1.0)
    n = len(log_weight)
    value = float(logsumexp(log_weight)) - math.log(n)
    variance = float(np.exp(log_weight - value).var())  # of relative weights, whose mean is 1
    return Change(value, pareto_k(log_weight), math.sqrt(variance / n), 1 / (1 + variance))


def _log_ratio(other: Model, model: Model, theta: FloatArray) -> FloatArray:
    """Return the log ratio of priors; where the old one is zero no draw counts."""
    own, changed = model.log_prior(theta), other.log_prior(theta)
    return np.where(np.isfinite(own), changed - np.where(np.isfinite(own), own, 0.0), -np.inf)


def _integrated(model: Model) -> float:
    if is_conjugate(model):
        return power_law_evidence(model).value
    try:
        laplace = fit_laplace(model)
    except ComputationError:
        return math.nan
    return quadrature_evidence(model.log_density, laplace, tol=1e-3, points_max=1_000_000).value
