"""Text of cells between separators: fast where clean, exact about where it is not."""

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.cells import FINITE, FORMULA, NUMBER, Cells, Source, clean_headers, lossless
from ridgebayes.fea.column_units import is_unit, split_header
from ridgebayes.fea.layout import LOOKED_AT, find_layout
from ridgebayes.fea.problems import Problems
from ridgebayes.runtime.text import clipped
from ridgebayes.table.files import is_rectangular, read_delimited, records

SEPARATORS = {"\t": "tab", ";": "';'", "|": "'|'", ",": "','"}
_COMMA = re.compile(r"\s*[+-]?(?:\d+,\d*|,\d+|\d+)(?:[eE][+-]?\d+)?\s*", re.A)
# How numbers are written: decimal mark, mark between thousands, and what cells look like.
_GROUPED = r"\s*[+-]?\d{{1,3}}(?:{0}\d{{3}})+(?:{1}\d*)?\s*|"
_STYLES = (
    (".", "", NUMBER),
    (",", "", _COMMA),
    *(
        (
            mark,
            sep,
            re.compile(_GROUPED.format(re.escape(sep), re.escape(mark)) + own.pattern, re.A),
        )
        for mark, seps, own in ((".", ",' \xa0\u202f", NUMBER), (",", ".' \xa0\u202f", _COMMA))
        for sep in seps
    ),
)
_WITH_UNIT = re.compile(r"\s*[+-]?[\d.,]+(?:[eE][+-]?\d+)?\s*([^\W\d]\S*)\s*")
_WORDS = {".": "point", ",": "comma"}
# What people write where there is no number.
_NOTHING = re.compile(
    r"\s*(?:-+|[\u2013\u2014?x.]|n\.?/?a\.?|nan|none|null|#n/?a|k\.?a\.?"
    r"|not reached|nicht erreicht)\s*",
    re.I,
)

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
        What counts are of, one of `ridgebayes.fea.words.COUNTS`.
    brackets, interpolate : bool
        For increments: always intervals, or always loads within them.
    """

    sheet: str | None = None
    skip_rows: int = 0
    header_row: int | None = None
    decimal: str | None = None
    empty: tuple[str, ...] = ()
    count_is: str | None = None
    brackets: bool = False
    interpolate: bool = False


class DelimitedText(Source):
    """A text file of cells between separators.

    Parameters
    ----------
    where : str
        Its name, for messages.
    content : bytes
        All of it: UTF-8, UTF-16 with its mark, or Windows-1252, lines ended in any way.
    how : Reading
        What the user says.
    problems : Problems
        Where rows of another length and formulas are noted.
    cell : callable, optional
        Of a worksheet: words for the cell of a line and a column, both from 1.

    Raises
    ------
    InputError
        If it is no text, is empty, or has an open quote.
    """

    def __init__(
        self,
        where: str,
        content: bytes,
        how: Reading,
        problems: Problems,
        cell: Callable[[int, int], str] | None = None,
    ) -> None:
        self.where, self._how, self._cell = where, how, cell
        content, self._messages = as_utf8(content, where)
        lines = content.split(b"\n", how.skip_rows)
        content = lines[-1] if len(lines) > how.skip_rows else b""
        if not content.strip():
            raise InputError(f"{where}: the file is empty")
        content, self._separator = _separated(content, where)
        rows = [
            (line + how.skip_rows, cells)
            for line, cells in islice(records(content, where, self._separator), LOOKED_AT)
            if any(one.strip() for one in cells)
        ]
        layout = find_layout(rows or [(1, [""])], where, how.header_row)
        self.settings = layout.settings
        self._messages += layout.messages
        self.headers = clean_headers(layout.headers, where)
        if layout.first >= len(rows):
            raise InputError(f"{where}: no rows below the header")
        found = zip(self.headers, map(_WITH_UNIT.fullmatch, rows[layout.first][1]), strict=False)
        units = {name: match[1] for name, match in found if match is not None}
        new = {
            name: f"{name} [{unit}]"
            for name, unit in units.items()
            if is_unit(unit) and not split_header(name)[1]
        }
        self._units = {new[name]: units[name] for name in new}  # that stand in the cells
        self.headers = tuple(new.get(name, name) for name in self.headers)
        self._first_line = rows[layout.first][0]
        self._body = content.split(b"\n", above := self._first_line - 1 - how.skip_rows)[above]
        self._body, notes = _without_notes(self._body, self._separator)
        self._messages += [f"{where}: passed over below the rows: {note!r}" for note in notes]
        self._lines: IntArray | None = None  # of rows, where they are not one after another
        self._plain = self._body  # what pandas gets
        data = np.frombuffer(self._body, dtype=np.uint8)
        if not is_rectangular(data, self._separator, len(self.headers)):
            self._lines, self._plain = self._checked_lines(problems)
        signs = np.flatnonzero(data == ord("="))
        starts = np.frombuffer(b'\r\n\t ",;|', dtype=np.uint8)
        if len(signs) and (signs[0] == 0 or np.isin(data[signs[signs > 0] - 1], starts).any()):
            for name, cells in self._text().items():
                begin = cells.str.lstrip().str.startswith("=").to_numpy(bool)
                problems.cells(begin, str(name), FORMULA)

    def read(self, numeric: Collection[str], problems: Problems) -> Cells:
        """Read all rows, the columns of these headers as numbers; note cells that are none."""
        wanted = [name for name in self.headers if name in numeric]
        frame, mark = None, "."
        if not self._how.empty and self._how.decimal != "comma":
            frame = self._fast(wanted, ".")
        if frame is None and not self._how.empty and self._separator != ",":
            frame, mark = self._fast(wanted, ","), ","
            # No cell has a point then; it takes one whose comma cannot stand between thousands.
            places = [self.headers.index(name) for name in wanted]
            if not any(_is_decimal_comma(cells[i]) for _, cells in self._rows() for i in places):
                frame = None
        if frame is None:
            frame, mark = self._cell_by_cell(wanted, problems)
        text: dict[str, Any] = {n: lossless(frame[n]) for n in self.headers if n not in wanted}
        name = "TSV" if self._separator == "\t" else "CSV"
        thousands = f", {mark[1:]!r} between thousands" if mark[1:] else ""
        kind = "Excel" if self._cell else f"{name}, separator {SEPARATORS[self._separator]}"
        dialect = f"{kind}, decimal {_WORDS[mark[0]]}{thousands}"
        messages = [f"{self.where}: {dialect}, {len(frame)} rows", *self._messages]
        return Cells.of(self, frame.assign(**text), *messages)

    def lines(self, rows: IntArray) -> IntArray:
        """Return the file's lines of some rows."""
        return rows + self._first_line if self._lines is None else self._lines[rows]

    def spot(self, row: int, name: str) -> str:
        """Return words for a cell."""
        line = int(self.lines(np.array(row)))
        return self._cell(line, self.headers.index(name) + 1) if self._cell else f"line {line}"

    def typed(self, wanted: Sequence[tuple[int, str]]) -> list[str]:
        """Return cells as they were typed."""
        rows = {row for row, _ in wanted}
        found = {row: cells for row, (_, cells) in enumerate(self._rows()) if row in rows}
        return [found[row][self.headers.index(name)] for row, name in wanted]

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """Yield line and cells of each record below the header that is as wide as it."""
        for line, cells in records(self._plain, self.where, self._separator):
            yield line + self._first_line - 1, cells

    def _text(self) -> pd.DataFrame:
        """Return every cell as it was typed."""
        rows = [cells for _, cells in self._rows()]
        return pd.DataFrame(rows, columns=list(self.headers), dtype=str)

    def _checked_lines(self, problems: Problems) -> tuple[IntArray, bytes]:
        """Return each row's line, and the records written again without blank lines between.

        Rows of another length are noted; empty cells beyond the header are none.
        """
        width, lines = len(self.headers), []
        # The two parsers differ where quotes and line ends are odd; as written here they do not.
        again = io.BytesIO()
        text = io.TextIOWrapper(again, encoding="utf-8", newline="")
        writer = csv.writer(text, delimiter=self._separator, lineterminator="\n")
        bad: list[str] = []
        for line, cells in self._rows():
            while len(cells) > width and not cells[-1].strip():
                cells.pop()
            if len(cells) == width:
                lines.append(line)
                writer.writerow(cells)
                continue
            shown = clipped(self._separator.join(cells))
            bad.append(f"line {line}: {shown} has {len(cells)} cells")
        if bad:
            more = f" and {len(bad) - 3} more rows" if len(bad) > 3 else ""
            problems.texts.append(
                f"{self.where}, {', '.join(bad[:3])}{more}: expected {width} cells, as the header "
                f"(separator {SEPARATORS[self._separator]})"
            )
        text.flush()
        return np.array(lines, dtype=np.int64), again.getvalue()

    def _fast(self, wanted: list[str], decimal: str) -> pd.DataFrame | None:
        """Return the rows as pandas reads them; None where a slower look is needed."""
        try:
            options = {"sep": self._separator, "decimal": decimal, "header": None}
            frame = read_delimited(self._plain, self.headers, wanted, **options)
        except (ValueError, OverflowError):
            return None
        if self._lines is not None and len(frame) != len(self._lines):
            return None
        values = frame[wanted].to_numpy()
        # pandas reads the words true and false as 1 and 0.
        lowered = self._body.lower()
        has_words = b"true" in lowered or b"false" in lowered
        odd = np.isinf(values).any() or (has_words and np.isin(values, (0, 1)).any())
        return None if odd else frame

    def _cell_by_cell(self, wanted: list[str], problems: Problems) -> tuple[pd.DataFrame, str]:
        """Read in the style of which fewest cells are no number, and note those that are none."""
        text = self._text()
        for name in wanted:
            text[name] = text[name].str.strip().str.removesuffix(self._units.get(name, ""))
            text[name] = text[name].mask(text[name].str.strip().isin(self._how.empty), "")
        counts = Counter(cell for name in wanted for cell in text[name] if cell.strip())
        styles = [one for one in _STYLES if self._how.decimal in (None, _WORDS[one[0]])]
        off = [
            sum(n for cell, n in counts.items() if not one.fullmatch(cell)) for *_, one in styles
        ]
        mark, thousands, style = styles[off.index(min(off))]
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
        }
        nothing = [cell for cell in counts if np.isinf(numbers[cell]) and _NOTHING.fullmatch(cell)]
        for name in wanted:
            values = text[name].map(numbers).to_numpy(dtype=float)
            bad = np.isinf(values)
            is_nothing = bad & text[name].isin(nothing).to_numpy(bool)
            problems.cells(bad & ~is_nothing, name, FINITE)
            problems.cells(is_nothing, name, f"{FINITE}; --empty where such a cell is empty")
            text[name] = np.where(bad, np.nan, values)
        if nothing:
            problems.options["empty"] = "\n".join(dict.fromkeys(map(str.strip, nothing)))
        return text, mark + thousands


