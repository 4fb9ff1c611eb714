"""Lines of text files of other programs: numbers and nodes in them, refused with file and line."""

import functools
import math
import re
from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import read_text

# A number as programs print it: Fortran drops the E of an exponent of three digits.
NUMBER = re.compile(r"([+-]?(?:\d+(?:\.\d*)?|\.\d+))(?:[EeDd]?([+-]\d+)|[EeDd](\d+))?")
_PLAIN = re.compile(r"[-+0-9.Ee \t]*")  # what numbers of Python's spelling are made of
_ROW = re.compile(r"\s*\d+\s+[-+.\d][-+0-9.Ee\s]*$")
_MOST_NODE = 2**53
_SHOWN = 60  # characters
Handler = Any  # a method of a `Printed`, of a line and its match


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
        return self.error(f"{self.text.strip()[:_SHOWN]!r}; expected {expected}")

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
            raise InputError(f"{where} {word[:40]!r}: expected a finite number")
        return number

    def values(self, columns: str) -> list[float]:
        """Return the line's numbers, as many as there are columns between commas."""
        words = self.words
        if len(words) != columns.count(",") + 1:
            raise self.unexpected(columns)
        return [self.finite(word) for word in words]

    def node(self, word: str, seen: Container[int], rule: str = "") -> int:
        """Return a node's number, which is whole and has not been seen.

        Raises
        ------
        InputError
        """
        number = self.finite(word)
        if number != int(number) or int(number) in seen:
            raise self.error(f"node {word[:40]!r}; expected a whole number, each node once{rule}")
        return int(number)


@dataclass(frozen=True, eq=False)
class NodeRows:
    """Rows of numbers by node.

    Parameters
    ----------
    nodes : ndarray of int, shape (n_row,)
        Empty where rows are not of nodes.
    values : ndarray of float, shape (n_row, n_column)
        Numbers beside the nodes.
    """

    nodes: IntArray
    values: FloatArray

    @classmethod
    def of_lines(cls, lines: Sequence[Line], columns: str, *, is_node: bool = True) -> "NodeRows":
        """Read rows of some columns, named between commas, the first of them a node.

        Raises
        ------
        InputError
            With its line, if a row has another number of columns, a cell is no finite number, or a
            node is not whole or stands twice.
        """
        words = [line.words for line in lines]
        n = columns.count(",") + 1
        try:
            if not all(len(one) == n for one in words):
                raise ValueError("another number of columns")
            if not all(_PLAIN.fullmatch(line.text) for line in lines):
                raise ValueError("not as Python has numbers")
            values = np.array(list(chain.from_iterable(words)), dtype=float).reshape(-1, n)
        except ValueError:  # exponents without an E, or a row that is none
            values = np.array([line.values(columns) for line in lines]).reshape(-1, n)
        is_odd = ~np.isfinite(values).all(axis=1)
        if not is_node:
            for i in np.flatnonzero(is_odd).tolist()[:1]:
                lines[i].values(columns)
            return cls(np.zeros(0, dtype=np.int64), values)
        is_odd |= ~(np.abs(values[:, 0]) <= _MOST_NODE)
        is_odd |= np.where(is_odd, 0.0, values[:, 0]) % 1 != 0
        is_odd |= pd.Series(values[:, 0]).duplicated().to_numpy()
        for i in np.flatnonzero(is_odd).tolist()[:1]:
            lines[i].values(columns)
            lines[i].node(words[i][0], set(values[:i, 0].tolist()))
        return cls(values[:, 0].astype(np.int64), values[:, 1:])

    def of(self, nodes: Sequence[int]) -> FloatArray:
        """Return the values of some nodes, NaN where there are none."""
        if not len(self.nodes):
            return np.full((len(nodes), max(self.values.shape[1], 1)), np.nan)
        place = pd.Index(self.nodes).get_indexer(pd.Index(nodes))
        return np.where((place >= 0)[:, None], self.values[place], np.nan)


@dataclass
class NodeTable:
    """Values of nodes that a program printed.

    Parameters
    ----------
    line : Line
        Where it begins.
    nodes : str
        Its set or region of nodes.
    rule : str
        Words for its rows, in messages.
    columns : list of str
        Names of the values.
    lines : list of Line
        Its rows, a node and its values.
    trailers : dict of str to list of float
        Values printed below the columns: ``TOTAL``, ``MAXIMUM``, ``MINIMUM``.
    whole : bool
        Whether its end was printed.
    below : bool
        Whether a blank line came after rows.
    """

    line: Line
    nodes: str
    rule: str
    columns: list[str] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    trailers: dict[str, list[float]] = field(default_factory=dict)
    whole: bool = False
    below: bool = False

    def has(self, *names: str) -> bool:
        """Return whether all of some columns are there."""
        return all(name in self.columns for name in names)

    @functools.cached_property
    def rows(self) -> NodeRows:
        """Its rows as numbers."""
        try:
            return NodeRows.of_lines(self.lines, ", ".join(["node", *self.columns]))
        except InputError as error:
            raise InputError(f"{error}, {self.rule}") from None

    def of(self, nodes: Sequence[int], *names: str) -> FloatArray:
        """Return columns, shape (n_node, n_name); NaN for nodes without a row."""
        return self.rows.of(nodes)[:, [self.columns.index(name) for name in names]]


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


@dataclass
class Frame:
    """Tables printed for one increment.

    Parameters
    ----------
    line : int
        Where it begins.
    name : str
        Its step and number, where messages show them.
    tables : list of NodeTable
        In the order of the file.
    ignored : str
        Why it is not to be used.
    """

    line: int
    name: str = ""
    tables: list[NodeTable] = field(default_factory=list)
    ignored: str = ""


def on(pattern: str) -> Callable[[Handler], Handler]:
    """Mark a method of a `Printed` as what takes lines that begin, after blanks, with a pattern."""

    def marked(method: Handler) -> Handler:
        method.pattern = re.compile(rf"\s*{pattern}")
        return method

    return marked


class Printed:
    """Contents of a file read so far: frames, and the table that lines belong to.

    A line goes to the first method, in the order of the class, that is marked by `on` and whose
    pattern it has; another one is the table's.
    """

    def __init__(self) -> None:
        self.found: dict[tuple[int, int], Frame] = {}
        self.others: set[str] = set()
        self.frame: Frame | None = None
        self.table: NodeTable | None = None
        self._handlers = [one for one in vars(type(self)).values() if hasattr(one, "pattern")]

    def take(self, line: Line) -> None:
        """Take a line."""
        if self.table is not None and _ROW.match(line.text):  # most lines are rows
            self.row(line, self.table)
            return
        for handler in self._handlers:
            if match := handler.pattern.match(line.text):
                handler(self, line, match)
                return
        if self.table is not None:
            self.row(line, self.table)

    def row(self, line: Line, table: NodeTable) -> None:
        """Take a line of a table."""
        raise NotImplementedError


def unused(names: Iterable[str]) -> list[str]:
    """Return a message about what a file holds and nobody needs, if there is any."""
    return [f"not used: {', '.join(sorted(names))}"] if names else []


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
