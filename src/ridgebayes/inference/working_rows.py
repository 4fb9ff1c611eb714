"""Normal approximations of rows that are not normal, around which points are drawn.

As in generalised linear models, each row gets a working response and a working weight. A Student
row is a normal row of unknown variance, and its weight is the mean precision given its residual.
Response and weight of an interval follow from slope and curvature of its log probability, averaged
over the offset's distribution: without the average, the curvature is 0 inside a wide interval and
far too large at its ends. Working rows only determine the positions of points; the points' weights
use the exact densities of the rows.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.model.rows import Rows
from ridgebayes.model.tails import NormalTail, Tail

_NORMAL = NormalTail()


@dataclass(frozen=True, eq=False)
class WorkingRows:
    """Working weights and responses of predictors, for many draws.

    Parameters
    ----------
    rows : Rows
        Rows.
    error : ndarray of float, shape (n_draw, n_predictor)
        Errors without offsets.
    variance : ndarray of float, shape (n_draw, n_row)
        Variance of the rows' own errors; the squared scale of Student errors.
    df : ndarray of float, shape (n_draw, 1), or None
        Degrees of freedom of Student errors.
    weight, mean : ndarray of float, shape (n_draw, n_predictor)
        Precision and mean of each predictor's normal approximation, as a function of its offset.
    """

    rows: Rows
    error: FloatArray
    variance: FloatArray
    df: FloatArray | None
    weight: FloatArray
    mean: FloatArray

    @classmethod
    def begun(
        cls,
        rows: Rows,
        error: FloatArray,
        scale: FloatArray,
        tail: Tail,
        df: FloatArray | None,
        prior_variance: FloatArray,
    ) -> "WorkingRows":
        """Return initial working rows, before the offsets have been estimated.

        Brackets become normal rows at their middles, and counts get weight 0. Student rows with
        residuals far larger than errors and offsets explain get small weights.
        """
        n = len(rows.upper)
        middle, uniform = rows.centre
        finite = np.isfinite(rows.upper)
        shift = np.where(finite, middle - np.where(finite, rows.upper, 0.0), 0.0)
        mean = np.where(np.isfinite(error), error, 0.0)
        mean[:, :n] += shift
        variance = np.broadcast_to(scale**2, (len(error), n))
        total = variance + uniform
        weight = np.zeros(error.shape)
        z = mean[:, :n] / np.sqrt(total + prior_variance[:, :n])
        weight[:, :n] = np.where(rows.is_count, 0.0, tail.weight(z, df) / total)
        return cls(rows, error, variance, df, weight, mean)

    def renewed(self, offset: FloatArray, spread: FloatArray) -> "WorkingRows":
        """Return working rows updated to the current distribution of the offsets.

        Parameters
        ----------
        offset, spread : ndarray of float, shape (n_draw, n_predictor)
            Mean and variance of each predictor's offset.
        """
        weight, mean = self.weight.copy(), self.mean.copy()
        n, exact = len(self.rows.upper), np.flatnonzero(self.rows.exact)
        if self.df is not None and len(exact):
            row_variance = self.variance[:, exact]
            square = (self.mean - offset)[:, exact] ** 2
            share = np.minimum((spread * self.weight)[:, exact], 1.0)
            # The expected squared residual includes the offset's variance, which is `share` times
            # the row's unknown variance. Solving for this variance at fixed share converges in
            # fewer passes than inserting its last value, which gains a factor of df + 1 per pass.
            weight[:, exact] = (self.df + 1 - share) / (self.df * row_variance + square)
        ends = np.concatenate([np.flatnonzero(~self.rows.exact), np.arange(n, offset.shape[1])])
        if len(ends):
            weight[:, ends], mean[:, ends] = self._intervals(ends, offset, spread)
        return replace(self, weight=weight, mean=mean)

    def _intervals(
        self, ends: np.ndarray, offset: FloatArray, spread: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return working weights and responses of brackets and of both ends of counts."""
        rows, n = self.rows, len(self.rows.upper)
        row = np.concatenate([np.arange(n), rows.counts])[ends]
        row_variance = self.variance[:, row]
        if self.df is not None:  # variance of the normal distribution with equal Fisher information
            row_variance = row_variance * (self.df + 3) / (self.df + 1)
        is_lower, is_count = ends >= n, rows.is_count[row]
        high = np.where(is_lower, np.inf, self.error[:, ends])
        low = np.where(is_lower, self.error[:, ends], -np.inf)
        low = np.where(is_count, low, high - (rows.upper - rows.lower)[row])
        centre, spread = offset[:, ends], spread[:, ends]
        sd = np.sqrt(spread + row_variance)
        alpha, beta = (low - centre) / sd, (high - centre) / sd
        log_p = _NORMAL.log_probability(alpha, beta, None)

        def ratio(z: FloatArray) -> tuple[FloatArray, FloatArray]:
            value = np.exp(np.where(np.isfinite(z), -0.5 * z * z - log_p, -np.inf))
            value = value / math.sqrt(2 * math.pi)
            return value, np.where(np.isfinite(z), z, 0.0) * value

        (a, a_z), (b, b_z) = ratio(alpha), ratio(beta)
        gradient = (a - b) / sd
        precision = np.maximum(gradient**2 + (b_z - a_z) / sd**2, 0.0)
        with np.errstate(all="ignore"):
            mean = centre + np.where(precision > 0, gradient / precision, 0.0)
        usable = np.isfinite(precision) & np.isfinite(mean)
        return np.where(usable, precision, 0.0), np.where(usable, mean, 0.0)
