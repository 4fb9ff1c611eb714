"""Cholesky factors and triangular solves for batches of small matrices."""

import math
from contextlib import suppress

import numpy as np
from scipy.linalg import blas, lapack

from ridgebayes._types import FloatArray

_MAX_BATCHED_SIZE = 16  # unknowns; larger systems are solved faster one by one


def cholesky_or_nan(matrix: FloatArray) -> FloatArray:
    """Return the lower Cholesky factors of a batch; NaN if a matrix is not positive definite."""
    with suppress(np.linalg.LinAlgError):
        return np.linalg.cholesky(matrix).astype(np.float64, copy=False)
    factors = matrix.copy(order="C")
    for factor in factors.reshape(-1, *matrix.shape[-2:]):
        # LAPACK stores arrays by column, so that it returns, in place, the upper factor.
        _, info = lapack.dpotrf(factor.T, overwrite_a=1)
        if info:
            factor[:] = np.nan
    return factors


def solve_lower(factor: FloatArray, right: FloatArray, *, transposed: bool = False) -> FloatArray:
    """Solve lower triangular systems of a batch, (..., n, n) and (..., n, m)."""
    n, m = right.shape[-2:]
    batch = np.broadcast_shapes(factor.shape[:-2], right.shape[:-2])
    n_batch = math.prod(batch)
    factors = np.broadcast_to(factor, (*batch, n, n)).reshape(n_batch, n, n)
    columns = np.broadcast_to(right, (*batch, n, m)).reshape(n_batch, n, m)
    if not columns.size:
        return np.zeros((*batch, n, m))
    if n <= _MAX_BATCHED_SIZE < n_batch:
        return _substituted(factors, columns, transposed).reshape(*batch, n, m)
    out = columns.copy(order="C")
    for matrix, x in zip(factors, out, strict=True):
        # BLAS stores arrays by column, so that it sees, and solves in place, the transposed system.
        blas.dtrsm(1.0, matrix.T, x.T, side=1, trans_a=int(transposed), overwrite_b=1)
    return out.reshape(*batch, n, m)


def _substituted(factor: FloatArray, right: FloatArray, transposed: bool) -> FloatArray:
    """Solve by substitution, one unknown at a time for the whole batch."""
    n, out = right.shape[1], right.copy()
    for i in reversed(range(n)) if transposed else range(n):
        before = slice(i + 1, n) if transposed else slice(0, i)
        row = factor[:, before, i] if transposed else factor[:, i, before]
        out[:, i] -= (row[:, None, :] @ out[:, before])[:, 0]
        out[:, i] /= factor[:, i, i, None]
    return out
