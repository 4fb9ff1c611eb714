"""Log densities of exact loads, brackets and counts, given their shared offsets.

The *error* of a predictor is ``log load - 2 log shape + 2 log rate - offset``; the rate shifts all
rows of a texture by one amount. An exact row has the density of its error. A bracket has the
probability of the interval between its ends, which share one offset. A count Q observed at a load p
means load(Q) <= p < load(Q + 2). These two loads have different offsets, so that a count has two
predictors; the predictors of the lower ends come after those of all rows.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.contact.contact_solution import DEFAULT_REL_TOL
from ridgebayes.errors import InputError
from ridgebayes.model.forms import Form
from ridgebayes.model.observations import Observations
from ridgebayes.model.tails import Tail

# Smallest relative standard error of a load if rows share offsets: the tolerance of half-plane
# loads. Without it, rows that agree to rounding would leave sigma without a lower bound.
MIN_REL_SE = DEFAULT_REL_TOL


@dataclass(frozen=True, eq=False)
class Rows:
    """Log loads of rows relative to the form's shape.

    Parameters
    ----------
    texture : ndarray of int, shape (n_row,)
        Index of each row's texture.
    rel_se : ndarray of float, shape (n_row,), dimensionless
        Known relative standard error of the load.
    exact : ndarray of bool, shape (n_row,)
        Rows with an exact load.
    is_count : ndarray of bool, shape (n_row,)
        Rows with a count observed at a load.
    upper : ndarray of float, shape (n_row,), dimensionless
        log load minus 2 log shape, for an exact load, a bracket's upper end, or a count's load.
        Infinite for a count of 2, which is reached at any load.
    lower : ndarray of float, shape (n_row,), dimensionless
        log load minus 2 log shape, for a bracket's lower end, or for a count's load with the shape
        of Q + 2.
    """

    texture: IntArray
    rel_se: FloatArray
    exact: BoolArray
    is_count: BoolArray
    upper: FloatArray
    lower: FloatArray

    @classmethod
    def of(cls, data: Observations, form: Form, *, share_offsets: bool = False) -> "Rows":
        """Return rows relative to the shape of a form.

        Parameters
        ----------
        data : Observations
            Rows.
        form : Form
            Contact form.
        share_offsets : bool, optional
            Whether rows share offsets; `rel_se` is then at least `MIN_REL_SE`.

        Raises
        ------
        InputError
            If the form has no load for a row's count.
        """
        a, b = data.a_over_R[data.texture], data.b_over_R[data.texture]
        shape = form.shape(data.Q, a, b)
        touched = data.is_count & (data.Q == 2)
        if not np.all((shape > 0) | touched):
            raise InputError(
                f"{form.name}: expected Q >= 4, got a row whose load is zero by this form"
            )
        with np.errstate(divide="ignore"):
            log_shape = np.log(np.where(touched, 1.0, shape))
        upper = np.where(touched, np.inf, data.log_load - 2 * log_shape)
        lower = data.log_lower - 2 * log_shape
        counts = np.flatnonzero(data.is_count)
        if len(counts):
            later = form.shape(data.Q[counts] + 2, a[counts], b[counts])
            lower[counts] = data.log_load[counts] - 2 * np.log(later)
        exact = data.is_exact
        lower[exact] = upper[exact]
        rel_se = np.maximum(data.rel_se, MIN_REL_SE) if share_offsets else data.rel_se
        return cls(data.texture, rel_se, exact, data.is_count, upper, lower)

    @cached_property
    def centre(self) -> tuple[FloatArray, FloatArray]:
        """Middle of each row's interval, and variance of a uniform distribution over its width.

        If one end is infinite, or the width above 1 (a factor of 2.7 in load), the interval of
        width 1 at the other end is used. Only proposals use these rough values.
        """
        upper = np.where(np.isfinite(self.upper), self.upper, self.lower + 1)
        lower = np.maximum(self.lower, upper - 1)
        return 0.5 * (upper + lower), (upper - lower) ** 2 / 12

    @cached_property
    def counts(self) -> IntArray:
        """Indices of the rows with counts, shape (n_count,)."""
        return np.flatnonzero(self.is_count)

    @cached_property
    def _intervals(self) -> IntArray:
        return np.flatnonzero(~self.exact)

    @cached_property
    def _is_count_interval(self) -> BoolArray:
        """Mask of the intervals that are counts."""
        value: BoolArray = self.is_count[self._intervals]
        return value

    def errors(self, log_rates: FloatArray, offset: FloatArray | float = 0.0) -> FloatArray:
        """Return the error of each predictor, shape (..., n_row + n_count).

        Parameters
        ----------
        log_rates : ndarray of float, shape (..., n_texture)
            log rate of each texture.
        offset : ndarray of float, shape (..., n_row + n_count), optional
            Offset of each predictor.
        """
        ends = np.concatenate([self.upper, self.lower[self.counts]])
        texture = np.concatenate([self.texture, self.texture[self.counts]])
        return ends + 2 * log_rates[..., texture] - offset

    def scale(self, sigma: FloatArray) -> FloatArray:
        """Return the scale of each row's own error, shape (..., n_row)."""
        value: FloatArray = np.sqrt(sigma[..., None] ** 2 + self.rel_se**2)
        return value

    def log_density(
        self, error: FloatArray, scale: FloatArray, tail: Tail, df: FloatArray | None
    ) -> FloatArray:
        """Return the log density of exact rows and the log probability of the others.

        Parameters
        ----------
        error : ndarray of float, shape (..., n_row + n_count)
            As `errors` returns them.
        scale : ndarray of float, shape (..., n_row)
            Scale of each row's own error.
        tail : Tail
            Distribution of the rows' own errors.
        df : ndarray of float, shape (..., 1), or None
            Degrees of freedom of Student errors.

        Returns
        -------
        ndarray of float, shape (..., n_row)
            Natural logarithms of densities and probabilities.
        """
        n = len(self.upper)
        if self.exact.all():
            return tail.log_density(error / scale, df) - np.log(scale)
        value = np.empty((*error.shape[:-1], n))
        if self.exact.any():
            scale_of_exact = np.broadcast_to(scale, value.shape)[..., self.exact]
            z = error[..., :n][..., self.exact] / scale_of_exact
            value[..., self.exact] = tail.log_density(z, df) - np.log(scale_of_exact)
        value[..., self._intervals] = self._log_probability(error, scale, tail, df)
        return value

    def _log_probability(
        self, error: FloatArray, scale: FloatArray, tail: Tail, df: FloatArray | None
    ) -> FloatArray:
        """Return log probabilities of brackets and counts, shape (..., n_interval)."""
        rows, is_count = self._intervals, self._is_count_interval
        scale = np.broadcast_to(scale, (*error.shape[:-1], len(self.upper)))[..., rows]
        high = error[..., rows]
        width = np.broadcast_to(self.upper[rows] - self.lower[rows], high.shape)
        with np.errstate(invalid="ignore"):  # a count of 2 has infinite ends
            low = high - width
        if is_count.any():
            low = low.copy()
            low[..., is_count] = error[..., len(self.upper) :]
            distance = error[..., rows[is_count]] - low[..., is_count]
            width = width.copy()
            # Offsets can put load(Q + 2) below load(Q), although the further ridge cannot be
            # reached first. Such an interval has width and probability zero.
            width[..., is_count] = np.maximum(distance, 0)
            low = np.minimum(low, high)
        return tail.log_probability(low / scale, high / scale, df, width / scale)


