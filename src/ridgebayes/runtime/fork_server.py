"""The process that forks workers: a copy of this one, made while that is safe."""

import gc
import multiprocessing
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from multiprocessing import forkserver, resource_tracker, util
from pathlib import Path
from typing import Any

# A server that has imported everything forks workers in milliseconds, whatever threads this process
# has by then; without one (Windows) each worker imports for itself.
METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
_PACKAGE = __name__.partition(".")[0]
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_starting = threading.Lock()


def start_server() -> None:
    """Start, once, the process that has imported what workers need, and forks them.

    Where this process has one thread it is a copy of this one: what is imported by now takes no
    memory and no time again. Otherwise it is a fresh one, which imports for itself.
    """
    if METHOD != "forkserver":
        return
    # Ctrl-C reaches the whole group of processes: server and workers start with it held back. The
    # tracker is started before, because that start ends with the signal let through.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    alone = sys.platform == "linux" and threading.active_count() == 1
    loaded = [name for name in list(sys.modules) if name.startswith(f"{_PACKAGE}.")]
    try:
        with one_thread_each(), _forking() if alone else nullcontext():
            forkserver.set_forkserver_preload([] if alone else loaded)
            forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _forking() -> Iterator[None]:
    """Have multiprocessing make its fork server by a fork in place of a fresh interpreter."""
    spawn = util.spawnv_passfds
    util.spawnv_passfds = _fork
    try:
        yield
    finally:
        util.spawnv_passfds = spawn


def _fork(path: bytes, args: Sequence[Any], passfds: Sequence[int]) -> int:
    """Do in a copy of this process what a fresh interpreter is told; stands for `spawnv_passfds`.

    Libraries may have threads of their own, such as arrow's allocator: those mind forks.
    """
    for stream in (sys.stdout, sys.stderr):
        stream.flush()  # else the copy would write the same again
    gc.freeze()  # what is there is shared as long as nobody collects it
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        process = os.fork()
    if process:
        gc.unfreeze()
        return process
    try:
        # Files of the parent: it would never be seen to end by who waits for their end.
        for file in [int(one.name) for one in Path("/proc/self/fd").iterdir()]:
            if file > 2 and file not in passfds:
                with suppress(OSError):
                    os.close(file)
        exec(args[-1], {})
    finally:
        os._exit(0)


@contextmanager
def one_thread_each() -> Iterator[None]:
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
