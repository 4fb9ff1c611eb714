"""Posteriors and evidences by adaptive importance sampling, for all models.

The sampler searches for modes from many starts. It fits a mixture of Student t distributions in
charts over several rounds; each round uses all draws so far, weighted by the density over the
mixture of all proposals so far. Four independent sets of draws from the final proposal then give
posterior and evidence: given the proposal, their mean weight is unbiased.

References
----------
Cappe et al. (2008), doi:10.1007/s11222-008-9059-x; Cornuet et al. (2012),
doi:10.1111/j.1467-9469.2011.00756.x; Vehtari et al. (2024), Journal of Machine Learning Research
25(72), for the shape of the weights' tail.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import ComputationError
from ridgebayes.inference.chains import Chains
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.modes import N_START, find_modes
from ridgebayes.inference.pareto_smoothing import MAX_PARETO_K, are_bounded, pareto_k
from ridgebayes.inference.proposal import Mixture, log_mean, log_sum
from ridgebayes.inference.target import Evaluated, Target, joined
from ridgebayes.runtime.randomness import stream

N_REPEAT = 4  # independent sets of draws
BLOCK = 32  # draws per block; thinning keeps whole blocks
MAX_SE = 0.05  # standard error of a ln evidence, so that two of them give a Bayes factor to 7 %
MAX_HALF_GAP = 0.1  # difference of ln evidences from all points and from half of the points
# The share of the prior in a proposal keeps weights bounded far from all components. The first
# proposal gets a larger share because it is rough.
_PRIOR_SHARE, _PRIOR_SHARE_FIRST = 0.05, 0.3
_MAX_LOG_MASS_GAP = 8.0  # modes with less than e^-8 of the heaviest mode's mass get no component
_MIN_EFFECTIVE_PER_PARAMETER = 20  # effective draws for a covariance to about 20 %
_MAX_COMPONENTS = 6  # components of the first proposal, divided among the modes
_GOOD_SHARE = 0.4  # adaptation ends after a round with a larger share of effective draws
EXACT_DRAW_FACTOR = 4  # exact densities get more draws: each costs a tenth of an estimate
_START_SD = 2.5  # prior sds: about 5 % of the starts are beyond five in a coordinate


@dataclass(frozen=True)
class Effort:
    """Numbers of draws of importance sampling.

    Parameters
    ----------
    n_round, n_per_round : int
        Maximum number of rounds of adaptation, and draws per round.
    n_draw : int
        Draws per set, a multiple of 32. There are four sets; if densities are exact, each set has
        four times as many draws.
    n_point : int
        Points per draw for the offsets of rows that are not normal, a multiple of eight.
    """

    n_round: int = 4
    n_per_round: int = 512
    n_draw: int = 256
    n_point: int = 16

    @property
    def halved(self) -> "Effort":
        """The effort with half of the draws, and the same points."""
        return replace(self, n_per_round=self.n_per_round // 2, n_draw=self.n_draw // 2)

    @property
    def doubled(self) -> "Effort":
        """The effort with twice the draws and points."""
        n_per_round, n_draw, n_point = self.n_per_round, self.n_draw, self.n_point
        return replace(self, n_per_round=2 * n_per_round, n_draw=2 * n_draw, n_point=2 * n_point)


@dataclass(frozen=True, eq=False)
class Drawn:
    """Draws of a posterior with its evidence.

    Parameters
    ----------
    u : ndarray of float, shape (n_repeat, n_draw, d)
        Normal scores of the outer parameters, of equal weight.
    log_density : ndarray of float, shape (n_repeat, n_draw)
        Log posterior density of the draws, not normalised.
    scores : ndarray of float, shape (n_repeat, n_draw, n_level)
        Scores of the offsets if rows are not normal, else empty.
    evidence : LogEvidence
        Evidence from the same draws.
    share : float
        Effective share of the draws, see `effective_share`.
    proposal : Mixture
        Proposal of the draws.
    """

    u: FloatArray
    log_density: FloatArray
    scores: FloatArray
    evidence: LogEvidence
    share: float
    proposal: Mixture

    @property
    def chains(self) -> Chains:
        """The draws as chains: each set is an ensemble, each block of draws a step."""
        n_repeat, n, d = self.u.shape
        shape = (n_repeat, n // BLOCK, BLOCK)
        failures = () if self.evidence.ok else (self.evidence.status,)
        return Chains(
            self.u.reshape(*shape, d),
            self.log_density.reshape(shape),
            np.full(n_repeat, self.share),
            np.ones(d + 1),
            failures,
        )


def importance_sample(target: Target, effort: Effort, seed: int) -> Drawn:
    """Draw from a posterior and estimate its evidence.

    Parameters
    ----------
    target : Target
        Posterior density.
    effort : Effort
        Numbers of draws.
    seed : int
        Seed.

    Raises
    ------
    ComputationError
        If no start or no draw has a positive density.
    """
    proposal = adapted(target, effort, stream(seed, "adaptation"))
    return draw_from(target, proposal, effort, seed)


def at_least(drawn: Drawn, target: Target, n: int, effort: Effort, seed: int) -> Drawn:
    """Return at least about n draws, from the same proposal if more are needed.

    The evidence stays that of `drawn`.
    """
    if drawn.u.shape[0] * drawn.u.shape[1] >= n:
        return drawn
    factor = EXACT_DRAW_FACTOR if target.is_exact else 1
    n_draw = math.ceil(n / (N_REPEAT * factor * BLOCK)) * BLOCK
    redrawn = draw_from(target, drawn.proposal, replace(effort, n_draw=n_draw), seed)
    return replace(redrawn, evidence=drawn.evidence)


def draw_from(target: Target, proposal: Mixture, effort: Effort, seed: int) -> Drawn:
    """Draw from a posterior with a proposal that has been fitted to it.

    Parameters
    ----------
    target, effort, seed
        As for `importance_sample`.
    proposal : Mixture
        Proposal.

    Raises
    ------
    ComputationError
        If no draw has a positive density.
    """
    sets, weights, halves = [], [], []
    n_draw = effort.n_draw * (EXACT_DRAW_FACTOR if target.is_exact else 1)
    for i in range(N_REPEAT):
        rng = stream(seed, f"set {i}")
        draws = target.evaluate(*proposal.draw(rng, n_draw), rng, effort.n_point)
        log_weight, half = log_weights(draws, [proposal])
        index = _resample(log_weight, stream(seed, f"resampling {i}"))
        sets.append((draws.u[index], draws.log_density[index], draws.scores[index]))
        weights.append(log_weight)
        halves.append(half)
    u, log_density, scores = map(np.stack, zip(*sets, strict=True))
    evidence = _evidence(target, weights, halves)
    share = effective_share(np.concatenate(weights))
    return Drawn(u, log_density, scores, evidence, share, proposal)


def _evidence(
    target: Target, weights: Sequence[FloatArray], halves: Sequence[FloatArray]
) -> LogEvidence:
    """Return the log evidence, whose status lists the failed checks of the weights."""
    together = np.concatenate(weights)
    value = float(log_mean(together))
    if not math.isfinite(value):
        raise ComputationError(
            f"{target.name}: expected draws of positive density, got none of {len(together)}"
        )
    relative = np.exp(together - value)
    within = float(relative.std()) / math.sqrt(len(relative))
    between = np.exp([log_mean(log_weight) - value for log_weight in weights])
    # The larger of two estimates: from the variance of the weights, and from the sets' scatter.
    se = max(within, float(between.std(ddof=1)) / math.sqrt(len(weights)))
    gap = abs(float(log_mean(np.concatenate(halves))) - value)
    k, failed = pareto_k(together), []
    if not (k <= MAX_PARETO_K or are_bounded(together)):
        failed.append(f"Pareto k {k:.2f}, above {MAX_PARETO_K}")
    if not se <= MAX_SE:
        failed.append(f"standard error {se:.2g}, above {MAX_SE:g}")
    if not gap <= MAX_HALF_GAP:
        failed.append(f"half of the points give {gap:.2g} less or more, above {MAX_HALF_GAP:g}")
    status = "importance weights: " + "; ".join(failed) if failed else "ok"
    return LogEvidence("importance", value, se, status)


def adapted(target: Target, effort: Effort, rng: np.random.Generator) -> Mixture:
    """Fit a proposal to a target in rounds, until a round has a good effective share."""
    shape = _split(_mode_mixture(target, rng), rng)
    prior = Mixture.prior(len(target.names))
    proposals = [shape.beside(prior, _PRIOR_SHARE_FIRST)]
    parts: list[Evaluated] = []
    n, n_point = effort.n_per_round, max(effort.n_point // 2, 4)  # fits need no precise densities
    for _ in range(effort.n_round):
        parts.append(target.evaluate(*proposals[-1].draw(rng, n), rng, n_point))
        last, _ = log_weights(parts[-1], proposals[-1:])
        draws = joined(parts)
        log_weight, _ = log_weights(draws, proposals)
        if np.isfinite(log_weight).any():
            weights = _tempered(log_weight, len(target.names))
            shape = shape.fitted(draws.coordinates, draws.log_jacobian, weights)
        proposals.append(shape.beside(prior, _PRIOR_SHARE))
        if effective_share(last) > _GOOD_SHARE:
            break
    return proposals[-1]


def _mode_mixture(target: Target, rng: np.random.Generator) -> Mixture:
    """Return a mixture of the normal approximations at the modes."""
    k, d = target.n_centred, len(target.names)
    components = []
    for chart in range(target.n_chart):
        starts = _START_SD * rng.standard_normal((N_START, d))
        starts[:, :k] = 0.0  # the coefficients' centre given the error model's parameters
        starts[: N_START // 4, :k] = rng.standard_normal((N_START // 4, k))
        modes = find_modes(partial(target.approximate, chart), starts)
        components += [(chart, mode) for mode in modes]
    if not components:
        raise ComputationError(
            f"{target.name}: expected starts of positive density, got none of {N_START}; the "
            "priors exclude the rows, or allow no positive rate of some texture"
        )
    heaviest = max(mode.log_mass for _, mode in components)
    kept = [
        (chart, mode) for chart, mode in components if mode.log_mass > heaviest - _MAX_LOG_MASS_GAP
    ]
    # The square roots of the masses are used, because Laplace's masses are rough.
    mass = np.exp([0.5 * (mode.log_mass - heaviest) for _, mode in kept])
    return Mixture(
        mass / mass.sum(),
        np.array([chart for chart, _ in kept]),
        np.stack([mode.centre for _, mode in kept]),
        np.stack([mode.factor for _, mode in kept]),
    )


def _split(start: Mixture, rng: np.random.Generator) -> Mixture:
    """Return a mixture with several shifted components per mode, for shapes that are not normal."""
    d = start.centres.shape[1]
    copies = max(_MAX_COMPONENTS // len(start.weights), 1)
    moved = rng.standard_normal((copies, *start.centres.shape))
    centres = start.centres + 0.7 * np.einsum("cij,rcj->rci", start.factors, moved)
    return Mixture(
        np.tile(start.weights, copies) / copies,
        np.tile(start.charts, copies),
        centres.reshape(-1, d),
        np.tile(start.factors, (copies, 1, 1)),
    )


def log_weights(draws: Evaluated, proposals: Sequence[Mixture]) -> tuple[FloatArray, FloatArray]:
    """Return log weights from all points, and from half of the points.

    A weight is the density over the mixture of the proposals, each with the same number of draws.
    """
    with np.errstate(all="ignore"):
        terms = [
            proposal.log_density(draws.coordinates, draws.log_jacobian) for proposal in proposals
        ]
        log_q = log_sum(np.stack(terms)) - math.log(len(terms))
        usable = np.isfinite(log_q) & np.isfinite(draws.coordinates).all(axis=(0, 2))
        density = np.stack([draws.log_density, draws.from_half])
        log_weight = np.where(usable, density - log_q, -np.inf)
    return log_weight[0], log_weight[1]


def effective_share(log_weight: FloatArray) -> float:
    """Return the effective sample size over the number of draws; 1 if all weights are equal."""
    top = log_weight.max()
    if not np.isfinite(top):
        return 0.0
    weights = np.exp(log_weight - top)
    return float(weights.sum() ** 2 / (weights**2).sum() / len(weights))


def _tempered(log_weight: FloatArray, d: int) -> FloatArray:
    """Return normalised weights raised to the largest power up to 1 with 20 d effective draws.

    A proposal fitted to a few large weights would be narrower than the posterior.
    """
    usable = np.isfinite(log_weight)
    n_effective = min(_MIN_EFFECTIVE_PER_PARAMETER * d, 0.5 * usable.sum())
    log_weight = np.where(usable, log_weight - log_weight.max(), -np.inf)

    def weights(power: float) -> FloatArray:
        value = np.where(usable, np.exp(power * np.where(usable, log_weight, 0.0)), 0.0)
        return np.asarray(value / value.sum())

    if 1 / (weights(1.0) ** 2).sum() >= n_effective:
        return weights(1.0)
    low, high = 0.0, 1.0
    for _ in range(10):
        middle = 0.5 * (low + high)
        is_enough = 1 / (weights(middle) ** 2).sum() >= n_effective
        low, high = (middle, high) if is_enough else (low, middle)
    return weights(low)


def _resample(log_weight: FloatArray, rng: np.random.Generator) -> IntArray:
    """Return indices of draws of equal weight, by systematic resampling, in random order."""
    n = len(log_weight)
    top = log_weight.max()
    if not np.isfinite(top):
        return np.arange(n)
    cumulative = np.cumsum(np.exp(log_weight - top))
    index = np.searchsorted(cumulative, (np.arange(n) + rng.random()) / n * cumulative[-1])
    return rng.permutation(np.minimum(index, n - 1))
