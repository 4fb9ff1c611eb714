"""Slow and obvious answers: dense covariances, grids, and integrals over offsets by brute force.

Nothing of `ridgebayes.inference` is used here, and of a model only its data, form and priors:
offsets follow from the definition of each structure, pair by pair of places.
"""

import itertools
import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from scipy import stats
from scipy.special import logsumexp

from ridgebayes import PowerLaw

LEAST_REL_SE = 1e-8  # of rows that share offsets


class Ends(NamedTuple):
    """Places whose loads rows depend on: each row's own, then those of Q + 2 of counts."""

    texture: np.ndarray
    Q: np.ndarray
    series: np.ndarray


def ends_of(data):
    counts = np.flatnonzero(data.is_count)
    own = np.where(data.Q == 2, 4, data.Q)  # a count of 2 says nothing of its own load
    return Ends(
        np.append(data.texture, data.texture[counts]),
        np.append(own, data.Q[counts] + 2),
        np.append(data.series, data.series[counts]),
    )


def place(data, ends, i):
    a, b = data.textures[ends.texture[i]]
    return math.log(ends.Q[i] / 2 - 1), a / (a + b)


def covariance(model, eta, ends=None):
    """Return the covariance of the offsets at some places, log K of the power law included."""
    data, noise = model.data, model.noise
    ends = ends_of(data) if ends is None else ends
    known = dict(zip(noise.parameter_names, eta, strict=True))
    n = len(ends.Q)
    value = np.zeros((n, n))
    for i, j in itertools.product(range(n), repeat=2):
        if ends.texture[i] == ends.texture[j]:
            value[i, j] += known["tau_texture"] ** 2 if "texture" in noise.factors else 0
            value[i, j] += (2 * 0.3) ** 2 if isinstance(model.form, PowerLaw) else 0
        if ends.Q[i] == ends.Q[j] and "step" in noise.factors:
            value[i, j] += known["tau_step"] ** 2
        if ends.series[i] == ends.series[j] and "series" in noise.factors:
            value[i, j] += known["tau_series"] ** 2
        if "step-smooth" in noise.factors:
            (x, r), (y, s) = place(data, ends, i), place(data, ends, j)
            square = ((x - y) / known["length_h"]) ** 2 + ((r - s) / known["length_ratio"]) ** 2
            same = abs(x - y) < 1e-9 and abs(r - s) < 1e-9
            value[i, j] += known["tau_step"] ** 2 * (math.exp(-square / 2) + same * noise.nugget)
    return value


def split(model, u):
    """Return coefficients, the power law's at the priors' medians, and error parameters."""
    k = model.n_outer_coefficient
    theta = np.array(
        [model.priors[n].value_at(x) for n, x in zip(model.outer_names, u, strict=True)]
    )
    if k:
        return theta[:k], theta[k:]
    return np.array([2 * 1.382 / (a + b) for a, b in model.data.textures]), theta


def log_loads(model, coefficients, ends=None):
    """Return the form's log loads at some places."""
    ends = ends_of(model.data) if ends is None else ends
    a, b = np.array(model.data.textures)[ends.texture].T
    return np.log(model.form.load(ends.Q, a, b, coefficients))


def scales(model, eta):
    rel_se = model.data.rel_se
    if model.noise.factors:
        rel_se = np.maximum(rel_se, LEAST_REL_SE)
    return np.hypot(eta[0], rel_se)


def log_prior(u):
    return float(stats.norm.logpdf(u).sum())


def dense(model, u):
    """Return residuals of exact rows, and their offsets' and whole covariance."""
    coefficients, eta = split(model, u)
    shared = covariance(model, eta)
    whole = shared + np.diag(scales(model, eta) ** 2)
    return model.data.log_load - log_loads(model, coefficients), shared, whole


def normal_log_density(model, u):
    """Return the log density of exact rows with normal errors, times the prior's."""
    residual, _, whole = dense(model, u)
    return log_prior(u) + stats.multivariate_normal(np.zeros(len(residual)), whole).logpdf(residual)


def exact_log_density(model, u):
    """Return the same by elimination with fractions, where errors are tiny."""
    residual, shared, _ = dense(model, u)
    matrix = [[Fraction(x) for x in row] for row in shared.tolist()]
    r, n = [Fraction(x) for x in residual.tolist()], len(residual)
    for i, scale in enumerate(scales(model, split(model, u)[1]).tolist()):
        matrix[i][i] += Fraction(scale) ** 2
    value = 0.0
    for i in range(n):
        pivot = matrix[i][i]
        value -= 0.5 * (math.log(2 * math.pi * pivot) + float(r[i] ** 2 / pivot))
        for j in range(i + 1, n):
            factor = matrix[j][i] / pivot
            r[j] -= factor * r[i]
            matrix[j] = [x - factor * y for x, y in zip(matrix[j], matrix[i], strict=True)]
    return value + log_prior(u)


def between(error, low, high):
    """Return the probability between two ends, 0 where they are turned round."""
    upper = error.sf(low) - error.sf(high)
    return np.maximum(np.where(low > 0, upper, error.cdf(high) - error.cdf(low)), 0)


