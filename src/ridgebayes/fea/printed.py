"""Base parser of text files with tables of node values at each increment."""

import functools
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.lines import Line, numbers_of, read_lines
from ridgebayes.fea.record import SHOWN
from ridgebayes.runtime.text import clipped, some_of
from ridgebayes.table.columns import LARGEST_Q

_ROW = re.compile(r"\s*\d+\s+[-+.\d][-+0-9.Ee\s]*$")
Handler = Any  # method of a `Printed` that takes a line and its match
Key = tuple[float, ...]
T = TypeVar("T")


class MissingError(Exception):
    """An increment is incomplete; the message is the reason."""


@dataclass(eq=False)
class NodeTable:
    """A printed table of node values.

    Parameters
    ----------
    line : Line
        First line.
    nodes : str
        Name of the set or region of nodes.
    columns : list of str
        Names of the values.
    rule : str
        Requirement on the rows, for messages.
    lines : list of Line
        Rows with a node and its values.
    below : dict of str to list of float
        Summary below the columns: ``TOTAL``, ``MAXIMUM``, ``MINIMUM``.
    whole : bool
        Whether the end of the table was printed.
    """

    line: Line
    nodes: str = ""
    columns: list[str] = field(default_factory=list)
    rule: str = ""
    lines: list[Line] = field(default_factory=list)
    below: dict[str, list[float]] = field(default_factory=dict)
    whole: bool = False

    def has(self, *names: str) -> bool:
        """Return whether the table has all these columns."""
        return all(name in self.columns for name in names)

    @functools.cached_property
    def rows(self) -> pd.DataFrame:
        """Values by node.

        Raises
        ------
        InputError
            If a row cannot be parsed, or a node is not a whole number or occurs twice. The message
            names the line.
        """
        try:
            values = numbers_of(self.lines, ["node", *self.columns])
            node = values[:, 0]
            is_odd = (node % 1 != 0) | (np.abs(node) > LARGEST_Q)
            is_odd |= ~np.isin(np.arange(len(node)), np.unique(node, return_index=True)[1])
            for i in np.flatnonzero(is_odd)[:1]:
                word = clipped(self.lines[i].words[0])
                raise self.lines[i].error(f"node {word}; expected a whole number, each node once")
        except InputError as error:
            raise InputError(f"{error}{self.rule and ', '}{self.rule}") from None
        return pd.DataFrame(values[:, 1:], columns=self.columns, index=node.astype(np.int64))

    def of(self, nodes: Sequence[int], *names: str) -> FloatArray:
        """Return columns of these nodes, shape (n_node, n_name).

        Raises
        ------
        MissingError
            If a node has no row.
        """
        values = self.rows[list(names)].reindex(pd.Index(nodes)).to_numpy()
        if n := int(np.isnan(values[:, 0]).sum()):
            raise MissingError(f"{', '.join(names)} missing for {n} of {len(nodes)} nodes")
        return values

    def force(self, nodes: Sequence[int], name: str) -> float:
        """Return the printed total of a column, or else its sum over these nodes.

        Raises
        ------
        MissingError
            If a node has no row.
        """
        if total := self.below.get("TOTAL"):
            return total[self.columns.index(name)]
        return math.fsum(self.of(nodes, name)[:, 0])


@dataclass(eq=False)
class Increment:
    """Tables of one increment.

    Parameters
    ----------
    line : Line
        First line.
    tables : list of NodeTable
        Tables in the order of the file.
    ignored : str
        Reason to ignore the increment; empty to use it.
    """

    line: Line
    tables: list[NodeTable] = field(default_factory=list)
    ignored: str = ""

    def table(self, columns: Sequence[str], *names: str) -> NodeTable:
        """Return the last table with these columns, for the first of the names with such a table.

        Parameters
        ----------
        columns : sequence of str
            Required columns.
        *names : str
            Names of node sets, or their parts after a point; "" for any set.

        Raises
        ------
        MissingError
            If the increment is ignored, or has no such table.
        InputError
            If a name fits tables of several sets.
        """
        if self.ignored:
            raise MissingError(self.ignored)
        for name in names or ("",):
            end = f".{name}".upper() if name else ""
            tables = [
                table
                for table in self.tables
                if table.has(*columns) and f".{table.nodes}".upper().endswith(end)
            ]
            if len(sets := {table.nodes for table in tables}) > 1:
                raise tables[-1].line.error(
                    f"{', '.join(columns)} of {', '.join(sorted(sets))}; name one of these regions"
                )
            if tables:
                return tables[-1]
        raise MissingError(
            f"{', '.join(columns)}{' of ' * bool(*names[:1])}{''.join(names[:1])} missing"
        )


def on(pattern: str) -> Callable[[Handler], Handler]:
    """Mark a method of a `Printed` as the handler of lines that begin with a pattern."""

    def marked(method: Handler) -> Handler:
        method.pattern = re.compile(rf"\s*{pattern}")
        return method

    return marked


