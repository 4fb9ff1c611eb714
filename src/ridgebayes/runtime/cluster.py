"""Executor on the workers of an existing Dask cluster; no other module uses Dask."""

import logging
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any, TypeVar

from ridgebayes.errors import InputError, WorkerLostError
from ridgebayes.runtime.reading import extra

_T = TypeVar("_T")
_TIMEOUT_S = 10.0  # for an answer of the scheduler


@contextmanager
def cluster(address: str) -> Iterator["ClusterExecutor"]:
    """Connect to a Dask scheduler, and disconnect at the end of the block.

    Parameters
    ----------
    address : str
        Address such as ``tcp://10.0.0.1:8786``.

    Yields
    ------
    ClusterExecutor
        Executor; unfinished tasks are dropped at the end of the block.

    Raises
    ------
    InputError
        If distributed is not installed, or no scheduler answers.
    """
    distributed = extra("distributed", "dask", f"--scheduler {address}: needs distributed")
    try:
        _check_connection(address)
        client = distributed.Client(address, timeout=_TIMEOUT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        rule = "expected tcp://HOST:PORT of a running scheduler"
        why = f"no Dask scheduler answers ({error})"
        raise InputError(f"--scheduler {address}: {why}; {rule}") from None
    # The end of a scheduler raises one error in the waiting task; Dask would log many.
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
    """Executor on a Dask client that raises this package's exceptions.

    Parameters
    ----------
    client : distributed.Client
        Connected client.

    Notes
    -----
    If a worker dies, the scheduler gives its tasks to another worker, at most as often as its
    setting ``distributed.scheduler.allowed-failures`` (3). Then `WorkerLostError` is raised.
    """

    def __init__(self, client: Any) -> None:  # a Client, whose methods have no type hints
        self._client = client
        # Impure calls need no digest of each task, and take no result of an earlier call.
        self._inner = self._client.get_executor(pure=False)

    def submit(
        self, function: Callable[..., _T], /, *args: object, **kwargs: object
    ) -> "Future[_T]":
        """Call a function on a worker; function, arguments and result have to be picklable."""
        outer: Future[_T] = Future()
        inner = self._inner.submit(function, *args, **kwargs)
        inner.add_done_callback(lambda done: _copy_outcome(done, outer))
        outer.add_done_callback(lambda done: done.cancelled() and inner.cancel())
        return outer

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Accept no more tasks."""
        self._inner.shutdown(wait=wait and not cancel_futures)


def _copy_outcome(inner: "Future[Any]", outer: "Future[Any]") -> None:
    from distributed import KilledWorker

    if not outer.set_running_or_notify_cancel():
        return
    error: BaseException | None
    if inner.cancelled():  # by Dask: a caller would have cancelled the outer future
        error = WorkerLostError("the Dask scheduler cancelled the task or is unreachable")
    else:
        error = inner.exception()
    if isinstance(error, KilledWorker):
        ended = f"this task ended {error.allowed_failures + 1} workers of the cluster"
        error = WorkerLostError(f"{ended}; they may need more memory")
    # The scheduler also unpickles tasks, and wraps an ImportError in its own exception.
    lacking = error if error is None or isinstance(error, ImportError) else error.__cause__
    if isinstance(lacking, ImportError):
        rule = "expected the same ridgebayes on its scheduler and on all its workers"
        error = InputError(f"--scheduler: a package is missing on the cluster ({lacking}); {rule}")
    if error is None:
        outer.set_result(inner.result())
    else:
        outer.set_exception(error)


def _check_connection(address: str) -> None:
    """Raise OSError if nothing listens at an address: a failing Dask client leaves threads."""
    scheme, _, rest = address.rpartition("://")
    host, _, port = rest.rpartition(":")
    if scheme not in ("", "tcp", "tls") or not host or not port.isdigit():
        raise ValueError("not tcp://HOST:PORT")
    socket.create_connection((host.strip("[]"), int(port)), timeout=_TIMEOUT_S).close()
