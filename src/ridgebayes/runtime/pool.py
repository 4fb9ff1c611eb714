"""Executors: this process, a pool of workers, or a Dask cluster; and results in order.

Each worker is a `ProcessPoolExecutor` of one process, with a thread that waits for it. If a worker
dies, only its task is lost, and a new worker repeats it. In an executor of several processes a
death would break all submitted tasks, and the responsible task would be unknown.
"""

import multiprocessing
import os
import pickle
import queue
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent import futures
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from multiprocessing import forkserver, resource_tracker
from pathlib import Path
from typing import Any, ParamSpec, TypeVar
from unittest.mock import patch

from threadpoolctl import threadpool_limits

from ridgebayes.errors import ComputationError, InputError, WorkerLostError, expect
from ridgebayes.runtime.progress import tell_count
from ridgebayes.runtime.text import exit_text

_P = ParamSpec("_P")
_T = TypeVar("_T")
_Task = TypeVar("_Task")
# A server that has imported everything forks workers in milliseconds. Without it (Windows) each
# worker imports all modules.
_METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
# One BLAS thread for each worker: several would compete for processors. One malloc arena: each
# thread of a worker would otherwise keep memory that it has freed.
_ENVIRONMENT = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "MALLOC_ARENA_MAX"), "1"
)
_UNGUARDED = 41  # exit code of a worker that would start workers; no code of Python or of a signal
_MAX_TRIES = 3  # a task that has killed so many workers would kill another one


