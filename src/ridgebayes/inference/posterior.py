"""The posterior of a model: draws and their convergence diagnostics."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import Texture
from ridgebayes.inference.chains import N_KEPT, Chains
from ridgebayes.inference.diagnostics import failed_diagnostics, summarise, values_text
from ridgebayes.inference.emcee_sampling import Walked
from ridgebayes.inference.importance import Drawn
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.runtime.randomness import stream

SAMPLERS = ("emcee", "importance", "exact")
MAX_LOG_LIKELIHOOD_SIZE = 30_000_000  # numbers: 240 MB


@dataclass(frozen=True, eq=False)
class Posterior:
    """The posterior of one form under one error model.

    Parameters
    ----------
    model : Model
        Data, form, error model and priors.
    chains : Chains
        Draws: normal scores of the parameters, then of the shared offsets.
    summary : pandas.DataFrame
        One row per parameter, as `ridgebayes.inference.diagnostics.summarise` returns it.
    convergence_failures : tuple of str
        Conditions of convergence that were not met; empty if all were.
    seed : int
        Seed of the run.
    sampler : str, optional
        ``emcee``, ``importance`` or ``exact``.
    evidence : LogEvidence, optional
        Evidence from the same draws; a posterior from a file has none.
    cautions : tuple of str, optional
        Reasons to doubt the result, one sentence each: units, copies, independence, priors.

    Examples
    --------
    A fit is a posterior, under the selected error model:

    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> fit.form.name, fit.noise.name, fit.converged
    ('hybrid', 'iid', True)
    >>> fit.draws.shape == fit.coordinates.shape == (fit.kept_chains.log_density.size, 3)
    True
    >>> few = fit.thinned(3000)
    >>> len(few.draws) <= 3000, few.rows_log_likelihood().shape == (len(few.draws), 41)
    (True, True)
    >>> fit.shared_offsets(2) is None  # independent rows share none
    True
    >>> fit.log_likelihood_of_rows.shape == fit.draws.shape[:1]
    True
    """

    model: Model
    chains: Chains
    summary: pd.DataFrame
    convergence_failures: tuple[str, ...]
    seed: int
    sampler: str = "importance"
    evidence: LogEvidence | None = field(default=None, repr=False)
    cautions: tuple[str, ...] = ()
    _kept: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        u = self.kept_chains.u[..., : self.model.n_parameter]
        object.__setattr__(self, "_kept", self.model.to_theta(u))

    def __getstate__(self) -> dict[str, object]:
        """Drop cached results, which can be many times larger than the draws."""
        return {name: value for name, value in vars(self).items() if name != "_derived"}

    def __repr__(self) -> str:
        state = "converged" if self.converged else f"NOT converged: {self.convergence_failures[0]}"
        values = values_text(self.summary)
        return f"{type(self).__name__}({self.form.name}, {self.noise.name}: {values}; {state})"

    @property
    def form(self) -> Form:
        """The form, bound to the calibrated textures."""
        return self.model.form

    @property
    def noise(self) -> Noise:
        """The error model."""
        return self.model.noise

    @property
    def converged(self) -> bool:
        """Whether every convergence rule was met."""
        return not self.convergence_failures

    @property
    def kept_chains(self) -> Chains:
        """The chains thinned to at most `N_KEPT` draws, whole steps at a time."""
        return self.chains.thinned(N_KEPT)

    @property
    def draws(self) -> FloatArray:
        """Thinned draws of the parameters, shape (n_draw, n_parameter), read-only."""
        draws = self._kept.reshape(-1, self.model.n_parameter)
        draws.flags.writeable = False
        return draws

    @property
    def coordinates(self) -> FloatArray:
        """Thinned draws as normal scores, offsets last, shape (n_draw, n_coordinate)."""
        kept = self.kept_chains.u
        return kept.reshape(-1, kept.shape[-1])

    @property
    def log_likelihood_of_rows(self) -> FloatArray:
        """Log-likelihood of all rows at the thinned draws, with log K and offsets integrated out.

        Shape (n_draw,). If rows that are not normal share offsets, it is the log of an unbiased
        estimate.
        """
        u = self.coordinates[:, self.model.outer]
        return self.kept_chains.log_density.ravel() - self.model.log_outer_prior(u)

    def thinned(self, n: int) -> Self:
        """Return the posterior with fewer draws; the summary remains that of all draws.

        Parameters
        ----------
        n : int
            Maximum number of draws, in whole steps.

        Returns
        -------
        Posterior
            Thinned posterior.
        """
        return replace(self, chains=self.chains.thinned(n))

    def rows_log_likelihood(self) -> FloatArray | None:
        """Return each row's log-likelihood at the thinned draws, or None if it is too large.

        It is given the other rows if exact, else given the offsets.
        """
        if self.kept_chains.log_density.size * len(self.model.data) > MAX_LOG_LIKELIHOOD_SIZE:
            return None
        integral, u, k = LatentIntegral(self.model), self.coordinates, self.model.n_parameter
        if integral.is_exact:
            return integral.rows_given_others(u[:, self.model.outer])
        return integral.rows_given_offsets(self.draws, u[:, k:])

    @cached_property
    def _derived(self) -> dict[int, "SharedOffsets | None"]:
        return {}

    def shared_offsets(self, stride: int) -> "SharedOffsets | None":
        """Return the shared offsets at every `stride`-th draw; the result is cached.

        Parameters
        ----------
        stride : int
            Thinning interval.

        Returns
        -------
        SharedOffsets or None
            None if the error model has no shared offsets.
        """
        if not self.noise.factors:
            return None
        if stride not in self._derived:
            u, k = self.coordinates[::stride], self.model.n_parameter
            eta = self.draws[::stride, self.model.n_coefficient :]
            self._derived[stride] = SharedOffsets(self.model, eta, u[:, k:])
        return self._derived[stride]


class SharedOffsets:
    """Shared offsets at draws of a posterior, evaluated at textures and counts.

    Parameters
    ----------
    model : Model
        Model.
    eta : ndarray of float, shape (n_draw, n_noise)
        Error model parameters.
    scores : ndarray of float, shape (n_draw, n_level)
        Scores of the error model's offsets, without log K.
    """

    def __init__(self, model: Model, eta: FloatArray, scores: FloatArray) -> None:
        self._offsets, self._eta, self._scores = model.offsets.own(), eta, scores
        self._prepared = self._offsets.prepared(eta, scores)

    def at(self, texture: Texture, Q: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance of a texture's offsets, both of shape (n_draw, n_Q)."""
        return self._offsets.at(texture, Q, self._eta, self._scores, self._prepared)


