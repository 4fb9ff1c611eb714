"""All transition loads of one texture from one Cholesky factor, for a given number of coefficients.

Transition k loads the strips 0 ... k-1 in full and none beyond, so its matrix is a leading block
of the matrix of the last transition, and so is its factor. Everything below follows from that.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from ridgebayes._types import BoolArray, FloatArray
from ridgebayes.contact.logkernel import cross_blocks, influence, lower_matrix, self_energies


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
    n, m = n_transitions, n_coefficients
    pitch = 2.0 + gap_ratio
    # Lengths now in units of half the whole extent: capacity 1/2, so the matrix is definite.
    half_width = 1.0 / (n * pitch - 0.5 * gap_ratio)
    log_half_width = math.log(half_width)
    scale = np.sqrt(self_energies(m))
    scale[0] = math.pi * math.sqrt(math.log(2.0) - log_half_width)

    matrix = lower_matrix(cross_blocks(gap_ratio, 2 * n - 1, m), n, log_half_width, scale)
    # The transpose of a C-ordered lower triangle is a Fortran-ordered upper one: no copy is made.
    factor, info = lapack.dpotrf(matrix.T, lower=0, clean=0, overwrite_a=1)
    if info != 0:
        raise np.linalg.LinAlgError(f"strip matrix is not positive definite (pivot {info})")

    rhs = np.empty((n * m, n + 2), order="F")
    rhs[:, 0] = _net_load(n, scale).ravel()
    rhs[:, 1] = _parabola(n, pitch, half_width, scale).ravel()
    rhs[:, 2:] = _corners(n, gap_ratio, log_half_width, scale).reshape(n * m, n)
    forward, _ = lapack.dtrtrs(factor, rhs, lower=0, trans=1, overwrite_b=1)
    load, parabola, corners = forward[:, 0], forward[:, 1], forward[:, 2:]

    # Rows of strip j take part in transition k only if j < k: from here on the others are zero.
    k = np.arange(1, n + 1)
    takes_part = np.repeat(np.arange(n), m)[:, None] < k
    corners = np.where(takes_part, corners, 0.0)
    last = slice(m - 1, None, m)
    load_load = np.cumsum(load * load)[last]
    load_parabola = np.cumsum(load * parabola)[last]
    x_corner = (0.5 * gap_ratio + k * pitch) * half_width
    shielding = 1.0 - load @ corners
    approach = (0.5 * x_corner**2 - parabola @ corners) / shielding
    one_side = approach * load_load - load_parabola
    F = 0.5 * math.pi * one_side / (pitch * half_width) ** 2

    padded = np.asfortranarray(np.where(takes_part, load[:, None] * approach, 0.0))
    padded -= np.where(takes_part, parabola[:, None], 0.0)
    solved, _ = lapack.dtrtrs(factor, padded, lower=0, trans=0, overwrite_b=1)
    coefficients = solved.reshape(n, m, n) / scale[:, None]
    mean = coefficients[:, 0].sum(axis=0) / k
    in_contact = np.arange(n)[:, None] < k
    tail = np.abs(coefficients[:, -2:]).max(axis=(0, 1)) / mean
    smallest = _smallest_pressure(coefficients, in_contact) / mean
    return StripSolution(F, tail, smallest, 1.0 / shielding)


def _net_load(n_strips: int, scale: FloatArray) -> FloatArray:
    """Integrate each basis function: the load functional, and the constant's right-hand side."""
    out = np.zeros((n_strips, scale.size))
    out[:, 0] = math.pi / scale[0]
    return out


def _parabola(n_strips: int, pitch: float, half_width: float, scale: FloatArray) -> FloatArray:
    """Project x^2/2 = (c + h s)^2/2 on the basis of each strip."""
    centre = (np.arange(n_strips) + 0.5) * pitch * half_width
    out = np.zeros((n_strips, scale.size))
    out[:, 0] = 0.5 * math.pi * (centre**2 + 0.5 * half_width**2) / scale[0]
    out[:, 1] = 0.5 * math.pi * centre * half_width / scale[1]
    out[:, 2] = 0.125 * math.pi * half_width**2 / scale[2]
    return out


def _corners(
    n_strips: int, gap_ratio: float, log_half_width: float, scale: FloatArray
) -> FloatArray:
    """Evaluate the potentials at the corners k = 1 ... n of strips j < k and of their mirrors.

    The corner is gap + (k-j-1) pitches from the near edge of strip j, and gap + (k+j) pitches
    from the near edge of its mirror image: one family of distances. Shape (strip, function, k).
    """
    parity = (-1.0) ** np.arange(scale.size)
    excess = gap_ratio + np.arange(2.0 * n_strips) * (2.0 + gap_ratio)
    potential = influence(excess, scale.size)
    potential[:, 0] -= math.pi * log_half_width
    potential /= scale
    out = np.zeros((n_strips, scale.size, n_strips))
    for j in range(n_strips):
        near = potential[: n_strips - j]
        far = potential[2 * j + 1 : n_strips + j + 1]
        out[j, :, j:] = (near + parity * far).T
    return out


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
