"""What simulation-based checks share: rows with other loads, and a record that is resumed."""

import json
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.model.observations import Observations
from ridgebayes.runtime.pool import map_ordered


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


def resumed(
    path: Path,
    tasks: Iterable[Any],
    keys: Iterable[str],
    compute: Callable[[Any], dict[str, object]],
    executor: Executor | None = None,
) -> pd.DataFrame:
    """Compute the tasks that a file does not hold yet, and return all that it holds then.

    Parameters
    ----------
    path : Path
        A JSON object a line, written as soon as it is there; made if it is not.
    tasks : iterable
        Each has the attributes `keys`.
    keys : iterable of str
        Entries of a line that say which task it is of.
    compute : callable
        Makes a line's object, with `keys` in it, of a task.
    executor : concurrent.futures.Executor, optional
        Runs the tasks; one after the other in this process if not given.

    Returns
    -------
    pandas.DataFrame
        A row a line.
    """
    keys = list(keys)
    path.parent.mkdir(exist_ok=True)
    with path.open("a+", encoding="utf-8") as file:
        file.seek(0)
        lines = [json.loads(line) for line in file]
        known = {tuple(line[key] for key in keys) for line in lines}
        wanted = [one for one in tasks if tuple(getattr(one, key) for key in keys) not in known]
        for line in map_ordered(compute, wanted, executor, name=str):
            file.write(json.dumps(line) + "\n")
            file.flush()
            lines.append(line)
    return pd.DataFrame(lines)
