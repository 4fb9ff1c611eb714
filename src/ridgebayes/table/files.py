"""Reading of contact tables into unchecked cells, and writing of canonical frames."""

import csv
import hashlib
import io
import json
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import IntArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.atomic import replacing
from ridgebayes.runtime.reading import decoded, extra, read_bytes, refusing
from ridgebayes.runtime.text import clipped
from ridgebayes.table.columns import COLUMNS, SHOWN, Column, RawTable, check_header, listed

SUFFIXES = (".csv", ".parquet")
MOST_CELLS = 100_000_000  # in a Parquet file, where few bytes can hold any number of equal rows


def raw_cells(
    source: object, where: str, record: str, contract: Sequence[Column] = COLUMNS
) -> RawTable:
    """Return the cells of a data frame or file; other sources raise InputError with `record`."""
    if isinstance(source, pd.DataFrame):
        return RawTable(source.copy(), where)
    if isinstance(source, str | os.PathLike):
        return read_raw(Path(source), contract)
    raise InputError(
        f"{where}: expected a path, a {record} or a pandas.DataFrame, got {type(source).__name__}"
    )


def read_raw(path: Path, contract: Sequence[Column] = COLUMNS) -> RawTable:
    """Read the cells of a CSV or Parquet file.

    Parameters
    ----------
    path : pathlib.Path
        Path ending in ``.csv`` (UTF-8, comma, one header line) or ``.parquet``.
    contract : sequence of Column, optional
        Column definitions; those of a contact table if not given.

    Returns
    -------
    RawTable
        Unchecked cells.

    Raises
    ------
    InputError
        If the suffix is unknown, the file does not exist, is a folder, cannot be read, is empty,
        is not UTF-8, or has rows of another length than its header; for Parquet also if pyarrow is
        missing or cannot read the file.
    """
    suffix, where = _suffix(path), str(path)
    if os.path.isdir(path):  # noqa: PTH112, as `Path.is_dir` fails on a name that is too long
        raise InputError(f"{path}: is a folder, not a table file")
    content = read_bytes(path)
    return _parquet(content, where) if suffix == ".parquet" else raw_csv(content, where, contract)


def check_name(path: Path) -> None:
    """Check early that a table can be written under a name.

    Parameters
    ----------
    path : pathlib.Path
        File to write later.

    Raises
    ------
    InputError
        If the suffix is unknown, or pyarrow is missing for Parquet.
    """
    if _suffix(path) == ".parquet":
        _pyarrow(str(path))


def write_frame(frame: pd.DataFrame, path: Path) -> None:
    """Write a frame as CSV or Parquet, atomically.

    Parameters
    ----------
    frame : pandas.DataFrame
        Table to write, without its index.
    path : pathlib.Path
        Path ending in ``.csv`` or ``.parquet``; an existing file is overwritten.

    Raises
    ------
    InputError
        If the suffix is unknown, the folder does not exist, or pyarrow is missing.
    OutputError
        If the file cannot be written, for instance because the disk is full.
    """
    check_name(path)
    with replacing(path) as part:
        if path.suffix.lower() == ".csv":
            frame.to_csv(part, index=False, lineterminator="\n", encoding="utf-8")
        else:
            frame.to_parquet(part, index=False, engine="pyarrow")


