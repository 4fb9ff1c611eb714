"""Text of cells between separators, and the numbers that are meant by them."""

import csv
import io
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.layout import (
    FINITE,
    FORMULA,
    LONGEST_HEAD,
    LOOKED_AT,
    SEPARATORS,
    as_text,
    clean_headers,
    filled,
    find_layout,
    separated,
)
from ridgebayes.fea.record import FileError, TableFile
from ridgebayes.fea.words import FORTRAN, NOTHING, NUMBER, is_unit, split_header
from ridgebayes.runtime.text import clipped, count, some_of
from ridgebayes.table.files import lossless, records

_COMMA = re.compile(r"\s*[+-]?(?:\d+,\d*|,\d+|\d+)(?:[eE][+-]?\d+)?\s*", re.A)


def _style(mark: str, thousands: str = "") -> tuple[str, str, re.Pattern[str]]:
    """Return a decimal mark, a mark between thousands, and what cells with them look like."""
    number = (NUMBER if mark == "." else _COMMA).pattern
    group, point = re.escape(thousands), re.escape(mark)
    grouped = rf"\s*[+-]?\d{{1,3}}(?:{group}\d{{3}})+(?:{point}\d*)?\s*|" if thousands else ""
    return mark, thousands, re.compile(grouped + number, re.A)


_STYLES = (
    *(_style("."), _style(",")),
    *(_style(".", thousands) for thousands in ",' \xa0\u202f"),
    *(_style(",", thousands) for thousands in ".' \xa0\u202f"),
)
_WITH_UNIT = re.compile(r"\s*[+-]?[\d.,]+(?:[eE][+-]?\d+)?\s*([^\W\d]\S*|%)\s*")
_WORDS = {".": "point", ",": "comma"}
# What Python takes for blanks, but for control characters that only damage brings into a file.
_BLANKS = "".join(c for c in map(chr, range(0x3001)) if c.isspace() and c not in "\x1c\x1d\x1e\x1f")

_UNEVEN = ('"', "#", "=", "nan")  # quotes, comments, formulas, no numbers
_IS_NEW = tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1)  # digits are exact by default
_EXACT: dict[str, Any] = {} if _IS_NEW else {"float_precision": "round_trip"}

_Row = tuple[int, list[str]]  # line, and cells
_NOTE = re.compile(r"#.*|[^\W\d].*\s.*")  # words, and not one label of a row cut off


@dataclass(frozen=True)
class Reading:
    """How a table file is to be read, where the user says more than the file.

    Parameters
    ----------
    sheet : str or None
        Worksheet by name or number; None takes the one with the words of the field.
    skip_rows : int
        Lines to pass over at the top.
    header_row : int or None
        Line of the header; 0 for none, None looks for it.
    decimal : str or None
        "point" or "comma".
    empty : tuple of str
        Texts of cells that are empty.
    count_is : str or None
        Things counted, one of `ridgebayes.fea.words.COUNTS`.
    brackets, interpolate : bool
        For increments: always intervals, even where gaps tell the load within; or always loads.
    closed_is : tuple of int
        Codes of a status that mean contact; none for 0 open, 1 closed.
    skip_empty : bool
        Whether rows without a load are left out.
    """

    sheet: str | None = None
    skip_rows: int = 0
    header_row: int | None = None
    decimal: str | None = None
    empty: tuple[str, ...] = ()
    count_is: str | None = None
    brackets: bool = False
    interpolate: bool = False
    closed_is: tuple[int, ...] = ()
    skip_empty: bool = False


def read_delimited(where: str, content: bytes, how: Reading, problems: FileError) -> "TextTable":
    """Read a text file of cells between separators.

    Parameters
    ----------
    where : str
        Its name, for messages.
    content : bytes
        All of it: UTF-8, UTF-16 with its mark, or Windows-1252, lines ended in any way.
    how : Reading
        Options that the user gives.
    problems : FileError
        As `TextTable`.

    Raises
    ------
    InputError
        If it is no text, is empty, or has an open quote.
    """
    text = as_text(content, where, problems).lstrip("\ufeff")
    lines = text.split("\n", how.skip_rows)
    text = lines[-1] if len(lines) > how.skip_rows else ""
    if not text.strip():
        raise InputError(f"{where}: the file is empty")
    text, separator = separated(text, where, problems)

    def rows(most: int | None) -> Iterator[_Row]:
        some = records(text[:most], where, separator)
        return ((line + how.skip_rows, cells) for line, cells in some)

    return TextTable(where, rows, separator, how, problems, text=text)


