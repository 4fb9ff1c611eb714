"""How far evidences depend on the priors' scales."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes.errors import ComputationError
from ridgebayes.evidence import power_law_evidence, quadrature_evidence
from ridgebayes.inference.diagnostics import K_MAX, pareto_k
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms import PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.priors import Prior

# A prior's scale by the name a reader knows it under, and the parameters it belongs to.
PRIOR_SCALES = {"c": ("c", "c1"), "c2": ("c2",), "K": ("K[",), "sigma": ("sigma",)}
SENSITIVITY_COLUMNS = ["prior", "factor", "form", "log_evidence"]
SCALE_FACTORS = tuple(10.0 ** (k / 4) for k in range(-4, 5))


def prior_sensitivity(
    fits: Mapping[str, Posterior],
    factors: Sequence[float] = SCALE_FACTORS,
    *,
    log_evidence: Mapping[str, float] | None = None,
) -> pd.DataFrame:
    """Return log evidences as each prior scale is stretched and shrunk.

    Parameters
    ----------
    fits : mapping of str to Posterior
        By form name.
    factors : sequence of float, optional
        Multiples of the default scale; a factor of 100 in all if not given.
    log_evidence : mapping of str to float, optional
        Evidences under the default priors, where deterministic methods have none.

    Returns
    -------
    pandas.DataFrame
        Columns prior (c, c2, K, sigma), factor, form, log_evidence. Independent normal rows are
        integrated anew; otherwise the posterior's draws are weighted by new over old prior, and
        the evidence is NaN where too few of them count (Pareto k above 0.7).
    """
    rows = []
    known = log_evidence or {}
    unchanged = {
        name: _deterministic_evidence(fit.model)
        if fit.model.is_iid_gaussian
        else known.get(name, math.nan)
        for name, fit in fits.items()
    }
    for scale, starts in PRIOR_SCALES.items():
        for name, fit in fits.items():
            mine = {
                p: prior
                for p, prior in fit.model.priors.items()
                if p in starts or (scale == "K" and p.startswith("K["))
            }
            for factor in factors:
                value = unchanged[name]
                if mine and factor != 1:
                    stretched = {p: prior.stretched(factor) for p, prior in mine.items()}
                    if fit.model.is_iid_gaussian:
                        value = _deterministic_evidence(fit.model.with_priors(stretched))
                    else:
                        value = unchanged[name] + _log_ratio(fit, stretched)
                rows.append({"prior": scale, "factor": factor, "form": name, "log_evidence": value})
    return pd.DataFrame(rows, columns=SENSITIVITY_COLUMNS)


def _log_ratio(fit: Posterior, priors: Mapping[str, Prior]) -> float:
    """Return log of new over old evidence: the mean over the posterior of new over old prior."""
    names = fit.model.parameter_names
    log_weight = np.zeros(len(fit.draws))
    for name, prior in priors.items():
        values = fit.draws[:, names.index(name)]
        log_weight += prior.log_pdf(values) - fit.model.priors[name].log_pdf(values)
    if not pareto_k(log_weight) <= K_MAX:
        return math.nan
    return float(logsumexp(log_weight)) - math.log(len(log_weight))


def _deterministic_evidence(model: Model) -> float:
    if isinstance(model.form, PowerLaw):
        return power_law_evidence(model).value
    try:
        laplace = fit_laplace(model)
    except ComputationError:
        return math.nan
    return quadrature_evidence(model.log_density, laplace, tol=1e-3, points_max=1_000_000).value
