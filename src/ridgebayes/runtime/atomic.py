"""Atomic writing of files, and locks that give a process exclusive use of an output."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ridgebayes.errors import InputError, OutputError, RidgebayesError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary file beside `path`, and rename it to `path` at the end of the block.

    Parameters
    ----------
    path : Path
        Final name; an existing file is overwritten.

    Yields
    ------
    Path
        Path ``.<name>.<process>.partial`` in the same folder, different for each process. The file
        is removed if the block raises.

    Raises
    ------
    InputError
        If the folder does not exist.
    OutputError
        If the file cannot be written for another reason, such as a full disk.

    Notes
    -----
    HDF5 ends the process if the disk fills up under an open file. HDF5 files are therefore made in
    memory, and written here.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with replacing(Path(folder, "a.txt")) as partial:
    ...         _ = partial.write_text("whole")
    ...     print([path.name for path in Path(folder).iterdir()])
    ['a.txt']
    """
    partial = path.parent / f".{path.name}.{os.getpid()}.partial"
    try:
        yield partial
        partial.replace(path)
    except RidgebayesError:
        raise
    except OSError as error:
        raise cannot_write(path, error) from None
    finally:
        with suppress(OSError):  # the folder was removed or made read-only
            partial.unlink(missing_ok=True)


def write_text(text: str, path: Path) -> None:
    """Write a text file atomically, in UTF-8 with unchanged newlines."""
    write_bytes(text.encode(), path)


def write_bytes(content: bytes, path: Path) -> None:
    """Write a file atomically."""
    with replacing(path) as partial:
        partial.write_bytes(content)


def cannot_write(path: Path, error: OSError) -> RidgebayesError:
    """Return the exception for a file that cannot be written.

    Parameters
    ----------
    path : Path
        File that was to be written.
    error : OSError
        Exception of the system.

    Returns
    -------
    InputError or OutputError
        `InputError` if the folder does not exist, because the name is wrong; else `OutputError`.

    Examples
    --------
    >>> print(cannot_write(Path("a.csv"), OSError(28, "No space left on device")))
    a.csv: cannot be written: No space left on device; expected a writable folder with room
    """
    why = " ".join((error.strerror or str(error)).split())
    what = f"{path}: cannot be written: {why}"
    if isinstance(error, FileNotFoundError | NotADirectoryError) or not path.parent.is_dir():
        return InputError(f"{what}; expected a file in an existing folder")
    return OutputError(f"{what}; expected a writable folder with room")


@contextmanager
def exclusive_lock(path: Path) -> Iterator[None]:
    """Prevent other processes from working on an output during the block.

    Parameters
    ----------
    path : Path
        Output to lock, by the file ``.<name>.lock`` beside it.

    Raises
    ------
    InputError
        If another process holds the lock, or the folder cannot be written to.

    Notes
    -----
    The system releases the lock when the process ends in any way, so the file left by a killed
    process blocks no other process. On a file system without locks nothing is prevented.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with exclusive_lock(Path(folder, "t.csv")):
    ...         print([path.name for path in Path(folder).iterdir()])
    ...     print(list(Path(folder).iterdir()))
    ['.t.csv.lock']
    []
    """
    from filelock import FileLock, Timeout  # imports asyncio and sqlite

    lock = FileLock(path.with_name(f".{path.name}.lock"))
    try:
        # Raises for a missing folder, which filelock would create, and for one without new files.
        Path(lock.lock_file).touch()
        lock.acquire(blocking=False)
    except Timeout:
        hint = "use another -o, or wait until it has ended"
        raise InputError(f"{path}: another process is working on it; {hint}") from None
    except OSError as error:
        if error.errno not in (errno.ENOLCK, errno.ENOTSUP):  # a file system without locks
            what = f"{path}: cannot be written: {error.strerror}"
            raise InputError(f"{what}; expected a folder that can be written to") from None
    try:
        yield
    finally:
        with suppress(OSError):  # the folder was removed or made read-only
            Path(lock.lock_file).unlink(missing_ok=True)
        lock.release()
