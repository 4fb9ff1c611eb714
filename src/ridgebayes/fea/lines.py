"""Lines of text files, with number parsing whose errors name file and line."""

import math
import re
from collections.abc import Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import read_text
from ridgebayes.runtime.text import clipped

# A printed number. Fortran omits the E of an exponent with three digits.
NUMBER = re.compile(r"([+-]?(?:\d+(?:\.\d*)?|\.\d+))(?:[EeDd]?([+-]\d+)|[EeDd](\d+))?")


class Line(NamedTuple):
    """A line of a file.

    Parameters
    ----------
    path : pathlib.Path
        File, for messages.
    number : int
        Line number, from 1.
    text : str
        Text without line end.
    ended : bool, optional
        Whether the line has a line end. The last line of an interrupted run may be incomplete.
    """

    path: Path
    number: int
    text: str
    ended: bool = True

    @property
    def words(self) -> list[str]:
        """Words of the line, separated by blanks."""
        return self.text.split()

    def error(self, message: str) -> InputError:
        """Return an error that names the file and the line."""
        return InputError(f"{self.path}, line {self.number}: {message}")

    def unexpected(self, expected: str) -> InputError:
        """Return an error that quotes the line."""
        return self.error(f"{clipped(self.text.strip())}; expected {expected}")

    def finite(self, word: str, value: int | None = None) -> float:
        """Parse a printed number.

        Parameters
        ----------
        word : str
            Digits with a decimal point; an exponent may lack its E, as Fortran prints it.
        value : int or None, optional
            Position of the word in the line, for messages.

        Raises
        ------
        InputError
            If the word is not a finite number, for example with a decimal comma.
        """
        number = parse_number(word)
        if not math.isfinite(number):
            where = f"{self.path}, line {self.number}" + (f", value {value} =" if value else ":")
            raise InputError(f"{where} {clipped(word)}: expected a finite number")
        return number

    def values(self, columns: Sequence[str]) -> list[float]:
        """Return the numbers of the line, one per column."""
        words = self.words
        if len(words) != len(columns):
            raise self.unexpected(", ".join(columns))
        return [self.finite(word) for word in words]


def numbers_of(lines: Sequence[Line], columns: Sequence[str]) -> FloatArray:
    """Return the numbers of lines, shape (n_line, n_column).

    Raises
    ------
    InputError
        If a line has another number of words, or a word is not a finite number. The message names
        the line.
    """
    words = [line.words for line in lines]
    flat = list(chain.from_iterable(words))
    text = "".join(flat)
    # Python also accepts underscores and digits of other scripts in numbers.
    if set(map(len, words)) == {len(columns)} and text.isascii() and "_" not in text:
        with suppress(ValueError):  # NumPy refuses exponents without an E
            values = np.array(flat, dtype=float).reshape(-1, len(columns))
            if np.isfinite(values).all():
                return values
    return np.array([line.values(columns) for line in lines]).reshape(-1, len(columns))


def parse_number(word: str) -> float:
    """Return a printed number, or NaN if the word is not a number.

    Examples
    --------
    >>> parse_number("1.5-101"), parse_number("1,5"), parse_number("1D2")
    (1.5e-101, nan, 100.0)
    """
    match = NUMBER.fullmatch(word) if word.isascii() else None
    return float(f"{match[1]}e{match[2] or match[3] or '0'}") if match is not None else math.nan


def read_lines(path: Path, *, unfinished: bool = False) -> list[Line]:
    """Read the lines of a text file.

    Parameters
    ----------
    path : pathlib.Path
        File to read.
    unfinished : bool, optional
        Whether to include a last line without line end.

    Returns
    -------
    list of Line

    Raises
    ------
    InputError
        If the file cannot be read, or is not UTF-8.
    """
    *texts, last = read_text(path).split("\n")
    lines = [Line(path, number, text) for number, text in enumerate(texts, start=1)]
    return [*lines, Line(path, len(lines) + 1, last, ended=False)] if unfinished and last else lines
