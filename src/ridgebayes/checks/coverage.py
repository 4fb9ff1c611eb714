"""How often bands contain what they claim to contain, on textures that were not fitted."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, FloatArray, Rng
from ridgebayes.checks.folds import Fold, clustered_se, folds_of, row_loads
from ridgebayes.comparison.compare import DEFAULT_FORMS
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms import Form
from ridgebayes.model.noise import Noise, as_noise
from ridgebayes.model.observations import Observations, refuse_circular
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.runtime.randomness import seed_of
from ridgebayes.table.table import ContactTable

PROBS = (0.5, 0.8, 0.9, 0.95, 0.99)
# Less than `importance_posterior` takes by itself: a share of 41 rows asks for no second digit.
EFFORT = {"n_round": 4, "n_per_round": 500, "n_draw": 640}
COVERAGE_COLUMNS = [
    "form",
    "noise",
    "prob",
    "n",
    "covered",
    "share",
    "share_se",
    "mean_width",
    "share_extrapolated",
    "n_texture",
    "n_unconverged",
    "n_failed",
    "failed",
]
Stage = Callable[[str], AbstractContextManager[object]]


def coverage(
    table: ContactTable,
    forms: Sequence[Form] = DEFAULT_FORMS,
    noises: Sequence[str | Noise] | None = None,
    *,
    probs: Sequence[float] = PROBS,
    rng: Rng = 0,
    executor: Executor | None = None,
    progress: Stage | None = None,
) -> pd.DataFrame:
    """Leave each texture out in turn, predict its transitions, and count those inside the bands.

    Parameters
    ----------
    table : ContactTable
        Rows of role calibration and status ok are used; those that give the load itself are
        predicted.
    forms : sequence of Form, optional
        Classic, power law, Modified and Hybrid if not given.
    noises : sequence of str or Noise, optional
        Error models; all if not given.
    probs : sequence of float, optional
        Probabilities of the simulation bands: equal-tailed intervals of the load.
    rng : int or numpy.random.Generator, optional
        Seed; each fold has a stream of its own name.
    executor : concurrent.futures.Executor, optional
        What folds are computed on; one after another if not given. The result is the same.
    progress : callable, optional
        Called with the name of each form and error model, returns a context manager around it.

    Returns
    -------
    pandas.DataFrame
        Columns form, noise, prob, n (rows predicted), covered, share, share_se, mean_width,
        share_extrapolated, n_texture, n_unconverged, n_failed, failed; one row per form, error
        model and probability. `share_se` takes whole textures as independent; it is 0 where all
        or no rows are covered, which does not mean that the share is known. `mean_width` is of
        the interval of log(p/E): 0.1 is some 10 % in load. `failed` names the textures whose fit
        failed and says why; their rows are not counted. Fits that did not converge are.

    Raises
    ------
    InputError
        If no row can be fitted, there is one texture only, a form would be fitted to rows that its
        own equation made, or a probability is not between 0 and 1.

    Notes
    -----
    *Cost.* One fit for all probabilities: 1 to 10 CPU seconds by error model, times textures.
    """
    _check_probs(probs)
    for form in forms:
        refuse_circular(table, form)
    data, seed = Observations.from_table(table), seed_of(rng)
    groups = [
        (form, as_noise(noise), folds_of(data, form, as_noise(noise), seed=seed, effort=EFFORT))
        for form in forms
        for noise in (Noise.every() if noises is None else noises)
    ]
    tasks = [_Task(fold, tuple(probs)) for _, _, folds in groups for fold in folds]
    found: Iterator[_Found | str] = map_ordered(
        _predicted, tasks, executor, name=lambda task: task.fold.full_name
    )
    frames = []
    for form, noise, folds in groups:
        with nullcontext() if progress is None else progress(f"{form.name}, {noise.name}"):
            results = [next(found) for _ in folds]
        failed = {
            fold.name: result
            for fold, result in zip(folds, results, strict=True)
            if isinstance(result, str)
        }
        sound = [result for result in results if not isinstance(result, str)]
        frames.append(_counted(form.name, noise.name, probs, sound, failed))
    return pd.concat(frames, ignore_index=True)


def coverage_of(
    fit: Posterior, table: ContactTable, *, probs: Sequence[float] = PROBS
) -> pd.DataFrame:
    """Count how many transitions of unseen textures lie inside the bands of a fit.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    table : ContactTable
        Textures that were not fitted. Rows of any role with status ok that give the load itself.
    probs : sequence of float, optional
        Probabilities of the simulation bands.

    Returns
    -------
    pandas.DataFrame
        As `coverage` returns it.

    Raises
    ------
    InputError
        If a texture was fitted, no row can be predicted, or a probability is not between 0 and 1.
    """
    _check_probs(probs)
    seen = sorted(set(table.textures) & set(fit.model.data.textures))
    if seen:
        a, b = seen[0]
        raise InputError(
            f"{table.where}: texture a/R = {a}, b/R = {b} was fitted; expected unseen textures only"
        )
    # The rows of an unseen texture have no role to play in a fit.
    everything = ContactTable.from_frame(table.frame.assign(role="calibration"), where=table.where)
    data = Observations.from_table(everything)
    if not data.is_exact.any():
        raise InputError(f"{table.where}: no row gives a load; expected at least one transition")
    found = _found(fit, data.take(data.is_exact), probs)
    return _counted(fit.form.name, fit.noise.name, probs, [found], {})


@dataclass(frozen=True, eq=False)
class _Task:
    fold: Fold
    probs: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class _Found:
    """Of the predicted rows, shape (n_obs,): texture, and by probability (n_prob, n_obs)."""

    texture: FloatArray
    covered: BoolArray
    width: FloatArray
    extrapolation: BoolArray
    converged: bool


def _predicted(task: _Task) -> _Found | str:
    """Posterior a fold and predict its exact rows; the reason where that fails."""
    fold = task.fold
    try:
        fit, _ = fold.refit()
    except ComputationError as error:
        return str(error)
    return _found(fit, fold.data.take(fold.left & fold.data.is_exact), task.probs)


def _found(fit: Posterior, data: Observations, probs: Sequence[float]) -> _Found:
    n = len(data)
    if n == 0:  # a texture of brackets and counts alone
        nothing = np.empty((len(probs), 0))
        empty = np.empty(0, dtype=bool)
        return _Found(np.empty(0), nothing.astype(bool), nothing, empty, fit.converged)
    load = row_loads(fit, data)
    covered, width = np.empty((len(probs), n), dtype=bool), np.empty((len(probs), n))
    for i, prob in enumerate(probs):
        lower, upper = (np.log(end) for end in load.interval(prob))
        covered[i] = (lower <= data.log_load) & (data.log_load <= upper)
        width[i] = upper - lower
    return _Found(data.texture.astype(float), covered, width, load.extrapolation, fit.converged)


def _counted(
    form: str,
    noise: str,
    probs: Sequence[float],
    found: Sequence[_Found],
    failed: dict[str, str],
) -> pd.DataFrame:
    # Textures of several fits are others, whatever their number within one.
    numbered = [replace(one, texture=one.texture + 1e6 * i) for i, one in enumerate(found)]
    rows = []
    for i, prob in enumerate(probs):
        covered = _joined([one.covered[i] for one in numbered])
        texture = _joined([one.texture for one in numbered])
        _, code = np.unique(texture, return_inverse=True)
        n = len(covered)
        size = np.bincount(code).astype(float)
        inside = np.bincount(code, covered).astype(float)
        mean = (lambda x: float(x.mean())) if n else (lambda x: np.nan)
        rows.append(
            {
                "form": form,
                "noise": noise,
                "prob": prob,
                "n": n,
                "covered": int(covered.sum()),
                "share": mean(covered),
                "share_se": clustered_se(inside, size) / n if n else np.nan,
                "mean_width": mean(_joined([one.width[i] for one in numbered])),
                "share_extrapolated": mean(_joined([one.extrapolation for one in numbered])),
                "n_texture": len(size),
                "n_unconverged": sum(not one.converged for one in numbered),
                "n_failed": len(failed),
                "failed": "; ".join(f"{name}: {why}" for name, why in failed.items()),
            }
        )
    return pd.DataFrame(rows, columns=COVERAGE_COLUMNS)


def _joined(parts: Sequence[FloatArray] | Sequence[BoolArray]) -> FloatArray:
    return np.concatenate([np.empty(0), *parts])


def _check_probs(probs: Sequence[float]) -> None:
    if not probs or not all(0 < prob < 1 for prob in probs):
        raise InputError(f"probs: expected each 0 < prob < 1, at least one, got {tuple(probs)}")
