"""Tables of any columns and units: CSV, TSV, Excel and Parquet to contact tables."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from ridgebayes.errors import InputError
from ridgebayes.fea.cells import Source
from ridgebayes.fea.delimited import DelimitedText
from ridgebayes.fea.interpret import ColumnInterpreter, listed
from ridgebayes.fea.mapping import CORNERS, Use, assign, check_constants
from ridgebayes.fea.parquet import ParquetTable
from ridgebayes.fea.record import Imported, provenance
from ridgebayes.fea.spreadsheet import Spreadsheet
from ridgebayes.fea.xy_report import read_xy
from ridgebayes.runtime.reading import read_bytes
from ridgebayes.table.columns import NAMES, RawTable
from ridgebayes.table.rules import as_text
from ridgebayes.table.table import ContactTable

SUFFIXES = (".csv", ".tsv", ".txt", ".rpt", ".xlsx", ".parquet")
_LONGEST = 300  # characters of the mapping in `source`
_NONE: Mapping[str, str] = MappingProxyType({})
_DISGUISED = (
    *((bytes([0x80, version]), "a pickle") for version in range(2, 6)),
    (b"\x1f\x8b", "compressed by gzip"),
    (b"\xd0\xcf\x11\xe0", "an Excel file before 2007, or one with a password"),
    (b"\x93NUMPY", "a NumPy file"),
    (b"\x89HDF", "an HDF5 file"),
)
_OLD = (".xls", ".xlsm", ".xlsb", ".xltm", ".xlam")


def read_columns(
    path: Path,
    mapping: Mapping[str, str] = _NONE,
    *,
    values: Mapping[str, str | float] = _NONE,
    sheet: str | None = None,
    brackets: bool = False,
) -> Imported:
    r"""Read a table of any columns.

    Parameters
    ----------
    path : pathlib.Path
        A ``.csv``, ``.tsv`` or ``.txt`` file (UTF-8; commas, semicolons or tabs), a ``.rpt`` of
        X-Y data, an ``.xlsx`` workbook, or a ``.parquet`` file. One header line.
    mapping : mapping of str to str
        What to which header: a column of the contract, or ``a``, ``b``, ``R``, ``offset``
        (lengths), ``E``, ``p``, ``p_lower`` (pressures; p is the line load over 2 R), ``line``,
        ``line_lower`` (line loads), or ``load`` (one of these by its unit). The header's unit
        (``[mm]``, ``(N/mm)``, ``, kPa``, `` / mm``) may be left out; ``header;unit`` gives one,
        ``header;1`` says that there is none. A header with ``*``, as ``p=Load Q=* [kPa]``, is
        one column for each Q, empty where Q was not reached; so are, unasked, headers such as
        ``Q=4``. Increments of load-stepped runs have ``gap Q=4``, ``gap_over_R Q=4``,
        ``pressure Q=4`` or ``status Q=4``. Contract columns without a mapping keep their
        meaning; with no mapping at all, well-known words are guessed.
    values : mapping of str to str or float
        Constants: ``R`` and ``E`` (``"8 mm"``, or a plain number where no column has a unit), and
        all but the load among the contract's columns.
    sheet : str or None
        Worksheet; None takes the only one with cells.
    brackets : bool, optional
        For increments, as `ridgebayes.fea.transitions.transitions_of`.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        If the file, the mapping or a cell breaks a rule; with file, line, column, value and rule.

    Notes
    -----
    *Validity.* Every column and value with a dimension has a unit, or none has and they are one
    consistent system. A bare ``load`` without a unit is p/E, and refused beside an E.

    *Accuracy.* Units are exact, and so are quotients of up to 10,000 distinct decimals.

    Examples
    --------
    >>> import tempfile
    >>> text = "Ridge [um],Groove [um],Q,P [N/mm]\n240,80,4,1e-3\n240,80,6,4e-3\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "mine.csv")
    ...     _ = path.write_text(text)
    ...     mapping = {"a": "Ridge", "b": "Groove", "line": "P"}
    ...     found = read_columns(path, mapping, values={"R": "8 mm", "E": "60 kPa"})
    >>> found.table.textures
    ((0.03, 0.01),)
    """
    check_constants(values, str(path))
    source = _source(path, sheet)
    where = source.where
    uses = assign(source.headers, mapping, values, where)
    corners = [use for use in uses if use.Q is not None and use.key in CORNERS]
    cells = source.read({use.header for use in uses if use.is_number})
    for use in uses:
        if use.header not in cells.frame:
            raise InputError(
                f"{where}, column {use.header!r}, {use.name}: expected numbers or text"
            )
    interpreter = ColumnInterpreter(cells, uses, values, is_history=bool(corners))
    if corners:
        frame, lines, messages = interpreter.history(corners, brackets=brackets)
    elif any(use.Q is not None for use in uses):
        frame, lines, messages = interpreter.wide()
    else:
        frame, lines, messages = interpreter.long()
    details = (sheet and f"sheet={sheet}", _mapping_text(interpreter.used, values))
    origin = provenance(path, "columns", *(text for text in details if text))
    if "source" in frame:
        own = as_text(frame["source"])
        frame["source"] = (origin + "; " + own).where(own != "", origin)
    else:
        frame["source"] = origin
    ordered = [name for name in NAMES if name in frame]
    frame = frame[[*ordered, *(name for name in frame if name not in ordered)]]
    messages = [*cells.messages, *interpreter.messages, *messages]
    del cells, interpreter, source  # of a million rows: 0.2 GB that validating needs
    line = None if lines is None else lambda row: int(lines[row])
    table = ContactTable._validated(RawTable(frame, where, line))
    return Imported(table, (*messages, *_kept(table)))


def _mapping_text(uses: Iterable[Use], values: Mapping[str, str | float]) -> str:
    """Return the mapping on one line, of many columns for each Q the first."""
    own = [use for use in uses if use.name != use.header or use.unit is not None]
    first: dict[tuple[str, bool], list[Use]] = {}
    for use in own:
        first.setdefault((use.key, use.Q is None), []).append(use)
    shown = [
        str(some[0]) + (f" and {len(some) - 1} more" if len(some) > 1 else "")
        for some in first.values()
    ]
    text = ", ".join([*shown, *(f"{key}={value}" for key, value in values.items())])
    # It stands in every row.
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def _source(path: Path, sheet: str | None) -> Source:
    """Return the file, by its suffix; nothing in it is run."""
    suffix = path.suffix.lower()
    if suffix in _OLD:
        raise InputError(f"{path}: {suffix} may hold macros and is not read; save as .xlsx")
    if suffix not in SUFFIXES:
        raise InputError(
            f"{path}: ends in {path.suffix or 'no suffix'!r}; expected one of {', '.join(SUFFIXES)}"
        )
    if sheet is not None and suffix != ".xlsx":
        raise InputError(f"{path}: sheet {sheet!r}: expected --sheet for .xlsx files only")
    content = read_bytes(path)
    for beginning, what in _DISGUISED:
        if content.startswith(beginning):
            raise InputError(f"{path}: the content is {what}; expected a {suffix} file")
    if not content:
        raise InputError(f"{path}: the file is empty")
    for beginning, what in ((b"PK\x03\x04", ".xlsx"), (b"PAR1", ".parquet")):
        if content.startswith(beginning) != (suffix == what):
            is_it = "begins as" if content.startswith(beginning) else "does not begin as"
            raise InputError(
                f"{path}: {is_it} a {what} file; expected a suffix that tells the format"
            )
    if suffix == ".xlsx":
        return Spreadsheet(path, content, sheet)
    if suffix == ".parquet":
        return ParquetTable(path, content)
    if suffix == ".rpt":
        content = read_xy(path).to_csv(index=False).encode()
    return DelimitedText(path, content)


def _kept(table: ContactTable) -> list[str]:
    labels = table.labels
    n_bracket = int(np.isfinite(table.column("p_over_E_lower")).sum())
    Q = table.column("Q")
    messages = [
        f"textures: {len(labels)}: {listed(labels)}",
        f"kept: {len(table)} rows, Q = {Q.min()} to {Q.max()}, {n_bracket} as brackets",
    ]
    n_not_ok = len(table.left_out)
    return [*messages, f"{n_not_ok} rows whose status is not 'ok'"] if n_not_ok else messages
