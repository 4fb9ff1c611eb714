"""Evidences by brute force: grids over all parameters that have no closed form, typed out."""

import numpy as np
from scipy import stats
from scipy.special import logsumexp


def modified_evidence(data):
    """Return ln Z and the mean of ln c of Modified with independent errors, by a grid."""
    a, b = data.a_over_R[data.texture], data.b_over_R[data.texture]
    at = 2 * np.log((data.Q / 2 - 1) * (a + b))
    log_c = np.linspace(np.log(1.38) - 0.8, np.log(1.38) + 0.8, 3_001)[:, None]
    log_sigma = np.linspace(np.log(1e-3), np.log(0.5), 601)
    square = ((data.log_load - at + 2 * log_c) ** 2).sum(axis=1)[:, None]
    sigma = np.exp(log_sigma)
    value = -0.5 * square / sigma**2 - len(data) * (log_sigma + 0.5 * np.log(2 * np.pi))
    value += stats.norm(np.log(1.38), 0.1).logpdf(log_c)
    value += stats.halfnorm(scale=0.05).logpdf(sigma) + log_sigma
    log_cell = np.log((log_c[1, 0] - log_c[0, 0]) * (log_sigma[1] - log_sigma[0]))
    weight = np.exp(value - logsumexp(value))
    return logsumexp(value) + log_cell, float((weight * log_c).sum())


def power_law_evidence(data, medians):
    """Return ln Z of the power law with independent errors, log K in closed form, by a grid."""
    log_sigma = np.linspace(np.log(1e-4), np.log(0.5), 2_001)
    total = stats.halfnorm(scale=0.05).logpdf(np.exp(log_sigma)) + log_sigma
    for j, median in enumerate(medians):
        own = data.log_load[data.texture == j] - 2 * np.log(
            (data.Q[data.texture == j] - 2) / median
        )
        # All rows of a texture share -2 log K, of sd 0.6: the matrix's determinant and inverse.
        n, noise = len(own), np.exp(2 * log_sigma)
        square = ((own**2).sum() - 0.36 * own.sum() ** 2 / (noise + 0.36 * n)) / noise
        log_size = (n - 1) * np.log(noise) + np.log(noise + 0.36 * n)
        total = total - 0.5 * (square + log_size + n * np.log(2 * np.pi))
    return logsumexp(total) + np.log(log_sigma[1] - log_sigma[0])
