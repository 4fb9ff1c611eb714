"""Results of simulated tables, kept in a file from which an interrupted study goes on."""

import json
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import pandas as pd

from ridgebayes.runtime.pool import map_ordered


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
