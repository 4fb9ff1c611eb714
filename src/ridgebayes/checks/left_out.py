"""Several forms scored side by side on textures and steps left out."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor

import numpy as np
import pandas as pd

from ridgebayes._types import Rng
from ridgebayes.checks.coverage import EFFORT
from ridgebayes.checks.cross_validation import cross_validate, stacked
from ridgebayes.model.forms import Form
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.table.table import ContactTable

LEFT_OUT_COLUMNS = [
    "form",
    "noise",
    "leave",
    "n_fold",
    "log_score",
    "log_score_se",
    "mean_crps",
    "stacking_weight",
    "failed",
]


def left_out_scores(
    table: ContactTable,
    forms: Sequence[Form],
    noise: str | Noise = "iid",
    *,
    leaves: Sequence[str] = ("texture", "step"),
    rng: Rng = 0,
    executor: Executor | None = None,
    effort: Mapping[str, int] = EFFORT,
) -> pd.DataFrame:
    """Score each form on textures, and on steps, that it is refitted without.

    Parameters
    ----------
    table : ContactTable
        Rows of role calibration and status ok are used.
    forms : sequence of Form
        Contact forms.
    noise : str or Noise, optional
        Error model of all.
    leaves : sequence of str, optional
        What is left out in turn: ``texture``, ``step``, ``row``. One of which the table has a
        single one has no scores.
    rng, executor, effort : optional
        As for `ridgebayes.checks.cross_validation.cross_validate`.

    Returns
    -------
    pandas.DataFrame
        Columns form, noise, leave, n_fold, log_score (of all folds, each its rows jointly),
        log_score_se, mean_crps (of log p/E), stacking_weight, failed (folds that could not be
        fitted, and why: such a form has no scores).

    Raises
    ------
    InputError
        As `ridgebayes.checks.cross_validation.cross_validate` does.
    """
    data = Observations.from_table(table)
    n_fold = {"texture": len(data.textures), "step": len(np.unique(data.Q)), "row": len(data)}
    rows = []
    for leave in leaves:
        if n_fold.get(leave) == 1:
            continue
        found = {
            form.name: cross_validate(
                table, form, noise=noise, leave=leave, rng=rng, executor=executor, effort=effort
            )
            for form in forms
        }
        sound = any(not one.failures for one in found.values())
        weights = stacked(found) if sound else dict.fromkeys(found, np.nan)
        rows += [
            [
                name,
                one.noise.name,
                leave,
                len(one.folds),
                one.elpd,
                one.elpd_se,
                one.mean_crps,
                weights[name],
                "; ".join(f"{fold}: {why}" for fold, why in one.failures.items()),
            ]
            for name, one in found.items()
        ]
    return pd.DataFrame(rows, columns=LEFT_OUT_COLUMNS)
