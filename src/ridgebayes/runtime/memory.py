"""Peak memory of a job together with its workers, and freed memory kept for batches."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from os import getpid
from pathlib import Path

import numpy as np

_PROC = Path("/proc")
_INTERVAL_S = 1.0  # seconds between measurements, which take some 10 ms each


def keep_freed_memory() -> None:
    """Let this process keep some 16 MB of freed memory for the arrays of the next batch.

    glibc returns large freed arrays to the system, and gets the next arrays page by page, which
    takes up to a fifth of the run time of an evidence. Freeing a block of 8 MB raises both limits,
    see M_MMAP_THRESHOLD in mallopt(3). Nothing changes under another C library.
    """
    np.empty(2**20)  # pages that are not written take no memory


@dataclass
class PeakMemory:
    """Largest sum of proportional set sizes measured so far.

    Parameters
    ----------
    in_bytes : int or None
        Peak; None if the system does not provide it (only Linux does).
    """

    in_bytes: int | None = None

    def look(self) -> None:
        """Measure this process and its descendants; shared memory counts once."""
        if (_PROC / "self/task" / str(threading.get_native_id()) / "children").exists():
            total = sum(map(_proportional_set_size, _family(getpid())))
            self.in_bytes = max(self.in_bytes or 0, total) or None


def _family(process: int) -> list[int]:
    """Return a process and its descendants."""
    family = [process]
    for member in family:  # the list grows during the loop
        for path in (_PROC / str(member) / "task").glob("*/children"):
            with suppress(OSError):  # the thread or process has ended
                family += map(int, path.read_text().split())
    return family


def _proportional_set_size(process: int) -> int:
    with suppress(OSError):
        for line in (_PROC / str(process) / "smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return 1024 * int(line.split()[1])
    return 0


@contextmanager
def watched_memory() -> Iterator[PeakMemory]:
    """Measure the memory of a job during the block."""
    peak, done = PeakMemory(), threading.Event()

    def watch() -> None:
        while not done.wait(_INTERVAL_S):
            peak.look()

    peak.look()
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield peak
    finally:
        done.set()
        watcher.join()
