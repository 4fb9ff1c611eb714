"""`FrictionTable`: a validated table of measured coefficients of friction."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray
from ridgebayes.runtime.text import count
from ridgebayes.table.columns import CALIBRATION, HELD_OUT, Column, Findings, RawTable
from ridgebayes.table.files import raw_cells
from ridgebayes.table.rules import read_cells, validated
from ridgebayes.table.table import ValidatedTable

_WIDTH = "must be finite and > 0; of a smooth surface a_over_R and b_over_R are both empty"
_LABEL = "any text on one line"
_POSITIVE = "must be finite and > 0"
_ROLE = "must be 'calibration' or 'held-out'"
COLUMNS = (
    Column("a_over_R", "number", _WIDTH, means="ridge width over the radius"),
    Column("b_over_R", "number", _WIDTH, means="groove width over the radius"),
    Column("p_over_E", "number", _POSITIVE, means="load per projected area over Young's modulus"),
    Column("mu", "number", _POSITIVE, means="coefficient of friction"),
    Column("mu_se", "number", "must be finite and >= 0", 0.0, means="its standard error"),
    Column("subject", "text", _LABEL, "", means="person or specimen; rows without one share one"),
    Column("session", "text", _LABEL, "", means="day or session of that subject"),
    Column("rig", "text", _LABEL, "", means="apparatus"),
    Column("role", "text", _ROLE, CALIBRATION, means="held-out: predicted, never fitted"),
)
_RULES = {column.name: column.rule for column in COLUMNS}


@dataclass(frozen=True, eq=False, repr=False)
class FrictionTable(ValidatedTable):
    """Validated rows of measured friction.

    `read_friction_table` returns it. Other columns follow the columns of the contract:

    ================== ============================================================================
    a_over_R, b_over_R ridge and groove width over the radius: finite, > 0; both empty: smooth
    p_over_E           load per projected area over Young's modulus: finite, > 0
    mu                 coefficient of friction: finite, > 0
    mu_se              optional: its standard error: >= 0; default 0
    subject            optional: person or specimen
    session            optional: day or session of that subject
    rig                optional: apparatus
    role               optional: ``calibration`` (default) or ``held-out``: predicted, never fitted
    ================== ============================================================================

    Parameters
    ----------
    where : str, optional
        File or name that messages show.

    Notes
    -----
    Rows without a label share one unnamed subject, session or rig.

    Examples
    --------
    >>> import pandas as pd
    >>> import ridgebayes as rb
    >>> rows = {"a_over_R": None, "b_over_R": None, "p_over_E": [0.004, 0.008], "mu": [1.3, 0.9]}
    >>> rb.read_friction_table(pd.DataFrame(rows))
    FrictionTable(friction table: 2 rows, 1 subject)
    >>> import tempfile
    >>> table = rb.read_friction_table(pd.DataFrame(rows))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     table.write(f"{folder}/friction.csv")
    ...     again = rb.read_friction_table(f"{folder}/friction.csv")
    >>> again.digest() == table.digest(), again.to_dataframe().equals(table.frame)
    (True, True)
    >>> table.is_fitted.tolist()
    [True, True]
    """

    where: str = "friction table"
    contract: ClassVar[Sequence[Column]] = COLUMNS

    def __repr__(self) -> str:
        subjects = count(self._frame["subject"].nunique(), "subject")
        return f"FrictionTable({self.where}: {count(len(self), 'row')}, {subjects})"

    @property
    def is_fitted(self) -> BoolArray:
        """Whether each row has the role calibration, shape (n_row,)."""
        return (self._frame["role"] == CALIBRATION).to_numpy(dtype=bool)


def read_friction_table(
    source: FrictionTable | pd.DataFrame | str | os.PathLike[str],
) -> FrictionTable:
    """Read and validate a table of measured friction.

    Parameters
    ----------
    source : str, path, pandas.DataFrame or FrictionTable
        A ``.csv`` file (UTF-8, commas, one header line), a ``.parquet`` file, or the rows
        themselves. `FrictionTable` describes the columns; a `FrictionTable` is returned unchanged.

    Returns
    -------
    FrictionTable
        Validated table with defaults filled in; rows are neither dropped nor repaired.

    Raises
    ------
    InputError
        If the source has another type, the file cannot be read, or a rule is broken. The message
        gives file, row, column, value and rule of the first twenty invalid cells, and counts the
        rest.

    Examples
    --------
    >>> rows = {"a_over_R": [0.022, None], "b_over_R": [0.02, None], "p_over_E": 0.01}
    >>> read_friction_table(pd.DataFrame(rows | {"mu": [0.8, 1.1], "subject": "A"}))
    FrictionTable(friction table: 2 rows, 1 subject)
    """
    if isinstance(source, FrictionTable):
        return source
    raw = raw_cells(source, "friction table", "FrictionTable", COLUMNS)
    return FrictionTable(validated(raw, _check, COLUMNS), raw.where)


def _check(raw: RawTable) -> tuple[pd.DataFrame, Findings]:
    """Return the canonical frame, and the cells that break a rule."""
    typed, empty, findings = read_cells(raw.frame, COLUMNS)
    for name in ("p_over_E", "mu"):
        findings.add(empty[name], name, "must not be empty or NaN")
        findings.add(~(typed[name] > 0), name, _RULES[name])
    for name, other in (("a_over_R", "b_over_R"), ("b_over_R", "a_over_R")):
        findings.add(empty[name] & ~empty[other], name, _WIDTH)
        findings.add(~(typed[name] > 0) & ~empty[name], name, _WIDTH)
    findings.add(~(typed["mu_se"] >= 0), "mu_se", _RULES["mu_se"])
    findings.add(~np.isin(typed["role"], (CALIBRATION, HELD_OUT)), "role", _RULES["role"])
    return pd.DataFrame(typed), findings
