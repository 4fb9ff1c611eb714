"""How far evidences depend on the priors' scales."""

import math
from collections.abc import Mapping, Sequence

import pandas as pd

from ridgebayes.errors import ComputationError
from ridgebayes.evidence import power_law_evidence, quadrature_evidence
from ridgebayes.fit import Fit
from ridgebayes.forms import PowerLaw
from ridgebayes.laplace import fit_laplace
from ridgebayes.likelihood import Model

# A prior's scale by the name a reader knows it under, and the parameters it belongs to.
PRIOR_SCALES = {"c": ("c", "c1"), "c2": ("c2",), "K": ("K[",), "sigma": ("sigma",)}
SENSITIVITY_COLUMNS = ["prior", "factor", "form", "log_evidence"]
SCALE_FACTORS = tuple(10.0 ** (k / 4) for k in range(-4, 5))


def prior_sensitivity(
    fits: Mapping[str, Fit], factors: Sequence[float] = SCALE_FACTORS
) -> pd.DataFrame:
    """Return log evidences as each prior scale is stretched and shrunk.

    Parameters
    ----------
    fits : mapping of str to Fit
        By form name.
    factors : sequence of float, optional
        Multiples of the default scale; a factor of 100 in all if not given.

    Returns
    -------
    pandas.DataFrame
        Columns prior (c, c2, K, sigma), factor, form, log_evidence; deterministic methods only.
    """
    rows = []
    unchanged = {name: _deterministic_evidence(fit.model) for name, fit in fits.items()}
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
                    value = _deterministic_evidence(fit.model.with_priors(stretched))
                rows.append({"prior": scale, "factor": factor, "form": name, "log_evidence": value})
    return pd.DataFrame(rows, columns=SENSITIVITY_COLUMNS)


def _deterministic_evidence(model: Model) -> float:
    if isinstance(model.form, PowerLaw):
        return power_law_evidence(model).value
    try:
        laplace = fit_laplace(model)
    except ComputationError:
        return math.nan
    return quadrature_evidence(model.log_density, laplace, tol=1e-3, points_max=1_000_000).value
