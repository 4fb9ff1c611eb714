"""Rows left out in turn: what a fold leaves out, and its posterior given the rest."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.evidence import LogEvidence
from ridgebayes.evidence.error_models import priors_of
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.default_priors import default_priors
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.prior_files import ResolvedPriors
from ridgebayes.predict.load_distribution import LoadDistribution
from ridgebayes.predict.predict import predict_load
from ridgebayes.runtime.randomness import stream

LEAVES = ("texture", "step", "row")
# Less than `importance_posterior` takes by itself: a share of 41 rows asks for no second digit.
EFFORT = {"n_round": 2, "n_per_round": 256, "n_draw": 384}


@dataclass(frozen=True, eq=False)
class Fold:
    """Rows to predict from the others; holds all that a process of its own needs.

    Parameters
    ----------
    name : str
        The texture's label, ``Q = 8`` or ``row 3``.
    data : Observations
        All rows.
    left : ndarray of bool, shape (n_obs,)
        The rows left out.
    form : Form
        Contact form.
    noise : Noise
        Error model.
    seed : int
        Seed of this fold alone.
    effort : mapping of str to int, optional
        Passed on to `importance_posterior`: fewer draws than its own for a first look.
    priors : mapping of str to Distribution, optional
        Replacements for default priors; those of coefficients that no row tells of are not needed.
    """

    name: str
    data: Observations
    left: BoolArray
    form: Form
    noise: Noise
    seed: int
    effort: Mapping[str, int] = field(default_factory=dict)
    priors: Mapping[str, Distribution] = field(default_factory=dict)

    @property
    def full_name(self) -> str:
        """Name with form and error model, for errors."""
        return f"{self.form.name}, {self.noise.name}, fold {self.name}"

    def refit(self) -> tuple[Posterior, LogEvidence]:
        """Return the posterior given the rows that stay.

        Raises
        ------
        ComputationError
            If no row stays, or the posterior has no interior mode.
        """
        if self.left.all():
            raise ComputationError("no row is left to fit")
        rest = self.data.take(~self.left)
        known = default_priors(self.form.bind(rest.textures, rest.labels), self.noise, self.priors)
        own = {name: prior for name, prior in self.priors.items() if name in known}
        model = Model(rest, self.form, self.noise, own)
        return importance_posterior(model, seed=self.seed, **self.effort)


def folds_of(
    data: Observations,
    form: Form,
    noise: Noise,
    *,
    leave: str = "texture",
    seed: int = 0,
    effort: Mapping[str, int] | None = None,
    priors: ResolvedPriors | None = None,
) -> list[Fold]:
    """Return one fold per texture, count Q or row.

    Parameters
    ----------
    data : Observations
        All rows.
    form : Form
        Contact form.
    noise : Noise
        Error model.
    leave : str, optional
        ``texture``, ``step`` or ``row``.
    seed : int, optional
        Seed; a fold's own depends on this, the form, the error model and the fold's name alone.
    effort : mapping of str to int, optional
        Passed on to `importance_posterior`.
    priors : mapping of str to mapping of str to Distribution, optional
        Replacements for default priors: by form name, or ``noise``, and parameter name.

    Raises
    ------
    InputError
        If `leave` is none of the three, or there would be one fold only.
    """
    if leave not in LEAVES:
        raise InputError(f"leave: expected one of {', '.join(LEAVES)}, got {leave!r}")
    codes, names = _codes(data, leave)
    if len(names) < 2:
        raise InputError(f"leave: expected rows of at least two, to leave one out, got {leave!r}")
    folds, replaced = [], priors_of(priors, form, noise)
    for code, name in enumerate(names):
        own = int(stream(seed, form.name, noise.name, f"leave {name}").integers(2**63))
        folds.append(Fold(name, data, codes == code, form, noise, own, effort or {}, replaced))
    return folds


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
        What came.

    Returns
    -------
    ndarray of float, shape (n,)
        Mean distance to the draws less half the mean distance between two of them; 0 is best.

    Notes
    -----
    *Cost.* That of sorting.

    References
    ----------
    Zamo & Naveau (2018), doi:10.1007/s11004-017-9709-7: the fair estimator.

    Examples
    --------
    >>> crps_of_draws(np.array([[0.0], [2.0]]), np.array([1.0])).tolist()
    [0.0]
    """
    n = len(draws)
    ladder = np.sort(draws, axis=0)
    place = 2 * np.arange(1, n + 1)[:, None] - n - 1
    apart = (place * ladder).sum(axis=0) / (n * (n - 1))
    return np.abs(draws - observed).mean(axis=0) - apart


def _codes(data: Observations, leave: str) -> tuple[IntArray, list[str]]:
    """Return the fold of each row, and the folds' names."""
    if leave == "texture":
        return data.texture, list(data.labels) or [f"a{a!r}_b{b!r}" for a, b in data.textures]
    if leave == "step":
        steps, codes = np.unique(data.Q, return_inverse=True)
        return codes.astype(np.int64), [f"Q = {step}" for step in steps.tolist()]
    return np.arange(len(data)), [f"row {i + 1}" for i in range(len(data))]
