"""The posterior of a model: draws with their diagnostics."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Self

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray
from ridgebayes.contact.scaling import Texture
from ridgebayes.inference.chains import N_KEPT, Chains
from ridgebayes.inference.diagnostics import failed_diagnostics, summarise, values_text
from ridgebayes.inference.laplace import Laplace, fit_laplace
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.power_law_exact import is_conjugate
from ridgebayes.inference.qmc_nodes import Nodes, compress
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.offsets_given import OffsetsGiven, OffsetsInParts, TabulatedOffsets

N_TEXTURE_WALKED = 40  # a power law of more textures is drawn from exactly, without a walk
_AT_ONCE = 256  # draws whose covariances of offsets are there whole, of which predictions keep half
SAMPLERS = ("emcee", "importance", "exact")
LARGEST_LOG_LIKELIHOOD = 30_000_000  # numbers; beyond it there is none, and LOO says so
_SMALL_LOG_LIKELIHOOD = 1_000_000  # numbers that go with draws from process to process


@dataclass(frozen=True, eq=False)
class Posterior:
    """The posterior of one form under one error model.

    Parameters
    ----------
    model : Model
        What was sampled: data, form, error model, priors.
    chains : Chains
        Draws in unconstrained coordinates.
    summary : pandas.DataFrame
        One row per parameter, as `ridgebayes.inference.diagnostics.summarise` returns it.
    convergence_failures : tuple of str
        What the fit lacks of convergence; empty if it converged.
    seed : int
        Seed of the run.
    approximation : Laplace, optional
        The normal approximation that it was sampled by; a posterior read from a file has none.
    sampler : str, optional
        What drew it: ``emcee``, ``importance`` or ``exact``.
    evidence : LogEvidence, optional
        Evidence that importance sampling found with the draws; a posterior from a file has none.
    log_likelihood : ndarray of float, shape (n_draw, n_obs), optional
        Of each row at `draws`, where `with_log_likelihood` has worked it out.

    Examples
    --------
    A fit is one, under the error model that is printed:

    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> fit.form.name, fit.noise.name, fit.converged
    ('hybrid', 'iid', True)
    >>> fit.draws.shape == fit.coordinates.shape == (fit.kept_chains.log_density.size, 3)
    True
    >>> few = fit.thinned(3000)
    >>> len(few.draws) <= 3000, few.rows_log_likelihood().shape == (len(few.draws), 41)
    (True, True)
    >>> few.with_log_likelihood().log_likelihood.shape == few.rows_log_likelihood().shape
    True
    >>> fit.at_draws(fit.coordinates[:10], seed=1).draws.shape
    (10, 3)
    >>> fit.nodes(256).weight.sum(axis=0).round(9).tolist(), fit.laplace.mode.shape
    ([1.0, 1.0], (3,))
    >>> fit.offsets_given(2)  # independent rows share none
    (2, None)
    >>> fit.tabulate_offsets(2, [fit.coordinates[::2]], [(0.022, 0.02)])  # until they are forgotten
    >>> fit.forget_offsets()
    """

    model: Model
    chains: Chains
    summary: pd.DataFrame
    convergence_failures: tuple[str, ...]
    seed: int
    approximation: Laplace | None = field(default=None, repr=False)
    sampler: str = "emcee"
    evidence: LogEvidence | None = field(default=None, repr=False)
    log_likelihood: FloatArray | None = field(default=None, repr=False)
    _kept: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_kept", self.model.to_theta(self.kept_chains.u))

    def __getstate__(self) -> dict[str, object]:
        """Leave behind what can be worked out again: it may be many times the rest."""
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
        """Thinned draws of the parameters, shape (n_draw, n_parameter)."""
        return self._kept.reshape(-1, self.model.n_parameter)

    @property
    def coordinates(self) -> FloatArray:
        """The same draws in unconstrained coordinates, shape (n_draw, n_coordinate)."""
        return self.kept_chains.u.reshape(-1, self.model.n_coordinate)

    def thinned(self, n: int) -> Self:
        """Return the same with fewer draws; the summary stays that of all.

        Parameters
        ----------
        n : int
            Most draws to keep, whole steps at a time.

        Returns
        -------
        Posterior
            With the rows' log-likelihood only where the draws it belongs to are kept.
        """
        chains = self.chains.thinned(n)
        same = chains.n_step == self.kept_chains.n_step
        return replace(self, chains=chains, log_likelihood=self.log_likelihood if same else None)

    def rows_log_likelihood(self) -> FloatArray | None:
        """Return each row's log-likelihood at the thinned draws; None where there are very many."""
        if self.kept_chains.log_density.size * len(self.model.data) > LARGEST_LOG_LIKELIHOOD:
            return None
        if self.log_likelihood is not None:
            return self.log_likelihood
        return self.model.pointwise_log_likelihood(self.coordinates)

    def with_log_likelihood(self) -> Self:
        """Return the same with the rows' log-likelihood, for scores and files, if it is small."""
        if len(self.draws) * len(self.model.data) > _SMALL_LOG_LIKELIHOOD:
            return self
        rows = self.model.pointwise_log_likelihood(self.coordinates)
        return replace(self, log_likelihood=rows)

    def at_draws(self, u: FloatArray, seed: int) -> "Posterior":
        """Return the posterior that some draws stand for.

        Parameters
        ----------
        u : ndarray of float, shape (n_draw, n_coordinate)
            Their unconstrained coordinates.
        seed : int
            Seed of what predictions draw beside them.

        Returns
        -------
        Posterior
            With the summary of all draws.
        """
        each, ones = u[None, :, None], np.ones(u.shape[1] + 1)
        chains = Chains(each, np.zeros(each.shape[:-1]), ones[:1], ones, ())
        of_all = self.summary, self.convergence_failures
        return Posterior(self.model, chains, *of_all, seed, self.approximation, self.sampler)

    @cached_property
    def laplace(self) -> Laplace:
        """The normal approximation, with other modes searched for; found once.

        ComputationError if there is no interior mode.
        """
        return self.approximation or fit_laplace(self.model, search_others=True)

    @cached_property
    def _derived(self) -> dict[object, Any]:
        return {}

    def nodes(self, n: int) -> Nodes | None:
        """Return weighted nodes that stand for the draws; kept for the next call.

        Parameters
        ----------
        n : int
            Nodes.

        Returns
        -------
        Nodes or None
            As `ridgebayes.inference.qmc_nodes.compress` returns them; None where none will do.
        """
        if n not in self._derived:
            found = None
            if not drawn_exactly(self.model):  # which has more coordinates than nodes can fill
                found = compress(self.model, self.laplace, self.coordinates, n, seed=self.seed)
            self._derived[n] = found
        value: Nodes | None = self._derived[n]
        return value

    def offsets_given(self, stride: int) -> tuple[int, OffsetsInParts | TabulatedOffsets | None]:
        """Return what the rows tell of shared offsets at every n-th draw; kept for the next call.

        Parameters
        ----------
        stride : int
            The least n that is wanted.

        Returns
        -------
        n : int
            `stride`, or more where fewer draws have been worked out before.
        given : OffsetsInParts, TabulatedOffsets or None
            Conditional means and factors; None where the error model has no shared offsets.
        """
        kept = self._derived.get("offsets")
        if kept is None or kept[0] < stride:
            kept = stride, _offsets_given(self.model, self.coordinates[::stride])
            self._derived["offsets"] = kept
        return kept

    def tabulate_offsets(
        self, stride: int, draws: Sequence[FloatArray], textures: Sequence[Texture]
    ) -> None:
        """Have `offsets_given` return a table of some textures, until that is forgotten.

        Parameters
        ----------
        stride : int
            Every n-th draw.
        draws : sequence of ndarray of float, shape (n, n_coordinate)
            Their coordinates in parts, of which what the rows tell is held one at a time.
        textures : sequence of (float, float)
            Those that will be asked for.
        """
        parts = [partial(_ready, self.model, u) for u in draws]
        self._derived["offsets"] = stride, TabulatedOffsets(parts, textures)

    def forget_offsets(self) -> None:
        """Let go of what `offsets_given` keeps."""
        self._derived.pop("offsets", None)


