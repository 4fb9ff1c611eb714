"""What a solver found of one texture, in plain values that travel and are kept; their table."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import pandas as pd

_BY_ROW = ("Q", "p_over_E", "rel_se", "status")
_IF_ANY = ("rel_se", "offset_over_R", "edges")


@dataclass(frozen=True)
class Curve:
    """Transitions of one texture at one offset, by one solver and mesh.

    Parameters
    ----------
    a_over_R, b_over_R : float, scalar, dimensionless
        Ridge and groove width.
    Q : tuple of int, shape (n_row,)
        Counts reached.
    p_over_E : tuple of float, shape (n_row,), dimensionless
        Their loads; NaN where none was found.
    rel_se : tuple of float, shape (n_row,), dimensionless
        Known relative errors of the loads.
    nu : float, scalar, dimensionless
        Poisson's ratio.
    offset_over_R : float, scalar, dimensionless
        The body's, from the groove's centre.
    role, solver, source : str
        As in the table's columns.
    status : tuple of str, shape (n_row,)
        ``ok``, or what failed.
    edges : int
        Of finite elements, over a ridge's width; 0 without.
    """

    a_over_R: float
    b_over_R: float
    Q: tuple[int, ...]
    p_over_E: tuple[float, ...]
    rel_se: tuple[float, ...]
    nu: float
    offset_over_R: float
    role: str
    solver: str
    status: tuple[str, ...]
    source: str
    edges: int

    def to_dict(self) -> dict[str, Any]:
        """Return the curve in values that JSON has: a load that is NaN is None."""
        loads = [None if math.isnan(load) else load for load in self.p_over_E]
        return asdict(self) | {"p_over_E": loads}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "Curve":
        """Return the curve of what `to_dict` gave, the same to the last bit."""
        loads = tuple(math.nan if load is None else load for load in values["p_over_E"])
        rows = {name: tuple(values[name]) for name in _BY_ROW} | {"p_over_E": loads}
        return cls(**(values | rows))


COLUMNS = [field.name for field in fields(Curve)]


def curves_to_frame(curves: Sequence[Curve]) -> pd.DataFrame:
    """Return the rows of curves, one after the other.

    Parameters
    ----------
    curves : sequence of Curve
        At least one.

    Returns
    -------
    pandas.DataFrame
        Columns of the contact table; those that only some solvers fill are left out where none has.
    """
    columns: dict[str, list[Any]] = {}
    for name in COLUMNS:
        if name in _BY_ROW:
            columns[name] = [value for curve in curves for value in getattr(curve, name)]
        else:
            columns[name] = [getattr(curve, name) for curve in curves for _ in curve.Q]
    shown = [name for name in COLUMNS if name not in _IF_ANY or any(columns[name])]
    return pd.DataFrame({name: columns[name] for name in shown})
