"""Files that appear whole or not at all, and outputs that one process at a time works on."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ridgebayes.errors import InputError, OutputError, RidgebayesError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a file beside `path` to write; it takes the name `path` when the block ends well.

    Parameters
    ----------
    path : Path
        Final name; an existing file is replaced.

    Yields
    ------
    Path
        ``.<name>.<process>.partial`` in the same folder, so that two processes never write the
        same; gone again if the block raises.

    Raises
    ------
    InputError
        If there is no such folder.
    OutputError
        If the file cannot be written for another reason, such as a full disk.

    Notes
    -----
    HDF5 does not outlive a disk that fills up under an open file: it ends the process. Such files
    are made in memory, and written here.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with replacing(Path(folder, "a.txt")) as partial:
    ...         _ = partial.write_text("whole")
    ...     print([path.name for path in Path(folder).iterdir()])
    ['a.txt']
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        yield partial
        partial.replace(path)
    except RidgebayesError:
        raise
    except OSError as error:
        raise cannot_write(path, error) from None
    finally:
        with suppress(OSError):  # a folder that is gone, or can only be read by now
            partial.unlink(missing_ok=True)


def write_text(text: str, path: Path) -> None:
    """Write a text file whole or not at all, in UTF-8, lines ended alike on all systems."""
    write_bytes(text.encode(), path)


def write_bytes(content: bytes, path: Path) -> None:
    """Write a file whole or not at all."""
    with replacing(path) as partial:
        partial.write_bytes(content)


def cannot_write(path: Path, error: OSError) -> RidgebayesError:
    """Return the error of a file that the system would not have written.

    Parameters
    ----------
    path : Path
        The file.
    error : OSError
        Why.

    Returns
    -------
    InputError or OutputError
        The first where there is no such folder: the name is wrong.

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
    The system releases the lock when a process ends, however it ended: the file that remains
    of a killed process blocks no other process. File systems without locks exclude none.

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
    from filelock import FileLock, Timeout  # loads asyncio and sqlite

    lock = FileLock(path.with_name(f".{path.name}.lock"))
    try:
        path.parent.stat()  # filelock would make a folder that is not there
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
        with suppress(OSError):  # a folder that is gone, or can only be read by now
            Path(lock.lock_file).unlink(missing_ok=True)
        lock.release()
