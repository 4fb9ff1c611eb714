"""Posteriors without some rows, and the predictive density of the rows left out.

Draws given all rows are weighted by one over the density of the rows left out given the rest. If
the rest constrains the posterior far less than all rows do, the draws miss much of the posterior
given the rest: scores are too high, and the Pareto k of the weights hardly shows it. In this case
new draws are made given the rest, and the score is the difference of the two log evidences. The
mean density over the new draws would be unreliable: for the first steps of the embedded sweep, left
out of Hybrid with independent errors, the score is -14.7 by evidences, but -57 with a standard
error of 1 by the mean over four thousand draws.
"""

import math
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes._types import BoolArray, FloatArray
from ridgebayes.errors import ComputationError
from ridgebayes.inference.chains import Chains
from ridgebayes.inference.importance import (
    EXACT_DRAW_FACTOR,
    Drawn,
    Effort,
    effective_share,
    importance_sample,
)
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.pareto_smoothing import MAX_FINITE_VARIANCE_K, pareto_smoothed
from ridgebayes.inference.posterior import Posterior, completed
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.default_priors import SLOPES
from ridgebayes.model.model import Model
from ridgebayes.runtime.randomness import stream

_MAX_WEIGHTED_DRAWS = 512  # four times as many if densities are exact
_MAX_RETURNED_DRAWS = 2 * _MAX_WEIGHTED_DRAWS  # about, given the rest
_MIN_EFFECTIVE_SHARE = 0.35  # with a smaller share scores of tiny tables are too high


@dataclass(frozen=True, eq=False)
class LeftOut:
    """The posterior given the remaining rows, and the score of the rows left out.

    Parameters
    ----------
    model : Model
        Model of the remaining rows.
    u : ndarray of float, shape (n_draw, n_outer)
        Draws of equal weight: normal scores of the outer parameters.
    scores : ndarray of float, shape (n_draw, n_level) or (n_draw, 0)
        Scores of the offsets if rows are not normal, else empty.
    log_score, log_score_se : float
        Joint log density of the rows left out given the rest, and its Monte Carlo error.
    method : str
        ``weights`` or ``evidences``.
    status : str
        ``ok``, or the reason why draws or score are not reliable.
    """

    model: Model
    u: FloatArray
    scores: FloatArray
    log_score: float
    log_score_se: float
    method: str
    status: str

    def posterior(self, seed: int) -> Posterior:
        """Return a posterior for predictions: with log K and offsets, but without a summary."""
        u = completed(self.model, self.u, self.scores, stream(seed, "offsets"))[None, :, None]
        ones = np.ones(u.shape[-1] + 1)
        chains = Chains(u, np.zeros(u.shape[:-1]), ones[:1], ones, ())
        failures = () if self.status == "ok" else (self.status,)
        return Posterior(self.model, chains, pd.DataFrame(), failures, seed)


