r"""Scores of shared offsets given rows with normal errors: a linear-normal problem, batch by batch.

With offsets ``Z L s``, scores ``s`` standard normal and rows of weight ``W`` (one over the error
variance), the scores given residuals ``r`` are normal with precision ``M = I + L' Z' W Z L`` and
mean ``M^-1 L' Z' W r``. Everything else follows: the scores integrated out,

.. math:: r' \Sigma^{-1} r = \sum W (r - Z L \bar s)^2 + \bar s'\bar s, \qquad
          \log|\Sigma| = \log|M| - \sum \log W,

in which no large numbers cancel. M has the size of the offsets, not of the rows.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.model.cholesky import (
    BorderedFactor,
    DenseFactor,
    Factor,
    InverseFactor,
    cholesky_or_nan,
    solve_lower,
)

Blocks = tuple[FloatArray, FloatArray, FloatArray]  # of a matrix: diagonal first, border, corner


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
        # Pairs of a further level with any: the border, then the corner.
        n_rest = n_level - self.n_first
        first, second = np.repeat(codes, n_factor, axis=0), np.tile(codes, (n_factor, 1))
        pairs = ((first - self.n_first) * n_level + second).ravel()
        rows = np.tile(np.arange(n_row), n_factor**2)[pairs >= 0]
        shape = (n_rest * n_level, n_row)
        pairs = pairs[pairs >= 0]
        self._pairs = sparse.csr_array((np.ones(len(rows)), (pairs, rows)), shape=shape)

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

    def gram(self, weight: FloatArray) -> Blocks:
        """Return Z' W Z: its first levels' diagonal, the further levels' border and corner."""
        n, n_rest = self.n_first, self.n_level - self.n_first
        first = self.gather(weight)
        if not n_rest:
            border, corner = (np.empty((*weight.shape[:-1], 0, size)) for size in (n, 0))
            return first, border, corner
        pairs = _apply(self._pairs, weight).reshape(*weight.shape[:-1], n_rest, self.n_level)
        return first[..., :n], pairs[..., :n], pairs[..., n:]


@dataclass(frozen=True, eq=False)
class OffsetPosterior:
    """Normal distribution of the scores given rows, for each of many draws of the parameters.

    Parameters
    ----------
    mean : ndarray of float, shape (..., n_level)
        Means.
    factor : DenseFactor or BorderedFactor
        Lower Cholesky factor R of the precision M.
    """

    mean: FloatArray
    factor: Factor

    @property
    def pivots(self) -> FloatArray:
        """Diagonal of the factor, shape (..., n_level): 1 of scores that rows say nothing of."""
        return self.factor.pivots

    @property
    def log_det(self) -> FloatArray:
        """Log |M|, shape (...)."""
        value: FloatArray = 2 * np.log(self.pivots).sum(axis=-1)
        return value

    def at(self, normal: FloatArray) -> FloatArray:
        """Return the scores that standard normals (..., n_level) stand for."""
        return self.mean + self.factor.solve_transposed(normal[..., None])[..., 0]

    def half(self, right: FloatArray) -> FloatArray:
        """Return R^-1 x, shape (..., n_level, n)."""
        return self.factor.solve(right)

    def row_variance(self, root: "Root", design: Design) -> FloatArray:
        """Return the variance of each row's offset, shape (..., n_row)."""
        if isinstance(self.factor, DenseFactor):
            return square_sum(self.half(root.loading(design)))
        # A row is of one of the first levels: nothing has the size of levels x rows.
        assert isinstance(root, DiagonalRoot)
        n, first = self.factor.diagonal.shape[-1], design.codes[0]
        own = root.scale[..., first] / self.factor.diagonal[..., first]
        right = root.scale[..., n:, None] * design.transposed[n:]
        right = right - self.factor.border[..., first] * own[..., None, :]
        return own**2 + square_sum(solve_lower(self.factor.corner, right))


def square_sum(half: FloatArray) -> FloatArray:
    """Return the sum of squares over levels, (..., n) from (..., n_level, n)."""
    value: FloatArray = (half * half).sum(axis=-2)
    return value


