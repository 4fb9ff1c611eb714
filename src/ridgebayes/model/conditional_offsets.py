r"""Scores of shared offsets given rows with normal errors: a linear-normal problem, batch by batch.

With offsets ``Z L s``, scores ``s`` standard normal and rows of weight ``W`` (one over the error
variance), the scores given residuals ``r`` are normal with precision ``M = I + L' Z' W Z L`` and
mean ``M^-1 L' Z' W r``. Everything else follows: the scores integrated out,

.. math:: r' \Sigma^{-1} r = \sum W (r - Z L \bar s)^2 + \bar s'\bar s, \qquad
          \log|\Sigma| = \log|M| - \sum \log W,

in which no large numbers cancel. M has the size of the offsets, not of the rows.
"""

import math
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import blas

from ridgebayes._types import FloatArray, IntArray

_SMALL = 16  # unknowns: of fewer, a batch is solved faster than system by system
_MANY = 32  # levels of one factor, of which its block is factorised apart from the others'
_INVERTED = 64  # levels up to which ten products with an inverse are quicker than ten solves


class Design:
    """Which level of each factor a row has: the matrix Z, without its zeros.

    Parameters
    ----------
    codes : ndarray of int, shape (n_factor, n_row)
        Level of each row, counted over all factors.
    n_level : int
        Levels of all factors together.
    """

    def __init__(self, codes: IntArray, n_level: int) -> None:
        n_factor, n_row = codes.shape
        # What is gathered by an index has the index's strides, and sums depend on strides in their
        # last digit: the same strides here and in a worker that got a pickled copy.
        codes = codes.copy()
        self.codes, self.n_level, self.diagonal = codes, n_level, n_factor == 1
        # Levels that the first factor alone has: a row is of one of them at most.
        self.n_first = n_level if n_factor == 1 else int(codes[1:].min())
        rows, ones = np.tile(np.arange(n_row), n_factor), np.ones(n_factor * n_row)
        shape = (n_level, n_row)
        self._gather = sparse.csr_array((ones, (codes.ravel(), rows)), shape=shape)
        if not self.diagonal:
            first, second = np.repeat(codes, n_factor, axis=0), np.tile(codes, (n_factor, 1))
            pairs = (first * n_level + second).ravel()
            rows, ones = np.tile(np.arange(n_row), n_factor**2), np.ones(n_factor**2 * n_row)
            shape = (n_level**2, n_row)
            self._pairs = sparse.csr_array((ones, (pairs, rows)), shape=shape)

    @property
    def transposed(self) -> FloatArray:
        """Z' with its zeros, shape (n_level, n_row)."""
        value: FloatArray = self._gather.toarray()
        return value

    def spread(self, b: FloatArray) -> FloatArray:
        """Return Z b: each row's offset, from (..., n_level) to (..., n_row)."""
        return sum((b[..., level] for level in self.codes[1:]), start=b[..., self.codes[0]])

    def gather(self, x: FloatArray) -> FloatArray:
        """Return Z' x, from (..., n_row) to (..., n_level)."""
        return _apply(self._gather, x)

    def gram(self, weight: FloatArray) -> FloatArray:
        """Return Z' W Z; only its diagonal, (..., n_level), where it has nothing else."""
        if self.diagonal:
            return self.gather(weight)
        return _apply(self._pairs, weight).reshape(*weight.shape[:-1], *(2 * (self.n_level,)))


@dataclass(frozen=True, eq=False)
class OffsetPosterior:
    """Normal distribution of the scores given rows, for each of many draws of the parameters.

    Parameters
    ----------
    mean : ndarray of float, shape (..., n_level)
        Means.
    root : ndarray of float, shape (..., n_level) or (..., n_level, n_level)
        Lower Cholesky factor of the precision M; its diagonal alone where M is diagonal.
    """

    mean: FloatArray
    root: FloatArray

    @property
    def _diagonal(self) -> bool:
        return self.root.ndim == self.mean.ndim

    @property
    def pivots(self) -> FloatArray:
        """Diagonal of the factor, shape (..., n_level): 1 of scores that rows say nothing of."""
        return self.root if self._diagonal else np.diagonal(self.root, axis1=-2, axis2=-1)

    @property
    def log_det(self) -> FloatArray:
        """Log |M|, shape (...)."""
        value: FloatArray = 2 * np.log(self.pivots).sum(axis=-1)
        return value

    def at(self, normal: FloatArray) -> FloatArray:
        """Return the scores that standard normals (..., n_level) stand for."""
        if self._diagonal:
            return self.mean + normal / self.root
        return self.mean + solve_lower(self.root, normal[..., None], transposed=True)[..., 0]

    def variance(self, loading: FloatArray) -> FloatArray:
        """Return the variance of scores' combinations (..., n_level, n), shape (..., n)."""
        value: FloatArray = (self.half(loading) ** 2).sum(axis=-2)
        return value

    def inverted(self) -> "OffsetPosterior | InverseFactor":
        """Return what `variance` may be asked of again and again, and takes less memory."""
        if self._diagonal or self.root.shape[-1] > _INVERTED:
            return self
        return InverseFactor(_inverse(self.root))

    def half(self, right: FloatArray) -> FloatArray:
        """Return R^-1 x of the factor M = R R', shape (..., n_level, n)."""
        return right / self.root[..., None] if self._diagonal else solve_lower(self.root, right)


