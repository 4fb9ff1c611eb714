"""Precision of the scores of offsets, factorised for many draws at once."""

from dataclasses import dataclass

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.model.design import DesignMatrix
from ridgebayes.model.linear_algebra import cholesky_or_nan, solve_lower
from ridgebayes.model.offsets import Root


@dataclass(frozen=True, eq=False)
class Precision:
    """Cholesky factor R of M = I + L' Z' W Z L, whose first block is diagonal.

    Parameters
    ----------
    root : Root
        L.
    diagonal : ndarray of float, shape (..., n_first)
        Diagonal of R in the first block.
    border : ndarray of float, shape (..., n_rest, n_first)
        Rows of the rest in R, columns of the first block.
    corner : ndarray of float, shape (..., n_rest, n_rest)
        Rows and columns of the rest in R, lower triangular.
    """

    root: Root
    diagonal: FloatArray
    border: FloatArray
    corner: FloatArray

    @classmethod
    def of(cls, design: DesignMatrix, root: Root, weight: FloatArray) -> "Precision":
        """Factorise M; draws whose M is not numerically positive definite get NaN.

        The cost is linear in the number of textures and cubic in the number of other levels.
        """
        first, border, corner = design.gram(weight)
        border, corner = root.inside(border, corner)
        diagonal = np.sqrt(1 + root.first**2 * first)
        border = border / diagonal[..., None, :]
        if not design.n_rest:
            return cls(root, diagonal, border, corner)
        corner = corner + np.eye(design.n_rest)
        if design.n_first:
            corner = corner - border @ np.swapaxes(border, -1, -2)
        return cls(root, diagonal, border, cholesky_or_nan(corner))

    @property
    def log_volume(self) -> FloatArray:
        """Half of log |M|, shape (...)."""
        corner = np.diagonal(self.corner, axis1=-2, axis2=-1)
        value: FloatArray = np.log(self.diagonal).sum(axis=-1) + np.log(corner).sum(axis=-1)
        return value

    def half(self, first: FloatArray, rest: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return R^-1 x for columns x, (..., n, m)."""
        first = first / self.diagonal[..., None]
        if self.diagonal.shape[-1] and self.corner.shape[-1]:
            rest = rest - self.border @ first
        return first, solve_lower(self.corner, rest)

    def back(self, first: FloatArray, rest: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return R'^-1 x for columns x, (..., n, m)."""
        rest = solve_lower(self.corner, rest, transposed=True)
        if self.diagonal.shape[-1] and self.corner.shape[-1]:
            first = first - np.swapaxes(self.border, -1, -2) @ rest
        return first / self.diagonal[..., None], rest

    def solve(self, first: FloatArray, rest: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return M^-1 x for one column x, (..., n)."""
        solution = self.back(*self.half(first[..., None], rest[..., None]))
        return solution[0][..., 0], solution[1][..., 0]

    def predictor_variance(self, design: DesignMatrix) -> FloatArray:
        """Return the variance of each predictor's offset given the rows, shape (n_draw, n)."""
        root, n_draw, n = self.root, len(self.diagonal), len(design.distinct)
        variance = np.zeros((n_draw, n))
        # Rows of Z L; copying columns of L' would take many times as long.
        rest = np.zeros((n_draw, n, design.n_rest))
        for levels in design.rest[:, design.distinct]:
            rest += root.rest.take(levels, axis=1)
        if design.first is not None:
            first = design.first[design.distinct]
            diagonal_part = (root.first / self.diagonal)[:, first]
            variance += diagonal_part**2
            border = np.swapaxes(self.border, -1, -2).take(first, axis=1)
            rest -= border * diagonal_part[..., None]
        variance += (solve_lower(self.corner, np.swapaxes(rest, -1, -2)) ** 2).sum(axis=-2)
        return variance[:, design.combination]
