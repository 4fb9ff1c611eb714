"""Integrated autocorrelation time of ensembles of walkers, and the sample sizes that follow.

Walkers of one ensemble move by each other's positions and are never separate chains: their
autocorrelation functions are averaged and one time is read off for the whole ensemble.
"""

import numpy as np
from scipy import fft

from ridgebayes._types import FloatArray

_FEW = 64  # lags that cost less one by one than all of them by Fourier transform


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
    columns = (x - x.mean(axis=0)).reshape(*x.shape[:2], -1)
    tau = [_time(np.ascontiguousarray(columns[..., i]), window) for i in range(columns.shape[-1])]
    return np.maximum(np.array(tau).reshape(x.shape[2:]), 1 / n_step)


def _time(x: FloatArray, window: float) -> float:
    """Return tau of centred values (n_step, n_walker): lag by lag while lags are few."""
    n_step, square = len(x), float(np.vdot(x, x))
    if square == 0:
        return np.nan
    tau = 1.0
    for lag in range(1, min(_FEW, n_step)):
        if lag - 1 >= window * tau:
            return tau
        tau += 2 * float(np.vdot(x[lag:], x[:-lag])) / square
    length = fft.next_fast_len(2 * n_step, real=True)
    power = np.abs(fft.rfft(x, length, axis=0)) ** 2
    rho = fft.irfft(power, length, axis=0)[:n_step].sum(axis=1) / square
    taus = 2 * np.cumsum(rho) - 1
    wide_enough = np.arange(n_step) >= window * taus
    return float(taus[np.argmax(wide_enough) if wide_enough.any() else -1])


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
