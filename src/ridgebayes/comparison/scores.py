"""Leave-one-out scores of several fits and their stacking weights as a table."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from ridgebayes.inference.diagnostics import leave_one_out, stacking_weights
from ridgebayes.inference.netcdf import groups_of
from ridgebayes.results import Fit

LOO_COLUMNS = ["form", "noise", "elpd", "se", "p", "n_bad_k", "stacking_weight"]


def loo_table(fits: Mapping[str, Fit]) -> pd.DataFrame:
    """Return elpd, its error, bad Pareto k and the stacking weight of each fit.

    Fits to so many rows that no pointwise log-likelihood is kept are not in it.
    """
    scores = {}
    for name, fit in fits.items():
        groups = groups_of(fit)
        if "log_likelihood" in groups:
            # The kept draws are thinned beyond the autocorrelation time where chains are long.
            reff = float(fit.summary["ess_bulk"].min()) / fit.kept_chains.log_density.size
            scores[name] = leave_one_out(groups, min(max(reff, 1e-3), 1.0))
    if not scores:
        return pd.DataFrame(columns=LOO_COLUMNS)
    weights = stacking_weights(np.stack([score.pointwise for score in scores.values()]))
    return pd.DataFrame(
        [
            {
                "form": name,
                "noise": fits[name].noise.name,
                "elpd": score.elpd,
                "se": score.se,
                "p": score.p,
                "n_bad_k": score.n_bad_k,
                "stacking_weight": weight,
            }
            for (name, score), weight in zip(scores.items(), weights, strict=True)
        ]
    )
