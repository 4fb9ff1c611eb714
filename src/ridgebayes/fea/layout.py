"""Where a table stands in a file: encoding, separators, title lines, header, units, and rows."""

import codecs
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import pandas as pd

from ridgebayes.errors import InputError
from ridgebayes.fea.record import FileError
from ridgebayes.fea.words import corners_of, is_unit, key_of, split_header
from ridgebayes.runtime.reading import decoded
from ridgebayes.runtime.text import clipped, some_of
from ridgebayes.table.columns import NAMES
from ridgebayes.table.files import records

LOOKED_AT = 60  # records
LONGEST_HEAD = 2_000_000  # characters that hold them: cells of the widest tables, some words each
_MOST_LOOKED = 200  # cells of a header
_NUMBER = re.compile(r"\s*[+-]?(?:\d[\d.,'\u2019 \u00a0\u202f]*|[.,]\d+)(?:[eE][+-]?\d+)?\s*%?\s*")
FINITE = "expected a finite number, with a point for decimals, or an empty cell"
FORMULA = "expected values, not formulas"
MOST_COLUMNS = 2000
LONGEST_HEADER = 500
_UNNAMED = "(column {})"
_NO_UNIT = ("", "-", "--", "\N{EN DASH}", "1", "#", "[-]", "(-)", "count", "%")
SEPARATORS = {"\t": "tab", ";": "';'", "|": "'|'", ",": "','"}
_TOUCH = re.compile(r"(?<=[\d.])(?=[-+]\d*\.\d)")  # where a number begins within a word
_REMARK = ("#", "%")
_RULE = re.compile(r"\s*[-=_]{9,}\s*")  # below a header
Records = Sequence[tuple[int, Sequence[str]]]


@dataclass(frozen=True)
class Layout:
    """Header and other lines found above the rows.

    Parameters
    ----------
    headers : list of str
        One a column, with the units of a row of units.
    first : int
        Which of the records is the first row.
    messages : tuple of str
        Messages about the lines that were recognised.
    """

    headers: list[str]
    first: int
    messages: tuple[str, ...] = ()


