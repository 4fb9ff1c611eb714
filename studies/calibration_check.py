"""Simulation-based calibration of posteriors: the rank of the truth among their draws.

Parameters are drawn from the prior, rows simulated under them, and the posterior of those rows is
sampled as that of any table is. If simulation, density and sampler are right, the rank of the truth
among independent posterior draws is uniform, for each parameter and for any other function of
parameters and rows. One such function is the joint log-likelihood, which sees mistakes that leave
each parameter's own marginal as it should be.
"""

import math
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, Rng
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.inference.chains import ProgressCallback, SampleSettings
from ridgebayes.inference.emcee_sampling import walk
from ridgebayes.inference.importance import Effort, importance_sample
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.inference.posterior import walked_posterior
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise, as_noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.replicated import prior_draws, simulate_log_loads
from ridgebayes.results import Fit
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.runtime.randomness import seed_of, stream
from studies.uniformity import Uniformity, ranks_to_pit, uniformity
from tests.drawn import drawn_posterior
from tests.simulated import simulated

LOG_LIKELIHOOD = "log-likelihood"  # the quantity beside the parameters
RANK_COLUMNS = ["replicate", "quantity", "rank", "n_draw", "converged"]
FAILURE_COLUMNS = ["replicate", "reason"]
MOST_FAILED = 0.05  # share of failed fits beyond which ranks of the others prove nothing
# A change of tau by 10 % instead of 1 % ends a walk at its 50 autocorrelation times: enough for a
# rank among some hundred draws, and a fifth of the time.
SBC_SETTINGS = SampleSettings(tau_change=0.1)
_GAP = 5.0  # autocorrelation times between the steps that draws are taken from


class Engine(Protocol):
    """What draws from a posterior."""

    def __call__(self, model: Model, *, seed: int) -> Fit:
        """Return the posterior's draws."""


@dataclass(frozen=True)
class Verdict:
    """What the ranks of all quantities say together.

    Parameters
    ----------
    calibrated : bool
        Whether every ECDF stays in its band, and no more than `MOST_FAILED` of the fits failed.
    p_value : float
        Smallest p-value over the quantities times their number, at most 1 (Bonferroni).
    quantity : str
        The quantity of smallest p-value.
    n_used, n_failed : int
        Fits whose ranks were used, and fits that failed.
    """

    calibrated: bool
    p_value: float
    quantity: str
    n_used: int
    n_failed: int

    def __str__(self) -> str:
        word = "calibrated" if self.calibrated else "NOT calibrated"
        failed = f", {self.n_failed} failed" if self.n_failed else ""
        return f"{word}: p = {self.p_value:.3g} ({self.quantity}), {self.n_used} fits{failed}"


@dataclass(frozen=True, eq=False)
class SBC:
    """Ranks of true values among posterior draws, over many simulated sets of rows.

    Parameters
    ----------
    form, noise : str
        Names of the form and the error model that simulated and fitted.
    engine : str
        How posteriors were drawn from: ``walk``, ``importance``, or a callable's name.
    n_replicate : int
        Simulated sets of rows.
    ranks : pandas.DataFrame
        Columns replicate, quantity, rank, n_draw, converged: how many of the `n_draw` draws are
        below the truth, for each parameter and the log-likelihood.
    failures : pandas.DataFrame
        Columns replicate, reason: fits that gave no draws, or did not converge.

    Notes
    -----
    The sum of two is one of both runs: see `first` of `sbc`.
    Failed fits are counted and listed, and their ranks take no part in the verdict. Given its rows
    a fit fails or not whatever the truth was, so that the ranks of the others are uniform still.
    But they say nothing of rows like those of the failed: above `MOST_FAILED` of these the verdict
    is not ``calibrated``. Ranks of fits that gave draws without converging stay in `ranks`.
    """

    form: str
    noise: str
    engine: str
    n_replicate: int
    ranks: pd.DataFrame
    failures: pd.DataFrame

    def __add__(self, other: "SBC") -> "SBC":
        return replace(
            self,
            n_replicate=self.n_replicate + other.n_replicate,
            ranks=pd.concat([self.ranks, other.ranks], ignore_index=True),
            failures=pd.concat([self.failures, other.failures], ignore_index=True),
        )

    @property
    def n_failed(self) -> int:
        """Fits that gave no draws, or did not converge."""
        return self.failures["replicate"].nunique()

    @property
    def quantities(self) -> tuple[str, ...]:
        """The parameters, and the log-likelihood."""
        return tuple(dict.fromkeys(self.ranks["quantity"]))

    def uniformity(self, prob: float = 0.99, *, unconverged: bool = False) -> dict[str, Uniformity]:
        """Test the ranks of each quantity.

        Parameters
        ----------
        prob : float, optional
            Probability that all ECDFs of calibrated posteriors stay in their bands: each has a
            band of probability 1 - (1 - prob)/(number of quantities). By Bonferroni's inequality
            that holds however the quantities' ranks depend on each other.
        unconverged : bool, optional
            Whether fits that gave draws without converging take part.

        Returns
        -------
        dict of str to Uniformity
            By quantity.

        Raises
        ------
        ComputationError
            If there is no rank to test.
        """
        ranks = self.ranks if unconverged else self.ranks[self.ranks["converged"]]
        if ranks.empty:
            raise ComputationError(f"{self.form}, {self.noise}: all {self.n_replicate} fits failed")
        each = 1 - (1 - prob) / len(self.quantities)
        found = {}
        for name, own in ranks.groupby("quantity", sort=False):
            n_draw = int(own["n_draw"].iloc[0])
            pit = ranks_to_pit(own["rank"].to_numpy(), n_draw)
            found[str(name)] = uniformity(pit, each, n_draw=n_draw)
        return found

    def verdict(self, prob: float = 0.99, *, unconverged: bool = False) -> Verdict:
        """Return what `uniformity` finds, in one record."""
        found = self.uniformity(prob, unconverged=unconverged)
        worst = min(found, key=lambda name: found[name].p_value)
        within = all(one.inside for one in found.values())
        few = self.n_failed <= MOST_FAILED * self.n_replicate
        p_value = min(1.0, len(found) * found[worst].p_value)
        return Verdict(within and few, p_value, worst, found[worst].n, self.n_failed)