class DiagonalRoot:
    """L of independent offsets: their standard deviations.

    Parameters
    ----------
    scale : ndarray of float, shape (..., n_level)
        The diagonal.
    """

    def __init__(self, scale: FloatArray) -> None:
        self._scale = scale

    def times(self, scores: FloatArray) -> FloatArray:
        """Return L s, shape (..., n_level)."""
        return self._scale * scores

    def transposed_times(self, x: FloatArray) -> FloatArray:
        """Return L' x, shape (..., n_level)."""
        return self._scale * x

    def precision(self, design: Design, weight: FloatArray) -> FloatArray:
        """Return L' Z' W Z L; its diagonal alone, (..., n_level), where it has nothing else."""
        gram = design.gram(weight)
        if gram.ndim == weight.ndim:
            return self._scale**2 * gram
        return self._scale[..., :, None] * gram * self._scale[..., None, :]

    def loading(self, design: Design) -> FloatArray:
        """Return (Z L)', shape (..., n_level, n_row)."""
        return self._scale[..., None] * design.transposed


class FullRoot:
    """L of offsets that vary together: a lower Cholesky factor.

    Parameters
    ----------
    factor : ndarray of float, shape (..., n_level, n_level)
        The factor.
    """

    def __init__(self, factor: FloatArray) -> None:
        self._factor, self._transposed = factor, np.swapaxes(factor, -1, -2)
        self._loading: tuple[Design, FloatArray] | None = None

    def times(self, scores: FloatArray) -> FloatArray:
        """Return L s, shape (..., n_level)."""
        return (self._factor @ scores[..., None])[..., 0]

    def transposed_times(self, x: FloatArray) -> FloatArray:
        """Return L' x, shape (..., n_level)."""
        return (self._transposed @ x[..., None])[..., 0]

    def precision(self, design: Design, weight: FloatArray) -> FloatArray:
        """Return L' Z' W Z L, shape (..., n_level, n_level)."""
        # One factor times itself: half the work of a product of two.
        if design.diagonal:
            half = self._transposed * np.sqrt(design.gather(weight))[..., None, :]
        else:
            half = self.loading(design) * np.sqrt(weight)[..., None, :]
        return half @ np.swapaxes(half, -1, -2)

    def loading(self, design: Design) -> FloatArray:
        """Return (Z L)', shape (..., n_level, n_row); kept for the next call."""
        if self._loading is None or self._loading[0] is not design:
            others = (self._transposed[..., level] for level in design.codes[1:])
            self._loading = design, sum(others, start=self._transposed[..., design.codes[0]])
        return self._loading[1]

    def inverted(self) -> "FullRoot | InverseFactor":
        """Return what `solve` may be asked of again and again, and takes less memory."""
        if self._factor.shape[-1] > _INVERTED:
            return self
        return InverseFactor(_inverse(self._factor))

    def solve(self, right: FloatArray) -> FloatArray:
        """Return L^-1 x, from (..., n_level, m)."""
        return solve_lower(self._factor, right)


@dataclass(frozen=True, eq=False)
class InverseFactor:
    """A lower Cholesky factor, L or that of M, by its inverse: all that predictions ask of it.

    Parameters
    ----------
    inverse : ndarray of float, shape (..., n_level, n_level)
        The inverse.
    """

    inverse: FloatArray

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the inverse times x, from (..., n_level, m)."""
        return self.inverse @ right

    def variance(self, loading: FloatArray) -> FloatArray:
        """Return the variance of scores' combinations (..., n_level, n), shape (..., n)."""
        value: FloatArray = (self.solve(loading) ** 2).sum(axis=-2)
        return value


Root = DiagonalRoot | FullRoot


def precision_root(design: Design, root: Root, weight: FloatArray) -> FloatArray:
    """Return the Cholesky factor of M = I + L' Z' W Z L, its diagonal alone where M is diagonal.

    Parameters
    ----------
    design : Design
        Z.
    root : DiagonalRoot or FullRoot
        L.
    weight : ndarray of float, shape (..., n_row)
        W.

    Returns
    -------
    ndarray of float, shape (..., n_level) or (..., n_level, n_level)
        NaN for draws whose weights are not finite, or so large that M cannot be factorised.
    """
    precision = root.precision(design, weight)
    if precision.ndim == weight.ndim:
        return np.sqrt(precision + 1)
    levels = np.arange(design.n_level)
    precision[..., levels, levels] += 1
    if isinstance(root, DiagonalRoot) and design.n_first > _MANY:
        return _bordered_cholesky(precision, design.n_first)
    return cholesky_or_nan(precision)


