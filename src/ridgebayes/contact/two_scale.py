"""Loads of a largely deformed body from half-plane loads: two scales.

Ridges are small beside the body. Its large deformation is that of a smooth cylinder; the effect of
ridges is local, and that on a half-plane. A texture's load p at which the body reaches a ridge
follows from the half-plane's by

    p r(p; nu)^2 = p_half-plane,

r being a smooth cylinder's contact half-width over Hertz's at the load p
(docs/derivations/two-scale.md).
"""

import csv
import math
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import NEO_HOOKEAN, FloatArray, Ogden
from ridgebayes.contact import hertz
from ridgebayes.contact.contact_solution import bearing_half_width, load_factor
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import InputError

LEAST_NU = 0.3
REACH = 0.5  # p/E to which the smooth cylinder was computed: data/make_smooth_cylinder.py
CHECKED = 0.33  # p/E to which loads on ridges were held against finite elements: docs/two-scale.md
CHECKED_STIFFENING = 0.2  # the same of other materials than the neo-Hookean
UNCHECKED = "not checked: no finite elements at this load to compare with"
BEYOND = f"not computed: p/E above {REACH:g}, or nu under {LEAST_NU:g}"
TABLE = Path(__file__).with_name("smooth_cylinder.csv")
# r - 1 as a polynomial in sqrt(p) without a constant, since r is 1 at p = 0, and in nu.
_ORDER_P, _ORDER_NU = 6, 4
_NEWTON_STEPS = 12
# Standard errors, from loads held against finite elements (docs/two-scale.md), by what they
# grow with.
ERRORS = Path(__file__).with_name("two_scale_errors.csv")


@cache
def _coefficients() -> FloatArray:
    """Return the coefficients of powers of sqrt(p), from 0, and of nu, by least squares."""
    nu, p, ratio = np.loadtxt(TABLE, delimiter=",", skiprows=1, unpack=True)
    terms = np.polynomial.polynomial.polyvander2d(np.sqrt(p), nu, [_ORDER_P, _ORDER_NU])
    first = _ORDER_NU + 1
    coefficients = np.linalg.lstsq(terms[:, first:], ratio - 1.0, rcond=None)[0]
    return np.concatenate([np.zeros(first), coefficients]).reshape(_ORDER_P + 1, first)


@cache
def _standard_errors() -> dict[str, float]:
    with ERRORS.open(encoding="utf-8", newline="") as file:
        return {row["by"]: float(row["standard_error"]) for row in csv.DictReader(file)}


@cache
def stiffening_of(nu: float, ogden: Ogden) -> tuple[FloatArray, float]:
    """Return `smooth.stiffening`, found once a body and process."""
    # scikit-fem loads slowly, so it is imported only where it is used.
    from ridgebayes.contact.smooth import stiffening

    return stiffening(nu, ogden)


def _body(nu: FloatArray, ogden: Ogden) -> tuple[FloatArray, float]:
    """Return the factor on r, as coefficients of powers of sqrt(p), and its largest load."""
    if ogden == NEO_HOOKEAN or not nu.size:
        return np.array([1.0]), REACH
    if not LEAST_NU <= nu.min() == nu.max():
        raise InputError(
            f"ogden: expected one poissons_ratio, {LEAST_NU:g} to 0.5, for a material of its own"
        )
    coefficients, reach = stiffening_of(float(nu.flat[0]), ogden)
    return np.append(1.0, coefficients[1:]), reach


def reach(nu: float = 0.5, ogden: Ogden = NEO_HOOKEAN) -> float:
    """Return p/E up to which r is known: 0.5, or less of a material that has no equilibrium."""
    return min(_body(np.array(nu), ogden)[1], REACH)


def checked(ogden: Ogden = NEO_HOOKEAN) -> float:
    """Return p/E up to which loads on ridges were held against finite elements."""
    return CHECKED if ogden == NEO_HOOKEAN else CHECKED_STIFFENING


