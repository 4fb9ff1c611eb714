"""Where the data that ships with the package lies: inside a wheel, or beside a source checkout."""

from pathlib import Path

from ridgebayes.errors import InputError

_PACKAGE = Path(__file__).resolve().parent
_ROOTS = (_PACKAGE / "data", _PACKAGE.parents[1] / "data")

PAPER_SWEEP = "paper_sweep.csv"
REFERENCE_FE = "fea/neo_hooke.csv"
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
        The existing file.

    Raises
    ------
    InputError
        If no file of that name was shipped.
    """
    for root in _ROOTS:
        if (root / name).is_file():
            return root / name
    raise InputError(f"data file {name!r}: not shipped with this installation")
