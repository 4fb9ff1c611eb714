"""Who computes: options that choose it, workers and their deaths, and results in order."""

import multiprocessing
import os
import signal
import subprocess
import sys
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
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from ridgebayes import ComputationError, InputError
from ridgebayes.errors import WorkerLostError
from ridgebayes.runtime.pool import WorkerPool, executor_for, map_ordered, workers


@pytest.fixture
def pool():
    pool = WorkerPool(2)
    yield pool
    pool.stop()
    assert multiprocessing.active_children() == []


def until(true, seconds=20.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_submit__returns_what_the_function_does_in_another_process(pool):
    assert pool.submit(divmod, 7, 2).result() == (3, 1)
    assert pool.submit(int, "11", base=2).result() == 3
    pids = {pool.submit(os.getpid).result() for _ in range(8)}
    assert os.getpid() not in pids
    assert 1 <= len(pids) <= 2


def test_submit__passes_errors_on_with_where_they_came_from(pool):
    error = pool.submit(int, "eleven").exception()
    assert isinstance(error, ValueError)
    assert "in _call" in str(error.__cause__)  # the worker's traceback
    # The worker lives on.
    assert pool.submit(abs, -1).result() == 1


class OneWayError(Exception):
    def __init__(self, one, two):
        super().__init__(f"{one} of {two}")


def _raise_what_does_not_come_back():
    raise OneWayError(1, 2)


class OnlyThere:
    """Cannot be made from what is sent of it, as a function of a notebook cannot."""

    def __reduce__(self):
        return __import__, ("no_such_module",)


def test_submit__what_cannot_travel_is_an_error_of_its_own(pool):
    assert "<lambda>'; worker processes import" in str(pool.submit(lambda: 1).exception())
    assert isinstance(pool.submit(threading.Lock).exception(), TypeError)  # the result cannot
    error = pool.submit(_raise_what_does_not_come_back).exception()
    assert (type(error), str(error)) == (RuntimeError, "OneWayError: 1 of 2")
    # Nor can it be read.
    assert "no_such_module'; worker processes import" in str(pool.submit(OnlyThere()).exception())
    assert pool.submit(abs, -1).result() == 1


def test_lost_worker__costs_its_own_task_a_second_try_and_no_other(pool, tmp_path):
    victim = pool.submit(os.getpid).result()
    os.kill(victim, signal.SIGSTOP)  # so that what it is given is not done when it dies
    # A folder that is there already cannot be made: no task can be done twice unseen.
    futures = [pool.submit(os.mkdir, tmp_path / str(i)) for i in range(20)]
    until(lambda: sum(future.done() for future in futures) == 19)
    os.kill(victim, signal.SIGKILL)
    assert [future.result(20) for future in futures] == [None] * 20
    assert len(list(tmp_path.iterdir())) == 20
    assert victim not in {pool.submit(os.getpid).result() for _ in range(8)}


def test_lost_worker__three_times_is_an_error_that_says_how(pool):
    error = pool.submit(os._exit, 7).exception()
    assert isinstance(error, WorkerLostError)
    assert str(error).startswith(
        "3 worker processes died on this task, the last with exit code 7; they"
    )
    assert pool.submit(abs, -1).result() == 1


def test_workers__leave_ctrl_c_to_their_parent():
    # A shell may have started this process with the signal ignored, and workers would inherit that.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    pool = WorkerPool(1)
    try:
        worker = pool.submit(os.getpid).result()
        for _ in range(3):
            sleeping = pool.submit(time.sleep, 0.2)
            until(sleeping.running)
            time.sleep(0.05)
            os.kill(worker, signal.SIGINT)  # at work
            assert sleeping.exception(20) is None
            os.kill(worker, signal.SIGINT)  # waiting for it
        assert pool.submit(os.getpid).result() == worker
    finally:
        pool.stop()
        signal.signal(signal.SIGINT, before)


def test_stop__does_not_wait_for_what_is_under_way():
    pool = WorkerPool(1)
    running, waiting = pool.submit(time.sleep, 100), pool.submit(abs, -1)
    until(running.running)
    start = time.monotonic()
    pool.stop()
    assert time.monotonic() - start < 20
    assert isinstance(running.exception(10), CancelledError)
    assert waiting.cancelled()
    with pytest.raises(RuntimeError, match="after shutdown"):
        pool.submit(abs, -1)


def test_shutdown__ends_what_is_begun_and_drops_the_rest_if_told():
    pool = WorkerPool(1)
    futures = [pool.submit(time.sleep, 0.3) for _ in range(3)]
    until(futures[0].running)
    pool.shutdown(cancel_futures=True)
    assert [future.cancelled() for future in futures] == [False, True, True]
    pool = WorkerPool(1)
    futures = [pool.submit(abs, -i) for i in range(3)]
    pool.shutdown()
    assert [future.result() for future in futures] == [0, 1, 2]
    assert multiprocessing.active_children() == []


PARENT = """
import os, sys, time
from ridgebayes.runtime.pool import WorkerPool
if __name__ == "__main__":
    pool = WorkerPool(2)
    worker = pool.submit(os.getpid).result()
    sleeping = [pool.submit(time.sleep, 100) for _ in range(2)]
    while not all(future.running() for future in sleeping):
        time.sleep(0.01)
    time.sleep(0.2)  # until they are asleep
    print(worker, flush=True)
    time.sleep(100)
"""


def test_workers__end_when_their_parent_is_killed(tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE) as parent:
        worker = int(parent.stdout.readline())
        assert Path(f"/proc/{worker}").exists()
        parent.kill()
    until(lambda: not Path(f"/proc/{worker}").exists())


UNGUARDED = """
import os
from ridgebayes.runtime.pool import end_unguarded_worker, workers
end_unguarded_worker()
with workers(1) as pool:
    pool.submit(os.getpid).result()
"""


def test_workers__of_a_script_without_a_guard_are_one_error_that_names_it(tmp_path):
    (script := tmp_path / "script.py").write_text(UNGUARDED)
    said = subprocess.run([sys.executable, script], capture_output=True, text=True)
    assert said.returncode == 1
    assert said.stderr.count("Error: ") == 1
    assert 'call run below `if __name__ == "__main__":`' in said.stderr


SERVER = """
import sys
from ridgebayes.runtime.pool import start_server, workers
if __name__ == "__main__":
    import ridgebayes.runtime.journal
    if sys.argv[1:]:
        start_server(sys.argv[1:])
    with workers(1) as pool:
        names = pool.submit(eval, "[*__import__('sys').modules]").result()
        print(["colorsys" in names, "ridgebayes.runtime.journal" in names])
"""


@pytest.mark.parametrize(
    ("preload", "expected"), [(["colorsys"], "[True, False]"), ([], "[False, True]")]
)
def test_start_server__imports_what_it_is_told_or_what_is_loaded(preload, expected):
    words = [sys.executable, "-", *preload]  # a script from standard input has no file
    said = subprocess.run(words, check=True, capture_output=True, text=True, input=SERVER)
    assert said.stdout == expected + "\n"


class Later(Executor):
    """Computes nothing until so many tasks are out, and then the last one first."""

    def __init__(self, until):
        self.until, self.waiting, self.done = until, [], []

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

    def __init__(self, error):
        self.error, self.futures = error, []

    def submit(self, function, task):
        self.futures.append(Future())
        if len(self.futures) == 2:
            self.futures[-1].set_exception(self.error)
        return self.futures[-1]


@pytest.mark.parametrize("n", [0, 1, 3, 50])
def test_map_ordered__is_the_order_of_tasks_on_any_executor(n):
    expected = [n - i for i in range(n)]
    tasks = [i - n for i in range(n)]
    assert list(map_ordered(abs, tasks, None)) == expected
    with ThreadPoolExecutor(3) as executor:
        assert list(map_ordered(abs, tasks, executor)) == expected
    backwards = Later(until=n)
    assert list(map_ordered(abs, tasks, backwards)) == expected
    assert backwards.done == tasks[::-1]


def test_map_ordered__submits_all_tasks_at_once():
    executor = Later(until=100)  # computes nothing until 100 tasks are out
    assert list(map_ordered(abs, range(-100, 0), executor)) == list(range(100, 0, -1))


def test_map_ordered__says_what_is_done_as_soon_as_it_is():
    executor, said = Later(until=3), []
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


def test_map_ordered__drops_what_is_not_wanted_any_more():
    executor = Later(until=2)
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
def test_map_ordered__names_the_task_that_workers_died_on(error):
    executor = Failing(error)
    with pytest.raises(ComputationError, match=r"^task 2: they died$"):
        list(map_ordered(abs, [-1, -2, -3], executor))
    assert executor.futures[0].cancelled()
    with pytest.raises(ComputationError, match=r"^that of -2: they died$"):
        list(map_ordered(abs, [-1, -2], Failing(error), name=lambda task: f"that of {task}"))


def test_map_ordered__a_broken_process_pool_is_a_computation_that_failed():
    with ProcessPoolExecutor(1) as executor, pytest.raises(ComputationError, match=r"^task 1: "):
        list(map_ordered(os._exit, [1, 1], executor))


THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def test_executor_for__one_process_is_this_one():
    for n in (None, 1):
        with executor_for(n) as executor:
            assert executor is None
    with executor_for(2) as executor:
        assert executor.submit(os.getpid).result() != os.getpid()


def test_workers__have_one_thread_each_and_leave_no_trace(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    with workers(1) as pool:
        assert [pool.submit(os.getenv, name).result() for name in THREADS] == ["1", "1", "1"]
    assert os.environ["OMP_NUM_THREADS"] == "7"
    assert "MKL_NUM_THREADS" not in os.environ


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (
            (2, "tcp://127.0.0.1:1"),
            r"^--workers and --scheduler: expected only one of the two, got both$",
        ),
        ((None, "tcp://127.0.0.1:1"), r"^--scheduler tcp://127.0.0.1:1: no Dask scheduler answers"),
        ((None, "nowhere"), r"^--scheduler nowhere: .* expected tcp://HOST:PORT"),
        ((None, "http://127.0.0.1:1"), r"not tcp://HOST:PORT"),
        ((None, "tcp://:8786"), r"not tcp://HOST:PORT"),
        ((None, "tcp://127.0.0.1:99999999"), r"no Dask scheduler answers"),
    ],
)
def test_executor_for__refuses_what_it_cannot_give(given, expected):
    with pytest.raises(InputError, match=expected), executor_for(*given):
        pass


def test_executor_for__says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    expected = r"needs distributed: pip install 'ridgebayes\[dask\]'"
    with pytest.raises(InputError, match=expected), executor_for(None, "tcp://127.0.0.1:1"):
        pass


def test_map_ordered__in_this_process_keeps_blas_to_one_thread_and_gives_it_back():
    def blas_threads(_=None):
        return {blas["num_threads"] for blas in threadpool_info() if blas["user_api"] == "blas"}

    with threadpool_limits(2, user_api="blas"):
        before = blas_threads()
        assert list(map_ordered(blas_threads, [0, 1], None)) == [{1}, {1}]
        assert blas_threads() == before == {2}
