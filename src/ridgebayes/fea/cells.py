"""Cells of text tables: columns between blanks, comments, notes, and styles of numbers."""

import math
import re
import string
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import IntArray
from ridgebayes.fea.lines import parse_number
from ridgebayes.fea.record import FileError, Row
from ridgebayes.fea.words import FORTRAN, NOTHING, NUMBER, is_unit, split_header
from ridgebayes.runtime.text import clipped, count, some_of

SEPARATORS = {"\t": "tab", ";": "';'", "|": "'|'", ",": "','"}
FINITE = "expected a finite number, with a point for decimals, or an empty cell"
_ONE_UNIT = "expected a number in the unit of the header, or of the first cell"
WITH_UNIT = re.compile(r"\s*[+-]?[\d.,]+(?:[eE][+-]?\d+)?\s*([^\W\d]\S*|%)\s*")
_WORDS = re.compile(r"\S+(?: \S+)*")  # words with single blanks between them
_NUMBER_START = re.compile(r"(?<=[\d.])(?=[-+]\d*\.\d)")  # start of a number within a word
_UNDERLINE = re.compile(r"\s*[-=_]{9,}\s*")  # line below a header
# A note has several words; a single word may be the label of a truncated row.
_NOTE = re.compile(r"#.*|[^\W\d].*\s.*")
# Whitespace without control characters, which occur in damaged files only.
_BLANKS = string.whitespace + "\x85\xa0\u1680\u2000\u2001\u2002\u2003\u2004\u2005\u2006\u2007\u2008"
_BLANKS += "\u2009\u200a\u2028\u2029\u202f\u205f\u3000"
_COMMA_NUMBER = re.compile(r"\s*[+-]?(?:\d+,\d*|,\d+|\d+)(?:[eE][+-]?\d+)?\s*", re.A)
_DECIMALS = {"point": ".", "comma": ","}
Style = tuple[str, str, re.Pattern[str]]  # decimal, mark between thousands, and such cells


def _style(decimal: str, thousands: str) -> Style:
    number = (NUMBER if decimal == "point" else _COMMA_NUMBER).pattern
    group, point = re.escape(thousands), re.escape(_DECIMALS[decimal])
    grouped = rf"\s*[+-]?[1-9]\d{{0,2}}(?:{group}\d{{3}})+(?:{point}\d*)?\s*|" if thousands else ""
    return decimal, thousands, re.compile(grouped + number, re.A)


_STYLES = (
    *(_style(decimal, "") for decimal in _DECIMALS),
    *(_style("point", mark) for mark in ",' \xa0\u202f"),
    *(_style("comma", mark) for mark in ".' \xa0\u202f"),
)


def tabs_for_blanks(text: str, problems: FileError, most: int) -> str:
    """Return text with tabs between columns; empty if most lines differ in number of words.

    Only the first `most` lines are compared.

    Raises
    ------
    InputError
        If numbers run together and cannot be split into columns.
    """
    lines = text.split("\n")
    n = next((i for i, row in enumerate(lines) if not row.lstrip().startswith(("#", "%"))), 0)
    rows = [re.sub(r"^\s*[#%]+", "", row) for row in lines[:n]] + lines[n:]  # may be a header
    rows = ["" if _UNDERLINE.fullmatch(row) else row for row in rows]
    _unwrap_header(rows)
    some = [row.split() for row in rows[:most] if row.strip() and row.lstrip()[0] not in "#%"]
    widths = Counter(map(len, some))
    width, n = widths.most_common(1)[0] if widths else (0, 0)
    touching = next((i for i, row in enumerate(rows) if _NUMBER_START.search(row)), None)
    if touching is not None and len(widths) > 1:
        # Numbers in columns of fixed width can touch. They are split if all rows then have the
        # same number of cells.
        split = [_NUMBER_START.sub(" ", row) for row in rows]
        counts = sorted({len(row.split()) for row in split if row.strip()})
        symptom = f"line {touching + 1}: columns run together, such as {clipped(lines[touching])}"
        if len(counts) != 1:
            raise problems.error(
                f"{symptom}; split before signs, lines have {' or '.join(map(str, counts))} cells: "
                "expected blanks between columns"
            )
        told = f"{problems.where}, {symptom}: split before signs, {counts[0]} columns"
        problems.messages.append(told)
        rows, width, n = split, counts[0], len(rows)
    if not (width >= 2 and n >= 2 and 2 * n > widths.total()):
        return ""
    for i, row in enumerate(rows):
        # Cells may contain single blanks, like column names of Abaqus.
        splits = [row.split(), re.split(r"\s{2,}", row.strip())]
        lines[i] = next(("\t".join(s) for s in splits if len(s) == width), row and lines[i])
    return "\n".join(lines)


