"""Executors: this process, a pool of workers, or a Dask cluster; and results in order.

A worker that dies takes nothing along but its task, which a fresh worker does again. In one
`ProcessPoolExecutor` of many workers a death breaks all that was submitted, and nobody knows on
which task: here each worker is an executor of its own, and a thread waits for it.
"""

import itertools
import multiprocessing
import os
import pickle
import queue
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from concurrent import futures
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from multiprocessing import forkserver, resource_tracker
from typing import Any, ParamSpec, TypeVar
from unittest.mock import patch

from threadpoolctl import threadpool_limits

from ridgebayes.errors import ComputationError, InputError, WorkerLostError
from ridgebayes.runtime.progress import tell_count
from ridgebayes.runtime.text import exit_text

_P = ParamSpec("_P")
_T = TypeVar("_T")
_Task = TypeVar("_Task")
# A server that has imported everything forks workers in milliseconds; without one (Windows) each
# worker imports for itself.
_METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
_PACKAGE = __name__.partition(".")[0]
# BLAS of one thread in each worker: several would fight for processors. One arena of glibc's
# malloc: a worker has threads, and each would keep memory that it has freed.
_ENVIRONMENT = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "MALLOC_ARENA_MAX"), "1"
)
_TRIES = 3  # a task that has killed as many workers would kill the next
# Tasks under way for each worker: one in progress, the others queued so that it never idles.
_PER_WORKER = 4
_MOST_UNDER_WAY = 1_000  # tasks of an executor that does not say how many workers it has


