"""Scaling of loads: widths of a texture, and the factor of Poisson's ratio."""

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError

Texture = tuple[float, float]
REFERENCE = 0.75  # 1 - nu^2 at nu = 0.5, the Poisson's ratio of the published coefficients


def reduced_load(p_over_E: ArrayLike, nu: ArrayLike = 0.5) -> FloatArray:
    """Return the load at nu = 0.5 equivalent to `p_over_E` at `nu`: (p/E)(1 - nu^2)/0.75.

    Parameters
    ----------
    p_over_E : array_like of float, any shape, dimensionless
        Normalised load.
    nu : array_like of float, broadcastable, dimensionless
        Poisson's ratio, 0 to 0.5.

    Returns
    -------
    ndarray of float, broadcast shape, dimensionless
        Reduced load.

    Raises
    ------
    InputError
        If `nu` is outside 0 to 0.5.

    Examples
    --------
    >>> float(reduced_load(0.012, nu=0.0))
    0.016
    """
    poisson = np.asarray(nu, dtype=float)
    if not np.all((poisson >= 0) & (poisson <= 0.5)):
        raise InputError(f"nu: expected 0 <= nu <= 0.5, got {nu!r}")
    # The factor is computed first: at nu = 0.5 it is 1, and the load is unchanged.
    value: FloatArray = np.asarray(p_over_E, dtype=float) * ((1 - poisson**2) / REFERENCE)
    return value
