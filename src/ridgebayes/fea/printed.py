"""Tables of node values that programs print, increment by increment."""

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
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import Line, numbers_of, read_lines
from ridgebayes.fea.record import SHOWN
from ridgebayes.runtime.text import clipped, some_of
from ridgebayes.table.columns import LARGEST_Q

_ROW = re.compile(r"\s*\d+\s+[-+.\d][-+0-9.Ee\s]*$")
Handler = Any  # a method of a `Printed`, of a line and its match
Key = tuple[float, ...]
T = TypeVar("T")


class MissingError(Exception):
    """Why an increment cannot be used."""


@dataclass(eq=False)
class NodeTable:
    """Values of nodes that a program printed.

    Parameters
    ----------
    line : Line
        Where it begins.
    nodes : str
        Its set or region of nodes.
    columns : list of str
        Names of the values.
    rule : str
        Words for its rows, in messages.
    lines : list of Line
        Its rows, a node and its values.
    below : dict of str to list of float
        Values printed below the columns: ``TOTAL``, ``MAXIMUM``, ``MINIMUM``.
    whole : bool
        Whether its end was printed.
    """

    line: Line
    nodes: str = ""
    columns: list[str] = field(default_factory=list)
    rule: str = ""
    lines: list[Line] = field(default_factory=list)
    below: dict[str, list[float]] = field(default_factory=dict)
    whole: bool = False

    def has(self, *names: str) -> bool:
        """Return whether all of some columns are there."""
        return all(name in self.columns for name in names)

    @functools.cached_property
    def rows(self) -> pd.DataFrame:
        """Its columns, by node.

        Raises
        ------
        InputError
            With its line, if a row cannot be read, or its node is not whole or stands twice.
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
        """Return columns, shape (n_node, n_name).

        Raises
        ------
        MissingError
            If nodes have no row.
        """
        values = self.rows[list(names)].reindex(pd.Index(nodes)).to_numpy()
        if n := int(np.isnan(values[:, 0]).sum()):
            raise MissingError(f"{', '.join(names)} missing for {n} of {len(nodes)} nodes")
        return values

    def force(self, nodes: Sequence[int], name: str) -> float:
        """Return the printed total of a column, or else the sum over nodes.

        Raises
        ------
        MissingError
            If nodes have no row.
        """
        if total := self.below.get("TOTAL"):
            return total[self.columns.index(name)]
        return math.fsum(self.of(nodes, name)[:, 0])


@dataclass(eq=False)
class Increment:
    """Tables printed for an increment.

    Parameters
    ----------
    line : Line
        Where it begins.
    tables : list of NodeTable
        In the order of the file.
    ignored : str
        Why it is not to be used.
    """

    line: Line
    tables: list[NodeTable] = field(default_factory=list)
    ignored: str = ""

    def table(self, columns: Sequence[str], *names: str) -> NodeTable:
        """Return the last table with some columns, of the first of several sets that has it.

        Parameters
        ----------
        columns : sequence of str
            Names of its columns.
        *names : str
            Names of sets, or the ends of such names after a point; "" for any.

        Raises
        ------
        MissingError
            If there is none.
        InputError
            If there are tables of several sets.
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
    """Mark a method of a `Printed` as what takes lines that begin, after blanks, with a pattern."""

    def marked(method: Handler) -> Handler:
        method.pattern = re.compile(rf"\s*{pattern}")
        return method

    return marked


class Printed:
    """Contents of files read so far: increments, and the table that lines belong to.

    A line goes to the first method, in the order of the class, that is marked by `on` and whose
    pattern it has; another line is the table's.

    Parameters
    ----------
    rule : str, optional
        Words for rows, in messages.
    """

    def __init__(self, rule: str = "") -> None:
        self.increments: dict[Key, Increment] = {}
        self.increment: Increment | None = None
        self.table: NodeTable | None = None
        self.others: set[str] = set()
        self.messages: list[str] = []
        self._rule, self._where, self._n_again = rule, "", 0
        self._nodes: dict[str, pd.Index[int]] = {}
        self._handlers = [item for item in vars(type(self)).values() if hasattr(item, "pattern")]

    @property
    def tables(self) -> list[NodeTable]:
        """All tables that were read."""
        return [table for increment in self.increments.values() for table in increment.tables]

    def read(self, path: Path, *, unfinished: bool = False) -> Self:
        """Take the lines of a file."""
        for line in read_lines(path, unfinished=unfinished):
            if line.text.strip():
                self.take(line)
            else:
                self.blank()
        self.increment = self.table = None
        return self

    def take(self, line: Line) -> None:
        """Take a line that is not blank."""
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
        """Take a blank line."""

    def row(self, line: Line, table: NodeTable) -> None:
        """Take a row of a table."""
        table.lines.append(line)

    def other(self, line: Line, table: NodeTable) -> None:
        """Take a line of a table that is no plain row."""
        self.row(line, table)

    def begin(self, line: Line, key: Key, *, anew: bool = False, ignored: str = "") -> Increment:
        """Go to an increment; where one is printed again, the later one counts."""
        if anew and self.increments.pop(key, None) is not None:
            self._n_again += 1
        self.table = None
        self.increment = self.increments.setdefault(key, Increment(line, ignored=ignored))
        return self.increment

    def open(self, line: Line, nodes: str, columns: list[str]) -> NodeTable:
        """Add a table to the increment; one that breaks off is gone on with."""
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
        """Return a column by node: the first of several names that is there.

        Raises
        ------
        MissingError
            If none is there.
        InputError
            If there are several, or nodes are not those of other increments.
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
        self, read: Callable[[Increment], tuple[float, T]], path: Path, wanted: str
    ) -> tuple[FloatArray, list[T]]:
        """Return the load, and what else a function reads of each increment in order of their keys.

        Parameters
        ----------
        read : callable
            It raises MissingError, with the reason, where an increment is to be ignored.
        path : pathlib.Path
            The file, for messages.
        wanted : str
            Words for the tables.

        Raises
        ------
        InputError
            If no increment is left.
        """
        states = []
        ignored: dict[str, list[str]] = {}
        for _, increment in sorted(self.increments.items(), key=lambda item: item[0]):
            try:
                states.append(read(increment))
            except MissingError as lack:
                ignored.setdefault(str(lack), []).append(f"line {increment.line.number}")
        self._where = str(path)
        said = [f"not used: {', '.join(sorted(self.others))}"] if self.others else []
        if self._n_again:
            said.append(f"{self._n_again} increments printed again: the later one counts")
        said += [
            f"{some_of(where, SHOWN)}: increment ignored, {lack}" for lack, where in ignored.items()
        ]
        said = [*self.messages, *said]
        if not states:
            why = "".join(f"; {text}" for text in said[:SHOWN])
            raise InputError(f"{path}: no increment with {wanted}{why}")
        self.messages = [f"{path}: {len(states)} increments", *said]
        return np.array([load for load, _ in states], dtype=float), [rest for _, rest in states]

    def history(
        self,
        load: FloatArray,
        source: str,
        solver: str,
        *,
        at: FloatArray | None = None,
        **contact: Any,
    ) -> ContactHistory:
        """Return the history of what `states` returned, `at` the places of the surface's nodes."""
        messages = tuple(self.messages)
        if at is not None:
            contact["x"], contact["height"] = np.moveaxis(at, -1, 0)
        return ContactHistory(load, self._where, source, solver, messages=messages, **contact)
