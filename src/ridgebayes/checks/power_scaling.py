r"""Sensitivity of a posterior to its prior and its likelihood, by power scaling.

The prior or the likelihood is raised to a power alpha near 1, by giving the posterior's draws the
weights ``density^(alpha - 1)``. The sensitivity of a parameter is the distance that its
distribution moves per doubling of alpha. No model is fitted again.
"""

import math

import numpy as np
import pandas as pd
from scipy import special

from ridgebayes._types import FloatArray
from ridgebayes.inference.pareto_smoothing import pareto_smoothed
from ridgebayes.inference.posterior import Posterior

COLUMNS = ["parameter", "prior", "likelihood", "diagnosis"]
THRESHOLD = 0.05  # sensitivity of a normal distribution whose mean moves by about 0.1 sd
CONFLICT = "prior-data conflict"
STRONG_PRIOR = "strong prior or weak likelihood"
_ALPHA_STEP = 0.01  # alpha is 1.01 and 1/1.01


def power_scaling(fit: Posterior) -> pd.DataFrame:
    """Return the sensitivity of each parameter to all priors and to the likelihood.

    Parameters
    ----------
    fit : Posterior
        Posterior.

    Returns
    -------
    pandas.DataFrame
        Columns parameter, prior, likelihood, diagnosis. The diagnosis is ``prior-data conflict``
        if both sensitivities are 0.05 or more, ``strong prior or weak likelihood`` if only that to
        the prior is, else empty.

    Notes
    -----
    Prior densities are those of the parameters. A half-normal density to the power alpha is
    half-normal with a standard deviation smaller by sqrt(alpha). Shared offsets and log K are
    integrated out of the likelihood, with an unbiased estimate if there is no closed form. The
    diagnoses ask for a closer look: an informative prior that is intended causes them too.

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
    """Return how far distributions move per doubling of the power of a density, near power 1.

    Parameters
    ----------
    draws : ndarray of float, shape (n_draw, n_parameter), any unit
        Draws.
    log_component : ndarray of float, shape (n_draw,)
        Log density of the prior or of the rows at the draws.

    Returns
    -------
    ndarray of float, shape (n_parameter,), dimensionless
        Cumulative Jensen-Shannon distance over abs(log2 alpha), averaged over alpha = 1.01, 1/1.01.
    """
    total = np.zeros(draws.shape[1])
    for alpha in (1 + _ALPHA_STEP, 1 / (1 + _ALPHA_STEP)):
        log_weight, _ = pareto_smoothed((alpha - 1) * log_component)
        weight = np.exp(log_weight)
        # The distance is not symmetric in the sign of x: the larger value is used.
        moved = [max(cumulative_distance(sign * x, weight) for sign in (1, -1)) for x in draws.T]
        total += np.array(moved) / abs(math.log2(alpha))
    return total / 2


def cumulative_distance(x: FloatArray, weight: FloatArray) -> float:
    r"""Return the cumulative Jensen-Shannon distance between draws and the same draws weighted.

    Parameters
    ----------
    x : ndarray of float, shape (n,), any unit
        Draws.
    weight : ndarray of float, shape (n,), dimensionless
        Weights, with sum 1.

    Returns
    -------
    float
        Distance, between 0 and 1.

    Notes
    -----
    With distribution functions P and Q and their mean M, the distance is the square root of

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
    # P/M = 1 + (P - Q)/(P + Q) avoids cancellation in the logarithm when P is close to Q.
    ahead = (p - q) / (p + q)
    change = p * np.log1p(ahead) + special.xlog1py(q, -ahead)  # the first q may round to 0
    return math.sqrt(max(float(width @ change) / math.log(2) / total, 0.0))
