"""Worker processes: what they return, what they raise, and what happens when they die."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import CancelledError, wait
from pathlib import Path

import pytest

from ridgebayes.runtime.worker_pool import WorkerLostError, WorkerPool


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


def test_submit__starts_no_more_processes_than_asked(pool):
    assert list(pool.map(abs, range(-50, 0))) == list(range(50, 0, -1))
    assert len(multiprocessing.active_children()) == 2


def test_submit__passes_errors_on_with_where_they_came_from(pool):
    error = pool.submit(int, "eleven").exception()
    assert isinstance(error, ValueError)
    assert "In a worker process:" in error.__notes__[0]
    # The worker lives on.
    assert pool.submit(abs, -1).result() == 1


def test_submit__what_cannot_travel_is_an_error_of_its_own(pool):
    assert "lambda" in str(pool.submit(lambda: 1).exception())
    assert isinstance(pool.submit(threading.Lock).exception(), TypeError)  # the result cannot
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
    assert str(error).startswith("3 worker processes died on it, the last with exit code 7; rule:")
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
    assert wait([running, waiting], timeout=10).not_done == set()
    assert isinstance(running.exception(), CancelledError)
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
from ridgebayes.runtime.worker_pool import WorkerPool
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
