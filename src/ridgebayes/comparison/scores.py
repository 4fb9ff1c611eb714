"""Leave-one-out scores of several fits and their stacking weights as a table."""

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd

from ridgebayes.errors import ComputationError
from ridgebayes.inference.diagnostics import Loo, leave_one_out, stacking_weights
from ridgebayes.inference.left_out import AllRows
from ridgebayes.inference.presets import STANDARD
from ridgebayes.results import Fit
from ridgebayes.runtime.randomness import stream

LOO_COLUMNS = ["form", "noise", "elpd", "se", "p", "n_bad_k", "stacking_weight"]


def loo_table(fits: Mapping[str, Fit]) -> pd.DataFrame:
    """Return elpd, its error, bad Pareto k and the stacking weight of each fit.

    Rows whose weights have a Pareto k above 0.7 are scored by a posterior without them; `n_bad_k`
    counts those that remain: all of them where they are more than 20, and rows without which
    there is no posterior. Such a fit's elpd, se, p and weight are NaN, and the other fits are
    weighed without it. Fits to so many rows that no pointwise log-likelihood is kept are not in
    the table.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> found = loo_table({"hybrid": fit})
    >>> found["n_bad_k"].tolist(), found["stacking_weight"].tolist()
    ([0], [1.0])
    """
    scores = {}
    for name, fit in fits.items():
        rows = fit.rows_log_likelihood()
        if rows is not None:
            scores[name] = _left_out(fit, rows)
    if not scores:
        return pd.DataFrame(columns=LOO_COLUMNS)
    sound = {name: score.pointwise for name, score in scores.items() if score.status == "ok"}
    weights = stacking_weights(np.stack([*sound.values()])) if sound else np.empty(0)
    weight_of = dict(zip(sound, weights.tolist(), strict=True))
    table = []
    for name, score in scores.items():
        sums = (score.elpd, score.se, score.p) if name in sound else (np.nan,) * 3
        cells = (*sums, score.n_bad_k, weight_of.get(name, np.nan))
        table.append((name, fits[name].noise.name, *cells))
    return pd.DataFrame(table, columns=LOO_COLUMNS)


def _left_out(fit: Fit, rows: np.ndarray) -> Loo:
    """Score a fit row by row, given each row's log-likelihood at its draws."""
    # The kept draws are thinned beyond the autocorrelation time where chains are long.
    reff = float(fit.summary["ess_bulk"].min()) / fit.kept_chains.log_density.size
    all_rows = AllRows.of(fit, STANDARD.effort, fit.seed)

    def refitted(row: int) -> float:
        left = np.arange(rows.shape[-1]) == row
        seed = int(stream(fit.seed, f"leave row {row + 1}").integers(2**63))
        try:
            score = all_rows.without(left, seed)
        except ComputationError:
            return math.nan
        return score.log_score if score.status == "ok" else math.nan

    return leave_one_out(rows, min(max(reff, 1e-3), 1.0), refitted)
