"""Galerkin blocks of the logarithmic kernel on equal strips, in Chebyshev functions.

Lengths are over the strip half-width a/2; `gap_ratio` is the groove width 2 b/a, so the pitch is
2 + gap_ratio. Strip j = 0, 1, ... has its centre at (j + 1/2) pitches, and its mirror image is
strip -1 - j, so every distance is a whole number of pitches. The derivation is
`docs/derivations/half-plane.md`.
"""

import math

import numpy as np

from ridgebayes._types import FloatArray


def log_ellipse(gap_ratio: FloatArray | float) -> FloatArray:
    """Return ln(rho) of the largest Bernstein ellipse that contains no neighbour strip.

    ln(rho) = arccosh(1 + 2 b/a): pressures and fields on a strip, in its local coordinate, have
    Chebyshev coefficients that fall as rho^-m.

    Parameters
    ----------
    gap_ratio : float or ndarray of float, shape (...), strip half-widths
        Groove width over half the ridge width, 2 b/a.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        ln(rho), without cancellation for narrow grooves.

    Examples
    --------
    >>> round(float(log_ellipse(0.25)), 12) == round(math.log(2.0), 12)  # 5/4 = cosh(ln 2)
    True
    """
    value: FloatArray = np.log1p(gap_ratio + np.sqrt(gap_ratio * (2.0 + gap_ratio)))
    return value


def inverse_rho(excess: FloatArray) -> FloatArray:
    """Return z = x - sqrt(x^2 - 1) at x = 1 + excess, of any shape, without cancellation."""
    value: FloatArray = 1.0 / (1.0 + excess + np.sqrt(excess * (2.0 + excess)))
    return value


def influence(excess: FloatArray, n_coefficients: int) -> FloatArray:
    """Evaluate the potential of T_n(t)/sqrt(1-t^2) to the right of its strip [-1, 1].

    Phi_n(x) = -int T_n(t)/sqrt(1-t^2) ln|x-t| dt, with z = x - sqrt(x^2-1):
    Phi_0 = pi ln(2 z) and Phi_n = (pi/n) z^n.

    Parameters
    ----------
    excess : ndarray of float, shape (...), strip half-widths
        Distance x - 1 >= 0 from the strip's right edge; used instead of x to avoid cancellation
        for narrow grooves.
    n_coefficients : int, scalar, count
        Number of functions, n = 0 ... n_coefficients - 1.

    Returns
    -------
    ndarray of float, shape (..., n_coefficients), dimensionless
        Phi_n(1 + excess). To the left of the strip the potential is (-1)^n times this.

    References
    ----------
    Mason and Handscomb, *Chebyshev Polynomials* (2002), on integral equations.

    Examples
    --------
    At x = 5/4, z = 1/2, so that Phi_0 = pi ln 1 = 0 and Phi_1 = pi/2:

    >>> influence(np.array([0.25]), 2) / math.pi
    array([[0. , 0.5]])
    """
    z = inverse_rho(excess)
    out = np.empty((*excess.shape, n_coefficients))
    out[...] = z[..., None]
    out[..., 0] = 1.0
    np.multiply.accumulate(out, axis=-1, out=out)
    out[..., 1:] *= math.pi / np.arange(1, n_coefficients)
    out[..., 0] = math.pi * np.log(2.0 * z)
    return out


def cross_blocks(gap_ratio: float, n_distances: int, n_coefficients: int) -> FloatArray:
    """Compute the Galerkin blocks of two strips at distances of 1, 2, ... pitches.

    G_d[m, n] = int T_m(s)/sqrt(1-s^2) Phi_n(d pitch + s) ds by Gauss-Chebyshev quadrature; the
    Bernstein ellipse determines the number of nodes.

    Parameters
    ----------
    gap_ratio : float, scalar, strip half-widths
        Groove width over half the ridge width, 2 b/a.
    n_distances : int, scalar, count
        Number of distances, 1 ... n_distances pitches, with the observer right of the source.
    n_coefficients : int, scalar, count
        Functions per strip.

    Returns
    -------
    ndarray of float, shape (n_distances, n_coefficients, n_coefficients), dimensionless
        Blocks; the transpose holds for the observer left of the source.

    Notes
    -----
    *Cost.* n_distances x nodes x n_coefficients^2 multiplications, one matrix product per block.

    Examples
    --------
    Far apart only the net load acts, -ln(distance), here 10^6 half-widths:

    >>> block = cross_blocks(1e6 - 2.0, 1, 2)[0]
    >>> round(float(block[0, 0]) / math.pi**2 / -math.log(1e6), 9)
    1.0
    """
    # The integrand is a polynomial of degree m < M times a function analytic inside the ellipse,
    # so the rule of q nodes aliases at rho^-(2q - M), which is at most the rounding error.
    by_ellipse = -math.log(np.finfo(np.float64).eps) / float(log_ellipse(gap_ratio))
    n_nodes = 4 + math.ceil(0.5 * (by_ellipse + n_coefficients))
    theta = (np.arange(n_nodes) + 0.5) * (math.pi / n_nodes)
    trial = np.cos(np.arange(n_coefficients)[:, None] * theta) * (math.pi / n_nodes)
    one_plus_s = 2.0 * np.cos(0.5 * theta) ** 2
    d = np.arange(n_distances)[:, None]
    # x - 1 = d pitch + s - 1 for d = 1, 2, ... pitches, summed from positive terms only.
    excess = gap_ratio + d * (2.0 + gap_ratio) + one_plus_s
    return trial @ influence(excess, n_coefficients)


def self_energies(n_coefficients: int) -> FloatArray:
    """Return the diagonal of a strip's block with itself, for half-width 1.

    Parameters
    ----------
    n_coefficients : int, scalar, count
        Functions per strip.

    Returns
    -------
    ndarray of float, shape (n_coefficients,), dimensionless
        pi^2 ln 2, then pi^2/(2m).

    Examples
    --------
    >>> self_energies(3)[1:] * 2.0 / math.pi**2
    array([1. , 0.5])
    """
    m = np.arange(1, n_coefficients)
    return np.concatenate(([math.pi**2 * math.log(2.0)], math.pi**2 / (2.0 * m)))