def find_layout(rows: Records, where: str, header_row: int | None = None) -> Layout:
    """Find the header among the first records of a file.

    Parameters
    ----------
    rows : sequence of (int, sequence of str)
        Line and cells of each record.
    where : str
        Name that messages show.
    header_row : int or None, optional
        The header's line, where the user says it; 0 for none.

    Raises
    ------
    InputError
        If there is no record in that line, or rows stand above the header.

    Examples
    --------
    >>> rows = [(1, ["Test 7"]), (3, ["Steg", "Q"]), (4, ["mm", ""]), (5, ["0,2", "4"])]
    >>> found = find_layout(rows, "mine.csv")
    >>> found.headers, found.first
    (['Steg [mm]', 'Q'], 3)
    """
    i = _header(rows) if header_row is None else _at(rows, header_row, where)
    if i is None:
        headers = [f"column {n}" for n in range(1, len(rows[0][1]) + 1)]
        names = f"columns are {headers[0]!r} to {headers[-1]!r}"
        return Layout(headers, 0, messages=(f"{where}: no header; {names}",))
    line, cells = rows[i]
    headers = [*cells]
    headers[0] = re.sub(r"^\s*(?:#|%|//)\s*", "", headers[0])
    if header_row is None:
        _refuse_rows(rows[:i], headers, line, where)
    messages = []
    if i:
        messages.append(f"{where}: header in line {line}, {i} title lines above it")
    below = rows[i + 1 : i + 2]
    if below and _is_units(below[0][1]):
        messages.append(f"{where}: units in line {below[0][0]}")
        units = _units(below[0][1])
        headers = [
            f"{name} [{unit}]" if unit not in _NO_UNIT and not split_header(name)[1] else name
            for name, unit in zip(headers, [*units, *[""] * len(headers)], strict=False)
        ]
    return Layout(headers, i + 1 + bool(len(messages) > bool(i)), tuple(messages))


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
    headers: list[str] = []
    if len(names) > MOST_COLUMNS:
        raise InputError(f"{where}: {len(names)} columns; expected at most {MOST_COLUMNS}")
    for i, name in enumerate(names, start=1):
        text = "" if name is None else " ".join(str(name).split())
        rules = {
            FORMULA: text.startswith("="),
            "expected no control characters": re.search(r"[\x00-\x1f\x7f]", text) is not None,
            f"expected at most {LONGEST_HEADER} characters": len(text) > LONGEST_HEADER,
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


def filled(frame: pd.DataFrame, where: str, problems: FileError) -> pd.DataFrame:
    """Return the rows of a file that hold anything, without unnamed columns that hold nothing.

    Parameters
    ----------
    frame : DataFrame, n_row rows
        All cells by header: numbers, NaN where a cell is empty, or text.
    where : str
        Name that messages show.
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
    if blank.all():
        raise InputError(f"{where}: no rows below the header")
    if n := int(blank.sum()):
        problems.messages.append(f"{n} empty rows ignored")
    return frame.loc[~blank, used]


def known(cells: Sequence[str]) -> int:
    """Return how many of some cells are headers whose meaning is known."""
    words = [split_header(one.strip())[0] for one in cells[:_MOST_LOOKED] if not is_number(one)]
    keys = {one if one in NAMES else key_of(one) for one in words} - {""}
    return len(keys) + len(corners_of(words))


def is_number(cell: str) -> bool:
    """Return whether a cell looks like a number, in whichever country."""
    return _NUMBER.fullmatch(cell) is not None


def _at(rows: Records, line: int, where: str) -> int | None:
    if line == 0:
        return None
    found = [i for i, (number, _) in enumerate(rows) if number == line]
    if not found:
        raise InputError(f"{where}: --header-row {line}: expected a line with cells near the top")
    return found[0]


def _header(rows: Records) -> int | None:
    """Return which record is the header: most words of the field above columns of numbers."""
    full = [[j for j, one in enumerate(cells) if one.strip()] for _, cells in rows]
    width = max(map(len, full))
    best, found = 0, None
    for i, (_, cells) in enumerate(rows):
        if 2 * len(full[i]) < width or len(full[i]) < 2 < width:
            continue
        below = [[row[j] for _, row in rows[i + 1 :] if j < len(row)] for j in range(len(cells))]
        some = [[one for one in column if one.strip()] for column in below]
        over = [
            j
            for j in full[i]
            if not is_number(cells[j]) and 2 * sum(map(is_number, some[j])) >= len(some[j]) > 0
        ]
        score = len(over) + 2 * known(cells) if over else 0
        if score > best:
            best, found = score, i
    if found is None and not any(is_number(rows[0][1][j]) for j in full[0]):
        return next(i for i, some in enumerate(full) if len(some) == width)
    return found


def _refuse_rows(above: Records, headers: Sequence[str], line: int, where: str) -> None:
    """Refuse records above the header that look like rows: they would be lost as titles."""
    least = max(2, sum(bool(one.strip()) for one in headers) / 2)
    lines = [str(at) for at, cells in above if sum(map(is_number, cells)) >= least]
    if lines:
        text = f"numbers above the header in line {line}, in line {some_of(lines, 3)}: expected "
        text += f"rows below it; --header-row {line} passes over them"
        raise FileError(where, needs=[text], options={"header_row": str(line)})


def _units(cells: Sequence[str]) -> list[str]:
    return [one.strip().removeprefix("#").strip().strip("[]()") for one in cells]


def _is_units(cells: Sequence[str]) -> bool:
    """Return whether a record holds units and nothing else."""
    units = _units(cells)
    return any(map(is_unit, units)) and all(one in _NO_UNIT or is_unit(one) for one in units)


def as_text(content: bytes, where: str, problems: FileError) -> str:
    """Return text that may be UTF-16 or Windows-1252; say so if it is."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            content = content.decode("utf-16").encode()
        except UnicodeDecodeError:
            raise InputError(f"{where}: begins as UTF-16 text, and is none") from None
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


def _tabs_for_blanks(text: str, where: str, problems: FileError) -> str:
    """Return text in columns with tabs between; empty if most lines are not equally wide."""
    lines = text.split("\n")
    n = next((i for i, row in enumerate(lines) if not row.lstrip().startswith(_REMARK)), 0)
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
        found = {len(row.split()) for row in parted if row.strip()}
        told = f"line {touching + 1}: columns run together, such as {clipped(lines[touching])}"
        if len(found) == 1:
            problems.messages.append(f"{where}, {told}: split before signs, {max(found)} columns")
            rows, width, is_table = parted, found.pop(), True
        elif not is_table:
            raise InputError(
                f"{where}, {told}; split before signs, lines have "
                f"{' or '.join(map(str, sorted(found)))} cells: expected blanks between columns"
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


def separated(text: str, where: str, problems: FileError) -> tuple[str, str]:
    """Return the text and its separator: the one by which most first records are equally wide.

    Tab goes before semicolon, bar and comma: a comma may stand within cells of the others. Text in
    columns with blanks between gets tabs.
    """
    best, n_record, failed = (0, ""), 0, None
    for separator in SEPARATORS:
        try:
            some = islice(records(text[:LONGEST_HEAD], where, separator), LOOKED_AT)
            widths = Counter(len(cells) for _, cells in some)
        except InputError as error:
            failed = error
            continue
        n_record = widths.total()
        width, n = max(widths.items(), key=lambda one: (one[1] * (one[0] > 1), one[0]))
        if width > 1 and n > best[0]:
            best = n, separator
    blank = "" if 2 * best[0] > n_record else _tabs_for_blanks(text, where, problems)
    if blank:
        return blank, "\t"
    if best[1]:
        return text, best[1]
    if failed is not None:
        raise failed
    raise InputError(
        f"{where}, line 1: one column only; expected columns separated by commas, semicolons, "
        "bars or tabs"
    )