@dataclass(frozen=True, eq=False)
class RowGroups:
    """Groups of exact rows with equal texture, known error and offset levels.

    Parameters
    ----------
    row : ndarray of int, shape (n_group,)
        Index of one row of each group.
    n, mean, sum_of_squares : ndarray of float, shape (n_group,)
        Number of rows, and mean of their `Rows.upper` with the sum of squares about it.
    of_row : ndarray of int, shape (n_row,)
        Index of each row's group.
    """

    row: IntArray
    n: FloatArray
    mean: FloatArray
    sum_of_squares: FloatArray
    of_row: IntArray

    @classmethod
    def of(cls, rows: Rows, levels: IntArray) -> "RowGroups":
        """Group rows by texture, known error and offset levels, shape (n_factor, n_row)."""
        keys = np.stack([rows.texture, np.unique(rows.rel_se, return_inverse=True)[1], *levels])
        _, first, group = np.unique(keys, axis=1, return_index=True, return_inverse=True)
        group = group.reshape(-1)
        n = np.bincount(group).astype(float)
        mean = np.bincount(group, rows.upper) / n
        # A difference of sums of squares would cancel: residuals are 1e-2 on values of 10.
        squares = np.bincount(group, (rows.upper - mean[group]) ** 2).astype(float)
        return cls(first, n, mean, squares, group)
