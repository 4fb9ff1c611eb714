"""Write joint draws to NetCDF, Parquet and CSV files."""

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
from ridgebayes.runtime.reading import LARGEST, extra

SUFFIXES = (".nc", ".parquet", ".csv")


def check_name(path: Path) -> None:
    """Refuse a file name with another suffix."""
    if path.suffix not in SUFFIXES:
        raise InputError(f"{path}: expected a file of {', '.join(SUFFIXES)}")


def write_inputs(blocks: xr.Dataset | Iterable[xr.Dataset], path: str | os.PathLike[str]) -> None:
    """Write draws to a file; blocks are written to Parquet and CSV one by one.

    Parameters
    ----------
    blocks : xarray.Dataset or iterable of xarray.Dataset
        Draws from `friction_inputs`, or blocks from `InputDraws.blocks`.
    path : str or path
        File to write, atomically: .nc, or .parquet or .csv with one row per draw and load (with
        edges, one row per edge). NetCDF files and the metadata of Parquet have the attributes.

    Raises
    ------
    InputError
        If the suffix is not supported, pyarrow is missing for Parquet, or the variables of a NetCDF
        file, which is built in memory, would take over 2 GiB.
    """
    target = Path(path)
    check_name(target)
    parts = [blocks] if isinstance(blocks, xr.Dataset) else blocks
    with replacing(target) as part:
        if target.suffix == ".nc":
            kept = parts if isinstance(parts, list) else _limited(parts, target)
            joined(list(kept)).to_netcdf(part, engine="h5netcdf")
        elif target.suffix == ".csv":
            for i, block in enumerate(parts):
                _frame(block).to_csv(part, mode="a" if i else "w", header=not i, index=False)
        else:
            _write_parquet(parts, part)


def _limited(parts: Iterable[xr.Dataset], path: Path) -> Iterator[xr.Dataset]:
    """Yield blocks, and refuse draws that are too large together."""
    for block in parts:
        n, size = int(block.attrs["n_draw"]), block.nbytes / block.sizes["draw"]
        most = LARGEST // (3 * size)  # an HDF5 file takes three times as much memory as its data
        if n > most:
            rule = f"at most {most:,.0f} in NetCDF, which is made in memory"
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
    """Return a table with one row per draw and load, or per edge."""
    frame = block.to_dataframe().reset_index()
    return frame[frame["edge_side"] != 0] if "edge" in block.dims else frame