def given_rows(
    design: Design,
    root: Root,
    weight: FloatArray,
    residual: FloatArray,
    factor: FloatArray | None = None,
) -> OffsetPosterior:
    """Return the scores' distribution given rows.

    Parameters
    ----------
    design : Design
        Z.
    root : DiagonalRoot or FullRoot
        L.
    weight, residual : ndarray of float, shape (..., n_row)
        W and r; a row may stand for several with one mean.
    factor : ndarray of float, optional
        What `precision_root` returns for the same arguments, where it is known.
    """
    factor = precision_root(design, root, weight) if factor is None else factor
    pull = root.transposed_times(design.gather(weight * residual))
    if factor.ndim == pull.ndim:
        return OffsetPosterior(pull / factor**2, factor)
    half = solve_lower(factor, pull[..., None])
    return OffsetPosterior(solve_lower(factor, half, transposed=True)[..., 0], factor)


def products_given(
    design: Design,
    root: Root,
    weight: FloatArray,
    columns: FloatArray,
    factor: FloatArray | None = None,
) -> FloatArray:
    """Return X' inverse(Sigma) X of fixed columns X of the rows, Sigma = Z L L' Z' + 1/W.

    Parameters
    ----------
    design, root, weight, factor
        As for `given_rows`.
    columns : ndarray of float, shape (n_row, m)
        X.

    Returns
    -------
    ndarray of float, shape (..., m, m)
        By Woodbury's identity.
    """
    factor = precision_root(design, root, weight) if factor is None else factor
    gathered = design.gather(weight[..., None, :] * columns.T)
    each = np.moveaxis(gathered, -2, 0)
    pulls = np.stack([root.transposed_times(pull) for pull in each], axis=-1)
    half = pulls / factor[..., None] if factor.ndim == weight.ndim else solve_lower(factor, pulls)
    return weighted_products(weight, columns) - np.swapaxes(half, -1, -2) @ half


def weighted_products(weight: FloatArray, columns: FloatArray) -> FloatArray:
    """Return X' W X, shape (..., m, m), of fixed columns (n_row, m) and weights (..., n_row)."""
    m = columns.shape[1]
    pairs = (columns[:, :, None] * columns[:, None, :]).reshape(len(columns), m * m)
    return (weight @ pairs).reshape(*weight.shape[:-1], m, m)


def _bordered_cholesky(matrix: FloatArray, n: int) -> FloatArray:
    """Return what `cholesky_or_nan` does of matrices whose first n rows and columns are diagonal.

    The cost grows with n, not with its cube.
    """
    first = np.arange(n)
    diagonal = np.sqrt(matrix[..., first, first])
    border = matrix[..., n:, :n] / diagonal[..., None, :]
    factor = np.zeros_like(matrix)
    factor[..., first, first] = diagonal
    factor[..., n:, :n] = border
    corner = matrix[..., n:, n:] - border @ np.swapaxes(border, -1, -2)
    factor[..., n:, n:] = cholesky_or_nan(corner)
    return factor


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
    if n <= _SMALL < n_batch:
        return _substituted(left, many, transposed).reshape(*batch, n, m)
    out = many.copy(order="C")
    for each, x in zip(left, out, strict=True):
        # BLAS takes columns first: rows of both are the transposed equation, solved in place.
        blas.dtrsm(1.0, each.T, x.T, side=1, trans_a=int(transposed), overwrite_b=1)
    return out.reshape(*batch, n, m)


def _inverse(factor: FloatArray) -> FloatArray:
    return solve_lower(factor, np.broadcast_to(np.eye(factor.shape[-1]), factor.shape))


def _substituted(factor: FloatArray, right: FloatArray, transposed: bool) -> FloatArray:
    """Solve by substitution, unknown by unknown for the whole batch at once."""
    n, out = right.shape[1], right.copy()
    for i in reversed(range(n)) if transposed else range(n):
        known = slice(i + 1, n) if transposed else slice(0, i)
        row = factor[:, known, i] if transposed else factor[:, i, known]
        out[:, i] -= (row[:, None, :] @ out[:, known])[:, 0]
        out[:, i] /= factor[:, i, i, None]
    return out


def _apply(matrix: sparse.csr_array, x: FloatArray) -> FloatArray:
    flat = x.reshape(math.prod(x.shape[:-1]), x.shape[-1])
    return np.ascontiguousarray((matrix @ flat.T).T).reshape(*x.shape[:-1], matrix.shape[0])
