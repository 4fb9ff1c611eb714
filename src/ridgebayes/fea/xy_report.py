"""X-Y reports of Abaqus/Viewer."""

import re
from pathlib import Path

import numpy as np
import pandas as pd

from ridgebayes.errors import InputError
from ridgebayes.fea.lines import DASHES, GAP, Line, read_lines

_BEGINS = "+-.0123456789"


def read_xy(path: Path) -> pd.DataFrame:
    """Read an X-Y report.

    Parameters
    ----------
    path : pathlib.Path
        A header, ``X`` and the curves' names, on one line or wrapped over several, then rows of
        numbers set in columns by blanks. Several tables with the same X become one.

    Returns
    -------
    DataFrame
        A column of float for each curve, ``X`` first; the index, ``line``, is that of the file.

    Raises
    ------
    InputError
        With the line, if the header has another number of columns than the rows, a name stands
        twice, a cell is no number, or there are no rows.
    """
    tables: list[tuple[list[str], dict[int, list[float]]]] = []  # names, and rows by line
    header: list[str] = []
    closed = False  # whether a blank line came below the header
    for line in read_lines(path, unfinished=True):
        text = line.text
        if not text.strip() or DASHES.match(text):
            closed = True
        elif text.lstrip()[0] not in _BEGINS:
            # Names; or what stands below the rows, such as a minimum, which no rows follow.
            header, closed = [text] if closed else [*header, text], False
        else:
            if header:
                tables.append((_columns(line, header), {}))
                header = []
            if not tables:
                raise line.error("numbers before a header; expected X and names")
            (names, rows), words = tables[-1], line.words
            if len(words) != len(names):
                raise line.error(
                    f"{len(words)} values; expected {len(names)} as in the header, with decimal "
                    "points"
                )
            rows[line.number] = [line.finite(word) for word in words]
    if not tables:
        raise InputError(f"{path}: no rows; expected a header, X and names, and rows of numbers")
    frame, *others = (
        pd.DataFrame.from_dict(rows, orient="index", columns=names) for names, rows in tables
    )
    for one in others:
        line = Line(path, one.index[0], "")
        if not np.array_equal(one.iloc[:, 0], frame.iloc[:, 0]):
            raise line.error("another X; expected tables of the same X")
        if twice := set(one.columns[1:]) & set(frame.columns):
            raise line.error(f"{min(twice)!r} again; expected each name once")
        frame = frame.assign(**{name: one[name].to_numpy() for name in one.columns[1:]})
    return frame.rename_axis("line")


def _columns(line: Line, header: list[str]) -> list[str]:
    """Return the names above a row: they hold single blanks, and may be wrapped over lines."""
    last, n = header[-1].strip(), len(line.words)
    names = GAP.split(last)
    names = names if len(names) == n else last.split()
    if len(header) > 1 or len(names) != n:
        names = _wrapped(header, line.text)
    if len(names) != n or not all(names):
        raise line.error(
            f"{n} values below the names {', '.join(map(repr, names))}; expected as many names"
        )
    if len(set(names)) < n:
        twice = next(name for name in names if names.count(name) > 1)
        raise line.error(f"{twice!r} again in the header; expected each name once")
    return names


def _wrapped(header: list[str], row: str) -> list[str]:
    """Return names over several lines: each piece belongs to the number next to it."""
    middles = [(m.start() + m.end()) / 2 for m in re.finditer(r"\S+", row)]
    names: list[list[str]] = [[] for _ in middles]
    for line in header:
        for piece in re.finditer(r"\S+(?: \S+)*", line):
            middle = (piece.start() + piece.end()) / 2
            names[int(np.argmin([abs(middle - one) for one in middles]))].append(piece[0])
    return [" ".join(pieces) for pieces in names]
