"""Excel workbooks: values only, and nothing in them is run or followed."""

import io
import re
import warnings
import zipfile
from collections.abc import Collection, Sequence
from contextlib import closing
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.cells import FINITE, FORMULA, NUMBER, SHOWN, Cells, cells_error, clean_headers
from ridgebayes.fea.record import refusing

LARGEST = 2**30  # bytes of all members, unpacked
LARGEST_XML = 2**26  # bytes of the members that are parsed: more would take minutes
LARGEST_RATIO = 200  # of unpacked to packed, above a megabyte
MOST_CELLS = 250_000  # some seconds
MOST_ROWS = 2**20  # of a worksheet, by the format
_ROW = re.compile(rb"<(?:\w{1,50}:)?row\b[^>]{0,2000}?\sr=[\"']([^\"']*)[\"']")
# What Python takes for a part of a number, and Excel does not: "1_000", digits of other scripts.
_ODD = re.compile(rb"<(?:\w{1,50}:)?v\b[^>]{0,200}>[^<]*?(\d_|[&\x80-\xff])")

_Cell = tuple[Any, str]  # value and openpyxl's data type


class Spreadsheet:
    """One worksheet of an Excel workbook.

    Parameters
    ----------
    path : pathlib.Path
        Its name, for messages.
    content : bytes
        All of it.
    sheet : str or None
        Which worksheet; None takes the only one that is not empty.

    Raises
    ------
    InputError
        If it is no workbook, unpacks to too much, has a document type, formulas or error values,
        or it is not clear which sheet is meant.
    """

    def __init__(self, path: Path, content: bytes, sheet: str | None) -> None:
        _check_archive(content, str(path))
        self._sheet, self._first, rows = _grid(content, str(path), sheet)
        self.where = f"{path}, sheet {self._sheet!r}"
        width = max(
            (i + 1 for row in rows for i, (value, _) in enumerate(row) if _is_full(value)),
            default=0,
        )
        rows = [[*row[:width], *[(None, "n")] * (width - len(row))] for row in rows]
        self._rows = rows[1:]
        self.headers = clean_headers([value for value, _ in rows[0]], self.where)
        if not self._rows:
            raise InputError(f"{self.where}: no rows below the header")
        self._check(lambda value, kind: kind == "f" or _is_formula(value), self.headers, FORMULA)
        self._check(lambda _, kind: kind == "e", self.headers, "expected no error values")

    def read(self, numeric: Collection[str]) -> Cells:
        """Read all rows, the columns of these headers as numbers."""
        wanted = [name for name in self.headers if name in numeric]
        self._check(lambda value, kind: not _is_number(value, kind), wanted, FINITE)
        columns: dict[str, Any] = {}
        for i, name in enumerate(self.headers):
            cells = [row[i][0] if _is_full(row[i][0]) else None for row in self._rows]
            if name in wanted or all(type(cell) in (int, float) for cell in cells):
                columns[name] = np.array([np.nan if c is None else float(c) for c in cells])
            else:
                columns[name] = pd.Series(["" if c is None else c for c in cells])
        message = f"{self.where}: Excel, {len(self._rows)} rows"
        return Cells.of(self, pd.DataFrame(columns), message)

    def lines(self, rows: IntArray) -> IntArray:
        """Return the worksheet's rows."""
        return rows + self._first + 1

    def place(self, row: int, name: str) -> str:
        """Return words for a cell."""
        column = import_module("openpyxl.utils").get_column_letter(self.headers.index(name) + 1)
        return f"{self.where}, cell {column}{self._first + 1 + row}"

    def typed(self, wanted: Sequence[tuple[int, str]]) -> list[str]:
        """Return cells as text."""
        cells = [self._rows[row][self.headers.index(name)][0] for row, name in wanted]
        return ["" if cell is None else str(cell) for cell in cells]

    def _check(self, is_bad: Any, names: Sequence[str], rule: str) -> None:
        at = {name: self.headers.index(name) for name in names}
        cells = [(row, name, one[at[name]]) for row, one in enumerate(self._rows) for name in at]
        bad = [(row, name, rule) for row, name, cell in cells if is_bad(*cell)]
        if bad:
            raise cells_error(self, bad[:SHOWN], len(bad))


def _is_full(value: Any) -> bool:
    return value is not None and not (isinstance(value, str) and not value.strip())


def _is_formula(value: Any) -> bool:
    return isinstance(value, str) and value.lstrip().startswith("=")


def _is_number(value: Any, kind: str) -> bool:
    if not _is_full(value):
        return True
    odd_text = isinstance(value, str) and not NUMBER.fullmatch(value)
    if kind == "d" or isinstance(value, bool) or odd_text:
        return False
    try:
        return bool(np.isfinite(float(value)))
    except (TypeError, ValueError, OverflowError):
        return False


