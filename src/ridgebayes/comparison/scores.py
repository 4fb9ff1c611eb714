"""Table of leave-one-out scores and stacking weights of several fits."""

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd

from ridgebayes.errors import ComputationError
from ridgebayes.inference.diagnostics import Loo, leave_one_out, stacking_weights
from ridgebayes.inference.left_out import AllRows
from ridgebayes.inference.posterior import Posterior
from ridgebayes.inference.presets import STANDARD
from ridgebayes.runtime.randomness import stream

LOO_COLUMNS = ["form", "noise", "elpd", "se", "p", "n_bad_k", "stacking_weight"]


def loo_table(fits: Mapping[str, Posterior]) -> pd.DataFrame:
    """Return elpd, its standard error, number of bad Pareto k and stacking weight of each fit.

    A row with a Pareto k above 0.5 is scored by a posterior fitted without it, at most 20 rows with
    the largest k. `n_bad_k` counts the rows with a k above 0.7 for which this is not done: all of
    them if there are more than 20, and rows without which the posterior cannot be fitted. The elpd,
    se, p and weight of such a fit are NaN, and the other fits are stacked without it. Fits with too
    many rows for a stored pointwise log-likelihood are left out of the table.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> loo = loo_table({"hybrid": fit})
    >>> loo["n_bad_k"].tolist(), loo["stacking_weight"].tolist()
    ([0], [1.0])
    """
    scores = {
        name: _score(fit, rows)
        for name, fit in fits.items()
        if (rows := fit.rows_log_likelihood()) is not None
    }
    sound = {name: score.pointwise for name, score in scores.items() if score.status == "ok"}
    weights = stacking_weights(np.stack([*sound.values()])) if sound else np.empty(0)
    weight_of = dict(zip(sound, weights.tolist(), strict=True))
    table = []
    for name, score in scores.items():
        sums = (score.elpd, score.se, score.p) if name in sound else (np.nan,) * 3
        cells = (*sums, score.n_bad_k, weight_of.get(name, np.nan))
        table.append((name, fits[name].noise.name, *cells))
    return pd.DataFrame(table, columns=LOO_COLUMNS)


def _score(fit: Posterior, rows: np.ndarray) -> Loo:
    """Return the leave-one-out score of a fit, given the log-likelihood of rows at its draws."""
    # Draws of long chains are thinned beyond the autocorrelation time.
    reff = float(fit.summary["ess_bulk"].min()) / fit.kept_chains.log_density.size
    all_rows = AllRows.of(fit, STANDARD.effort, fit.seed)

    def refitted(row: int) -> float:
        is_left_out = np.arange(rows.shape[-1]) == row
        seed = int(stream(fit.seed, f"leave row {row + 1}").integers(2**63))
        try:
            score = all_rows.without(is_left_out, seed)
        except ComputationError:
            return math.nan
        return score.log_score if score.status == "ok" else math.nan

    return leave_one_out(rows, min(max(reff, 1e-3), 1.0), refitted)
