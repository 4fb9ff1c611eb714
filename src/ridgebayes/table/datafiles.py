"""Location of the data shipped with the package, in a wheel or a source checkout."""

from pathlib import Path

import pandas as pd

from ridgebayes.errors import InputError
from ridgebayes.table.table import ContactTable, read_table

_PACKAGE = Path(__file__).resolve().parent.parent
_ROOTS = (_PACKAGE / "data", _PACKAGE.parent.parent / "data")

PAPER_SWEEP = "paper_sweep.csv"
CYLINDER_SWEEP = "fea/cylinder_sweep.csv"
CALCULIX_FE = "fea/neo_hooke.csv"
SMOOTH_FE = "fea/smooth_cylinder.csv"


def data_path(name: str) -> Path:
    """Return the path of a shipped data file.

    Parameters
    ----------
    name : str
        Path below `data`, such as ``"paper_sweep.csv"``.

    Returns
    -------
    pathlib.Path
        Path of the existing file.

    Raises
    ------
    InputError
        If the file is not shipped.
    """
    for root in _ROOTS:
        if (root / name).is_file():
            return root / name
    raise InputError(f"data file {name!r}: not shipped with this installation")


def paper_sweep() -> ContactTable:
    """Return the embedded default table: the study's nine textures and a held-out texture.

    Returns
    -------
    ContactTable
        Transition loads of the half-plane at nu = 0.5. Nine textures up to p/E = 0.02 are for
        calibration; (0.012, 0.09) up to p/E = 0.045 is held out.

    Raises
    ------
    InputError
        If the file is not shipped.

    Examples
    --------
    >>> len(paper_sweep().calibration)
    41
    """
    return read_table(data_path(PAPER_SWEEP))


def reference_fe() -> ContactTable:
    """Return finite-strain finite-element loads, on which runs compare the forms a second time.

    Returns
    -------
    ContactTable
        The study's nine textures for calibration, computed by this package's finite elements; two
        of them held out, computed by the independent program CalculiX.

    Raises
    ------
    InputError
        If a file is not shipped.

    Examples
    --------
    >>> table = reference_fe()
    >>> len(table.calibration.textures), len(table.held_out.textures)
    (9, 2)
    """
    cylinder = read_table(data_path(CYLINDER_SWEEP)).frame
    other = read_table(data_path(CALCULIX_FE)).frame.assign(role="held-out")
    where = f"{CYLINDER_SWEEP} and {CALCULIX_FE}"
    return ContactTable.from_frame(pd.concat([cylinder, other], ignore_index=True), where=where)
