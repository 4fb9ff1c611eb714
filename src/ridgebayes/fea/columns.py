"""Reader for tables with any columns and units: CSV, TSV, text, Excel and Parquet."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes.errors import InputError
from ridgebayes.fea.convert import Converter, listed
from ridgebayes.fea.delimited import read_delimited
from ridgebayes.fea.increments import of_corners, of_counts
from ridgebayes.fea.mapping import (
    ABOVE_0,
    CORNERS,
    LOADS,
    LOWERS,
    Use,
    assign,
    check_constants,
    lacking,
)
from ridgebayes.fea.missing import ask_columns
from ridgebayes.fea.parquet import ParquetTable
from ridgebayes.fea.record import (
    SHOWN,
    FileError,
    Given,
    Imported,
    TableFile,
    broken_rule,
    provenance,
)
from ridgebayes.fea.spreadsheet import read_workbook
from ridgebayes.fea.wide import melted
from ridgebayes.fea.words import DISGUISES, MOST_DISTINCT
from ridgebayes.runtime.reading import read_bytes
from ridgebayes.runtime.text import LONGEST_VALUE, count
from ridgebayes.table.columns import RawTable
from ridgebayes.table.rules import as_text, checked, row_codes
from ridgebayes.table.table import ContactTable

SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".rpt", ".xlsx", ".parquet")
_BODY_KEYS = ("R", "D", "E")
_NEVER_EMPTY = ("a", "b", "pitch", *_BODY_KEYS)  # columns that must not have empty cells
# Columns that may have a value only in the first row of a group, as in merged cells.
_GROUP_KEYS = (*_NEVER_EMPTY, "a_over_R", "b_over_R", "nu", "offset", "offset_over_R", "thickness")


def read_columns(path: Path, facts: Given) -> Imported:
    r"""Read a table with any columns and units.

    Parameters
    ----------
    path : pathlib.Path
        A ``.csv``, ``.tsv``, ``.txt`` or ``.dat`` file (commas, semicolons, bars, tabs or blanks
        between cells), a ``.rpt`` of X-Y data, an ``.xlsx`` workbook, or a ``.parquet`` file. Title
        lines above the header and a row of units below it are recognised.
    facts : Given
        The user's options. `map` gives headers by key, in addition to recognised headers. A key is
        a contract column, ``a``, ``b``, ``pitch``, ``R``, ``D``, ``offset`` (lengths), ``E``,
        ``p``, ``p_lower`` (pressures; p is the line load over 2 R), ``line``, ``line_lower`` (line
        loads), ``force``, ``force_lower``, or ``load`` (the unit tells the kind of load). The
        header's unit (``[mm]``, ``(N/mm)``, ``, kPa``, `` / mm``) may be omitted in the mapping;
        ``header;unit`` overrides it, and ``header;1`` means no unit. A header with ``*``, such as
        ``p=Load Q=* [kPa]``, maps one column per Q, with empty cells where Q was not reached.
        Headers such as ``Q=4`` are recognised without a mapping. Increments of load-stepped runs
        have columns ``gap Q=4``, ``gap_over_R Q=4``, ``pressure Q=4`` or ``status Q=4``, or
        repeated counts. Constants are `R`, `E` and `thickness` (``"8 mm"``, or a plain number if
        no column has a unit), `nu`, the texture, and the ``[values]`` of a mapping file, which may
        hold any contract column except the load.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        If the file, the mapping or a cell breaks a rule, or a quantity is missing. The message
        lists all errors, with file, line, column, value and rule.

    Notes
    -----
    *Validity.* Units are given for all columns and values with a dimension, or for none of them; in
    the latter case they form one consistent system. A ``load`` without a unit is p/E, and is
    refused if E is given.

    *Accuracy.* Quotients with up to 14 digits are exact decimals; others have rounding errors.

    Examples
    --------
    >>> import tempfile
    >>> text = "Ridge [um],Groove [um],Q,P [N/mm]\n240,80,4,1e-3\n240,80,6,4e-3\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "mine.csv")
    ...     _ = path.write_text(text)
    ...     names = ("a=Ridge", "b=Groove", "line=P")
    ...     table = read_columns(path, Given(map=names, R="8 mm", E="60 kPa")).table
    >>> table.textures
    ((0.03, 0.01),)
    """
    mapping, values = facts.columns_and_values()
    check_constants(values, str(path))
    problems = FileError(str(path))
    source = open_table(path, facts, problems)
    uses, term = assign(source.headers, mapping, values, problems)
    problems.known = {use.name: use.typed for use in uses if use.repeat is None}
    cells = source.read({use.header for use in uses if use.is_number}, problems)
    _fill_down(cells, uses, problems)
    for use in uses:
        if use.header not in cells:
            rule = "expected numbers or text"
            raise problems.error(f"column {use.header!r}, {use.name}: {rule}")
        _check_cells(cells, use, problems)
    if needed := lacking(uses, values):
        uses = ask_columns(needed, cells, uses, values, problems)
    corners = [use for use in uses if use.Q is not None and use.key in CORNERS]
    if not corners and any(use.label is not None for use in uses):
        cells, uses = melted(cells, uses, problems)
    cells, uses = _one_series(cells, uses, problems)
    converter = Converter(cells, uses, values, facts, problems)
    rows: pd.Index[int] | None = None  # row in the file; None if rows are increments
    frame = of_corners(converter, corners) if corners else converter.rows(term)
    if not corners and len(frame):
        if "kind" not in frame and "status" not in frame and _counts_repeat(frame):
            frame = of_counts(converter, frame)
        else:
            frame = converter.finished(frame)
            rows, frame = frame.index, frame.reset_index(drop=True)
    if frame.empty or "decimal" in problems.options:  # all numbers are ambiguous
        problems.raise_all(source)
        rule = "expected Q of 4 or more in some row: fewer ridges touch at any load"
        most = cells[next(use.header for use in uses if use.key == "Q")].max()
        raise problems.error(f"Q, {count(len(cells), 'row')}, a count of {most:g} at most: {rule}")
    named = [f"{key}={text!r}" for key, text in problems.known.items() if key != text]
    shown = ", ".join([*named, *(f"{key}={value}" for key, value in values.items())])
    details = [f"sheet={facts.sheet}"] * bool(facts.sheet) + [shown[:LONGEST_VALUE]] * bool(shown)
    origin = provenance(path, "columns", *details)
    source_column: Any = origin
    if "source" in frame:
        sources = as_text(frame["source"])
        source_column = (origin + "; " + sources).where(sources != "", origin)
    frame["source"] = source_column
    lines = None if rows is None or source.lines is None else source.lines[rows]
    bodies = [use for use in uses if use.key in _BODY_KEYS and len(cells[use.header].unique()) > 1]
    del cells, converter  # for a million rows this frees 0.2 GB for the validation
    table = _validated(RawTable(frame, source.where, lines), rows, problems, source, bodies)
    Q = table.column("Q")
    n_bracket = int(np.isfinite(table.column("p_over_E_lower")).sum())
    problems.messages += [
        f"textures: {len(table.labels)}: {listed(table.labels)}",
        f"kept: {len(table)} rows, Q = {Q.min()} to {Q.max()}, {n_bracket} as brackets",
    ]
    if n_not_ok := len(table.left_out):
        problems.messages.append(f"{n_not_ok} rows whose status is not 'ok'")
    return Imported(table, tuple(problems.messages), problems.known)


def _counts_repeat(frame: pd.DataFrame) -> bool:
    """Return whether rows are increments: counts of 4 or more repeat while the load rises.

    At least a third of the rows repeat the count of the previous row, and the load rises in 80 % of
    the repeats up to the highest load of each curve.
    """
    Q, load = frame["Q"].to_numpy(), frame["p_over_E"].to_numpy()
    same = Q[1:] == Q[:-1]
    # Each count becomes a column in memory.
    if 3 * same.sum() < len(same) or not 4 <= np.nanmax(Q, initial=0) <= MOST_DISTINCT:
        return False
    curve = row_codes(*(frame[name] for name in frame if name not in ("Q", "p_over_E")))
    # A curve without loads has its highest load in the first row, and thus no increments.
    top = pd.Series(load).fillna(-np.inf).groupby(curve).transform("idxmax").to_numpy()
    same &= (curve[1:] == curve[:-1]) & (np.arange(1, len(Q)) <= top[1:])
    rising = same & (load[1:] > load[:-1])
    return bool(0 < 0.8 * same.sum() <= rising.sum())


def _fill_down(cells: pd.DataFrame, uses: Iterable[Use], problems: FileError) -> None:
    """Fill empty cells from above where a value is typed once for a group of rows.

    Cells are filled if the first row of each group has all group values (widths), and consecutive
    groups differ. Otherwise the empty cells are missing values.
    """
    there = [use.header for use in uses if use.Q is None and use.header in cells]
    groups = [use.header for use in uses if use.key in _GROUP_KEYS and use.header in there]
    widths = [name for name in groups if cells[name].dtype.kind == "f" and cells[name].isna().any()]
    if not widths:
        return
    head = cells[widths].notna()
    first, values = head.all(axis=1), cells[widths]
    follows = first & first.shift(fill_value=False)
    again = follows & (values == values.shift()).all(axis=1)
    if (head.any(axis=1) != first).any() or not first.iloc[0] or again.any():
        return
    cells[widths] = values.ffill()
    texts = [use.header for use in uses if use.key in ("series", "texture") and use.header in there]
    full = [name for name in texts if (cells[name].ne("") <= first).all()]
    for name in full:
        cells[name] = cells[name].mask(cells[name].eq("") & ~first).ffill()
    problems.messages.append(
        f"columns {', '.join(map(repr, [*widths, *full]))}: {count(int((~first).sum()), 'row')} "
        "with empty cells have the value above, as in merged cells"
    )


def _one_series(
    cells: pd.DataFrame, uses: list[Use], problems: FileError
) -> tuple[pd.DataFrame, list[Use]]:
    """Return the table with all recognised series columns joined; drop columns of row numbers."""
    series = [use for use in uses if use.key == "series" and use.how in ("guessed", "wide")]
    kept = [use for use in series if len(cells) == 1 or cells[use.header].duplicated().any()]
    for use in series:
        if use not in kept:
            problems.known.pop("series", None)
            how = f"it numbers the rows (--map 'series={use.header}' takes it)"
            problems.messages.append(f"column {use.header!r} is not taken as series: {how}")
    rest = [use for use in uses if use not in series]
    if len(kept) < 2:
        return cells, [*rest, *kept]
    name = ", ".join(use.header for use in kept)
    joined = pd.DataFrame({use.header: as_text(cells[use.header]) for use in kept})
    problems.messages.append(f"series: {name}, joined")
    joined_use = Use("series", name, how="guessed")
    return cells.assign(**{name: joined.agg(", ".join, axis=1)}), [*rest, joined_use]


def _check_cells(cells: pd.DataFrame, use: Use, problems: FileError) -> None:
    """Report the cells that break a rule of their column, and set them to NaN."""
    if use.key not in (*ABOVE_0, *LOWERS, "pressure"):
        return
    numbers = cells[use.header].to_numpy(dtype=float)
    if use.key in LOADS[1:] and len(numbers) > 1 and np.nanmax(numbers, initial=-np.inf) <= 0:
        cells[use.header] = -numbers
        problems.messages.append(
            f"column {use.header!r}: no load above 0, so compression is negative: sign turned"
        )
        return
    sign = "above 0" if use.key in ABOVE_0 else "0 or above"
    sign = "0 where open, above 0 where closed" if use.key == "pressure" else sign
    # A load of 0 is valid in increments; for other rows the table rules check the load.
    is_low = numbers <= 0 if use.key in ABOVE_0 and use.key not in LOADS else numbers < 0
    is_lost = np.isnan(numbers) & (use.key in _NEVER_EMPTY and use.Q is None)
    for rule, bad in (("not empty", is_lost), (sign, is_low)):
        problems.cells(cells.index[bad], use.header, f"expected {rule}")
    if is_low.any():
        cells[use.header] = np.where(is_low, np.nan, numbers)


def _validated(
    raw: RawTable,
    rows: "pd.Index[int] | None",
    problems: FileError,
    source: TableFile,
    bodies: Sequence[Use],
) -> ContactTable:
    """Return the table; raise all reported problems and all broken table rules."""
    frame, findings = checked(raw)
    noted = set() if rows is None else problems.rows()
    for column, rule, bad, other in findings.complaints():
        if bodies and "curve" in rule:
            name = bodies[0].header
            problems.need(
                f"rows of several bodies ({name!r}) are alike over R and E: expected a column that "
                f"tells them apart, as --map 'series={name}'",
                {"series": name, **{use.key: use.typed for use in bodies}},
            )
            continue
        if "empty" in rule and rows is not None:
            keep = np.array([int(rows[row]) not in noted for row in bad], dtype=bool)
            bad, other = bad[keep], None if other is None else other[keep]
        if not len(bad):
            continue
        rule = rule if other is None else rule.format(other=int(other[0]) + 1)
        rule += "; repeats need a label each, --map 'series=HEADER'" if "once" in rule else ""
        places = [raw.place(row).removeprefix(f"{raw.where}, ") for row in bad[:SHOWN].tolist()]
        cells = [raw.shown(row, column) for row in bad[:SHOWN].tolist()]
        spots = list(zip(places, cells, strict=True))
        problems.wrong.append(broken_rule(raw.where, column, rule, spots, len(bad)))
    problems.raise_all(source)
    return ContactTable(frame, raw.where)


def open_table(path: Path, facts: Given, problems: FileError) -> TableFile:
    """Open a table file by its suffix; macros and formulas are not executed."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(
            f"{path}: ends in {path.suffix or 'no suffix'!r}; expected one of {', '.join(SUFFIXES)}"
        )
    if facts.sheet is not None and suffix != ".xlsx":
        raise InputError(f"{path}: sheet {facts.sheet!r}: expected --sheet for .xlsx files only")
    content = read_bytes(path)
    if not content:
        raise InputError(f"{path}: the file is empty")
    for beginning, what in DISGUISES.items():
        if content.startswith(bytes.fromhex(beginning)) and what != suffix:
            raise InputError(f"{path}: the content is {what}; expected a {suffix} file")
    if suffix == ".parquet":
        return ParquetTable(path, content)
    if suffix == ".xlsx":
        return read_workbook(path, content, facts, problems)
    return read_delimited(content, facts, problems)
