"""Log densities of rows given their shared offsets: exact loads, brackets, counts.

The *error* of a predictor is ``log load - 2 log shape + 2 log rate - offset``, in which the rate
shifts all rows of a texture alike. An exact row has the density of its error. A bracket has the
probability between its ends, which share one offset. A count Q seen at a load p says
load(Q) <= p < load(Q + 2): its two ends have offsets, and so predictors, of their own; those of the
lower ends follow those of the rows.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.model.forms import Form
from ridgebayes.model.observations import Observations
from ridgebayes.model.tails import Tail

# Relative standard error that a load has at least where rows share offsets: the tolerance of
# half-plane loads. Rows that agree to rounding would leave sigma without a lower bound.
LEAST_REL_SE = 1e-8
# Share of the majorising weight that a curvature has to reach for a Newton step (Student errors
# have none beyond the root of df), and least share for points around a mode.
_LEAST_CURVATURE, _LEAST_PRECISION = 0.3, 0.25
# Inside a wide interval the density is flat: points get this share of a uniform error's precision.
_UNIFORM_PRECISION = 0.7


class Expansion(NamedTuple):
    """Second-order expansion of the rows' log density in the offsets.

    Parameters
    ----------
    gradient : ndarray of float, shape (..., n_predictor)
        Derivative by each predictor's offset.
    precision : ndarray of float, shape (..., n_predictor)
        Minus the second derivatives, or positive values in their place.
    crossed : ndarray of float, shape (..., n_count)
        Minus the mixed second derivatives of the two ends of counts.
    """

    gradient: FloatArray
    precision: FloatArray
    crossed: FloatArray


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows with the form's shape taken off, one by one.

    Parameters
    ----------
    texture : ndarray of int, shape (n_row,)
        Index of each row's texture.
    rel_se : ndarray of float, shape (n_row,), dimensionless
        Known relative standard error of the load.
    exact : ndarray of bool, shape (n_row,)
        Rows that give the load itself.
    is_count : ndarray of bool, shape (n_row,)
        Rows that say which count was seen at a load.
    upper : ndarray of float, shape (n_row,), dimensionless
        log load less 2 log shape: of the load itself, of a bracket's upper end, of the load at
        which a count was seen. Infinite for a count of 2, which any load is enough for.
    lower : ndarray of float, shape (n_row,), dimensionless
        The same of a bracket's lower end, and of a count's load less the shape of Q + 2.
    """

    texture: IntArray
    rel_se: FloatArray
    exact: BoolArray
    is_count: BoolArray
    upper: FloatArray
    lower: FloatArray

    @classmethod
    def of(cls, data: Observations, form: Form, *, share_offsets: bool = False) -> "Rows":
        """Take the shape of a form off some rows.

        Parameters
        ----------
        data : Observations
            Rows.
        form : Form
            Contact form.
        share_offsets : bool, optional
            Whether rows share offsets; none is known better than `LEAST_REL_SE` then.

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
        rel_se = np.maximum(data.rel_se, LEAST_REL_SE) if share_offsets else data.rel_se
        return cls(data.texture, rel_se, exact, data.is_count, upper, lower)

    @cached_property
    def centre(self) -> tuple[FloatArray, FloatArray]:
        """Each row's middle and the variance of a uniform error within its width.

        Where one end is infinite, or the width above 1 (a factor of 2.7 in load), a width of 1 at
        the other end stands for it: a rough value for proposals, whose weights correct it.
        """
        upper = np.where(np.isfinite(self.upper), self.upper, self.lower + 1)
        lower = np.maximum(self.lower, upper - 1)
        return 0.5 * (upper + lower), (upper - lower) ** 2 / 12

    @cached_property
    def counts(self) -> IntArray:
        """Numbers of the rows that count, shape (n_count,)."""
        return np.flatnonzero(self.is_count)

    @cached_property
    def _intervals(self) -> IntArray:
        return np.flatnonzero(~self.exact)

    @cached_property
    def _is_window(self) -> BoolArray:
        """Which of the intervals are counts."""
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
            Its parameter.

        Returns
        -------
        ndarray of float, shape (..., n_row)
            Natural logarithms.
        """
        n = len(self.upper)
        if self.exact.all():
            return tail.log_density(error / scale, df) - np.log(scale)
        value = np.empty((*error.shape[:-1], n))
        if self.exact.any():
            own = np.broadcast_to(scale, value.shape)[..., self.exact]
            z = error[..., :n][..., self.exact] / own
            value[..., self.exact] = tail.log_density(z, df) - np.log(own)
        value[..., self._intervals] = self._interval(error, scale, tail, df)[0]
        return value

    def _interval(
        self, error: FloatArray, scale: FloatArray, tail: Tail, df: FloatArray | None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return log probabilities of intervals, and their lower and upper ends in scales."""
        rows, windows = self._intervals, self._is_window
        scale = np.broadcast_to(scale, (*error.shape[:-1], len(self.upper)))[..., rows]
        high = error[..., rows]
        width = np.broadcast_to(self.upper[rows] - self.lower[rows], high.shape)
        with np.errstate(invalid="ignore"):  # a count of 2 has infinite ends
            low = high - width
        if windows.any():
            low = low.copy()
            low[..., windows] = error[..., len(self.upper) :]
            apart = error[..., rows[windows]] - low[..., windows]
            width = width.copy()
            # A load cannot reach a further ridge before a nearer one: P(Q >= n) is the running
            # minimum over n where offsets turn two loads round.
            width[..., windows] = np.maximum(apart, 0)
            low = np.minimum(low, high)
        low, high, width = low / scale, high / scale, width / scale
        return tail.log_probability(low, high, df, width), low, high

    def expansion(
        self,
        error: FloatArray,
        scale: FloatArray,
        tail: Tail,
        df: FloatArray | None,
        *,
        for_points: bool = False,
    ) -> Expansion:
        """Return gradient and precision of the log density in the offsets.

        Parameters
        ----------
        error, scale, tail, df
            As for `log_density`.
        for_points : bool, optional
            Return precisions for points around a mode, wide enough for the tails of weights to be
            light, in place of those for a Newton step.
        """
        n = len(self.upper)
        scale = np.broadcast_to(scale, (*error.shape[:-1], n))
        gradient, precision = np.zeros(error.shape), np.zeros(error.shape)
        crossed = np.zeros((*error.shape[:-1], len(self.counts)))
        if self.exact.any():
            here = np.flatnonzero(self.exact)
            own = scale[..., here]
            z = error[..., here] / own
            weight, curvature = tail.weight(z, df), tail.curvature(z, df)
            if for_points:
                curvature = np.maximum(curvature, _LEAST_PRECISION * weight)
            else:
                curvature = np.where(curvature > _LEAST_CURVATURE * weight, curvature, weight)
            gradient[..., here] = tail.score(z, df) / own
            precision[..., here] = curvature / own**2
        if len(self._intervals):
            self._expand_intervals(
                (gradient, precision, crossed), error, scale, tail, df, for_points=for_points
            )
        return Expansion(gradient, precision, crossed)

    def _expand_intervals(
        self,
        out: tuple[FloatArray, FloatArray, FloatArray],
        error: FloatArray,
        scale: FloatArray,
        tail: Tail,
        df: FloatArray | None,
        *,
        for_points: bool,
    ) -> None:
        """Write the expansions of brackets and counts into arrays of all predictors."""
        gradient, precision, crossed = out
        rows, windows, n = self._intervals, self._is_window, len(self.upper)
        log_p, low, high = self._interval(error, scale, tail, df)
        own = scale[..., rows]

        def at_end(z: FloatArray) -> tuple[FloatArray, FloatArray]:
            """Return density over probability at an end, and the same times the score there."""
            ratio = np.nan_to_num(np.exp(tail.log_density(z, df) - log_p), posinf=0.0)
            with np.errstate(invalid="ignore"):
                return ratio, np.where(np.isfinite(z), ratio * tail.score(z, df), 0.0)

        with np.errstate(all="ignore"):
            a, a_score = at_end(high)
            b, b_score = at_end(low)
            at_high, at_low, mixed = a_score + a * a, b * b - b_score, -a * b
            outside = np.where(low > 0, low, np.where(high < 0, high, 0.0))
            weight = tail.weight(outside, df)
            # Student errors: outside the interval the log density is not concave.
            is_flat = (at_high + at_low + 2 * mixed < _LEAST_CURVATURE * weight) & (outside != 0)
            is_flat &= tail.parameter_names != ()
            at_high = np.where(is_flat, np.where(high < 0, weight, 0.0), at_high)
            at_low = np.where(is_flat, np.where(low > 0, weight, 0.0), at_low)
            mixed = np.where(is_flat, 0.0, mixed)
            if for_points:
                floor = _UNIFORM_PRECISION / (1 + (high - low) ** 2 / 12)
                short = np.maximum(floor - (at_high + at_low + 2 * mixed), 0) / 4
                at_high, at_low, mixed = at_high + short, at_low + short, mixed + short
        one = ~windows
        square = own**2
        gradient[..., rows[one]] = ((b - a) / own)[..., one]
        precision[..., rows[one]] = ((at_high + at_low + 2 * mixed) / square)[..., one]
        gradient[..., rows[windows]] = (-a / own)[..., windows]
        gradient[..., n:] = (b / own)[..., windows]
        precision[..., rows[windows]] = (at_high / square)[..., windows]
        precision[..., n:] = (at_low / square)[..., windows]
        crossed[...] = (mixed / square)[..., windows]


@dataclass(frozen=True, eq=False)
class RowGroups:
    """Exact rows alike in texture, known error and offsets: number, mean, sum of squares.

    Parameters
    ----------
    row : ndarray of int, shape (n_group,)
        A row of each group.
    n, mean, sum_of_squares : ndarray of float, shape (n_group,)
        Number of rows, and the mean and the sum of squares about it of their `Rows.upper`.
    of_row : ndarray of int, shape (n_row,)
        Group of each row.
    """

    row: IntArray
    n: FloatArray
    mean: FloatArray
    sum_of_squares: FloatArray
    of_row: IntArray

    @classmethod
    def of(cls, rows: Rows, levels: IntArray) -> "RowGroups":
        """Group rows; `levels`, shape (n_factor, n_row), are those of their offsets."""
        keys = np.stack([rows.texture, np.unique(rows.rel_se, return_inverse=True)[1], *levels])
        _, first, group = np.unique(keys, axis=1, return_index=True, return_inverse=True)
        group = group.reshape(-1)
        n = np.bincount(group).astype(float)
        mean = np.bincount(group, rows.upper) / n
        # About the mean, not as a difference of squares: residuals are 1e-2 on values of 10.
        squares = np.bincount(group, (rows.upper - mean[group]) ** 2).astype(float)
        return cls(first, n, mean, squares, group)
