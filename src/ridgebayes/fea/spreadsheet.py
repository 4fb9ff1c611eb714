"""Excel workbooks: values only, and nothing in them is run or followed."""

import io
import re
import warnings
import zipfile
from contextlib import closing
from dataclasses import replace
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from ridgebayes.errors import InputError
from ridgebayes.fea.delimited import Reading, TextTable
from ridgebayes.fea.layout import LOOKED_AT, find_layout, known
from ridgebayes.fea.record import FileError
from ridgebayes.runtime.reading import extra, refusing

LARGEST = 2**30  # bytes of all members, unpacked
LARGEST_XML = 2**26  # bytes of the members that are parsed: more would take minutes
LARGEST_RATIO = 200  # of unpacked to packed, above a megabyte
MOST_CELLS = 250_000  # some seconds
MOST_ROWS = 2**20  # of a worksheet, by the format
_ROW = re.compile(rb"<(?:\w{1,50}:)?row\b[^>]{0,2000}?\sr=[\"']([^\"']*)[\"']")
# What Python takes for a part of a number, and Excel does not: "1_000", digits of other scripts.
_ODD = re.compile(rb"<(?:\w{1,50}:)?v\b[^>]{0,200}>[^<]*?(\d_|[&\x80-\xff])")


ALL = "all"  # sheets
Grids = dict[str, list[list[str]]]  # text of cells, by sheet and row


def read_workbook(path: Path, content: bytes, how: Reading, problems: FileError) -> TextTable:
    """Read one worksheet of an Excel workbook, as the text that its cells hold.

    Parameters
    ----------
    path : pathlib.Path
        Its name, for messages.
    content : bytes
        All of it.
    how : Reading
        Its sheet is a name or a number, or all; None takes the one with most words of the field.
    problems : FileError
        As `ridgebayes.fea.delimited.TextTable`.

    Raises
    ------
    InputError
        If it is no workbook, unpacks to too much, has a document type, or it is not clear which
        sheet is meant.
    """
    _check_archive(content, str(path))
    found, typed = _grids(content, problems, how.sheet)
    name, rows = next(iter(found.items()))
    if len(rows) <= how.skip_rows:
        raise InputError(f"{path}, sheet {name!r}: the file is empty")
    if how.sheet == ALL and len(found) > 1:
        return _joined(path, found, typed, how, problems)
    width = max(map(len, rows))
    wide = ([*row, *[""] * (width - len(row))] for row in rows)
    lines = list(islice(enumerate(wide, start=1), how.skip_rows, None))
    problems.where = f"{path}, sheet {name!r}"
    letter = import_module("openpyxl.utils").get_column_letter
    return TextTable(
        problems.where,
        lambda _: lines,
        "\t",
        how,
        problems,
        lambda line, column: f"cell {letter(column)}{line}",
        typed,
    )


def _joined(
    path: Path, found: Grids, typed: set[str], how: Reading, problems: FileError
) -> TextTable:
    """Read all sheets with the header of the first, and their names as a column."""
    rows: list[list[str]] = []
    places: list[tuple[str, int]] = []  # sheet and line of each row
    first, left_out = None, []
    for name, cells in found.items():
        full = [(i, row) for i, row in enumerate(cells, start=1) if any(row) and i > how.skip_rows]
        layout = find_layout(full[:LOOKED_AT], f"{path}, sheet {name!r}", how.header_row)
        first = first or layout
        if layout.headers != first.headers:
            left_out.append(name)
            continue
        if not rows:
            rows.append([*layout.headers, "Sheet"])
            places.append((name, full[max(layout.first - 1, 0)][0]))
        for i, row in full[layout.first :]:
            rows.append([*row, *[""] * (len(layout.headers) - len(row)), name])
            places.append((name, i))
    names = [name for name in found if name not in left_out]
    problems.messages.append(f"sheets read one after the other: {', '.join(map(repr, names))}")
    if left_out:
        told = ", ".join(map(repr, left_out))
        problems.messages.append(f"sheets ignored, with another header: {told}")
    width = max(map(len, rows))
    lines = [(i, [*row, *[""] * (width - len(row))]) for i, row in enumerate(rows, start=1)]
    problems.where = f"{path}, {len(names)} sheets"
    letter = import_module("openpyxl.utils").get_column_letter

    def cell(line: int, column: int) -> str:
        name, at = places[line - 1]
        return f"sheet {name!r}, cell {letter(column)}{at}"

    plain = replace(how, header_row=None, skip_rows=0)
    return TextTable(problems.where, lambda _: lines, "\t", plain, problems, cell, typed)


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