def _polynomial(
    root: FloatArray, nu: FloatArray, by_material: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return r, and its derivative by the root of p."""
    of_p, whole = np.polynomial.polynomial, _coefficients()
    ratio = of_p.polyval2d(root, nu, whole)
    slope = of_p.polyval2d(root, nu, of_p.polyder(whole, axis=0))
    ratio, body = 1.0 + ratio, of_p.polyval(root, by_material)
    return ratio * body, slope * body + ratio * of_p.polyval(root, of_p.polyder(by_material))


def width_ratio(p_over_E: ArrayLike, nu: ArrayLike = 0.5, ogden: Ogden = NEO_HOOKEAN) -> FloatArray:
    """Return r, a smooth cylinder's contact half-width over that of Hertz at the same load.

    Parameters
    ----------
    p_over_E : array_like of float, shape (...), dimensionless
        Load per projected area over Young's modulus.
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio, 0.3 to 0.5.
    ogden : tuple of (float, float), optional
        The material, as in `contact.cylinder.material.Material`; neo-Hookean if not given.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        r, by broadcasting; NaN above p/E = 0.5, and where nu is under 0.3.

    Raises
    ------
    InputError
        If the material is another one and nu is not one ratio from 0.3 on.

    Notes
    -----
    *Validity.* Between two flat plates or with a mid-plane that stays flat: by symmetry the same.

    *Accuracy.* 2e-4; 1e-3 above p/E = 0.2 where nu is below 0.4; 2e-3 of another material.

    *Cost.* Of another material some 15 CPU seconds, once in a process.

    Examples
    --------
    >>> width_ratio(0.1, [0.5, 0.3]).round(3).tolist()
    [0.986, 0.906]
    """
    p, nu = np.broadcast_arrays(np.asarray(p_over_E, float), np.asarray(nu, float))
    by_material, reach = _body(nu, ogden)
    ratio, _ = _polynomial(np.sqrt(p), nu, by_material)
    return np.where((p <= reach) & (nu >= LEAST_NU), ratio, np.nan)


def half_plane_load(
    p_over_E: ArrayLike, nu: ArrayLike = 0.5, ogden: Ogden = NEO_HOOKEAN
) -> FloatArray:
    """Return the load p r^2 under which a half-plane does what the body does under p.

    Parameters
    ----------
    p_over_E, nu : array_like of float, shape (...), dimensionless
        As in `width_ratio`.
    ogden : tuple of (float, float), optional
        As in `width_ratio`.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        By broadcasting; NaN above p/E = 0.5.
    """
    return np.asarray(p_over_E, float) * width_ratio(p_over_E, nu, ogden) ** 2


def load_of(half_plane: ArrayLike, nu: ArrayLike = 0.5, ogden: Ogden = NEO_HOOKEAN) -> FloatArray:
    """Return the load p under which the body does what a half-plane does under another.

    Parameters
    ----------
    half_plane : array_like of float, shape (...), dimensionless
        p r^2.
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio, 0.3 to 0.5.
    ogden : tuple of (float, float), optional
        As in `width_ratio`.

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
    by_material, reach = _body(nu, ogden)
    within = wanted <= half_plane_load(reach, nu, ogden)
    p = np.where(within, wanted, np.nan)
    for _ in range(_NEWTON_STEPS):
        root = np.sqrt(p)
        ratio, slope = _polynomial(root, nu, by_material)
        # d(p r^2)/dp = r^2 + r sqrt(p) dr/dsqrt(p)
        p = np.minimum(p + (wanted - p * ratio**2) / (ratio * (ratio + root * slope)), reach)
    return p


def relative_error(
    p_over_E: ArrayLike, profile: Profile, nu: ArrayLike = 0.5, ogden: Ogden = NEO_HOOKEAN
) -> FloatArray:
    """Return the relative standard error of loads: what two scales neglect.

    Ridges lower the load at which a contact reaches as far, large deformation raises it. Both are
    taken into account; what deformation changes in the ridges' effect is not.

    Parameters
    ----------
    p_over_E : array_like of float, shape (...), dimensionless
        Loads.
    profile : Profile
        The rigid side.
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio.
    ogden : tuple of (float, float), optional
        As in `width_ratio`.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        By broadcasting; NaN above p/E = 0.5.

    Notes
    -----
    *Accuracy.* Held against finite elements in docs/two-scale.md.
    """
    ratio, pitch = width_ratio(p_over_E, nu, ogden), profile.pitch
    width = ratio * hertz.half_width(p_over_E, nu=nu)
    # Round corners are touched in part: ridges are as wide as contact on them may be.
    loads = load_factor(0.0) * (1 - np.square(nu)) * half_plane_load(p_over_E, nu, ogden)
    borne = [2 * bearing_half_width(profile, W) for W in loads.ravel().tolist()]
    ridge = np.reshape(borne, loads.shape)
    # How much further the contact reaches than a smooth body's: its compliance between ridges
    # (docs/derivations/half-plane.md, "Very many ridges"), and 0.1 where that is nothing.
    compliance = -np.log(np.sin(0.5 * math.pi * ridge / pitch))
    further = pitch * (0.1 + 0.5 * compliance)
    by_ridges = 1.0 - (width / (width + further)) ** 2
    pressure = np.asarray(p_over_E, float) / width * pitch / ridge
    by_body = 1.0 - ratio**2
    by_material = np.abs(1.0 - (ratio / width_ratio(p_over_E, nu)) ** 2)
    errors = _standard_errors()
    share = errors["width"] * width**2 + errors["body"] * by_body + errors["pressure"] * pressure
    share = share + errors["material"] * np.sqrt(by_material)
    error = np.hypot(errors["table"] + errors["table and body"] * by_body, by_ridges * share)
    # Over the middle of a groove or a ridge there is no lateral force, and no such error.
    by_offset = errors["offset"] * math.sin(2 * math.pi * profile.offset)
    return np.asarray(np.hypot(error, by_offset))