def posterior_of(model: Model, drawn: Drawn, seed: int) -> Posterior:
    """Return the posterior from importance draws of a model, with diagnostics.

    Parameters
    ----------
    model : Model
        Model.
    drawn : Drawn
        Draws of the outer parameters.
    seed : int
        Seed of the draws of offsets and of log K.
    """
    n_repeat, n, d = drawn.u.shape
    u, scores = drawn.u.reshape(-1, d), drawn.scores.reshape(n_repeat * n, drawn.scores.shape[-1])
    whole = completed(model, u, scores, stream(seed, "offsets"))
    chains = drawn.chains
    whole = whole.reshape(*chains.log_density.shape, -1)
    chains = replace(chains, u=whole, tau=np.ones(whole.shape[-1] + 1))
    return _posterior(model, chains, seed, "importance", drawn.evidence)


def failed_walk(model: Model, walked: Walked) -> tuple[str, ...]:
    """Return the unmet conditions of a walk: stopping rule, and diagnostics of outer parameters."""
    theta = model.outer_theta(walked.chains.u)
    summary = summarise(theta, model.outer_names)
    return walked.chains.convergence_failures + failed_diagnostics(summary)


def walked_posterior(
    model: Model, walked: Walked, seed: int, evidence: LogEvidence | None
) -> Posterior:
    """Return the posterior from a walk's draws, with diagnostics.

    The walk of a model with offsets or log K is first thinned to at most about `N_KEPT` draws.
    """
    chains, scores = walked.chains, walked.scores
    if model.offsets.n_level:
        scores, chains = scores[:, chains.kept_steps(N_KEPT)], chains.thinned(N_KEPT)
    *shape, d = chains.u.shape
    u, n_level = chains.u.reshape(-1, d), scores.shape[-1]
    whole = completed(model, u, scores.reshape(len(u), n_level), stream(seed, "offsets"))
    chains = replace(chains, u=whole.reshape(*shape, -1))
    return _posterior(model, chains, seed, "emcee", evidence)


def _posterior(
    model: Model, chains: Chains, seed: int, sampler: str, evidence: LogEvidence | None
) -> Posterior:
    theta = model.to_theta(chains.u[..., : model.n_parameter])
    share = float(chains.acceptance.mean()) if sampler == "importance" else 1.0
    summary = summarise(theta, model.parameter_names, share=share)
    failures = chains.convergence_failures + failed_diagnostics(summary)
    return Posterior(model, chains, summary, failures, seed, sampler, evidence)


def completed(
    model: Model, u: FloatArray, scores: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return normal scores of all parameters, K included, and of the error model's offsets.

    Parameters
    ----------
    model : Model
        Model.
    u : ndarray of float, shape (n_draw, n_outer)
        Normal scores of the outer parameters.
    scores : ndarray of float, shape (n_draw, n_level) or (n_draw, 0)
        Scores of all offsets; if there are none, they are drawn given normal rows.
    rng : numpy.random.Generator
        Source of the draws.
    """
    if not model.offsets.n_level:
        return u
    if not scores.shape[1]:
        scores = LatentIntegral(model).draw(u, rng)
    n_first = model.offsets.n_first
    # Most coordinates are scores of steps or places; in single precision they compress well in
    # files. Scores of textures keep double precision, since rows may determine K very precisely.
    first, rest = scores[:, :n_first], scores[:, n_first:].astype(np.float32).astype(float)
    if not model.has_slopes:
        return np.concatenate([u, first, rest], axis=1)
    eta = model.outer_theta(u)
    total = model.offsets.first_root(eta) * first
    slopes, texture_offset = model.slopes_given(total, eta, rng)
    parts = [slopes, u]
    if "texture" in model.noise.factors:
        parts.append(texture_offset / model.offsets.tau("texture", eta)[:, None])
    return np.concatenate([*parts, rest], axis=1)
