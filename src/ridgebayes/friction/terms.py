"""Terms of the friction model, on plain arrays."""

import math

import numpy as np

from ridgebayes._types import FloatArray

_TERM_PARAMETERS = ("tau0", "alpha", "area_factor", "beta", "kappa")
PARAMETERS = (*_TERM_PARAMETERS, "tau_subject", "tau_session", "tau_rig", "sigma")
COEFFICIENTS = ("tau0", "alpha", "beta", "kappa")  # at least one must not be 0
TERMS = ("adhesion", "deformation", "interlocking")
EFFECTS = ("subject", "session", "rig", "repeat")


def coefficients(theta: FloatArray) -> FloatArray:
    """Return the factors of E A/W, w/R, I/W and 1, shape (..., 4).

    A cylinder that rolls or slides without adhesion loses a share beta of the elastic work,
    (2/(3 pi)) W w/R per unit length (Johnson 1985, section 9.4).
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
