"""An independence move: candidates from a mixture of Student t fitted to the posterior beforehand.

Where the fit is good almost every candidate is accepted and steps hardly remember each other; where
it is poor the Metropolis-Hastings ratio still leaves the posterior exact, and the moves mixed with
it carry the walkers. Several components follow a posterior that is bent or has two humps, as that
of a Student tail has: few outliers and a narrow scale, or none and a wide one.

The fit is adaptive importance sampling: round by round draws of the proposal are weighted by
density over proposal, and the next proposal is fitted to them. A round costs a few steps of a walk,
and finds what a walk's start may miss.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import gammaln, logsumexp, ndtr, ndtri

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import ComputationError
from ridgebayes.inference.pareto_smoothing import pareto_k

# In the mixture nearly all steps are the fitted proposal's; differential evolution carries the
# walkers where the fit is wrong. The others are there to be measured against it.
MOVES = {  # independence, differential evolution, stretch
    "mixture": (0.9, 0.1, 0.0),
    "independence": (1.0, 0.0, 0.0),
    "differential evolution": (0.0, 1.0, 0.0),
    "stretch": (0.0, 0.0, 1.0),
}
_DF = 8.0  # small enough for the proposal's tails to cover the posterior's
_SCALE = 1.05
_SKEW = 0.4  # from which a coordinate's halves differ
_PRIOR_WEIGHT = 20.0  # draws' worth of the common covariance in that of each component
_LIGHT = 0.5  # Pareto shape below which weights have a variance
_BATCH = 512  # points whose densities are asked for at a time: memory is bounded, caches are used


@dataclass(frozen=True, eq=False)
class Independence:
    """A proposal for `emcee.moves.MHMove`, in whitened coordinates.

    The first coordinates come from a mixture of Student t, the last from independent normals: many
    coefficients are nearly that already, given the error model. Those that rows bound on one side
    are not: their normals have two halves of different widths.

    Parameters
    ----------
    weights : ndarray of float, shape (n_component,)
        Weights of the components, sum 1.
    centres : ndarray of float, shape (n_component, k)
        Their centres.
    factors : ndarray of float, shape (n_component, k, k)
        Lower Cholesky factors of their shapes.
    rest : ndarray of float, shape (3, m)
        Mode of each coordinate after the k-th, and its standard deviations below and above.

    Examples
    --------
    >>> propose = Independence.standard(2, 1)
    >>> candidates, log_ratio = propose(np.zeros((3, 3)), np.random.RandomState(0))
    >>> candidates.shape, bool(np.all(log_ratio > 0))
    ((3, 3), True)
    """

    weights: FloatArray
    centres: FloatArray
    factors: FloatArray
    rest: FloatArray

    @classmethod
    def standard(cls, k: int, m: int = 0) -> "Independence":
        """Return one component at the origin, of unit shape, and m standard normals."""
        rest = np.stack([np.zeros(m), np.ones(m), np.ones(m)])
        return cls(np.ones(1), np.zeros((1, k)), np.eye(k)[None], rest)

    @classmethod
    def fitted(
        cls, points: FloatArray, k: int, rng: np.random.Generator, n_component: int = 4
    ) -> "Independence":
        """Return the mixture fitted to draws (n, k + m) by expectation maximisation."""
        weights, centres, factors = _mixture(points[:, :k], n_component, rng)
        rest = [_halves(one) for one in points[:, k:].T]
        return cls(weights, centres, factors, np.array(rest).reshape(-1, 3).T)

    def __call__(
        self, z: FloatArray, random: np.random.RandomState
    ) -> tuple[FloatArray, FloatArray]:
        """Return candidates of the shape of `z` and log q(old) - log q(new), shape (n,)."""
        candidates = self.rvs(random, len(z))
        log_pdf = self.log_pdf(np.concatenate([z, candidates]))
        return candidates, log_pdf[: len(z)] - log_pdf[len(z) :]

    def rvs(self, random: np.random.RandomState | np.random.Generator, n: int) -> FloatArray:
        """Return draws of the proposal, shape (n, k + m)."""
        k, (mode, below, above) = self.centres.shape[1], self.rest
        ladder = np.cumsum(self.weights)
        component = np.searchsorted(ladder, random.uniform(0.0, ladder[-1], n), side="right")
        component = np.minimum(component, len(ladder) - 1)
        steps = random.standard_normal((n, k)) * np.sqrt(_DF / random.chisquare(_DF, size=(n, 1)))
        first = self.centres[component]
        first = first + _SCALE * np.einsum("nij,nj->ni", self.factors[component], steps)
        last = random.standard_normal((n, len(mode)))
        two = below != above
        # The same probability below as the normal's, which has as much on either side.
        share, p = (below / (below + above))[two], ndtr(last[:, two])
        last[:, two] = np.where(
            p < share, ndtri(0.5 * p / share), ndtri(1 - 0.5 * (1 - p) / (1 - share))
        )
        last = mode + _SCALE * np.where(last < 0, below, above) * last
        return np.concatenate([first, last], axis=1)

    def log_pdf(self, z: FloatArray) -> FloatArray:
        """Return the proposal's log density, shape (n,)."""
        k, (inverse, peaks) = self.centres.shape[1], self._shapes
        squares = _distances(z[:, :k], self.centres, inverse)
        components = peaks[:, None] - 0.5 * (_DF + k) * np.log1p(squares / _DF)
        value = _log_sum_exp(components)
        if z.shape[1] > k:
            mode, below, above = self.rest
            off = z[:, k:] - mode
            last = off / (_SCALE * np.where(off < 0, below, above))
            mean_sd = 0.5 * _SCALE * (below + above)
            value -= 0.5 * (last * last).sum(axis=1)
            value -= np.log(mean_sd * math.sqrt(2 * math.pi)).sum()
        return value

    @cached_property
    def _shapes(self) -> tuple[FloatArray, FloatArray]:
        """The inverses of the components' factors, and their log densities at the centres."""
        k, shapes = self.centres.shape[1], _SCALE * self.factors
        peak = gammaln(0.5 * (_DF + k)) - gammaln(0.5 * _DF) - 0.5 * k * math.log(_DF * math.pi)
        inverse = np.linalg.inv(shapes).astype(np.float64)
        return inverse, np.log(self.weights) - _log_volumes(shapes) + peak


