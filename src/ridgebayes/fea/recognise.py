"""Which format a file has: by its name, and by how it begins."""

from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import read_bytes

FORMATS = ("table", "calculix", "calculix-contact", "abaqus-dat", "abaqus-rpt", "series")
_TABLES = (".csv", ".tsv", ".txt", ".xlsx", ".parquet", ".rpt")
_LOOKED_AT = 20_000  # bytes


def recognise(path: Path) -> str:
    """Return the format of a file.

    Parameters
    ----------
    path : pathlib.Path
        The file.

    Returns
    -------
    str
        One of `FORMATS`.

    Raises
    ------
    InputError
        If it cannot be read, or is none that is known.
    """
    suffix = path.suffix.lower()
    content = read_bytes(path)
    head = content[:_LOOKED_AT]
    if suffix in (".vtu", ".xdmf", ".xmf"):
        return "series"
    if b"Field Output Report" in head:
        return "abaqus-rpt"
    if suffix == ".dat":
        if b"THE FOLLOWING TABLE IS PRINTED" in head or b"A B A Q U S" in head or b"Abaqus" in head:
            return "abaqus-dat"
        if b"displacements (" in head or b"contact stress (" in head or b") for set " in head:
            # Contact stresses alone tell which faces carry; displacements tell more.
            return "calculix" if b"displacements (" in content else "calculix-contact"
    if suffix in _TABLES:
        return "table"
    raise InputError(
        f"{path}: its format is not recognised; expected --format {', '.join(FORMATS)}, or a "
        "suffix "
        f"of {', '.join(_TABLES)}, .dat, .rpt, .vtu or .xdmf"
    )
