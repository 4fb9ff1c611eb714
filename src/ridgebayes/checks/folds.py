"""Rows left out in turn: what a fold leaves out, and its posterior given the rest.

Of very many textures, counts or rows a fold leaves out a tenth, drawn at random.
Where the posterior given all rows is known, its draws are weighted by what the rows left out took
from them; only where too few of them count, or their density is only estimated, is a fold fitted
anew. Its draws come from a proposal fitted to those given all rows then, unless hardly any of them
count or weights have a heavy tail: then its posterior is searched for.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.checks.all_rows import AllRows, Told
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.evidence import LogEvidence, power_law_evidence
from ridgebayes.inference.chains import Chains
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.moves import Independence
from ridgebayes.inference.posterior import Posterior, drawn_exactly
from ridgebayes.inference.power_law_exact import sample_power_law
from ridgebayes.model.default_priors import SLOPES, default_priors
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.prior_files import ResolvedPriors, priors_of
from ridgebayes.predict.load_distribution import LoadDistribution
from ridgebayes.predict.predict import predict_load
from ridgebayes.results import Fit
from ridgebayes.runtime.randomness import stream

LEAVES = ("texture", "step", "row")
# Each takes a fit for every form: above, ten folds of many tell as much.
_MOST_FOLDS = {"texture": 24, "step": 24, "row": 50}
_N_GROUP = 10
# Less than `importance_posterior` takes by itself: a share of 41 rows asks for no second digit.
EFFORT = {"n_round": 2, "n_per_round": 256, "n_draw": 128, "n_point": 16}
# Draws behind a CRPS, whose standard error is about 1 % of a predictive sd; of very many rows,
# whose mean is looked at, fewer.
N_CRPS, _LEAST_CRPS, _MOST_CRPS = 10_240, 1_024, 2**22
# Draws that a fold's posterior is resampled to: fewer where each has offsets.
_N_RESAMPLED, _N_RESAMPLED_LATENT = 1_024, 256
_N_PROPOSAL = 512  # draws that a proposal is fitted to
# A proposal fitted to draws of which a smaller share counts does not reach what the rest allows.
_LEAST_NEAR = 0.2


@dataclass(frozen=True, eq=False)
class Weighted:
    """A fold's posterior by weights: of draws, with the rows' joint score by all of them."""

    posterior: Posterior
    log_score: float
    log_score_se: float


@dataclass(frozen=True, eq=False)
class Fold:
    """Rows to predict from the others; holds all that a process of its own needs.

    Parameters
    ----------
    name : str
        The texture's label, ``Q = 8``, ``row 3``; or ``group 2 of 10``.
    data : Observations
        All rows.
    left : ndarray of bool, shape (n_obs,)
        The rows left out.
    form : Form
        Contact form.
    noise : Noise
        Error model.
    seed : int
        Seed of this fold alone.
    effort : mapping of str to int, optional
        Passed on to `importance_posterior`: fewer draws than its own for a first look.
    priors : mapping of str to Distribution, optional
        Replacements for default priors; those of coefficients that no row tells of are not needed.
    known : AllRows, optional
        From the posterior given all rows under these priors.
    """

    name: str
    data: Observations
    left: BoolArray
    form: Form
    noise: Noise
    seed: int
    effort: Mapping[str, int] = field(default_factory=dict)
    priors: Mapping[str, Distribution] = field(default_factory=dict)
    known: AllRows | None = None

    @property
    def full_name(self) -> str:
        """Name with form and error model, for errors."""
        return f"{self.form.name}, {self.noise.name}, fold {self.name}"

    def refit(self) -> tuple[Posterior, LogEvidence]:
        """Return the posterior given the rows that stay.

        Raises
        ------
        ComputationError
            If no row stays, or the posterior has no interior mode.
        """
        if self.left.all():
            raise ComputationError("no row is left to fit")
        model, known, told = self.rest, self.known, self.told
        if drawn_exactly(model):  # of independent draws there is nothing to diagnose
            chains = sample_power_law(model, seed=self.seed)
            drawn = Posterior(model, chains, pd.DataFrame(), (), self.seed)
            return drawn, power_law_evidence(model)
        is_near = told is None or told.share >= _LEAST_NEAR
        if known is not None and known.laplace is not None and is_near:
            u = known.coordinates[:: max(len(known.coordinates) // _N_PROPOSAL, 1)]
            u = u[:, np.isin(known.names, model.parameter_names)]
            laplace = known.laplace
            if model.parameter_names != known.names:  # without coefficients of the rows left out
                laplace = fit_laplace(model, near=model.to_theta(u.mean(axis=0)))
            rng = stream(self.seed, "proposal")
            near = Independence.fitted(laplace.whiten(u)[0], laplace.n_curved, rng)
            found = importance_posterior(model, laplace, near, seed=self.seed, **self.effort)
            # Where draws given all rows fell short, so would those of another search.
            if found[1].ok or known.failures:
                return found
        return importance_posterior(model, seed=self.seed, **self.effort)

    @cached_property
    def rest(self) -> Model:
        """The model of the rows that stay."""
        return self.model(self.data.take(~self.left))

    @cached_property
    def told(self) -> Told | None:
        """What draws given all rows tell; None where their densities or parameters are others."""
        if self.known is None or self.left.all():
            return None
        return self.known.told(self.rest)

    def weighted(self) -> Weighted | None:
        """Return the posterior given the rows that stay, from draws given all; None if too few.

        A draw's weight is one over the density of the rows left out given the others. Their joint
        score is the mean of that density by these weights, whose tail is smoothed.
        """
        told = self.told
        if self.known is None or told is None or not told.is_enough:
            return None
        weight, model = told.weight, self.rest
        top = told.joint.max()
        density = np.exp(told.joint - top)
        mean = float(weight @ density)
        se = float(np.sqrt((weight**2) @ (density - mean) ** 2)) / mean
        ladder = np.cumsum(weight)
        n = _N_RESAMPLED_LATENT if model.is_latent else _N_RESAMPLED
        middles = (np.arange(n) + 0.5) / n * ladder[-1]
        u = self.known.coordinates[np.searchsorted(ladder, middles)]
        if model.is_latent:
            offsets = model.estimated(u, stream(self.seed, "offsets"), 1).latent
            u = np.concatenate([u, offsets], axis=1)
        u = u[None, :, None]
        ones = np.ones(model.n_coordinate + 1)
        chains = Chains(u, np.zeros(u.shape[:-1]), np.ones(1), ones, ())
        posterior = Posterior(model, chains, pd.DataFrame(), self.known.failures, self.seed)
        return Weighted(posterior, float(top) + math.log(mean), se)

    def model(self, rows: Observations) -> Model:
        """Return the model of some of the rows, under the given priors of its parameters."""
        known = default_priors(self.form.bind(rows.textures, rows.labels), self.noise, self.priors)
        names = {*known, SLOPES}
        own = {name: prior for name, prior in self.priors.items() if name in names}
        return Model(rows, self.form, self.noise, own)


def folds_of(
    data: Observations,
    form: Form | Fit,
    noise: Noise,
    *,
    leave: str = "texture",
    seed: int = 0,
    effort: Mapping[str, int] | None = None,
    priors: ResolvedPriors | None = None,
) -> list[Fold]:
    """Return one fold per texture, count Q or row, or ten of a tenth each where there are many.

    Above 24 textures or counts, or 50 rows.

    Parameters
    ----------
    data : Observations
        All rows.
    form : Form or Fit
        Contact form; or its fit to all rows under the same priors, whose draws save most refits.
    noise : Noise
        Error model.
    leave : str, optional
        ``texture``, ``step`` or ``row``.
    seed : int, optional
        Seed; a fold's own depends on this, the form, the error model and the fold's name alone.
    effort : mapping of str to int, optional
        Passed on to `importance_posterior`.
    priors : mapping of str to mapping of str to Distribution, optional
        Replacements for default priors: by form name, or ``noise``, and parameter name.

    Raises
    ------
    InputError
        If `leave` is none of the three, or there would be one fold only.
    """
    if leave not in LEAVES:
        raise InputError(f"leave: expected one of {', '.join(LEAVES)}, got {leave!r}")
    codes, names = _codes(data, leave)
    if len(names) > _MOST_FOLDS[leave]:
        dealt = stream(seed, f"groups of {leave}").permutation(len(names)) % _N_GROUP
        codes, names = dealt[codes], [f"group {i + 1} of {_N_GROUP}" for i in range(_N_GROUP)]
    if len(names) < 2:
        raise InputError(f"leave: expected rows of at least two, to leave one out, got {leave!r}")
    known = None
    if isinstance(form, Fit):
        given = form.posteriors.get(noise.name)
        form, known = form.form, None if given is None else AllRows.of(given)
    folds, replaced = [], priors_of(priors, form, noise)
    for code, name in enumerate(names):
        own = int(stream(seed, form.name, noise.name, f"leave {name}").integers(2**63))
        left = codes == code
        folds.append(Fold(name, data, left, form, noise, own, effort or {}, replaced, known))
    return folds


def row_loads(fit: Posterior, data: Observations, Q: IntArray | None = None) -> LoadDistribution:
    """Return the distribution of each row's load as it would be observed, reduced to nu = 0.5.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    data : Observations
        Rows; those of calibrated textures and counts keep the offsets that were learned.
    Q : ndarray of int, shape (n_obs,), optional
        Counts to be reached, instead of the rows' own.

    Returns
    -------
    LoadDistribution
        Shape (n_obs,). The row's known relative error is part of it.
    """
    a, b = data.a_over_R[data.texture], data.b_over_R[data.texture]
    load = predict_load(fit, a, b, np.asarray(data.Q if Q is None else Q, dtype=float))
    return load.widened(data.rel_se)


def row_crps(fit: Posterior, data: Observations, rng: np.random.Generator) -> FloatArray:
    """Return the CRPS of log(p/E) of rows, each predicted by itself.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    data : Observations
        Rows that were not fitted.
    rng : numpy.random.Generator
        Of the draws.

    Returns
    -------
    ndarray of float, shape (n_obs,), dimensionless
        NaN in brackets and counts.
    """
    # A count of 2 needs no load to be reached; 4 stands in its place and is not looked at.
    load = row_loads(fit, data, np.maximum(data.Q, 4))
    n = int(np.clip(_MOST_CRPS // max(len(data), 1), _LEAST_CRPS, N_CRPS))
    with np.errstate(all="ignore"):
        crps = crps_of_draws(np.log(load.rvs(n, rng)), data.log_load)
    return np.where(data.is_exact, crps, np.nan)


def clustered_se(total: FloatArray, n: FloatArray) -> float:
    """Return the standard error of a sum over rows of which only whole folds are independent.

    Parameters
    ----------
    total, n : ndarray of float, shape (n_fold,)
        Sum and number of the rows of each fold. A fold's rows stray from the mean row together.

    Returns
    -------
    float
        NaN for a single fold.

    Examples
    --------
    >>> clustered_se(np.array([4.0, 0.0, 2.0]), np.array([2.0, 2.0, 2.0])).__round__(4)
    3.4641
    """
    if len(total) < 2:
        return np.nan
    astray = total - n * (total.sum() / n.sum())
    return float(np.sqrt(len(total) / (len(total) - 1) * (astray**2).sum()))


def crps_of_draws(draws: FloatArray, observed: FloatArray) -> FloatArray:
    """Return the continuous ranked probability score of each observation, without bias.

    Parameters
    ----------
    draws : ndarray of float, shape (n_draw, n)
        Draws of each prediction.
    observed : ndarray of float, shape (n,)
        What came.

    Returns
    -------
    ndarray of float, shape (n,)
        Mean distance to the draws less half the mean distance between two of them; 0 is best.

    Notes
    -----
    *Cost.* That of sorting.

    References
    ----------
    Zamo & Naveau (2018), doi:10.1007/s11004-017-9709-7: the fair estimator.

    Examples
    --------
    >>> crps_of_draws(np.array([[0.0], [2.0]]), np.array([1.0])).tolist()
    [0.0]
    """
    n = len(draws)
    ladder = np.sort(draws, axis=0)
    place = 2 * np.arange(1, n + 1)[:, None] - n - 1
    apart = (place * ladder).sum(axis=0) / (n * (n - 1))
    value: FloatArray = np.abs(draws - observed).mean(axis=0) - apart
    return value


def _codes(data: Observations, leave: str) -> tuple[IntArray, list[str]]:
    """Return the fold of each row, and the folds' names."""
    if leave == "texture":
        return data.texture, list(data.labels) or [f"a{a!r}_b{b!r}" for a, b in data.textures]
    if leave == "step":
        steps, codes = np.unique(data.Q, return_inverse=True)
        return codes.astype(np.int64), [f"Q = {step}" for step in steps.tolist()]
    return np.arange(len(data)), [f"row {i + 1}" for i in range(len(data))]