def _grids(content: bytes, problems: FileError, sheet: str | None) -> tuple[Grids, set[str]]:
    """Return the sheet that is asked for, or all of them, and the cells that are numbers."""
    where = problems.where
    openpyxl = extra("openpyxl", "excel", f"{where}: Excel files need openpyxl")
    options = {"read_only": True, "data_only": False, "keep_links": False}
    # openpyxl lets out exceptions of many kinds on what is no workbook.
    with refusing(f"{where}: not a readable Excel file", most=200), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of styles and extensions, which hold no values
        with closing(openpyxl.load_workbook(io.BytesIO(content), **options)) as book:
            sheets = {one.title: one for one in book.worksheets}
            sheet = None if (is_all := sheet == ALL and ALL not in sheets) else sheet
            if sheet is not None and sheet not in sheets:
                numbers = dict(zip(map(str, range(1, len(sheets) + 1)), sheets, strict=True))
                if sheet not in numbers:
                    there = ", ".join(map(repr, sheets))
                    raise InputError(f"{where}: no sheet {sheet!r}; the sheets are {there}")
                sheet = numbers[sheet]
            wanted = sheets if sheet is None else {sheet: sheets[sheet]}
            typed: set[str] = set()
            found = {name: _rows(one, where, typed) for name, one in wanted.items()}
        if any(cell.startswith("=") for rows in found.values() for row in rows for cell in row):
            found = _stored(openpyxl, content, found, typed)
    full = {name: rows for name, rows in found.items() if rows}
    if not full:
        raise InputError(f"{where}: no sheet with cells{'' if sheet is None else f' in {sheet!r}'}")
    if is_all:
        return full, typed
    tops = {name: [one for one in rows[:LOOKED_AT] if any(one)] for name, rows in full.items()}
    words = {name: max(map(known, rows)) for name, rows in tops.items()}
    best = [name for name in full if words[name] == max(words.values())]
    if len(best) > 1:
        problems.need(
            f"{len(best)} sheets have cells: {', '.join(map(repr, best))}; use --sheet (--sheet "
            "all reads those with the same header)",
            sheet=best[0],
        )
    return {best[0]: full[best[0]]}, typed


def _stored(
    openpyxl: Any, content: bytes, found: dict[str, list[list[str]]], typed: set[str]
) -> dict[str, list[list[str]]]:
    """Return cells with the values that the file stores of formulas, where it does."""
    options = {"read_only": True, "data_only": True, "keep_links": False}
    with closing(openpyxl.load_workbook(io.BytesIO(content), **options)) as book:
        values = {name: _rows(book[name], name, typed) for name in found}
    for name, rows in found.items():
        for row, stored in zip(rows, values[name], strict=False):
            for i, cell in enumerate(row):
                if cell.startswith("=") and i < len(stored) and stored[i]:
                    row[i] = stored[i]
    return found


def _rows(sheet: Any, where: str, typed: set[str]) -> list[list[str]]:
    sheet.reset_dimensions()  # what a file says of them may be wrong, and would cut rows off
    rows: list[list[str]] = []
    n_cell = 0
    for number, row in enumerate(sheet.iter_rows(), start=1):
        n_cell += len(row)
        if number > MOST_ROWS or n_cell > MOST_CELLS:
            raise InputError(
                f"{where}, sheet {sheet.title!r}: more than {MOST_CELLS} cells; save larger "
                "tables as CSV"
            )
        rows.append([_text(cell.value, cell.data_type) for cell in row])
        typed |= {
            text for cell, text in zip(row, rows[-1], strict=True) if cell.data_type == "n" and text
        }
    while rows and not any(rows[-1]):
        rows.pop()
    return rows


def _text(value: Any, kind: str) -> str:
    """Return a cell as text on one line; of a number the one that reads back as it."""
    text = "" if value is None else " ".join(str(value).split())
    return f"={text.removeprefix('=')}" if kind == "f" else text
