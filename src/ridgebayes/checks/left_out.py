"""Cross-validation: posteriors without some rows, and scores of the predictions of these rows.

With many textures, counts or rows, each fold leaves out a random tenth of them.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, FloatArray, IntArray, Rng
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.inference.chains import N_KEPT
from ridgebayes.inference.diagnostics import stacking_weights
from ridgebayes.inference.importance import Effort
from ridgebayes.inference.left_out import AllRows, LeftOut
from ridgebayes.inference.posterior import Posterior
from ridgebayes.inference.presets import STANDARD
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise, as_noise
from ridgebayes.model.observations import Observations, refuse_circular
from ridgebayes.model.prior_files import ResolvedPriors, priors_of
from ridgebayes.predict.load_distribution import LoadDistribution
from ridgebayes.predict.load_draws import MAX_DRAWS_TIMES_ROWS
from ridgebayes.predict.predict import load_places, predict_load
from ridgebayes.results import Fit
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.runtime.randomness import seed_of, stream
from ridgebayes.table.table import ContactTable

LEFT_OUT_COLUMNS = ["form", "noise", "leave", "n_fold", "log_score", "log_score_se", "mean_crps"]
LEFT_OUT_COLUMNS += ["stacking_weight", "failed"]
# Each fold costs a posterior for every form. Above these numbers ten folds of a tenth each suffice.
_MAX_FOLDS = dict.fromkeys(("texture", "step", "series"), 24) | {"row": 50}
_N_GROUPS = 10
_T = TypeVar("_T")


@dataclass(frozen=True, eq=False)
class Fold:
    """Left-out rows and the information needed to predict them in a separate process.

    Parameters
    ----------
    name : str
        Label of the texture or series, ``Q = 8``, ``row 3``, or ``group 2 of 10``.
    left : ndarray of bool, shape (n_obs,)
        Mask of the left-out rows.
    all_rows : AllRows
        Posterior given all rows.
    seed : int
        Seed of this fold.
    """

    name: str
    left: BoolArray
    all_rows: AllRows
    seed: int

    @property
    def full_name(self) -> str:
        """Name with form and error model, for error messages."""
        model = self.all_rows.model
        return f"{model.form.name}, {model.noise.name}, fold {self.name}"

    @property
    def rows(self) -> Observations:
        """Left-out rows."""
        return self.all_rows.model.data.take(self.left)

    def left_out(self) -> LeftOut:
        """Return the posterior given the remaining rows, and the score of the left-out rows.

        Raises
        ------
        ComputationError
            If no row remains, or no draw of the posterior has a positive density.
        """
        return self.all_rows.without(self.left, self.seed)


def folds_of(
    data: Observations,
    pair: tuple[Form | Fit, Noise],
    *,
    leave: str = "texture",
    seed: int = 0,
    effort: Effort = STANDARD.effort,
    priors: ResolvedPriors | None = None,
) -> list[Fold]:
    """Return a fold for each texture, count Q, series or row, or ten folds if there are many.

    Ten folds of a tenth each are used above 24 textures, counts or series, or 50 rows.

    Parameters
    ----------
    data : Observations
        All rows.
    pair : (Form or Fit, Noise)
        Contact form, or its fit to all rows under the same priors, whose draws are used again; and
        the error model.
    leave : str, optional
        ``texture``, ``step``, ``series`` or ``row``.
    seed : int, optional
        Seed; a fold's seed depends only on this, the form, the error model and the fold's name.
    effort : Effort, optional
        Number of draws of posteriors.
    priors : mapping of str to mapping of str to Distribution, optional
        Replacements for default priors, by form name or ``noise``, and parameter name.

    Raises
    ------
    InputError
        If `leave` is unknown, or there would be only one fold.
    """
    if leave not in _MAX_FOLDS:
        raise InputError(f"leave: expected one of {', '.join(_MAX_FOLDS)}, got {leave!r}")
    codes, names = _codes(data, leave)
    if len(names) > _MAX_FOLDS[leave]:
        dealt = stream(seed, f"groups of {leave}").permutation(len(names)) % _N_GROUPS
        codes, names = dealt[codes], [f"group {i + 1} of {_N_GROUPS}" for i in range(_N_GROUPS)]
    if len(names) < 2:
        raise InputError(f"leaving out each {leave}: expected rows of two or more, got one")
    form, noise = form_of(pair[0]), pair[1]
    posterior = pair[0].posteriors.get(noise.name) if isinstance(pair[0], Fit) else None

    def seed_for(name: str) -> int:
        return int(stream(seed, form.name, noise.name, name).integers(2**63))

    if posterior is None:
        model = Model(data, form, noise, priors_of(priors, form, noise))
        all_rows = AllRows.drawn(model, effort, seed_for("all rows"))
    else:
        all_rows = AllRows.of(posterior, effort, seed_for("all rows"))
    return [
        Fold(name, codes == code, all_rows, seed_for(f"leave {name}"))
        for code, name in enumerate(names)
    ]


def of_folds(
    work: Callable[[Fold], _T],
    data: Observations,
    pairs: Sequence[tuple[Form | Fit, Noise]],
    *,
    executor: Executor | None = None,
    **options: Any,
) -> Iterator[list[tuple[Fold, _T]]]:
    """Yield the folds of each pair of form and error model, with the result of each fold.

    Parameters
    ----------
    work : callable
        Function that returns the result of a fold; for processes, a function of a module.
    data : Observations
        All rows.
    pairs : sequence of (Form or Fit, Noise)
        Pairs to fit.
    executor : concurrent.futures.Executor, optional
        Executor of posteriors and folds, which run in turn if not given.
    **options
        Arguments of `folds_of`.
    """
    fold_pair = partial(folds_of, data, **options)
    groups = list(map_ordered(fold_pair, pairs, executor, name=lambda pair: pair[1].name))
    folds = [fold for group in groups for fold in group]
    results = map_ordered(work, folds, executor, name=lambda fold: fold.full_name)
    for group in groups:
        yield [(fold, next(results)) for fold in group]


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
    """Score the predictions of each form for left-out textures and steps.

    Parameters
    ----------
    table : ContactTable
        Table whose rows of role calibration and status ok are used.
    forms : sequence of Form or Fit
        Contact forms, or their fits to all rows under the same priors, whose draws are used again.
    noise : str or Noise, optional
        Error model of all fits.
    leaves : sequence of str, optional
        Kinds of rows to leave out in turn: ``texture``, ``step`` (all rows of a count Q),
        ``series`` or ``row``. A kind with a single fold has no scores.
    rng : int or numpy.random.Generator, optional
        Seed; each fold has its own random stream.
    executor : concurrent.futures.Executor, optional
        Executor of the folds, which run in turn if not given. The result is the same.
    effort : Effort, optional
        Number of draws of each posterior.
    priors : mapping of str to mapping of str to Distribution, optional
        Replacements for default priors, by form name or ``noise``, and parameter name.

    Returns
    -------
    pandas.DataFrame
        Columns form, noise, leave, n_fold, log_score (sum over folds of the joint log predictive
        density of a fold's rows), log_score_se (with folds as independent units), mean_crps (of
        log(p/E), over exact rows: 0.03 is 3 % in load), stacking_weight, failed (folds that could
        not be computed and the reason; such a form has no scores).

    Raises
    ------
    InputError
        If no row can be fitted, an element of `leaves` is unknown, or a form would be fitted to
        rows computed from its equation.

    Notes
    -----
    *Accuracy.* Monte Carlo is the only approximation; see `inference.left_out`.
    *Cost.* Some hundredths of a CPU second for a fold computed by weights, up to a second for a
    fold that is drawn again.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> from ridgebayes.table.datafiles import CALCULIX_FE, data_path
    >>> table = rb.read_table(data_path(CALCULIX_FE))
    >>> scores = left_out_scores(table, [rb.Modified()], leaves=["texture"], rng=1)
    >>> scores[["n_fold", "stacking_weight"]].values.tolist()
    [[2.0, 1.0]]
    """
    for form in forms:
        refuse_circular(table, form_of(form))
    data, noise, seed = Observations.from_table(table), as_noise(noise), seed_of(rng)
    rows = []
    for leave in leaves:
        if leave in _MAX_FOLDS and len(_codes(data, leave)[1]) < 2:
            continue
        how = {"leave": leave, "seed": seed, "effort": effort, "priors": priors}
        pairs = [(form, noise) for form in forms]
        groups = of_folds(_score, data, pairs, executor=executor, **how)
        by_form = dict(zip((form_of(form).name for form in forms), groups, strict=True))
        log_scores = {k: np.array([score for _, (score, *_) in by_form[k]]) for k in by_form}
        sound = [name for name, scores in log_scores.items() if np.isfinite(scores).all()]
        weights = dict.fromkeys(by_form, 0.0 if sound else np.nan)
        if sound:
            stacked = stacking_weights(np.stack([log_scores[name] for name in sound]))
            weights |= dict(zip(sound, stacked.tolist(), strict=True))
        for name, group in by_form.items():
            scores, n_row = log_scores[name], np.array([fold.left.sum() for fold, _ in group])
            failed = "; ".join(f"{fold.name}: {why}" for fold, (_, _, why) in group if why)
            crps = np.concatenate([crps for _, (_, crps, _) in group])
            mean = float(crps.mean()) if len(crps) else np.nan
            total = scores.sum(), clustered_se(scores, n_row), mean
            rows.append((name, noise.name, leave, len(group), *total, weights[name], failed))
    return pd.DataFrame(rows, columns=LEFT_OUT_COLUMNS)


def _score(fold: Fold) -> tuple[float, FloatArray, str]:
    """Return a fold's log score, the CRPS of its exact rows, and the reason of a failure."""
    try:
        rest = fold.left_out()
    except ComputationError as error:
        return np.nan, np.array([np.nan]), str(error)
    rng = stream(fold.seed, "draws of a CRPS")
    return rest.log_score, row_crps(rest.posterior(fold.seed), fold.rows, rng), ""


