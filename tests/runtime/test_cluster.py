"""Dask: a scheduler and workers that are processes of their own, one of which is killed."""

import importlib
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from dataclasses import replace

import distributed
import pytest

import ridgebayes as rb
from ridgebayes.commands.generate import sweep_job
from ridgebayes.errors import WorkerLostError
from ridgebayes.runtime.pool import executor_for, map_ordered

SCENE = rb.Scene.of([(0.012 + 0.001 * i, 0.03 - 0.001 * i) for i in range(20)], p_over_E=0.01)


@contextmanager
def process(*words, **options):
    started = subprocess.Popen(
        [sys.executable, "-m", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        **options,
    )
    try:
        yield started
    finally:
        started.kill()
        started.wait()


@contextmanager
def dask_worker(address):
    # Without a nanny: what is killed stays dead.
    words = ("--no-nanny", "--nthreads", "1", "--no-dashboard")
    with process("distributed.cli.dask_worker", address, *words) as started:
        yield started


@contextmanager
def dask_scheduler(**settings):
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    words = ("--host", "127.0.0.1", "--port", str(port), "--no-dashboard", "--no-show")
    environment = os.environ | settings
    with process("distributed.cli.dask_scheduler", *words, env=environment) as started:
        end = time.monotonic() + 60
        while True:
            try:
                socket.create_connection(("127.0.0.1", port), timeout=1).close()
                break
            except OSError:
                assert started.poll() is None
                assert time.monotonic() < end
                time.sleep(0.05)
        yield f"tcp://127.0.0.1:{port}", started


@pytest.fixture(scope="module")
def address():
    """The address of a scheduler with two workers."""
    with ExitStack() as stack:
        where, _ = stack.enter_context(dask_scheduler())
        for _ in range(2):
            stack.enter_context(dask_worker(where))
        with distributed.Client(where) as client:
            client.wait_for_workers(2, timeout=60)
        yield where


def test_sweep__dask_writes_the_bytes_of_one_process_and_of_two(tmp_path, address):
    sweep_job(tmp_path / "dask.csv", SCENE, scheduler=address)
    sweep_job(tmp_path / "two.csv", SCENE, workers=2)
    rb.generate(SCENE).write(tmp_path / "one.csv")
    expected = (tmp_path / "one.csv").read_bytes()
    assert (tmp_path / "two.csv").read_bytes() == expected
    assert (tmp_path / "dask.csv").read_bytes() == expected


def test_version_of_workers__is_asked_for(address):
    from ridgebayes.simulate import generation

    task = generation._tasks(SCENE, "auto", 1e-8, (24, 10))[0]
    old = replace(task, version="0.0.9")
    with (
        executor_for(None, address) as executor,
        pytest.raises(
            rb.InputError, match=rf"a worker has ridgebayes {rb.__version__}, .* 0\.0\.9"
        ),
    ):
        executor.submit(generation._solved, old).result(60)


def test_cluster__without_the_package_is_told_to_install_it(address, tmp_path, monkeypatch):
    (tmp_path / "only_here.py").write_text("def one(x):\n    return 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    one = importlib.import_module("only_here").one
    expected = (
        r"a package is missing on the cluster \(No module named 'only_here'\); "
        r"expected the same ridgebayes on its sched"
    )
    with executor_for(None, address) as executor, pytest.raises(rb.InputError, match=expected):
        executor.submit(one, 1).result(60)


def test_sweep__a_dask_worker_killed_on_the_way_changes_nothing(tmp_path, address):
    rb.generate(SCENE).write(tmp_path / "one.csv")
    said = []
    with executor_for(None, address) as executor, dask_worker(address) as victim:
        where = third_worker(executor)
        os.kill(victim.pid, signal.SIGSTOP)  # it will hold textures, and not get them done

        def tell(text):
            said.append(text)
            if victim.poll() is None and executor._client.processing().get(where):
                victim.kill()
                victim.wait()

        for _ in range(40):  # on a busy machine the others may be done before it is given any
            said.clear()
            rb.generate(SCENE, executor=executor, progress=tell).write(tmp_path / "dask.csv")
            if victim.poll() is not None:
                break
        assert victim.poll() == -signal.SIGKILL
    assert len(said) == len(SCENE.textures)
    assert (tmp_path / "dask.csv").read_bytes() == (tmp_path / "one.csv").read_bytes()


def third_worker(executor):
    """Wait for one more than the two there are, and return its address."""
    end, before = time.monotonic() + 60, set(executor._client.nthreads())
    assert len(before) == 2
    while not (new := set(executor._client.nthreads()) - before):
        assert time.monotonic() < end
        time.sleep(0.05)
    (where,) = new
    return where


def test_lost_workers__too_many_of_them_name_the_task():
    allowed = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
    with (
        dask_scheduler(**allowed) as (where, _),
        dask_worker(where),
        executor_for(None, where) as executor,
    ):
        with pytest.raises(WorkerLostError, match="this task ended 1 workers of the cluster; they"):
            executor.submit(os._exit, 1).result(60)
        with (
            dask_worker(where),
            pytest.raises(rb.ComputationError, match=r"^task 1: this task ended 1 workers"),
        ):
            list(map_ordered(os._exit, [1], executor))


def test_lost_scheduler__is_a_computation_that_failed():
    with (
        dask_scheduler() as (where, scheduler),
        dask_worker(where),
        executor_for(None, where) as executor,
    ):
        assert executor.submit(abs, -1).result(60) == 1
        waiting = executor.submit(time.sleep, 100)
        time.sleep(0.5)
        scheduler.kill()
        with pytest.raises(WorkerLostError, match="scheduler"):
            waiting.result(60)
