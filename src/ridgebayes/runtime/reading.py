"""Bytes and text of files that somebody else may have made: bounded before they are read."""

from pathlib import Path
from stat import S_ISREG

from ridgebayes.errors import InputError

LARGEST = 2 * 2**30  # bytes of a file: more is not read into memory
LARGEST_TEXT = 64 * 2**20  # bytes of TOML or JSON: more takes a parser minutes


def read_bytes(path: Path, most: int = LARGEST) -> bytes:
    """Return the content of a file.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    most : int, optional
        Bytes that it may have; 2 GiB if not given.

    Returns
    -------
    bytes

    Raises
    ------
    InputError
        If it is not there, is not a file (a device never ends, a pipe may never begin), is larger,
        or cannot be read.
    """
    try:
        about = path.stat()
        if not S_ISREG(about.st_mode):
            raise InputError(f"{path}: is not a file")
        if about.st_size > most:
            raise InputError(f"{path}: {about.st_size} bytes; expected at most {most}")
        return path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    except MemoryError:
        raise InputError(f"{path}: cannot be read: not enough memory") from None


def read_text(path: Path, most: int = LARGEST) -> str:
    """Return a file's text: UTF-8 with or without a byte order mark, lines ended in any way.

    Raises
    ------
    InputError
        As `read_bytes`, if it holds a zero byte, or if it is not UTF-8: with the line.
    """
    content = read_bytes(path, most)
    if b"\0" in content:
        line = content[: content.index(b"\0")].count(b"\n") + 1
        raise InputError(f"{path}, line {line}: a zero byte: not a text file, or not UTF-8")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise InputError(
            f"{path}, line {line}: byte {content[error.start]:#04x} is not UTF-8; expected UTF-8"
        ) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")
