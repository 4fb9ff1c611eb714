"""A smooth function of one number, tabulated where many values are asked for: Chebyshev series.

A distribution function averaged over thousands of draws is smooth in log load, but dear. Where many
loads lie close it is worked out at sixteen places of a cell, which is halved until the last
coefficients are small; elsewhere at the loads themselves.

>>> sine = Interpolant(np.sin, 1e-14)
>>> y = np.linspace(0.0, 10.0, 10_001)
>>> bool(np.abs(sine(y) - np.sin(y)).max() < 1e-13)
True
"""

from collections.abc import Callable

import numpy as np
from numpy.polynomial.chebyshev import chebpts1, chebval, chebvander

from ridgebayes._types import FloatArray

_N = 16  # coefficients of a cell
_NODES = chebpts1(_N)
_TO_SERIES = np.linalg.inv(chebvander(_NODES, _N - 1))
_WIDEST = 3.0  # of the cells that are tried first
_FINEST = 40  # halvings of a cell: what is rough then has a step there
_AT_ONCE = 4_096  # arguments evaluated together, which bounds memory
_UNKNOWN, _ROUGH = np.full((2, _N), [[np.nan], [np.inf]])  # in place of a series


class Interpolant:
    """A function's values to ten times a tolerance, from its values at few places.

    Tabulated cells are kept for later calls. A rough function is evaluated directly, with at most
    one additional evaluation for each argument at every halving.

    Parameters
    ----------
    function : callable
        From ndarray of float, shape (n,), to the same; of size 1.
    tolerance : float
        Bound on the last three coefficients of each cell.
    """

    def __init__(self, function: Callable[[FloatArray], FloatArray], tolerance: float) -> None:
        self._function, self._tolerance = function, tolerance
        self._series: dict[tuple[float, float], FloatArray] = {}  # by a cell's width and number

    def __call__(self, y: FloatArray) -> FloatArray:
        """Return the values at finite y, shape (n,)."""
        value, pending = np.empty(len(y)), np.arange(len(y))
        few, width = [pending[:0]], _WIDEST
        for _ in range(_FINEST):
            if not len(pending):
                break
            place = y[pending] / width
            floor = np.floor(place)
            cells, own, n = np.unique(floor, return_inverse=True, return_counts=True)
            self._tabulate(width, cells[n > _N])
            series = np.array(
                [self._series.get((width, cell), _UNKNOWN) for cell in cells.tolist()]
            )
            state = series[own, 0]
            known = np.isfinite(state)
            x = 2 * (place - floor)[known] - 1
            value[pending[known]] = chebval(x, series[own[known]].T, tensor=False)
            few.append(pending[np.isnan(state)])
            pending, width = pending[np.isinf(state)], width / 2
        own = np.concatenate([*few, pending])
        for i in range(0, len(own), _AT_ONCE):
            value[own[i : i + _AT_ONCE]] = self._function(y[own[i : i + _AT_ONCE]])
        return value

    def _tabulate(self, width: float, cells: FloatArray) -> None:
        """Find the series of those cells that have none yet."""
        new = np.array([cell for cell in cells.tolist() if (width, cell) not in self._series])
        if not len(new):
            return
        values = self._function((width * (new[:, None] + 0.5 * (1 + _NODES))).ravel())
        found = values.reshape(-1, _N) @ _TO_SERIES.T
        found[np.abs(found[:, -3:]).max(axis=1) >= self._tolerance] = _ROUGH
        self._series |= zip(((width, cell) for cell in new.tolist()), found, strict=True)
