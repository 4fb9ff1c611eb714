"""Rows left out in turn: what a fold leaves out, its posterior given the rest, its predictions.

Folds of very many textures, counts or rows leave out a tenth each, drawn at random.
"""

from dataclasses import dataclass

import numpy as np

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.inference.importance import Effort
from ridgebayes.inference.left_out import AllRows, LeftOut
from ridgebayes.inference.posterior import Posterior
from ridgebayes.inference.presets import STANDARD
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.prior_files import ResolvedPriors, priors_of
from ridgebayes.predict.load_distribution import LoadDistribution
from ridgebayes.predict.predict import predict_load
from ridgebayes.results import Fit
from ridgebayes.runtime.randomness import stream

# Each takes a posterior for every form: above, ten folds of many tell as much.
_MOST_FOLDS = {"texture": 24, "step": 24, "series": 24, "row": 50}
_N_GROUP = 10
# Draws behind a CRPS, whose standard error is about 1 % of a predictive sd; of very many rows,
# whose mean is looked at, fewer.
N_CRPS, _LEAST_CRPS, _MOST_CRPS = 10_240, 1_024, 2**22


@dataclass(frozen=True, eq=False)
class Fold:
    """Rows to predict from the others; holds all that a process of its own needs.

    Parameters
    ----------
    name : str
        The texture's label, ``Q = 8``, the series' label, ``row 3``; or ``group 2 of 10``.
    left : ndarray of bool, shape (n_obs,)
        The rows left out.
    known : AllRows
        The posterior given all rows.
    seed : int
        Seed of this fold alone.
    """

    name: str
    left: BoolArray
    known: AllRows
    seed: int

    @property
    def full_name(self) -> str:
        """Name with form and error model, for errors."""
        model = self.known.model
        return f"{model.form.name}, {model.noise.name}, fold {self.name}"

    @property
    def rows(self) -> Observations:
        """The rows left out."""
        return self.known.model.data.take(self.left)

    def found(self) -> LeftOut:
        """Return the posterior given the rows that stay, and the score of the others.

        Raises
        ------
        ComputationError
            If no row stays, or no draw given the rest has a positive density.
        """
        return self.known.without(self.left, self.seed)


def folds_of(
    data: Observations,
    form: Form | Fit,
    noise: Noise,
    *,
    leave: str = "texture",
    seed: int = 0,
    effort: Effort = STANDARD.effort,
    priors: ResolvedPriors | None = None,
) -> list[Fold]:
    """Return one fold per texture, count Q, series or row, or ten of a tenth where there are many.

    Above 24 textures, counts or series, or 50 rows.

    Parameters
    ----------
    data : Observations
        All rows.
    form : Form or Fit
        Contact form; or its fit to all rows under the same priors, so that these need no draws.
    noise : Noise
        Error model.
    leave : str, optional
        ``texture``, ``step``, ``series`` or ``row``.
    seed : int, optional
        Seed; a fold's own depends on this, the form, the error model and the fold's name alone.
    effort : Effort, optional
        Draws of posteriors.
    priors : mapping of str to mapping of str to Distribution, optional
        Replacements for default priors: by form name, or ``noise``, and parameter name.

    Raises
    ------
    InputError
        If `leave` is none of the four, or there would be one fold only.
    """
    if leave not in _MOST_FOLDS:
        raise InputError(f"leave: expected one of {', '.join(_MOST_FOLDS)}, got {leave!r}")
    codes, names = _codes(data, leave)
    if len(names) > _MOST_FOLDS[leave]:
        dealt = stream(seed, f"groups of {leave}").permutation(len(names)) % _N_GROUP
        codes, names = dealt[codes], [f"group {i + 1} of {_N_GROUP}" for i in range(_N_GROUP)]
    if len(names) < 2:
        raise InputError(f"leave: expected rows of at least two, to leave one out, got {leave!r}")
    given = form.posteriors.get(noise.name) if isinstance(form, Fit) else None
    form = form.form if isinstance(form, Fit) else form

    def own_seed(name: str) -> int:
        return int(stream(seed, form.name, noise.name, name).integers(2**63))

    if given is None:
        model = Model(data, form, noise, priors_of(priors, form, noise))
        known = AllRows.drawn(model, effort, own_seed("all rows"))
    else:
        known = AllRows.of(given, effort, own_seed("all rows"))
    return [
        Fold(name, codes == code, known, own_seed(f"leave {name}"))
        for code, name in enumerate(names)
    ]


