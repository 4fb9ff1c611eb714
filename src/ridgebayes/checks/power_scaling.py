r"""How far each posterior depends on its prior and on its rows: both raised to powers near one.

With the prior's or the likelihood's power alpha in place of 1, the posterior's draws get weights
``density^(alpha - 1)``. How far a parameter's distribution moves, per doubling of alpha, is its
sensitivity. No model is fitted again.
"""

import math

import numpy as np
import pandas as pd
from scipy import special

from ridgebayes._types import FloatArray
from ridgebayes.inference.pareto_smoothing import pareto_smoothed
from ridgebayes.inference.posterior import Posterior

COLUMNS = ["parameter", "prior", "likelihood", "diagnosis"]
THRESHOLD = 0.05  # sensitivity that counts; that of a normal's mean moved by 0.1 sd or so
CONFLICT = "prior-data conflict"
STRONG_PRIOR = "strong prior or weak likelihood"
_STEP = 0.01  # alpha is 1.01 and 1/1.01


def power_scaling(fit: Posterior) -> pd.DataFrame:
    """Return the sensitivity of each parameter to all priors and to the likelihood.

    Parameters
    ----------
    fit : Posterior
        Posterior.

    Returns
    -------
    pandas.DataFrame
        Columns parameter, prior, likelihood, diagnosis: ``prior-data conflict`` where both are
        0.05 or more, ``strong prior or weak likelihood`` where the prior alone is, else empty.

    Notes
    -----
    Prior densities are those of the parameters themselves: a half-normal scale with its density to
    the power alpha is one with a standard deviation smaller by sqrt(alpha). Shared offsets and log
    K are integrated out of the likelihood, by an unbiased estimate where there is no closed form.
    The diagnoses are prompts to look, not verdicts: an informative prior that is meant also shows.

    References
    ----------
    Kallioinen et al. (2024), doi:10.1007/s11222-023-10366-5.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> table = power_scaling(rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1))
    >>> table["diagnosis"].tolist()
    ['', '', '']
    """
    model, theta = fit.model, fit.draws
    by_prior = sensitivities(theta, model.log_prior(theta))
    by_likelihood = sensitivities(theta, fit.log_likelihood_of_rows)
    names = model.parameter_names
    frame = pd.DataFrame({"parameter": names, "prior": by_prior, "likelihood": by_likelihood})
    alone = np.where(by_likelihood >= THRESHOLD, CONFLICT, STRONG_PRIOR)
    return frame.assign(diagnosis=np.where(by_prior >= THRESHOLD, alone, ""))


def sensitivities(draws: FloatArray, log_component: FloatArray) -> FloatArray:
    """Return how far distributions move per doubling of a component's power, near power 1.

    Parameters
    ----------
    draws : ndarray of float, shape (n_draw, n_parameter), any unit
        Draws.
    log_component : ndarray of float, shape (n_draw,)
        Log density of the component at them: of a prior, or of the rows.

    Returns
    -------
    ndarray of float, shape (n_parameter,), dimensionless
        Cumulative Jensen-Shannon distance over abs(log2 alpha), mean of alpha = 1.01 and 1/1.01.
    """
    total = np.zeros(draws.shape[1])
    for alpha in (1 + _STEP, 1 / (1 + _STEP)):
        log_weight, _ = pareto_smoothed((alpha - 1) * log_component)
        weight = np.exp(log_weight)
        # The distance is not symmetric: the larger of those of x and of -x counts.
        moved = [max(cumulative_distance(sign * x, weight) for sign in (1, -1)) for x in draws.T]
        total += np.array(moved) / abs(math.log2(alpha))
    return total / 2


def cumulative_distance(x: FloatArray, weight: FloatArray) -> float:
    r"""Return the cumulative Jensen-Shannon distance of draws from the same draws weighted.

    Parameters
    ----------
    x : ndarray of float, shape (n,), any unit
        Draws.
    weight : ndarray of float, shape (n,), dimensionless
        Weights, sum 1.

    Returns
    -------
    float
        From 0 to 1.

    Notes
    -----
    With distribution functions P and Q and M their mean it is the root of

    .. math:: \int (P \log_2 \tfrac{P}{M} + Q \log_2 \tfrac{Q}{M}) dx \big/ \int (P + Q) dx,

    from the smallest to the largest draw.

    References
    ----------
    Nguyen & Vreeken (2015), doi:10.1007/978-3-319-23525-7_11.
    """
    order = np.argsort(x)
    width = np.diff(x[order])
    p = np.arange(1, len(x)) / len(x)
    q = np.cumsum(weight[order])[:-1]
    total = float(width @ (p + q))
    if not total > 0:  # all draws are equal
        return 0.0
    # P/M = 1 + (P - Q)/(P + Q): where P and Q are alike, their logarithms would cancel.
    ahead = (p - q) / (p + q)
    change = p * np.log1p(ahead) + special.xlog1py(q, -ahead)  # the first q may round to 0
    return math.sqrt(max(float(width @ change) / math.log(2) / total, 0.0))
