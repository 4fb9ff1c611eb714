"""Separators between the cells of a text file, and the encoding of its bytes."""

import codecs
import re
from collections import Counter
from itertools import islice

from ridgebayes.errors import InputError
from ridgebayes.fea.layout import LOOKED_AT
from ridgebayes.fea.problems import FileError
from ridgebayes.runtime.reading import decoded
from ridgebayes.runtime.text import clipped
from ridgebayes.table.files import records

SEPARATORS = {"\t": "tab", ";": "';'", "|": "'|'", ",": "','"}
_TOUCH = re.compile(r"(?<=[\d.])(?=[-+]\d*\.\d)")  # where a number begins within a word
_REMARK = ("#", "%")


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
        "\t".join(row.split()) if len(row.split()) == width else as_is
        for row, as_is in zip(rows, lines, strict=True)
    )


def separated(text: str, where: str, problems: FileError) -> tuple[str, str]:
    """Return the text and its separator: the one by which most first records are equally wide.

    Tab goes before semicolon, bar and comma: a comma may stand within cells of the others. Text in
    columns with blanks between gets tabs.
    """
    best, n_record, failed = (0, ""), 0, None
    for separator in SEPARATORS:
        try:
            some = islice(records(text, where, separator), LOOKED_AT)
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