def _offsets_given(model: Model, u: FloatArray) -> OffsetsInParts | None:
    """Return the same at any number of draws; None where rows share no offsets."""
    if model.offsets is None:
        return None
    starts = range(0, len(u), _AT_ONCE)
    return OffsetsInParts(tuple(_ready(model, u[i : i + _AT_ONCE]) for i in starts))


def _ready(model: Model, u: FloatArray) -> OffsetsGiven:
    """Return what rows tell of offsets at some draws, ready for many textures."""
    given = model.offsets_given(u)
    assert given is not None  # there are offsets
    return given.inverted()


def posterior_of(
    model: Model,
    chains: Chains,
    laplace: Laplace | None,
    *,
    seed: int,
    sampler: str,
    evidence: LogEvidence | None = None,
) -> Posterior:
    """Return the posterior that draws of a model stand for, with their diagnostics."""
    summary = summarise(model.to_theta(chains.u), model.parameter_names)
    convergence_failures = chains.convergence_failures + failed_diagnostics(summary)
    return Posterior(model, chains, summary, convergence_failures, seed, laplace, sampler, evidence)


def drawn_exactly(model: Model) -> bool:
    """Return whether a posterior is drawn from exactly: a power law's of very many textures."""
    return model.n_coefficient > N_TEXTURE_WALKED and is_conjugate(model)
