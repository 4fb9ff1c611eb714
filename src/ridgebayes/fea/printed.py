"""Base parser of text files with tables of node values at each increment."""

import functools
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple, Self

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


class MissingError(Exception):
    """An increment is incomplete; the message is the reason."""


class Wanted(NamedTuple):
    """Columns that a reader needs of some nodes, and the node set of their table.

    Parameters
    ----------
    columns : sequence of str
        Names of the values.
    nodes : sequence of int
        Nodes whose values are needed.
    of : str, optional
        Node set; "" in files without names of sets.
    """

    columns: Sequence[str]
    nodes: Sequence[int]
    of: str = ""


@dataclass(eq=False)
class NodeTable:
    """A printed table of node values.

    Parameters
    ----------
    line : Line
        First line.
    nodes : str
        Name of the set of nodes.
    columns : list of str
        Names of the values.
    lines : list of Line
        Rows with a node and its values.
    below : dict of str to list of float
        Summary below the columns: ``TOTAL``, ``MAXIMUM``, ``MINIMUM``.
    whole : bool
        Whether the end of the table was printed.
    """

    line: Line
    nodes: str
    columns: list[str]
    lines: list[Line] = field(default_factory=list)
    below: dict[str, list[float]] = field(default_factory=dict)
    whole: bool = False

    def has(self, columns: Sequence[str]) -> bool:
        """Return whether the table has all these columns."""
        return set(columns) <= set(self.columns)

    @functools.cached_property
    def rows(self) -> pd.DataFrame:
        """Values by node.

        Raises
        ------
        InputError
            If a row cannot be parsed, or a node is not a whole number or occurs twice. The message
            names the line.
        """
        values = numbers_of(self.lines, ["node", *self.columns])
        node = values[:, 0]
        is_odd = (node % 1 != 0) | (np.abs(node) > LARGEST_Q)
        is_odd |= ~np.isin(np.arange(len(node)), np.unique(node, return_index=True)[1])
        for i in np.flatnonzero(is_odd)[:1]:
            word = clipped(self.lines[i].words[0])
            raise self.lines[i].error(f"node {word}; expected a whole number, each node once")
        return pd.DataFrame(values[:, 1:], columns=self.columns, index=node.astype(np.int64))


@dataclass(eq=False)
class Increment:
    """Tables of one increment.

    Parameters
    ----------
    line : Line
        First line.
    ignored : str
        Reason to ignore the increment; empty to use it.
    tables : list of NodeTable
        Tables in the order of the file.
    """

    line: Line
    ignored: str = ""
    tables: list[NodeTable] = field(default_factory=list)


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
    """

    def __init__(self) -> None:
        self.increments: dict[Key, Increment] = {}
        self.increment: Increment | None = None
        self.table: NodeTable | None = None
        self.others: set[str] = set()
        self.messages: list[str] = []
        self._n_again = 0
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

    def begin(self, line: Line, key: Key, *, anew: bool = False, ignored: str = "") -> None:
        """Start or continue an increment; with `anew`, replace an increment of the same key."""
        if anew and self.increments.pop(key, None) is not None:
            self._n_again += 1
        self.table = None
        self.increment = self.increments.setdefault(key, Increment(line, ignored))

    def open(self, line: Line, nodes: str, columns: list[str]) -> NodeTable:
        """Add a table to the increment, or continue an unfinished table with the same columns."""
        if self.increment is None:
            raise line.error("a table before its increment; expected the head of an increment")
        for table in self.increment.tables:
            if (table.nodes, table.columns) == (nodes, columns) and not table.whole:
                self.table = table
                return table
        self.table = NodeTable(line, nodes, columns)
        self.increment.tables.append(self.table)
        return self.table

    def nodes_with(self, *columns: str) -> list[int]:
        """Return the nodes that have these columns in any increment."""
        tables = (table.rows.index for table in self.tables if table.has(columns))
        return sorted(set(chain(*tables)))

    def filled(self, table: NodeTable, wanted: Wanted) -> pd.DataFrame:
        """Return the rows of all wanted nodes.

        Raises
        ------
        MissingError
            If a node has no row.
        """
        rows = table.rows.reindex(pd.Index(wanted.nodes))
        if n := int(rows.isna().any(axis=1).sum()):
            names = ", ".join(wanted.columns)
            raise MissingError(f"{names} missing for {n} of {len(wanted.nodes)} nodes")
        return rows

    def states(
        self, force: Wanted, values: Wanted, path: Path, required: str
    ) -> tuple[FloatArray, FloatArray]:
        """Return the loads and the node values of all complete increments, by rising key.

        Parameters
        ----------
        force : Wanted
            Column of the force: the printed total, or else the sum over the nodes.
        values : Wanted
            Columns of the nodes' values.
        path : pathlib.Path
            File, for messages.
        required : str
            Description of the required tables, for messages.

        Returns
        -------
        load : ndarray of float, shape (n_increment,)
        values : ndarray of float, shape (n_increment, n_node, n_column)

        Raises
        ------
        InputError
            If all increments are ignored, or the forces of the nodes balance each other.
        """
        states: list[tuple[float, FloatArray]] = []
        most = net = 0.0  # largest force of one node, and the sum of forces in its increment
        ignored: dict[str, list[str]] = {}
        for _, increment in sorted(self.increments.items(), key=lambda item: item[0]):
            try:
                forces, table = _table(increment, force), _table(increment, values)
                (name,) = force.columns
                if (total := forces.below.get("TOTAL")) is not None:
                    load = total[forces.columns.index(name)]
                else:
                    parts = self.filled(forces, force)[name]
                    load = math.fsum(parts)
                    most, net = max((most, net), (parts.abs().max(), abs(load)))
                states.append((load, self.filled(table, values)[[*values.columns]].to_numpy()))
            except MissingError as lack:
                ignored.setdefault(str(lack), []).append(f"line {increment.line.number}")
        notes = [*self.messages]
        notes += [f"not used: {', '.join(sorted(self.others))}"] * bool(self.others)
        again = f"{self._n_again} increments printed again: the later one counts"
        notes += [again] * bool(self._n_again)
        notes += [
            f"{some_of(where, SHOWN)}: increment ignored, {lack}" for lack, where in ignored.items()
        ]
        if not states:
            why = "".join(f"; {text}" for text in notes[:SHOWN])
            raise InputError(f"{path}: no increment with {required}{why}")
        if net < most:
            balance = f"forces {name} sum to {net:.3g}, less than that of one node, {most:.3g}"
            raise InputError(f"{path}: {balance}; expected the driven nodes alone")
        self.messages = [f"{path}: {len(states)} increments", *notes]
        loads, at = zip(*states, strict=True)
        return np.array(loads, dtype=float), np.array(at, dtype=float)


def _table(increment: Increment, wanted: Wanted) -> NodeTable:
    """Return the only table of an increment with the columns of a node set."""
    if increment.ignored:
        raise MissingError(increment.ignored)
    name, names = wanted.of.upper(), ", ".join(wanted.columns)
    found = [
        table for table in increment.tables if table.nodes == name and table.has(wanted.columns)
    ]
    if len(found) > 1:
        raise found[1].line.error(f"{names} stands twice in an increment; expected one table")
    if not found:
        raise MissingError(f"{names}{wanted.of and f' of {wanted.of}'} missing")
    return found[0]
