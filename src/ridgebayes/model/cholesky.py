"""Cholesky factors of many matrices at once: dense, diagonal, or diagonal but for a border."""

import math
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.linalg import blas

from ridgebayes._types import FloatArray, IntArray

_SMALL = 16  # unknowns: of fewer, a batch is solved faster than system by system
_INVERTED = 64  # levels up to which ten products with an inverse are quicker than ten solves


@dataclass(frozen=True, eq=False)
class DenseFactor:
    """A lower Cholesky factor R of M.

    Parameters
    ----------
    factor : ndarray of float, shape (..., n, n)
        R.
    """

    factor: FloatArray

    @property
    def pivots(self) -> FloatArray:
        """Diagonal of R, shape (..., n)."""
        return np.diagonal(self.factor, axis1=-2, axis2=-1)

    @property
    def nbytes(self) -> int:
        """Memory that it takes."""
        return self.factor.nbytes

    def solve(self, right: FloatArray) -> FloatArray:
        """Return R^-1 x, from (..., n, m)."""
        return solve_lower(self.factor, right)

    def solve_transposed(self, right: FloatArray) -> FloatArray:
        """Return R'^-1 x, from (..., n, m)."""
        return solve_lower(self.factor, right, transposed=True)

    def inverted(self) -> "DenseFactor | InverseFactor":
        """Return what `solve` may be asked of again and again, and takes less memory."""
        n = self.factor.shape[-1]
        if n > _INVERTED:
            return self
        return InverseFactor(
            solve_lower(self.factor, np.broadcast_to(np.eye(n), self.factor.shape))
        )

    def of(self, levels: IntArray) -> "DenseFactor":
        """Return the factor of some unknowns, those left out being independent given these."""
        return DenseFactor(self.factor[..., levels[:, None], levels])


@dataclass(frozen=True, eq=False)
class InverseFactor:
    """A lower Cholesky factor by its inverse: all that predictions ask of it.

    Parameters
    ----------
    inverse : ndarray of float, shape (..., n, n)
        The inverse.
    """

    inverse: FloatArray

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the inverse times x, from (..., n, m)."""
        return self.inverse @ right

    def of(self, levels: IntArray) -> "InverseFactor":
        """Return the inverse of some unknowns' factor, as of a `DenseFactor`."""
        return InverseFactor(self.inverse[..., levels[:, None], levels])


@dataclass(frozen=True, eq=False)
class BorderedFactor:
    """The factor of a matrix whose first rows and columns are diagonal, without its zeros.

    Parameters
    ----------
    diagonal : ndarray of float, shape (..., n_first)
        Of the first rows.
    border : ndarray of float, shape (..., n_rest, n_first)
        The other rows' first columns.
    corner : ndarray of float, shape (..., n_rest, n_rest)
        Their last columns: a lower factor. There may be none.
    """

    diagonal: FloatArray
    border: FloatArray
    corner: FloatArray

    @property
    def pivots(self) -> FloatArray:
        """Diagonal of R, shape (..., n_first + n_rest)."""
        if not self.corner.shape[-1]:
            return self.diagonal
        last = np.diagonal(self.corner, axis1=-2, axis2=-1)
        return np.concatenate([self.diagonal, last], axis=-1)

    @property
    def nbytes(self) -> int:
        """Memory that it takes."""
        return self.diagonal.nbytes + self.border.nbytes + self.corner.nbytes

    def solve(self, right: FloatArray) -> FloatArray:
        """Return R^-1 x, from (..., n, m)."""
        n = self.diagonal.shape[-1]
        first = right[..., :n, :] / self.diagonal[..., None]
        if right.shape[-2] == n:
            return first
        last = solve_lower(self.corner, right[..., n:, :] - self.border @ first)
        return np.concatenate([first, last], axis=-2)

    def solve_transposed(self, right: FloatArray) -> FloatArray:
        """Return R'^-1 x, from (..., n, m)."""
        n = self.diagonal.shape[-1]
        if right.shape[-2] == n:
            return right / self.diagonal[..., None]
        first, last = right[..., :n, :], right[..., n:, :]
        last = solve_lower(self.corner, last, transposed=True)
        first = (first - np.swapaxes(self.border, -1, -2) @ last) / self.diagonal[..., None]
        return np.concatenate([first, last], axis=-2)

    def inverted(self) -> "BorderedFactor":
        """Return itself: it takes little memory, and is quick."""
        return self

    def of(self, levels: IntArray) -> "BorderedFactor":
        """Return the factor of some of the first unknowns and of all others."""
        first = levels[levels < self.diagonal.shape[-1]]
        return BorderedFactor(self.diagonal[..., first], self.border[..., first], self.corner)


Factor = DenseFactor | BorderedFactor


def cholesky_or_nan(matrix: FloatArray) -> FloatArray:
    """Return lower Cholesky factors of a batch; NaN where a matrix is not positive definite."""
    with suppress(np.linalg.LinAlgError):
        return np.linalg.cholesky(matrix).astype(np.float64, copy=False)
    factors = np.full(matrix.shape, np.nan)
    for place in np.ndindex(matrix.shape[:-2]):
        try:
            factors[place] = np.linalg.cholesky(matrix[place])
        except np.linalg.LinAlgError:
            continue
    return factors


def solve_lower(factor: FloatArray, right: FloatArray, *, transposed: bool = False) -> FloatArray:
    """Solve lower triangular systems of a batch, (..., n, n) and (..., n, m)."""
    n, m = right.shape[-2:]
    batch = np.broadcast_shapes(factor.shape[:-2], right.shape[:-2])
    n_batch = math.prod(batch)
    left = np.broadcast_to(factor, (*batch, n, n)).reshape(n_batch, n, n)
    many = np.broadcast_to(right, (*batch, n, m)).reshape(n_batch, n, m)
    if not many.size:
        return many.reshape(*batch, n, m)
    if n <= _SMALL < n_batch:
        return _substituted(left, many, transposed).reshape(*batch, n, m)
    out = many.copy(order="C")
    for each, x in zip(left, out, strict=True):
        # BLAS takes columns first: rows of both are the transposed equation, solved in place.
        blas.dtrsm(1.0, each.T, x.T, side=1, trans_a=int(transposed), overwrite_b=1)
    return out.reshape(*batch, n, m)


def _substituted(factor: FloatArray, right: FloatArray, transposed: bool) -> FloatArray:
    """Solve by substitution, unknown by unknown for the whole batch at once."""
    n, out = right.shape[1], right.copy()
    for i in reversed(range(n)) if transposed else range(n):
        known = slice(i + 1, n) if transposed else slice(0, i)
        row = factor[:, known, i] if transposed else factor[:, i, known]
        out[:, i] -= (row[:, None, :] @ out[:, known])[:, 0]
        out[:, i] /= factor[:, i, i, None]
    return out