def rows_log_density(model, coefficients, eta, offset, error=None):
    """Return each row's log density given offsets (..., n_end), by scipy's distributions."""
    data, n = model.data, len(model.data)
    if error is None:
        error = stats.t(eta[-1]) if model.noise.tail == "student" else stats.norm
    scale, mean = scales(model, eta), log_loads(model, coefficients) + offset
    value = np.empty((*offset.shape[:-1], n))
    later = dict(zip(np.flatnonzero(data.is_count).tolist(), range(n, mean.shape[-1]), strict=True))
    with np.errstate(divide="ignore"):
        for i in range(n):
            z = (data.log_load[i] - mean[..., i]) / scale[i]
            if data.is_count[i]:
                beyond = (data.log_load[i] - mean[..., later[i]]) / scale[i]
                high = np.inf if data.Q[i] == 2 else z
                value[..., i] = np.log(between(error, beyond, high))
            elif data.is_exact[i]:
                value[..., i] = error.logpdf(z) - math.log(scale[i])
            else:
                low = (data.log_lower[i] - mean[..., i]) / scale[i]
                value[..., i] = np.log(between(error, low, z))
    return value


def log_density_by_grid(model, u, *, error=None, n=601, reach=9.0):
    """Return the log density with one or two offsets integrated out on a grid of their scores."""
    coefficients, eta = split(model, u)
    variance, vectors = np.linalg.eigh(covariance(model, eta))
    some = variance > 1e-14 * variance.max()
    assert some.sum() <= 2
    axis = np.linspace(-reach, reach, n)
    scores = np.stack(np.meshgrid(*[axis] * int(some.sum()), indexing="ij"), axis=-1)
    scores = scores.reshape(-1, int(some.sum()))
    offset = scores @ (vectors[:, some] * np.sqrt(variance[some])).T
    rows = rows_log_density(model, coefficients, eta, offset, error).sum(axis=-1)
    prior = stats.norm.logpdf(scores).sum(axis=-1)
    cell = math.log(axis[1] - axis[0]) * int(some.sum())
    return float(logsumexp(rows + prior)) + cell + log_prior(u)


def log_evidence_by_prior_draws(model, *, n=1_000_000, seed=0):
    """Return the log of the mean likelihood over draws of parameters and offsets, and its error.

    For tables of few and vague rows of one coefficient, whose loads have no known error.
    """
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((n, model.n_outer))
    theta = {
        name: model.priors[name].value_at(x) for name, x in zip(model.outer_names, u.T, strict=True)
    }
    ends, data = ends_of(model.data), model.data
    # One coefficient c: loads are those of c = 1 over its square.
    mean = log_loads(model, np.ones(1)) - 2 * np.log(theta["c"])[:, None]
    for name, places in (("texture", ends.texture), ("step", ends.Q), ("series", ends.series)):
        if name in model.noise.factors:
            _, level = np.unique(places, return_inverse=True)
            x = rng.standard_normal((n, level.max() + 1)) * theta[f"tau_{name}"][:, None]
            mean = mean + x[:, level]
    error = stats.t(theta["df"]) if "df" in theta else stats.norm
    later, rows = len(data), np.zeros(n)
    for i in range(len(data)):
        high = (data.log_load[i] - mean[:, i]) / theta["sigma"]
        if data.is_exact[i]:
            each = error.logpdf(high) - np.log(theta["sigma"])
        else:
            low = (data.log_lower[i] - mean[:, i]) / theta["sigma"]
            if data.is_count[i]:
                low, later = (data.log_load[i] - mean[:, later]) / theta["sigma"], later + 1
            with np.errstate(divide="ignore"):
                each = np.log(between(error, low, high))
        rows += each
    likelihood = np.exp(rows - rows.max())
    value = math.log(likelihood.mean()) + rows.max()
    return value, float(likelihood.std() / likelihood.mean() / math.sqrt(n))


def iid_posterior(model, grids):
    """Return the log evidence of independent exact rows and a grid's weights.

    Parameters
    ----------
    model : Model
        Under ``iid`` or ``iid:student``; of one coefficient.
    grids : sequence of ndarray
        Points of each parameter, rising; trapezoids between them.

    Returns
    -------
    float, ndarray
        Log evidence, and posterior masses of the grid's points.
    """
    c, sigma = grids[:2]
    df = grids[2] if len(grids) > 2 else np.ones(1)
    residual = model.data.log_load - log_loads(model, np.ones(1)) + 2 * np.log(c)[:, None]
    value = np.empty((len(c), len(sigma), len(df)))
    for j, s in enumerate(sigma.tolist()):
        z = residual / s
        for k, nu in enumerate(df.tolist()):
            kind = stats.t(nu) if len(grids) > 2 else stats.norm
            value[:, j, k] = (kind.logpdf(z) - math.log(s)).sum(axis=-1)
    for i, (name, grid) in enumerate(zip(model.parameter_names, grids, strict=True)):
        shape = [1, 1, 1]
        shape[i] = -1
        width = np.gradient(grid)
        width[[0, -1]] /= 2
        value += (model.priors[name].log_pdf(grid) + np.log(width)).reshape(shape)
    total = float(logsumexp(value))
    return total, np.exp(value - total)
