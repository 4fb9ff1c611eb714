"""Results come in the order of tasks, whoever computes them; few tasks are out at a time."""

import os
import threading
import time
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)

import pytest

from ridgebayes.errors import ComputationError
from ridgebayes.runtime.ordered import map_ordered
from ridgebayes.runtime.worker_pool import WorkerLostError


class Later(Executor):
    """Computes nothing until so many tasks are out, and then the last one first."""

    def __init__(self, n_worker, until):
        self.n_worker, self.until = n_worker, until
        self.waiting, self.done = [], []

    def submit(self, function, task):
        future = Future()
        self.waiting.append((future, function, task))
        if len(self.waiting) >= self.until:
            while self.waiting:
                future_there, function, task = self.waiting.pop()
                self.done.append(task)
                future_there.set_result(function(task))
        return future


class Failing(Executor):
    """Fails the second task."""

    n_worker = 2

    def __init__(self, error):
        self.error, self.futures = error, []

    def submit(self, function, task):
        self.futures.append(Future())
        if len(self.futures) == 2:
            self.futures[-1].set_exception(self.error)
        return self.futures[-1]


@pytest.mark.parametrize("n", [0, 1, 3, 50])
def test_in_order__is_the_order_of_tasks_on_any_executor(n):
    expected = [n - i for i in range(n)]
    tasks = [i - n for i in range(n)]
    assert list(map_ordered(abs, tasks, None)) == expected
    with ThreadPoolExecutor(3) as executor:
        assert list(map_ordered(abs, tasks, executor)) == expected
    backwards = Later(n_worker=100, until=n)
    assert list(map_ordered(abs, tasks, backwards)) == expected
    assert backwards.done == tasks[::-1]


def test_in_order__takes_four_tasks_a_worker_and_no_more():
    taken = []

    def tasks():
        for i in range(30):
            taken.append(i)
            yield i

    executor = Later(n_worker=2, until=1_000)
    found = []
    thread = threading.Thread(
        target=lambda: found.extend(map_ordered(float, tasks(), executor)), daemon=True
    )
    thread.start()
    for n_done in range(30):
        out = min(8, 30 - n_done)
        end = time.monotonic() + 10
        while len(executor.waiting) < out and time.monotonic() < end:
            time.sleep(0.001)
        time.sleep(0.002)  # in which more would come
        assert len(executor.waiting) == out
        assert len(taken) == n_done + out
        future, function, task = executor.waiting.pop()
        future.set_result(function(task))
    thread.join(10)
    assert found == [float(i) for i in range(30)]


def test_in_order__says_what_is_done_as_soon_as_it_is():
    executor, said = Later(n_worker=1, until=3), []
    found = map_ordered(
        abs, [-1, -2, -3], executor, done=lambda task, got: said.append((task, got))
    )
    assert next(found) == 1
    assert said == [(-2, 2), (-1, 1)]  # the second before its turn
    assert list(found) == [2, 3]
    assert len(said) == 3
    said.clear()
    list(map_ordered(abs, [-1, -2], None, done=lambda task, got: said.append((task, got))))
    assert said == [(-1, 1), (-2, 2)]


def test_in_order__drops_what_is_not_wanted_any_more():
    executor = Later(n_worker=1, until=2)
    found = map_ordered(abs, [-1, -2, -3], executor)
    next(found)
    future = executor.waiting[0][0]
    assert not future.cancelled()
    found.close()
    assert future.cancelled()


@pytest.mark.parametrize(
    "error",
    [WorkerLostError("they died"), BrokenExecutor("they died"), CancelledError("they died")],
)
def test_in_order__names_the_task_that_workers_died_on(error):
    executor = Failing(error)
    with pytest.raises(ComputationError, match=r"^task 2: they died$"):
        list(map_ordered(abs, [-1, -2, -3], executor))
    assert executor.futures[0].cancelled()
    with pytest.raises(ComputationError, match=r"^that of -2: they died$"):
        list(map_ordered(abs, [-1, -2], Failing(error), name=lambda task: f"that of {task}"))


def test_in_order__passes_errors_of_tasks_on():
    for executor in (None, ThreadPoolExecutor(1)):
        with pytest.raises(ValueError, match="math domain"):
            list(map_ordered(_root, [1, -1], executor))


def _root(x):
    if x < 0:
        raise ValueError("math domain")
    return x**0.5


def test_in_order__a_broken_process_pool_is_a_computation_that_failed():
    with (
        ProcessPoolExecutor(1) as executor,
        pytest.raises(ComputationError, match=r"^task 1: "),
    ):
        list(map_ordered(os._exit, [1, 1], executor))
