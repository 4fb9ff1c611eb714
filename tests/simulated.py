"""Rows with the loads of a simulation in place of their own."""

from dataclasses import replace

import numpy as np

from ridgebayes import InputError
from ridgebayes._types import FloatArray
from ridgebayes.model.observations import Observations


def simulated(data: Observations, log_load: FloatArray) -> Observations:
    """Return rows with other loads: all of them exact.

    Parameters
    ----------
    data : Observations
        Rows that give textures, counts and known errors.
    log_load : ndarray of float, shape (n_obs,), dimensionless
        What `simulate_log_loads` drew. Rows without a load (counts of 2) are left out.

    Returns
    -------
    Observations
        Exact rows.

    Raises
    ------
    InputError
        If there is not one load for each row, or none at all.
    """
    log_load = np.asarray(log_load, dtype=float)
    if log_load.shape != (len(data),):
        raise InputError(f"log_load: expected ({len(data)},), got shape {log_load.shape}")
    here = np.isfinite(log_load)
    if not here.any():
        raise InputError("log_load: expected at least one, got no finite value")
    return replace(
        data.take(here),
        log_load=log_load[here],
        log_lower=np.full(here.sum(), np.nan),
        is_count=np.zeros(here.sum(), dtype=bool),
    )
