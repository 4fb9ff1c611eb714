"""Rows with the loads of a simulation in place of their own."""

from dataclasses import replace

import numpy as np


def simulated(data, log_load):
    """Return observations with other loads: all of them exact, those without a load left out."""
    here = np.isfinite(log_load)
    return replace(
        data.take(here),
        log_load=log_load[here],
        log_lower=np.full(here.sum(), np.nan),
        is_count=np.zeros(here.sum(), dtype=bool),
    )
