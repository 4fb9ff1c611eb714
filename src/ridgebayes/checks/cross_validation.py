"""Cross-validation: scores of what is left out, predicted from all the rest."""

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, Rng
from ridgebayes.checks.folds import Fold, clustered_se, folds_of, row_crps
from ridgebayes.errors import ComputationError
from ridgebayes.inference.diagnostics import stacking_weights
from ridgebayes.inference.importance import Effort
from ridgebayes.inference.presets import STANDARD
from ridgebayes.model.forms import Form
from ridgebayes.model.noise import Noise, as_noise
from ridgebayes.model.observations import Observations, refuse_circular
from ridgebayes.model.prior_files import ResolvedPriors
from ridgebayes.results import Fit
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.runtime.randomness import seed_of, stream
from ridgebayes.table.table import ContactTable

FOLD_COLUMNS = ["fold", "n_row", "log_score", "log_score_se", "method", "status"]
LEFT_OUT_COLUMNS = ["form", "noise", "leave", "n_fold", "log_score", "log_score_se", "mean_crps"]
LEFT_OUT_COLUMNS += ["stacking_weight", "failed"]


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Scores of predictions of folds left out.

    Parameters
    ----------
    form : str
        Name of the contact form.
    noise : Noise
        Error model.
    folds : pandas.DataFrame
        Columns fold, n_row, log_score, log_score_se, method, status. `log_score` is the joint
        predictive density of the fold's rows, `log_score_se` its Monte Carlo error. `method`:
        ``weights``, the mean density over weighted draws given all rows; ``evidences``, the log
        evidence of all rows less that of the rest, where too few of these draws count. `status`:
        ``ok`` or what the fold's posterior lacks.
    crps : ndarray of float, shape (n_obs,), dimensionless
        CRPS of log(p/E) of each row, in the table's order; NaN in brackets, in counts, and in folds
        that failed.
    failures : dict of str to str
        Folds that could not be computed, and why.

    Notes
    -----
    Totals are NaN where a fold failed: sums over different rows cannot be compared.
    """

    form: str
    noise: Noise
    folds: pd.DataFrame
    crps: FloatArray
    failures: dict[str, str]

    @property
    def elpd(self) -> float:
        """Sum over the folds of their joint log score."""
        return float(self.folds["log_score"].sum(skipna=False))

    @property
    def elpd_se(self) -> float:
        """Standard error of `elpd`, of which folds are the independent units."""
        return clustered_se(self.folds["log_score"].to_numpy(), self.folds["n_row"].to_numpy(float))

    @property
    def mean_crps(self) -> float:
        """Mean CRPS of the exact rows, in log(p/E): 0.03 is 3 % in load."""
        exact = self.crps[~np.isnan(self.crps)]
        return math.nan if self.failures or not len(exact) else float(exact.mean())


def cross_validate(
    table: ContactTable,
    form: Form | Fit,
    *,
    noise: str | Noise = "iid",
    leave: str = "texture",
    rng: Rng = 0,
    executor: Executor | None = None,
    effort: Effort = STANDARD.effort,
    priors: ResolvedPriors | None = None,
) -> CrossValidation:
    """Predict each texture (or count, series, row) from all others; of many a tenth at a time.

    Parameters
    ----------
    table : ContactTable
        Rows of role calibration and status ok are used.
    form : Form or Fit
        Contact form; or its fit to all rows under the same priors, whose draws serve then.
    noise : str or Noise, optional
        Error model.
    leave : str, optional
        Rows that a fold leaves out: ``texture``, ``step`` (all rows of a count Q), ``series``
        or ``row``.
    rng : int or numpy.random.Generator, optional
        Seed; each fold has a stream of its own name.
    executor : concurrent.futures.Executor, optional
        Executor of the folds; one after another if not given. The result is the same.
    effort : Effort, optional
        Draws of each posterior.
    priors : mapping of str to mapping of str to Distribution, optional
        Replacements for default priors: by form name, or ``noise``, and parameter name.

    Returns
    -------
    CrossValidation
        Scores; a fold whose posterior cannot be drawn from is in its `failures`.

    Raises
    ------
    InputError
        If no row can be fitted, there would be one fold only, `leave` is none of the four, or the
        form would be fitted to rows that its own equation made.

    Notes
    -----
    *Accuracy.* Nothing is approximated but by Monte Carlo; see `inference.left_out`.
    *Cost.* Some hundredths of a CPU second per fold by weights, up to a second per fold that is
    drawn again.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> from ridgebayes.table.datafiles import CALCULIX_FE, data_path
    >>> table = rb.read_table(data_path(CALCULIX_FE))
    >>> done = cross_validate(table, rb.Modified(), leave="texture", rng=1)
    >>> len(done.folds), bool(done.elpd_se > done.folds["log_score_se"].max())
    (2, True)
    """
    refuse_circular(table, form.form if isinstance(form, Fit) else form)
    data, error_model, seed = Observations.from_table(table), as_noise(noise), seed_of(rng)
    folds = folds_of(data, form, error_model, leave=leave, seed=seed, effort=effort, priors=priors)
    found = list(map_ordered(_score_fold, folds, executor, name=lambda fold: fold.full_name))
    crps = np.full(len(data), np.nan)
    for fold, (own, _) in zip(folds, found, strict=True):
        crps[fold.left] = own
    frame = pd.DataFrame([record for _, record in found], columns=FOLD_COLUMNS)
    failed = frame[frame["method"] == "none"]
    failures = dict(zip(failed["fold"], failed["status"], strict=True))
    return CrossValidation(folds[0].known.model.form.name, error_model, frame, crps, failures)


def _score_fold(fold: Fold) -> tuple[FloatArray, tuple[object, ...]]:
    """Return the CRPS of a fold's rows, and `FOLD_COLUMNS`."""
    n = int(fold.left.sum())
    try:
        found = fold.found()
    except ComputationError as error:
        return np.full(n, np.nan), (fold.name, n, np.nan, np.nan, "none", str(error))
    crps = row_crps(found.posterior(fold.seed), fold.rows, stream(fold.seed, "draws of a CRPS"))
    score = found.log_score, found.log_score_se
    return crps, (fold.name, n, *score, found.method, found.status)