class WorkerPool(futures.ThreadPoolExecutor):
    """Pool of worker processes that repeats a task if its worker died.

    Parameters
    ----------
    n_worker : int
        Maximum number of processes; each is started when there is work for it.

    Notes
    -----
    *Cost.* Some 0.3 ms for each task, plus pickling.
    """

    def __init__(self, n_worker: int) -> None:
        super().__init__(n_worker)
        # By the identifier of the thread that waits for the worker.
        self._workers: dict[int, futures.ProcessPoolExecutor] = {}
        self._starting = threading.Lock()
        self._stopped = False
        start_server()

    def submit(
        self, function: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs
    ) -> "futures.Future[_T]":
        """Call a function on a worker; function, arguments and result have to be picklable."""
        return super().submit(self._compute, function, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Accept no more tasks, and end the workers after the submitted tasks."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        while wait and self._workers:
            self._workers.popitem()[1].shutdown()

    def stop(self) -> None:
        """End the workers at once, even during a task."""
        with self._starting:
            self._stopped = True
            for worker in self._workers.values():
                for process in worker._processes.values():  # from Python 3.14 on: kill_workers
                    process.kill()
        self.shutdown(cancel_futures=True)

    def _compute(
        self, function: Callable[..., _T], args: tuple[object, ...], kwargs: dict[str, object]
    ) -> _T:
        """Call a function on this thread's worker, and on a new one if the worker dies."""
        with _sending():
            message = pickle.dumps((function, args, kwargs))
        me, code = threading.get_ident(), None
        for _ in range(_MAX_TRIES):
            try:
                with self._starting:
                    if self._stopped:
                        raise futures.CancelledError
                    if me not in self._workers:
                        context = multiprocessing.get_context(_METHOD)
                        self._workers[me] = futures.ProcessPoolExecutor(1, context, _start_worker)
                    main = sys.modules["__main__"]
                    script = getattr(main, "__file__", None)
                    # Workers import the script, but cannot import one from standard input.
                    script = script if script and Path(script).exists() else None
                    with patch.object(main, "__file__", script, create=True):
                        future = self._workers[me].submit(_call, message)
                value: _T = future.result()
                return value
            except futures.BrokenExecutor:
                with self._starting:
                    worker = self._workers.pop(me)
                (process,) = worker._processes.values()
                worker.shutdown()
                code = process.exitcode
                if code == _UNGUARDED:
                    raise WorkerLostError(
                        "each worker process imports the script that started it, and would run it "
                        'again: call run below `if __name__ == "__main__":`, or with workers=1'
                    ) from None
        died = f"{_MAX_TRIES} worker processes died on this task, the last with {exit_text(code)}"
        raise WorkerLostError(f"{died}; they may need more memory")


def end_unguarded_worker() -> None:
    """End a worker that runs the script of the main process, which lacks a guard, as it starts."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        os._exit(_UNGUARDED)


def start_server(preload: Sequence[str] = ()) -> None:
    """Start the process that imports what workers need and forks them, unless it is running.

    The server imports in parallel to this process, so an early start saves waiting.

    Parameters
    ----------
    preload : sequence of str, optional
        Modules to import; if not given, the modules of this package that are already loaded.
    """
    if _METHOD != "forkserver":
        os.environ.update(_ENVIRONMENT)  # inherited by each worker
        return
    # Ctrl-C reaches the whole process group, so server and workers start with SIGINT blocked. The
    # resource tracker is started first, because its start unblocks the signal.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        with patch.dict(os.environ, _ENVIRONMENT):
            loaded = [name for name in list(sys.modules) if name.startswith("ridgebayes.")]
            forkserver.set_forkserver_preload(list(preload) or loaded)
            forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def n_cpu() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep BLAS to one thread during a block or a function, as in workers.

    Several threads slow small triangular systems down tenfold.
    """
    with threadpool_limits(1, user_api="blas"):
        yield


@contextmanager
def workers(n: int) -> Iterator[WorkerPool]:
    """Start n worker processes with one BLAS thread each, and stop them at the end.

    Parameters
    ----------
    n : int
        Number of processes.

    Yields
    ------
    WorkerPool
        Executor. The end of the block drops tasks that have not started; an error also drops
        running tasks. Workers never outlive their parent.
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
    """Return the executor that two options of a command select.

    Parameters
    ----------
    n_worker : int, optional
        Number of processes on this machine.
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://10.0.0.1:8786``.

    Returns
    -------
    context manager
        Context of an executor. It is None, for computing in this process, if neither option is
        given or `n_worker` is 1.

    Raises
    ------
    InputError
        If both are given, distributed is not installed, or no scheduler answers.
    """
    if scheduler is not None:
        if n_worker is not None:
            raise InputError("--workers and --scheduler: expected only one of the two, got both")
        # Dask is an optional dependency.
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
    """Yield the result of a function for each task, in the order of the tasks.

    Parameters
    ----------
    function : callable
        Function of one task; picklable if there is an executor.
    tasks : iterable
        Tasks, which are all submitted at once.
    executor : concurrent.futures.Executor or None
        Executor of the tasks; None computes them in turn in this process.
    name : callable, optional
        Returns the name of a task for error messages; "task 3" if not given.
    done : callable, optional
        Called with a task and its result as soon as it is computed, in any order.

    Yields
    ------
    object
        Results. An early result waits for its turn without keeping a worker waiting.

    Raises
    ------
    ComputationError
        If workers die, so that a task cannot be computed; the message names it. Other exceptions
        of a task are raised as soon as they arrive.
    """
    tasks = list(tasks)
    if executor is None:
        with one_blas_thread():
            for n_done, task in enumerate(tasks, start=1):
                result = function(task)
                if done is not None:
                    done(task, result)
                tell_count(n_done, len(tasks))
                yield result
        return
    expect(futures.Executor, executor=executor)
    under_way: dict[futures.Future[_T], int] = {}
    early: dict[int, _T] = {}
    ended: queue.SimpleQueue[futures.Future[_T]] = queue.SimpleQueue()
    turn = 0
    try:
        for number, task in enumerate(tasks):
            future = executor.submit(function, task)
            under_way[future] = number
            future.add_done_callback(ended.put)
        for n_done in range(1, len(tasks) + 1):
            future = ended.get()
            number = under_way.pop(future)
            try:
                early[number] = result = future.result()
            except (WorkerLostError, futures.BrokenExecutor, futures.CancelledError) as error:
                called = f"task {number + 1}" if name is None else name(tasks[number])
                why = str(error) or "its worker ended before it was done"
                raise ComputationError(f"{called}: {why}") from None
            if done is not None:
                done(tasks[number], result)
            tell_count(n_done, len(tasks))
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
    """Submit a call, or defer it if there is no executor, and return a function for its result.

    Parameters
    ----------
    executor : concurrent.futures.Executor or None
        Executor of the call; None makes the call in this process when the result is requested.
    function : callable
        Function to call; picklable with its arguments if there is an executor.
    *args, **kwargs
        Arguments of the function.

    Returns
    -------
    callable
        Function without arguments that returns the result of the call, or raises its exception.

    Examples
    --------
    >>> power = submit_or_defer(None, pow, 2, 10)
    >>> power()
    1024
    """
    if executor is None:
        return partial(function, *args, **kwargs)
    return executor.submit(function, *args, **kwargs).result


def _start_worker() -> None:
    """Prepare a new worker: ignore Ctrl-C, and exit when the parent process ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_exit_with_parent, daemon=True).start()


def _exit_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None  # only the main process has no parent
    parent.join()
    os._exit(1)


@contextmanager
def _sending() -> Iterator[None]:
    """Say that a worker cannot get what is not in a module, such as a form of a notebook."""
    try:
        yield
    except (AttributeError, ImportError, TypeError, pickle.PicklingError) as error:
        raise WorkerLostError(
            f"{error}; worker processes import the forms and functions that they use: define them "
            "in a file that is imported, or call with workers=1"
        ) from None


def _call(message: bytes) -> Any:
    """Call a pickled function on a worker; a failure to unpickle must not end the worker."""
    with _sending():
        function, args, kwargs = pickle.loads(message)
    try:
        return function(*args, **kwargs)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))  # some exceptions can be pickled but not unpickled
        except Exception:
            raise RuntimeError(f"{type(error).__name__}: {error}") from error
        raise
