"""Reader for Parquet tables, through pyarrow."""

from collections.abc import Collection
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes.errors import InputError
from ridgebayes.fea.cells import FINITE
from ridgebayes.fea.delimited import clean_headers, filled
from ridgebayes.fea.record import FileError, TableFile
from ridgebayes.runtime.reading import refusing
from ridgebayes.table.files import read_arrow


class ParquetTable(TableFile):
    """A Parquet file.

    Parameters
    ----------
    path : pathlib.Path
        Path of the file, for messages.
    content : bytes
        Content of the file.

    Raises
    ------
    InputError
        If pyarrow is missing or refuses the file, or the file has no rows or too many rows.
    """

    def __init__(self, path: Path, content: bytes) -> None:
        self.where, self.lines = str(path), None
        self._table = read_arrow(content, self.where)
        self.headers = clean_headers(self._table.column_names, self.where)
        if not self._table.num_rows:
            raise InputError(f"{self.where}: no rows")

    def read(self, numeric: Collection[str], problems: FileError) -> pd.DataFrame:
        """Read all rows, `numeric` columns as numbers; report cells that are not finite."""
        problems.messages.append(f"{self.where}: Parquet, {self._table.num_rows} rows")
        columns: dict[str, Any] = {}
        for name, column in zip(self.headers, self._table.columns, strict=True):
            with refusing(f"{self.where}, column {name!r}", most=200):
                values = self._values(name, column, name in numeric)
            if values is None:
                problems.messages.append(f"column {name!r} ignored: its type is {column.type}")
            else:
                columns[name] = values
        for name in set(numeric) & columns.keys():
            problems.cells(np.isinf(columns[name]), name, FINITE)
            columns[name] = np.where(np.isinf(columns[name]), np.nan, columns[name])
        return filled(pd.DataFrame(columns), problems)

    def cell(self, row: int, name: str) -> tuple[str, str]:
        """Return the place and the text of a cell."""
        column = self._table.column(self.headers.index(name))
        return f"row {row + 1}", str(column[row].as_py())

    def _values(self, name: str, column: Any, is_number: bool) -> Any:
        types: Any = import_module("pyarrow.types")
        if types.is_dictionary(column.type):
            column = column.cast(column.type.value_type)
        kind = column.type
        if types.is_integer(kind) and not column.null_count and not is_number:
            return column.to_numpy()
        if types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind):
            return column.cast("float64", safe=False).to_numpy()
        if is_number and not types.is_null(kind):
            raise InputError(f"{self.where}, column {name!r}: holds {kind}: expected numbers")
        if types.is_null(kind):
            return np.full(len(column), np.nan) if is_number else [""] * len(column)
        if types.is_string(kind) or types.is_large_string(kind):
            return column.to_pandas().fillna("").astype(str)
        if types.is_boolean(kind) or types.is_temporal(kind):
            return pd.Series(["" if value is None else str(value) for value in column.to_pylist()])
        return None
