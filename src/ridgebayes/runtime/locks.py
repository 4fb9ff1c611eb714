"""Outputs that one process at a time works on."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ridgebayes.errors import InputError

try:
    import fcntl
except ImportError:  # not a POSIX system
    fcntl = None  # type: ignore[assignment]

_FLAGS = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)


@contextmanager
def exclusive_lock(path: Path) -> Iterator[None]:
    """Keep every other process from working on an output while the block lasts.

    Parameters
    ----------
    path : Path
        The output. The lock is held on ``.<name>.lock`` beside it.

    Raises
    ------
    InputError
        If another process holds it, or the folder cannot be written to.

    Notes
    -----
    The system lets go of the lock when a process ends, however it ended: a file that a killed one
    left stands in nobody's way. Where there is no such lock, on file systems without and outside
    of POSIX, nothing is kept apart.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with only_one(Path(folder, "t.csv")):
    ...         print([path.name for path in Path(folder).iterdir()])
    ...     print(list(Path(folder).iterdir()))
    ['.t.csv.lock']
    []
    """
    lock = path.with_name(f".{path.name}.lock")
    descriptor = _held(path, lock)
    try:
        yield
    finally:
        with suppress(OSError):  # a folder that is gone, or can only be read by now
            lock.unlink(missing_ok=True)
        os.close(descriptor)


def _held(path: Path, lock: Path) -> int:
    """Return the open file that the lock is on."""
    while True:
        try:
            descriptor = os.open(lock, _FLAGS, 0o666)
        except OSError as error:
            raise InputError(
                f"{path}: cannot be written: {error.strerror}; expected a folder that can be "
                "written to"
            ) from None
        if fcntl is None:
            return descriptor
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            raise InputError(
                f"{path}: another process is working on it; use another -o, or wait for its end"
            ) from None
        except OSError:  # a file system without locks
            return descriptor
        if _is(descriptor, lock):
            return descriptor
        os.close(descriptor)  # the one before removed the file after it was opened here


def _is(descriptor: int, lock: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), lock.stat())
    except FileNotFoundError:
        return False
