"""The terms of friction, on plain arrays."""

import math

import numpy as np

from ridgebayes._types import FloatArray

_OF_TERMS = ("tau0", "alpha", "area_factor", "beta", "kappa")
PARAMETERS = (*_OF_TERMS, "tau_subject", "tau_session", "tau_rig", "sigma")
COEFFICIENTS = ("tau0", "alpha", "beta", "kappa")  # one of them has to be there
TERMS = ("adhesion", "deformation", "interlocking")
EFFECTS = ("subject", "session", "rig", "repeat")


def coefficients(theta: FloatArray) -> FloatArray:
    """Return what the contact's three quantities and 1 are multiplied by, shape (..., 4).

    The quantities are E A/W, w/R and I/W. Deformation: a cylinder that rolls or slides without
    adhesion loses beta of the work (2/(3 pi)) W w/R a unit length (Johnson 1985, section 9.4).
    """
    tau0, alpha, area_factor, beta, kappa = np.moveaxis(theta[..., :5], -1, 0)
    return np.stack([tau0 * area_factor, 2 / (3 * math.pi) * beta, kappa, alpha], axis=-1)


def terms(contact: FloatArray, theta: FloatArray) -> FloatArray:
    """Return adhesion, deformation and interlocking, shape (..., 3).

    Parameters
    ----------
    contact : ndarray of float, shape (..., 3)
        E A/W, w/R and I/W.
    theta : ndarray of float, shape (..., 9)
        Parameters in the order of `PARAMETERS`.
    """
    factors = coefficients(theta)
    summands = contact * factors[..., :3]
    summands[..., 0] += factors[..., 3]
    return summands
