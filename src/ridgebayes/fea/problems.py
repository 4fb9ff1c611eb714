"""What is wrong with a file and what it does not say: gathered, and told at once."""

import heapq
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.text import clipped

SHOWN = 3  # cells of one complaint that a message lists; the rest is counted
_MOST = 20  # complaints


class Source(Protocol):
    """A table file whose header is known; rows are counted from 0 below it."""

    where: str
    headers: tuple[str, ...]
    settings: Mapping[str, tuple[str, int]]  # constants of title lines, each with its line

    def lines(self, rows: IntArray) -> IntArray | None:
        """Return the file's lines of some rows; None where it has no lines."""
        return None

    def spot(self, row: int, name: str) -> str:
        """Return words for a cell, such as ``line 4``."""

    def typed(self, wanted: Sequence[tuple[int, str]]) -> list[str]:
        """Return cells, each of a row and a header, as they were typed."""


@dataclass(eq=False, repr=False)
class FileError(InputError):
    """A file that cannot be imported as it was asked for.

    Parameters
    ----------
    where : str
        The file, for messages.
    wrong, needs : list of str
        What breaks rules, and what the user has to say.
    options : dict of str to str
        Options that a second try needs, by name; ``?`` stands for what only the user knows.
    mapping : dict of str to str
        The same of ``--map``.
    known : dict of str to str
        What has been recognised, as ``--map`` would say it.
    is_broken : bool
        Whether cells break rules that no option changes.
    """

    where: str
    wrong: list[str] = field(default_factory=list)
    needs: list[str] = field(default_factory=list)
    options: dict[str, str] = field(default_factory=dict)
    mapping: dict[str, str] = field(default_factory=dict)
    known: dict[str, str] = field(default_factory=dict)
    is_broken: bool = False

    def __str__(self) -> str:
        lines = [*self.wrong, *self.needs]
        if len(lines) == 1:
            return lines[0] if lines[0].startswith(self.where) else f"{self.where}: {lines[0]}"
        counts = ((len(self.wrong), "rules broken"), (len(self.needs), "values missing or unclear"))
        head = " and ".join(f"{n} {what}" for n, what in counts if n)
        more = [f"and {len(lines) - _MOST} more"] if len(lines) > _MOST else []
        return "\n  ".join([f"{self.where}: {head}", *lines[:_MOST], *more])

    def joined(self, later: "FileError") -> "FileError":
        """Return both errors as one: of a first reading, and of one with its needs supplied."""
        wrong: dict[str, str] = {}  # by all but values, which depend on the units supplied
        # With widths and empty cells supplied as a guess, what follows from them is no rule broken.
        told = [] if "texture" in self.options else later.wrong
        if "empty" in self.options:
            told = [text for text in told if "expected not empty" not in text]
        for text in (*self.wrong, *told):
            wrong.setdefault(re.sub(r" = [^:,]+", "", text), text)
        return FileError(
            later.where,
            list(wrong.values()),
            list(dict.fromkeys([*self.needs, *later.needs])),
            {**later.options, **self.options},
            {**self.mapping, **later.mapping},
            {**self.known, **later.known},
            self.is_broken or later.is_broken,
        )


class Problems:
    """What was understood so far, and what is wrong: needs the user can supply, the rest is so."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.messages: list[str] = []
        self.texts: list[str] = []
        self.needs: list[str] = []
        self.options: dict[str, str] = {}
        self.mapping: dict[str, str] = {}
        self.known: dict[str, str] = {}
        self.columns = ""
        self._cells: dict[tuple[str, str], list[int]] = {}
        self._told: set[tuple[int, str]] = set()

    def __bool__(self) -> bool:
        return bool(self.texts or self.needs or self._cells)

    def need(self, text: str, mapping: dict[str, str] | None = None, /, **options: str) -> None:
        """Note what the user has to say, with the options that would say it."""
        if text not in self.needs:
            self.needs.append(text)
        self.mapping |= {k: v for k, v in (mapping or {}).items() if k not in self.mapping}
        self.options |= {k: v for k, v in options.items() if k not in self.options}

    def cells(self, bad: "BoolArray | IntArray | pd.Index[int]", header: str, rule: str) -> None:
        """Note cells by a mask over the file's rows or by their rows; each cell is told once."""
        rows = np.flatnonzero(bad) if bad.dtype == bool else bad
        fresh = [row for row in rows.tolist() if (row, header) not in self._told]
        if fresh:
            self._told |= {(row, header) for row in fresh}
            self._cells.setdefault((header, rule), []).extend(fresh)

    def rows(self) -> IntArray:
        """Return the file's rows of which a cell was told of."""
        return np.unique(np.array([row for row, _ in self._told], dtype=np.int64))

    def shown(self, source: Source) -> list[str]:
        """Return a line for each complaint, in the order of the file."""
        found = []
        for (header, rule), rows in self._cells.items():
            first = heapq.nsmallest(SHOWN, rows)
            cells = source.typed([(row, header) for row in first])
            spots = [
                f"{source.spot(row, header)} = {clipped(cell)}"
                for row, cell in zip(first, cells, strict=True)
            ]
            if len(rows) == 1:
                spot, cell = spots[0].split(" = ", 1)
                text = f"{source.where}, {spot}, column {header!r} = {cell}: {rule}"
            else:
                more = f" and {len(rows) - SHOWN} more" if len(rows) > SHOWN else ""
                text = f"column {header!r}, {len(rows)} cells: {rule}: {', '.join(spots)}{more}"
            found.append((first[0], text))
        return [text for _, text in sorted(found, key=lambda one: one[0])]

    def raise_all(self, source: Source | None = None) -> None:
        """Raise what was noted, if anything was."""
        wrong = [*self.texts, *(self.shown(source) if source is not None else ())]
        needs = [*self.needs, *([f"the columns are {self.columns}"] if self.columns else ())]
        if not wrong and not needs:
            return
        # What --empty could mend is not broken.
        is_broken = bool(self.texts) or any("--empty" not in rule for _, rule in self._cells)
        raise FileError(self.where, wrong, needs, self.options, self.mapping, self.known, is_broken)
