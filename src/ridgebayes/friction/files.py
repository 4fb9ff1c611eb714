"""Joint draws as files: NetCDF, Parquet and CSV."""

import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from ridgebayes.errors import InputError
from ridgebayes.friction.inputs import joined
from ridgebayes.runtime.atomic import replacing
from ridgebayes.runtime.reading import extra

SUFFIXES = (".nc", ".parquet", ".csv")
LARGEST_NETCDF = 2**30  # bytes of variables: a file of HDF5 is made in memory, three times that


def check_name(path: Path) -> None:
    """Refuse a file of another kind."""
    if path.suffix not in SUFFIXES:
        raise InputError(f"{path}: expected a file of {', '.join(SUFFIXES)}")


def write_inputs(blocks: xr.Dataset | Iterable[xr.Dataset], path: str | os.PathLike[str]) -> None:
    """Write draws; those that come in blocks go to Parquet and CSV one by one.

    Parameters
    ----------
    blocks : xarray.Dataset or iterable of xarray.Dataset
        What `friction_inputs` returns, or `InputDraws.blocks` yields.
    path : str or path
        File to write, whole or not at all: .nc; .parquet or .csv, a row a draw and load (with edges
        a row an edge). Attributes go into NetCDF and into the metadata of Parquet.

    Raises
    ------
    InputError
        If the suffix is another, pyarrow is missing for Parquet, or blocks would make more than
        1 GiB of variables for NetCDF: that is made in memory.
    """
    target = Path(path)
    check_name(target)
    parts = [blocks] if isinstance(blocks, xr.Dataset) else blocks
    with replacing(target) as part:
        if target.suffix == ".nc":
            kept = parts if isinstance(parts, list) else _bounded(parts, target)
            joined(list(kept)).to_netcdf(part, engine="h5netcdf")
        elif target.suffix == ".csv":
            for i, block in enumerate(parts):
                _frame(block).to_csv(part, mode="a" if i else "w", header=not i, index=False)
        else:
            _write_parquet(parts, part)


def _bounded(parts: Iterable[xr.Dataset], path: Path) -> Iterator[xr.Dataset]:
    """Yield blocks, unless all together would be too large."""
    for block in parts:
        n, size = int(block.attrs["n_draw"]), block.nbytes / block.sizes["draw"]
        if n * size > LARGEST_NETCDF:
            rule = f"at most {LARGEST_NETCDF / size:,.0f} in NetCDF, which is made in memory"
            draws = f"{n:,} draws of {size:,.0f} bytes"
            raise InputError(f"{path}: {draws}; expected {rule}; Parquet and CSV take any number")
        yield block


def _write_parquet(parts: Iterable[xr.Dataset], path: Path) -> None:
    parquet = extra("pyarrow.parquet", "parquet", f"{path}: Parquet needs pyarrow")
    import pyarrow as pa  # heavy, and an extra

    writer: Any = None
    with ExitStack() as open_files:
        for block in parts:
            table = pa.Table.from_pandas(_frame(block), preserve_index=False)
            if writer is None:
                about = {name: str(value) for name, value in block.attrs.items()}
                schema = table.schema.with_metadata((table.schema.metadata or {}) | about)
                writer = open_files.enter_context(parquet.ParquetWriter(path, schema))
            writer.write_table(table.cast(writer.schema))


def _frame(block: xr.Dataset) -> pd.DataFrame:
    """Return a row a draw and load, or an edge of it."""
    frame = block.to_dataframe().reset_index()
    return frame[frame["edge_side"] != 0] if "edge" in block.dims else frame