def row_loads(fit: Posterior, data: Observations, Q: IntArray | None = None) -> LoadDistribution:
    """Return the distribution of each row's load as it would be observed, reduced to nu = 0.5.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    data : Observations
        Rows; those of calibrated textures and counts keep the offsets that were learned.
    Q : ndarray of int, shape (n_obs,), optional
        Counts to be reached, instead of the rows' own.

    Returns
    -------
    LoadDistribution
        Shape (n_obs,). The row's known relative error is part of it.
    """
    a, b = data.a_over_R[data.texture], data.b_over_R[data.texture]
    load = predict_load(fit, a, b, np.asarray(data.Q if Q is None else Q, dtype=float))
    return load.widened(data.rel_se)


def row_crps(fit: Posterior, data: Observations, rng: np.random.Generator) -> FloatArray:
    """Return the CRPS of log(p/E) of rows, each predicted by itself.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    data : Observations
        Rows that were not fitted.
    rng : numpy.random.Generator
        Generator of the draws.

    Returns
    -------
    ndarray of float, shape (n_obs,), dimensionless
        NaN in brackets and counts.
    """
    if not data.is_exact.any():
        return np.full(len(data), np.nan)
    # A count of 2 needs no load to be reached; 4 stands in its place and is not looked at.
    load = row_loads(fit, data, np.maximum(data.Q, 4))
    n = int(np.clip(_MOST_CRPS // len(data), _LEAST_CRPS, N_CRPS))
    with np.errstate(all="ignore"):
        crps = crps_of_draws(np.log(load.rvs(n, rng)), data.log_load)
    return np.where(data.is_exact, crps, np.nan)


def clustered_se(total: FloatArray, n: FloatArray) -> float:
    """Return the standard error of a sum over rows of which only whole folds are independent.

    Parameters
    ----------
    total, n : ndarray of float, shape (n_fold,)
        Sum and number of the rows of each fold. A fold's rows stray from the mean row together.

    Returns
    -------
    float
        NaN for a single fold.

    Examples
    --------
    >>> clustered_se(np.array([4.0, 0.0, 2.0]), np.array([2.0, 2.0, 2.0])).__round__(4)
    3.4641
    """
    if len(total) < 2:
        return np.nan
    astray = total - n * (total.sum() / n.sum())
    return float(np.sqrt(len(total) / (len(total) - 1) * (astray**2).sum()))


def crps_of_draws(draws: FloatArray, observed: FloatArray) -> FloatArray:
    """Return the continuous ranked probability score of each observation, without bias.

    Parameters
    ----------
    draws : ndarray of float, shape (n_draw, n)
        Draws of each prediction.
    observed : ndarray of float, shape (n,)
        Observed values.

    Returns
    -------
    ndarray of float, shape (n,)
        Mean distance to the draws less half the mean distance between two of them; 0 is best.

    Notes
    -----
    *Cost.* A sort of the draws.

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
    value: FloatArray = np.abs(draws - observed).mean(axis=0) - apart
    return value


def _codes(data: Observations, leave: str) -> tuple[IntArray, list[str]]:
    """Return the fold of each row, and the folds' names."""
    if leave == "texture":
        return data.texture, list(data.labels) or [f"a{a!r}_b{b!r}" for a, b in data.textures]
    if leave == "series":
        return data.series, list(data.series_labels)
    if leave == "step":
        steps, codes = np.unique(data.Q, return_inverse=True)
        return codes.astype(np.int64), [f"Q = {step}" for step in steps.tolist()]
    return np.arange(len(data)), [f"row {i + 1}" for i in range(len(data))]
