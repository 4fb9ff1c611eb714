"""Import of files of all supported formats as a contact table."""

import os
import re
import warnings
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

from ridgebayes.errors import CautionWarning, InputError
from ridgebayes.fea import ansys, febio
from ridgebayes.fea.columns import SUFFIXES, read_columns
from ridgebayes.fea.record import Given, Imported
from ridgebayes.fea.runs import read_run
from ridgebayes.fea.words import COUNTS, NOT_READ, OPTIONS
from ridgebayes.runtime.reading import read_bytes
from ridgebayes.scene.typed import parse_texture
from ridgebayes.table.table import ContactTable

_HEAD_BYTES = 20_000  # bytes at the beginning of a file that are searched for marks of a format
FORMATS = tuple(OPTIONS)
# Format, suffixes and mark; the format is the first whose suffixes and mark match the file.
_RECOGNISED: tuple[tuple[str, tuple[str, ...], re.Pattern[bytes]], ...] = (
    ("series", (".vtu", ".pvd", ".xdmf", ".xmf"), re.compile(b"")),
    ("calculix", (".frd",), re.compile(b"")),
    ("febio", (), febio.MARK),
    ("ansys", (), ansys.MARK),
    ("abaqus-rpt", (), re.compile(b"Field Output Report")),
    ("abaqus-dat", (".dat",), re.compile(b"THE FOLLOWING TABLE IS PRINTED|A B A Q U S|Abaqus")),
    ("calculix", (".dat",), re.compile(rb"(?:displacements|contact stress) \(|\) for set ")),
    ("table", SUFFIXES, re.compile(b"")),
)
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
    if isinstance(texture, str):
        texture = parse_texture(texture, facts.get("R"), "texture")
    read = import_files(
        [Path(path) for path in paths], Given(texture=texture, **facts), program=program, role=role
    )
    for caution in read.cautions:
        warnings.warn(caution, CautionWarning, stacklevel=2)
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
    imported = read_columns(path, facts) if name == "table" else read_run(name, paths, facts)
    table, messages = imported.table, (f"format: {name}", *imported.messages)
    if role is not None:
        table = ContactTable.from_frame(table.frame.assign(role=role), where=table.where)
        messages += (f"role: {role}",)
    return replace(imported, table=table, messages=messages)


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
        if suffix in kind.get("suffixes", ()) or name in kind.get("names", ()):
            raise InputError(f"{path}: {kind['is']} is not read; {kind['instead']}")
    for program, suffixes, mark in _RECOGNISED:
        if (not suffixes or suffix in suffixes) and mark.search(head):
            return program
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
