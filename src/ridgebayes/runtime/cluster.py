"""The workers of an existing Dask cluster, as an executor: the only module that knows Dask."""

import logging
import math
import socket
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any, TypeVar

from ridgebayes.errors import InputError, WorkerLostError
from ridgebayes.runtime.reading import extra

_T = TypeVar("_T")
_ANSWER_S = 10.0  # in which a scheduler has to answer
_COUNT_S = 5.0  # a count of the workers costs a message each way


@contextmanager
def cluster(address: str) -> Iterator["ClusterExecutor"]:
    """Connect to a Dask scheduler, and leave it as it was at the end.

    Parameters
    ----------
    address : str
        Such as ``tcp://10.0.0.1:8786``.

    Yields
    ------
    ClusterExecutor
        Executor; tasks that are not done at the end of the block are dropped.

    Raises
    ------
    InputError
        If distributed is not installed, or no scheduler answers.
    """
    distributed = extra("distributed", "dask", f"--scheduler {address}: needs distributed")
    try:
        _reach(address)
        client = distributed.Client(address, timeout=_ANSWER_S, set_as_default=False)
    except (OSError, ValueError) as error:
        rule = "expected tcp://HOST:PORT of a running scheduler"
        why = f"no Dask scheduler answers ({error})"
        raise InputError(f"--scheduler {address}: {why}; {rule}") from None
    # A scheduler that ends is one error of the task that waits for it; Dask would log many.
    logs = [logging.getLogger(name) for name in ("distributed.client", "distributed.core")]
    levels = [log.level for log in logs]
    for log in logs:
        log.setLevel(logging.CRITICAL)
    try:
        yield ClusterExecutor(client)
    finally:
        client.close()
        for log, level in zip(logs, levels, strict=True):
            log.setLevel(level)


class ClusterExecutor(Executor):
    """A Dask client as an executor whose errors are this package's.

    Parameters
    ----------
    client : distributed.Client
        Connected.

    Notes
    -----
    The scheduler gives tasks of a worker that died to another one, as often as its setting
    ``distributed.scheduler.allowed-failures`` says (3), and then fails them: `WorkerLostError`.
    """

    def __init__(self, client: Any) -> None:  # a Client, whose methods have no types
        self._client = client
        # Not pure: no time is spent on a digest of each task, and no result of before is taken.
        self._inner = self._client.get_executor(pure=False)
        self._n_worker, self._counted = 0, -math.inf

    @property
    def n_worker(self) -> int:
        """Threads of all workers, counted again every few seconds: clusters grow and shrink."""
        if time.monotonic() > self._counted + _COUNT_S:
            self._n_worker = sum(self._client.nthreads().values())
            self._counted = time.monotonic()
        return self._n_worker

    def submit(
        self, function: Callable[..., _T], /, *args: object, **kwargs: object
    ) -> "Future[_T]":
        """Have a worker of the cluster call a function; all has to be picklable."""
        outer: Future[_T] = Future()
        inner = self._inner.submit(function, *args, **kwargs)
        inner.add_done_callback(lambda done: _pass_on(done, outer))
        outer.add_done_callback(lambda done: done.cancelled() and inner.cancel())
        return outer

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more tasks."""
        self._inner.shutdown(wait=wait and not cancel_futures)


def _pass_on(inner: "Future[Any]", outer: "Future[Any]") -> None:
    from distributed import KilledWorker

    if not outer.set_running_or_notify_cancel():
        return
    error: BaseException | None
    if inner.cancelled():  # by Dask: the one who waits would have cancelled the outer one
        error = WorkerLostError("the Dask scheduler cancelled the task or is unreachable")
    else:
        error = inner.exception()
    if isinstance(error, KilledWorker):
        ended = f"this task ended {error.allowed_failures + 1} workers of the cluster"
        error = WorkerLostError(f"{ended}; they may need more memory")
    # Dask's scheduler reads a task as well, and wraps what it lacks in an error of its own.
    lacking = error if error is None or isinstance(error, ImportError) else error.__cause__
    if isinstance(lacking, ImportError):
        rule = "expected the same ridgebayes on its scheduler and on all its workers"
        error = InputError(f"--scheduler: a package is missing on the cluster ({lacking}); {rule}")
    if error is None:
        outer.set_result(inner.result())
    else:
        outer.set_exception(error)


def _reach(address: str) -> None:
    """Raise OSError if nothing listens there: a Dask client that fails leaves threads behind."""
    scheme, _, rest = address.rpartition("://")
    host, _, port = rest.rpartition(":")
    if scheme not in ("", "tcp", "tls") or not host or not port.isdigit():
        raise ValueError("not tcp://HOST:PORT")
    socket.create_connection((host.strip("[]"), int(port)), timeout=_ANSWER_S).close()
