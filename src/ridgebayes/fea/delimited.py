"""CSV, TSV and semicolon-separated text: fast where clean, exact about where it is not."""

import codecs
import csv
import io
import itertools
import re
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.cells import (
    FINITE,
    FORMULA,
    NUMBER,
    SHOWN,
    Cells,
    clean_headers,
    lossless,
    refusal,
)
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
        first = next(records(self._content, self.where, self._separator))
        self._header_line = first[0]
        self.headers = clean_headers(first[1], self.where)
        self._lines: IntArray | None = None
        self._plain = self._content  # what pandas gets
        data = np.frombuffer(self._content, dtype=np.uint8)
        if not is_rectangular(data, self._separator, len(self.headers)):
            self._lines, self._plain = self._checked_lines()
        self._check_formulas(data)

    def read(self, numeric: Collection[str]) -> Cells:
        """Read all rows, the columns of these headers as numbers."""
        wanted = [name for name in self.headers if name in numeric]
        frame = self._fast(wanted, ".")
        mark = "point"
        if frame is None:
            frame, mark = self._decimal_comma(wanted)
        text: dict[str, Any] = {n: lossless(frame[n]) for n in self.headers if n not in wanted}
        name = "TSV" if self._separator == "\t" else "CSV"
        dialect = f"{name}, separator {SEPARATORS[self._separator]}, decimal {mark}"
        lines = self._lines
        offset = self._header_line + 1

        def line(row: int) -> int:
            return row + offset if lines is None else int(lines[row])

        return Cells(
            self.where,
            frame.assign(**text),
            lambda row, _: f"{self.where}, line {line(row)}",
            self._typed,
            line,
            (f"{self.where}: {dialect}, {len(frame)} rows",),
        ).without_blank_rows()

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """Yield line and cells of each record below the header."""
        rows = records(self._content, self.where, self._separator)
        next(rows)
        return rows

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
            if len(cells) != width:
                n += 1
                if n <= SHOWN:
                    typed = self._separator.join(cells)
                    shown = typed if len(typed) <= 60 else f"{typed[:57]}..."
                    bad.append(
                        f"{self.where}, line {line}: {shown!r} has {len(cells)} cells: expected "
                        f"{width} cells, as the header (separator {SEPARATORS[self._separator]})"
                    )
        if n == 1:
            raise InputError(bad[0])
        if n:
            more = [f"and {n - SHOWN} more"] if n > SHOWN else []
            raise InputError(
                "\n  ".join([f"{self.where}: {n} rows of another length", *bad, *more])
            )
        text.flush()
        return np.array(lines, dtype=np.int64), again.getvalue()

    def _check_formulas(self, data: Any) -> None:
        signs = np.flatnonzero(data == ord("="))
        before = data[signs[signs > 0] - 1]
        starts = np.frombuffer(b'\r\n\t ",;', dtype=np.uint8)
        if not np.isin(before, starts).any():
            return
        bad, n = [], 0
        for line, cells in self._rows():
            for name, cell in zip(self.headers, cells, strict=True):
                if cell.lstrip().startswith("="):
                    n += 1
                    if n <= SHOWN:
                        bad.append((f"{self.where}, line {line}", name, cell, FORMULA))
        if n:
            raise refusal(self.where, bad, n)

    def _fast(self, wanted: list[str], decimal: str, *, only: bool = False) -> pd.DataFrame | None:
        """Return the rows as pandas reads them; None where a slower look is needed."""
        try:
            frame = read_delimited(
                self._plain,
                self.headers,
                wanted,
                sep=self._separator,
                usecols=wanted if only else None,
                decimal=decimal,
            )
        except (ValueError, OverflowError):
            return None
        if self._lines is not None and len(frame) != len(self._lines):
            return None
        for name in wanted:
            values = frame[name].to_numpy()
            if np.isinf(values).any():
                return None
            # pandas reads the words true and false as 1 and 0.
            if ((values == 0) | (values == 1)).any() and _has_words(self._content):
                return None
        return frame

    def _decimal_comma(self, wanted: list[str]) -> tuple[pd.DataFrame, str]:
        """Read cell by cell: with decimal commas if they are beyond doubt; else tell each cell."""
        places = [self.headers.index(name) for name in wanted]
        if self._separator != "," and (frame := self._fast(wanted, ",")) is not None:
            # No cell has a point then; it takes one whose comma cannot stand between thousands.
            cells_of_rows = ([cells[i] for i in places] for _, cells in self._rows())
            if any(map(_is_decimal_comma, itertools.chain.from_iterable(cells_of_rows))):
                return frame, "comma"
        # One column at a time shows where to look; the others are numbers with points.
        doubtful = [name for name in wanted if self._fast([name], ".", only=True) is None] or wanted
        places = [self.headers.index(name) for name in doubtful]
        first: dict[str, tuple[int, str, str]] = {}  # line, header and cell of the first of a kind
        bad, n = [], 0
        sure = False
        for line, cells in self._rows():
            for name, i in zip(doubtful, places, strict=True):
                cell = cells[i]
                if not cell.strip():
                    continue
                if NUMBER.fullmatch(cell):
                    if "." in cell:
                        first.setdefault("point", (line, name, cell))
                    if np.isfinite(float(cell)):
                        continue
                elif _COMMA.fullmatch(cell):
                    first.setdefault("comma", (line, name, cell))
                    sure = sure or _is_decimal_comma(cell)
                    if np.isfinite(float(cell.replace(",", "."))):
                        continue
                n += 1
                if n <= SHOWN:
                    bad.append((f"{self.where}, line {line}", name, cell, FINITE))
        if n:
            raise refusal(self.where, bad, n)
        if "comma" not in first:
            return self._slow(wanted), "point"
        number, name, cell = first["comma"]
        place = f"{self.where}, line {number}, column {name!r} = {cell!r}"
        if self._separator == ",":
            raise InputError(
                f"{place}: expected a point for decimals, since commas separate the cells"
            )
        for name in wanted:
            if name not in doubtful and "point" not in first:
                i = self.headers.index(name)
                found = next(((n, row[i]) for n, row in self._rows() if "." in row[i]), None)
                if found is not None:
                    first["point"] = (found[0], name, found[1])
        if "point" in first:
            number, name, cell = first["point"]
            raise InputError(
                f"{place}: but line {number}, column {name!r} = {cell!r}: expected one decimal "
                "mark "
                "in all of the file, and no thousands separators"
            )
        if not sure:
            raise InputError(
                f"{place}: may be a decimal comma or a thousands separator, and no cell tells "
                "which: expected a point for decimals"
            )
        return self._slow(wanted), "comma"

    def _slow(self, wanted: list[str]) -> pd.DataFrame:
        rows = list(self._rows())
        if self._lines is None:
            self._lines = np.array([line for line, _ in rows], dtype=np.int64)
        columns: dict[str, Any] = {}
        for place, name in enumerate(self.headers):
            cells = [row[place] for _, row in rows]
            columns[name] = _floats(cells) if name in wanted else pd.Series(cells, dtype=str)
        return pd.DataFrame(columns)

    def _typed(self, wanted: Sequence[tuple[int, str]]) -> list[str]:
        rows = {row for row, _ in wanted}
        found = {row: cells for row, (_, cells) in enumerate(self._rows()) if row in rows}
        return [found[row][self.headers.index(name)] for row, name in wanted]


def _floats(cells: list[str]) -> FloatArray:
    return np.array([float(c.replace(",", ".")) if c.strip() else np.nan for c in cells])


def _is_decimal_comma(cell: str) -> bool:
    return _COMMA.fullmatch(cell) is not None and _THOUSANDS.fullmatch(cell) is None


def _has_words(content: bytes) -> bool:
    return re.search(rb"true|false", content, re.I) is not None


def _utf8(content: bytes, where: str) -> bytes:
    """Return UTF-8 text without its mark, lines ended by LF, no blank ones at its end."""
    for mark, name in ((codecs.BOM_UTF16_LE, "UTF-16"), (codecs.BOM_UTF16_BE, "UTF-16")):
        if content.startswith(mark):
            raise InputError(f"{where}, line 1: begins as {name} text; expected UTF-8")
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