@dataclass(frozen=True, eq=False)
class _Replication:
    """All that one simulated set of rows and its fit need; small enough to be sent to a process."""

    places: Observations
    form: Form
    noise: Noise
    priors: Mapping[str, Distribution] | None
    engine: Engine
    n_draw: int
    seed: int

    def __call__(self, replicate: int) -> tuple[list[dict[str, object]], str]:
        """Return the ranks, and why the fit failed if it did."""
        seed = int(stream(self.seed, f"replicate {replicate}").integers(2**63))
        rng = stream(seed, "simulate")
        template = Model(self.places, self.form, self.noise, self.priors)
        truth = prior_draws(template, rng, 1)[0]
        rows = simulated(self.places, simulate_log_loads(template, truth, rng)[0])
        model = Model(rows, self.form, self.noise, self.priors)
        try:
            fit = self.engine(model, seed=seed)
        except ComputationError as error:
            return [], str(error)
        u = independent_draws(fit, self.n_draw, stream(seed, "thin"))
        theta = model.to_theta(u[:, : model.n_parameter])
        values = dict(zip(model.parameter_names, zip(truth, theta.T, strict=True), strict=True))
        true, *others = log_likelihood(model, np.vstack([truth, theta]), stream(seed, "points"))
        values[LOG_LIKELIHOOD] = true, np.array(others)
        ranks = [
            {
                "replicate": replicate,
                "quantity": name,
                "rank": int(np.count_nonzero(draws < true)),
                "n_draw": self.n_draw,
                "converged": fit.converged,
            }
            for name, (true, draws) in values.items()
        ]
        return ranks, "; ".join(fit.convergence_failures)


