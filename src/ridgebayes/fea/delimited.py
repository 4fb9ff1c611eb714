"""CSV, TSV and semicolon-separated text: fast where clean, exact about where it is not."""

import codecs
import csv
import io
import re
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.cells import (
    FINITE,
    FORMULA,
    NUMBER,
    SHOWN,
    Cells,
    clean_headers,
    lines_error,
    lossless,
)
from ridgebayes.runtime.text import clipped
from ridgebayes.table.files import is_rectangular, read_delimited, records

SEPARATORS = {"\t": "tab", ";": "';'", ",": "','"}
_SNIFFED = 50  # records by which a separator is judged
_COMMA = re.compile(r"\s*[+-]?(?:\d+,\d*|,\d+)(?:[eE][+-]?\d+)?\s*", re.A)
# What a comma between thousands may look like: such cells do not tell which comma is meant.
_THOUSANDS = re.compile(r"\s*[+-]?[1-9]\d{0,2},\d{3}\s*", re.A)


class DelimitedText:
    """A text file of cells between separators.

    Parameters
    ----------
    path : pathlib.Path
        Its name, for messages.
    content : bytes
        All of it: UTF-8, with or without a byte-order mark, lines ended in any way.

    Raises
    ------
    InputError
        If it is not UTF-8 text, is empty, has formulas, an open quote, or rows of another length
        than the header.
    """

    def __init__(self, path: Path, content: bytes) -> None:
        self.where = str(path)
        self._content = _utf8(content, self.where)
        self._separator = _separator(self._content, self.where)
        line, header = next(records(self._content, self.where, self._separator))
        self.headers = clean_headers(header, self.where)
        self._first_line = line + 1
        self._lines: IntArray | None = None  # of rows, where they are not one after another
        self._plain = self._content  # what pandas gets
        data = np.frombuffer(self._content, dtype=np.uint8)
        if not is_rectangular(data, self._separator, len(self.headers)):
            self._lines, self._plain = self._checked_lines()
        signs = np.flatnonzero(data == ord("="))
        starts = np.frombuffer(b'\r\n\t ",;', dtype=np.uint8)
        if np.isin(data[signs[signs > 0] - 1], starts).any():
            text = self._text()
            columns = {str(name): cells.str.lstrip() for name, cells in text.frame.items()}
            begin = {
                name: cells.str.startswith("=").to_numpy(bool) for name, cells in columns.items()
            }
            text.check(*((bad, name, FORMULA) for name, bad in begin.items()))

    def read(self, numeric: Collection[str]) -> Cells:
        """Read all rows, the columns of these headers as numbers."""
        wanted = [name for name in self.headers if name in numeric]
        frame, mark = self._fast(wanted, "."), "point"
        if frame is None and self._separator != ",":
            frame, mark = self._fast(wanted, ","), "comma"
            # No cell has a point then; it takes one whose comma cannot stand between thousands.
            places = [self.headers.index(name) for name in wanted]
            if not any(_is_decimal_comma(cells[i]) for _, cells in self._rows() for i in places):
                frame = None
        if frame is None:
            frame, mark = self._cell_by_cell(wanted)
        text: dict[str, Any] = {n: lossless(frame[n]) for n in self.headers if n not in wanted}
        name = "TSV" if self._separator == "\t" else "CSV"
        dialect = f"{name}, separator {SEPARATORS[self._separator]}, decimal {mark}"
        return Cells.of(self, frame.assign(**text), f"{self.where}: {dialect}, {len(frame)} rows")

    def lines(self, rows: IntArray) -> IntArray:
        """Return the file's lines of some rows."""
        return rows + self._first_line if self._lines is None else self._lines[rows]

    def place(self, row: int, name: str) -> str:
        """Return words for a cell."""
        return f"{self.where}, line {self.lines(np.array(row))}"

    def typed(self, wanted: Sequence[tuple[int, str]]) -> list[str]:
        """Return cells as they were typed."""
        rows = {row for row, _ in wanted}
        found = {row: cells for row, (_, cells) in enumerate(self._rows()) if row in rows}
        return [found[row][self.headers.index(name)] for row, name in wanted]

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """Yield line and cells of each record below the header."""
        rows = records(self._content, self.where, self._separator)
        next(rows)
        return rows

    def _text(self) -> Cells:
        """Return every cell as it was typed."""
        rows = [cells for _, cells in self._rows()]
        frame = pd.DataFrame(rows, columns=list(self.headers), dtype=str)
        return Cells(self, frame, np.arange(len(frame)), ())

    def _checked_lines(self) -> tuple[IntArray, bytes]:
        """Return each row's line, and the records written again without blank lines between.

        Raises
        ------
        InputError
            If rows are of another length than the header.
        """
        width, lines = len(self.headers), []
        # The two parsers differ where quotes and line ends are odd; as written here they do not.
        again = io.BytesIO()
        text = io.TextIOWrapper(again, encoding="utf-8", newline="")
        writer = csv.writer(text, delimiter=self._separator, lineterminator="\n")
        writer.writerow(range(width))
        bad: list[str] = []
        n = 0
        for line, cells in self._rows():
            lines.append(line)
            writer.writerow(cells)
            n += len(cells) != width
            if len(cells) != width and n <= SHOWN:
                bad.append(
                    f"{self.where}, line {line}: {clipped(self._separator.join(cells))} has "
                    f"{len(cells)} cells: expected {width} cells, as the header (separator "
                    f"{SEPARATORS[self._separator]})"
                )
        if n:
            raise lines_error(self.where, bad, n, "rows of another length")
        text.flush()
        return np.array(lines, dtype=np.int64), again.getvalue()

    def _fast(self, wanted: list[str], decimal: str) -> pd.DataFrame | None:
        """Return the rows as pandas reads them; None where a slower look is needed."""
        try:
            frame = read_delimited(
                self._plain, self.headers, wanted, sep=self._separator, decimal=decimal
            )
        except (ValueError, OverflowError):
            return None
        if self._lines is not None and len(frame) != len(self._lines):
            return None
        values = frame[wanted].to_numpy()
        # pandas reads the words true and false as 1 and 0.
        has_words = re.search(rb"true|false", self._content, re.IGNORECASE) is not None
        odd = np.isinf(values).any() or (has_words and np.isin(values, (0, 1)).any())
        return None if odd else frame

    def _cell_by_cell(self, wanted: list[str]) -> tuple[pd.DataFrame, str]:
        """Read with decimal commas if they are beyond doubt; else tell each cell."""
        text = self._text()
        typed = {name: text.frame[name].tolist() for name in wanted}
        values = {name: np.array([_number(cell) for cell in typed[name]]) for name in wanted}
        text.check(*((np.isinf(values[name]), name, FINITE) for name in wanted))

        def first(mark: str) -> str:
            """Return words for the first cell with a mark."""
            for row, cells in enumerate(zip(*typed.values(), strict=True)):
                for name, cell in zip(wanted, cells, strict=True):
                    if mark in cell:
                        return f"line {self.lines(np.array(row))}, column {name!r} = {cell!r}"
            return ""

        comma, point = first(","), first(".")
        if comma:
            place = f"{self.where}, {comma}"
            if self._separator == ",":
                raise InputError(
                    f"{place}: expected a point for decimals, since commas separate the cells"
                )
            if point:
                raise InputError(
                    f"{place}: but {point}: expected one decimal mark in all of the file, and "
                    "no thousands separators"
                )
            if not any(_is_decimal_comma(cell) for cells in typed.values() for cell in cells):
                raise InputError(
                    f"{place}: may be a decimal comma or a thousands separator, and no cell tells "
                    "which: expected a point for decimals"
                )
        return text.frame.assign(**values), "comma" if comma else "point"


