"""Rows left out: the posterior given the rest, and the density of the rows left out given it.

A draw given all rows is weighed by one over the density of the rows left out given the others.
Where the rest constrains the posterior far less than all rows do, these draws miss much of it:
scores are too high, and the weights' tail hardly shows it. In this case the engine draws from the
posterior given the rest, and the score is the difference of the two log evidences. The mean density
over the new draws is no substitute: the first steps of the embedded sweep, left out of Hybrid with
independent errors, score -14.7 by evidences, and -57 with a standard error of 1 by four thousand
draws.
"""

import math
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

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

_MAX_ESTIMATED_DRAWS = 512  # that are weighed
_MIN_EFFECTIVE_SHARE = 0.35  # scores of tiny tables are too high where fewer draws count
_MIN_EFFECTIVE_DRAWS = 100  # for a log score to about 0.1
_N_KEPT = 1_024  # draws given the rest


@dataclass(frozen=True, eq=False)
class LeftOut:
    """The posterior given the rows that stay, and the score of those left out.

    Parameters
    ----------
    model : Model
        Posterior of the rows that stay.
    u : ndarray of float, shape (n_draw, n_outer)
        Draws of equal weight: normal scores of its outer parameters.
    scores : ndarray of float, shape (n_draw, n_level) or (n_draw, 0)
        Scores of its offsets, where rows are not normal.
    log_score, log_score_se : float
        Joint log density of the rows left out given the others, and its Monte Carlo error.
    method : str
        ``weights`` or ``evidences``.
    status : str
        ``ok``, or what draws or score lack.
    """

    model: Model
    u: FloatArray
    scores: FloatArray
    log_score: float
    log_score_se: float
    method: str
    status: str

    def posterior(self, seed: int) -> Posterior:
        """Return the draws with log K and offsets, for predictions; without a summary."""
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
        Posterior of all rows.
    evidence : LogEvidence
        Its log evidence.
    u : ndarray of float, shape (n_draw, n_outer)
        Some of its draws; none where it could not be drawn from.
    log_density : ndarray of float, shape (n_draw,)
        Their log posterior density; for estimates the value that the draw came with, so that
        weights are unbiased.
    status : str
        ``ok``, or what the draws lack.
    effort : Effort, optional
        Effort for a posterior of fewer rows.
    """

    model: Model
    evidence: LogEvidence
    u: FloatArray
    log_density: FloatArray
    status: str
    effort: Effort = field(default_factory=Effort)

    @classmethod
    def of(cls, posterior: Posterior, effort: Effort, seed: int) -> "AllRows":
        """Take a posterior's draws; one from a file has to be weighed again."""
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
        """Draw from a model's posterior; the reason is the status where that fails."""
        try:
            drawn = _drawn(model, effort, seed)
        except ComputationError as error:
            none = LogEvidence("importance", math.nan, math.nan, str(error))
            nothing = np.empty((0, model.n_outer))
            return cls(model, none, nothing, np.empty(0), str(error), effort)
        log_density = drawn.log_density.ravel()
        stride, status = _stride(model, len(log_density)), drawn.evidence.status
        u = drawn.u.reshape(-1, model.n_outer)[::stride]
        return cls(model, drawn.evidence, u, log_density[::stride], status, effort)

    def without(self, left: BoolArray, seed: int) -> LeftOut:
        """Return the posterior without some rows, and their score.

        Parameters
        ----------
        left : ndarray of bool, shape (n_obs,)
            Rows to leave out.
        seed : int
            Seed.

        Raises
        ------
        ComputationError
            If no row stays, or no draw given the rest has a positive density.

        Notes
        -----
        *Accuracy.* By weights if their Pareto k is at most 0.5 and 35 % of the draws count: errors
        are then a few hundredths, as the standard error says. By evidences their own, of which
        that of all rows is common to all that is left out.
        """
        if left.all():
            raise ComputationError("no row is left to fit")
        rest = rest_of(self.model, left)
        if len(self.u) and rest.outer_names == self.model.outer_names:
            weighed = self._weighed(rest, seed)
            if weighed is not None:
                return weighed
        drawn = _drawn(rest, self.effort, seed)
        stride = max(drawn.log_density.size // _N_KEPT, 1)
        u, scores = (
            x.reshape(drawn.log_density.size, x.shape[-1])[::stride]
            for x in (drawn.u, drawn.scores)
        )
        value, se = self.evidence.value - drawn.evidence.value, drawn.evidence.se
        status = drawn.evidence.status
        if drawn.evidence.ok:
            status = "ok" if self.evidence.ok else f"all rows: {self.evidence.status}"
        return LeftOut(
            rest, u, scores, value, math.hypot(se, self.evidence.se), "evidences", status
        )

    def _weighed(self, rest: Model, seed: int) -> LeftOut | None:
        """Return the same from weighed draws; None where too few of them count."""
        rng = stream(seed, "weights")
        estimate = LatentIntegral(rest).estimated(self.u, rng, self.effort.n_point)
        joint = self.log_density - estimate.log_density  # equal priors: the density of what is left
        log_weight, shape = pareto_smoothed(-joint)
        least = max(_MIN_EFFECTIVE_SHARE, _MIN_EFFECTIVE_DRAWS / len(joint))
        if not (shape <= MAX_FINITE_VARIANCE_K and effective_share(log_weight) >= least):
            return None
        weight, top = np.exp(log_weight), joint.max()
        density = np.exp(joint - top)
        mean = float(weight @ density)
        se = float(np.sqrt((weight**2) @ (density - mean) ** 2)) / mean
        ladder, n = np.cumsum(weight), min(_N_KEPT, len(weight))
        index = np.searchsorted(ladder, (np.arange(n) + 0.5) / n * ladder[-1])
        value = float(top) + math.log(mean)
        draws = self.u[index], estimate.scores[index]
        return LeftOut(rest, *draws, value, se, "weights", self.status)


def rest_of(model: Model, left: BoolArray) -> Model:
    """Return the model without some rows, under the priors of the parameters that it keeps."""
    rows = model.data.take(~left)
    form = model.form.bind(rows.textures, rows.labels)
    names = {*form.parameter_names, *model.noise.parameter_names, SLOPES}
    priors = {name: prior for name, prior in model.given_priors.items() if name in names}
    return Model(rows, form, model.noise, priors)


def _stride(model: Model, n: int) -> int:
    factor = EXACT_DRAW_FACTOR if LatentIntegral(model).is_exact else 1
    return -(-n // (_MAX_ESTIMATED_DRAWS * factor))


def _drawn(model: Model, effort: Effort, seed: int) -> Drawn:
    """Draw from a posterior; again with twice the draws and points where weights fail a check."""
    target = ModelTarget(model, seed)
    drawn = importance_sample(target, effort, seed)
    return drawn if drawn.evidence.ok else importance_sample(target, effort.doubled, seed)