def log_likelihood(model: Model, theta: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the log-likelihood of the outer parameters, (n, n_parameter) to (n,).

    Offsets and log K are integrated out; with points of their own where that is an estimate.
    """
    u = model.to_scores(theta)[:, model.outer]
    found = LatentIntegral(model).estimated(u, rng, 32).log_density
    return np.asarray(found - model.log_outer_prior(u))


def _walk(model: Model, *, seed: int) -> Fit:
    target = ModelTarget(model, seed)
    proposal = importance_sample(target, Effort(), seed).proposal
    walked = walk(target, proposal, seed=seed, settings=SBC_SETTINGS)
    return Fit.of(walked_posterior(model, walked, seed, None))


def _importance(model: Model, *, seed: int) -> Fit:
    return Fit.of(drawn_posterior(model, seed=seed))


ENGINES: dict[str, Engine] = {"walk": _walk, "importance": _importance}


def sbc(
    data: Observations,
    form: Form,
    noise: str | Noise = "iid",
    *,
    n_replicate: int = 200,
    first: int = 0,
    rng: Rng = 0,
    fit: str | Engine = "walk",
    n_draw: int = 199,
    priors: Mapping[str, Distribution] | None = None,
    executor: Executor | None = None,
    progress: ProgressCallback | None = None,
) -> SBC:
    """Rank true parameters among the draws of their posteriors, over simulated sets of rows.

    Parameters
    ----------
    data : Observations
        Rows that give textures, counts and known errors; all are simulated as exact loads.
    form : Form
        Contact form.
    noise : str or Noise, optional
        Error model.
    n_replicate : int, optional
        Simulated sets of rows.
    first : int, optional
        Number of the first one: with the same seed a run goes on where another ended.
    rng : int or numpy.random.Generator, optional
        Seed; each replicate has a stream of its own.
    fit : str or callable, optional
        ``walk``: emcee's, with `SBC_SETTINGS`; ``importance``: what `calibrate` draws; or what
        makes a Fit of a Model and a ``seed``.
    n_draw : int, optional
        Draws of each posterior that the truth is ranked among.
    priors : mapping of str to Distribution, optional
        Replacements for default priors, by parameter name.
    executor : concurrent.futures.Executor, optional
        What replicates are computed on; one after another if not given. The result is the same.
    progress : callable, optional
        Called with a line of text now and then.

    Returns
    -------
    SBC
        Ranks, and which fits failed.

    Raises
    ------
    InputError
        If `fit` is neither, `n_replicate` is under 1, or there are not `n_draw` draws.

    Notes
    -----
    *Prior.* The likelihood of rows is zero where a texture's rate is not positive, and the prior is
    not renormalised for that. No rows can be simulated there: truths are drawn from the prior kept
    to positive rates, which has the same posterior.
    *Draws.* From the walkers of all ensembles, at steps at least five autocorrelation times apart.
    Walkers of one step are independent of each other once a walk has reached the posterior.
    *Log-likelihood.* Offsets and log K integrated out. Where that is an unbiased estimate, truth
    and draws have points of their own alike, so that its ranks are uniform all the same.

    References
    ----------
    Talts et al. (2018), arXiv:1804.06788; Modrak et al. (2023), doi:10.1214/23-BA1404, for the
    log-likelihood.
    """
    engine = ENGINES.get(fit) if isinstance(fit, str) else fit
    if engine is None:
        raise InputError(f"fit: expected one of {', '.join(ENGINES)}, or a callable, got {fit!r}")
    if n_replicate < 1:
        raise InputError(f"n_replicate: expected at least 1, got {n_replicate}")
    error_model, places = as_noise(noise), exact_places(data)
    run = _Replication(places, form, error_model, priors, engine, n_draw, seed_of(rng))
    ranks: list[dict[str, object]] = []
    failures: list[dict[str, object]] = []
    numbers = range(first, first + n_replicate)
    found = map_ordered(run, numbers, executor, name=lambda i: f"replicate {i}")
    for i, (own, reason) in zip(numbers, found, strict=True):
        ranks += own
        if reason:
            failures.append({"replicate": i, "reason": reason})
        if progress is not None and (i + 1) % 10 == 0:
            progress(f"{i + 1 - first} of {n_replicate} replicates, {len(failures)} failed")
    return SBC(
        form.name,
        error_model.name,
        fit if isinstance(fit, str) else getattr(fit, "__name__", "own"),
        n_replicate,
        pd.DataFrame(ranks, columns=RANK_COLUMNS),
        pd.DataFrame(failures, columns=FAILURE_COLUMNS),
    )


def independent_draws(fit: Fit, n: int, rng: np.random.Generator) -> FloatArray:
    """Return some draws of a fit that are independent of each other, as far as it converged.

    Parameters
    ----------
    fit : Fit
        Posterior.
    n : int
        Number of draws.
    rng : numpy.random.Generator
        Which walkers and steps are taken.

    Returns
    -------
    ndarray of float, shape (n, n_coordinate)
        Unconstrained coordinates, from steps at least five autocorrelation times apart.

    Raises
    ------
    InputError
        If those steps do not hold so many draws.
    """
    chains = fit.chains
    tau = float(np.max(chains.tau))
    gap = math.ceil(_GAP * tau) if math.isfinite(tau) else chains.n_step
    pool = chains.u[:, ::-1][:, :: max(gap, 1)].reshape(-1, chains.u.shape[-1])
    if len(pool) < n:
        raise InputError(f"n_draw: expected at most {len(pool)}, all that are independent, got {n}")
    return pool[rng.choice(len(pool), n, replace=False)]


def exact_places(data: Observations) -> Observations:
    """Return rows that can be simulated: exact, without counts of 2. Their loads mean nothing."""
    return simulated(data, np.where(data.Q >= 4, 0.0, np.nan))