class TextTable(TableFile):
    """A table whose cells are text.

    Parameters
    ----------
    where : str
        Its name, for messages.
    rows : callable
        Returns lines from 1 and their cells, of that many characters at least, or all.
    separator : str
        Separator between cells.
    how : Reading
        Options that the user gives.
    problems : FileError
        Where rows of another length and formulas are noted.
    cell : callable, optional
        Returns words for a worksheet's cell in a line and a column, both from 1.
    typed : collection of str, optional
        Cells of a worksheet that are numbers, not text, and so have a point for decimals.
    text : str, optional
        Text of the rows; pandas reads it if all rows have equally many plain cells.

    Raises
    ------
    InputError
        If there is no header, or no row.
    """

    def __init__(
        self,
        where: str,
        rows: Callable[[int | None], Iterable[_Row]],
        separator: str,
        how: Reading,
        problems: FileError,
        cell: Callable[[int, int], str] | None = None,
        typed: Collection[str] = (),
        text: str = "",
    ) -> None:
        self._is_typed = frozenset(typed)
        self.where, self._separator, self._how, self._cell = where, separator, how, cell
        head = islice(rows(LONGEST_HEAD), LOOKED_AT)
        full = [(line, cells) for line, cells in head if any(one.strip() for one in cells)]
        layout = find_layout(full or [(1, [""])], where, how.header_row)
        problems.messages += layout.messages
        self.headers = clean_headers(layout.headers, where)
        if layout.first >= len(full):
            raise InputError(f"{where}: no rows below the header")
        self._body: str | None = None
        first = full[layout.first :]
        if self._read_even(text, first[0][0] - how.skip_rows):
            return
        begun = next((cells for _, cells in first if not self._is_comment(cells)), first[0][1])
        cut = zip(self.headers, map(_WITH_UNIT.fullmatch, begun), strict=False)
        units = {name: match[1] for name, match in cut if match is not None}
        new = {
            name: f"{name} [{unit}]"
            for name, unit in units.items()
            if (unit == "%" or is_unit(unit)) and not split_header(name)[1]
        }
        self._units = {new[name]: units[name] for name in new}  # that stand in the cells
        self.headers = tuple(new.get(name, name) for name in self.headers)
        below = [row for row in rows(None) if row[0] >= first[0][0]]
        below, comments = self._without_comments(below)
        below, notes = _without_notes(below)
        told = f"{where}: passed over"
        if comments:
            problems.messages.append(
                f"{told}: {count(len(comments), 'comment')} such as {comments[0]!r}"
            )
        problems.messages += [f"{told} below the rows: {note!r}" for note in notes]
        self.lines, self._typed = self._checked(below, problems)
        for name, cells in self._typed.items():
            begin = cells.str.lstrip().str.startswith("=").to_numpy(bool)
            save = "; no value is stored: open the file in Excel or LibreOffice, and save it once"
            problems.cells(begin, str(name), FORMULA + (save if cell else ""))

    def read(self, numeric: Collection[str], problems: FileError) -> pd.DataFrame:
        """Read all rows, the columns of these headers as numbers; note cells that are none."""
        wanted = [name for name in self.headers if name in numeric]
        frame, mark = self._plain(wanted), "."
        if frame is None:
            numbers, mark = self._numbers(wanted, problems)
            frame = self._typed.assign(**numbers)
        own = {n: lossless(frame[n]) for n in self.headers if n not in wanted}
        frame = frame.assign(**own)
        name = "TSV" if self._separator == "\t" else "CSV"
        thousands = f", {mark[1:]!r} between thousands" if mark[1:] else ""
        kind = "Excel" if self._cell else f"{name}, separator {SEPARATORS[self._separator]}"
        dialect = f"{kind}, decimal {_WORDS[mark[0]]}{thousands}"
        problems.messages.insert(0, f"{self.where}: {dialect}, {len(frame)} rows")
        return filled(frame, self.where, problems)

    def spot(self, row: int, name: str) -> str:
        """Return words for a cell."""
        line = int(self.lines[row])
        return self._cell(line, self.headers.index(name) + 1) if self._cell else f"line {line}"

    def typed(self, row: int, name: str) -> str:
        """Return a cell as it was typed."""
        return str(self._typed[name].iloc[row])

    @cached_property
    def _typed(self) -> pd.DataFrame:
        """All cells as they were typed, of an even text."""
        frame: pd.DataFrame = pd.read_csv(io.StringIO(self._body), dtype=str, **self._options())
        return frame

    def _options(self) -> dict[str, Any]:
        how: dict[str, Any] = {"sep": self._separator, "header": None, "names": list(self.headers)}
        return how | {"keep_default_na": False, "quoting": csv.QUOTE_NONE}

    def _read_even(self, text: str, first: int) -> bool:
        """Keep the rows for pandas, if they are cells and nothing else, as many in each."""
        body = text.split("\n", first - 1)[-1].rstrip("\n")
        small, separator = body.lower(), self._separator
        if not body or self._how.empty or any(mark in small for mark in _UNEVEN):
            return False
        code = np.frombuffer(f"{body}\n".encode(), dtype=np.uint8)
        ends, marks = (np.flatnonzero(code == ord(one)) for one in ("\n", separator))
        n_mark = np.diff(np.searchsorted(marks, ends), prepend=0)
        is_row = np.diff(ends, prepend=-1) > 1
        if (n_mark[is_row] != len(self.headers) - 1).any():
            return False
        begin, last = body.lstrip("\n").split("\n", 1)[0], body.rpartition("\n")[2]
        is_note = sum(bool(cell.strip()) for cell in last.split(separator)) < 2  # perhaps
        if is_note or any(_WITH_UNIT.fullmatch(cell) for cell in begin.split(separator)):
            return False
        self._body, self._units = body, {}
        self.lines = np.flatnonzero(is_row) + first + self._how.skip_rows
        return True

    def _plain(self, wanted: list[str]) -> pd.DataFrame | None:
        """Return an even text whose numbers are all plain ones; None of any other."""
        if self._body is None or self._how.decimal == "comma":
            return None
        text = {name: str for name in self.headers if name not in wanted}
        frame: pd.DataFrame = pd.read_csv(
            io.StringIO(self._body),
            dtype=text,
            na_values={name: [""] for name in wanted},
            low_memory=False,
            **_EXACT,
            **self._options(),
        )
        if not all(frame[name].dtype.kind in "if" for name in wanted):
            return None
        numbers = {name: frame[name].astype(float) for name in wanted}
        is_finite = not any(np.isinf(cells).any() for cells in numbers.values())
        return frame.assign(**numbers) if is_finite else None

    def _is_comment(self, cells: list[str]) -> bool:
        """Return whether a record begins with a # that is not part of a label."""
        begin = cells[0].lstrip()
        is_whole = len(cells) == len(self.headers)
        return begin.startswith("# " if is_whole else "#")

    def _without_comments(self, rows: list[_Row]) -> tuple[list[_Row], list[str]]:
        """Return the rows without comments, and those; if most rows were some, they are labels."""
        some = [cells for _, cells in rows if self._is_comment(cells)]
        n_whole = sum(len(cells) == len(self.headers) for cells in some)
        if not some or 2 * n_whole > sum(len(cells) == len(self.headers) for _, cells in rows):
            return rows, []
        comments = [self._separator.join(cells) for cells in some]
        return [row for row in rows if not self._is_comment(row[1])], comments

    def _checked(self, rows: list[_Row], problems: FileError) -> tuple[IntArray, pd.DataFrame]:
        """Return each row's line, and every cell as it was typed.

        Rows of another length are noted; empty cells beyond the header are none.
        """
        width, lines, whole, bad = len(self.headers), list[int](), list[list[str]](), list[str]()
        for line, cells in rows:
            while len(cells) > width and not cells[-1].strip():
                cells.pop()
            if len(cells) == width:
                lines.append(line)
                whole.append(cells)
                continue
            shown = clipped(self._separator.join(cells))
            bad.append(f"line {line}: {shown} has {len(cells)} cells")
        if bad:
            problems.wrong.append(
                f"{self.where}, {some_of(bad, 3)}: expected {width} cells, as the header "
                f"(separator {SEPARATORS[self._separator]})"
            )
        frame = pd.DataFrame(whole, columns=list(self.headers), dtype=str)
        return np.array(lines, dtype=np.int64), frame

    def _numbers(self, wanted: list[str], problems: FileError) -> tuple[dict[str, FloatArray], str]:
        """Read in the style of which fewest cells are no number, and note those that are none."""
        text: dict[str, pd.Series[str]] = {}
        for name in wanted:
            cells = self._typed[name].str.strip(_BLANKS)
            cells = cells.str.removesuffix(self._units.get(name, "")).str.strip(_BLANKS)
            text[name] = cells.mask(cells.isin(self._how.empty), "")
        counts: Counter[Any] = Counter()
        for cells in text.values():
            counts.update(cells[cells != ""].value_counts(sort=False).to_dict())
        some = ((cell, _exact(cell, self._is_typed)) for cell in counts)
        exact = {cell: number for cell, number in some if number is not None}
        if fortran := [cell.strip() for cell in exact if cell not in self._is_typed]:
            problems.messages.append(
                f"{count(len(fortran), 'number')} with an exponent of Fortran's, such as "
                f"{fortran[0]!r} = {exact[next(c for c in exact if c.strip() == fortran[0])]:g}"
            )
        counts = Counter({cell: n for cell, n in counts.items() if cell not in exact})

        def n_off(style: tuple[str, str, re.Pattern[str]]) -> int:
            return sum(n for cell, n in counts.items() if not style[2].fullmatch(cell))

        styles = [one for one in _STYLES if self._how.decimal in (None, _WORDS[one[0]])]
        mark, thousands, style = next((one for one in styles if not n_off(one)), None) or min(
            styles, key=n_off
        )
        doubtful = next((cell for cell in counts if "," in cell and style.fullmatch(cell)), "")
        is_sure = thousands or self._how.decimal or any(map(_is_decimal_comma, counts))
        if mark == "," and doubtful and not is_sure:
            likely = "point" if self._separator == "," else "comma"
            problems.need(
                f"cells such as {doubtful!r} may have a decimal comma or thousands, and no cell "
                "tells which: expected --decimal comma or point",
                decimal=likely,
            )
        numbers = {
            cell: float(cell.strip().replace(thousands, "").replace(mark, "."))
            if style.fullmatch(cell)
            else np.inf
            for cell in counts
        } | exact
        rule = FINITE.replace("a point", "a comma") if mark == "," else FINITE
        nothing = [cell for cell in counts if np.isinf(numbers[cell]) and NOTHING.fullmatch(cell)]
        found = {}
        for name in wanted:
            values = text[name].map(numbers).to_numpy(dtype=float)
            bad = np.isinf(values)
            is_nothing = bad & text[name].isin(nothing).to_numpy(bool)
            problems.cells(bad & ~is_nothing, name, rule)
            problems.cells(is_nothing, name, f"{rule}; --empty where such a cell is empty")
            found[name] = np.where(bad, np.nan, values)
        if nothing:
            problems.options["empty"] = "\n".join(dict.fromkeys(map(str.strip, nothing)))
        return found, mark + thousands


def _is_decimal_comma(cell: str) -> bool:
    return "," in cell and _COMMA.fullmatch(cell) is not None and not _STYLES[2][2].fullmatch(cell)


def _without_notes(rows: list[_Row]) -> tuple[list[_Row], list[str]]:
    """Return the rows without those below them that hold one text and nothing else, and those."""
    notes: list[str] = []
    for last in range(len(rows), 1, -1):
        filled = [cell.strip() for cell in rows[last - 1][1] if cell.strip()]
        if len(filled) > 1 or (filled and not _NOTE.fullmatch(filled[0])):
            return rows[:last], notes[::-1]
        notes += filled
    return rows[:1], notes[::-1]


def _exact(cell: str, typed: Collection[str]) -> float | None:
    """Return a number that no decimal mark has to be known for; None of other cells."""
    if cell in typed:
        return float(cell) if NUMBER.fullmatch(cell) else None
    match = FORTRAN.fullmatch(cell)
    return None if match is None else float(f"{match[1]}e{match[2] or match[3]}")
