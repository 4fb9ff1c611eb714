"""Table files, and text tables: encoding, separator, header, row of units, and cells."""

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import suppress
from functools import cached_property
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes.errors import InputError
from ridgebayes.fea.cells import SEPARATORS, WITH_UNIT, body_cells, numbers_in, tabs_for_blanks
from ridgebayes.fea.record import MOST, FileError, Row, TableFile
from ridgebayes.fea.words import DISGUISES, corners_of, is_unit, key_of, split_header
from ridgebayes.runtime.reading import decoded, read_bytes
from ridgebayes.runtime.text import count, some_of
from ridgebayes.table.columns import NAMES, REQUIRED
from ridgebayes.table.files import even_lines, lossless, records

SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".rpt", ".xlsx", ".parquet")
LOOKED_AT = 60  # first records, and first cells of each, that are searched for the header
_NUMBER = re.compile(r"\s*[+-]?(?:\d[\d.,'\u2019 \u00a0\u202f]*|[.,]\d+)(?:[eE][+-]?\d+)?\s*%?\s*")
_HEADER = re.compile(r"(?!=)[^\x00-\x1f\x7f]*")
_NO_UNIT = ("", "-", "--", "\N{EN DASH}", "1", "#", "count")
_NOT_PLAIN = ("#", "=", "nan")  # signs of comments, formulas and missing numbers
# From pandas 3.1 on, floats are exact by default.
_IS_OLD = np.lib.NumpyVersion(pd.__version__) < "3.1.0"
_EXACT_FLOATS: dict[str, Any] = {"float_precision": "round_trip"} if _IS_OLD else {}


