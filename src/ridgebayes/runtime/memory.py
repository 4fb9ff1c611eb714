"""How much memory a job and its workers take together, at their peak."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from os import getpid
from pathlib import Path

_PROC = Path("/proc")
_EVERY = 1.0  # seconds between two looks, each of some 10 ms


@dataclass
class PeakMemory:
    """The greatest sum of proportional set sizes seen so far.

    Parameters
    ----------
    in_bytes : int or None
        None where the system does not tell (only Linux does).
    """

    in_bytes: int | None = None

    def look(self) -> None:
        """Add up this process and all below it; memory that they share counts once."""
        if (_PROC / "self/task" / str(threading.get_native_id()) / "children").exists():
            total = sum(map(_proportional_set_size, _family(getpid())))
            self.in_bytes = max(self.in_bytes or 0, total) or None


def _family(process: int) -> list[int]:
    """Return a process and all below it."""
    family = [process]
    for member in family:  # which grows meanwhile
        for path in (_PROC / str(member) / "task").glob("*/children"):
            with suppress(OSError):  # a thread or process that has just ended
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
    """Watch the memory of a job while the block runs."""
    peak, done = PeakMemory(), threading.Event()

    def watch() -> None:
        while not done.wait(_EVERY):
            peak.look()

    peak.look()
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield peak
    finally:
        done.set()
        watcher.join()
