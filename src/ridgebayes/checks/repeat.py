"""A posterior checked twice: drawn again with twice the draws, and held against its priors.

Both are asked for by reporting checklists: Depaoli and van de Schoot (2017),
doi:10.1037/met0000065, points 3 and 6; Kruschke (2021), doi:10.1038/s41562-021-01177-7, step 6.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from ridgebayes.errors import ComputationError
from ridgebayes.inference.importance_sampling import N_REPEAT, importance_posterior
from ridgebayes.inference.posterior import Posterior
from ridgebayes.runtime.randomness import stream

OUTER = 0.01  # share of a prior on either side beyond which a posterior mean is out of place
_CHEAP = {"n_round": 3, "n_per_round": 512, "n_point": 32}
_MOST_PARAMETERS = 20
_N_PRIOR = 10_000
_PER_STEP = 128  # importance draws come in multiples of it


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
    """Draw a posterior again by importance sampling, with twice its kept draws and another seed.

    Parameters
    ----------
    posterior : Posterior
        What is checked.

    Returns
    -------
    Repeat
        How far the means moved. `failed` tells of weights with too heavy a tail.
    """
    n_each = -(-2 * len(posterior.draws) // (N_REPEAT * _PER_STEP)) * _PER_STEP
    n_draw = N_REPEAT * n_each
    try:
        again, _ = importance_posterior(
            posterior.model, seed=posterior.seed + 1, n_draw=n_each, **_CHEAP
        )
    except ComputationError as error:
        return Repeat(n_draw, "", float("nan"), str(error))
    means, sds = (posterior.summary[name].to_numpy() for name in ("mean", "sd"))
    moved = np.abs(again.summary["mean"].to_numpy() - means) / sds
    worst = int(moved.argmax())
    failed = "; ".join(why for why in again.convergence_failures if "Pareto" in why)
    return Repeat(n_draw, posterior.model.parameter_names[worst], float(moved[worst]), failed)


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
    rng = stream(posterior.seed, "against priors")
    rows = []
    for row in posterior.summary.to_dict("records"):
        draws = posterior.model.priors[row["parameter"]].rvs(rng, _N_PRIOR)
        below = float((draws < row["mean"]).mean())
        rows.append((row["parameter"], float(np.median(draws)), row["mean"], below))
    return pd.DataFrame(rows, columns=["parameter", "prior_median", "mean", "prior_below"])
