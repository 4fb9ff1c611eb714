"""Loads of a largely deformed body from half-plane loads: two scales.

Ridges are small beside the body. Its large deformation is smooth, and is that of a smooth cylinder;
what ridges do is local, and the half-plane's. A texture's load p at which the body reaches a ridge
follows from the half-plane's by

    p r(p; nu)^2 = p_half-plane,

r being a smooth cylinder's contact half-width over Hertz's at the load p
(docs/derivations/two-scale.md).
"""

import math
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray
from ridgebayes.contact import hertz

LEAST_NU = 0.3
REACH = 0.5  # p/E to which the smooth cylinder was computed: data/make_smooth_cylinder.py
CHECKED = 0.33  # p/E to which loads on ridges were held against finite elements: docs/two-scale.md
UNCHECKED = f"not checked: no finite elements above p/E = {CHECKED:g} to compare with"
BEYOND = f"not computed: p/E above {REACH:g}, or nu under {LEAST_NU:g}"
TABLE = Path(__file__).with_name("smooth_cylinder.csv")
# r - 1 as a polynomial in sqrt(p) without a constant, for at p = 0 r is 1, and in nu.
_ORDER_P, _ORDER_NU = 6, 4
_NEWTON_STEPS = 12
# Standard errors: of r^2, at no load and over 1 - r^2; of ridges' effect, over it, by the square
# of the half-width, by 1 - r^2, and by the mean pressure on ridges.
_TABLE_ERROR, _TABLE_GROWTH = 4e-4, 4e-3
_BY_WIDTH, _BY_BODY, _BY_PRESSURE = 0.05, 0.1, 0.01
OFF_CENTRE = 4e-3  # of loads of bodies off centre, beside these


@cache
def _coefficients() -> FloatArray:
    """Return the coefficients of powers of sqrt(p), from 0, and of nu, by least squares."""
    nu, p, ratio = np.loadtxt(TABLE, delimiter=",", skiprows=1, unpack=True)
    terms = np.polynomial.polynomial.polyvander2d(np.sqrt(p), nu, [_ORDER_P, _ORDER_NU])
    first = _ORDER_NU + 1
    found = np.linalg.lstsq(terms[:, first:], ratio - 1.0, rcond=None)[0]
    return np.concatenate([np.zeros(first), found]).reshape(_ORDER_P + 1, first)


def width_ratio(p_over_E: ArrayLike, nu: ArrayLike = 0.5) -> FloatArray:
    """Return r, a smooth cylinder's contact half-width over that of Hertz at the same load.

    Parameters
    ----------
    p_over_E : array_like of float, shape (...), dimensionless
        Load per projected area over Young's modulus.
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio, 0.3 to 0.5.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        r, by broadcasting; NaN above p/E = 0.5, and where nu is under 0.3.

    Notes
    -----
    *Validity.* Neo-Hookean, between two flat plates or with a mid-plane that stays flat: by
    symmetry the same.

    *Accuracy.* 2e-4; 1e-3 above p/E = 0.2 where nu is below 0.4.

    Examples
    --------
    >>> width_ratio(0.1, [0.5, 0.3]).round(3).tolist()
    [0.986, 0.906]
    """
    p, nu = np.broadcast_arrays(np.asarray(p_over_E, float), np.asarray(nu, float))
    ratio = 1.0 + np.polynomial.polynomial.polyval2d(np.sqrt(p), nu, _coefficients())
    return np.where((p <= REACH) & (nu >= LEAST_NU), ratio, np.nan)


def half_plane_load(p_over_E: ArrayLike, nu: ArrayLike = 0.5) -> FloatArray:
    """Return the load p r^2 under which a half-plane does what the body does under p.

    Parameters
    ----------
    p_over_E, nu : array_like of float, shape (...), dimensionless
        As of `width_ratio`.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        By broadcasting; NaN above p/E = 0.5.
    """
    return np.asarray(p_over_E, float) * width_ratio(p_over_E, nu) ** 2


def load_of(half_plane: ArrayLike, nu: ArrayLike = 0.5) -> FloatArray:
    """Return the load p under which the body does what a half-plane does under another.

    Parameters
    ----------
    half_plane : array_like of float, shape (...), dimensionless
        p r^2.
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio, 0.3 to 0.5.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        p/E, by broadcasting; NaN above 0.5, and where a load is NaN.

    Examples
    --------
    >>> round(float(load_of(half_plane_load(0.2))), 12)
    0.2
    """
    wanted, nu = np.broadcast_arrays(np.asarray(half_plane, float), np.asarray(nu, float))
    slope = np.polynomial.polynomial.polyder(_coefficients(), axis=0)
    within = wanted <= half_plane_load(REACH, nu)
    p = np.where(within, wanted, np.nan)
    for _ in range(_NEWTON_STEPS):
        root, ratio = np.sqrt(p), width_ratio(p, nu)
        # d(p r^2)/dp = r^2 + r sqrt(p) dr/dsqrt(p)
        rate = ratio * (ratio + root * np.polynomial.polynomial.polyval2d(root, nu, slope))
        p = np.minimum(p + (wanted - p * ratio**2) / rate, REACH)
    return p


def relative_error(
    p_over_E: ArrayLike, a_over_R: float, b_over_R: float, nu: ArrayLike = 0.5
) -> FloatArray:
    """Return the relative standard error of loads: what two scales neglect.

    Ridges lower the load at which a contact reaches as far, large deformation raises it. Both are
    taken into account; what deformation changes in the ridges' effect is not.

    Parameters
    ----------
    p_over_E : array_like of float, shape (...), dimensionless
        Loads.
    a_over_R, b_over_R : float, scalar, dimensionless
        Ridge and groove width.
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        By broadcasting; NaN above p/E = 0.5.

    Notes
    -----
    *Accuracy.* Held against finite elements in docs/two-scale.md.
    """
    ratio, pitch = width_ratio(p_over_E, nu), a_over_R + b_over_R
    width = ratio * hertz.half_width(p_over_E, nu=nu)
    # By how much further than a smooth body's the contact reaches: its compliance between ridges
    # (docs/derivations/half-plane.md, "Very many ridges"), and 0.1 where that is nothing.
    compliance = -math.log(math.sin(0.5 * math.pi * a_over_R / pitch))
    further = pitch * (0.1 + 0.5 * compliance)
    by_ridges = 1.0 - (width / (width + further)) ** 2
    pressure = np.asarray(p_over_E, float) / width * pitch / a_over_R
    by_body = 1.0 - ratio**2
    share = _BY_WIDTH * width**2 + _BY_BODY * by_body + _BY_PRESSURE * pressure
    return np.hypot(_TABLE_ERROR + _TABLE_GROWTH * by_body, by_ridges * share)
