"""Closed forms of a cylinder on a smooth flat (Hertz), in the ridge units of the study.

p is the load per projected area, so the line load is P' = 2 R p. Equation numbers refer to
doi:10.1016/j.ijssolstr.2019.06.026.
"""

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray


def hertz_constant(nu: ArrayLike = 0.5) -> FloatArray:
    """Return c = 2 sqrt(2/pi) sqrt(1 - nu^2), the half-width over R at p/E = 1.

    Parameters
    ----------
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        c; 1.382 at nu = 0.5, as published with eq. (3).

    References
    ----------
    doi:10.1016/j.ijssolstr.2019.06.026, eq. (3).

    Examples
    --------
    >>> round(float(hertz_constant(0.5)), 3)
    1.382
    """
    nu = np.asarray(nu, dtype=np.float64)
    return np.sqrt(8.0 / np.pi * (1.0 - nu**2))


def half_width(p_over_E: ArrayLike, *, nu: ArrayLike = 0.5) -> FloatArray:
    """Compute the contact half-width over R, w/R = c sqrt(p/E).

    Parameters
    ----------
    p_over_E : array_like of float, shape (...), dimensionless
        Load per projected area over Young's modulus.
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        w/R, by broadcasting.

    Notes
    -----
    *Validity.* Half-plane theory; a whole cylinder in small strain needs 1 % more load at
    w = 0.1 R and 3 % more at 0.2 R.

    References
    ----------
    Johnson, *Contact Mechanics* (1985), chapter 4, Hertz theory, doi:10.1017/CBO9781139171731.

    Examples
    --------
    >>> round(float(half_width(0.01)) / float(hertz_constant()), 12)  # sqrt(0.01)
    0.1
    """
    return hertz_constant(nu) * np.sqrt(np.asarray(p_over_E, dtype=np.float64))


def load_of_half_width(half_width_over_R: ArrayLike, *, nu: ArrayLike = 0.5) -> FloatArray:
    """Compute the load at a given contact half-width: p/E = (w/R)^2 / c^2.

    Parameters
    ----------
    half_width_over_R : array_like of float, shape (...), dimensionless
        Contact half-width over radius.
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        p/E, by broadcasting.

    Examples
    --------
    >>> round(float(load_of_half_width(0.1, nu=0.0)) / (np.pi / 800.0), 12)
    1.0
    """
    return (np.asarray(half_width_over_R, dtype=np.float64) / hertz_constant(nu)) ** 2


def ridge_units(
    p_over_E: ArrayLike, a_over_R: ArrayLike, b_over_R: ArrayLike, *, nu: ArrayLike = 0.5
) -> FloatArray:
    """Express the smooth contact length d in ridges, eqs (1, 2): Q' = 2 + (d-b)/(a+b).

    Parameters
    ----------
    p_over_E : array_like of float, shape (...), dimensionless
        Load per projected area over Young's modulus.
    a_over_R, b_over_R : array_like of float, shape (...), dimensionless
        Ridge and groove width over radius.
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        Continuous count Q', by broadcasting; below 2 while the contact is shorter than a groove.

    References
    ----------
    doi:10.1016/j.ijssolstr.2019.06.026, eqs (1, 2).

    Examples
    --------
    d = R: (1 - 0.01)/0.033 = 30 pitches beyond the first pair.

    >>> round(float(ridge_units(np.pi / 32.0, 0.023, 0.01, nu=0.0)), 9)
    32.0
    """
    a, b = np.asarray(a_over_R, dtype=np.float64), np.asarray(b_over_R, dtype=np.float64)
    return 2.0 + (2.0 * half_width(p_over_E, nu=nu) - b) / (a + b)


def transition_load(
    Q: ArrayLike, a_over_R: ArrayLike, b_over_R: ArrayLike, *, nu: ArrayLike = 0.5
) -> FloatArray:
    """Compute the load at which a smooth contact is as long as Q ridges, eqs (3, 4) inverted.

    p/E = ((h L + B/2)/c)^2 with h = Q/2 - 1, L = A + B: the half-width reaches the corner at
    b/2 + h pitches.

    Parameters
    ----------
    Q : array_like of float, shape (...), dimensionless
        Count of proximal corners.
    a_over_R, b_over_R : array_like of float, shape (...), dimensionless
        Ridge and groove width over radius, A and B.
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        p/E, by broadcasting.

    Notes
    -----
    *Validity.* Grooves are ignored, so the load of every ridged texture is over-estimated.

    References
    ----------
    doi:10.1016/j.ijssolstr.2019.06.026, eqs (3, 4).

    Examples
    --------
    >>> load = transition_load(4, 0.03, 0.02, nu=0.0)  # half-width 0.05 + 0.01
    >>> round(float(half_width(load, nu=0.0)), 12)
    0.06
    """
    pairs = 0.5 * np.asarray(Q, dtype=np.float64) - 1.0
    a, b = np.asarray(a_over_R, dtype=np.float64), np.asarray(b_over_R, dtype=np.float64)
    return load_of_half_width(pairs * (a + b) + 0.5 * b, nu=nu)
