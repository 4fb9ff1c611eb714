"""All transition loads of one sharp, centred texture, for a given number of coefficients.

Transition k loads the strips 0 ... k-1 in full and none beyond: events of a `RidgeRow`, one linear
solve with one Cholesky factor.
"""

import math
from dataclasses import dataclass

import numpy as np

from ridgebayes._types import BoolArray, FloatArray
from ridgebayes.contact.ridge_row import RidgeRow
from ridgebayes.contact.rigid_profile import Profile


@dataclass(frozen=True)
class StripSolution:
    """Transitions 1 ... n of one texture, solved with a fixed number of coefficients.

    Attributes
    ----------
    F : ndarray of float, shape (n_transition,), dimensionless
        Load times (1 - nu^2) over (pitch/R)^2.
    tail : ndarray of float, shape (n_transition,), dimensionless
        Largest of the last two coefficients on any strip, over the mean of the first.
    smallest_pressure : ndarray of float, shape (n_transition,), dimensionless
        Smallest p(s) sqrt(1-s^2) at Chebyshev points, ends included, over its mean.
    amplification : ndarray of float, shape (n_transition,), dimensionless
        By what rounding errors are magnified in the approach.
    """

    F: FloatArray
    tail: FloatArray
    smallest_pressure: FloatArray
    amplification: FloatArray


def solve_strips(gap_ratio: float, n_transitions: int, n_coefficients: int) -> StripSolution:
    """Solve the frictionless parabola on flat strips at every transition.

    -int q ln|x - xi| dxi = d - x^2/2 on the strips in contact, gap 0 at the next proximal corner.

    Parameters
    ----------
    gap_ratio : float, scalar, strip half-widths
        Groove width over half the ridge width, 2 b/a.
    n_transitions : int, scalar, count
        Transitions 1 ... n_transitions; transition k has k strips on each side.
    n_coefficients : int, scalar, count
        Chebyshev coefficients per strip, at least 3 (the parabola itself needs them).

    Returns
    -------
    StripSolution
        Arrays over transitions.

    Raises
    ------
    numpy.linalg.LinAlgError
        If rounding has cost the matrix its positive definiteness.

    Notes
    -----
    *Accuracy.* The error of F falls as rho^(-2 n_coefficients), `logkernel.log_ellipse`.

    *Cost.* One factorisation of size n_transitions x n_coefficients.

    References
    ----------
    Johnson, *Contact Mechanics* (1985), chapter 2, line loading of an elastic half-space,
    doi:10.1017/CBO9781139171731. `docs/derivations/half-plane.md` for the method.

    Examples
    --------
    Very narrow grooves are no grooves: F_1 -> pi/8.

    >>> round(float(solve_strips(1e-6, 1, 900).F[0]) * 8.0 / math.pi, 4)
    1.0
    """
    row = RidgeRow.of(Profile(2.0, gap_ratio), n_transitions, n_coefficients, 1.0)
    moments, _, lift = row.covered_in_full(np.arange(n_transitions))
    k = np.arange(1, n_transitions + 1)
    mean = moments[:, 0].sum(axis=0) / k
    tail = np.abs(moments[:, -2:]).max(axis=(0, 1)) / mean
    smallest = _smallest_pressure(moments, row.within) / mean
    F = 0.25 * math.pi * row.load(moments) / row.profile.pitch**2
    return StripSolution(F, tail, smallest, 1.0 / (1.0 - lift))


def _smallest_pressure(coefficients: FloatArray, in_contact: BoolArray) -> FloatArray:
    """Return the minimum of p(s) sqrt(1-s^2) over Chebyshev-Lobatto points and strips.

    At s = +-1 this is the strength of the edge singularity: it turns negative before the pressure
    does anywhere a point would see it.
    """
    m = coefficients.shape[1]
    points = np.arange(2 * m + 1) * (math.pi / (2 * m))
    values = np.tensordot(np.cos(points[:, None] * np.arange(m)), coefficients, axes=(1, 1))
    value: FloatArray = np.where(in_contact, values.min(axis=0), np.inf).min(axis=0)
    return value