def table_content(path: Path, problems: FileError) -> bytes:
    """Return the content of a table file; refuse an unknown suffix and content of another kind."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(
            f"{path}: ends in {path.suffix or 'no suffix'!r}; expected one of {', '.join(SUFFIXES)}"
        )
    sheet = problems.facts.sheet
    if sheet is not None and suffix != ".xlsx":
        raise InputError(f"{path}: sheet {sheet!r}: expected --sheet for .xlsx files only")
    content = read_bytes(path)
    if not content:
        raise InputError(f"{path}: the file is empty")
    for beginning, what in DISGUISES.items():
        if content.startswith(bytes.fromhex(beginning)) and what != suffix:
            raise InputError(f"{path}: the content is {what}; expected a {suffix} file")
    return content


def read_delimited(content: bytes, problems: FileError) -> "TextTable":
    """Read a delimited text file.

    The content is UTF-8, UTF-16 with a byte order mark, or Windows-1252, with any line ends, and
    tabs, semicolons, bars, commas or blanks between cells.

    Raises
    ------
    InputError
        If the content is not text, is empty, has only one column, or has a quote without end.
    """
    skipped = problems.facts.skip_rows
    lines = _as_text(content, problems).lstrip("\ufeff").split("\n", skipped)
    text = lines[-1] if len(lines) > skipped else ""
    if not text.strip():
        raise problems.error("the file is empty")
    text, separator = _separated(text, problems)
    numbered = records(text, problems.where, separator)
    rows = ((line + skipped, cells) for line, cells in numbered)
    kind = f"CSV, separator {SEPARATORS[separator]}"
    return TextTable(rows, kind, problems, separator=separator, text=text)


def _as_text(content: bytes, problems: FileError) -> str:
    has_mark = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    for encoding in ("utf-16",) if has_mark else ("utf-8", "cp1252"):
        with suppress(UnicodeDecodeError):
            text = content.decode(encoding)
            if encoding != "utf-8":
                name = {"utf-16": "UTF-16", "cp1252": "Windows-1252, as it is not UTF-8"}[encoding]
                problems.messages.append(f"{problems.where}: read as {name}")
            return decoded(text.encode(), problems.where)
    return decoded(content, problems.where)


def _separated(text: str, problems: FileError) -> tuple[str, str]:
    """Return the text and the separator that splits most of the first records into equal widths.

    Tab, semicolon and bar precede comma, since a comma may be part of cells between other
    separators. In text with columns between blanks, the blanks are replaced by tabs.
    """
    best, n_record, failed = (0, ""), 0, None
    for separator in SEPARATORS:
        try:
            first = islice(records(text, problems.where, separator), LOOKED_AT)
            widths = Counter(len(cells) for _, cells in first)
        except InputError as error:
            failed = error
            continue
        n_record = widths.total()
        width, n = max(widths.items(), key=lambda item: (item[1] * (item[0] > 1), item[0]))
        if width > 1 and n > best[0]:
            best = n, separator
    if 2 * best[0] <= n_record and (blank := tabs_for_blanks(text, problems, LOOKED_AT)):
        return blank, "\t"
    if not best[1]:
        rule = "expected columns separated by commas, semicolons, bars or tabs"
        raise failed or problems.error(f"line 1: one column only; {rule}")
    return text, best[1]


def find_header(rows: Sequence[Row], problems: FileError) -> tuple[list[str], int]:
    """Find the header among the first records of a file.

    Parameters
    ----------
    rows : sequence of (int, list of str)
        Line and cells of each record.

    Returns
    -------
    headers : list of str
        Header of each column, with its unit if a row of units follows.
    n_head : int
        Number of records above the first row.

    Raises
    ------
    InputError
        If `header_row` has no record, or rows stand above the header.

    Examples
    --------
    >>> rows = [(1, ["Test 7"]), (3, ["Steg", "Q"]), (4, ["mm", ""]), (5, ["0,2", "4"])]
    >>> find_header(rows, FileError("mine.csv"))
    (['Steg [mm]', 'Q'], 3)
    """
    header_row, lines = problems.facts.header_row, [line for line, _ in rows]
    if header_row and header_row not in lines:
        raise problems.error(f"--header-row {header_row}: expected a line with cells near the top")
    i = lines.index(header_row) if header_row else None if header_row == 0 else _guess_header(rows)
    if i is None:
        n_title = next((n for n, (_, cells) in enumerate(rows) if any(map(_is_number, cells))), 0)
        headers = [f"column {n}" for n in range(1, len(rows[n_title][1]) + 1)]
        names = f"rows from line {lines[n_title]} on, columns {headers[0]!r} to {headers[-1]!r}"
        problems.messages.append(f"{problems.where}: no header; {names}")
        return headers, n_title
    headers = [*rows[i][1]]
    headers[0] = re.sub(r"^\s*(?:#|%|//)\s*", "", headers[0])
    if header_row is None:
        _refuse_rows(rows[:i], headers, lines[i], problems.where)
    if i:
        shown = f"header in line {lines[i]}, {count(i, 'title line')} above it"
        problems.messages.append(f"{problems.where}: {shown}")
    below = rows[i + 1][1] if i + 1 < len(rows) else []
    units = [cell.strip().removeprefix("#").strip().strip("[]()") for cell in below]
    texts = [unit for unit in units if unit not in _NO_UNIT]
    n_unit = sum(unit == "%" or is_unit(unit) for unit in texts)
    # Half of the units may be those of other quantities, such as s or °C.
    if not 0 < len(texts) <= 2 * n_unit or any(map(_is_number, texts)):
        return headers, i + 1
    problems.messages.append(f"{problems.where}: units in line {lines[i + 1]}")
    for j, unit in enumerate(units[: len(headers)]):
        if unit not in _NO_UNIT and not split_header(headers[j])[1]:
            headers[j] = f"{headers[j]} [{unit}]"
    return headers, i + 2


def clean_headers(names: Sequence[object], where: str) -> tuple[str, ...]:
    r"""Return unique headers on one line; an empty or duplicate header gets its column's number.

    Raises
    ------
    InputError
        If a header is a formula or has control characters, if all headers are empty, or if there
        are more than 2000 columns.

    Examples
    --------
    >>> clean_headers(["Ridge  width\n[mm]", None, "Q", "Q"], "mine.csv")
    ('Ridge width [mm]', '(column 2)', 'Q', 'Q #4')
    """
    texts = ["" if name is None else " ".join(str(name).split()) for name in names]
    if len(texts) > MOST or not any(texts):
        rule = f"at most {MOST}" if any(texts) else "a header for each column"
        raise InputError(f"{where}: {len(texts)} columns: expected {rule}")
    headers: list[str] = []
    for i, text in enumerate(texts, start=1):
        if not _HEADER.fullmatch(text):
            rule = "expected text, without formulas and control characters"
            raise InputError(f"{where}, header, column {i} = {text[:60]!r}: {rule}")
        if text in headers:
            words, unit = split_header(text)
            text = f"{words} #{i}" + (f" [{unit}]" if unit else "")
        headers.append(text or f"(column {i})")
    return tuple(headers)


def filled(frame: pd.DataFrame, problems: FileError) -> pd.DataFrame:
    """Return a table without empty rows and without empty columns that have no header.

    The index of the result is the row in the file, from 0.

    Raises
    ------
    InputError
        If all rows are empty, and no cell was reported.
    """
    empty = frame.isna() | (frame == "")
    is_unnamed = [f"(column {i})" == name for i, name in enumerate(frame, start=1)]
    is_used = ~(np.array(is_unnamed) & empty.all().to_numpy())
    blank = empty.all(axis=1)
    if blank.all():
        if not problems:
            raise problems.error("no rows below the header")
        blank = ~blank  # the cells were reported as invalid numbers
    if n := int(blank.sum()):
        problems.messages.append(f"{count(n, 'empty row')} ignored")
    return frame.loc[~blank, is_used]


def n_known(cells: Sequence[str]) -> int:
    """Return the number of cells that are recognised headers."""
    words = [split_header(cell.strip())[0] for cell in cells[:LOOKED_AT] if not _is_number(cell)]
    keys = {text if text in NAMES else key_of(text) for text in words} - {""}
    return len(keys) + len(corners_of(words))


def _is_number(cell: str) -> bool:
    return _NUMBER.fullmatch(cell) is not None


def _guess_header(rows: Sequence[Row]) -> int | None:
    """Return the index of the likeliest header: most recognised words above columns of numbers."""
    if set(REQUIRED) <= set(rows[0][1]):  # a contract table: avoids the slow import of units
        return 0
    full = [[j for j, cell in enumerate(cells) if cell.strip()] for _, cells in rows]
    width = max(map(len, full))
    best, place = 0, None
    for i, (_, cells) in enumerate(rows):
        if 2 * len(full[i]) < width or len(full[i]) < 2 < width:
            continue
        over = 0
        for j in full[i]:
            below = [row[j] for _, row in rows[i + 1 :] if j < len(row) and row[j].strip()]
            is_over = 2 * sum(map(_is_number, below)) >= len(below) > 0
            over += is_over and not _is_number(cells[j])
        score = over + 2 * n_known(cells) if over else 0
        if score > best:
            best, place = score, i
    first = list(map(len, full)).index(width)
    is_header = place is None and not any(map(_is_number, rows[first][1]))
    return first if is_header else place


def _refuse_rows(above: Sequence[Row], headers: Sequence[str], line: int, where: str) -> None:
    """Refuse rows of numbers above the header, which would be ignored as title lines."""
    least = max(2, sum(bool(name.strip()) for name in headers) / 2)
    lines = [str(at) for at, cells in above if sum(map(_is_number, cells)) >= least]
    if lines:
        text = f"numbers above the header in line {line}, in line {some_of(lines, 3)}: expected "
        text += f"rows below it; --header-row {line} passes over them"
        raise FileError(where, needs=[text], options={"header_row": str(line)})


class TextTable(TableFile):
    """A table whose cells are text.

    Parameters
    ----------
    rows : iterable of (int, list of str)
        Line number, from 1, and cells of each record.
    kind : str
        Format of the file, for messages.
    problems : FileError
        Collects messages, rows of wrong length, and formulas.
    place : callable, optional
        Function that names a cell by line and column, both from 1.
    typed : collection of str, optional
        Texts of a worksheet's numeric cells, which have a decimal point.
    separator, text : str, optional
        Text of the rows, and the separator between its cells. pandas reads it if all rows have the
        same number of plain cells.

    Raises
    ------
    InputError
        If there is no header, or no row below it.
    """

    def __init__(
        self,
        rows: Iterable[Row],
        kind: str,
        problems: FileError,
        *,
        place: Callable[[int, int], str] = lambda line, column: f"line {line}",
        typed: Collection[str] = (),
        separator: str = "\t",
        text: str = "",
    ) -> None:
        self.where, self._kind, self._facts = problems.where, kind, problems.facts
        self._place, self._is_typed, self._separator = place, typed, separator
        head = [*islice(rows := iter(rows), LOOKED_AT)]
        full = [row for row in head if any(map(str.strip, row[1]))]
        headers, n_head = find_header(full or [(1, [""])], problems)
        self.headers = clean_headers(headers, self.where)
        if n_head >= len(full):
            raise problems.error("no rows below the header")
        first = full[n_head][0]
        self._units: dict[str, tuple[str, bool]] = {}  # units in the cells of columns, by header
        self._body = self._even_body(text, first - self._facts.skip_rows)
        if not self._body:
            titles = [cells for _, cells in full[:n_head]]
            records_below = [row for row in chain(head, rows) if row[0] >= first]
            below = [row for row in records_below if row[1] not in titles]
            if n_again := len(records_below) - len(below):  # as in files that were joined
                said = f"{count(n_again, 'row')} with the header again"
                problems.messages.append(f"{self.where}: passed over: {said}")
            self._units, self.lines, self._typed = body_cells(
                below, self.headers, separator, problems
            )
            self.headers = tuple(map(str, self._typed))
            advice = "; no value is stored: open the file in Excel or LibreOffice, and save it once"
            rule = f"expected values, not formulas{advice if kind == 'Excel' else ''}"
            for name, cells in self._typed.items():
                is_formula = cells.str.lstrip().str.startswith("=").to_numpy(bool)
                problems.cells(is_formula, str(name), rule)

    def _even_body(self, text: str, first: int) -> str:
        """Return the text of the rows if all have the same number of plain cells; empty if not."""
        *titles, body = text.split("\n", first - 1)
        body, separator = body.rstrip("\n"), self._separator
        small = body.lower()
        if not body or self._facts.empty or any(mark in small for mark in _NOT_PLAIN):
            return ""
        if any(title.strip() and title in body for title in titles):
            return ""
        lines = even_lines(body, separator, len(self.headers))
        begin, last = body.lstrip("\n").partition("\n")[0], body.rpartition("\n")[2]
        is_note = sum(bool(cell.strip()) for cell in last.split(separator)) < 2  # or a short row
        if lines is None or is_note or any(map(WITH_UNIT.fullmatch, begin.split(separator))):
            return ""
        self.lines = lines + first + self._facts.skip_rows
        return body

    def read(self, numeric: Collection[str], problems: FileError) -> pd.DataFrame:
        """Read all rows, `numeric` columns as numbers; report cells that are not numbers."""
        columns = [name for name in self.headers if name in numeric]
        frame, style = self._plain(columns), "decimal point"
        if frame is None:
            cells, mark = self._typed[columns], self._separator
            numbers, style = numbers_in(cells, self._units, self._is_typed, problems, mark)
            frame = self._typed.assign(**numbers)
        frame = frame.assign(**{n: lossless(frame[n]) for n in self.headers if n not in columns})
        size = count(len(frame), "row")
        problems.messages.insert(0, f"{self.where}: {self._kind}, {style}, {size}")
        return filled(frame, problems)

    def cell(self, row: int, name: str) -> tuple[str, str]:
        """Return the place and the text of a cell."""
        place = self._place(int(self.lines[row]), self.headers.index(name) + 1)
        return place, str(self._typed[name].iloc[row])

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
        if not self._body or self._facts.decimal == "comma":
            return None
        text = {name: str for name in self.headers if name not in numeric}
        frame = self._by_pandas(dtype=text, na_values={n: [""] for n in numeric}, **_EXACT_FLOATS)
        if not all(frame[name].dtype.kind in "if" for name in numeric):
            return None
        frame = frame.astype(dict.fromkeys(numeric, float))
        values = frame[numeric].to_numpy()
        # Points may separate thousands beside semicolons, unless a number is such as 0.25.
        is_clear = self._separator != ";" or (np.abs(values[values % 1 > 0]) < 1).any()
        return frame if is_clear and not np.isinf(values).any() else None
