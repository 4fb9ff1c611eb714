"""Measure what sharing out scenes costs: ``python benchmarks/scaling.py [--elements]``.

Tasks that do nothing and half-plane scenes, computed in this process, on the local pool and on a
Dask cluster of processes on this machine, with one worker and two. Rates are by the wall clock,
so other work on the machine slows them; CPU milliseconds a task hardly depend on that. They are of
this process (which hands tasks out and takes results in), of Dask's scheduler, and of the workers.

``--elements`` also times the study's nine textures by finite elements up to p/E = 0.02, each by
itself, says how much memory they took, and predicts how long 10,000 such scenes take on 1, 100 and
1,000 workers: some minutes.
"""

import argparse
import heapq
import os
import resource
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

import numpy as np
import psutil  # comes with distributed

import ridgebayes as rb
from ridgebayes.runtime.pool import executor_for, map_ordered, workers
from ridgebayes.scene.scene import Scene
from ridgebayes.simulate.generation import generate

N_NOTHING, N_SCENE = 3_000, 400


@dataclass
class Cluster:
    """Who computes: an executor, and the processes behind it."""

    name: str
    executor: Executor | None = None
    scheduler: list[int] = field(default_factory=list)
    workers: list[int] = field(default_factory=list)


def cpu(pids: list[int]) -> float:
    times = [psutil.Process(pid).cpu_times() for pid in pids]
    return sum(one.user + one.system for one in times)


@contextmanager
def local(n: int) -> Iterator[Cluster]:
    with workers(n) as pool:
        list(pool.map(time.sleep, [0.5] * n))  # all are there
        here = psutil.Process().children(recursive=True)
        yield Cluster(f"local pool, {n}", pool, [], [one.pid for one in here])


@contextmanager
def process(*words: str) -> Iterator[int]:
    with subprocess.Popen(
        [sys.executable, "-m", *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as started:
        try:
            yield started.pid
        finally:
            started.kill()


@contextmanager
def dask(n: int) -> Iterator[Cluster]:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = str(found.getsockname()[1])
    address = f"tcp://127.0.0.1:{port}"
    with ExitStack() as stack:
        words = ("--host", "127.0.0.1", "--port", port, "--no-dashboard", "--no-show")
        scheduler = stack.enter_context(process("distributed.cli.dask_scheduler", *words))
        words = (address, "--no-nanny", "--nthreads", "1", "--no-dashboard")
        pids = [
            stack.enter_context(process("distributed.cli.dask_worker", *words)) for _ in range(n)
        ]
        time.sleep(5)
        executor = stack.enter_context(executor_for(None, address))
        yield Cluster(f"Dask, {n}", executor, [scheduler], pids)


def measured(where: Cluster, n: int, work: Callable[[Executor | None], object]) -> None:
    every = ([os.getpid()], where.scheduler, where.workers)
    before, start = [cpu(pids) for pids in every], time.perf_counter()
    work(where.executor)
    wall = time.perf_counter() - start
    used = [1e3 * (cpu(pids) - t) / n for pids, t in zip(every, before, strict=True)]
    own, scheduler, working = used
    print(
        f"{where.name:<14} {n / wall:>10.0f} {1e3 * wall / n:>10.2f} {own:>8.2f} "
        f"{scheduler:>10.2f} {working:>8.2f}",
        flush=True,
    )


def nothing(executor: Executor | None) -> None:
    list(map_ordered(abs, range(N_NOTHING), executor))


def scenes(seed: int) -> Scene:
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.012, 0.032, N_SCENE), rng.uniform(0.01, 0.03, N_SCENE)
    return Scene.of(zip(a, b, strict=True))


def predicted(costs: list[float], n: int, n_worker: int, dispatch: float) -> float:
    """Return the seconds until the last of n scenes is done, of costs drawn from those given.

    Each goes to the worker that is free first, as a scheduler gives them out, and no two are given
    out within `dispatch` seconds.
    """
    drawn = np.random.default_rng(1).choice(costs, n)
    free = [0.0] * n_worker
    for i, cost in enumerate(drawn):
        heapq.heapreplace(free, max(free[0], i * dispatch) + cost)
    return max(free)


def elements() -> None:
    print(f"\n{'a/R':>6} {'b/R':>6} {'rows':>5} {'CPU s':>7} {'most memory so far, GiB':>24}")
    costs = []
    for texture in Scene.paper().textures:
        if texture.role == "held-out":
            continue
        a, b = texture.a_over_R, texture.b_over_R
        start = time.process_time()
        table = rb.generate(Scene.of([(a, b)]), solver="cylinder-fe")
        costs.append(used := time.process_time() - start)
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        print(f"{a:>6} {b:>6} {len(table):>5} {used:>7.1f} {memory:>24.2f}", flush=True)
    for n_worker in (1, 100, 1_000):
        for dispatch in (0.0, 2e-3):
            seconds = predicted(costs, 10_000, n_worker, dispatch)
            at_work = 10_000 * float(np.mean(costs)) / (n_worker * seconds)
            print(
                f"10,000 scenes, {n_worker:>5} workers, {1e3 * dispatch:g} ms to give one out: "
                f"{seconds:>9.0f} s, workers busy {at_work:.0%}"
            )


def main() -> None:
    parser = argparse.ArgumentParser(prog="python benchmarks/scaling.py")
    parser.add_argument("--elements", action="store_true", help="finite elements too")
    options = parser.parse_args()
    print(f"{os.cpu_count()} processors, load before: {os.getloadavg()[0]:.1f}")
    # Other scenes first: imports are not what is asked about, and solutions are remembered.
    first, then = scenes(0), scenes(1)
    generate(first)
    for title, n, before, work in (
        ("tasks that do nothing", N_NOTHING, nothing, nothing),
        (
            "half-plane scenes",
            N_SCENE,
            lambda executor: generate(first, executor=executor),
            lambda executor: generate(then, executor=executor),
        ),
    ):
        print(f"\n{n} {title}: a second; wall ms each; CPU ms each here, scheduler, workers")
        measured(Cluster("this process"), n, work)
        for make in (local, dask):
            for n_worker in (1, 2):
                with make(n_worker) as where:
                    before(where.executor)
                    measured(where, n, work)
    if options.elements:
        elements()


if __name__ == "__main__":
    main()