def _check_archive(content: bytes, where: str) -> None:
    """Refuse what would unpack to too much, and XML with a document type: before any parser."""
    # zipfile lets out exceptions of many kinds on what is no archive.
    unreadable = refusing(f"{where}: not a readable Excel file", most=200)
    with unreadable, zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = archive.infolist()
        parsed = [one for one in members if one.filename.lower().endswith((".xml", ".rels"))]
        total, size = (sum(one.file_size for one in some) for some in (members, parsed))
        most = max(10**6, LARGEST_RATIO * len(content))
        macros = any("vbaproject" in one.filename.lower() for one in members)
        rules = {
            f"unpacks to {total} bytes; expected at most {LARGEST}": total <= LARGEST,
            f"unpacks to {total} bytes from {len(content)}; expected at most {LARGEST_RATIO} times "
            "its size": total <= most,
            f"{size} bytes of sheets; expected at most {LARGEST_XML}, save larger tables as CSV": (
                size <= LARGEST_XML
            ),
            "holds macros; expected a workbook without macros": not macros,
        }
        for rule, holds in rules.items():
            if not holds:
                raise InputError(f"{where}: {rule}")
        for one in parsed:
            _check_xml(archive.read(one), one.filename, where)


def _check_xml(text: bytes, name: str, where: str) -> None:
    if text[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in text[:100]:
        raise InputError(f"{where}: {name} is not UTF-8; expected XML as UTF-8")
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise InputError(f"{where}: {name} has a document type; expected XML without DOCTYPE")
    if "worksheets/" in name:
        # The reader passes over rows that are out of order.
        numbers = [int(n) if n.isdigit() else -1 for n in _ROW.findall(text)]
        if any(n < 1 for n in numbers) or any(np.diff(numbers) <= 0):
            raise InputError(f"{where}: {name}: expected numbered rows in rising order")
        if odd := _ODD.search(text):
            cell = odd.group().split(b">")[-1][:60].decode("utf-8", "replace")
            raise InputError(f"{where}: {name}: value {cell!r}: expected a number")


def _grid(content: bytes, where: str, sheet: str | None) -> tuple[str, int, list[list[_Cell]]]:
    """Return the sheet's name, the number of its first row with a value, and rows from there."""
    try:
        openpyxl: Any = import_module("openpyxl")  # an extra, and slow to load
    except ImportError:
        raise InputError(
            f"{where}: Excel files need openpyxl: pip install 'ridgebayes[excel]'"
        ) from None
    options = {"read_only": True, "data_only": False, "keep_links": False}
    # openpyxl lets out exceptions of many kinds on what is no workbook.
    with refusing(f"{where}: not a readable Excel file", most=200), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of styles and extensions, which hold no values
        with closing(openpyxl.load_workbook(io.BytesIO(content), **options)) as book:
            sheets = {one.title: one for one in book.worksheets}
            if sheet is not None and sheet not in sheets:
                there = ", ".join(map(repr, sheets))
                raise InputError(f"{where}: no sheet {sheet!r}; the sheets are {there}")
            wanted = sheets if sheet is None else {sheet: sheets[sheet]}
            found = {name: _rows(one, where) for name, one in wanted.items()}
    full = [name for name, (_, rows) in found.items() if rows]
    if not full:
        raise InputError(f"{where}: no sheet with cells{'' if sheet is None else f' in {sheet!r}'}")
    if len(full) > 1:
        raise InputError(
            f"{where}: {len(full)} sheets have cells: {', '.join(map(repr, full))}; use --sheet"
        )
    return full[0], *found[full[0]]


def _rows(sheet: Any, where: str) -> tuple[int, list[list[_Cell]]]:
    sheet.reset_dimensions()  # what a file says of them may be wrong, and would cut rows off
    rows: list[list[_Cell]] = []
    first = n_cell = 0
    for number, row in enumerate(sheet.iter_rows(), start=1):
        n_cell += len(row)
        if number > MOST_ROWS or n_cell > MOST_CELLS:
            raise InputError(
                f"{where}, sheet {sheet.title!r}: more than {MOST_CELLS} cells; save larger "
                "tables as CSV"
            )
        if not first and not any(_is_full(cell.value) for cell in row):
            continue
        first = first or number
        rows.append([(_text(cell.value), cell.data_type) for cell in row])
    while rows and not any(_is_full(value) for value, _ in rows[-1]):
        rows.pop()
    return first, rows


def _text(value: Any) -> Any:
    """Return formulas of several cells, which are objects, as text."""
    return value if value is None or isinstance(value, str | int | float) else str(value)
