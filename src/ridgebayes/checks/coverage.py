"""Coverage of the bands: how often they contain transitions of textures that were not fitted."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from itertools import product

import numpy as np
import pandas as pd

from ridgebayes._types import Rng
from ridgebayes.checks.left_out import Fold, clustered_se, form_of, of_folds, row_loads
from ridgebayes.drawing import PROBS
from ridgebayes.errors import ComputationError, expect
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms import Form, as_form
from ridgebayes.model.noise import Noise, as_noise
from ridgebayes.model.observations import Observations, refuse_circular
from ridgebayes.model.prior_files import ResolvedPriors
from ridgebayes.request import DEFAULT_FORMS, TableLike
from ridgebayes.results import Fit
from ridgebayes.runtime.randomness import seed_of
from ridgebayes.table.table import read_table

COVERAGE_COLUMNS = ["form", "noise", "prob", "n", "covered", "share", "share_se", "mean_width"]
COVERAGE_COLUMNS += ["share_extrapolated", "n_texture", "n_unconverged", "n_failed", "failed"]
# Result of a fold: its predicted rows and whether its fit converged, or the reason of a failure.
_Result = tuple[pd.DataFrame, bool] | str
_ROW_COLUMNS = ("prob", "texture", "covered", "width", "extrapolation")
_NO_ROWS = pd.DataFrame(columns=list(_ROW_COLUMNS), dtype=float)


def coverage(
    table: TableLike,
    forms: Sequence[Form | Fit | str] = DEFAULT_FORMS,
    noises: Sequence[str | Noise] | None = None,
    *,
    probs: Sequence[float] = PROBS,
    rng: Rng = 0,
    executor: Executor | None = None,
    progress: Callable[[str], AbstractContextManager[object]] | None = None,
    priors: ResolvedPriors | None = None,
) -> pd.DataFrame:
    """Leave each texture out in turn, predict its transitions, and count those inside the bands.

    With more than 24 textures, a tenth of them is left out at a time.

    Parameters
    ----------
    table : ContactTable, path or pandas.DataFrame
        Table whose rows of role calibration and status ok are used. Rows that give the load
        exactly are predicted.
    forms : sequence of Form, Fit or str, optional
        Contact forms; Classic, power law, Modified and Hybrid if not given. A fit to all rows under
        the same priors saves drawing from its posteriors again.
    noises : sequence of str or Noise, optional
        Error models; all if not given.
    probs : sequence of float, optional
        Probabilities of the simulation bands: equal-tailed intervals of the load.
    rng : int or numpy.random.Generator, optional
        Seed; each fold has its own random stream.
    executor : concurrent.futures.Executor, optional
        Executor of the folds, which run in turn if not given. The result is the same.
    progress : callable, optional
        Called with the name of each form and error model; returns a context manager for its folds.
    priors : mapping of str to mapping of str to Distribution, optional
        Replacements for default priors, by form name or ``noise``, and parameter name.

    Returns
    -------
    pandas.DataFrame
        Columns form, noise, prob, n (rows predicted), covered, share, share_se, mean_width,
        share_extrapolated, n_texture, n_unconverged, n_failed, failed; one row per form, error
        model and probability. `share_se` treats textures as independent units; it is 0 if all or
        no rows are covered, although the share is uncertain. `mean_width` is the mean width of
        the interval of log(p/E): 0.1 is some 10 % in load. `failed` gives the textures whose fit
        failed and the reason; their rows are not counted. Rows of fits that did not converge are
        counted. The frame is empty if no row gives the load exactly.

    Raises
    ------
    InputError
        If no row can be fitted, there is only one texture, or a form would be fitted to rows
        computed from its equation.

    Notes
    -----
    *Cost.* Up to a CPU second for each fold.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> shares = rb.coverage(rb.paper_sweep(), [rb.Hybrid()], ["iid"], probs=[0.9])
    >>> shares[["form", "n", "n_texture"]].values.tolist()
    [['hybrid', 41, 9]]
    """
    expect(Iterable, forms=forms)
    expect(Iterable, None, noises=noises)
    expect(Mapping, None, priors=priors)
    expect(Callable, None, progress=progress)
    rows, seed = read_table(table), seed_of(rng)
    chosen = [form if isinstance(form, Fit) else as_form(form) for form in forms]
    for form in chosen:
        refuse_circular(rows, form_of(form))
    data = Observations.from_table(rows)
    if not data.is_exact.any():  # a bracket or count has no load that a band could contain
        return pd.DataFrame(columns=COVERAGE_COLUMNS)
    every = [as_noise(noise) for noise in (Noise.every() if noises is None else noises)]
    pairs, work = list(product(chosen, every)), partial(_predicted, probs)
    groups = of_folds(work, data, pairs, executor=executor, seed=seed, priors=priors)
    counted: list[tuple[object, ...]] = []
    for form, noise in pairs:
        name = form_of(form).name
        with nullcontext() if progress is None else progress(f"{name}, {noise.name}"):
            results = [(fold.name, result) for fold, result in next(groups)]
        counted += count_covered(name, noise.name, probs, results)
    return pd.DataFrame(counted, columns=COVERAGE_COLUMNS)


def _predicted(probs: Sequence[float], fold: Fold) -> _Result:
    """Predict the rows of a fold from the other rows, or return the reason of a failure."""
    try:
        fit = fold.left_out().posterior(fold.seed)
    except ComputationError as error:
        return str(error)
    rows = fold.rows
    return covered_rows(fit, rows.take(rows.is_exact), probs), fit.converged


def covered_rows(fit: Posterior, data: Observations, probs: Sequence[float]) -> pd.DataFrame:
    """Return prob, texture, covered, width and extrapolation for each observation and prob.

    Parameters
    ----------
    fit : Posterior
        Posterior fitted without the rows.
    data : Observations
        Rows that give the load exactly; may be empty.
    probs : sequence of float
        Probabilities of the bands.
    """
    if not len(data):
        return _NO_ROWS
    load, prob = row_loads(fit, data), np.reshape(probs, (-1, 1))
    lower, upper = np.log(load.interval(prob))
    covered = (lower <= data.log_load) & (data.log_load <= upper)
    arrays = np.broadcast_arrays(prob, data.texture, covered, upper - lower, load.extrapolation)
    columns = (array.ravel() for array in arrays)
    return pd.DataFrame(dict(zip(_ROW_COLUMNS, columns, strict=True)))


def count_covered(
    form: str, noise: str, probs: Sequence[float], results: Sequence[tuple[str, _Result]]
) -> Iterator[tuple[object, ...]]:
    """Yield the row of `COVERAGE_COLUMNS` for each probability, over the successful folds."""
    failed = [f"{name}: {result}" for name, result in results if isinstance(result, str)]
    sound = [result for _, result in results if not isinstance(result, str)]
    n_unconverged = sum(not converged for _, converged in sound)
    frames = dict(enumerate(frame for frame, _ in sound if len(frame)))
    # The number of a texture is unique only within a fold.
    every = pd.concat(frames, names=["fold"]) if frames else _NO_ROWS.rename_axis("fold")
    for prob in probs:
        part = every[every["prob"] == prob]
        by_texture = part.groupby(["fold", "texture"])["covered"]
        size, inside = (n.to_numpy().astype(float) for n in (by_texture.size(), by_texture.sum()))
        share_se = clustered_se(inside, size) / len(part) if len(part) else np.nan
        shares = (len(part), int(inside.sum()), part["covered"].mean(), share_se)
        means = (part["width"].mean(), part["extrapolation"].mean())
        folds = (len(size), n_unconverged, len(failed), "; ".join(failed))
        yield form, noise, prob, *shares, *means, *folds