def _is_decimal_comma(cell: str) -> bool:
    return "," in cell and _COMMA.fullmatch(cell) is not None and not _STYLES[2][2].fullmatch(cell)


def _without_notes(body: bytes, separator: str) -> tuple[bytes, list[str]]:
    """Return the rows without lines below them that hold one text and nothing else, and those."""
    lines, notes = body.split(b"\n"), []
    while len(lines) > 2 and lines[-2].count(b'"') % 2 == 0:
        cells = [cell.strip(' "') for cell in lines[-2].decode().split(separator)]
        filled = [cell for cell in cells if cell]
        if len(filled) > 1 or (filled and not _NOTE.fullmatch(filled[0])):
            break
        notes += filled
        del lines[-2]
    return b"\n".join(lines), notes[::-1]


def as_utf8(content: bytes, where: str) -> tuple[bytes, list[str]]:
    """Return text as UTF-8 without its mark, lines ended by LF, and what else it was."""
    messages = []
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            content = content.decode("utf-16").encode()
        except UnicodeDecodeError:
            raise InputError(f"{where}: begins as UTF-16 text, and is none") from None
        messages.append(f"{where}: UTF-16 text")
    content = content.removeprefix(codecs.BOM_UTF8)
    if b"\0" in content:
        line = content[: content.index(b"\0")].count(b"\n") + 1
        raise InputError(f"{where}, line {line}: a zero byte: not a text file, or not UTF-8")
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        byte = f"{where}, line {line}: byte {content[error.start]:#04x} is not UTF-8"
        try:
            content = content.decode("cp1252").encode()
        except UnicodeDecodeError:
            raise InputError(f"{byte}; expected UTF-8") from None
        messages.append(f"{byte}: read as Windows-1252")
    content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n").rstrip(b"\n")
    return content + b"\n", messages


def _separated(content: bytes, where: str) -> tuple[bytes, str]:
    """Return the text and its separator: the one by which most first records are equally wide.

    Tab goes before semicolon, bar and comma: a comma may stand within cells of the others. Text in
    columns with blanks between gets tabs.
    """
    best, failed = (0, ""), None
    for separator in SEPARATORS:
        try:
            some = islice(records(content, where, separator), LOOKED_AT)
            widths = Counter(len(cells) for _, cells in some)
        except InputError as error:
            failed = error
            continue
        width, n = max(widths.items(), key=lambda one: (one[1] * (one[0] > 1), one[0]))
        if width > 1 and n > best[0]:
            best = n, separator
    if best[1]:
        return content, best[1]
    if failed is not None:
        raise failed
    rows = [re.sub(r"^\s*#+", "", row) for row in content.decode().split("\n")]
    if len({len(row.split()) for row in rows[:LOOKED_AT] if row.strip()} - {1}) == 1:
        return "\n".join("\t".join(row.split()) for row in rows).encode(), "\t"
    raise InputError(
        f"{where}, line 1: one column only; expected columns separated by commas, semicolons, "
        "bars or tabs"
    )