@dataclass(frozen=True, eq=False)
class AllRows:
    """The posterior given all rows.

    Parameters
    ----------
    model : Model
        Model of all rows.
    evidence : LogEvidence
        Log evidence of all rows.
    u : ndarray of float, shape (n_draw, n_outer)
        Thinned draws; empty if sampling failed.
    log_density : ndarray of float, shape (n_draw,)
        Log posterior density of the draws. Estimates are the values with which the draws were
        accepted, so that weights are unbiased.
    status : str
        ``ok``, or the reason why the draws are not reliable.
    effort : Effort, optional
        Numbers of draws for a posterior of fewer rows.
    """

    model: Model
    evidence: LogEvidence
    u: FloatArray
    log_density: FloatArray
    status: str
    effort: Effort = field(default_factory=Effort)

    @classmethod
    def of(cls, posterior: Posterior, effort: Effort, seed: int) -> "AllRows":
        """Thin a posterior's draws; if it has no evidence (read from a file), compute it."""
        model, evidence = posterior.model, posterior.evidence
        if evidence is None:
            evidence = cls.drawn(model, effort, seed).evidence
        log_density = posterior.kept_chains.log_density.ravel()
        stride = _stride(model, len(log_density))
        u = posterior.coordinates[::stride, model.outer]
        status = (*posterior.convergence_failures, "ok")[0]
        return cls(model, evidence, u, log_density[::stride], status, effort)

    @classmethod
    def drawn(cls, model: Model, effort: Effort, seed: int) -> "AllRows":
        """Draw from a model's posterior; if sampling fails, the status states the reason."""
        try:
            drawn = _sample(model, effort, seed)
        except ComputationError as error:
            failed = LogEvidence("importance", math.nan, math.nan, str(error))
            no_draws = np.empty((0, model.n_outer))
            return cls(model, failed, no_draws, np.empty(0), str(error), effort)
        log_density = drawn.log_density.ravel()
        stride, status = _stride(model, len(log_density)), drawn.evidence.status
        u = drawn.u.reshape(-1, model.n_outer)[::stride]
        return cls(model, drawn.evidence, u, log_density[::stride], status, effort)

    def without(self, left: BoolArray, seed: int) -> LeftOut:
        """Return the posterior without some rows, and the score of these rows.

        Parameters
        ----------
        left : ndarray of bool, shape (n_obs,)
            Rows to leave out.
        seed : int
            Seed.

        Raises
        ------
        ComputationError
            If no row remains, or no draw given the rest has a positive density.

        Notes
        -----
        *Accuracy.* Weights are used if their Pareto k is at most 0.5 and the effective share is at
        least 35 %; errors are then a few hundredths, in line with the standard error. Otherwise
        the errors are those of the two evidences; the error of the evidence of all rows is common
        to all scores.
        """
        if left.all():
            raise ComputationError("no row is left to fit")
        rest = rest_of(self.model, left)
        if len(self.u) and rest.outer_names == self.model.outer_names:
            reweighted = self._reweighted(rest, seed)
            if reweighted is not None:
                return reweighted
        drawn = _sample(rest, self.effort, seed)
        stride = max(drawn.log_density.size // _MAX_RETURNED_DRAWS, 1)
        u, scores = (
            x.reshape(drawn.log_density.size, x.shape[-1])[::stride]
            for x in (drawn.u, drawn.scores)
        )
        value = self.evidence.value - drawn.evidence.value
        se = math.hypot(self.evidence.se, drawn.evidence.se)
        status = drawn.evidence.status
        if drawn.evidence.ok:
            status = "ok" if self.evidence.ok else f"all rows: {self.evidence.status}"
        return LeftOut(rest, u, scores, value, se, "evidences", status)

    def _reweighted(self, rest: Model, seed: int) -> LeftOut | None:
        """Return the result from weighted draws; None if the weights are too unequal."""
        rng = stream(seed, "weights")
        estimate = LatentIntegral(rest).estimated(self.u, rng, self.effort.n_point)
        joint = self.log_density - estimate.log_density  # of rows left out: priors cancel
        log_weight, shape = pareto_smoothed(-joint)
        is_even = effective_share(log_weight) >= _MIN_EFFECTIVE_SHARE
        if not (shape <= MAX_FINITE_VARIANCE_K and is_even):
            return None
        # In logs: one draw may be so dense that the densities of all others would be 0 beside it.
        weight, value = np.exp(log_weight), float(logsumexp(log_weight + joint))
        se = float(np.linalg.norm(np.exp(log_weight + joint - value) - weight))
        cumulative, n = np.cumsum(weight), min(_MAX_RETURNED_DRAWS, len(weight))
        index = np.searchsorted(cumulative, (np.arange(n) + 0.5) / n * cumulative[-1])
        scores = estimate.scores[index]
        return LeftOut(rest, self.u[index], scores, value, se, "weights", self.status)


def rest_of(model: Model, left: BoolArray) -> Model:
    """Return the model without some rows, with the priors of the parameters that remain."""
    rows = model.data.take(~left)
    form = model.form.bind(rows.textures, rows.labels)
    names = {*form.parameter_names, *model.noise.parameter_names, SLOPES}
    priors = {name: prior for name, prior in model.given_priors.items() if name in names}
    return Model(rows, form, model.noise, priors)


def _stride(model: Model, n: int) -> int:
    factor = EXACT_DRAW_FACTOR if LatentIntegral(model).is_exact else 1
    return -(-n // (_MAX_WEIGHTED_DRAWS * factor))


def _sample(model: Model, effort: Effort, seed: int) -> Drawn:
    """Draw from a posterior; repeat with twice the draws and points if weights fail a check."""
    target = ModelTarget(model, seed)
    drawn = importance_sample(target, effort, seed)
    return drawn if drawn.evidence.ok else importance_sample(target, effort.doubled, seed)
