"""Import of files of all supported formats, and of tables with any columns and units."""

import os
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes.errors import InputError, expect, warn_of
from ridgebayes.fea.binary_tables import ALL, SHEET, TABLES
from ridgebayes.fea.convert import Converter, listed
from ridgebayes.fea.delimited import SUFFIXES, table_content
from ridgebayes.fea.layouts import (
    counts_repeat,
    filled_down,
    melted,
    of_corners,
    of_counts,
    one_series,
)
from ridgebayes.fea.mapping import ABOVE_0, LOADS, LOWERS, NEVER_EMPTY, Use, assign
from ridgebayes.fea.record import (
    SHOWN,
    FileError,
    Given,
    Imported,
    TableFile,
    broken_rule,
    provenance,
)
from ridgebayes.fea.words import COUNTS, NOT_READ, OPTIONS, RECOGNISED
from ridgebayes.runtime.reading import read_bytes
from ridgebayes.runtime.text import LONGEST_VALUE, count
from ridgebayes.scene.typed import parse_texture
from ridgebayes.table.columns import RawTable
from ridgebayes.table.rules import as_text, checked
from ridgebayes.table.table import ContactTable

_HEAD_BYTES = 20_000  # bytes at the beginning of a file that are searched for marks of a format
FORMATS = tuple(OPTIONS)
_MULTI_FILE_FORMATS = ("febio", "ansys", "series")


def import_table(
    *paths: str | os.PathLike[str],
    program: str | None = None,
    role: str | None = None,
    texture: tuple[float, float] | str | None = None,
    **facts: Any,
) -> ContactTable:
    """Import measured or simulated loads as a contact table, as ``ridgebayes import``.

    Parameters
    ----------
    *paths : path
        File to read, or all files of a run that has several.
    program : str, optional
        Format, such as ``table``, ``calculix`` or ``abaqus-dat`` (``--format`` of the command).
        None recognises the format.
    role : str, optional
        Role of all rows, ``calibration`` or ``held-out``.
    texture : (float, float) or str, optional
        Ridge and groove width over R, or a text such as ``"0.25 mm,0.25 mm"``.
    **facts
        Facts that the file does not contain, named as the command's options: R, E, nu, thickness
        and load_se are texts with units; map is a sequence of texts ``key=header``; further facts
        are sheet, skip_rows, decimal, deck, surface, reaction, corner, ...

    Returns
    -------
    ContactTable
        Table of transition loads.

    Raises
    ------
    InputError
        If the file cannot be read. The message lists all errors and missing facts.

    Warns
    -----
    CautionWarning
        If values look doubtful.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ridgebayes as rb
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "loads.csv")
    ...     rows = ["ridge (mm),groove (mm),Q,p (kPa)", "0.2,0.16,4,0.03", "0.2,0.16,6,0.18"]
    ...     _ = path.write_text(chr(10).join(rows))
    ...     table = rb.import_table(path, R="8 mm", E="60 kPa")
    >>> table.textures, [round(p, 6) for p in table.frame["p_over_E"]]
    (((0.025, 0.02),), [0.0005, 0.003])
    """
    for path in paths or (None,):
        expect(str, os.PathLike, paths=path)
    if isinstance(texture, str):
        texture = parse_texture(texture, facts.get("R"), "texture")
    read = import_files(
        [Path(path) for path in paths], Given(texture=texture, **facts), program=program, role=role
    )
    warn_of(read.cautions)
    return read.table


def import_files(
    paths: Sequence[Path],
    facts: Given,
    *,
    program: str | None = None,
    role: str | None = None,
) -> Imported:
    """Import a file, or the files of a run.

    Parameters
    ----------
    paths : sequence of Path
        One file; or several ``.vtu`` files in the order of their loads, or several files of an
        FEBio or ANSYS run.
    facts : Given
        Facts that the files do not contain.
    program : str or None
        One of `ridgebayes.fea.read.FORMATS`; None recognises the format.
    role : str or None
        Role of all rows; None keeps the roles of the file.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        If a file cannot be parsed, a required fact is missing, or the format does not use a fact.
    """
    path = paths[0]
    name = recognise(path) if program is None else program
    if name not in FORMATS:
        raise InputError(f"--format {name}: expected {', '.join(FORMATS)}")
    if len(paths) > 1 and name not in _MULTI_FILE_FORMATS:
        rule = f"expected one (several of {', '.join(_MULTI_FILE_FORMATS)})"
        raise InputError(f"{len(paths)} files of format {name}: {rule}")
    _check_given(name, facts)
    if name == "table":
        imported = read_columns(path, facts)
    else:
        from ridgebayes.fea.runs import read_run  # slow imports that tables do not need

        imported = read_run(name, paths, facts)
    table, messages = imported.table, (f"format: {name}", *imported.messages)
    if role is not None:
        table = ContactTable.from_frame(table.frame.assign(role=role), where=table.where)
        messages += (f"role: {role}",)
    return replace(imported, table=table, messages=messages)


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
        have columns ``status Q=4``, or repeated counts. Constants are `R`, `E` and `thickness`
        (``"8 mm"``, or a plain number if no column has a unit), `nu`, the texture, and the
        ``[values]`` of a mapping file, which may hold any contract column except the load.

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
    problems = FileError(str(path), facts, values)
    content = table_content(path, problems)
    source = TABLES[path.suffix.lower()](content, problems)
    uses, term = assign(source.headers, mapping, problems)
    problems.known = {use.name: use.typed for use in uses if use.repeat is None}
    cells = source.read({use.header for use in uses if use.is_number}, problems)
    if cells.select_dtypes("number").isna().any(axis=None):
        sheet = cells[SHEET] if facts.sheet == ALL and SHEET in cells else np.zeros(len(cells))
        parts = (part for _, part in cells.groupby(sheet, sort=False))
        cells = pd.concat([filled_down(part, uses, problems) for part in parts])
    for use in uses:
        if use.header not in cells:
            rule = "expected numbers or text"
            raise problems.error(f"column {use.header!r}, {use.name}: {rule}")
    _check_cells(cells, uses, problems)
    corners = [use for use in uses if use.Q is not None and use.key == "status"]
    if not corners and any(use.label is not None for use in uses):
        cells, uses = melted(cells, uses, problems)
    if any(use.key == "series" for use in uses):
        cells, uses = one_series(cells, uses, problems)
    converter = Converter(cells, uses, problems)
    rows: pd.Index[int] | None = None  # row in the file; None if rows are increments
    frame = of_corners(converter, corners) if corners else converter.rows(term)
    if not corners and len(frame):
        may_repeat = not {"kind", "status"} & set(frame) and (frame["Q"].diff() == 0).any()
        if may_repeat and counts_repeat(frame):
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
    doubts = tuple(converter.doubts)
    del cells, converter  # for a million rows this frees 0.2 GB for the validation
    table = _validated(RawTable(frame, source.where, lines), rows, problems, source)
    Q, labels = table.column("Q"), table.labels
    n_bracket = int(np.isfinite(table.column("p_over_E_lower")).sum())
    problems.messages += [
        f"textures: {len(labels)}: {listed(labels)}",
        f"kept: {count(len(table), 'row')}, Q = {Q.min()} to {Q.max()}, {n_bracket} as brackets",
    ]
    if n_not_ok := len(table.left_out):
        problems.messages.append(f"{count(n_not_ok, 'row')} whose status is not 'ok'")
    return Imported(table, tuple(problems.messages), problems.known, doubts)


