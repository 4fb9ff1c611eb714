"""Contact tables in files: to raw cells, and from a canonical frame."""

import hashlib
import io
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes.errors import InputError
from ridgebayes.runtime.atomic import replacing
from ridgebayes.runtime.reading import read_bytes
from ridgebayes.runtime.text import one_line_message
from ridgebayes.table.columns import NAMES
from ridgebayes.table.csv import raw_csv
from ridgebayes.table.findings import RawTable

SUFFIXES = (".csv", ".parquet")
MOST_CELLS = 10**8  # of Parquet: a small file of repeated values may hold any number of rows


def read_raw(path: Path) -> RawTable:
    """Read the cells of a CSV or Parquet file.

    Parameters
    ----------
    path : pathlib.Path
        Ends in ``.csv`` (UTF-8, comma, one header line) or ``.parquet``.

    Returns
    -------
    RawTable
        The cells, unchecked.

    Raises
    ------
    InputError
        If the suffix is unknown, the file is not there, is a folder, cannot be read, is empty, is
        not UTF-8, or has rows of another length than its header; for Parquet also if pyarrow is
        missing or refuses the file.
    """
    suffix = _suffix(path)
    with suppress(OSError):  # which is told of below
        if path.is_dir():
            raise InputError(f"{path}: is a folder, not a table file")
    content = read_bytes(path)
    return _parquet(content, str(path)) if suffix == ".parquet" else raw_csv(content, str(path))


def check_name(path: Path) -> None:
    """Refuse a name that no table can be written under, before there is one.

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
    """Write a frame as CSV or Parquet, whole or not at all.

    Parameters
    ----------
    frame : pandas.DataFrame
        What to write; the index is not.
    path : pathlib.Path
        Ends in ``.csv`` or ``.parquet``; an existing file is replaced.

    Raises
    ------
    InputError
        If the suffix is unknown, the folder does not exist, or pyarrow is missing.
    OutputError
        If the file cannot be written, such as on a full disk.
    """
    suffix = _suffix(path)
    if suffix == ".parquet":
        _pyarrow(str(path))
    with replacing(path) as part:
        if suffix == ".csv":
            frame.to_csv(part, index=False, lineterminator="\n", encoding="utf-8")
        else:
            frame.to_parquet(part, index=False, engine="pyarrow")


def frame_digest(frame: pd.DataFrame) -> str:
    """Return the SHA-256 of a canonical frame, the user's own columns in order of name.

    Parameters
    ----------
    frame : pandas.DataFrame
        Every column of the contract and any others.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    hashed = hashlib.sha256()
    for name in [*NAMES, *sorted(set(frame.columns) - set(NAMES))]:
        cells = frame[name]
        hashed.update(json.dumps([name, len(cells)]).encode())
        if cells.dtype.kind in "iuf":
            # + 0.0 makes -0.0 and 0.0 the same bytes; every NaN becomes the same NaN.
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
    try:
        import pyarrow.parquet
    except ImportError:
        raise InputError(
            f"{where}: Parquet needs pyarrow: pip install 'ridgebayes[parquet]'"
        ) from None
    return pyarrow


def _parquet(content: bytes, where: str) -> RawTable:
    pyarrow = _pyarrow(where)
    try:
        file = pyarrow.parquet.ParquetFile(io.BytesIO(content))
        width = max(len(file.schema_arrow), 1)
        # Of each group: the total that a file states may be wrong.
        groups = range(file.metadata.num_row_groups)
        n_row = sum(file.metadata.row_group(i).num_rows for i in groups)
        if n_row * width > MOST_CELLS:
            raise InputError(
                f"{where}: {n_row} rows of {width} columns; expected at most {MOST_CELLS} cells"
            )
        frame = file.read().to_pandas()
    except InputError:
        raise
    # pyarrow and pandas let out exceptions of many kinds on what is no Parquet file of a table.
    except Exception as error:
        raise InputError(
            f"{where}: not a readable Parquet file: {one_line_message(error)}"
        ) from None
    # A named index is a column that another program set apart (pandas keeps 4, 6, 8 as a range
    # outside the columns); one without a name only counts rows.
    named = [name for name in frame.index.names if name is not None]
    return RawTable(frame.reset_index(named) if named else frame, where)
