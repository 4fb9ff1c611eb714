"""Worker processes on this machine, each of which may die without taking the others' work along.

A thread of this process looks after each worker: it hands over a task, waits for the answer, and
knows which task was under way if the worker dies. `concurrent.futures.ProcessPoolExecutor` does
not know: one dead process breaks all that was submitted.
"""

import multiprocessing
import os
import pickle
import queue
import signal
import threading
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from ridgebayes.errors import ComputationError

_T = TypeVar("_T")
# A server that has imported everything forks workers in milliseconds; without one (Windows) each
# worker imports for itself.
_HAS_SERVER = "forkserver" in multiprocessing.get_all_start_methods()
_PRELOADED = ["ridgebayes.commands.jobs", "ridgebayes.report.figures", "arviz", "corner"]
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_starting = threading.Lock()
TRIES = 3  # a task that has killed as many workers would kill the next


class WorkerLostError(ComputationError):
    """Every worker that was given a task died on it."""


class WorkerPool(Executor):
    """Processes that compute what is submitted; a task whose worker died is done again.

    Parameters
    ----------
    n_worker : int
        Processes at most; each is started when there is work for it.
    tries : int, optional
        Workers that a task may lose before it fails with `WorkerLostError`.

    Notes
    -----
    *Cost.* Some 0.1 ms a task, and what pickling takes.
    """

    def __init__(self, n_worker: int, *, tries: int = TRIES) -> None:
        self.n_worker = n_worker
        self._tries = tries
        self._tasks: queue.SimpleQueue[_Task | None] = queue.SimpleQueue()
        self._threads: list[threading.Thread] = []
        self._workers: set[_Worker] = set()
        self._lock = threading.Lock()
        self._closed = self._stopped = False
        start_server()

    def submit(
        self, function: Callable[..., _T], /, *args: object, **kwargs: object
    ) -> "Future[_T]":
        """Have a worker call a function; all has to be picklable."""
        future: Future[_T] = Future()
        with self._lock:
            if self._closed:
                raise RuntimeError("submitted after shutdown")
            self._tasks.put(_Task(future, function, args, kwargs))
            if len(self._threads) < self.n_worker:
                self._threads.append(threading.Thread(target=self._serve, daemon=True))
                self._threads[-1].start()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more tasks, and end the workers when those there are done, or dropped."""
        with self._lock:
            self._closed = True
        if cancel_futures:
            self._drop()
        for _ in self._threads:
            self._tasks.put(None)
        if wait:
            for thread in self._threads:
                thread.join()

    def stop(self) -> None:
        """End the workers at once, whatever they are at."""
        with self._lock:
            self._stopped = True
            for worker in self._workers:
                worker.kill()
        self.shutdown(cancel_futures=True)

    def _drop(self) -> None:
        try:
            while True:
                if (task := self._tasks.get_nowait()) is not None and task.future.cancel():
                    task.future.set_running_or_notify_cancel()  # or those who wait would wait on
        except queue.Empty:
            pass

    def _serve(self) -> None:
        """Look after one worker: in a thread of its own."""
        worker: _Worker | None = None
        while (task := self._tasks.get()) is not None:
            if not task.future.set_running_or_notify_cancel():
                continue
            try:
                message = pickle.dumps((task.function, task.args, task.kwargs))
                worker, answer = self._done(message, worker)
                ok, value = pickle.loads(answer)
            except Exception as error:
                ok, value = False, error
                worker = worker if worker in self._workers else None
            if ok:
                task.future.set_result(value)
            else:
                task.future.set_exception(value)
            del task, value  # an idle worker keeps nothing alive
        if worker is not None:
            self._end(worker)

    def _done(self, message: bytes, worker: "_Worker | None") -> "tuple[_Worker, bytes]":
        """Return the answer and whose it is: of this worker, or of a fresh one in its place."""
        code: int | None = None
        for _ in range(self._tries):
            if worker is None:
                worker = self._started()
            try:
                return worker, worker.ask(message)
            except (EOFError, OSError):
                code = self._end(worker)
                worker = None
            if self._stopped:
                raise CancelledError
        raise WorkerLostError(
            f"{self._tries} worker processes died on it, the last with {_exit(code)}; "
            "expected enough memory for each worker"
        )

    def _started(self) -> "_Worker":
        worker = _Worker()
        with self._lock:
            self._workers.add(worker)
            if self._stopped:
                worker.kill()
        return worker

    def _end(self, worker: "_Worker") -> int | None:
        with self._lock:
            self._workers.discard(worker)
        return worker.end()


def start_server() -> None:
    """Start, once, the process that imports what workers need and forks them.

    It imports while this process goes on with its own work: the earlier, the less is waited for.
    """
    if _HAS_SERVER:
        with _one_thread_each():
            forkserver.set_forkserver_preload(_PRELOADED)
            forkserver.ensure_running()


@dataclass(frozen=True, eq=False)
class _Task:
    future: "Future[Any]"
    function: Callable[..., Any]
    args: tuple[object, ...]
    kwargs: dict[str, object] = field(default_factory=dict)


class _Worker:
    """One process and the pipe to it."""

    def __init__(self) -> None:
        get = multiprocessing.get_context
        context = get("forkserver") if _HAS_SERVER else get("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_work, args=(theirs,), daemon=True)
        # Ctrl-C reaches the whole group of processes: held back until the worker ignores it. The
        # tracker is started before, because that start ends with the signal let through.
        resource_tracker.ensure_running()
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            with _one_thread_each():
                self._process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            theirs.close()

    def ask(self, message: bytes) -> bytes:
        """Return the answer; EOFError or OSError if the process has died."""
        self._pipe.send_bytes(message)
        return self._pipe.recv_bytes()

    def kill(self) -> None:
        self._process.kill()

    def end(self) -> int | None:
        """Let an idle process end by itself, and return its exit code."""
        self._pipe.close()
        self._process.join()
        code = self._process.exitcode
        self._process.close()
        return code


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Have processes started here load a BLAS of one thread: several would fight for processors."""
    with _starting:
        before = {name: os.environ.get(name) for name in _THREADS}
        os.environ.update(dict.fromkeys(_THREADS, "1"))
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    os.environ.pop(name, None)
                else:
                    os.environ[name] = value


def _work(pipe: Connection) -> None:
    """Compute what comes through the pipe until it is closed: all that a worker does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    threading.Thread(target=_follow, daemon=True).start()
    while True:
        try:
            message = pipe.recv_bytes()
        except (EOFError, OSError):
            return
        try:
            pipe.send_bytes(_answer(message))
        except OSError:  # nobody waits for it any more
            return


def _answer(message: bytes) -> bytes:
    """Return whether a call ended well, and its value or error."""
    try:
        function, args, kwargs = pickle.loads(message)
        return pickle.dumps((True, function(*args, **kwargs)))
    except BaseException as error:
        error.add_note(f"In a worker process:\n{traceback.format_exc()}")
        try:
            content = pickle.dumps((False, error))
            pickle.loads(content)  # some errors go but do not come back
        except Exception:
            content = pickle.dumps((False, RuntimeError(f"{type(error).__name__}: {error}")))
        return content


def _follow() -> None:
    """End this process when the one that asked for it does, however that ended."""
    parent = multiprocessing.parent_process()
    assert parent is not None  # only the process that asked has none
    parent.join()
    os._exit(1)


def _exit(code: int | None) -> str:
    if code is not None and code < 0:
        return f"signal {-code} ({signal.strsignal(-code)})"
    return f"exit code {code}"
