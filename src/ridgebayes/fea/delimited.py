"""Splitting of text files into records: encoding, separator, header, row of units, and headers."""

import codecs
import re
from collections import Counter
from collections.abc import Sequence
from itertools import islice

import pandas as pd

from ridgebayes.errors import InputError
from ridgebayes.fea.record import FileError
from ridgebayes.fea.words import corners_of, is_unit, key_of, split_header
from ridgebayes.runtime.reading import decoded
from ridgebayes.runtime.text import clipped, some_of
from ridgebayes.table.columns import NAMES
from ridgebayes.table.files import records

SEPARATORS = {"\t": "tab", ";": "';'", "|": "'|'", ",": "','"}
_NUMBER_START = re.compile(r"(?<=[\d.])(?=[-+]\d*\.\d)")  # start of a number within a word
_UNDERLINE = re.compile(r"\s*[-=_]{9,}\s*")  # line below a header
LOOKED_AT = 60  # first records that are searched for the header
_MAX_CELLS = 200  # cells of a record that are compared with known headers
_NUMBER = re.compile(r"\s*[+-]?(?:\d[\d.,'\u2019 \u00a0\u202f]*|[.,]\d+)(?:[eE][+-]?\d+)?\s*%?\s*")
_MAX_COLUMNS = 2000
_MAX_HEADER_LENGTH = 500  # characters
_UNNAMED = "(column {})"
_NO_UNIT = ("", "-", "--", "\N{EN DASH}", "1", "#", "[-]", "(-)", "count", "%")
Row = tuple[int, list[str]]  # line number, from 1, and cells


def separated_text(content: bytes, skip_rows: int, problems: FileError) -> tuple[str, str]:
    """Return the text of a file below the skipped lines, and its separator.

    Parameters
    ----------
    content : bytes
        Content of the file: UTF-8, UTF-16 with a byte order mark, or Windows-1252, with any line
        ends.
    skip_rows : int
        Lines to skip at the top.
    problems : FileError
        Collects messages about the text.

    Raises
    ------
    InputError
        If the content is not text, is empty, or has only one column.
    """
    text = _as_text(content, problems).lstrip("\ufeff")
    lines = text.split("\n", skip_rows)
    text = lines[-1] if len(lines) > skip_rows else ""
    if not text.strip():
        raise problems.error("the file is empty")
    return _separated(text, problems)


def _as_text(content: bytes, problems: FileError) -> str:
    """Decode text; report an encoding of UTF-16 or Windows-1252."""
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
    """Return text with tabs between columns; empty if most lines differ in number of words."""
    lines = text.split("\n")
    n = next((i for i, row in enumerate(lines) if not row.lstrip().startswith(("#", "%"))), 0)
    rows = [re.sub(r"^\s*[#%]+", "", row) for row in lines[:n]] + lines[n:]  # may be a header
    rows = ["" if _UNDERLINE.fullmatch(row) else row for row in rows]
    some = [row.split() for row in rows[:LOOKED_AT] if row.strip() and row.lstrip()[0] not in "#%"]
    widths = Counter(map(len, some))
    width, n = widths.most_common(1)[0] if widths else (0, 0)
    is_table = width >= 2 and n >= 2 and 2 * n > widths.total()
    touching = next((i for i, row in enumerate(rows) if _NUMBER_START.search(row)), None)
    if touching is not None and len(widths) > 1:
        # Numbers in columns of fixed width can touch. They are split if all rows then have the
        # same number of cells.
        split = [_NUMBER_START.sub(" ", row) for row in rows]
        counts = sorted({len(row.split()) for row in split if row.strip()})
        symptom = f"{problems.where}, line {touching + 1}: columns run together, such as "
        symptom += clipped(lines[touching])
        if len(counts) == 1:
            problems.messages.append(f"{symptom}: split before signs, {counts[0]} columns")
            rows, width, is_table = split, counts[0], True
        elif not is_table:
            raise InputError(
                f"{symptom}; split before signs, lines have {' or '.join(map(str, counts))} cells: "
                "expected blanks between columns"
            )
    if not is_table:
        return ""
    return "\n".join(
        _with_tabs(row, width) or (row and as_is) for row, as_is in zip(rows, lines, strict=True)
    )


def _with_tabs(row: str, width: int) -> str:
    """Return a line of `width` cells with tabs between them; empty if it has another width.

    Cells may contain single blanks, like column names of Abaqus.
    """
    splits = (row.split(), re.split(r"\s{2,}", row.strip()))
    return next(("\t".join(cells) for cells in splits if len(cells) == width), "")


def find_header(
    rows: Sequence[Row], header_row: int | None, problems: FileError
) -> tuple[list[str], int]:
    """Find the header among the first records of a file.

    Parameters
    ----------
    rows : sequence of (int, list of str)
        Line and cells of each record.
    header_row : int or None
        Line of the header; 0 for a file without header, None to search for it.
    problems : FileError
        Collects messages about the lines above the rows.

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
    >>> find_header(rows, None, FileError("mine.csv"))
    (['Steg [mm]', 'Q'], 3)
    """
    where = problems.where
    i = _guess_header(rows) if header_row is None else _index_of_line(rows, header_row, where)
    if i is None:
        headers = [f"column {n}" for n in range(1, len(rows[0][1]) + 1)]
        names = f"columns are {headers[0]!r} to {headers[-1]!r}"
        problems.messages.append(f"{where}: no header; {names}")
        return headers, 0
    line, headers = rows[i][0], [*rows[i][1]]
    headers[0] = re.sub(r"^\s*(?:#|%|//)\s*", "", headers[0])
    if header_row is None:
        _refuse_rows(rows[:i], headers, line, where)
    if i:
        problems.messages.append(f"{where}: header in line {line}, {i} title lines above it")
    for below, cells in rows[i + 1 : i + 2]:
        units = [cell.strip().removeprefix("#").strip().strip("[]()") for cell in cells]
        if any(map(is_unit, units)) and all(unit in _NO_UNIT or is_unit(unit) for unit in units):
            problems.messages.append(f"{where}: units in line {below}")
            for j, unit in enumerate(units[: len(headers)]):
                if unit not in _NO_UNIT and not split_header(headers[j])[1]:
                    headers[j] = f"{headers[j]} [{unit}]"
            return headers, i + 2
    return headers, i + 1


