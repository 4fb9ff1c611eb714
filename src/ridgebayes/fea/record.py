"""What importers hand on: a table, and what they understood of the file."""

import hashlib
import math
import re
from dataclasses import dataclass
from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import read_bytes
from ridgebayes.table.table import ContactTable

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
        raise InputError(f"{where} {word[:40]!r}: expected a finite number")
    return number
