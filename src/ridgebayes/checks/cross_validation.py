"""Cross-validation by refitting: scores of what is left out, predicted from all the rest."""

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, Rng
from ridgebayes.checks.all_rows import has_exact_likelihood
from ridgebayes.checks.folds import (
    EFFORT,
    Fold,
    clustered_se,
    folds_of,
    row_crps,
)
from ridgebayes.errors import ComputationError
from ridgebayes.evidence import LogEvidence
from ridgebayes.inference.diagnostics import stacking_weights
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise, as_noise
from ridgebayes.model.observations import Observations, refuse_circular
from ridgebayes.model.prior_files import ResolvedPriors
from ridgebayes.results import Fit
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.runtime.randomness import seed_of, stream
from ridgebayes.table.table import ContactTable

FOLD_COLUMNS = ["fold", "n_row", "log_score", "log_score_se", "method", "status"]
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
        ``weights``, the mean density over weighted draws given all rows; ``draws``, over draws of
        a fit without the fold's rows; ``evidences``, the evidence of all rows over that of the
        rest, where no likelihood without the offsets is exact or the form has a coefficient for the
        left-out texture alone. `status`: ``ok`` or what the fold's posterior lacks.
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
    effort: Mapping[str, int] | None = None,
    priors: ResolvedPriors | None = None,
) -> CrossValidation:
    """Predict each texture (or count, or row) from all others; of many a tenth at a time.

    Parameters
    ----------
    table : ContactTable
        Rows of role calibration and status ok are used.
    form : Form or Fit
        Contact form; or its fit to all rows under the same priors: folds are then scored by its
        draws, weighted, and refitted only where too few of these count (under 35 %).
    noise : str or Noise, optional
        Error model.
    leave : str, optional
        What a fold leaves out: ``texture``, ``step`` (all rows of a count Q) or ``row``.
    rng : int or numpy.random.Generator, optional
        Seed; each fold has a stream of its own name.
    executor : concurrent.futures.Executor, optional
        What folds are computed on; one after another if not given. The result is the same.
    effort : mapping of str to int, optional
        Passed on to `importance_posterior`: fewer draws than its own for a first look.
    priors : mapping of str to mapping of str to Distribution, optional
        Replacements for default priors: by form name, or ``noise``, and parameter name.

    Returns
    -------
    CrossValidation
        Scores; a fold whose posterior has no interior mode is in its `failures`.

    Raises
    ------
    InputError
        If no row can be fitted, there would be one fold only, `leave` is none of the three, or the
        form would be fitted to rows that its own equation made.

    Notes
    -----
    *Accuracy.* Nothing is approximated but by Monte Carlo. Joint scores by draws have the standard
    error given beside them; those by evidences about 0.03.
    *Cost.* A tenth to a half CPU second per fold by weights; one `importance_posterior` per fold
    that is fitted anew, 0.5 to 18 CPU seconds.

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
    tasks, known = list(folds), folds[0].known
    total: _Scores | str | None = None
    by_evidences = not all(_by_draws(fold) for fold in folds)
    if by_evidences and known is not None and known.evidence is not None and not known.failures:
        total = _Scores(_NO_CRPS, None, "evidences", known.evidence, "ok")
    elif by_evidences:
        own = int(stream(seed, folds[0].form.name, error_model.name, "all rows").integers(2**63))
        nothing = np.zeros(len(data), dtype=bool)
        tasks.append(replace(folds[0], name="all rows", left=nothing, seed=own))
    found = list(map_ordered(_score_fold, tasks, executor, name=lambda fold: fold.full_name))
    total = found.pop() if len(tasks) > len(folds) else total
    crps = np.full(len(data), np.nan)
    records, failures = [], {}
    for fold, scores in zip(folds, found, strict=True):
        record = {"fold": fold.name, "n_row": int(fold.left.sum())}
        if isinstance(scores, str):
            failures[fold.name] = scores
            records.append(record | {"method": "none", "status": scores})
        else:
            crps[fold.left] = scores.crps
            records.append(record | _joint_score(scores, total))
    frame = pd.DataFrame(records).reindex(columns=FOLD_COLUMNS)
    return CrossValidation(folds[0].form.name, error_model, frame, crps, failures)


def left_out_scores(
    table: ContactTable,
    forms: Sequence[Form | Fit],
    noise: str | Noise = "iid",
    *,
    leaves: Sequence[str] = ("texture", "step"),
    rng: Rng = 0,
    executor: Executor | None = None,
    effort: Mapping[str, int] = EFFORT,
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
        What is left out in turn: ``texture``, ``step``, ``row``. One of which the table has a
        single one has no scores.
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
    n_fold = {"texture": len(data.textures), "step": len(np.unique(data.Q)), "row": len(data)}
    rows = []
    for leave in leaves:
        if n_fold.get(leave) == 1:
            continue
        refitted = partial(
            cross_validate, table, noise=noise, leave=leave, rng=rng, executor=executor
        )
        scored = [refitted(form, effort=effort, priors=priors) for form in forms]
        found = {one.form: one for one in scored}
        weights = stacked(found)
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


def stacked(results: Mapping[str, CrossValidation]) -> dict[str, float]:
    """Return the weights of several models whose mixture predicts left-out folds best.

    Parameters
    ----------
    results : mapping of str to CrossValidation
        By name, of the same folds; those with failures get no weight.

    Returns
    -------
    dict of str to float
        Weights, sum 1; NaN where all have failures.
    """
    sound = {name: found for name, found in results.items() if not found.failures}
    if not sound:
        return dict.fromkeys(results, math.nan)
    scores = np.stack([found.folds["log_score"].to_numpy() for found in sound.values()])
    weights = dict(zip(sound, stacking_weights(scores).tolist(), strict=True))
    return {name: weights.get(name, 0.0) for name in results}


def joint_log_densities(fit: Posterior, data: Observations) -> FloatArray:
    """Return log p(rows that were not fitted | rows that were, parameters) of each draw.

    Parameters
    ----------
    fit : Posterior
        Posterior given some of the rows.
    data : Observations
        All rows.

    Returns
    -------
    ndarray of float, shape (n_draw,)
        What all rows' log-likelihood has over that of the fitted ones, offsets integrated out:
        exact, see `_by_draws`.
    """
    whole = Model(data, fit.form, fit.noise, fit.model.priors)
    return whole.log_likelihood(fit.draws) - fit.model.log_likelihood(fit.draws)


_NO_CRPS = np.empty(0)


@dataclass(frozen=True, eq=False)
class _Scores:
    """What a fold's own process hands back."""

    crps: FloatArray
    joint: tuple[float, float] | None  # with its error
    method: str
    evidence: LogEvidence | None
    status: str