def left_out_scores(
    table: ContactTable,
    forms: Sequence[Form | Fit],
    noise: str | Noise = "iid",
    *,
    leaves: Sequence[str] = ("texture", "step"),
    rng: Rng = 0,
    executor: Executor | None = None,
    effort: Effort = STANDARD.effort,
    priors: ResolvedPriors | None = None,
) -> pd.DataFrame:
    """Score each form on textures, and on steps, that it is not fitted to.

    Parameters
    ----------
    table : ContactTable
        Rows of role calibration and status ok are used.
    forms : sequence of Form or Fit
        Contact forms, or their fits: see `cross_validate`.
    noise : str or Noise, optional
        Error model of all.
    leaves : sequence of str, optional
        Kinds of rows to leave out in turn, see `cross_validate`. A kind has no scores where the
        table has a single fold of it.
    rng, executor, effort, priors : optional
        As for `cross_validate`.

    Returns
    -------
    pandas.DataFrame
        Columns form, noise, leave, n_fold, log_score (of all folds, each its rows jointly),
        log_score_se, mean_crps (of log p/E), stacking_weight, failed (folds that could not be
        fitted, and why: such a form has no scores).

    Raises
    ------
    InputError
        As `cross_validate` does.
    """
    data = Observations.from_table(table)
    n_fold = {"texture": len(data.textures), "step": len(np.unique(data.Q))}
    n_fold |= {"series": data.n_series, "row": len(data)}
    rows = []
    how: dict[str, Any]
    for leave in leaves:
        if n_fold.get(leave) == 1:
            continue
        how = {"noise": noise, "leave": leave, "rng": rng, "executor": executor, "effort": effort}
        scored = [cross_validate(table, form, priors=priors, **how) for form in forms]
        weights = stacked({one.form: one for one in scored})
        for one in scored:
            scores = one.elpd, one.elpd_se, one.mean_crps, weights[one.form]
            failed = "; ".join(f"{fold}: {why}" for fold, why in one.failures.items())
            rows.append((one.form, one.noise.name, leave, len(one.folds), *scores, failed))
    return pd.DataFrame(rows, columns=LEFT_OUT_COLUMNS)


def stacked(results: Mapping[str, CrossValidation]) -> dict[str, float]:
    """Return the weights of several models whose mixture predicts left-out folds best.

    Parameters
    ----------
    results : mapping of str to CrossValidation
        By name, of the same folds; those without a total get no weight.

    Returns
    -------
    dict of str to float
        Weights, sum 1; NaN where none has a total.
    """
    sound = {name: found for name, found in results.items() if math.isfinite(found.elpd)}
    if not sound:
        return dict.fromkeys(results, math.nan)
    scores = np.stack([found.folds["log_score"].to_numpy() for found in sound.values()])
    weights = dict(zip(sound, stacking_weights(scores).tolist(), strict=True))
    return {name: weights.get(name, 0.0) for name in results}
