"""The evidence by thermodynamic integration: a second opinion, dear and less accurate.

ln Z is the integral from 0 to 1 of the mean log-likelihood under the posterior whose likelihood is
raised to the power beta. beta = t^5, since nearly all changes near the prior; the midpoint rule in
t, since under the prior itself, where sigma may vanish, the mean does not exist.
"""

import math

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.adaptation import weighted
from ridgebayes.evidence.record import LogEvidence
from ridgebayes.likelihood import Model
from ridgebayes.moves import Independence
from ridgebayes.randomness import stream

_POWER = 5
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
        Method ``thermodynamic``; the standard error is of the draws alone, not of the rule.

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
        value += slope * mean
        variance += slope**2 * float((share**2) @ (log_likelihood - mean) ** 2)
    return LogEvidence("thermodynamic", value, math.sqrt(variance))
