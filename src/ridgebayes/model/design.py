"""The design matrix Z of a mixed model, which assigns levels of shared offsets to predictors."""

import numpy as np
from scipy import sparse

from ridgebayes._types import FloatArray, IntArray


class DesignMatrix:
    """The sparse matrix Z, stored as the levels of each linear predictor.

    Parameters
    ----------
    first : ndarray of int, shape (n,), or None
        Level of each predictor in the first block; None if there is no first block.
    n_first : int
        Number of levels in the first block.
    rest : ndarray of int, shape (n_factor, n)
        Levels of the other factors, numbered over all of them; -1 if a predictor has no level.
    n_rest : int
        Number of levels of the other factors.
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
        levels = rest if first is None else np.vstack([first, rest])
        # One predictor for each combination of levels, and the combination of each predictor.
        _, self.distinct, combination = np.unique(
            levels, axis=1, return_index=True, return_inverse=True
        )
        self.combination = combination.reshape(-1)
        columns = np.arange(self.n)
        factor, column = np.nonzero(rest >= 0)
        # Sparse products are fast for Z' x, since there are many rows and few levels.
        self._to_first = None if first is None else _selector(first, columns, n_first)
        self._to_rest = _selector(rest[factor, column], column, n_rest, self.n)
        self._is_diagonal = len(rest) == 1
        self._border, self._corner = self._products()

    def _products(self) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Return sparse matrices that map the diagonal of W to border and corner of Z' W Z."""
        rest, has = self.rest, self.rest >= 0
        corner_rows = rest[:, None] * self.n_rest + rest
        *levels, column = np.nonzero(has[:, None] & has)
        corner = _selector(corner_rows[*levels, column], column, self.n_rest**2, self.n)
        border_rows = rest * self.n_first + (0 if self.first is None else self.first)
        level, column = np.nonzero(has & (self.first is not None))
        size = self.n_rest * self.n_first
        return _selector(border_rows[level, column], column, size, self.n), corner

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
            First block, diagonal because a predictor has one level in it.
        border : ndarray of float, shape (..., n_rest, n_first)
            Rows of the other levels, columns of the first block.
        corner : ndarray of float, shape (..., n_rest, n_rest), or (..., n_rest) if diagonal
            Block of the other levels, diagonal if they belong to one factor.
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
    """Return a sparse matrix with ones at some rows and columns."""
    ones, n_column = np.ones(len(rows)), len(columns) if n_column is None else n_column
    return sparse.csr_array((ones, (rows, columns)), shape=(n_row, n_column))


def _times(matrix: sparse.csr_array, x: FloatArray) -> FloatArray:
    """Multiply vectors on the last axis by a sparse matrix."""
    flat = x.reshape(-1, x.shape[-1])
    return np.ascontiguousarray((matrix @ flat.T).T).reshape(*x.shape[:-1], matrix.shape[0])
