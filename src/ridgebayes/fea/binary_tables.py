"""Readers for tables in binary files: Parquet, and Excel without macros, formulas and links."""

import io
import re
import warnings
import zipfile
from collections.abc import Callable, Collection, Iterable
from contextlib import closing
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes.errors import InputError
from ridgebayes.fea.cells import FINITE
from ridgebayes.fea.delimited import (
    LOOKED_AT,
    SUFFIXES,
    TextTable,
    clean_headers,
    filled,
    find_header,
    n_known,
    read_delimited,
)
from ridgebayes.fea.record import SHOWN, FileError, TableFile
from ridgebayes.runtime.reading import LARGEST_TEXT, extra, refusing
from ridgebayes.runtime.text import count, some_of
from ridgebayes.table.files import read_arrow
from ridgebayes.table.rules import as_text

MOST_CELLS = 250_000  # largest number of cells or rows of a worksheet; openpyxl takes seconds
_ROW = re.compile(rb"<(?:\w{1,50}:)?row\b[^>]{0,2000}?\sr=[\"']([^\"']*)[\"']")
_HIDDEN = re.compile(
    rb"""<(?:\w{1,50}:)?row\b(?=[^>]{0,2000}?\shidden=["'](?:1|true)["'])[^>]{0,2000}?\sr=["'](\d+)["']"""
)
_PARSED = (".xml", ".rels")
# Values that Python parses as numbers and Excel does not, like "1_000" or digits of other scripts.
_NOT_EXCEL_NUMBER = re.compile(rb"<(?:\w{1,50}:)?v\b[^>]{0,200}>[^<]*?(\d_|[&\x80-\xff])")
ALL, SHEET = "all", "Sheet"  # option value for all sheets, and the column of their names
Grids = dict[str, list[list[str]]]  # text of cells by sheet, row and column


def read_workbook(content: bytes, problems: FileError) -> TextTable:
    """Read one worksheet of an Excel workbook, or all worksheets, as a table of text.

    Parameters
    ----------
    content : bytes
        Content of the file.
    problems : FileError
        The import; collects messages, errors and questions. The fact `sheet` is a name, a number
        or "all"; None uses the sheet with the most recognised headers.

    Raises
    ------
    InputError
        If the content is not a workbook, is too large when unpacked, has a document type, or has no
        sheet of that name.
    """
    path = problems.where
    _check_archive(content, path)
    grids, typed = _grids(content, problems)
    name, rows = next(iter(grids.items()))
    if len(rows) <= problems.facts.skip_rows:
        raise InputError(f"{path}, sheet {name!r}: the file is empty")
    places: list[tuple[str, int]] = []
    if len(grids) > 1:
        rows, places = _joined(grids, problems)
        problems.facts = replace(problems.facts, header_row=None, skip_rows=0)
    else:
        problems.where = f"{path}, sheet {name!r}"
    letter = import_module("openpyxl.utils").get_column_letter

    def spot(line: int, column: int) -> str:
        sheet, at = places[line - 1] if places else ("", line)
        return f"{sheet and f'sheet {sheet!r}, '}cell {letter(column)}{at}"

    width = max(map(len, rows))
    padded = [(i, [*row, *[""] * (width - len(row))]) for i, row in enumerate(rows, start=1)]
    below = padded[problems.facts.skip_rows :]
    return TextTable(below, "Excel", problems, place=spot, typed=typed)


def _joined(grids: Grids, problems: FileError) -> tuple[list[list[str]], list[tuple[str, int]]]:
    """Join the sheets with the same header as the first; return rows with their sheet and line."""
    rows: list[list[str]] = []
    places, path, facts = list[tuple[str, int]](), problems.where, problems.facts
    names: dict[bool, list[str]] = {True: [], False: []}  # sheets that are read, and ignored
    for name, cells in grids.items():
        filled_rows = (row for row in enumerate(cells, start=1) if any(row[1]))
        full = [row for row in filled_rows if row[0] > facts.skip_rows]
        headers, n_head = find_header(full[:LOOKED_AT], FileError(f"{path}, sheet {name!r}", facts))
        if not rows:
            rows, places = [[*headers, SHEET]], [(name, full[max(n_head - 1, 0)][0])]
        names[is_read := rows[0] == [*headers, SHEET]].append(name)
        for line, row in full[n_head:] if is_read else ():
            rows.append([*row, *[""] * (len(headers) - len(row)), name])
            places.append((name, line))
    action = {True: "read one after the other", False: "ignored, with another header"}
    for is_read, sheets in names.items():
        if sheets:
            shown = ", ".join(map(repr, sheets))
            problems.messages.append(f"sheets {action[is_read]}: {shown}")
    problems.where = f"{path}, {len(names[True])} sheets"
    return rows, places