class WorkerPool(futures.ThreadPoolExecutor):
    """Processes that compute what is submitted; a task whose worker died is done again.

    Parameters
    ----------
    n_worker : int
        Processes at most; each is started when there is work for it.

    Notes
    -----
    *Cost.* Some 0.3 ms a task, and what pickling takes.
    """

    def __init__(self, n_worker: int) -> None:
        super().__init__(n_worker)
        self.n_worker = n_worker
        # By the thread that waits for it.
        self._workers: dict[int, futures.ProcessPoolExecutor] = {}
        self._starting = threading.Lock()
        self._stopped = False
        start_server()

    def submit(
        self, function: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs
    ) -> "futures.Future[_T]":
        """Have a worker call a function; all has to be picklable."""
        return super().submit(self._compute, function, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more tasks, and end the workers when those there are done, or dropped."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        while wait and self._workers:
            self._workers.popitem()[1].shutdown()

    def stop(self) -> None:
        """End the workers at once, whatever they are at."""
        with self._starting:
            self._stopped = True
            for worker in self._workers.values():
                for process in worker._processes.values():  # from Python 3.14 on: kill_workers
                    process.kill()
        self.shutdown(cancel_futures=True)

    def _compute(
        self, function: Callable[..., _T], args: tuple[object, ...], kwargs: dict[str, object]
    ) -> _T:
        """Have this thread's worker call a function, or a fresh one in its place if it dies."""
        message = pickle.dumps((function, args, kwargs))
        me, code = threading.get_ident(), None
        for _ in range(_TRIES):
            try:
                with self._starting:
                    if self._stopped:
                        raise futures.CancelledError
                    if me not in self._workers:
                        context = multiprocessing.get_context(_METHOD)
                        self._workers[me] = futures.ProcessPoolExecutor(1, context, _begin)
                    future = self._workers[me].submit(_call, message)
                value: _T = future.result()
                return value
            except futures.BrokenExecutor:
                with self._starting:
                    worker = self._workers.pop(me)
                (process,) = worker._processes.values()
                worker.shutdown()
                code = process.exitcode
        died = f"{_TRIES} worker processes died on this task, the last with {exit_text(code)}"
        raise WorkerLostError(f"{died}; they may need more memory")


def start_server(preload: Sequence[str] = ()) -> None:
    """Start, once, the process that imports what workers need and forks them.

    It imports while this process goes on with its own work: the earlier, the less is waited for.

    Parameters
    ----------
    preload : sequence of str, optional
        Modules to import; those of this package that are loaded by now if not given.
    """
    if _METHOD != "forkserver":
        os.environ.update(_ENVIRONMENT)  # which each worker takes over when it starts
        return
    # Ctrl-C reaches the whole group of processes: server and workers start with it held back. The
    # tracker is started before, because that start ends with the signal let through.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        with patch.dict(os.environ, _ENVIRONMENT):
            loaded = [name for name in list(sys.modules) if name.startswith(f"{_PACKAGE}.")]
            forkserver.set_forkserver_preload(list(preload) or loaded)
            forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


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
        Executor. The end of the block drops tasks that have not started, and an error also drops
        tasks under way. Workers never outlive their parent.
    """
    pool = WorkerPool(n)
    try:
        yield pool
        pool.shutdown(cancel_futures=True)
    finally:
        pool.stop()


def executor_for(
    n_worker: int | None = None, scheduler: str | None = None
) -> AbstractContextManager[futures.Executor | None]:
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
        Context of an executor, or of None where this process computes: neither given, or one
        process.

    Raises
    ------
    InputError
        If both are given, distributed is not installed, or no scheduler answers.
    """
    if scheduler is not None:
        if n_worker is not None:
            raise InputError("--workers and --scheduler: expected only one of the two, got both")
        # Needs an optional extra.
        from ridgebayes.runtime.cluster import cluster

        return cluster(scheduler)
    return nullcontext() if n_worker in (None, 1) else workers(n_worker)


def map_ordered(
    function: Callable[[_Task], _T],
    tasks: Iterable[_Task],
    executor: futures.Executor | None,
    *,
    name: Callable[[_Task], str] | None = None,
    done: Callable[[_Task, _T], None] | None = None,
) -> Iterator[_T]:
    """Yield what a function makes of each task, in their order, wherever they are computed.

    Parameters
    ----------
    function : callable
        Function of one task; picklable if there is an executor.
    tasks : iterable
        Taken as they are needed: no more than four for each worker are under way at a time.
    executor : concurrent.futures.Executor or None
        Executor of the tasks; None is this process, one task after the other.
    name : callable, optional
        Gives a task's name to errors; "task 3" if not given.
    done : callable, optional
        Called with a task and its result as soon as that is there, in any order.

    Yields
    ------
    object
        Results. Those that come early wait for their turn, and keep no worker waiting.

    Raises
    ------
    ComputationError
        If workers die, so that a task cannot be computed; it is named. Whatever else a task
        raises is passed on as soon as it comes.
    """
    n = len(tasks) if isinstance(tasks, Sized) else None
    if executor is None:
        # One thread for BLAS, as in workers: several make small triangular systems 10 times slower.
        with threadpool_limits(1, user_api="blas"):
            for n_done, task in enumerate(tasks, start=1):
                result = function(task)
                if done is not None:
                    done(task, result)
                tell_count(n_done, n)
                yield result
        return
    numbered = enumerate(tasks)
    under_way: dict[futures.Future[_T], tuple[int, _Task]] = {}
    early: dict[int, _T] = {}
    ended: queue.SimpleQueue[futures.Future[_T]] = queue.SimpleQueue()
    turn = n_done = 0
    try:
        while True:
            n_worker = getattr(executor, "n_worker", None)  # which may change
            most = _MOST_UNDER_WAY if n_worker is None else _PER_WORKER * max(n_worker, 1)
            for number, task in itertools.islice(numbered, max(most - len(under_way), 0)):
                future = executor.submit(function, task)
                under_way[future] = number, task
                future.add_done_callback(ended.put)
            if not under_way:
                return
            future = ended.get()
            number, task = under_way.pop(future)
            try:
                early[number] = result = future.result()
            except (WorkerLostError, futures.BrokenExecutor, futures.CancelledError) as error:
                called = f"task {number + 1}" if name is None else name(task)
                why = str(error) or "its worker ended before it was done"
                raise ComputationError(f"{called}: {why}") from None
            if done is not None:
                done(task, result)
            n_done += 1
            tell_count(n_done, n)
            while turn in early:
                yield early.pop(turn)
                turn += 1
    finally:
        for future in under_way:
            future.cancel()


def submit_or_defer(
    executor: futures.Executor | None,
    function: Callable[_P, _T],
    *args: _P.args,
    **kwargs: _P.kwargs,
) -> Callable[[], _T]:
    """Have a worker begin a call, and return what waits for its result.

    Parameters
    ----------
    executor : concurrent.futures.Executor or None
        Executor of the call; None is this process, when the result is requested.
    function : callable
        With its arguments picklable if there is an executor.
    *args, **kwargs
        Its arguments.

    Returns
    -------
    callable
        Without arguments; returns the result, or raises what the call raised.

    Examples
    --------
    >>> power = submit_or_defer(None, pow, 2, 10)
    >>> power()
    1024
    """
    if executor is None:
        return partial(function, *args, **kwargs)
    return executor.submit(function, *args, **kwargs).result


def _begin() -> None:
    """Leave Ctrl-C to the parent, and end when it does, however that ended: in a fresh worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_follow, daemon=True).start()


def _follow() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None  # only the process that asked has none
    parent.join()
    os._exit(1)


def _call(message: bytes) -> Any:
    """Call a function: in a worker, which an error in reading the call would end."""
    try:
        function, args, kwargs = pickle.loads(message)
        return function(*args, **kwargs)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))  # some errors go but do not come back
        except Exception:
            raise RuntimeError(f"{type(error).__name__}: {error}") from error
        raise
