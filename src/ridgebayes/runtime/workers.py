"""Who computes: this process, worker processes beside it, or the workers of a cluster."""

import os
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager, nullcontext

from ridgebayes.errors import InputError
from ridgebayes.runtime.worker_pool import WorkerPool


def n_cpu() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def workers(n: int) -> Iterator[WorkerPool]:
    """Start n worker processes with one BLAS thread each, and stop them at the end.

    Parameters
    ----------
    n : int
        Processes.

    Yields
    ------
    WorkerPool
        An executor; what is not begun when the block is left is dropped, and if it is left by an
        error also what is under way. Workers never outlive their parent.
    """
    pool = WorkerPool(n)
    try:
        yield pool
        pool.shutdown(cancel_futures=True)
    finally:
        pool.stop()


def executor_for(
    n_worker: int | None = None, scheduler: str | None = None
) -> AbstractContextManager[Executor | None]:
    """Give what computes tasks, as two options of a command name it.

    Parameters
    ----------
    n_worker : int, optional
        Processes on this machine.
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://10.0.0.1:8786``.

    Returns
    -------
    context manager
        Of an executor, or of None where this process computes by itself: neither given, or one
        process.

    Raises
    ------
    InputError
        If both are given, there would be no process, distributed is not installed, or no
        scheduler answers.

    Examples
    --------
    >>> with executor_for(1) as executor:
    ...     print(executor)
    None
    """
    if scheduler is not None:
        if n_worker is not None:
            raise InputError("--workers and --scheduler: expected one of them, got both")
        from ridgebayes.runtime.cluster import cluster

        return cluster(scheduler)
    if n_worker is not None and n_worker < 1:
        raise InputError(f"--workers {n_worker}: expected at least 1")
    return nullcontext() if n_worker in (None, 1) else workers(n_worker)
