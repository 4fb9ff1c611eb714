"""Loads of a largely deformed body from half-plane loads, by separation of two scales.

Ridges are small beside the body. The large deformation is that of a smooth cylinder, and the local
effect of ridges is that on a half-plane. The load p at which the body reaches a ridge follows from
the half-plane's load by

    p r(p; nu)^2 = p_half-plane,

where r is a smooth cylinder's contact half-width over Hertz's half-width at the load p
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

LEAST_NU = 0.3  # smallest Poisson's ratio of the table
REACH = 0.5  # largest p/E of the smooth cylinder's table, from data/make_smooth_cylinder.py
CHECKED = 0.33  # p/E to which loads on ridges were compared with finite elements: docs/two-scale.md
CHECKED_STIFFENING = 0.2  # the same limit for materials other than neo-Hookean
UNCHECKED = "not checked: no finite elements at this load to compare with"
BEYOND = f"not computed: p/E above {REACH:g}, or nu under {LEAST_NU:g}"
TABLE = Path(__file__).with_name("smooth_cylinder.csv")
# Orders of the polynomials r - 1 in sqrt(p) and nu, which are 0 at p = 0.
_ORDER_P, _ORDER_NU = 6, 4
# Standard errors, from a comparison of loads with finite elements (docs/two-scale.md).
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
    """Return `smooth.stiffening`, computed once for each body and process."""
    # scikit-fem takes long to import.
    from ridgebayes.contact.smooth import stiffening

    return stiffening(nu, ogden, _ORDER_P)


def _material_factor(nu: FloatArray, ogden: Ogden) -> tuple[FloatArray, float]:
    """Return the material's factor on r, as coefficients of powers of sqrt(p), and its limit."""
    if ogden == NEO_HOOKEAN or not nu.size:
        return np.array([1.0]), REACH
    if not LEAST_NU <= nu.min() == nu.max():
        raise InputError(
            f"ogden: expected one poissons_ratio, {LEAST_NU:g} to 0.5, for a material of its own"
        )
    coefficients, reach = stiffening_of(float(nu.flat[0]), ogden)
    return np.append(1.0, coefficients[1:]), reach


def reach(nu: float = 0.5, ogden: Ogden = NEO_HOOKEAN) -> float:
    """Return the largest p/E with known r: 0.5, or less if the material has no equilibrium."""
    return min(_material_factor(np.array(nu), ogden)[1], REACH)


def checked(ogden: Ogden = NEO_HOOKEAN) -> float:
    """Return the largest p/E at which loads on ridges were compared with finite elements."""
    return CHECKED if ogden == NEO_HOOKEAN else CHECKED_STIFFENING


