"""`import_table`: output of other programs or tests as a contact table."""

import os
import warnings
from pathlib import Path
from typing import Any

from ridgebayes.errors import CautionWarning
from ridgebayes.fea.given import Given
from ridgebayes.fea.read import import_files
from ridgebayes.scene.texture_text import parse_texture
from ridgebayes.table.table import ContactTable


def import_table(
    *paths: str | os.PathLike[str],
    program: str | None = None,
    role: str | None = None,
    texture: tuple[float, float] | str | None = None,
    **facts: Any,
) -> ContactTable:
    """Read the output of finite elements or tests as a contact table, as ``ridgebayes import``.

    Parameters
    ----------
    *paths : path
        File to read, or all files of a run that wrote several.
    program : str, optional
        ``table``, ``calculix``, ``abaqus-dat``, ...: the command's ``--format``. Recognised if not
        given.
    role : str, optional
        Role of all rows: ``calibration`` or ``held-out``.
    texture : (float, float) or str, optional
        Ridge and groove width over R, or a text such as ``"0.25 mm,0.25 mm"``.
    **facts
        Facts that the file lacks, named as the command's options: R, E, nu, thickness and
        load_se as texts with units; map as a sequence of texts ``key=header``; sheet, skip_rows,
        decimal, deck, surface, reaction, corner, ...

    Returns
    -------
    ContactTable
        The file's rows.

    Raises
    ------
    InputError
        If the file cannot be understood: the message says what is missing.

    Warns
    -----
    CautionWarning
        If values that were read look doubtful.

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
