"""Evidence by nested sampling with dynesty: a check that shares as little as it can with the rest.

Bridge, importance sampling and quadrature all integrate over coordinates that this package made:
whitened parameters, and offsets relative to what the rows tell of them. A wrong Jacobian would be
wrong in all three alike. Here nothing is whitened. Parameters are drawn from their priors, shared
offsets are L(theta) times standard normal scores, and rows have their likelihood one by one.
"""

import math
import warnings

import numpy as np
from scipy.special import ndtri

from ridgebayes._types import FloatArray
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.model.model import Model
from ridgebayes.runtime.reading import extra

_REMAINING = 0.05  # log evidence that the live points may still hold when sampling ends
_WALKED = 6  # coordinates from which on random walks are cheaper than draws within ellipsoids


def nested_evidence(
    model: Model,
    *,
    rng: np.random.Generator,
    n_live: int = 500,
    n_call_max: int = 5_000_000,
) -> LogEvidence:
    """Estimate the log evidence by nested sampling, from the prior inwards.

    Parameters
    ----------
    model : Model
        Posterior.
    rng : numpy.random.Generator
        For all draws.
    n_live : int, optional
        Live points: the standard error falls as one over their square root.
    n_call_max : int, optional
        Likelihood calls after which the run is given up.

    Returns
    -------
    LogEvidence
        Method ``dynesty``. The status is not ok, and the value NaN, where `n_call_max` calls were
        not enough.

    Raises
    ------
    InputError
        If dynesty is not installed.

    Notes
    -----
    *Accuracy.* The standard error is dynesty's own: of the volumes, sqrt(information / n_live). It
    does not know of random walks too short to forget where they began; more live points do not
    help against that.
    *Validity.* Priors are reached through a unit cube, which ends 8.2 standard deviations from a
    prior's centre at the upper end: what the posterior holds beyond is lost.
    *Cost.* One likelihood call at a time, some 0.1 to 0.2 ms: ten seconds for three coordinates,
    minutes for ten, an hour for forty.

    References
    ----------
    Skilling (2006), doi:10.1214/06-BA127; Speagle (2020), doi:10.1093/mnras/staa278.
    """
    dynesty = extra("dynesty", "dynesty", "nested sampling needs dynesty")
    n = model.n_coordinate

    def log_likelihood(u: FloatArray) -> float:
        # A priori all coordinates are standard normals, scores of drawn offsets too.
        return float(model.log_density(u) + 0.5 * (u * u + math.log(2 * math.pi)).sum())

    # Scores times an unknown scale lie along curved ridges, which no ellipsoid fits.
    walked = model.is_latent or n >= _WALKED
    sampler = dynesty.NestedSampler(
        log_likelihood,
        ndtri,
        n,
        nlive=n_live,
        sample="rwalk" if walked else "unif",
        walks=20 + 2 * n if walked else None,
        rstate=rng,
    )
    with np.errstate(all="ignore"), warnings.catch_warnings():
        # What it says of runs cut short is said by the status.
        warnings.simplefilter("ignore")
        sampler.run_nested(dlogz=_REMAINING, maxcall=n_call_max, print_progress=False)
    found = sampler.results
    # Those of the points that were replaced: the loop ends beyond either limit.
    if found.ncall[: found.niter].sum() > n_call_max:
        return LogEvidence(
            "dynesty", math.nan, math.nan, f"not finished after {n_call_max} likelihood calls"
        )
    return LogEvidence("dynesty", float(found.logz[-1]), float(found.logzerr[-1]))
