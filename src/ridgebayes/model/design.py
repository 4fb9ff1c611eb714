"""Which levels of shared offsets a predictor has: the design matrix Z of a mixed model."""

import numpy as np
from scipy import sparse

from ridgebayes._types import FloatArray, IntArray


class DesignMatrix:
    """Levels of each linear predictor: the matrix Z, without its zeros.

    Parameters
    ----------
    first : ndarray of int, shape (n,), or None
        Level of each predictor in the first block; None where there is no such block.
    n_first : int
        Levels of the first block.
    rest : ndarray of int, shape (n_factor, n)
        Levels in the rest, counted over all its factors; -1 where a predictor has none.
    n_rest : int
        Levels of the rest.
    """

    def __init__(
        self,
        first: IntArray | None,
        n_first: int,
        rest: IntArray,
        n_rest: int,
    ) -> None:
        self.first, self.n_first = first, n_first
        self.rest, self.n_rest = rest, n_rest
        self.n = rest.shape[1] if first is None else len(first)
        every = rest if first is None else np.vstack([first, rest])
        # A predictor of each combination of levels, and the combination of each predictor.
        _, self.distinct, combination = np.unique(
            every, axis=1, return_index=True, return_inverse=True
        )
        self.combination = combination.reshape(-1)
        columns = np.arange(self.n)
        factor, column = np.nonzero(rest >= 0)
        # Z' x by sparse products: rows are many, levels few.
        self._to_first = None if first is None else _selector(first, columns, n_first)
        self._to_rest = _selector(rest[factor, column], column, n_rest, self.n)
        self._is_diagonal = len(rest) == 1
        self._border, self._corner = self._products()

    def _products(self) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Return the maps from the diagonal of W to border and corner of Z' W Z."""
        column = np.arange(self.n)
        corner_at, corner_of, border_at, border_of = [], [], [], []
        for mine in self.rest:
            for its in self.rest:
                has = (mine >= 0) & (its >= 0)
                corner_at.append(mine[has] * self.n_rest + its[has])
                corner_of.append(column[has])
            if self.first is not None:
                has = mine >= 0
                border_at.append(mine[has] * self.n_first + self.first[has])
                border_of.append(column[has])
        corner = _selector(_joined(corner_at), _joined(corner_of), self.n_rest**2, self.n)
        size = self.n_rest * self.n_first
        border = _selector(_joined(border_at), _joined(border_of), size, self.n)
        return border, corner

    def gather(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return Z' x, from (..., n) to (..., n_first) and (..., n_rest)."""
        first = (
            np.empty((*x.shape[:-1], 0)) if self._to_first is None else _times(self._to_first, x)
        )
        return first, _times(self._to_rest, x)

    def spread(self, first: FloatArray, rest: FloatArray) -> FloatArray:
        """Return Z x: the offset of each predictor, shape (..., n)."""
        value = np.zeros((*rest.shape[:-1], self.n))
        if self.first is not None:
            value += first[..., self.first]
        for levels in self.rest:
            if (levels >= 0).all():
                value += rest[..., levels]
            else:
                value[..., levels >= 0] += rest[..., levels[levels >= 0]]
        return value

    def gram(self, weight: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return Z' W Z: the first block's diagonal, the border, the corner.

        Parameters
        ----------
        weight : ndarray of float, shape (..., n)
            Diagonal of W.

        Returns
        -------
        first : ndarray of float, shape (..., n_first)
            Diagonal: a predictor has one level there.
        border : ndarray of float, shape (..., n_rest, n_first)
            Rest by first block.
        corner : ndarray of float, shape (..., n_rest, n_rest), or (..., n_rest) of a diagonal
            Rest: diagonal where a predictor has one level there, too.
        """
        lead, r = weight.shape[:-1], self.n_rest
        first, rest = self.gather(weight)
        border = _times(self._border, weight).reshape(*lead, r, self.n_first)
        if self._is_diagonal:
            return first, border, rest
        return first, border, _times(self._corner, weight).reshape(*lead, r, r)


def _selector(
    rows: IntArray, columns: IntArray, n_row: int, n_column: int | None = None
) -> sparse.csr_array:
    ones, n_column = np.ones(len(rows)), len(columns) if n_column is None else n_column
    return sparse.csr_array((ones, (rows, columns)), shape=(n_row, n_column))


def _joined(parts: list[IntArray]) -> IntArray:
    return np.concatenate(parts) if parts else np.empty(0, np.int64)


def _times(matrix: sparse.csr_array, x: FloatArray) -> FloatArray:
    """Return a sparse matrix times vectors on the last axis."""
    flat = x.reshape(-1, x.shape[-1])
    return np.ascontiguousarray((matrix @ flat.T).T).reshape(*x.shape[:-1], matrix.shape[0])
