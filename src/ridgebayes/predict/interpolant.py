"""A smooth function of one number, tabulated where it is asked for: pieces of Chebyshev series.

A distribution function averaged over thousands of draws is smooth in log load, but dear. Asked for
at many loads it is worked out at some hundred, in pieces that are halved until the last
coefficients of each are at rounding.

>>> sine = Interpolant(np.sin)
>>> y = np.linspace(0.0, 10.0, 10_001)
>>> bool(np.abs(sine(y) - np.sin(y)).max() < 1e-13)
True
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.polynomial import chebyshev

from ridgebayes._types import FloatArray

_N = 16  # coefficients of a piece
_TOLERANCE = 1e-14  # of the last three of them
_AT_ONCE = 4_096  # arguments evaluated together, which bounds memory
_ANGLES = (np.arange(_N) + 0.5) * np.pi / _N
_NODES = np.cos(_ANGLES)
_TO_SERIES = 2 / _N * np.cos(np.outer(np.arange(_N), _ANGLES))
_TO_SERIES[0] /= 2


class Interpolant:
    """A function's values to ten times a tolerance, from its values at few places.

    Parameters
    ----------
    function : callable
        From ndarray of float, shape (n,), to the same; smooth, of size 1. It is evaluated itself
        where a table would take too many values.
    tolerance : float, optional
        Of the last three coefficients of each piece.
    widest : float, optional
        Width of a piece that is not tried wider.
    """

    def __init__(
        self,
        function: Callable[[FloatArray], FloatArray],
        tolerance: float = _TOLERANCE,
        widest: float = np.inf,
    ) -> None:
        self._function, self._tolerance, self._widest = function, tolerance, widest
        self._edges, self._series, self._failed = np.empty(0), np.empty((0, _N)), 0

    def __call__(self, y: FloatArray, n_most: int = 0) -> FloatArray:
        """Return the values at finite y, shape (n,), from at most n or `n_most` further ones."""
        if not len(y):
            return np.empty(0)
        n_most = max(len(y), n_most)
        # What has failed once is not tried again.
        covered = n_most > self._failed and self._cover(float(y.min()), float(y.max()), n_most)
        if not covered:
            self._failed = max(n_most, self._failed)
        evaluate = self._tabulated if covered else self._function
        return np.concatenate([evaluate(y[i : i + _AT_ONCE]) for i in range(0, len(y), _AT_ONCE)])

    def _tabulated(self, y: FloatArray) -> FloatArray:
        piece = np.clip(np.searchsorted(self._edges, y) - 1, 0, len(self._series) - 1)
        low, high = self._edges[piece], self._edges[piece + 1]
        x = (2 * y - low - high) / (high - low)
        return np.asarray(chebyshev.chebval(x, self._series[piece].T, tensor=False))

    def _cover(self, low: float, high: float, n_most: int) -> bool:
        """Extend the pieces to a range; False if that would take more than `n_most` values."""
        gaps = [(low, max(high, np.nextafter(low, np.inf)))]
        if len(self._edges):
            ends = float(self._edges[0]), float(self._edges[-1])
            gaps = [gap for gap in ((low, ends[0]), (ends[1], high)) if gap[0] < gap[1]]
        pieces = [_pieces(*gap, self._widest) for gap in gaps]
        pending, done, n = np.concatenate([np.empty((0, 2)), *pieces]), [], 0
        while len(pending):
            n += len(pending) * _N
            if n > n_most:
                return False
            series = _series_of(self._function, pending)
            smooth = np.abs(series[:, -3:]).max(axis=1) < self._tolerance
            done += list(zip(pending[smooth, 0], series[smooth], strict=True))
            pending = _halved(pending[~smooth])
        if done:
            starts = np.append(self._edges[:-1], [start for start, _ in done])
            series = np.concatenate([self._series, [series for _, series in done]])
            order = np.argsort(starts)
            end = max(high, self._edges[-1] if len(self._edges) else gaps[0][1])
            self._edges, self._series = np.append(starts[order], end), series[order]
        return True


def _pieces(low: float, high: float, widest: float) -> FloatArray:
    """Return the ends of equal pieces of a range, shape (n_piece, 2)."""
    edges = np.linspace(low, high, 1 + max(math.ceil((high - low) / widest), 1))
    return np.column_stack([edges[:-1], edges[1:]])


def _halved(pieces: FloatArray) -> FloatArray:
    cut = pieces.mean(axis=1)
    return np.stack([pieces[:, 0], cut, cut, pieces[:, 1]], axis=1).reshape(-1, 2)


def _series_of(function: Callable[[FloatArray], FloatArray], pieces: FloatArray) -> FloatArray:
    """Return the coefficients of each piece, shape (n_piece, 16)."""
    middle, half = pieces.mean(axis=1), 0.5 * (pieces[:, 1] - pieces[:, 0])
    values = function((middle[:, None] + half[:, None] * _NODES).ravel())
    series: FloatArray = values.reshape(-1, _N) @ _TO_SERIES.T
    return series
