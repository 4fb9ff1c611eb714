"""An independence move: candidates from a Student t fitted to the posterior beforehand.

Where the fit is good almost every candidate is accepted and steps hardly remember each other; where
it is poor the Metropolis-Hastings ratio still leaves the posterior exact, and the moves mixed with
it carry the walkers.
"""

import math
from collections.abc import Callable

import numpy as np

from ridgebayes._types import FloatArray

Proposal = Callable[[FloatArray, np.random.RandomState], tuple[FloatArray, FloatArray]]


def student_independence(
    df: float = 10.0,
    scale: float = 1.05,
    centre: FloatArray | float = 0.0,
    factor: FloatArray | None = None,
) -> Proposal:
    """Return a proposal function for `emcee.moves.MHMove` in whitened coordinates.

    Parameters
    ----------
    df : float, optional
        Degrees of freedom; small enough for the proposal's tails to cover the posterior's.
    scale : float, optional
        Width of the t in units of `factor`.
    centre : ndarray of float, shape (d,), optional
        Centre of the t.
    factor : ndarray of float, shape (d, d), optional
        Lower Cholesky factor of the t's shape; the identity if not given.

    Returns
    -------
    callable
        ``(coordinates (n, d), RandomState) -> (candidates (n, d), log q(old) - log q(new) (n,))``.

    Examples
    --------
    >>> propose = student_independence()
    >>> candidates, log_ratio = propose(np.zeros((3, 2)), np.random.RandomState(0))
    >>> candidates.shape, bool(np.all(log_ratio > 0))
    ((3, 2), True)
    """
    inverse = None if factor is None else np.linalg.inv(factor)

    def log_q(z: FloatArray) -> FloatArray:
        d = z.shape[1]
        y = z - centre if inverse is None else (z - centre) @ inverse.T
        return -0.5 * (df + d) * np.log1p((y * y).sum(axis=1) / (df * scale**2))

    def propose(z: FloatArray, random: np.random.RandomState) -> tuple[FloatArray, FloatArray]:
        n, d = z.shape
        stretch = scale * math.sqrt(df) / np.sqrt(random.chisquare(df, size=(n, 1)))
        steps = random.standard_normal((n, d)) * stretch
        candidates = centre + (steps if factor is None else steps @ factor.T)
        return candidates, log_q(z) - log_q(candidates)

    return propose