def clean_headers(names: Sequence[object], where: str) -> tuple[str, ...]:
    r"""Return unique headers on one line each, with a placeholder for an empty header.

    A duplicate header gets the number of its column.

    Raises
    ------
    InputError
        If a header is a formula, is too long or has control characters, if all headers are empty,
        or if there are more than 2000 columns.

    Examples
    --------
    >>> clean_headers(["Ridge  width\n[mm]", None, "Q", "Q"], "mine.csv")
    ('Ridge width [mm]', '(column 2)', 'Q', 'Q #4')
    """
    if len(names) > _MAX_COLUMNS:
        raise InputError(f"{where}: {len(names)} columns; expected at most {_MAX_COLUMNS}")
    headers: list[str] = []
    for i, name in enumerate(names, start=1):
        text = "" if name is None else " ".join(str(name).split())
        rules = {
            "expected values, not formulas": text.startswith("="),
            "expected no control characters": re.search(r"[\x00-\x1f\x7f]", text) is not None,
            f"expected at most {_MAX_HEADER_LENGTH} characters": len(text) > _MAX_HEADER_LENGTH,
        }
        for rule, is_broken in rules.items():
            if is_broken:
                raise InputError(f"{where}, header, column {i} = {text[:60]!r}: {rule}")
        if text in headers:
            words, unit = split_header(text)
            text = f"{words} #{i}" + (f" [{unit}]" if unit else "")
        headers.append(text or _UNNAMED.format(i))
    if all(name == _UNNAMED.format(i) for i, name in enumerate(headers, start=1)):
        raise InputError(f"{where}: no header; expected a header for each column")
    return tuple(headers)


def filled(frame: pd.DataFrame, problems: FileError) -> pd.DataFrame:
    """Return a table without empty rows and without empty columns that have no header.

    Parameters
    ----------
    frame : DataFrame, n_row rows
        All cells by header: numbers (NaN for an empty cell) or text.
    problems : FileError
        Collects a message with the number of empty rows.

    Returns
    -------
    DataFrame
        Its index is the row in the file, from 0.

    Raises
    ------
    InputError
        If all rows are empty.
    """
    empty = frame.isna() | (frame == "")
    unnamed = {_UNNAMED.format(i) for i in range(1, len(empty.columns) + 1)}
    used = [name for name in frame if name not in unnamed or not empty[name].all()]
    blank = empty.all(axis=1)
    if blank.all() and not problems:
        raise problems.error("no rows below the header")
    blank &= not blank.all()  # if all are blank, their cells were reported as invalid numbers
    if n := int(blank.sum()):
        problems.messages.append(f"{n} empty rows ignored")
    return frame.loc[~blank, used]


def n_known(cells: Sequence[str]) -> int:
    """Return the number of cells that are recognised headers."""
    words = [split_header(cell.strip())[0] for cell in cells[:_MAX_CELLS] if not is_number(cell)]
    keys = {text if text in NAMES else key_of(text) for text in words} - {""}
    return len(keys) + len(corners_of(words))


def is_number(cell: str) -> bool:
    """Return whether a cell looks like a number with any decimal mark and thousands separator."""
    return _NUMBER.fullmatch(cell) is not None


def _index_of_line(rows: Sequence[Row], line: int, where: str) -> int | None:
    if line == 0:
        return None
    lines = [number for number, _ in rows]
    if line not in lines:
        raise InputError(f"{where}: --header-row {line}: expected a line with cells near the top")
    return lines.index(line)


def _guess_header(rows: Sequence[Row]) -> int | None:
    """Return the index of the likeliest header: most recognised words above columns of numbers."""
    full = [[j for j, cell in enumerate(cells) if cell.strip()] for _, cells in rows]
    width = max(map(len, full))
    best, place = 0, None
    for i, (_, cells) in enumerate(rows):
        if 2 * len(full[i]) < width or len(full[i]) < 2 < width:
            continue
        over = 0
        for j in full[i]:
            below = [row[j] for _, row in rows[i + 1 :] if j < len(row) and row[j].strip()]
            is_over = 2 * sum(map(is_number, below)) >= len(below) > 0
            over += is_over and not is_number(cells[j])
        score = over + 2 * n_known(cells) if over else 0
        if score > best:
            best, place = score, i
    if place is None and not any(is_number(rows[0][1][j]) for j in full[0]):
        return list(map(len, full)).index(width)
    return place


def _refuse_rows(above: Sequence[Row], headers: Sequence[str], line: int, where: str) -> None:
    """Refuse rows of numbers above the header, which would be ignored as title lines."""
    least = max(2, sum(bool(name.strip()) for name in headers) / 2)
    lines = [str(at) for at, cells in above if sum(map(is_number, cells)) >= least]
    if lines:
        text = f"numbers above the header in line {line}, in line {some_of(lines, 3)}: expected "
        text += f"rows below it; --header-row {line} passes over them"
        raise FileError(where, needs=[text], options={"header_row": str(line)})
