"""Integrated autocorrelation time of ensembles of walkers, and the sample sizes that follow.

Walkers of one ensemble move by each other's positions and are never separate chains: their
autocorrelation functions are averaged and one time is read off for the whole ensemble.
"""

import numpy as np
from scipy import fft

from ridgebayes._types import FloatArray


def autocorrelation_time(x: FloatArray, window: float = 5.0) -> FloatArray:
    """Return the integrated autocorrelation time in steps.

    tau = 1 + 2 sum_{t=1}^{M} rho(t), with M the smallest window of at least `window` tau.

    Parameters
    ----------
    x : ndarray of float, shape (n_step, n_walker, ...), any unit
        Values along the steps.
    window : float, optional
        Sokal's window constant.

    Returns
    -------
    ndarray of float, shape (...), steps
        At least 1/n_step; 1 for independent steps. NaN where the values do not vary.

    References
    ----------
    Goodman & Weare (2010), doi:10.2140/camcos.2010.5.65; Sokal (1997), section 3.

    Examples
    --------
    >>> x = np.random.default_rng(1).standard_normal((4000, 8))
    >>> bool(abs(autocorrelation_time(x) - 1) < 0.1)
    True
    """
    n_step = len(x)
    centred = x - x.mean(axis=0)
    length = fft.next_fast_len(2 * n_step, real=True)
    power = np.abs(fft.rfft(centred, length, axis=0)) ** 2
    rho = fft.irfft(power, length, axis=0)[:n_step].mean(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        rho = rho / rho[0]
    tau = 2 * np.cumsum(rho, axis=0) - 1
    lag = np.arange(n_step).reshape((-1,) + (1,) * (tau.ndim - 1))
    wide_enough = lag >= window * tau
    first = np.where(wide_enough.any(axis=0), wide_enough.argmax(axis=0), n_step - 1)
    return np.maximum(np.take_along_axis(tau, first[None], axis=0)[0], 1 / n_step)


def effective_sample_size(x: FloatArray) -> FloatArray:
    """Return the effective sample size of several ensembles for the mean of `x`.

    Steps times walkers over tau, summed over the ensembles.

    Parameters
    ----------
    x : ndarray of float, shape (n_ensemble, n_step, n_walker, ...), any unit
        Values.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        Effective number of independent draws.

    Examples
    --------
    >>> x = np.random.default_rng(1).standard_normal((4, 1000, 8))
    >>> bool(abs(effective_sample_size(x) / x.size - 1) < 0.1)
    True
    """
    n = x.shape[1] * x.shape[2]
    return np.sum([n / autocorrelation_time(ensemble) for ensemble in x], axis=0)
