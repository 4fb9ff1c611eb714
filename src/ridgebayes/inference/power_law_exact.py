"""The power law's evidence and posterior: every K in closed form, sigma by quadrature.

Given sigma the log loads of a texture are normal about -2 log K, and log K has a normal prior: the
posterior of log K is normal and its evidence exact, texture by texture. Draws of it serve tables of
many textures, where a walk in as many dimensions gets slow.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from ridgebayes._types import BoolArray, FloatArray
from ridgebayes.distributions.distribution import LogNormal
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.inference.chains import Chains
from ridgebayes.inference.funnel_mode import no_mode
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.model.forms import PowerLaw
from ridgebayes.model.likelihood_independent import IndependentNormalRows
from ridgebayes.model.model import Model
from ridgebayes.model.rows import RowGroups
from ridgebayes.runtime.randomness import stream

_AT_ONCE = 2**20  # numbers at a time, of sigma x textures
_NEGLIGIBLE = 50.0  # in log density
_FAR = 37.0  # normal scores of sigma: beyond, no probability is left
_FINEST = 1e-5  # step of these scores
_N_SCORE = 1_000  # points of sigma's distribution that draws are made from, at least
_SHAPE = (4, 20, 128)  # ensembles, steps and walkers of the chains that the draws are laid out as


def is_conjugate(model: Model) -> bool:
    """Return whether every K has a closed-form posterior given sigma."""
    return (
        isinstance(model.form, PowerLaw)
        and model.is_iid_gaussian
        and all(isinstance(prior, LogNormal) for prior in list(model.priors.values())[:-1])
    )


def power_law_evidence(model: Model, *, tol: float = 1e-6) -> LogEvidence:
    """Return the power law's log evidence for any number of textures.

    Parameters
    ----------
    model : Model
        With form PowerLaw and log-normal priors of K.
    tol : float, optional
        The step in sigma's normal score is halved until the log evidence changes by less.

    Returns
    -------
    LogEvidence
        Method ``quadrature``: sigma is all that is left to integrate numerically. The status is not
        ok, and the value NaN, where the form reproduces all rows to rounding: sigma then has the
        density of their rounding errors, if any.

    Raises
    ------
    InputError
        If the form is not the power law, a prior of K is not log-normal, or rows do not have
        independent normal errors.
    """
    if not isinstance(model.form, PowerLaw):
        raise InputError(f"form: expected power-law, got {model.form.name!r}")
    for name, prior in list(model.priors.items())[:-1]:
        if not isinstance(prior, LogNormal):
            raise InputError(f"prior of {name!r}: expected log-normal, got {prior}")
    before = math.nan
    try:
        for grid in _refined(model):
            value = float(logsumexp(grid.log_density)) + math.log(grid.step)
            if abs(value - before) < tol:
                return LogEvidence("quadrature", value, max(abs(value - before), 1e-12))
            before = value
    except ComputationError:
        return LogEvidence("quadrature", math.nan, math.nan, "no misfit beyond rounding")
    return LogEvidence("quadrature", math.nan, math.nan, f"not settled to {tol:g}")


def rounding(model: Model) -> float:
    """Return the error scale below which misfit of the log loads is that of their last digits."""
    return float(4 * np.finfo(float).eps * max(1.0, np.abs(model.data.log_load).max()))


def log_evidence_given_sigma(model: Model, sigma: FloatArray) -> FloatArray:
    """Return the log evidence of the power law at known sigma, K integrated out.

    Parameters
    ----------
    model : Model
        With form PowerLaw.
    sigma : ndarray of float, shape (n,), dimensionless
        Error scale.

    Returns
    -------
    ndarray of float, shape (n,)
        Exact to rounding.
    """
    at_once = max(_AT_ONCE // len(_groups(model).n), 1)
    parts = [_evidence(model, sigma[i : i + at_once]) for i in range(0, len(sigma), at_once)]
    return np.concatenate(parts)


def conditional_log_k(model: Model, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and sd of each log K given sigma, both of shape (n, n_texture).

    With x = log K each row says 2 x = -z with the row's variance.
    """
    groups, median, log_sd = _groups(model), *_priors(model)
    weight = groups.n / (sigma[:, None] ** 2 + groups.rel_se**2)
    precision = 1 / log_sd**2 + 4 * _by_texture(groups, weight)
    linear = np.log(median) / log_sd**2 - 2 * _by_texture(groups, weight * groups.mean)
    return linear / precision, 1 / np.sqrt(precision)


def _priors(model: Model) -> tuple[FloatArray, FloatArray]:
    """Return the median and log-sd of each K."""
    priors = list(model.priors.values())[: model.n_coefficient]
    pairs = [(prior.median, prior.log_sd) for prior in priors if isinstance(prior, LogNormal)]
    assert len(pairs) == len(priors)
    median, log_sd = np.array(pairs).T
    return median, log_sd


