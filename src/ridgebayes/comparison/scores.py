"""Leave-one-out scores of several fits and their stacking weights as a table."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from ridgebayes.inference.diagnostics import leave_one_out, stacking_weights
from ridgebayes.results import Fit

LOO_COLUMNS = ["form", "noise", "elpd", "se", "p", "n_bad_k", "stacking_weight"]


def loo_table(fits: Mapping[str, Fit]) -> pd.DataFrame:
    """Return elpd, its error, bad Pareto k and the stacking weight of each fit.

    Fits to so many rows that no pointwise log-likelihood is kept are not in it. Where more than a
    fifth of the rows have a Pareto k above 0.7, elpd, se, p and weight are NaN, `n_bad_k` says why,
    and the other fits are weighed without it: refitting would take a posterior for each row.
    """
    scores = {}
    for name, fit in fits.items():
        rows = fit.rows_log_likelihood()
        if rows is not None:
            # The kept draws are thinned beyond the autocorrelation time where chains are long.
            reff = float(fit.summary["ess_bulk"].min()) / fit.kept_chains.log_density.size
            scores[name] = leave_one_out(rows, min(max(reff, 1e-3), 1.0))
    if not scores:
        return pd.DataFrame(columns=LOO_COLUMNS)
    sound = {name: score.pointwise for name, score in scores.items() if score.status == "ok"}
    weights = stacking_weights(np.stack([*sound.values()])) if sound else np.empty(0)
    weight_of = dict(zip(sound, weights, strict=True))
    frame = pd.DataFrame(
        [
            (name, fits[name].noise.name, score.elpd, score.se, score.p, score.n_bad_k, np.nan)
            for name, score in scores.items()
        ],
        columns=LOO_COLUMNS,
    )
    frame["stacking_weight"] = frame["form"].map(weight_of).astype(float)
    frame.loc[frame["stacking_weight"].isna(), ["elpd", "se", "p"]] = np.nan
    return frame
