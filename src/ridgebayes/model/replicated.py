"""Simulation of new log loads, and draws of parameters from the prior."""

import numpy as np

from ridgebayes._types import BATCH_SIZE, BoolArray, FloatArray
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.model.joint_prior import JointPrior
from ridgebayes.model.model import Model
from ridgebayes.model.offsets import Offsets

_MAX_ROUNDS = 1_000  # rounds of n prior draws, until n of them have positive rates


def simulate_log_loads(
    model: Model, theta: FloatArray, rng: np.random.Generator, n: int = 1
) -> FloatArray:
    """Draw new log loads at the rows' textures and counts.

    Parameters
    ----------
    model : Model
        Form, error model, and the rows' textures and counts; their loads are not used.
    theta : ndarray of float, shape (..., n_parameter)
        Parameters.
    rng : numpy.random.Generator
        Source of the draws.
    n : int, optional
        Number of draws at each `theta`.

    Returns
    -------
    ndarray of float, shape (n, ..., n_obs), dimensionless
        Sum of the form's log load, new draws of shared offsets, and each row's own error, whose
        scale includes the known relative error in quadrature. Brackets and counts also get the
        exact load of their Q. NaN at a count of 2, and if the form's rate is not positive.

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
    """Return the form's log loads of the rows, shape (..., n_obs); NaN if there is no load."""
    data = model.data
    shape = model.form.shape(data.Q, data.a_over_R[data.texture], data.b_over_R[data.texture])
    log_rate = model.log_rates(theta)[..., data.texture]
    with np.errstate(divide="ignore", invalid="ignore"):
        value = 2 * (np.log(shape) - log_rate)
    return np.where(np.isfinite(value), value, np.nan)


def is_possible(model: Model, theta: FloatArray) -> BoolArray:
    """Return a mask of parameters at which the model has loads, shape ``theta.shape[:-1]``.

    All rates must be positive, and a smooth offset's covariance must have a Cholesky factor.
    """
    possible = np.isfinite(model.log_rates(theta)).all(axis=-1)
    offsets = model.offsets.own()
    if offsets.n_smooth:
        ones = np.ones((1, *theta.shape[:-1], offsets.n_level))
        offset = _offsets(offsets, theta[..., model.n_coefficient :], ones)[0]
        possible = possible & np.isfinite(offset).all(axis=-1)
    return np.asarray(possible)


def _offsets(offsets: Offsets, eta: FloatArray, scores: FloatArray) -> FloatArray:
    """Return each predictor's offset for `eta` (..., n_noise) and `scores` (n, ..., n_level).

    The draws are processed in batches to limit the memory of their covariances.
    """
    flat = eta.reshape(-1, eta.shape[-1])
    by_draw = scores.reshape(len(scores), len(flat), offsets.n_level)
    step = max(BATCH_SIZE // max(offsets.n_smooth**2, 1), 1)
    parts = [
        offsets.of_predictors(flat[i : i + step], by_draw[:, i : i + step])
        for i in range(0, len(flat), step)
    ]
    value = np.concatenate(parts, axis=1)
    return value.reshape(*scores.shape[:-1], value.shape[-1])


def prior_draws(model: Model, rng: np.random.Generator, n: int) -> FloatArray:
    """Draw parameters from the prior, restricted to parameters at which the model has loads.

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
        Draws at which the rate of every texture is positive. The restriction does not change the
        posterior, since the likelihood of other parameters is zero.

    Raises
    ------
    ComputationError
        If fewer than 0.1 % of the prior draws have positive rates.
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
