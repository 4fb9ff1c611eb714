"""Fit an independence proposal to a density before it is sampled: adaptive importance sampling.

Round by round draws of the proposal are weighted by density over proposal, and the next proposal is
fitted to them. A round costs a few steps of a walk, and finds what a walk's start may miss.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.inference.moves import Independence

_BATCH = 512  # points whose densities are asked for at a time: memory is bounded, caches are used


@dataclass(frozen=True, eq=False)
class Weighted:
    """Draws of a proposal with the logarithms of their weights.

    Parameters
    ----------
    z : ndarray of float, shape (n, d)
        Draws.
    log_density : ndarray of float, shape (n,)
        Log density, not normalised.
    log_weight : ndarray of float, shape (n,)
        Log density less that of the proposal.
    """

    z: FloatArray
    log_density: FloatArray
    log_weight: FloatArray

    @property
    def log_mean(self) -> float:
        """Log of the mean weight: of the density's integral."""
        return float(logsumexp(self.log_weight)) - math.log(len(self.z))

    @property
    def relative(self) -> FloatArray:
        """Weights over their mean, shape (n,)."""
        return np.exp(self.log_weight - self.log_mean)

    def resampled(self, rng: np.random.Generator, n: int, *, largest: float = np.inf) -> IntArray:
        """Return n indices drawn by weight, evenly spaced along the ladder of weights, shuffled.

        Relative weights above `largest` are cut there.
        """
        ladder = np.cumsum(np.minimum(self.relative, largest))
        index = np.searchsorted(ladder, (np.arange(n) + rng.random()) / n * ladder[-1])
        return rng.permutation(np.minimum(index, len(self.z) - 1))


def weighted(
    log_density: Callable[[FloatArray], FloatArray],
    proposal: Independence,
    rng: np.random.Generator,
    n: int,
) -> Weighted:
    """Draw from a proposal and weigh the draws.

    Parameters
    ----------
    log_density : callable
        (n, d) to (n,): log density in whitened coordinates.
    proposal : Independence
        Where draws come from.
    rng : numpy.random.Generator
        Source of randomness.
    n : int
        Draws.

    Raises
    ------
    InputError
        If the density is positive at none of them.
    """
    z = proposal.rvs(rng, n)
    target = np.concatenate([log_density(z[i : i + _BATCH]) for i in range(0, n, _BATCH)])
    if not np.isfinite(target).any():
        raise InputError(
            "sample: no starting points of positive density; expected a feasible centre"
        )
    return Weighted(z, target, target - proposal.log_pdf(z))


def adapted(
    log_density: Callable[[FloatArray], FloatArray],
    k: int,
    n_rest: int,
    rng: np.random.Generator,
    *,
    n_round: int = 6,
    n: int = 2_000,
) -> tuple[Independence, Weighted]:
    """Return a proposal fitted to a density, and the last round's weighted draws.

    Parameters
    ----------
    log_density : callable
        (n, k + n_rest) to (n,): log density in whitened coordinates.
    k, n_rest : int
        Coordinates that the mixture is fitted to, and those that are nearly normal.
    rng : numpy.random.Generator
        Source of randomness.
    n_round, n : int, optional
        Rounds, and draws of each.
    """
    proposal = Independence.standard(k, n_rest)
    draws = weighted(log_density, proposal, rng, n)
    for _ in range(n_round):
        # Early weights are cut, so that no single draw is all that the next round is fitted to.
        chosen = draws.resampled(rng, n, largest=math.sqrt(n))
        proposal = Independence.fitted(draws.z[chosen], k, rng)
        draws = weighted(log_density, proposal, rng, n)
    return proposal, draws