class DiagonalRoot:
    """L of independent offsets: their standard deviations.

    Parameters
    ----------
    scale : ndarray of float, shape (..., n_level)
        The diagonal.
    """

    def __init__(self, scale: FloatArray) -> None:
        self.scale = scale

    def times(self, scores: FloatArray) -> FloatArray:
        """Return L s, shape (..., n_level)."""
        return self.scale * scores

    def transposed_times(self, x: FloatArray) -> FloatArray:
        """Return L' x, shape (..., n_level)."""
        return self.scale * x

    def precision(self, design: Design, weight: FloatArray) -> Blocks:
        """Return L' Z' W Z L in the blocks of `Design.gram`."""
        first, border, corner = design.gram(weight)
        n = design.n_first
        own, rest = self.scale[..., :n], self.scale[..., n:]
        if not rest.shape[-1]:
            return own**2 * first, border, corner
        further = rest[..., None]
        return (
            own**2 * first,
            further * border * own[..., None, :],
            further * corner * rest[..., None, :],
        )

    def loading(self, design: Design) -> FloatArray:
        """Return (Z L)', shape (..., n_level, n_row)."""
        return self.scale[..., None] * design.transposed


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

    def inverted(self) -> DenseFactor | InverseFactor:
        """Return what `solve` may be asked of again and again, and takes less memory."""
        return DenseFactor(self._factor).inverted()

    def solve(self, right: FloatArray) -> FloatArray:
        """Return L^-1 x, from (..., n_level, m)."""
        return solve_lower(self._factor, right)


Root = DiagonalRoot | FullRoot


def precision_root(design: Design, root: Root, weight: FloatArray) -> Factor:
    """Return the Cholesky factor of M = I + L' Z' W Z L.

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
    DenseFactor or BorderedFactor
        NaN for draws whose weights are not finite, or so large that M cannot be factorised.

    Notes
    -----
    *Cost.* Of independent offsets it grows with the levels of the first factor, and with the cube
    of the others' number.
    """
    if isinstance(root, FullRoot):
        precision = root.precision(design, weight)
        levels = np.arange(design.n_level)
        precision[..., levels, levels] += 1
        return DenseFactor(cholesky_or_nan(precision))
    first, border, corner = root.precision(design, weight)
    diagonal = np.sqrt(first + 1)
    if not corner.shape[-1]:
        return BorderedFactor(diagonal, border, corner)
    border = border / diagonal[..., None, :]
    corner = corner + np.eye(corner.shape[-1]) - border @ np.swapaxes(border, -1, -2)
    return BorderedFactor(diagonal, border, cholesky_or_nan(corner))


def given_rows(
    design: Design,
    root: Root,
    weight: FloatArray,
    residual: FloatArray,
    factor: Factor | None = None,
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
    factor : DenseFactor or BorderedFactor, optional
        What `precision_root` returns for the same arguments, where it is known.
    """
    factor = precision_root(design, root, weight) if factor is None else factor
    pull = root.transposed_times(design.gather(weight * residual))
    half = factor.solve(pull[..., None])
    return OffsetPosterior(factor.solve_transposed(half)[..., 0], factor)


def products_given(
    design: Design,
    root: Root,
    weight: FloatArray,
    columns: FloatArray,
    factor: Factor | None = None,
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
    half = factor.solve(pulls)
    return weighted_products(weight, columns) - np.swapaxes(half, -1, -2) @ half


def weighted_products(weight: FloatArray, columns: FloatArray) -> FloatArray:
    """Return X' W X, shape (..., m, m), of fixed columns (n_row, m) and weights (..., n_row)."""
    m = columns.shape[1]
    pairs = (columns[:, :, None] * columns[:, None, :]).reshape(len(columns), m * m)
    return (weight @ pairs).reshape(*weight.shape[:-1], m, m)


def _apply(matrix: sparse.csr_array, x: FloatArray) -> FloatArray:
    flat = x.reshape(math.prod(x.shape[:-1]), x.shape[-1])
    return np.ascontiguousarray((matrix @ flat.T).T).reshape(*x.shape[:-1], matrix.shape[0])