def frame_digest(frame: pd.DataFrame, contract: Sequence[Column] = COLUMNS) -> str:
    """Return the SHA-256 of a canonical frame, with additional columns sorted by name.

    Parameters
    ----------
    frame : pandas.DataFrame
        Every column of the contract, and additional columns.
    contract : sequence of Column, optional
        Column definitions; those of a contact table if not given.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    hashed = hashlib.sha256()
    names = [column.name for column in contract]
    for name in [*names, *sorted(set(frame.columns) - set(names))]:
        cells = frame[name]
        hashed.update(json.dumps([name, len(cells)]).encode())
        if cells.dtype.kind in "iuf":
            # + 0.0 gives -0.0 the bytes of 0.0, and all NaN become the same NaN.
            values = cells.to_numpy(dtype=np.float64, na_value=np.nan) + 0.0
            hashed.update(np.where(np.isnan(values), np.nan, values).astype("<f8").tobytes())
        else:
            codes, distinct = pd.factorize(cells.astype(str))
            hashed.update(json.dumps(list(distinct)).encode())
            hashed.update(codes.astype("<i8").tobytes())
    return hashed.hexdigest()


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(
            f"{path}: a table file ends in .csv or .parquet, not {path.suffix or 'no suffix'!r}"
        )
    return suffix


def _pyarrow(where: str) -> Any:
    return extra("pyarrow.parquet", "parquet", f"{where}: Parquet needs pyarrow")


def read_arrow(content: bytes, where: str) -> Any:
    """Read a Parquet file into pyarrow's table, after a check of its size.

    Parameters
    ----------
    content : bytes
        Content of the file.
    where : str
        Name for messages.

    Returns
    -------
    pyarrow.Table

    Raises
    ------
    InputError
        If pyarrow is missing or cannot read the file, or it holds over 10^8 cells.
    """
    parquet = _pyarrow(where)
    # pyarrow raises exceptions of many types for a damaged file.
    with refusing(f"{where}: not a readable Parquet file"):
        file = parquet.ParquetFile(io.BytesIO(content))
        width = max(len(file.schema_arrow), 1)
        # Rows are counted by group, because the total stated by the file may be wrong.
        groups = range(file.metadata.num_row_groups)
        n_row = sum(file.metadata.row_group(i).num_rows for i in groups)
        if fits := n_row * width <= MOST_CELLS:
            table = file.read()
            table.validate(full=True)
    if not fits:
        raise InputError(
            f"{where}: {n_row} rows of {width} columns; expected at most {MOST_CELLS} cells"
        )
    return table


def _parquet(content: bytes, where: str) -> RawTable:
    table = read_arrow(content, where)
    with refusing(f"{where}: not a readable Parquet file"):  # pandas may fail to convert it
        frame = table.to_pandas()
    # A named index is a column (pandas keeps 4, 6, 8 as a range outside the columns). An index
    # without a name only counts rows.
    named = [name for name in frame.index.names if name is not None]
    return RawTable(frame.reset_index(named) if named else frame, where)


# Text that can become a number without loss: "007", "+1" and longer numbers stay text.
_PLAIN_NUMBER = r"-?(?:0|[1-9]\d{0,15})(?:\.\d+)?(?:[eE][+-]?\d{1,3})?|"


def raw_csv(content: bytes, where: str, contract: Sequence[Column] = COLUMNS) -> RawTable:
    """Read the cells of a CSV file.

    Parameters
    ----------
    content : bytes
        UTF-8 with or without a byte-order mark, commas and one header line. Blank lines are
        skipped.
    where : str
        Name for messages.
    contract : sequence of Column, optional
        Column definitions; those of a contact table if not given.

    Returns
    -------
    RawTable
        Unchecked cells; additional columns of numbers only are converted to numbers.

    Raises
    ------
    InputError
        If the bytes are not UTF-8, contain a NUL, or are empty; if a column is missing or occurs
        twice; if a quote is not closed, or a row has another number of cells than the header.
    """
    text = decoded(content, where)
    if not text.strip():
        raise InputError(f"{where}: the file is empty")
    cells = records(text, where)
    header = next(cells)[1]
    # The header is checked first: with another separator every row would look ragged.
    check_header(header, where, contract)
    even = even_lines(text, ",", len(header))
    if even is None:
        rows = list(cells)
        frame = pd.DataFrame(_whole_rows(rows, header, where), columns=header, dtype=str)
        lines = np.array([line for line, _ in rows], dtype=np.int64)
    else:  # pandas needs two thirds of the time and memory, for tables of a million rows
        options: dict[str, Any] = {"header": 0, "dtype": str, "keep_default_na": False}
        frame, lines = pd.read_csv(io.StringIO(text), names=header, **options), even[1:] + 1
    extra_names = set(header) - {column.name for column in contract}
    numbers = {name: lossless(frame[name]) for name in extra_names}
    return RawTable(frame.assign(**numbers), where, lines)


def even_lines(text: str, separator: str, n_column: int) -> IntArray | None:
    """Return the lines, from 0, that are not empty, or None if cells are quoted or rows ragged."""
    code = np.frombuffer(f"{text}\n".encode(), dtype=np.uint8)
    ends, marks = (np.flatnonzero(code == ord(mark)) for mark in ("\n", separator))
    n_mark = np.diff(np.searchsorted(marks, ends), prepend=0)
    is_row = np.diff(ends, prepend=-1) > 1
    is_even = '"' not in text and (n_mark[is_row] == n_column - 1).all()
    return np.flatnonzero(is_row) if is_even else None


def records(text: str, where: str, separator: str = ",") -> Iterator[tuple[int, list[str]]]:
    """Yield the line number and cells of each record that is not blank, header first.

    Raises
    ------
    InputError
        If a quote is not closed or occurs inside a cell.
    """
    lines = (match[0] for match in re.finditer(r"[^\n]*\n|[^\n]+", text))  # without a copy
    reader = csv.reader(lines, delimiter=separator, strict=True)
    before = 0
    try:
        for cells in reader:
            if len(cells) > 1 or (cells and cells[0].strip()):
                yield before + 1, cells
            before = reader.line_num
    except csv.Error as error:
        raise InputError(f"{where}, line {before + 1}: not CSV: {error}") from None


def _whole_rows(
    rows: list[tuple[int, list[str]]], header: list[str], where: str
) -> list[list[str]]:
    """Return the cells of rows; refuse rows of another length than the header."""
    width, columns = len(header), [*header, f"beyond {header[-1]}"]
    bad = [(i, *row) for i, row in enumerate(rows, start=1) if len(row[1]) != width]
    if bad:
        lines = [
            f"{where}, row {row} (line {line}): column {columns[min(len(cells), width)]}: "
            f"{clipped(','.join(cells))}: must have {width} cells as the header, has {len(cells)}"
            for row, line, cells in bad[:SHOWN]
        ]
        raise InputError(listed(where, lines, len(bad), len(bad)))
    return [cells for _, cells in rows]


def lossless(cells: "pd.Series[str]") -> "pd.Series[str] | pd.Series[float]":
    """Return a column of text as numbers, if every cell can be converted without loss.

    Examples
    --------
    >>> lossless(pd.Series(["1", ""])).tolist(), lossless(pd.Series(["007"])).tolist()
    ([1.0, nan], ['007'])
    """
    codes, words = pd.factorize(cells)  # each distinct text is converted once
    empty = words == ""
    if empty.all() or not words.str.fullmatch(_PLAIN_NUMBER).all():
        return cells
    whole = not empty.any() and words.str.fullmatch(r"-?\d+").all()
    values = words.where(~empty, "nan").to_numpy(dtype=object).astype(int if whole else float)
    return cells if np.isinf(values).any() else pd.Series(values[codes], index=cells.index)