def _unwrap_header(rows: list[str]) -> None:
    r"""Join a header with the line below it, in place, if that continues names of columns.

    The second line, which ends the header of an X-Y report of Abaqus, has words below some names.

    Examples
    --------
    >>> rows = ["  X   RF2 PI:   U2", "        TOP N: 1", "", " 1.  2.  3."]
    >>> _unwrap_header(rows)
    >>> rows[:2]
    ['X  RF2 PI: TOP N: 1  U2', '']
    """
    i = next((i for i, row in enumerate(rows) if row.strip()), 0)
    header, below, end = [*rows[i : i + 3], "", "", ""][:3]
    names = {match.span(): match[0] for match in _WORDS.finditer(header)}
    more = [*_WORDS.finditer(below)]
    if end.strip() or not 0 < len(more) < len(names) or NUMBER.fullmatch(below.split()[0]):
        return
    for match in more:
        above = min(names, key=lambda span: abs(sum(span) - sum(match.span())))
        names[above] += f" {match[0]}"
    rows[i : i + 2] = ["  ".join(names.values()), ""]


def body_cells(
    rows: list[Row], headers: Sequence[str], separator: str, problems: FileError
) -> tuple[dict[str, tuple[str, bool]], IntArray, pd.DataFrame]:
    """Return the cells below a header, without comments and without notes below the rows.

    Parameters
    ----------
    rows : list of (int, list of str)
        Line and cells of each record. Empty cells beyond the header are dropped.
    headers : sequence of str
        Header of each column.
    separator : str
        Separator between cells, for messages.
    problems : FileError
        Collects messages, and rows of wrong length.

    Returns
    -------
    units : dict of str to (str, bool)
        Unit in the cells of a column, by header, and whether each cell needs it, since the header
        of the file lacks it. The returned header contains the unit.
    lines : ndarray of int, shape (n_row,)
        Line of each row.
    cells : DataFrame, n_row rows
        Text of the cells by header.

    Raises
    ------
    InputError
        If all rows are empty.
    """
    width, where = len(headers), problems.where
    comments = [row for row in rows if _is_comment(row[1], width)]
    n_comment, n_whole = (sum(len(row[1]) == width for row in part) for part in (comments, rows))
    full = [cells for _, cells in rows if any(map(str.strip, cells))]
    if not full:
        raise problems.error("no rows below the header")
    first = next((cells for cells in full if not _is_comment(cells, width)), full[0])
    if comments and 2 * n_comment <= n_whole:  # otherwise # begins labels
        text = repr(separator.join(comments[0][1]))
        shown = f"{count(len(comments), 'comment')} such as {text}"
        problems.messages.append(f"{where}: passed over: {shown}")
        rows = [row for row in rows if not _is_comment(row[1], width)]
    rows = _without_notes(rows, width, problems)
    names, units = list(headers), dict[str, tuple[str, bool]]()
    for i, match in enumerate(map(WITH_UNIT.fullmatch, first[:width])):
        if match and (match[1] == "%" or is_unit(match[1])):
            unit = split_header(names[i])[1]
            names[i] = names[i] if unit else f"{names[i]} [{match[1]}]"
            if unit in ("", match[1]):
                units[names[i]] = match[1], not unit
    for _, cells in rows:
        while len(cells) > width and not cells[-1].strip():
            cells.pop()
    bad = [
        f"line {line}: {clipped(separator.join(cells))} has {len(cells)} cells"
        for line, cells in rows
        if len(cells) != width
    ]
    if bad:
        rule = f"expected {width} cells, as the header (separator {SEPARATORS[separator]})"
        problems.wrong.append(f"{where}, {some_of(bad, 3)}: {rule}")
        rows = [row for row in rows if len(row[1]) == width]
    frame = pd.DataFrame([cells for _, cells in rows], columns=names, dtype=str)
    return units, np.array([line for line, _ in rows], dtype=np.int64), frame


def _is_comment(cells: Sequence[str], width: int) -> bool:
    """Return whether a record is a comment: it begins with a # that is not part of a label."""
    return cells[0].lstrip().startswith("# " if len(cells) == width else "#")


def _without_notes(rows: list[Row], width: int, problems: FileError) -> list[Row]:
    """Return the rows without the notes below them: lines of text, without numbers."""
    n_row, notes = len(rows), list[str]()
    while n_row > 1:
        cells = rows[n_row - 1][1]
        words = [cell.strip() for cell in cells if cell.strip()]
        numbers = [word for word in words if any(s[2].fullmatch(word) for s in _STYLES[:2])]
        is_row = len(words) > 1 and (len(cells) >= width or numbers)
        if is_row or (words and not _NOTE.fullmatch(words[0])):
            break
        notes, n_row = [", ".join(words)] * bool(words) + notes, n_row - 1
    start = f"{problems.where}: passed over below the rows:"
    problems.messages += [f"{start} {note!r}" for note in notes]
    return rows[:n_row]


