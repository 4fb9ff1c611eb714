"""Two checks of a posterior: a repeat with twice the draws, and a comparison with its priors.

Reporting checklists ask for both: Depaoli and van de Schoot (2017), doi:10.1037/met0000065,
points 3 and 6; Kruschke (2021), doi:10.1038/s41562-021-01177-7, step 6.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.special import ndtr

from ridgebayes.errors import ComputationError
from ridgebayes.inference.importance import at_least, importance_sample
from ridgebayes.inference.posterior import Posterior, posterior_of
from ridgebayes.inference.presets import STANDARD
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.model import MAX_COEFFICIENTS
from ridgebayes.runtime.randomness import stream

OUTER = 0.01  # tail probability of a prior beyond which a posterior mean is remarkable


@dataclass(frozen=True)
class Repeat:
    """A posterior drawn again, independently and with twice the draws.

    Parameters
    ----------
    n_draw : int
        Number of draws of the repeat.
    parameter : str
        Parameter whose mean moved most.
    moved : float
        Distance moved, in posterior standard deviations.
    failed : str
        Reason why the repeat failed or is unreliable; empty if it is reliable.
    """

    n_draw: int
    parameter: str
    moved: float
    failed: str = ""


def repeat_posterior(posterior: Posterior) -> Repeat:
    """Draw from a posterior again, with a new search for modes and twice the number of draws.

    Parameters
    ----------
    posterior : Posterior
        Posterior to check.

    Returns
    -------
    Repeat
        Largest move of a mean. `failed` states a problem, such as a heavy tail of the weights.

    Notes
    -----
    *Cost.* One evaluation of the density for each draw, and the search for modes.
    """
    model, n_draw = posterior.model, 2 * len(posterior.draws)
    seed = int(stream(posterior.seed, "repeat").integers(2**63))
    target, effort = ModelTarget(model, seed), STANDARD.effort
    try:
        first = importance_sample(target, effort, seed)
        drawn = at_least(first, target, n_draw, effort, seed + 1)
    except ComputationError as error:
        return Repeat(n_draw, "", float("nan"), str(error))
    summary, again = posterior.summary, posterior_of(model, drawn, seed).summary
    moved = (np.abs(again["mean"] - summary["mean"]) / summary["sd"]).to_numpy()
    worst, failed = int(moved.argmax()), "" if first.evidence.ok else first.evidence.status
    name = str(summary["parameter"][worst])
    return Repeat(drawn.log_density.size, name, float(moved[worst]), failed)


def is_cheap(posterior: Posterior) -> bool:
    """Return whether a repeat takes seconds: few parameters and a density in closed form."""
    target = ModelTarget(posterior.model)
    return target.is_exact and posterior.model.n_parameter <= MAX_COEFFICIENTS


def against_priors(posterior: Posterior) -> pd.DataFrame:
    """Return the position of each posterior mean in its prior.

    Parameters
    ----------
    posterior : Posterior
        Posterior with the priors of its model.

    Returns
    -------
    pandas.DataFrame
        Columns parameter, prior_median, mean, and prior_below: the prior probability below `mean`.
    """
    rows = []
    for row in posterior.summary.to_dict("records"):
        prior = posterior.model.priors[row["parameter"]]
        below = float(ndtr(prior.score(row["mean"])))
        rows.append((row["parameter"], float(prior.value_at(0.0)), row["mean"], below))
    return pd.DataFrame(rows, columns=["parameter", "prior_median", "mean", "prior_below"])
