"""Conversion of text records to a table: header, units in cells, and numbers."""

import csv
import io
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import cached_property
from itertools import chain, islice
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.delimited import (
    LOOKED_AT,
    SEPARATORS,
    Row,
    clean_headers,
    filled,
    find_header,
    separated_text,
)
from ridgebayes.fea.record import FileError, Given, TableFile
from ridgebayes.fea.words import FORTRAN, NOTHING, NUMBER, is_unit, split_header
from ridgebayes.runtime.text import clipped, count, some_of
from ridgebayes.table.files import even_lines, lossless, records

FINITE = "expected a finite number, with a point for decimals, or an empty cell"
_WITH_ERROR = re.compile(r"\s*[\d.,eE+-]+\s*(?:±|\+/?-)\s*[\d.,eE+-]+\s*")
_TWO_NUMBERS = (
    "expected one number a cell, and its error in a column of its own, headed 'sd' or 'standard "
    "error'"
)
_MARK_NAMES = {".": "point", ",": "comma"}
_COMMA_NUMBER = re.compile(r"\s*[+-]?(?:\d+,\d*|,\d+|\d+)(?:[eE][+-]?\d+)?\s*", re.A)
_WITH_UNIT = re.compile(r"\s*[+-]?[\d.,]+(?:[eE][+-]?\d+)?\s*([^\W\d]\S*|%)\s*")
# A note has several words; a single word may be the label of a truncated row.
_NOTE = re.compile(r"#.*|[^\W\d].*\s.*")
# Whitespace without control characters, which occur in damaged files only.
_BLANKS = "".join(c for c in map(chr, range(0x3001)) if c.isspace() and c not in "\x1c\x1d\x1e\x1f")
_NOT_PLAIN = ("#", "=", "nan")  # signs of comments, formulas and missing numbers
_IS_PANDAS_3_1 = tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1)  # floats exact by default
_EXACT_FLOATS: dict[str, Any] = {} if _IS_PANDAS_3_1 else {"float_precision": "round_trip"}


def _number_style(mark: str, thousands: str = "") -> tuple[str, str, re.Pattern[str]]:
    """Return the decimal mark, the thousands separator, and the pattern of such cells."""
    number = (NUMBER if mark == "." else _COMMA_NUMBER).pattern
    group, point = re.escape(thousands), re.escape(mark)
    grouped = rf"\s*[+-]?[1-9]\d{{0,2}}(?:{group}\d{{3}})+(?:{point}\d*)?\s*|" if thousands else ""
    return mark, thousands, re.compile(grouped + number, re.A)


_STYLES = (
    *(_number_style("."), _number_style(",")),
    *(_number_style(".", thousands) for thousands in ",' \xa0\u202f"),
    *(_number_style(",", thousands) for thousands in ".' \xa0\u202f"),
)


