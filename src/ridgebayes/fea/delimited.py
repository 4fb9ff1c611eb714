"""Text files to records of cells: encoding, separator, header, units, and names of columns."""

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
_TOUCH = re.compile(r"(?<=[\d.])(?=[-+]\d*\.\d)")  # where a number begins within a word
_RULE = re.compile(r"\s*[-=_]{9,}\s*")  # below a header
LOOKED_AT = 60  # records
_MOST_LOOKED = 200  # cells of a header
_NUMBER = re.compile(r"\s*[+-]?(?:\d[\d.,'\u2019 \u00a0\u202f]*|[.,]\d+)(?:[eE][+-]?\d+)?\s*%?\s*")
_MOST_COLUMNS = 2000
_LONGEST = 500  # characters of a header
_UNNAMED = "(column {})"
_NO_UNIT = ("", "-", "--", "\N{EN DASH}", "1", "#", "[-]", "(-)", "count", "%")
Row = tuple[int, list[str]]  # line from 1, and cells


def separated_text(content: bytes, skip_rows: int, problems: FileError) -> tuple[str, str]:
    """Return a file's text below some lines, and the separator between its cells.

    Parameters
    ----------
    content : bytes
        All of it: UTF-8, UTF-16 with its mark, or Windows-1252, lines ended in any way.
    skip_rows : int
        Lines to pass over at the top.
    problems : FileError
        Where messages about the text are noted.

    Raises
    ------
    InputError
        If it is no text, is empty, or has one column only.
    """
    text = _as_text(content, problems).lstrip("\ufeff")
    lines = text.split("\n", skip_rows)
    text = lines[-1] if len(lines) > skip_rows else ""
    if not text.strip():
        raise problems.error("the file is empty")
    return _separated(text, problems)


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


def find_header(
    rows: Sequence[Row], header_row: int | None, problems: FileError
) -> tuple[list[str], int]:
    """Find the header among the first records of a file.

    Parameters
    ----------
    rows : sequence of (int, list of str)
        Line and cells of each record.
    header_row : int or None
        The header's line, where the user says it; 0 for none.
    problems : FileError
        Where messages about the lines above the rows are noted.

    Returns
    -------
    headers : list of str
        Name of each column, with the units of a row of units.
    n_head : int
        Number of records above the first row.

    Raises
    ------
    InputError
        If there is no record in that line, or rows stand above the header.

    Examples
    --------
    >>> rows = [(1, ["Test 7"]), (3, ["Steg", "Q"]), (4, ["mm", ""]), (5, ["0,2", "4"])]
    >>> find_header(rows, None, FileError("mine.csv"))
    (['Steg [mm]', 'Q'], 3)
    """
    where = problems.where
    i = _likeliest(rows) if header_row is None else _at(rows, header_row, where)
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
    r"""Return headers on one line each, and a stand-in for a column without one.

    A header that stands twice gets the number of its column.

    Raises
    ------
    InputError
        If a header is a formula, is too long or has control characters, or there are over 2000.

    Examples
    --------
    >>> clean_headers(["Ridge  width\n[mm]", None, "Q", "Q"], "mine.csv")
    ('Ridge width [mm]', '(column 2)', 'Q', 'Q #4')
    """
    if len(names) > _MOST_COLUMNS:
        raise InputError(f"{where}: {len(names)} columns; expected at most {_MOST_COLUMNS}")
    headers: list[str] = []
    for i, name in enumerate(names, start=1):
        text = "" if name is None else " ".join(str(name).split())
        rules = {
            "expected values, not formulas": text.startswith("="),
            "expected no control characters": re.search(r"[\x00-\x1f\x7f]", text) is not None,
            f"expected at most {_LONGEST} characters": len(text) > _LONGEST,
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
    """Return the rows of a file that hold anything, without unnamed columns that hold nothing.

    Parameters
    ----------
    frame : DataFrame, n_row rows
        All cells by header: numbers, NaN where a cell is empty, or text.
    problems : FileError
        Where it is said how many rows are empty.

    Returns
    -------
    DataFrame
        Its index tells which rows of the file they are, from 0.

    Raises
    ------
    InputError
        If no row does.
    """
    empty = frame.isna() | (frame == "")
    unnamed = {_UNNAMED.format(i) for i in range(1, len(empty.columns) + 1)}
    used = [name for name in frame if name not in unnamed or not empty[name].all()]
    blank = empty.all(axis=1)
    if blank.all() and not problems:
        raise problems.error("no rows below the header")
    blank &= not blank.all()  # else its cells are no numbers
    if n := int(blank.sum()):
        problems.messages.append(f"{n} empty rows ignored")
    return frame.loc[~blank, used]


def n_known(cells: Sequence[str]) -> int:
    """Return how many of some cells are headers whose meaning is known."""
    words = [split_header(cell.strip())[0] for cell in cells[:_MOST_LOOKED] if not is_number(cell)]
    keys = {text if text in NAMES else key_of(text) for text in words} - {""}
    return len(keys) + len(corners_of(words))


def is_number(cell: str) -> bool:
    """Return whether a cell looks like a number, in whichever country."""
    return _NUMBER.fullmatch(cell) is not None


def _at(rows: Sequence[Row], line: int, where: str) -> int | None:
    if line == 0:
        return None
    lines = [number for number, _ in rows]
    if line not in lines:
        raise InputError(f"{where}: --header-row {line}: expected a line with cells near the top")
    return lines.index(line)


def _likeliest(rows: Sequence[Row]) -> int | None:
    """Return which record is the header: most words of the field above columns of numbers."""
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
    """Refuse records above the header that look like rows: they would be lost as titles."""
    least = max(2, sum(bool(name.strip()) for name in headers) / 2)
    lines = [str(at) for at, cells in above if sum(map(is_number, cells)) >= least]
    if lines:
        text = f"numbers above the header in line {line}, in line {some_of(lines, 3)}: expected "
        text += f"rows below it; --header-row {line} passes over them"
        raise FileError(where, needs=[text], options={"header_row": str(line)})