def _check_archive(content: bytes, where: str) -> None:
    """Refuse workbooks that unpack to too much data or have a document type, before parsing."""
    # zipfile raises exceptions of many types for a damaged archive.
    unreadable = refusing(f"{where}: not a readable Excel file", most=200)
    with unreadable, zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = archive.infolist()
        parsed = [member for member in members if member.filename.lower().endswith(_PARSED)]
        size = sum(member.file_size for member in parsed)
        if size > LARGEST_TEXT:
            rule = f"expected at most {LARGEST_TEXT}, save larger tables as CSV"
            raise InputError(f"{where}: {size} bytes of sheets; {rule}")
        if any("vbaproject" in member.filename.lower() for member in members):
            raise InputError(f"{where}: holds macros; expected a workbook without macros")
        for member in parsed:
            _check_xml(archive.read(member), member.filename, where)


def _check_xml(text: bytes, name: str, where: str) -> None:
    if text[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in text[:100]:
        raise InputError(f"{where}: {name} is not UTF-8; expected XML as UTF-8")
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise InputError(f"{where}: {name} has a document type; expected XML without DOCTYPE")
    if "worksheets/" in name:
        # openpyxl skips rows that are out of order.
        numbers = [int(n) if n.isdigit() else -1 for n in _ROW.findall(text)]
        if any(n < 1 for n in numbers) or any(np.diff(numbers) <= 0):
            raise InputError(f"{where}: {name}: expected numbered rows in rising order")
        if odd := _NOT_EXCEL_NUMBER.search(text):
            cell = odd.group().split(b">")[-1][:60].decode("utf-8", "replace")
            raise InputError(f"{where}: {name}: value {cell!r}: expected a number")


def _grids(content: bytes, problems: FileError) -> tuple[Grids, set[str]]:
    """Return the cells of the requested sheets, and the texts of numeric cells."""
    where, sheet = problems.where, problems.facts.sheet
    openpyxl = extra("openpyxl", "excel", f"{where}: Excel files need openpyxl")
    typed: set[str] = set()
    # openpyxl raises exceptions of many types for a damaged workbook.
    with refusing(f"{where}: not a readable Excel file", most=200), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about styles and extensions, which hold no values
        with _opened(openpyxl, content, data_only=False) as book:
            sheets = {page.title: page for page in book.worksheets}
            is_all = sheet == ALL and ALL not in sheets
            names = [name for name, page in sheets.items() if page.sheet_state == "visible"]
            if sheet is not None and not is_all:
                names = [_name_of(sheet, sheets, where)]
            elif hidden := [name for name in sheets if name not in names]:
                problems.messages.append(f"hidden sheets ignored: {', '.join(map(repr, hidden))}")
            grids = {name: _rows(sheets[name], where, typed) for name in names}
            for name, rows in grids.items():
                with sheets[name]._get_source() as xml:
                    hidden = [n.decode() for n in _HIDDEN.findall(xml.read())]
                if lines := [n for n in hidden if int(n) <= len(rows) and any(rows[int(n) - 1])]:
                    problems.messages.append(
                        f"sheet {name!r}: hidden rows are read too (a filter hides rows): row "
                        f"{some_of(lines, SHOWN)}; to leave them out, copy the visible rows to a "
                        "sheet of their own, --sheet NAME"
                    )
        if any(cell.startswith("=") for rows in grids.values() for row in rows for cell in row):
            with _opened(openpyxl, content, data_only=True) as book:
                for name, rows in grids.items():
                    _replace_formulas(rows, _rows(book[name], where, typed))
    full = {name: rows for name, rows in grids.items() if rows}
    if not full:
        raise InputError(f"{where}: no sheet with cells{f' in {names[0]!r}' if sheet else ''}")
    if is_all:
        return full, typed
    words = {name: max(map(n_known, filter(any, rows[:LOOKED_AT]))) for name, rows in full.items()}
    best = [name for name in full if words[name] == max(words.values())]
    if len(best) > 1:
        problems.need(
            f"{len(best)} sheets have cells: {', '.join(map(repr, best))}; use --sheet (--sheet "
            "all reads those with the same header)",
            sheet=best[0],
        )
    elif len(full) > 1:
        others = ", ".join(repr(name) for name in full if name != best[0])
        problems.messages.append(f"sheets ignored, fewer recognised headers: {others}")
    return {best[0]: full[best[0]]}, typed


def _opened(openpyxl: Any, content: bytes, *, data_only: bool) -> Any:
    options = {"read_only": True, "data_only": data_only, "keep_links": False}
    return closing(openpyxl.load_workbook(io.BytesIO(content), **options))


def _name_of(sheet: str, sheets: Iterable[str], where: str) -> str:
    """Return the name of the sheet that the user gives by name or number."""
    numbers = {str(n): name for n, name in enumerate(sheets, start=1)}
    if sheet not in sheets and sheet not in numbers:
        shown = ", ".join(map(repr, sheets))
        raise InputError(f"{where}: no sheet {sheet!r}; the sheets are {shown}")
    return sheet if sheet in sheets else numbers[sheet]


def _replace_formulas(rows: list[list[str]], values: list[list[str]]) -> None:
    """Replace formulas by their stored values in place, if the file has them."""
    for row, stored in zip(rows, values, strict=False):
        for i, value in enumerate(stored):
            if value and i < len(row) and row[i].startswith("="):
                row[i] = value


def _rows(sheet: Any, where: str, typed: set[str]) -> list[list[str]]:
    sheet.reset_dimensions()  # dimensions in the file may be wrong and truncate the sheet
    rows: list[list[str]] = []
    n_cell, above = 0, dict[int, str]()  # last text of each column
    for number, row in enumerate(sheet.iter_rows(), start=1):
        n_cell += len(row)
        if max(number, n_cell) > MOST_CELLS:
            rule = f"more than {MOST_CELLS} cells; save larger tables as CSV"
            raise InputError(f"{where}, sheet {sheet.title!r}: {rule}")
        rows.append([_text(cell, above.get(i, "")) for i, cell in enumerate(row)])
        for i, (cell, text) in enumerate(zip(row, rows[-1], strict=True)):
            if cell.data_type == "n" and text:
                typed.add(text)
            elif text:
                above[i] = text
    while rows and not any(rows[-1]):
        rows.pop()
    return rows


def _text(cell: Any, above: str) -> str:
    """Return the value of a cell as text on one line, with all digits of a number.

    Excel shows 0.03 in the format of per cent as 3 %, which a header with % above means.
    """
    value, kind = cell.value, cell.data_type
    if kind == "n" and value is not None and "%" in above and "%" in cell.number_format:
        value = f"{100 * value:.15g}"
    text = "" if value is None else " ".join(str(value).split())
    return f"={text.removeprefix('=')}" if kind == "f" else text


class ParquetTable(TableFile):
    """A Parquet file.

    Parameters
    ----------
    content : bytes
        Content of the file.
    problems : FileError
        The import.

    Raises
    ------
    InputError
        If pyarrow is missing or refuses the file, or the file has no rows or too many rows.
    """

    def __init__(self, content: bytes, problems: FileError) -> None:
        self.where, self.lines = problems.where, None
        self._table = read_arrow(content, self.where)
        self.headers = clean_headers(self._table.column_names, self.where)
        if not self._table.num_rows:
            raise InputError(f"{self.where}: no rows")

    def read(self, numeric: Collection[str], problems: FileError) -> pd.DataFrame:
        """Read all rows, `numeric` columns as numbers; report cells that are not finite."""
        problems.messages.append(f"{self.where}: Parquet, {count(self._table.num_rows, 'row')}")
        types: Any = import_module("pyarrow.types")
        numbers = (types.is_integer, types.is_floating, types.is_decimal, types.is_null)
        columns: dict[str, pd.Series[Any]] = {}
        for name, column in zip(self.headers, self._table.columns, strict=True):
            kind = column.type.value_type if types.is_dictionary(column.type) else column.type
            is_number = any(test(kind) for test in numbers)
            if name in numeric and not is_number:
                where = f"{self.where}, column {name!r}"
                raise InputError(f"{where}: holds {kind}: expected numbers")
            if types.is_nested(kind):
                problems.messages.append(f"column {name!r} ignored: its type is {kind}")
                continue
            with refusing(f"{self.where}, column {name!r}", most=200):
                cells = column.to_pandas()
                if name in numeric or (is_number and cells.dtype.kind not in "iu"):
                    cells = cells.astype(float)
                columns[name] = cells if is_number else as_text(cells)
        frame = pd.DataFrame(columns)
        for name in set(numeric) & columns.keys():
            problems.cells(np.isinf(frame[name].to_numpy()), name, FINITE)
            frame[name] = frame[name].replace([np.inf, -np.inf], np.nan)
        return filled(frame, problems)

    def cell(self, row: int, name: str) -> tuple[str, str]:
        """Return the place and the text of a cell."""
        column = self._table.column(self.headers.index(name))
        return f"row {row + 1}", str(column[row].as_py())


# Readers of tables by suffix.
TABLES: dict[str, Callable[[bytes, FileError], TableFile]] = {
    **dict.fromkeys(SUFFIXES, read_delimited),
    ".xlsx": read_workbook,
    ".parquet": ParquetTable,
}