def _polynomial(
    root: FloatArray, nu: FloatArray, by_material: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return r and its derivative by the root of p."""
    of_p, whole = np.polynomial.polynomial, _coefficients()
    ratio = of_p.polyval2d(root, nu, whole)
    slope = of_p.polyval2d(root, nu, of_p.polyder(whole, axis=0))
    ratio, body = 1.0 + ratio, of_p.polyval(root, by_material)
    return ratio * body, slope * body + ratio * of_p.polyval(root, of_p.polyder(by_material))


def width_ratio(p_over_E: ArrayLike, nu: ArrayLike = 0.5, ogden: Ogden = NEO_HOOKEAN) -> FloatArray:
    """Return r, a smooth cylinder's contact half-width over Hertz's half-width at the same load.

    Parameters
    ----------
    p_over_E : array_like of float, shape (...), dimensionless
        Load per projected area over Young's modulus.
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio, 0.3 to 0.5.
    ogden : tuple of (float, float), optional
        Material, see `contact.cylinder.material.Material`; neo-Hookean if not given.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        r, by broadcasting; NaN above p/E = 0.5, and for nu below 0.3.

    Raises
    ------
    InputError
        If the material is not neo-Hookean, and nu is not a single ratio of at least 0.3.

    Notes
    -----
    *Validity.* Bodies between two flat plates or, equivalently by symmetry, with a flat mid-plane.

    *Accuracy.* 2e-4; 1e-3 above p/E = 0.2 if nu is below 0.4; 2e-3 for other materials.

    *Cost.* About 15 CPU seconds for a material other than neo-Hookean, once per process.

    Examples
    --------
    >>> width_ratio(0.1, [0.5, 0.3]).round(3).tolist()
    [0.986, 0.906]
    """
    p, nu = np.broadcast_arrays(np.asarray(p_over_E, float), np.asarray(nu, float))
    by_material, reach = _material_factor(nu, ogden)
    ratio, _ = _polynomial(np.sqrt(p), nu, by_material)
    return np.where((p <= reach) & (nu >= LEAST_NU), ratio, np.nan)


def half_plane_load(
    p_over_E: ArrayLike, nu: ArrayLike = 0.5, ogden: Ogden = NEO_HOOKEAN
) -> FloatArray:
    """Return the half-plane load p r^2 that has the same effect as the body's load p.

    Parameters
    ----------
    p_over_E, nu : array_like of float, shape (...), dimensionless
        See `width_ratio`.
    ogden : tuple of (float, float), optional
        See `width_ratio`.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        p r^2 over E, by broadcasting; NaN above p/E = 0.5.
    """
    return np.asarray(p_over_E, float) * width_ratio(p_over_E, nu, ogden) ** 2


def load_of(half_plane: ArrayLike, nu: ArrayLike = 0.5, ogden: Ogden = NEO_HOOKEAN) -> FloatArray:
    """Return the body's load p that has the same effect as a half-plane load.

    Parameters
    ----------
    half_plane : array_like of float, shape (...), dimensionless
        Half-plane load p r^2 over E.
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio, 0.3 to 0.5.
    ogden : tuple of (float, float), optional
        See `width_ratio`.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        p/E, by broadcasting; NaN above 0.5, and for NaN loads.

    Examples
    --------
    >>> round(float(load_of(half_plane_load(0.2))), 12)
    0.2
    """
    loads, nu = np.broadcast_arrays(np.asarray(half_plane, float), np.asarray(nu, float))
    by_material, reach = _material_factor(nu, ogden)
    within = loads <= half_plane_load(reach, nu, ogden)
    p = np.where(within, loads, np.nan)
    last = np.zeros_like(p)
    # The error of a Newton step is quadratic, so that of the last one is rounding.
    while (np.abs(p - last) > math.sqrt(np.finfo(np.float64).eps) * p).any():
        last, root = p, np.sqrt(p)
        ratio, slope = _polynomial(root, nu, by_material)
        # d(p r^2)/dp = r^2 + r sqrt(p) dr/dsqrt(p)
        p = np.minimum(p + (loads - p * ratio**2) / (ratio * (ratio + root * slope)), reach)
    return p


def relative_error(
    p_over_E: ArrayLike, profile: Profile, nu: ArrayLike = 0.5, ogden: Ogden = NEO_HOOKEAN
) -> FloatArray:
    """Return the relative standard error of loads due to the separation of scales.

    Ridges lower the load of a contact of given width, and large deformation raises it. Loads
    include both effects, but not the change of the ridges' effect by large deformation.

    Parameters
    ----------
    p_over_E : array_like of float, shape (...), dimensionless
        Loads.
    profile : Profile
        Rigid profile.
    nu : array_like of float, shape (...), dimensionless
        Poisson's ratio.
    ogden : tuple of (float, float), optional
        See `width_ratio`.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        Relative standard error, by broadcasting; NaN above p/E = 0.5.

    Notes
    -----
    *Accuracy.* Compared with finite elements in docs/two-scale.md.
    """
    ratio, pitch = width_ratio(p_over_E, nu, ogden), profile.pitch
    width = ratio * hertz.half_width(p_over_E, nu=nu)
    # Round corners are touched in part: the effective ridge width is that of the contact.
    loads = load_factor(0.0) * (1 - np.square(nu)) * half_plane_load(p_over_E, nu, ogden)
    borne = [2 * bearing_half_width(profile, W) for W in loads.ravel().tolist()]
    ridge = np.reshape(borne, loads.shape)
    # Increase of the contact width by ridges: half their compliance, in pitches
    # (docs/derivations/half-plane.md, "Very many ridges"), and a margin of 0.1.
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
    # Over the centre of a groove or ridge the lateral force and its error are 0.
    by_offset = errors["offset"] * math.sin(2 * math.pi * profile.offset)
    return np.asarray(np.hypot(error, by_offset))
