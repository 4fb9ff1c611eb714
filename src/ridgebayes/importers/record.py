"""What importers hand on: a table, and what they understood of the file."""

import hashlib
import math
import re
from dataclasses import dataclass
from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.table import ContactTable

LARGEST = 2 * 2**30  # bytes of a file: more is not read into memory
HUGE = 1e100  # of lengths and loads: no body's are so great, and products of a few are floats yet
# A number as programs print it: Fortran drops the E of an exponent of three digits.
NUMBER = re.compile(r"([+-]?(?:\d+(?:\.\d*)?|\.\d+))(?:[EeDd]?([+-]\d+)|[EeDd](\d+))?")


@dataclass(frozen=True, eq=False)
class Imported:
    """A file that was understood.

    Parameters
    ----------
    table : ContactTable
        Its rows.
    said : tuple of str
        What was understood, a line each: columns, units, textures, rows kept, rows left out and
        why.
    """

    table: ContactTable
    said: tuple[str, ...]


def read_bytes(path: Path) -> bytes:
    """Return the content of a file.

    Parameters
    ----------
    path : pathlib.Path
        The file.

    Returns
    -------
    bytes

    Raises
    ------
    InputError
        If it is not there, is not a file, is over 2 GiB, or cannot be read.
    """
    try:
        if not path.is_file():
            what = "is not a file" if path.exists() else "no such file"
            raise InputError(f"{path}: {what}")
        if (size := path.stat().st_size) > LARGEST:
            raise InputError(f"{path}: {size} bytes; rule: at most {LARGEST}")
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None


def read_text(path: Path) -> str:
    """Return a file's text: UTF-8 with or without a byte order mark, lines ended in any way.

    Raises
    ------
    InputError
        As `read_bytes`, if it holds a zero byte, or if it is not UTF-8: with the line.
    """
    content = read_bytes(path)
    if b"\0" in content:
        line = content[: content.index(b"\0")].count(b"\n") + 1
        raise InputError(f"{path}, line {line}: a zero byte: not a text file, or not UTF-8")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise InputError(
            f"{path}, line {line}: byte {content[error.start]:#04x} is not UTF-8; rule: UTF-8"
        ) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def words_of(error: Exception, most: int = 120) -> str:
    """Return what an error says as one line, cut off at a length, that ends in no blank."""
    text = getattr(error, "strerror", None) or str(error)
    return " ".join(text.split())[:most].strip()


def provenance(path: Path, importer: str, *details: str) -> str:
    """Return where rows come from: importer, file, the beginning of its SHA-256, details."""
    digest = hashlib.sha256(read_bytes(path)).hexdigest()[:16]
    return " ".join([f"import {importer}:", path.name, f"sha256={digest}", *details])


def finite(path: Path, line: int, word: str, value: int | None = None) -> float:
    """Return a printed number.

    Parameters
    ----------
    path : pathlib.Path
        The file, for messages.
    line : int
        The line, for messages.
    word : str
        Digits with a point; an exponent may lack its E, as Fortran prints it.
    value : int or None, optional
        Which value of the line it is, for messages.

    Returns
    -------
    float

    Raises
    ------
    InputError
        If it is no finite number, such as with a comma for the point.
    """
    match = NUMBER.fullmatch(word) if word.isascii() else None
    number = math.nan
    if match is not None:
        number = float(f"{match[1]}e{match[2] or match[3] or '0'}")
    if not math.isfinite(number):
        where = f"{path}, line {line}" + (f", value {value} =" if value else ":")
        raise InputError(f"{where} {word[:40]!r}: rule: a finite number")
    return number
