"""The smooth cylinder against Hertz: the check that came before any ridge (the study's Fig. 3)."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray
from ridgebayes.checks.least_squares import r_squared
from ridgebayes.contact.halfplane import smooth_load
from ridgebayes.contact.hertz import load_of_half_width, ridge_units
from ridgebayes.table.datafiles import SMOOTH_FE, data_path

FIG_3_TEXTURE = (0.022, 0.03)
_HALF_WIDTHS = (0.02, 0.2)  # over R: p/E from 0.0002 to 0.021, the loads of the study


@dataclass(frozen=True, eq=False)
class SmoothCurve:
    """Contact length of a smooth cylinder, in ridge units, beside eq. (1) at the same load.

    Parameters
    ----------
    name : str
        Who computed it: ``half-plane``, ``small-strain`` or ``neo-hooke``.
    p_over_E : ndarray of float, shape (n_load,), dimensionless
        Loads.
    count : ndarray of float, shape (n_load,), dimensionless
        Q' of the computed contact length by eq. (2).
    hertz : ndarray of float, shape (n_load,), dimensionless
        Q' of eq. (1) at the same load.
    load_ratio : ndarray of float, shape (n_load,), dimensionless
        Load over the Hertz load of the same contact length.
    """

    name: str
    p_over_E: FloatArray
    count: FloatArray
    hertz: FloatArray
    load_ratio: FloatArray

    @property
    def r_squared(self) -> float:
        """R^2 of eq. (1) as a prediction of the computed Q'."""
        return r_squared(self.count, self.hertz)

    @property
    def worst_count_error(self) -> float:
        """Largest relative error of eq. (1) in Q'."""
        return float(np.max(np.abs(self.hertz / self.count - 1)))

    @property
    def worst_load_error(self) -> float:
        """Largest relative error of eq. (1) in the load of a contact length."""
        return float(np.max(np.abs(1 / self.load_ratio - 1)))


def smooth_cylinder() -> tuple[SmoothCurve, ...]:
    """Return the smooth cylinder's Q' by eq. (2), in ridges of Fig. 3, computed three ways.

    Returns
    -------
    tuple of SmoothCurve
        The half-plane equation without grooves, then the shipped finite-element rows, small
        strain and neo-Hookean.

    Notes
    -----
    *Accuracy.* The half-plane curve is Hertz to rounding: one equation solved two ways. Only the
    finite-element rows can differ, because their body is a whole cylinder.

    References
    ----------
    doi:10.1016/j.ijssolstr.2019.06.026, eqs (1, 2) and Fig. 3.

    Examples
    --------
    >>> [(curve.name, round(curve.worst_load_error, 3)) for curve in smooth_cylinder()]
    [('half-plane', 0.0), ('small-strain', 0.025), ('neo-hooke', 0.006)]
    """
    widths = np.linspace(*_HALF_WIDTHS, 60)
    curves = [_curve("half-plane", widths, smooth_load(widths))]
    rows = pd.read_csv(data_path(SMOOTH_FE))
    for name, part in rows.groupby("model", sort=False):
        part = part.sort_values("half_width_over_R")
        w = part["half_width_over_R"].to_numpy()
        load = part["load_over_hertz"].to_numpy() * load_of_half_width(w)
        curves.append(_curve(str(name), w, load))
    return tuple(curves)


def _curve(name: str, half_width: FloatArray, load: FloatArray) -> SmoothCurve:
    a, b = FIG_3_TEXTURE
    count = 2 + (2 * half_width - b) / (a + b)
    hertz = ridge_units(load, a, b)
    return SmoothCurve(name, load, count, hertz, load / load_of_half_width(half_width))
