"""A posterior checked twice: drawn again with twice the draws, and held against its priors.

Both are asked for by reporting checklists: Depaoli and van de Schoot (2017),
doi:10.1037/met0000065, points 3 and 6; Kruschke (2021), doi:10.1038/s41562-021-01177-7, step 6.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.special import ndtr

from ridgebayes.errors import ComputationError
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.moves import Independence, weighted
from ridgebayes.inference.pareto_smoothing import K_MAX, pareto_k
from ridgebayes.inference.posterior import Posterior
from ridgebayes.runtime.randomness import stream

OUTER = 0.01  # share of a prior on either side beyond which a posterior mean is out of place
_MOST_PARAMETERS = 20


@dataclass(frozen=True)
class Repeat:
    """A posterior drawn again, independently and with twice the draws.

    Parameters
    ----------
    n_draw : int
        Draws of the repeat.
    parameter : str
        The parameter whose mean moved most.
    moved : float
        By how much, in posterior standard deviations.
    failed : str
        Why there is no repeat to rely on; empty if there is one.
    """

    n_draw: int
    parameter: str
    moved: float
    failed: str = ""


def repeat_posterior(posterior: Posterior) -> Repeat:
    """Estimate a posterior's means again by importance sampling, with twice its kept draws.

    Parameters
    ----------
    posterior : Posterior
        What is checked; not one whose offsets are sampled.

    Returns
    -------
    Repeat
        How far the means moved. `failed` tells of weights with too heavy a tail.

    Notes
    -----
    The proposal is fitted to the kept draws: what they miss of the posterior shows in the tail of
    the weights, not a mode far from all of them.

    *Cost.* One density a draw.
    """
    model, n_draw = posterior.model, 2 * len(posterior.draws)
    names, means, sds = (posterior.summary[c].to_numpy() for c in ("parameter", "mean", "sd"))
    rng = stream(posterior.seed, "repeat")
    try:
        laplace = fit_laplace(model, near=means)
    except ComputationError as error:
        return Repeat(n_draw, "", float("nan"), str(error))
    known, _ = laplace.whiten(posterior.coordinates)
    proposal = Independence.fitted(known, laplace.n_curved, rng)
    again = weighted(laplace.whitened(model.log_density), proposal, rng, n_draw)
    theta = model.to_theta(laplace.unwhiten(again.z)[0])
    moved = np.abs(np.average(theta, axis=0, weights=again.relative) - means) / sds
    worst, shape = int(moved.argmax()), pareto_k(again.log_weight)
    failed = f"importance weights: Pareto k {shape:.2f}, above {K_MAX}" if shape > K_MAX else ""
    return Repeat(n_draw, names[worst], float(moved[worst]), failed)


def is_cheap(posterior: Posterior) -> bool:
    """Return whether a repeat takes seconds: few parameters, and no offsets to be sampled over."""
    return not posterior.model.is_latent and posterior.model.n_parameter <= _MOST_PARAMETERS


def against_priors(posterior: Posterior) -> pd.DataFrame:
    """Return where in its prior each posterior mean lies.

    Parameters
    ----------
    posterior : Posterior
        With the priors of its model.

    Returns
    -------
    pandas.DataFrame
        Columns parameter, prior_median, mean, prior_below: the share of the prior below the mean.
    """
    rows = []
    for row in posterior.summary.to_dict("records"):
        prior = posterior.model.priors[row["parameter"]]
        below = float(ndtr(prior.score(row["mean"])))
        rows.append((row["parameter"], float(prior.value_at(0.0)), row["mean"], below))
    return pd.DataFrame(rows, columns=["parameter", "prior_median", "mean", "prior_below"])
