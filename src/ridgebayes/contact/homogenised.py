r"""Transition loads of very many ridges: the smooth contact with the compliance of a ridge's scale.

A nominal pressure on periodic strips brings the body down by more than on a plane, in proportion to
:math:`\Lambda = \ln(1/\sin(\pi a/2\lambda))`. To a wide contact that is a change of its edge alone:

.. math:: F_k = \frac{\pi}{8} (k + \beta_k)^2, \qquad
          \beta_k = \beta_m - \frac{\Lambda}{\pi^2} \ln\frac{k}{m} + O(1/m),

Hertz's load of a half-width of k + beta pitches. Given one exact load far enough out, those beyond
follow without a solution.
"""

import math

import numpy as np

from ridgebayes._types import FloatArray, IntArray


def edge_constants(F: FloatArray) -> FloatArray:
    """Return beta of loads F_1 ... F_n, shape (n,), dimensionless."""
    return np.sqrt(8 * F / math.pi) - np.arange(1, len(F) + 1)


def beyond(F: FloatArray, gap_ratio: float, k: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return loads of transitions beyond those known, and estimates of their relative errors.

    Parameters
    ----------
    F : ndarray of float, shape (n,), dimensionless
        Exact loads F_1 ... F_n, n at least 4.
    gap_ratio : float
        Groove width over half the ridge width, 2 b/a.
    k : ndarray of int, shape (n_beyond,)
        Transitions, above n.

    Returns
    -------
    F, rel_error : ndarray of float, shape (n_beyond,), dimensionless
        The error is taken from how well the law holds over the last two doublings below n.

    References
    ----------
    `docs/derivations/half-plane.md`, "Very many ridges".
    """
    n, beta = len(F), edge_constants(F)
    share = 2.0 / (2.0 + gap_ratio)  # a over the pitch
    slope = math.log(1 / math.sin(0.5 * math.pi * share)) / math.pi**2
    half, quarter = n // 2, n // 4
    misses = [
        beta[far - 1] - beta[near - 1] + slope * math.log(far / near)
        for far, near in ((n, half), (half, quarter))
    ]
    ratio = k / n
    found = beta[n - 1] - slope * np.log(ratio)
    error = (abs(misses[0]) + abs(misses[1])) * (1 + np.log2(ratio))
    return math.pi / 8 * (k + found) ** 2, 2 * error / k
