"""A smooth function of one number, tabulated where it is asked for: pieces of Chebyshev series.

A distribution function averaged over thousands of draws is smooth in log load, but dear. Asked for
at many loads it is worked out at some hundred, in pieces that are halved until the last
coefficients of each are at rounding.

>>> sine = Interpolant(np.sin)
>>> y = np.linspace(0.0, 10.0, 10_001)
>>> bool(np.abs(sine(y) - np.sin(y)).max() < 1e-13)
True
"""

from collections.abc import Callable

import numpy as np

from ridgebayes._types import FloatArray

_N = 16  # coefficients of a piece
_TOLERANCE = 1e-14  # of the last three of them
_AT_ONCE = 4_096  # arguments evaluated together, which bounds memory
_ANGLES = (np.arange(_N) + 0.5) * np.pi / _N
_NODES = np.cos(_ANGLES)
_TO_SERIES = 2 / _N * np.cos(np.outer(np.arange(_N), _ANGLES))
_TO_SERIES[0] /= 2


class Interpolant:
    """A function's values to 1e-13, from its values at few places.

    Parameters
    ----------
    function : callable
        From ndarray of float, shape (n,), to the same; smooth, of size 1. It is evaluated itself
        where a table would take as many values.
    """

    def __init__(self, function: Callable[[FloatArray], FloatArray]) -> None:
        self._function = function
        self._edges, self._series = np.empty(0), np.empty((0, _N))

    def __call__(self, y: FloatArray) -> FloatArray:
        """Return the values at finite y, shape (n,)."""
        if not len(y):
            return np.empty(0)
        covered = self._cover(float(y.min()), float(y.max()), len(y))
        evaluate = self._evaluate if covered else self._function
        return np.concatenate([evaluate(y[i : i + _AT_ONCE]) for i in range(0, len(y), _AT_ONCE)])

    def _evaluate(self, y: FloatArray) -> FloatArray:
        piece = np.clip(np.searchsorted(self._edges, y) - 1, 0, len(self._series) - 1)
        low, high = self._edges[piece], self._edges[piece + 1]
        x = (2 * y - low - high) / (high - low)
        series = self._series[piece].T
        last, value = np.zeros_like(x), np.zeros_like(x)
        for coefficient in series[:0:-1]:  # Clenshaw
            last, value = value, coefficient + 2 * x * value - last
        result: FloatArray = series[0] + x * value - last
        return result

    def _cover(self, low: float, high: float, n_most: int) -> bool:
        """Extend the pieces to a range; False if that would take more than `n_most` values."""
        gaps = [(low, max(high, np.nextafter(low, np.inf)))]
        if len(self._edges):
            ends = float(self._edges[0]), float(self._edges[-1])
            gaps = [gap for gap in ((low, ends[0]), (ends[1], high)) if gap[0] < gap[1]]
        pending, done, n = np.array(gaps).reshape(-1, 2), [], 0
        while len(pending):
            n += len(pending) * _N
            if n > n_most:
                return False
            middle, half = pending.mean(axis=1), 0.5 * (pending[:, 1] - pending[:, 0])
            values = self._function((middle[:, None] + half[:, None] * _NODES).ravel())
            series = values.reshape(-1, _N) @ _TO_SERIES.T
            smooth = np.abs(series[:, -3:]).max(axis=1) < _TOLERANCE
            done += list(zip(pending[smooth, 0], series[smooth], strict=True))
            rough, cut = pending[~smooth], middle[~smooth]
            pending = np.stack([rough[:, 0], cut, cut, rough[:, 1]], axis=1).reshape(-1, 2)
        if done:
            starts = np.append(self._edges[:-1], [start for start, _ in done])
            series = np.concatenate([self._series, [series for _, series in done]])
            order = np.argsort(starts)
            end = max(high, self._edges[-1] if len(self._edges) else gaps[0][1])
            self._edges, self._series = np.append(starts[order], end), series[order]
        return True