def numbers_in(
    cells: pd.DataFrame,
    units: Mapping[str, tuple[str, bool]],
    typed: Collection[str],
    problems: FileError,
    separator: str = "\t",
) -> tuple[pd.DataFrame, str]:
    """Parse text as numbers in the style that fits most cells, and report the other cells.

    Parameters
    ----------
    cells : DataFrame, n_row rows
        Text of the cells.
    units : mapping of str to (str, bool)
        Units in the cells, by header, as `body_cells` returns them.
    typed : collection of str
        Texts of a worksheet's numeric cells, which have a decimal point.
    problems : FileError
        The import, with the decimal mark and texts that mean an empty cell; collects messages and
        cells that are not numbers.
    separator : str, optional
        Separator between cells; with semicolons, programs also write decimal commas.

    Returns
    -------
    DataFrame
        Numbers; NaN for empty cells and cells that are not numbers.
    str
        Style of the numbers, for messages.
    """
    text: dict[str, pd.Series[str]] = {}
    counts: Counter[Any] = Counter()
    for name in map(str, cells):
        typed_unit, _ = units.get(name, ("", False))
        column = cells[name].str.strip(_BLANKS).str.removesuffix(typed_unit).str.strip(_BLANKS)
        column = column.str.replace("\N{MINUS SIGN}", "-")
        text[name] = column.mask(column.isin(problems.facts.empty), "")
        counts.update(text[name].value_counts(sort=False).to_dict())
    del counts[""]
    numbers = {cell: float(cell) for cell in counts if cell in typed and NUMBER.fullmatch(cell)}
    fortran = [cell for cell in counts if cell not in numbers and FORTRAN.fullmatch(cell)]
    numbers |= {cell: parse_number(cell.strip()) for cell in fortran}
    if fortran:
        problems.messages.append(
            f"{count(len(fortran), 'number')} with an exponent of Fortran's, such as "
            f"{fortran[0].strip()!r} = {numbers[fortran[0]]:g}"
        )
    rest = {cell: n for cell, n in counts.items() if cell not in numbers}
    decimal, thousands, pattern = _style_of(rest, problems, separator)
    for cell in filter(pattern.fullmatch, rest):
        numbers[cell] = float(cell.replace(thousands, "").replace(_DECIMALS[decimal], "."))
    numbers = {cell: number for cell, number in numbers.items() if math.isfinite(number)}
    rule = FINITE.replace("point", decimal)
    rules = dict.fromkeys((cell for cell in counts if cell not in numbers), rule)
    with_unit = {cell: match[1] for cell in rules if (match := WITH_UNIT.fullmatch(cell))}
    rules |= dict.fromkeys([cell for cell, unit in with_unit.items() if is_unit(unit)], _ONE_UNIT)
    if nothing := list(filter(NOTHING.fullmatch, rules)):
        rules |= dict.fromkeys(nothing, f"{rule}; --empty where such a cell is empty")
        problems.options["empty"] = "\n".join(dict.fromkeys(map(str.strip, nothing)))
    for name, column in text.items():
        broken = column.map(rules)
        for rule in broken.dropna().unique():
            problems.cells((broken == rule).to_numpy(bool), name, rule)
        typed_unit, is_needed = units.get(name, ("", False))
        if is_needed:
            is_bare = ~cells[name].str.strip(_BLANKS).str.endswith(typed_unit)
            problems.cells((is_bare & column.isin(numbers)).to_numpy(bool), name, _ONE_UNIT)
    frame = pd.DataFrame({n: column.map(numbers).astype(float) for n, column in text.items()})
    return frame, f"decimal {decimal}" + (f", {thousands!r} between thousands" if thousands else "")


def _style_of(counts: Mapping[str, int], problems: FileError, separator: str) -> Style:
    """Return the first style that fits most cells; ask the user if its mark is ambiguous."""

    def n_off(style: Style) -> int:
        return sum(n for cell, n in counts.items() if not style[2].fullmatch(cell))

    decimal = problems.facts.decimal
    styles = [style for style in _STYLES if decimal in (None, style[0])]
    style = next((s for s in styles if not n_off(s)), None) or min(styles, key=n_off)
    mark, other = (",", "point") if style[0] == "comma" else (".", "comma")
    if not decimal and not style[1] and (mark == "," or separator == ";"):
        marked = [cell for cell in counts if mark in cell and style[2].fullmatch(cell)]
        if marked and all(map(_style(other, mark)[2].fullmatch, marked)):
            problems.need(
                f"cells such as {marked[0]!r} may have a decimal {style[0]} or thousands, and no "
                "cell tells which: expected --decimal comma or point",
                decimal="?",
            )
    return style