def _by_draws(fold: Fold) -> bool:
    whole = fold.model(fold.data)
    return has_exact_likelihood(whole) and whole.parameter_names == fold.rest.parameter_names


def _score_fold(fold: Fold) -> _Scores | str:
    """Fit a fold and score its rows; the reason where that fails."""
    found = fold.weighted() if fold.left.any() else None
    evidence, joint, method = None, None, "evidences"
    if found is not None:
        fit, method = found.posterior, "weights"
        joint = found.log_score, found.log_score_se
    else:
        try:
            fit, evidence = fold.refit()
        except ComputationError as error:
            return str(error)
        if fold.left.any() and _by_draws(fold):
            joint, method = _log_mean(joint_log_densities(fit, fold.data)), "draws"
    status, crps = (*fit.convergence_failures, "ok")[0], _NO_CRPS
    if fold.left.any():
        rows = fold.data.take(fold.left)
        crps = np.full(len(rows), np.nan)
        if rows.is_exact.any():
            crps = row_crps(fit, rows, stream(fold.seed, "draws of a CRPS"))
    return _Scores(crps, joint, method, evidence, status)


def _log_mean(log_values: FloatArray) -> tuple[float, float]:
    """Return the log of the mean of exponentials and its standard error."""
    top = log_values.max()
    if not np.isfinite(top):
        return -math.inf, math.nan
    values = np.exp(log_values - top)
    return float(top + np.log(values.mean())), float(
        values.std(ddof=1) / (values.mean() * math.sqrt(len(values)))
    )


def _joint_score(scores: _Scores, total: _Scores | str | None) -> dict[str, object]:
    """Return a fold's joint score, its error, how it was found, and what it lacks."""
    if scores.joint is not None:
        value, se = scores.joint
        known = {"log_score": value, "log_score_se": se}
        return known | {"method": scores.method, "status": scores.status}
    if not isinstance(total, _Scores):
        return {"method": "evidences", "status": f"all rows: {total}"}
    assert total.evidence is not None  # both were fitted
    assert scores.evidence is not None
    return {
        "log_score": total.evidence.value - scores.evidence.value,
        "log_score_se": math.hypot(total.evidence.se, scores.evidence.se),
        "method": "evidences",
        "status": scores.status if total.status == "ok" else f"all rows: {total.status}",
    }
