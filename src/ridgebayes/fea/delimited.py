"""Text files: encoding, and the separator between cells, which may be blanks."""

import codecs
import re
from collections import Counter
from collections.abc import Iterator
from itertools import islice

from ridgebayes.errors import InputError
from ridgebayes.fea.cells import SEPARATORS, TextTable
from ridgebayes.fea.given import Given
from ridgebayes.fea.header import LOOKED_AT, Row
from ridgebayes.fea.record import FileError
from ridgebayes.runtime.reading import decoded
from ridgebayes.runtime.text import clipped
from ridgebayes.table.files import records

_TOUCH = re.compile(r"(?<=[\d.])(?=[-+]\d*\.\d)")  # a number begins within a word
_RULE = re.compile(r"\s*[-=_]{9,}\s*")  # below a header


def read_delimited(content: bytes, facts: Given, problems: FileError) -> TextTable:
    """Read a text file of cells between separators.

    Parameters
    ----------
    content : bytes
        All of it: UTF-8, UTF-16 with its mark, or Windows-1252, lines ended in any way.
    facts : Given
        Options that the user gives.
    problems : FileError
        As `ridgebayes.fea.cells.TextTable`.

    Raises
    ------
    InputError
        If it is no text, is empty, or has an open quote.
    """
    text = _as_text(content, problems).lstrip("\ufeff")
    lines = text.split("\n", facts.skip_rows)
    text = lines[-1] if len(lines) > facts.skip_rows else ""
    if not text.strip():
        raise problems.error("the file is empty")
    text, separator = _separated(text, problems)

    def rows() -> Iterator[Row]:
        for line, cells in records(text, problems.where, separator):
            yield line + facts.skip_rows, cells

    return TextTable(rows(), separator, facts, problems, text=text)


def _as_text(content: bytes, problems: FileError) -> str:
    """Return text that may be UTF-16 or Windows-1252; say so if it is."""
    where = problems.where
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            content = content.decode("utf-16").encode()
        except UnicodeDecodeError:
            raise problems.error("begins as UTF-16 text, and is none") from None
        problems.messages.append(f"{where}: UTF-16 text")
    try:
        return decoded(content, where)
    except InputError as error:
        try:
            text = decoded(content.decode("cp1252").encode(), where)
        except UnicodeDecodeError:
            raise error from None
        byte = str(error).removesuffix("; expected UTF-8")
        problems.messages.append(f"{byte}: read as Windows-1252")
        return text


def _separated(text: str, problems: FileError) -> tuple[str, str]:
    """Return the text and its separator: the one that gives most first records one width.

    Tab goes before semicolon, bar and comma: a comma may stand within cells of the others. Text in
    columns with blanks between gets tabs.
    """
    best, n_record, failed = (0, ""), 0, None
    for separator in SEPARATORS:
        try:
            some = islice(records(text, problems.where, separator), LOOKED_AT)
            widths = Counter(len(cells) for _, cells in some)
        except InputError as error:
            failed = error
            continue
        n_record = widths.total()
        width, n = max(widths.items(), key=lambda item: (item[1] * (item[0] > 1), item[0]))
        if width > 1 and n > best[0]:
            best = n, separator
    blank = "" if 2 * best[0] > n_record else _tabs_for_blanks(text, problems)
    if blank:
        return blank, "\t"
    if best[1]:
        return text, best[1]
    raise failed or InputError(
        f"{problems.where}, line 1: one column only; expected columns separated by commas, "
        "semicolons, bars or tabs"
    )


def _tabs_for_blanks(text: str, problems: FileError) -> str:
    """Return text in columns with tabs between; empty if most lines are not equally wide."""
    lines = text.split("\n")
    n = next((i for i, row in enumerate(lines) if not row.lstrip().startswith(("#", "%"))), 0)
    rows = [re.sub(r"^\s*[#%]+", "", row) for row in lines[:n]] + lines[n:]  # a header among them
    rows = ["" if _RULE.fullmatch(row) else row for row in rows]
    some = [row.split() for row in rows[:LOOKED_AT] if row.strip() and row.lstrip()[0] not in "#%"]
    widths = Counter(map(len, some))
    width, n = widths.most_common(1)[0] if widths else (0, 0)
    is_table = width >= 2 and n >= 2 and 2 * n > widths.total()
    touching = next((i for i, row in enumerate(rows) if _TOUCH.search(row)), None)
    if touching is not None and len(widths) > 1:
        # Numbers of fixed columns run together: safe to part where all rows then have one width.
        parted = [_TOUCH.sub(" ", row) for row in rows]
        counts = sorted({len(row.split()) for row in parted if row.strip()})
        said = f"{problems.where}, line {touching + 1}: columns run together, such as "
        said += clipped(lines[touching])
        if len(counts) == 1:
            problems.messages.append(f"{said}: split before signs, {counts[0]} columns")
            rows, width, is_table = parted, counts[0], True
        elif not is_table:
            raise InputError(
                f"{said}; split before signs, lines have {' or '.join(map(str, counts))} cells: "
                "expected blanks between columns"
            )
    if not is_table:
        return ""
    return "\n".join(
        _with_tabs(row, width) or (row and as_is) for row, as_is in zip(rows, lines, strict=True)
    )


def _with_tabs(row: str, width: int) -> str:
    """Return a line of so many cells with tabs between; names of Abaqus hold single blanks."""
    ways = (row.split(), re.split(r"\s{2,}", row.strip()))
    return next(("\t".join(cells) for cells in ways if len(cells) == width), "")
