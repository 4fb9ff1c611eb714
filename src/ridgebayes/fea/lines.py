"""Lines of text files of other programs: numbers in them, refused with file and line."""

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

# A number as programs print it: Fortran drops the E of an exponent of three digits.
NUMBER = re.compile(r"([+-]?(?:\d+(?:\.\d*)?|\.\d+))(?:[EeDd]?([+-]\d+)|[EeDd](\d+))?")


class Line(NamedTuple):
    """A line of a file.

    Parameters
    ----------
    path : pathlib.Path
        The file, for messages.
    number : int
        From 1.
    text : str
        Without its end.
    ended : bool, optional
        Whether it has one: the last line of a run that was stopped may be half.
    """

    path: Path
    number: int
    text: str
    ended: bool = True

    @property
    def words(self) -> list[str]:
        """Words of the line, between blanks."""
        return self.text.split()

    def error(self, message: str) -> InputError:
        """Return an error that names the file and the line."""
        return InputError(f"{self.path}, line {self.number}: {message}")

    def unexpected(self, expected: str) -> InputError:
        """Return an error that shows the line."""
        return self.error(f"{clipped(self.text.strip())}; expected {expected}")

    def finite(self, word: str, value: int | None = None) -> float:
        """Return a printed number.

        Parameters
        ----------
        word : str
            Digits with a point; an exponent may lack its E, as Fortran prints it.
        value : int or None, optional
            Which value of the line it is, for messages.

        Raises
        ------
        InputError
            If it is no finite number, such as with a comma for the point.
        """
        number = parse_number(word)
        if not math.isfinite(number):
            where = f"{self.path}, line {self.number}" + (f", value {value} =" if value else ":")
            raise InputError(f"{where} {clipped(word)}: expected a finite number")
        return number

    def values(self, columns: Sequence[str]) -> list[float]:
        """Return the line's numbers, as many as there are columns."""
        words = self.words
        if len(words) != len(columns):
            raise self.unexpected(", ".join(columns))
        return [self.finite(word) for word in words]


def numbers_of(lines: Sequence[Line], columns: Sequence[str]) -> FloatArray:
    """Return the numbers of lines, shape (n_line, n_column).

    Raises
    ------
    InputError
        With its line, if a line has another number of columns, or a cell is no finite number.
    """
    words = [line.words for line in lines]
    flat = list(chain.from_iterable(words))
    text = "".join(flat)
    # Python has underscores and digits of other scripts in numbers, too.
    if set(map(len, words)) == {len(columns)} and text.isascii() and "_" not in text:
        with suppress(ValueError):  # exponents without an E
            values = np.array(flat, dtype=float).reshape(-1, len(columns))
            if np.isfinite(values).all():
                return values
    return np.array([line.values(columns) for line in lines]).reshape(-1, len(columns))


def last_digit_of(word: str) -> float:
    """Return what the last printed digit is worth.

    Examples
    --------
    >>> last_digit_of("1.234"), last_digit_of("1.2345E-03")
    (0.001, 1e-07)
    """
    match = NUMBER.fullmatch(word)
    assert match is not None
    power = int(match[2] or match[3] or 0) - len(match[1].partition(".")[2])
    return float(f"1e{power}")


def parse_number(word: str) -> float:
    """Return a printed number, NaN if it is none.

    Examples
    --------
    >>> parse_number("1.5-101"), parse_number("1,5"), parse_number("1D2")
    (1.5e-101, nan, 100.0)
    """
    match = NUMBER.fullmatch(word) if word.isascii() else None
    return float(f"{match[1]}e{match[2] or match[3] or '0'}") if match is not None else math.nan


def read_lines(path: Path, *, unfinished: bool = False) -> list[Line]:
    """Read a text file.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    unfinished : bool, optional
        Whether to return a last line without an end too.

    Returns
    -------
    list of Line

    Raises
    ------
    InputError
        If it cannot be read, or is not UTF-8.
    """
    *texts, last = read_text(path).split("\n")
    lines = [Line(path, number, text) for number, text in enumerate(texts, start=1)]
    return [*lines, Line(path, len(lines) + 1, last, ended=False)] if unfinished and last else lines