def _halves(x: FloatArray) -> tuple[float, float, float]:
    """Return mode and sds below and above of a normal of two halves, equal if draws allow it.

    By maximum likelihood, the mode among quantiles of the draws: John (1982),
    doi:10.1080/03610928208828279.
    """
    mean, variance = x.mean(), x.var()
    # Never narrower than a tenth: a handful of different draws says little of a spread.
    sd = math.sqrt(variance + 0.01)
    if abs(((x - mean) ** 3).mean()) < _SKEW * sd**3:
        return mean, sd, sd
    modes = np.quantile(x, np.linspace(0.02, 0.98, 49))
    off = x - modes[:, None]
    below, above = (
        np.cbrt((half**2).mean(axis=1)) for half in (np.minimum(off, 0), np.maximum(off, 0))
    )
    i = int((below + above).argmin())
    below, above = (np.sqrt(one[i] ** 2 * (below[i] + above[i]) + 0.01) for one in (below, above))
    return float(modes[i]), float(below), float(above)


def _mixture(
    points: FloatArray, n_component: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit a mixture of normals, each drawn a little towards the common covariance."""
    n = len(points)
    # Whitened coordinates have unit scale: the ridge keeps a handful of different draws in shape.
    common = np.atleast_2d(np.cov(points.T)) + 1e-4 * np.eye(points.shape[1])
    centres = points[rng.choice(n, n_component, replace=False)]
    factors = np.repeat(np.linalg.cholesky(common)[None], n_component, axis=0)
    weights = np.full(n_component, 1 / n_component)
    for _ in range(12):  # a proposal, not an estimate: it need not be the last digit's mixture
        log_share = -0.5 * _distances(points, centres, np.linalg.inv(factors))
        log_share += (np.log(weights) - _log_volumes(factors))[:, None]
        share = np.exp(log_share - _log_sum_exp(log_share))
        mass = share.sum(axis=1) + 1e-9
        weights = mass / mass.sum()
        centres = share @ points / mass[:, None]
        off = points - centres[:, None]
        scatter = np.swapaxes(share[:, :, None] * off, 1, 2) @ off + 0.2 * _PRIOR_WEIGHT * common
        factors = np.linalg.cholesky(scatter / (mass + _PRIOR_WEIGHT)[:, None, None])
    return weights, centres, factors


def _distances(points: FloatArray, centres: FloatArray, inverse: FloatArray) -> FloatArray:
    """Return squared distances in units of each component's shape, (n_component, n)."""
    off = np.swapaxes(inverse @ (points.T - centres[:, :, None]), 0, 1)
    value: FloatArray = (off * off).sum(axis=0)
    return value


def _log_sum_exp(x: FloatArray) -> FloatArray:
    """Return log sum exp over the first axis: SciPy's own takes longer to begin than to add."""
    top = x.max(axis=0)
    value: FloatArray = top + np.log(np.exp(x - top).sum(axis=0))
    return value


def _log_volumes(factors: FloatArray) -> FloatArray:
    value: FloatArray = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1)
    return value


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

    @property
    def effective(self) -> float:
        """Share of the draws that count: 1 where weights are all equal."""
        return float(1 / np.square(self.relative).mean())

    @property
    def k(self) -> float:
        """Pareto shape of the weights' tail."""
        return pareto_k(self.log_weight)

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
    ComputationError
        If the density is positive at none of them.
    """
    z = proposal.rvs(rng, n)
    target = np.concatenate([log_density(z[i : i + _BATCH]) for i in range(0, n, _BATCH)])
    if not np.isfinite(target).any():
        raise ComputationError(f"expected draws of positive density, got none of {n}")
    return Weighted(z, target, target - proposal.log_pdf(z))


def adapted(
    log_density: Callable[[FloatArray], FloatArray],
    k: int,
    n_rest: int,
    rng: np.random.Generator,
    *,
    n_round: int = 6,
    n: int = 2_000,
    start: Weighted | None = None,
    enough: float = 1.0,
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
        Rounds, at least one, and draws of each.
    start : Weighted, optional
        Draws that the first round is fitted to; of a standard proposal if not given.
    enough : float, optional
        Share of the draws that count, at which no further round is made if no tail of weights is
        heavy.
    """
    proposal = Independence.standard(k, n_rest)
    draws = start or weighted(log_density, proposal, rng, n)
    for i in range(n_round):
        if (i or start is None) and draws.effective > enough and draws.k < _LIGHT:
            break
        # Early weights are cut, so that no single draw is all that the next round is fitted to.
        chosen = draws.resampled(rng, n, largest=math.sqrt(n))
        proposal = Independence.fitted(draws.z[chosen], k, rng)
        draws = weighted(log_density, proposal, rng, n)
    return proposal, draws