def _check_cells(cells: pd.DataFrame, uses: Sequence[Use], problems: FileError) -> None:
    """Report the cells that break a rule of their column, and set them to NaN."""
    for use in (use for use in uses if use.key in (*ABOVE_0, *LOWERS)):
        numbers = cells[use.header].to_numpy(dtype=float)
        if use.key in LOADS[1:] and len(numbers) > 1 and np.nanmax(numbers, initial=-np.inf) <= 0:
            cells[use.header] = -numbers
            problems.messages.append(
                f"column {use.header!r}: no load above 0, so compression is negative: sign turned"
            )
            continue
        sign = "above 0" if use.key in ABOVE_0 else "0 or above"
        # A load of 0 is valid in increments; for other rows the table rules check the load.
        is_low = numbers <= 0 if use.key in ABOVE_0 and use.key not in LOADS else numbers < 0
        is_lost = np.isnan(numbers) & (use.key in NEVER_EMPTY and use.Q is None)
        for rule, bad in (("not empty", is_lost), (sign, is_low)):
            problems.cells(cells.index[bad], use.header, f"expected {rule}")
        if is_low.any():
            cells[use.header] = np.where(is_low, np.nan, numbers)


def _validated(
    raw: RawTable,
    rows: "pd.Index[int] | None",
    problems: FileError,
    source: TableFile,
) -> ContactTable:
    """Return the table; raise all reported problems and all broken table rules."""
    frame, findings = checked(raw)
    noted = set() if rows is None else problems.rows()
    for column, rule, bad, other in findings.complaints():
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
    return ContactTable(frame, raw.where, _is_valid=True)


def recognise(path: Path) -> str:
    """Recognise the format of a file.

    Parameters
    ----------
    path : pathlib.Path
        File to look at.

    Returns
    -------
    str
        One of `FORMATS`.

    Raises
    ------
    InputError
        If the file cannot be read, or its format is unsupported or unknown.
    """
    suffix, name = path.suffix.lower(), path.name.lower()
    head = read_bytes(path)[:_HEAD_BYTES]
    for kind in NOT_READ.values():
        is_marked = re.search(kind.get("mark", "(?!)").encode(), head)
        if is_marked or suffix in kind.get("suffixes", ()) or name in kind.get("names", ()):
            raise InputError(f"{path}: {kind['is']} is not read; {kind['instead']}")
    for kind in RECOGNISED:  # the first whose suffixes and mark fit
        if suffix in kind.get("suffixes", [suffix]) and re.search(kind["mark"].encode(), head):
            return str(kind["format"])
    if suffix in SUFFIXES:
        return "table"
    raise InputError(
        f"{path}: its format is not recognised; expected --format {', '.join(FORMATS)}, or a "
        f"suffix of {', '.join(SUFFIXES)}, .frd, .vtu, .pvd or .xdmf"
    )


def _check_given(name: str, facts: Given) -> None:
    for option in sorted(set(chain(*OPTIONS.values())) - set(OPTIONS[name])):
        if getattr(facts, option) != getattr(Given, option):
            typed = option.replace("_", "-")
            raise InputError(f"--{typed}: not used by format {name}; remove it")
    if facts.decimal not in (None, "point", "comma"):
        raise InputError(f"--decimal {facts.decimal}: expected point, comma")
    if facts.count_is not in (None, *COUNTS):
        raise InputError(f"--count-is {facts.count_is}: expected {', '.join(sorted(COUNTS))}")
