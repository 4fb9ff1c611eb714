"""The evidence by thermodynamic integration: a second opinion, dear and less accurate.

ln Z is the integral from 0 to 1 of the mean log-likelihood under the posterior whose likelihood is
raised to the power beta. beta = t^5, since nearly all changes near the prior; the midpoint rule in
t, since under the prior itself, where sigma may vanish, the mean does not exist.
"""

import math

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.moves import Independence, weighted
from ridgebayes.model.model import Model
from ridgebayes.runtime.randomness import stream

_POWER = 5
_RULE_MAX = 0.5  # error of the rule above which a log evidence says nothing
_N_EFFECTIVE_MIN = 25  # draws of a temperature, of whose mean fewer say nothing
_ROUNDS = 3  # of fitting the proposal to the next temperature, from that of the one before


def thermodynamic_evidence(
    model: Model, *, n_temperature: int = 32, n_draw: int = 1_000, seed: int = 0
) -> LogEvidence:
    """Integrate the mean log-likelihood over temperatures.

    Parameters
    ----------
    model : Model
        Posterior of a few parameters, no offsets sampled.
    n_temperature : int, optional
        Temperatures: the error falls with the square of their number.
    n_draw : int, optional
        Importance draws at each.
    seed : int, optional
        Seed.

    Returns
    -------
    LogEvidence
        Method ``thermodynamic``; the standard error is of the draws, and of the rule as far as the
        mean's curvature between neighbouring temperatures tells it. The status is not ok where the
        rule's part is above 0.5, or a temperature has hardly any effective draw: a likelihood so
        sharp that the temperatures step over it.

    References
    ----------
    Friel & Pettitt (2008), doi:10.1111/j.1467-9868.2007.00650.x.
    """
    k = model.n_coordinate
    rng = stream(seed, "thermodynamic")
    # In u the prior is standard normal: the first proposal.
    proposal = Independence.standard(k)
    width = 1 / n_temperature
    value, variance = 0.0, 0.0
    means, n_effective = np.empty(n_temperature), np.empty(n_temperature)
    for i in range(n_temperature):
        t = (i + 0.5) * width
        beta = t**_POWER

        def log_target(u: FloatArray, beta: float = beta) -> FloatArray:
            log_likelihood = model.log_likelihood(model.to_theta(u))
            return beta * log_likelihood - 0.5 * (u * u).sum(axis=-1)

        for _ in range(_ROUNDS):
            draws = weighted(log_target, proposal, rng, n_draw)
            chosen = draws.resampled(rng, n_draw, largest=math.sqrt(n_draw))
            proposal = Independence.fitted(draws.z[chosen], k, rng)
        draws = weighted(log_target, proposal, rng, n_draw)
        finite = np.isfinite(draws.log_density)
        share = draws.relative[finite] / draws.relative[finite].sum()
        log_likelihood = model.log_likelihood(model.to_theta(draws.z[finite]))
        mean = float(share @ log_likelihood)
        slope = _POWER * t ** (_POWER - 1) * width
        means[i], n_effective[i] = slope * mean, 1 / float(share @ share)
        value += slope * mean
        variance += slope**2 * float((share**2) @ (log_likelihood - mean) ** 2)
    # Of a parabola through three neighbours the midpoint rule misses 1/24 of the second difference.
    rule = float(np.abs(np.diff(means, 2)).sum()) / 24 if n_temperature > 2 else math.inf
    status = "ok"
    if not rule <= _RULE_MAX:
        status = f"{n_temperature} temperatures are too few: the rule may err by {rule:.2g}"
    elif n_effective.min() < _N_EFFECTIVE_MIN:
        status = (
            f"a temperature has {n_effective.min():.0f} effective draws, below {_N_EFFECTIVE_MIN}"
        )
    return LogEvidence("thermodynamic", value, math.sqrt(variance + rule**2), status)
