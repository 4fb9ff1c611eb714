"""What a Student tail gains over a normal one, seen from the normal one's mode.

Where rows share offsets a Student posterior has no closed form, and to search for its mode takes
seconds. Most tables have no outliers: there the tail's evidence is a little below its normal
twin's, and a look along the two parameters that a tail moves says so in milliseconds.
"""

import math

import numpy as np
from scipy.special import logsumexp

from ridgebayes._types import FloatArray
from ridgebayes.inference.coordinates import Conditional
from ridgebayes.inference.laplace import Laplace
from ridgebayes.model.model import Model

_DF = np.geomspace(1.0, 120.0, 9)
_SHRUNK = math.log(8.0)  # range of log sigma: heavy tails need a smaller one
_WIDENED = 4.0  # posterior sds of log sigma above the mode
_STEP = 1.1  # between points, in the same: the trapezoidal rule errs by 1e-6 of a normal density
_POINTS_MAX = 64  # of sigma; its posterior is so narrow in tables of some thousand rows


def student_gain(model: Model, twin: Model, laplace: Laplace) -> float:
    """Return ln evidence of a Student error model less that of its normal twin, roughly.

    Parameters
    ----------
    model, twin : Model
        Of one structure, with Student errors and with normal ones.
    laplace : Laplace
        The twin's approximation.

    Returns
    -------
    float
        With all but sigma and df at the twin's mode, coefficients integrated out. NaN where sigma
        is known too well for a grid.

    Notes
    -----
    *Validity.* Offsets may be widened by outliers themselves; a gain that needs them narrower is
    not seen. Independent rows, which have no offsets, tell of outliers in any case.
    """
    k, noise = twin.n_coefficient, laplace.mode[twin.n_coefficient :]
    covariance = laplace.factor[k:, k:] @ laplace.factor[k:, k:].T
    theta = twin.to_theta(laplace.mode)
    slope = theta[k] - twin.to_theta(laplace.mode - 1e-4 * np.eye(twin.n_parameter)[k])[k]
    sd = max(1e4 * slope / theta[k] * math.sqrt(covariance[0, 0]), 1e-3)  # of log sigma
    n = math.ceil((_SHRUNK + _WIDENED * sd) / (_STEP * sd))
    if n > _POINTS_MAX:
        return math.nan
    sigma = theta[k] * np.exp(np.linspace(-_SHRUNK, _WIDENED * sd, n))
    normal = _integrated(twin, laplace.mode[:k], noise, {0: sigma})
    student = np.append(noise, 0.0)
    return _integrated(model, laplace.mode[:k], student, {0: sigma, len(noise): _DF}) - normal


def _integrated(
    model: Model, coefficients: FloatArray, noise: FloatArray, axes: dict[int, FloatArray]
) -> float:
    """Return the log density integrated over coefficients and values of some error parameters."""
    k, frame = model.n_coefficient, Conditional.of(model, coefficients)
    scores, log_widths = [], []
    for place, values in axes.items():
        theta = np.repeat(model.to_theta(np.append(coefficients, noise))[None], len(values), axis=0)
        theta[:, k + place] = values
        scores.append(model.to_unconstrained(theta)[:, k + place])
        log_widths.append(np.log(np.gradient(scores[-1])))
    u_noise = np.broadcast_to(noise, (*map(len, scores), len(noise))).copy()
    for place, grid in zip(axes, np.meshgrid(*scores, indexing="ij"), strict=True):
        u_noise[..., place] = grid
    flat = u_noise.reshape(-1, len(noise))
    u, log_jacobian = frame.forward(np.zeros((len(flat), k)), flat)
    value = model.marginal_log_density(np.concatenate([u, flat], axis=1)) + log_jacobian
    volume = sum(np.meshgrid(*log_widths, indexing="ij"))
    return float(logsumexp(np.nan_to_num(value, nan=-np.inf) + np.ravel(volume)))