class Printed:
    """Line parser that collects increments and their tables.

    A row goes to the current table. Another line goes to the first method, in the order of the
    class, that is marked by `on` and whose pattern matches, or else to the current table.

    Parameters
    ----------
    rule : str, optional
        Requirement on rows, for messages.
    """

    def __init__(self, rule: str = "") -> None:
        self.increments: dict[Key, Increment] = {}
        self.increment: Increment | None = None
        self.table: NodeTable | None = None
        self.others: set[str] = set()
        self.messages: list[str] = []
        self._rule, self._n_again = rule, 0
        self._nodes: dict[str, pd.Index[int]] = {}
        self._handlers = [item for item in vars(type(self)).values() if hasattr(item, "pattern")]

    @property
    def tables(self) -> list[NodeTable]:
        """Tables of all increments."""
        return [table for increment in self.increments.values() for table in increment.tables]

    def read(self, path: Path, *, unfinished: bool = False) -> Self:
        """Parse the lines of a file."""
        for line in read_lines(path, unfinished=unfinished):
            if line.text.strip():
                self.take(line)
            else:
                self.blank()
        self.increment = self.table = None
        return self

    def take(self, line: Line) -> None:
        """Parse a line that is not blank."""
        if self.table is not None and _ROW.match(line.text):  # most lines are rows
            self.row(line, self.table)
            return
        for handler in self._handlers:
            if match := handler.pattern.match(line.text):
                handler(self, line, match)
                return
        if self.table is not None:
            self.other(line, self.table)

    def blank(self) -> None:
        """Handle a blank line."""

    def row(self, line: Line, table: NodeTable) -> None:
        """Add a row to the table."""
        table.lines.append(line)

    def other(self, line: Line, table: NodeTable) -> None:
        """Handle a line within a table that is not a plain row."""
        self.row(line, table)

    def begin(self, line: Line, key: Key, *, anew: bool = False, ignored: str = "") -> Increment:
        """Start or continue an increment; with `anew`, replace an increment of the same key."""
        if anew and self.increments.pop(key, None) is not None:
            self._n_again += 1
        self.table = None
        self.increment = self.increments.setdefault(key, Increment(line, ignored=ignored))
        return self.increment

    def open(self, line: Line, nodes: str, columns: list[str]) -> NodeTable:
        """Add a table to the increment, or continue an unfinished table with the same columns."""
        if self.increment is None:
            raise line.error("a table before its increment; expected the head of an increment")
        for table in self.increment.tables:
            if (table.nodes, table.columns) == (nodes, columns) and not table.whole:
                self.table = table
                return table
        self.table = NodeTable(line, nodes, columns, self._rule)
        self.increment.tables.append(self.table)
        return self.table

    def column(self, increment: Increment, *names: str) -> "pd.Series[float]":
        """Return the first of several columns that an increment has, by node.

        Raises
        ------
        MissingError
            If the increment has none of the columns.
        InputError
            If several tables have the column, or the nodes differ between increments.
        """
        for name in names:
            tables = [table for table in increment.tables if table.has(name)]
            if len(tables) > 1:
                raise tables[-1].line.error(
                    f"{name} stands twice in an increment; expected one table"
                )
            for table in tables:
                column = table.rows[name].sort_index()
                if not column.index.equals(self._nodes.setdefault(name, column.index)):
                    raise table.line.error(
                        f"{name} of other nodes; expected the same nodes in all increments"
                    )
                return column
        raise MissingError(f"{' or '.join(names)} missing")

    def states(
        self, read: Callable[[Increment], tuple[float, T]], path: Path, required: str
    ) -> tuple[FloatArray, list[T]]:
        """Return the loads and states of all complete increments, in the order of their keys.

        Parameters
        ----------
        read : callable
            Function that returns the load and the state of an increment, and raises MissingError
            with the reason for ignoring an increment.
        path : pathlib.Path
            File, for messages.
        required : str
            Description of the required tables, for messages.

        Raises
        ------
        InputError
            If all increments are ignored.
        """
        states = []
        ignored: dict[str, list[str]] = {}
        for _, increment in sorted(self.increments.items(), key=lambda item: item[0]):
            try:
                states.append(read(increment))
            except MissingError as lack:
                ignored.setdefault(str(lack), []).append(f"line {increment.line.number}")
        notes = [f"not used: {', '.join(sorted(self.others))}"] if self.others else []
        if self._n_again:
            notes.append(f"{self._n_again} increments printed again: the later one counts")
        notes += [
            f"{some_of(where, SHOWN)}: increment ignored, {lack}" for lack, where in ignored.items()
        ]
        notes = [*self.messages, *notes]
        if not states:
            why = "".join(f"; {text}" for text in notes[:SHOWN])
            raise InputError(f"{path}: no increment with {required}{why}")
        self.messages = [f"{path}: {len(states)} increments", *notes]
        return np.array([load for load, _ in states], dtype=float), [rest for _, rest in states]
