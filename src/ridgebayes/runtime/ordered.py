"""Tasks shared out to whoever computes, and their results in order."""

import itertools
import queue
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from functools import partial
from typing import ParamSpec, TypeVar

from ridgebayes.errors import ComputationError
from ridgebayes.runtime.worker_pool import WorkerLostError

_P = ParamSpec("_P")
_T = TypeVar("_T")
_Task = TypeVar("_Task")
# Tasks under way for each worker: one at work, the others at hand when that is done.
_PER_WORKER = 4
_UNKNOWN = 1_000  # tasks under way on an executor that does not say how many workers it has


def map_ordered(
    function: Callable[[_Task], _T],
    tasks: Iterable[_Task],
    executor: Executor | None,
    *,
    name: Callable[[_Task], str] | None = None,
    done: Callable[[_Task, _T], None] | None = None,
) -> Iterator[_T]:
    """Yield what a function makes of each task, in their order, wherever they are computed.

    Parameters
    ----------
    function : callable
        Of one task; picklable if there is an executor.
    tasks : iterable
        Taken as they are needed: no more than four for each worker are under way at a time.
    executor : concurrent.futures.Executor or None
        What computes; None is this process, one task after the other.
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
    if executor is None:
        for task in tasks:
            result = function(task)
            if done is not None:
                done(task, result)
            yield result
        return
    numbered = enumerate(tasks)
    under_way: dict[Future[_T], tuple[int, _Task]] = {}
    early: dict[int, _T] = {}
    ended: queue.SimpleQueue[Future[_T]] = queue.SimpleQueue()
    turn = 0
    try:
        while True:
            room = _room(executor) - len(under_way)
            for number, task in itertools.islice(numbered, max(room, 0)):
                future = executor.submit(function, task)
                under_way[future] = number, task
                future.add_done_callback(ended.put)
            if not under_way:
                return
            future = ended.get()
            number, task = under_way.pop(future)
            try:
                early[number] = result = future.result()
            except (WorkerLostError, BrokenExecutor, CancelledError) as error:
                called = f"task {number + 1}" if name is None else name(task)
                why = str(error) or "its worker ended before it was done"
                raise ComputationError(f"{called}: {why}") from None
            if done is not None:
                done(task, result)
            while turn in early:
                yield early.pop(turn)
                turn += 1
    finally:
        for future in under_way:
            future.cancel()


def submit_or_defer(
    executor: Executor | None, function: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs
) -> Callable[[], _T]:
    """Have a worker begin a call, and return what waits for its result.

    Parameters
    ----------
    executor : concurrent.futures.Executor or None
        What computes; None is this process, when the result is asked for.
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
    >>> power = begun(None, pow, 2, 10)
    >>> power()
    1024
    """
    if executor is None:
        return partial(function, *args, **kwargs)
    return executor.submit(function, *args, **kwargs).result


def _room(executor: Executor) -> int:
    n_worker = getattr(executor, "n_worker", None)
    return _UNKNOWN if n_worker is None else _PER_WORKER * max(n_worker, 1)
