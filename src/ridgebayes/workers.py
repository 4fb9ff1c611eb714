"""Worker processes that share out independent computations and never outlive their parent."""

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def n_cpu() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def workers(n: int) -> Iterator[ProcessPoolExecutor]:
    """Start n worker processes with one BLAS thread each, and stop them at the end.

    Parameters
    ----------
    n : int
        Processes.

    Yields
    ------
    concurrent.futures.ProcessPoolExecutor
        An executor; what is not begun when the block is left is dropped.
    """
    before = {name: os.environ.get(name) for name in _THREADS}
    # Read by the BLAS when a worker loads it: threads of several workers fight for the processors.
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    pool = ProcessPoolExecutor(
        n, multiprocessing.get_context("spawn"), initializer=_follow, initargs=(os.getpid(),)
    )
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _follow(parent: int) -> None:
    """Leave Ctrl-C to the parent, and end when the parent does, however it ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