def row_loads(fit: Posterior, data: Observations) -> LoadDistribution:
    """Return the predictive distribution of each row's observed load, reduced to nu = 0.5.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    data : Observations
        Rows. Rows of calibrated textures and counts share their inferred offsets.

    Returns
    -------
    LoadDistribution
        Shape (n_obs,), including the known relative error of each row.
    """
    a, b = data.a_over_R[data.texture], data.b_over_R[data.texture]
    return predict_load(fit, load_places(a, b, data.Q)).widened(data.rel_se)


def row_crps(fit: Posterior, data: Observations, rng: np.random.Generator) -> FloatArray:
    """Return the CRPS of log(p/E) of the rows that give the load exactly.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    data : Observations
        Rows that were not fitted; each is predicted separately.
    rng : numpy.random.Generator
        Generator of the draws.

    Returns
    -------
    ndarray of float, shape (n_exact,), dimensionless
    """
    exact = data.take(data.is_exact)
    if not len(exact):
        return np.zeros(0)
    # The standard error of a CRPS is about 1 % of a predictive sd. With many rows fewer draws
    # suffice, because only the mean over rows is reported.
    n = min(N_KEPT, -(-MAX_DRAWS_TIMES_ROWS // len(exact)))
    return crps_of_draws(np.log(row_loads(fit, exact).rvs(n, rng)), exact.log_load)


def clustered_se(total: FloatArray, n: FloatArray) -> float:
    """Return the standard error of a sum over rows if only folds are independent.

    Parameters
    ----------
    total, n : ndarray of float, shape (n_fold,)
        Sum over the rows of each fold, and their number.

    Returns
    -------
    float
        Standard error; NaN for a single fold.

    Examples
    --------
    >>> clustered_se(np.array([4.0, 0.0, 2.0]), np.array([2.0, 2.0, 2.0])).__round__(4)
    3.4641
    """
    if len(total) < 2:
        return np.nan
    deviation = total - n * (total.sum() / n.sum())
    return float(np.sqrt(len(total) / (len(total) - 1) * (deviation**2).sum()))


def crps_of_draws(draws: FloatArray, observed: FloatArray) -> FloatArray:
    """Return an unbiased estimate of the continuous ranked probability score of each observation.

    Parameters
    ----------
    draws : ndarray of float, shape (n_draw, n)
        Draws of each prediction.
    observed : ndarray of float, shape (n,)
        Observed values.

    Returns
    -------
    ndarray of float, shape (n,)
        Mean distance to the draws minus half the mean distance between two draws; 0 is best.

    Notes
    -----
    *Cost.* Sorting of the draws.

    References
    ----------
    Zamo & Naveau (2018), doi:10.1007/s11004-017-9709-7: the fair estimator.

    Examples
    --------
    >>> crps_of_draws(np.array([[0.0], [2.0]]), np.array([1.0])).tolist()
    [0.0]
    """
    n = len(draws)
    place = 2 * np.arange(1, n + 1)[:, None] - n - 1
    apart = (place * np.sort(draws, axis=0)).sum(axis=0) / (n * (n - 1))
    return np.asarray(np.abs(draws - observed).mean(axis=0) - apart)


def form_of(form: Form | Fit) -> Form:
    """Return a form, or the form of a fit."""
    return form.form if isinstance(form, Fit) else form


def _codes(data: Observations, leave: str) -> tuple[IntArray, list[str]]:
    """Return the fold of each row, and the names of the folds."""
    if leave == "texture":
        return data.texture, list(data.labels) or [f"a{a!r}_b{b!r}" for a, b in data.textures]
    if leave == "series":
        return data.series, list(data.series_labels)
    if leave == "step":
        steps, codes = np.unique(data.Q, return_inverse=True)
        return codes.astype(np.int64), [f"Q = {step}" for step in steps.tolist()]
    return np.arange(len(data)), [f"row {i + 1}" for i in range(len(data))]