def _groups(model: Model) -> RowGroups:
    if not isinstance(model.likelihood, IndependentNormalRows):
        raise InputError(
            "error model: expected iid and exact rows, which alone leave the power law a closed "
            f"form, got {model.noise.name!r}"
        )
    return model.likelihood.groups


def _by_texture(groups: RowGroups, values: FloatArray) -> FloatArray:
    """Return sums over the groups of each texture, (n, n_texture) from (n, n_group)."""
    # Groups are in the order of their textures, of which each has one at least.
    starts = np.flatnonzero(np.diff(groups.texture, prepend=-1))
    value: FloatArray = np.add.reduceat(values, starts, axis=1)
    return value


def _evidence(model: Model, sigma: FloatArray) -> FloatArray:
    """Evidence by Bayes' rule at the conditional means: likelihood x prior / posterior."""
    groups, median, log_sd = _groups(model), *_priors(model)
    mean, sd = conditional_log_k(model, sigma)
    variance = sigma[:, None] ** 2 + groups.rel_se**2
    squares = groups.sum_of_squares
    squares = squares + groups.n * (groups.mean + 2 * mean[:, groups.texture]) ** 2
    fit = -0.5 * (groups.n * np.log(2 * math.pi * variance) + squares / variance).sum(axis=1)
    off = (mean - np.log(median)) / log_sd
    value: FloatArray = fit + (np.log(sd / log_sd) - 0.5 * off**2).sum(axis=1)
    return value


def sample_power_law(model: Model, *, seed: int) -> Chains:
    """Draw independently from the power law's posterior.

    Parameters
    ----------
    model : Model
        With form PowerLaw and log-normal priors of K.
    seed : int
        Seed.

    Returns
    -------
    Chains
        Independent draws laid out as chains: acceptance 1, autocorrelation time 1.

    Raises
    ------
    ComputationError
        If the form reproduces all rows to rounding.

    Notes
    -----
    *Validity.* Rows with misfit beyond rounding, or with known errors.
    *Accuracy.* sigma by inversion of its distribution function on a grid of its normal score, 1,000
    points or more; log K exactly.
    *Cost.* O(draws x textures).
    """
    for grid in _refined(model):
        if grid.n_near >= _N_SCORE:
            break
    density = np.exp(grid.log_density - grid.log_density.max())
    cdf = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])

    u = np.empty((*_SHAPE, model.n_parameter))
    for ensemble in range(_SHAPE[0]):
        rng = stream(seed, f"ensemble {ensemble}")
        drawn = np.interp(rng.random(_SHAPE[1:]) * cdf[-1], cdf, grid.score)
        for step in range(_SHAPE[1]):  # a step at a time bounds the memory
            sigma = model.priors["sigma"].value_at(drawn[step])
            mean, sd = conditional_log_k(model, sigma)
            log_k = mean + sd * rng.standard_normal(mean.shape)
            theta = np.concatenate([np.exp(log_k), sigma[:, None]], axis=1)
            u[ensemble, step] = model.to_unconstrained(theta)
    log_density = np.stack([[model.log_density(step) for step in ensemble] for ensemble in u])
    tau = np.ones(model.n_parameter + 1)
    return Chains(u, log_density, np.ones(_SHAPE[0]), tau, ())


class _Grid(NamedTuple):
    """Evenly spaced normal scores of sigma, and the log density of these with the rows."""

    step: float
    score: FloatArray
    log_density: FloatArray
    n_near: int  # where the density is not negligible


def _refined(model: Model) -> Iterator[_Grid]:
    """Yield grids of ever smaller steps, the first over all scores; `no_mode` if rounding rules."""
    low, high, step = -_FAR, _FAR, 0.5
    while step > _FINEST:
        score = np.arange(low, high, step)
        sigma, values = _given_score(model, score)
        if sigma[np.argmax(values)] < rounding(model):
            raise no_mode(model)
        near = score[_may_matter(model, sigma, values)]
        yield _Grid(step, score, values, len(near))
        low, high, step = near[0] - step, near[-1] + 1.5 * step, step / 2


def _given_score(model: Model, score: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return sigma at its normal score, and the log density of the score with the rows."""
    with np.errstate(all="ignore"):  # far out sigma is 0 or infinite
        sigma = model.priors["sigma"].value_at(score)
        values = log_evidence_given_sigma(model, sigma) - 0.5 * (score**2 + math.log(2 * math.pi))
    return sigma, np.where(np.isfinite(values), values, -np.inf)


def _may_matter(model: Model, sigma: FloatArray, values: FloatArray) -> BoolArray:
    """Return where the density, or that up to the next point, may not be negligible."""
    with np.errstate(all="ignore"):
        apart = np.nan_to_num(np.abs(np.gradient(np.log(sigma))), posinf=0.0)
    # Of many rows the peak is narrow: between two points it may be as much higher than both.
    near: BoolArray = values + len(model.data) * apart**2 > values.max() - _NEGLIGIBLE
    return near
