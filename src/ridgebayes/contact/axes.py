"""Ranges and distinct values of rows that come in blocks, and nodes of interpolation axes."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError

ROUNDING = 1e-12  # relative difference of ratios and loads that are equal but for rounding


class Spread:
    """Distinct rows, if there are few, and the range of each column.

    Parameters
    ----------
    most : int
        Largest number of distinct rows to keep.

    Examples
    --------
    >>> seen = Spread(2)
    >>> seen.add(np.array([[1.0, 5.0], [1.0, 5.0]]))
    >>> seen.add(np.array([[0.0, 7.0]]))
    >>> seen.place(np.array([[1.0, 5.0]])).tolist()
    [1]
    >>> seen.add(np.array([[0.0, 8.0]]))
    >>> seen.distinct is None, seen.low.tolist(), seen.high.tolist()
    (True, [0.0, 5.0], [1.0, 8.0])
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self.distinct: FloatArray | None = None
        self.low, self.high = np.array(np.inf), np.array(-np.inf)

    def add(self, rows: FloatArray) -> None:
        """Add rows, shape (n, n_column)."""
        few = self.low.ndim == 0 or self.distinct is not None
        self.low = np.minimum(self.low, rows.min(axis=0))
        self.high = np.maximum(self.high, rows.max(axis=0))
        if few:
            before = rows[:0] if self.distinct is None else self.distinct
            distinct = np.unique(np.concatenate([before, rows]), axis=0)
            self.distinct = distinct if len(distinct) <= self._most else None

    def place(self, rows: FloatArray) -> IntArray:
        """Return the index of each row among the distinct rows, shape (n,)."""
        distinct = np.empty((0, rows.shape[1])) if self.distinct is None else self.distinct
        return np.asarray((rows[:, None] == distinct).all(axis=-1).argmax(axis=1))

    def check(self, rows: FloatArray) -> None:
        """Refuse rows that are not among the added rows, or outside their range."""
        within = (rows >= self.low) & (rows <= self.high)
        if self.distinct is not None:
            within = (rows[:, None] == self.distinct).all(axis=-1).any(axis=1)
        if not within.all():
            raise InputError(
                "scene: expected a callable that draws only with its generator, got other draws "
                "from the same generator the second time"
            )


@dataclass(frozen=True)
class Axis:
    """Nodes between two values, and their weights for interpolation.

    Parameters
    ----------
    low, high : float
        Ends of the range.
    n : int
        Number of nodes; 1 if the ends are equal.
    degree : int, optional
        Degree of the spline between nodes.

    Examples
    --------
    >>> axis = Axis.over(1.0, 3.0, 5)
    >>> (axis.weights(np.array([1.0, 1.3, 3.0])) @ axis.nodes**3).round(12).tolist()
    [1.0, 2.197, 27.0]
    >>> Axis.over(0.1 + 0.2, 0.3, 5).n, Axis.over(0.3, 0.1 + 0.2, 5).n  # equal to rounding
    (1, 1)
    """

    low: float
    high: float
    n: int
    degree: int = 3

    @classmethod
    def over(cls, low: float, high: float, n: int, *, degree: int = 3) -> "Axis":
        """Return the axis over a range, with one node if the ends are equal within rounding."""
        is_range = high > low and not np.isclose(high, low, rtol=ROUNDING, atol=0.0)
        return cls(float(low), float(high), n if is_range else 1, degree)

    @property
    def nodes(self) -> FloatArray:
        """Nodes in rising order, shape (n,)."""
        if self.n == 1:  # the value may be infinite
            return np.array([self.low])
        return np.linspace(self.low, self.high, self.n)

    def weights(self, x: FloatArray) -> FloatArray:
        """Return the weight of each node at values x, shape (len(x), n)."""
        if self.n == 1:
            return np.ones((len(x), 1))
        return np.asarray(make_interp_spline(self.nodes, np.eye(self.n), k=self.degree)(x))