class TextTable(TableFile):
    """A table whose cells are text.

    Parameters
    ----------
    rows : iterable of (int, list of str)
        Line number, from 1, and cells of each record.
    separator : str
        Separator between cells.
    facts : Given
        The user's options.
    problems : FileError
        Collects rows of wrong length and formulas.
    cell : callable, optional
        Function that names a worksheet's cell by line and column, both from 1.
    typed : collection of str, optional
        Texts of a worksheet's numeric cells, which have a decimal point.
    text : str, optional
        Text of the rows. pandas reads it if all rows have the same number of plain cells.

    Raises
    ------
    InputError
        If there is no header, or no row below it.
    """

    def __init__(
        self,
        rows: Iterable[Row],
        separator: str,
        facts: Given,
        problems: FileError,
        cell: Callable[[int, int], str] | None = None,
        typed: Collection[str] = (),
        text: str = "",
    ) -> None:
        self.where, self._facts, self._cell = problems.where, facts, cell
        self._separator, self._is_typed = separator, typed
        rows = iter(rows)
        head = [*islice(rows, LOOKED_AT)]
        full = [row for row in head if any(map(str.strip, row[1]))]
        headers, n_head = find_header(full or [(1, [""])], facts.header_row, problems)
        self.headers = clean_headers(headers, self.where)
        if n_head >= len(full):
            raise InputError(f"{self.where}: no rows below the header")
        first = full[n_head][0]
        self._units: dict[str, str] = {}  # unit in the cells of a column, by header
        self._body: str | None = None
        if not self._read_even(text, first - facts.skip_rows):
            below = [row for row in chain(head, rows) if row[0] >= first]
            self._read_uneven(below, full[n_head:], problems)

    def _read_even(self, text: str, first: int) -> bool:
        """Keep the text for pandas if all rows have the same number of plain cells."""
        body = text.split("\n", first - 1)[-1].rstrip("\n")
        small, separator = body.lower(), self._separator
        if not body or self._facts.empty or any(mark in small for mark in _NOT_PLAIN):
            return False
        if (lines := even_lines(body, separator, len(self.headers))) is None:
            return False
        begin, last = body.lstrip("\n").split("\n", 1)[0], body.rpartition("\n")[2]
        is_note = sum(bool(cell.strip()) for cell in last.split(separator)) < 2  # or a short row
        if is_note or any(map(_WITH_UNIT.fullmatch, begin.split(separator))):
            return False
        self._body = body
        self.lines = lines + first + self._facts.skip_rows
        return True

    def _read_uneven(self, rows: list[Row], head: Sequence[Row], problems: FileError) -> None:
        """Keep the rows as text, without comments and without notes below the rows."""
        begin = next((cells for _, cells in head if not self._is_comment(cells)), head[0][1])
        renamed = {}
        for name, match in zip(self.headers, map(_WITH_UNIT.fullmatch, begin), strict=False):
            if match and (match[1] == "%" or is_unit(match[1])) and not split_header(name)[1]:
                renamed[name] = f"{name} [{match[1]}]"
                self._units[renamed[name]] = match[1]
        self.headers = tuple(renamed.get(name, name) for name in self.headers)
        rows = self._without_notes(self._without_comments(rows, problems), problems)
        self.lines, self._typed = self._checked(rows, problems)
        for name in self.headers:
            cells = self._typed[name]
            begins = cells.str.lstrip().str.startswith("=").to_numpy(bool)
            advice = "; no value is stored: open the file in Excel or LibreOffice, and save it once"
            rule = "expected values, not formulas" + (advice if self._cell else "")
            problems.cells(begins, name, rule)

    def read(self, numeric: Collection[str], problems: FileError) -> pd.DataFrame:
        """Read all rows, `numeric` columns as numbers; report cells that are not numbers."""
        columns = [name for name in self.headers if name in numeric]
        frame, mark = self._plain(columns), "."
        if frame is None:
            numbers, mark = self._numbers(columns, problems)
            frame = self._typed.assign(**numbers)
        frame = frame.assign(**{n: lossless(frame[n]) for n in self.headers if n not in columns})
        name = "TSV" if self._separator == "\t" else "CSV"
        kind = "Excel" if self._cell else f"{name}, separator {SEPARATORS[self._separator]}"
        thousands = f", {mark[1:]!r} between thousands" if mark[1:] else ""
        dialect = f"{kind}, decimal {_MARK_NAMES[mark[0]]}{thousands}"
        problems.messages.insert(0, f"{self.where}: {dialect}, {len(frame)} rows")
        return filled(frame, problems)

    def spot(self, row: int, name: str) -> str:
        """Return the place of a cell, for messages."""
        line = int(self.lines[row])
        return self._cell(line, self.headers.index(name) + 1) if self._cell else f"line {line}"

    def typed(self, row: int, name: str) -> str:
        """Return the text of a cell."""
        return str(self._typed[name].iloc[row])

    @cached_property
    def _typed(self) -> pd.DataFrame:
        """Text of all cells, as pandas reads it."""
        return self._by_pandas(dtype=str)

    def _by_pandas(self, **options: Any) -> pd.DataFrame:
        options |= {"sep": self._separator, "header": None, "names": list(self.headers)}
        options |= {"keep_default_na": False, "quoting": csv.QUOTE_NONE, "low_memory": False}
        frame: pd.DataFrame = pd.read_csv(io.StringIO(self._body), **options)
        return frame

    def _plain(self, numeric: list[str]) -> pd.DataFrame | None:
        """Read the table with pandas; return None if a number is not plain."""
        if self._body is None or self._facts.decimal == "comma":
            return None
        text = {name: str for name in self.headers if name not in numeric}
        frame = self._by_pandas(dtype=text, na_values={n: [""] for n in numeric}, **_EXACT_FLOATS)
        if not all(frame[name].dtype.kind in "if" for name in numeric):
            return None
        frame = frame.astype(dict.fromkeys(numeric, float))
        return None if any(np.isinf(frame[name]).any() for name in numeric) else frame

    def _is_comment(self, cells: list[str]) -> bool:
        """Return whether a record is a comment: it begins with a # that is not part of a label."""
        is_whole = len(cells) == len(self.headers)
        return cells[0].lstrip().startswith("# " if is_whole else "#")

    def _without_comments(self, rows: list[Row], problems: FileError) -> list[Row]:
        """Return the rows without comments; if most full rows begin with #, keep all as labels."""
        comments = [row for row in rows if self._is_comment(row[1])]
        n_whole, n_row = (
            sum(len(cells) == len(self.headers) for _, cells in part) for part in (comments, rows)
        )
        if not comments or 2 * n_whole > n_row:
            return rows
        first = repr(self._separator.join(comments[0][1]))
        shown = f"{count(len(comments), 'comment')} such as {first}"
        problems.messages.append(f"{self.where}: passed over: {shown}")
        commented = {line for line, _ in comments}
        return [row for row in rows if row[0] not in commented]

    def _without_notes(self, rows: list[Row], problems: FileError) -> list[Row]:
        """Return the rows without the notes below them, which are lines of one text each."""
        notes: list[str] = []
        for n_row in range(len(rows), 0, -1):
            words = [cell.strip() for cell in rows[n_row - 1][1] if cell.strip()]
            if n_row == 1 or len(words) > 1 or (words and not _NOTE.fullmatch(words[0])):
                break
            notes += words
        start = f"{self.where}: passed over below the rows:"
        problems.messages += [f"{start} {note!r}" for note in reversed(notes)]
        return rows[:n_row] if rows else rows

    def _checked(self, rows: list[Row], problems: FileError) -> tuple[IntArray, pd.DataFrame]:
        """Return the line number of each row, and the text of all cells.

        Rows of wrong length are reported. Empty cells beyond the header are dropped.
        """
        width, whole, bad = len(self.headers), list[Row](), list[str]()
        for line, cells in rows:
            while len(cells) > width and not cells[-1].strip():
                cells.pop()
            if len(cells) == width:
                whole.append((line, cells))
            else:
                shown = clipped(self._separator.join(cells))
                bad.append(f"line {line}: {shown} has {len(cells)} cells")
        if bad:
            problems.wrong.append(
                f"{self.where}, {some_of(bad, 3)}: expected {width} cells, as the header "
                f"(separator {SEPARATORS[self._separator]})"
            )
        frame = pd.DataFrame([cells for _, cells in whole], columns=list(self.headers), dtype=str)
        return np.array([line for line, _ in whole], dtype=np.int64), frame

    def _numbers(self, names: list[str], problems: FileError) -> tuple[dict[str, FloatArray], str]:
        """Parse numbers in the style that fits most cells, and report the other cells."""
        text: dict[str, pd.Series[str]] = {}
        counts: Counter[Any] = Counter()
        for name in names:
            cells = self._typed[name].str.strip(_BLANKS)
            cells = cells.str.removesuffix(self._units.get(name, "")).str.strip(_BLANKS)
            text[name] = cells.mask(cells.isin(self._facts.empty), "")
            counts.update(text[name].value_counts(sort=False).to_dict())
        del counts[""]
        numbers = {cell: number for cell in counts if (number := self._exact(cell)) is not None}
        if fortran := [cell for cell in numbers if cell not in self._is_typed]:
            problems.messages.append(
                f"{count(len(fortran), 'number')} with an exponent of Fortran's, such as "
                f"{fortran[0].strip()!r} = {numbers[fortran[0]]:g}"
            )
        rest = {cell: n for cell, n in counts.items() if cell not in numbers}
        mark, thousands, style = self._style_of(rest, problems)
        digits = {cell: cell.replace(thousands, "").replace(mark, ".") for cell in rest}
        numbers |= {c: float(digits[c]) if style.fullmatch(c) else np.inf for c in rest}
        bad = [cell for cell in rest if np.isinf(numbers[cell])]
        nothing = [cell for cell in bad if NOTHING.fullmatch(cell)]
        ranges = [cell for cell in bad if _WITH_ERROR.fullmatch(cell)]
        rule = FINITE.replace("a point", "a comma") if mark == "," else FINITE
        rules = {
            f"{rule}; --empty where such a cell is empty": nothing,
            _TWO_NUMBERS: ranges,
            rule: [*{*bad} - {*nothing, *ranges}],
        }
        columns = {}
        finite = {cell: number for cell, number in numbers.items() if not np.isinf(number)}
        for name in names:
            columns[name] = text[name].map(finite).to_numpy(dtype=float)
            for broken, bad_cells in rules.items():
                problems.cells(text[name].isin(bad_cells).to_numpy(bool), name, broken)
        if nothing:
            problems.options["empty"] = "\n".join(dict.fromkeys(map(str.strip, nothing)))
        return columns, mark + thousands

    def _exact(self, cell: str) -> float | None:
        """Return the number of a cell that has the same meaning with any decimal mark, or None."""
        if cell in self._is_typed:
            return float(cell) if NUMBER.fullmatch(cell) else None
        match = FORTRAN.fullmatch(cell)
        return None if match is None else float(f"{match[1]}e{match[2] or match[3]}")

    def _style_of(
        self, counts: Mapping[str, int], problems: FileError
    ) -> tuple[str, str, re.Pattern[str]]:
        """Return the first style that fits most cells; ask the user if a comma is ambiguous."""

        def n_off(style: tuple[str, str, re.Pattern[str]]) -> int:
            return sum(n for cell, n in counts.items() if not style[2].fullmatch(cell))

        decimal = self._facts.decimal
        styles = [style for style in _STYLES if decimal in (None, _MARK_NAMES[style[0]])]
        style = next((s for s in styles if not n_off(s)), None) or min(styles, key=n_off)
        if style[0] == "," and not style[1] and not decimal:
            commas = [cell for cell in counts if "," in cell and style[2].fullmatch(cell)]
            if commas and all(map(_STYLES[2][2].fullmatch, commas)):
                problems.need(
                    f"cells such as {commas[0]!r} may have a decimal comma or thousands, and no "
                    "cell tells which: expected --decimal comma or point",
                    decimal="point" if self._separator == "," else "?",
                )
        return style


def read_delimited(content: bytes, facts: Given, problems: FileError) -> TextTable:
    """Read a delimited text file.

    Raises
    ------
    InputError
        As `separated_text` and `TextTable`, or if a quote is not closed.
    """
    text, separator = separated_text(content, facts.skip_rows, problems)
    lines = records(text, problems.where, separator)
    rows = ((line + facts.skip_rows, cells) for line, cells in lines)
    return TextTable(rows, separator, facts, problems, text=text)
