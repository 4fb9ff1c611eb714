"""Posteriors and evidences by adaptive importance sampling: the one sampler of all models.

Modes are searched for from many starts. A mixture of Student t in charts is fitted, round by round,
to all draws so far, weighed by density over the mixture of all proposals so far. Four repeats are
made independently of each other, so that they can disagree.

References
----------
Cappe et al. (2008), doi:10.1007/s11222-008-9059-x; Cornuet et al. (2012),
doi:10.1111/j.1467-9469.2011.00756.x; Vehtari et al. (2024), Journal of Machine Learning Research
25(72), for the shape of the weights' tail.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import ComputationError
from ridgebayes.inference.charts import Chart, charts_of
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.inference.modes import N_START, find_modes
from ridgebayes.inference.proposal import Mixture, _log_sum
from ridgebayes.model.model import Model
from ridgebayes.runtime.randomness import stream

N_REPEAT = 4
_DEFENSIVE, _DEFENSIVE_FIRST = 0.05, 0.3  # share of the prior in proposals, and in the first one
_LEAST_LOG_MASS = 8.0  # below the heaviest mode's: nothing rests on such a mode
_DRAWS_PER_PARAMETER = 20  # effective draws that a proposal is fitted to, at least
_MOST_COMPONENTS = 4  # of a mixture of few modes
_FEWER_POINTS = 2  # times fewer points while proposals are fitted
_ENOUGH = 0.5  # share of a round's draws that count, at which the proposal is good enough
_SPREAD_OF_STARTS = 1.5  # prior sds


@dataclass(frozen=True)
class Effort:
    """How many draws importance sampling takes.

    Parameters
    ----------
    n_round, n_per_round : int
        Rounds of adaptation of each repeat, and draws of each round.
    n_draw : int
        Draws of each repeat's last proposal.
    n_point : int
        Points for the scores of rows that are not normal, for each draw; a multiple of four.
    """

    n_round: int = 4
    n_per_round: int = 512
    n_draw: int = 512
    n_point: int = 32

    @property
    def doubled(self) -> "Effort":
        """Twice the draws and points."""
        return replace(
            self, n_per_round=2 * self.n_per_round, n_draw=2 * self.n_draw, n_point=2 * self.n_point
        )


class Evaluated(NamedTuple):
    """Draws of outer parameters with their densities and coordinates."""

    u: FloatArray  # (n, n_outer)
    log_density: FloatArray  # (n,)
    from_half: FloatArray  # (n,)
    scores: FloatArray  # (n, n_level)
    coordinates: FloatArray  # (n_chart, n, n_outer)
    log_jacobian: FloatArray  # (n_chart, n)


class Target:
    """A model's posterior of the outer parameters in charts."""

    def __init__(self, model: Model, rng: np.random.Generator) -> None:
        self.model = model
        self.integral = LatentIntegral(model)
        self.charts: Sequence[Chart] = charts_of(self.integral, rng)

    def evaluate(
        self, charts: IntArray, q: FloatArray, rng: np.random.Generator, n_point: int
    ) -> Evaluated:
        """Return the draws at coordinates q of their charts."""
        n = self.integral.n_at_once(n_point)
        parts = [
            self._evaluate(charts[i : i + n], q[i : i + n], rng, n_point)
            for i in range(0, len(q), n)
        ]
        return joined(parts)

    def _evaluate(
        self, charts: IntArray, q: FloatArray, rng: np.random.Generator, n_point: int
    ) -> Evaluated:
        k = self.model.n_outer_coefficient
        theta = self.model.outer_theta(np.concatenate([np.zeros((len(q), k)), q[:, k:]], axis=1))
        prepared = self.integral.prepared(theta[:, k:])
        with np.errstate(all="ignore"):
            each = [chart.conditional(prepared) for chart in self.charts]
            u = np.choose(charts[:, None], [one.to_scores(q) for one in each])
            coordinates = np.stack([q] if len(each) == 1 else [one.from_scores(u) for one in each])
            log_jacobian = np.stack([one.log_jacobian for one in each])
            usable = np.isfinite(u).all(axis=1)
            found = self.integral.estimated(
                np.where(usable[:, None], u, 0.0), rng, n_point, prepared
            )
        return Evaluated(
            u,
            np.where(usable, found.log_density, -np.inf),
            np.where(usable, found.from_half, -np.inf),
            found.scores,
            coordinates,
            log_jacobian,
        )

    def approximate(self, chart: int, q: FloatArray) -> FloatArray:
        """Return the log density in a chart's coordinates, smooth, shape (n,)."""
        n = self.integral.n_at_once(4)
        parts = [self._approximate(chart, q[i : i + n]) for i in range(0, len(q), n)]
        return np.concatenate(parts)

    def _approximate(self, chart: int, q: FloatArray) -> FloatArray:
        k = self.model.n_outer_coefficient
        theta = self.model.outer_theta(np.concatenate([np.zeros((len(q), k)), q[:, k:]], axis=1))
        prepared = self.integral.prepared(theta[:, k:])
        with np.errstate(all="ignore"):
            conditional = self.charts[chart].conditional(prepared)
            u = conditional.to_scores(q)
            usable = np.isfinite(u).all(axis=1)
            value = self.integral.approximate(np.where(usable[:, None], u, 0.0), prepared)
            value = value + conditional.log_jacobian
        return np.where(usable & ~np.isnan(value), value, -np.inf)

    def start(self, rng: np.random.Generator) -> Mixture:
        """Return a mixture of the normal approximations at the modes."""
        k, d = self.model.n_outer_coefficient, self.model.n_outer
        found = []
        for i in range(len(self.charts)):
            starts = _SPREAD_OF_STARTS * rng.standard_normal((N_START, d))
            starts[:, :k] = 0.0  # the centre of the coefficients given all else
            starts[: N_START // 4, :k] = rng.standard_normal((N_START // 4, k))
            modes = find_modes(lambda q, i=i: self.approximate(i, q), starts)
            found += [(i, mode) for mode in modes]
        if not found:
            raise ComputationError(
                f"{self.model.form.name}: expected starts of positive density, got none of "
                f"{N_START}"
            )
        heaviest = max(mode.log_mass for _, mode in found)
        kept = [(i, mode) for i, mode in found if mode.log_mass > heaviest - _LEAST_LOG_MASS]
        # Tempered: Laplace's masses are rough.
        mass = np.exp([0.5 * (mode.log_mass - heaviest) for _, mode in kept])
        return Mixture(
            mass / mass.sum(),
            np.array([i for i, _ in kept]),
            np.stack([mode.centre for _, mode in kept]),
            np.stack([mode.factor for _, mode in kept]),
        )


def joined(parts: Sequence[Evaluated]) -> Evaluated:
    """Return several sets of draws as one."""
    axes = (0, 0, 0, 0, 1, 1)
    columns = zip(zip(*parts, strict=True), axes, strict=True)
    return Evaluated(*(np.concatenate(arrays, axis=axis) for arrays, axis in columns))


def adapted(target: Target, effort: Effort, rng: np.random.Generator) -> Mixture:
    """Return a proposal fitted to a target, round by round."""
    shape = _split(target.start(rng), rng)
    prior = Mixture.prior(target.model.n_outer)
    proposals = [shape.beside(prior, _DEFENSIVE_FIRST)]
    parts: list[Evaluated] = []
    n, few = effort.n_per_round, max(effort.n_point // _FEWER_POINTS, 4)
    for i in range(effort.n_round):
        parts.append(target.evaluate(*proposals[-1].draw(rng, n), rng, few))
        draws = joined(parts)
        log_weight, _ = log_weights(draws, proposals)
        if np.isfinite(log_weight).any():
            weights = _tempered(log_weight, _DRAWS_PER_PARAMETER * target.model.n_outer)
            shape = shape.fitted(draws.coordinates, draws.log_jacobian, weights)
        proposals.append(shape.beside(prior, _DEFENSIVE))
        if i and effective_share(log_weight[-n:]) > _ENOUGH:
            break
    return proposals[-1]


def log_weights(
    draws: Evaluated, proposals: Sequence[Mixture]
) -> tuple[FloatArray, FloatArray]:
    """Return log weights of density over the mixture of proposals that made equal numbers."""
    with np.errstate(all="ignore"):
        terms = [one.log_density(draws.coordinates, draws.log_jacobian) for one in proposals]
        log_q = _log_sum(np.stack(terms)) - math.log(len(terms))
        usable = np.isfinite(log_q) & np.isfinite(draws.coordinates).all(axis=(0, 2))
        both = np.where(usable, np.stack([draws.log_density, draws.from_half]) - log_q, -np.inf)
    return both[0], both[1]


def effective_share(log_weight: FloatArray) -> float:
    """Return the share of the draws that count: 1 where weights are all equal."""
    top = log_weight.max()
    if not np.isfinite(top):
        return 0.0
    weights = np.exp(log_weight - top)
    return float(weights.sum() ** 2 / (weights**2).sum() / len(weights))


def _tempered(log_weight: FloatArray, n_effective: float) -> FloatArray:
    """Return normalised weights, raised to the power up to 1 that leaves so many effective draws.

    Few draws of large weight would make the next proposal narrower than the posterior.
    """
    log_weight = log_weight - log_weight.max()
    low, high = 0.0, 1.0
    n_effective = min(n_effective, 0.5 * np.isfinite(log_weight).sum())
    for _ in range(12):
        power = high if low == 0.0 and high == 1.0 else 0.5 * (low + high)
        with np.errstate(invalid="ignore"):
            weights = np.where(np.isfinite(log_weight), np.exp(power * log_weight), 0.0)
        weights /= weights.sum()
        if 1 / (weights**2).sum() >= n_effective:
            if power == 1.0:
                break
            low = power
        else:
            high = power if power < 1.0 else 0.999
    return weights


def _split(start: Mixture, rng: np.random.Generator) -> Mixture:
    """Return components beside each mode, for shapes that are not normal."""
    d = start.centres.shape[1]
    copies = max(_MOST_COMPONENTS // len(start.weights), 1)
    moved = rng.standard_normal((copies, *start.centres.shape))
    centres = start.centres + 0.7 * np.einsum("cij,rcj->rci", start.factors, moved)
    return Mixture(
        np.tile(start.weights, copies) / copies,
        np.tile(start.charts, copies),
        centres.reshape(-1, d),
        np.tile(start.factors, (copies, 1, 1)),
    )


def log_mean(log_weight: FloatArray) -> float:
    top = log_weight.max()
    if top == -np.inf:
        return -math.inf
    return float(top + math.log(np.exp(log_weight - top).mean()))


def sample(model, seed, effort=Effort()):
    rng = stream(seed, "importance")
    target = Target(model, rng)
    proposal = adapted(target, effort, rng)
    R=[]
    for i in range(N_REPEAT):
        d = target.evaluate(*proposal.draw(rng, effort.n_draw), rng, effort.n_point)
        a, b = log_weights(d, [proposal])
        R.append(Repeat(d, a, b, proposal))
    return target, R
class Repeat(NamedTuple):
    draws: Evaluated
    log_weight: FloatArray
    half_log_weight: FloatArray  # by half of the points
    last: Mixture