def _number(cell: str) -> float:
    """Return the number of a cell: NaN of an empty one, and infinity of one that is no number."""
    if not cell.strip():
        return np.nan
    if NUMBER.fullmatch(cell) or _COMMA.fullmatch(cell):
        return float(cell.replace(",", "."))
    return np.inf


def _is_decimal_comma(cell: str) -> bool:
    return _COMMA.fullmatch(cell) is not None and _THOUSANDS.fullmatch(cell) is None


def _utf8(content: bytes, where: str) -> bytes:
    """Return UTF-8 text without its mark, lines ended by LF, no blank ones at its end."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise InputError(f"{where}, line 1: begins as UTF-16 text; expected UTF-8")
    content = content.removeprefix(codecs.BOM_UTF8)
    if b"\0" in content:
        line = content[: content.index(b"\0")].count(b"\n") + 1
        raise InputError(f"{where}, line {line}: a zero byte: not a text file, or not UTF-8")
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise InputError(
            f"{where}, line {line}: byte {content[error.start]:#04x} is not UTF-8; expected UTF-8"
        ) from None
    content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n").rstrip(b"\n")
    if not content.strip():
        raise InputError(f"{where}: the file is empty")
    return content + b"\n"


def _separator(content: bytes, where: str) -> str:
    """Return the separator that gives the first records as many cells as the header.

    Tab goes before semicolon before comma: a comma may stand within cells of the others.
    """
    fit: list[tuple[int, str]] = []
    odd: list[tuple[int, str]] = []
    failed: InputError | None = None
    for separator in SEPARATORS:
        try:
            found = records(content, where, separator)
            widths = [len(cells) for _, (_, cells) in zip(range(_SNIFFED), found, strict=False)]
        except InputError as error:
            failed = error
            continue
        if widths and widths[0] > 1:
            (fit if len(set(widths)) == 1 else odd).append((widths[0], separator))
    if fit:
        return fit[0][1]
    if odd:
        return max(odd, key=lambda one: one[0])[1]
    if failed is not None:
        raise failed
    raise InputError(
        f"{where}, line 1: one column only; expected columns separated by commas, semicolons or "
        "tabs"
    )
