"""XML files of meshes that somebody else may have made: nothing in them is taken on trust.

No types and no entities are declared in them, sizes are held against limits before numbers are
read, and only what is asked for is read.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import LARGEST, read_text
from ridgebayes.runtime.text import one_line_message

_LARGEST_XML = 64 * 2**20  # bytes: more would take a parser longer than a user waits
_SHOWN = 80  # characters of a word in a file that messages show
_MOST_NAMES = 10  # of fields that messages show
_ENCODING = re.compile(r"<\?xml[^>]*encoding\s*=\s*[\"']([^\"']*)")


@dataclass
class Series:
    """What stands in the files of a series.

    Parameters
    ----------
    points : ndarray of float, shape (n_point, 2 or 3), length
        Undeformed.
    moved : ndarray of float, shape (n_state, n_point, 2), length
        Displacements.
    loads : ndarray of float, shape (n_state,)
        Time of each state.
    places : list of str
        Where each state stands, for messages.
    """

    points: FloatArray
    moved: FloatArray
    loads: FloatArray
    places: list[str]


@dataclass
class Budget:
    """What is left of the bytes that a series' numbers may take."""

    left: int = LARGEST


class MeshXml:
    """A parsed file.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    budget : Budget
        Shared by the files of a series.

    Raises
    ------
    InputError
        If it is no XML, is too large, has a document type or entities, or is not UTF-8.
    """

    def __init__(self, path: Path, budget: Budget) -> None:
        self.path, self._budget = path, budget
        text = read_text(path)
        if len(text) > _LARGEST_XML:
            raise self.error(f"{len(text)} bytes; expected at most {_LARGEST_XML}, with HDF5")
        for word in ("<!DOCTYPE", "<!ENTITY"):
            if (at := text.upper().find(word)) >= 0:
                line = text.count("\n", 0, at) + 1
                raise InputError(f"{path}, line {line}: {word}; expected XML without it")
        encoding = _ENCODING.match(text)
        if encoding and encoding[1].upper() not in ("UTF-8", "UTF8", "ASCII", "US-ASCII"):
            raise InputError(f"{path}, line 1: encoding {short(encoding[1])}; expected UTF-8")
        try:
            self.root = ET.fromstring(text)
        except ET.ParseError as error:
            raise InputError(f"{path}, line {error.position[0]}: {error}; expected XML") from None

    def error(self, message: str) -> InputError:
        """Return an error that names the file."""
        return InputError(f"{self.path}: {message}")

    def take(self, shape: Sequence[int]) -> None:
        """Refuse numbers that with all before them would take too many bytes."""
        self._budget.left -= 8 * math.prod(shape)
        if self._budget.left < 0:
            raise self.error(
                f"{' x '.join(map(str, shape))} numbers; expected at most {LARGEST} bytes in all"
            )

    def whole(self, word: str | None) -> int:
        """Return a whole number from 0."""
        if word is None or not re.fullmatch("[0-9]{1,15}", word):
            raise self.error(f"{short(word)}; expected a whole number")
        return int(word)

    def one_of(self, name: str, word: str | None, words: Sequence[str]) -> str:
        """Return a word that is one of some."""
        if word is None or word not in words:
            raise self.error(f"{name} {short(word)}; expected one of {', '.join(words)}")
        return word

    def from_text(self, text: str, shape: tuple[int, ...], *, is_single: bool) -> FloatArray:
        """Return numbers between blanks, in single precision if they were."""
        try:
            if not text.isascii() or "_" in text:
                raise ValueError("not in digits of ASCII")
            numbers = np.array(text.split(), dtype=np.float64)
        except ValueError as error:
            message = f"{one_line_message(error)}; expected numbers between blanks"
            raise self.error(message) from None
        if numbers.size != math.prod(shape):
            raise self.error(f"{numbers.size} numbers, and Dimensions {shape}; expected as many")
        with np.errstate(over="ignore"):  # to infinity, which is refused where it belongs
            return np.asarray(numbers, dtype="f4" if is_single else "f8").reshape(shape)


def one_named(here: str, field: str, data: list[ET.Element], given: list[ET.Element]) -> ET.Element:
    """Return the one array of point data with a name; messages show those of all that is given."""
    found = [one for one in data if one.get("Name") == field]
    if not found:
        names = ", ".join(sorted({short(one.get("Name")) for one in given})[:_MOST_NAMES])
        raise InputError(f"{here}: no point data {field!r}; the fields are {names or 'none'}")
    if len(found) > 1:
        raise InputError(f"{here}: {len(found)} point data {field!r}; expected one of a name")
    return found[0]


def displacements(where: str, field: str, values: FloatArray, points: FloatArray) -> FloatArray:
    """Return displacements if they are finite, and two or three a point."""
    if values.ndim != 2 or len(values) != len(points) or values.shape[1] not in (2, 3):
        raise InputError(
            f"{where}: {field!r} of shape {values.shape}; expected ({len(points)}, 2 or 3)"
        )
    return finite_array(where, repr(field), values)[:, :2]


def finite_array(where: str, what: str, values: FloatArray) -> FloatArray:
    """Return numbers that are all finite."""
    if not np.isfinite(values).all():
        raise InputError(f"{where}: {what} are not all finite; expected finite numbers")
    return values


def as_floats(values: np.ndarray) -> FloatArray:
    """Return numbers in this machine's order, as float32 where they were."""
    kind = np.float32 if values.dtype.kind == "f" and values.dtype.itemsize <= 4 else np.float64
    return np.asarray(values, dtype=kind)


def short(word: str | None) -> str:
    """Return a word of a file as messages show it: in quotes, and no more than its beginning."""
    return repr(word if word is None else word[:_SHOWN])
