"""Means over draws of Student distribution functions, at many loads."""

from collections.abc import Callable

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.predict.interpolant import Interpolant, sparsely

_FEW_LOADS = 60  # loads up to which means of Student errors are worked out one by one
_TOLERANCE = 1e-8  # of a table of them
_MOST = 3_000  # values of such a table; of draws too far apart for it there is none
_WIDEST = 3.0  # of its pieces


class StudentTable:
    """Means of Student distribution functions: tabulated, for their tails reach every load.

    They are smooth in arcsinh of the distance from their middle. Counts of one texture mostly
    share theirs but for a shift.

    Parameters
    ----------
    mean_at : callable
        From y, mean and scale to the mean over draws at each y.
    """

    def __init__(self, mean_at: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]) -> None:
        self._mean_at, self._is_rough = mean_at, False
        self._last: tuple[FloatArray, FloatArray, Interpolant] | None = None

    def at(self, y: FloatArray, mean: FloatArray, scale: FloatArray) -> FloatArray:
        """Return the mean over draws at each y, shape (n,); 0 at -inf."""
        result, inside = np.zeros(len(y)), np.flatnonzero(y > -np.inf)
        if len(inside) <= _FEW_LOADS or not np.isfinite(mean).all():
            result[inside] = self._mean_at(y[inside], mean, scale)
            return result
        middle, width = float(np.median(mean)), float(np.median(scale))
        x = np.arcsinh((y[inside] - middle) / width)

        def along(x: FloatArray) -> FloatArray:
            return self._mean_at(middle + width * np.sinh(x), mean, scale)

        if self._is_last(mean, scale):
            assert self._last is not None
            table = self._last[2]
            if not self._is_rough and table.cover(x.min(), x.max(), _MOST):
                result[inside] = np.clip(table.tabulated(x), 0.0, 1.0)
                return result
            self._is_rough = True
        else:
            self._last = mean, scale, Interpolant(along, _TOLERANCE, _WIDEST)
        result[inside] = np.clip(sparsely(along, x, _TOLERANCE, _WIDEST), 0.0, 1.0)
        return result

    def _is_last(self, mean: FloatArray, scale: FloatArray) -> bool:
        """Return whether this is what was asked for last but for a shift: worth a table."""
        if self._last is None or not np.array_equal(scale, self._last[1]):
            return False
        return bool(np.ptp(mean - self._last[0]) < _TOLERANCE * scale.min())
