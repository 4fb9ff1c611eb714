"""Parquet files as cells, through pyarrow and nothing else."""

import io
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes.errors import InputError
from ridgebayes.fea.cells import FINITE, Cells, Source, clean_headers
from ridgebayes.fea.record import refusing

MOST_CELLS = 10**8  # a small file of repeated values may hold any number of rows


class ParquetTable(Source):
    """A Parquet file.

    Parameters
    ----------
    path : pathlib.Path
        Its name, for messages.
    content : bytes
        All of it.

    Raises
    ------
    InputError
        If pyarrow is missing or refuses the file, or it has too many rows.
    """

    def __init__(self, path: Path, content: bytes) -> None:
        self.where = str(path)
        try:
            # An extra, and slow to load.
            import pyarrow
            import pyarrow.parquet
        except ImportError:
            raise InputError(
                f"{self.where}: Parquet needs pyarrow: pip install 'ridgebayes[parquet]'"
            ) from None
        self._types = pyarrow.types
        # pyarrow lets out exceptions of many kinds on what is no Parquet file.
        with refusing(f"{self.where}: not a readable Parquet file", most=200):
            file = pyarrow.parquet.ParquetFile(io.BytesIO(content))
            groups = range(file.metadata.num_row_groups)
            n_row = sum(file.metadata.row_group(i).num_rows for i in groups)
            if n_row * max(len(file.schema_arrow), 1) > MOST_CELLS:
                raise InputError(
                    f"{self.where}: {n_row} rows of {len(file.schema_arrow)} columns; expected at "
                    f"most {MOST_CELLS} cells"
                )
            self._table = file.read()
            self._table.validate(full=True)

        self.headers = clean_headers(self._table.column_names, self.where)
        if not self._table.num_rows:
            raise InputError(f"{self.where}: no rows")

    def read(self, numeric: Collection[str]) -> Cells:
        """Read all rows, the columns of these headers as numbers."""
        wanted = set(numeric)
        messages = [f"{self.where}: Parquet, {self._table.num_rows} rows"]
        columns: dict[str, Any] = {}
        for name, column in zip(self.headers, self._table.columns, strict=True):
            with refusing(f"{self.where}, column {name!r}", most=200):
                values = self._values(name, column, name in wanted)
            if values is None:
                messages.append(f"column {name!r} ignored: its type is {column.type}")
            else:
                columns[name] = values
        cells = Cells.of(self, pd.DataFrame(columns), *messages)
        cells.check(
            *((np.isinf(cells.frame[n].to_numpy()), n, FINITE) for n in self.headers if n in wanted)
        )
        return cells

    def place(self, row: int, name: str) -> str:
        """Return words for a cell."""
        return f"{self.where}, row {row + 1}"

    def typed(self, wanted: Sequence[tuple[int, str]]) -> list[str]:
        """Return cells as text."""
        return [str(self._table.column(self.headers.index(n))[row].as_py()) for row, n in wanted]

    def _values(self, name: str, column: Any, is_number: bool) -> Any:
        types, kind = self._types, column.type
        if types.is_dictionary(kind):
            column = column.cast(kind.value_type)
            kind = column.type
        if types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind):
            if is_number or not types.is_integer(kind) or column.null_count:
                return column.cast("float64", safe=False).to_numpy().astype(np.float64)
            return column.to_numpy()
        if is_number and not types.is_null(kind):
            raise InputError(f"{self.where}, column {name!r}: holds {kind}: expected numbers")
        if types.is_null(kind):
            return np.full(len(column), np.nan) if is_number else [""] * len(column)
        if types.is_string(kind) or types.is_large_string(kind):
            return column.to_pandas().fillna("").astype(str)
        if types.is_boolean(kind) or types.is_temporal(kind):
            return pd.Series(["" if one is None else str(one) for one in column.to_pylist()])
        return None
