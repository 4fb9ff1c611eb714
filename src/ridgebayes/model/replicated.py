"""New log loads under a form and an error model: what the model says that rows could have been."""

import numpy as np

from ridgebayes._types import BoolArray, FloatArray
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.model.joint_prior import JointPrior
from ridgebayes.model.model import Model
from ridgebayes.model.offsets import Offsets

_BATCH_SIZE = 2**20  # numbers of covariances, 8 MB
_MAX_ROUNDS = 1_000  # of prior draws without a load


def simulate_log_loads(
    model: Model, theta: FloatArray, rng: np.random.Generator, n: int = 1
) -> FloatArray:
    """Draw new log loads at the rows' textures and counts.

    Parameters
    ----------
    model : Model
        Form, error model and the places of the rows; their loads are not looked at.
    theta : ndarray of float, shape (..., n_parameter)
        Parameters.
    rng : numpy.random.Generator
        Source of the draws.
    n : int, optional
        Draws at each `theta`.

    Returns
    -------
    ndarray of float, shape (n, ..., n_obs), dimensionless
        Form, plus new draws of shared offsets, plus each row's own error, its known relative error
        in quadrature. A row that brackets its load, and one that counts, gets an exact load: that
        of its Q. NaN where there is none: at a count of 2, and where the form's rate is not
        positive.

    Raises
    ------
    InputError
        If `theta` does not have the model's parameters on its last axis.

    Examples
    --------
    >>> from ridgebayes.table.datafiles import paper_sweep
    >>> from ridgebayes.model.forms import Modified
    >>> from ridgebayes.model.observations import Observations
    >>> model = Model(Observations.from_table(paper_sweep()), Modified())
    >>> simulate_log_loads(model, np.array([1.38, 0.03]), np.random.default_rng(1), n=5).shape
    (5, 41)
    """
    theta = np.asarray(theta, dtype=float)
    if theta.shape[-1:] != (model.n_parameter,):
        raise InputError(
            f"theta: expected {model.n_parameter} parameters on the last axis "
            f"({', '.join(model.parameter_names)}), got shape {theta.shape}"
        )
    eta = theta[..., model.n_coefficient :]
    log_load = form_log_loads(model, theta) + np.zeros((n,) + (1,) * theta.ndim)
    offsets = model.offsets.own()
    if offsets.n_level:
        scores = rng.standard_normal((*log_load.shape[:-1], offsets.n_level))
        log_load += _offsets(offsets, eta, scores)[..., : len(model.data)]
    df = eta[..., -1:] if model.noise.tail == "student" else None
    scale = np.sqrt(eta[..., :1] ** 2 + model.data.rel_se**2)
    return log_load + scale * model.noise.distribution.rvs(rng, df, log_load.shape)


def form_log_loads(model: Model, theta: FloatArray) -> FloatArray:
    """Return the form's own log loads of the rows, shape (..., n_obs), NaN where there is none."""
    data = model.data
    shape = model.form.shape(data.Q, data.a_over_R[data.texture], data.b_over_R[data.texture])
    log_rate = model.log_rates(theta)[..., data.texture]
    with np.errstate(divide="ignore", invalid="ignore"):
        value = 2 * (np.log(shape) - log_rate)
    return np.where(np.isfinite(value), value, np.nan)


def is_possible(model: Model, theta: FloatArray) -> BoolArray:
    """Return whether rows have a likelihood at all at parameters, ``theta.shape[:-1]``.

    Every rate is positive, and a smooth offset's covariance can be factorised.
    """
    possible = np.isfinite(model.log_rates(theta)).all(axis=-1)
    offsets = model.offsets.own()
    if offsets.n_smooth:
        ones = np.ones((1, *theta.shape[:-1], offsets.n_level))
        offset = _offsets(offsets, theta[..., model.n_coefficient :], ones)[0]
        possible = possible & np.isfinite(offset).all(axis=-1)
    return np.asarray(possible)


def _offsets(offsets: Offsets, eta: FloatArray, scores: FloatArray) -> FloatArray:
    """Return each predictor's offset, some draws at a time: their covariances are not there whole.

    `eta` has shape (..., n_noise), `scores` (n, ..., n_level).
    """
    flat = eta.reshape(-1, eta.shape[-1])
    by_draw = scores.reshape(len(scores), len(flat), offsets.n_level)
    step = max(_BATCH_SIZE // max(offsets.n_smooth**2, 1), 1)
    parts = []
    for i in range(0, len(flat), step):
        part = by_draw[:, i : i + step]
        first, rest = part[..., : offsets.n_first], part[..., offsets.n_first :]
        root = offsets.root(flat[i : i + step])
        parts.append(offsets.design.spread(*root.times(first, rest)))
    value = np.concatenate(parts, axis=1)
    return value.reshape(*scores.shape[:-1], value.shape[-1])


def prior_draws(model: Model, rng: np.random.Generator, n: int) -> FloatArray:
    """Draw parameters from the prior, where loads follow from them.

    Parameters
    ----------
    model : Model
        Form, error model, priors and textures.
    rng : numpy.random.Generator
        Source of the draws.
    n : int
        Number of draws.

    Returns
    -------
    ndarray of float, shape (n, n_parameter)
        Draws at which the rate of every texture is positive. Where one is not, the likelihood of
        any rows is zero: the posterior is the same for the prior and for the prior kept to these.

    Raises
    ------
    ComputationError
        If hardly any draw has positive rates.
    """
    joint = JointPrior(model.priors.values())
    parts, n_possible = [], 0
    for _ in range(_MAX_ROUNDS):
        theta = joint.rvs(rng, n)
        theta = theta[is_possible(model, theta)]
        parts.append(theta)
        n_possible += len(theta)
        if n_possible >= n:
            return np.concatenate(parts)[:n]
    raise ComputationError(
        f"{model.form.name}: {n_possible} of {_MAX_ROUNDS * n} prior draws have positive rates; "
        f"expected at least {n}"
    )
