"""Normal rows in place of rows whose densities are not normal, to draw points around.

As in generalised linear models each row gets a working response and a working weight. A Student row
is a normal of unknown variance: its weight is the mean precision given the residual. Intervals get
slope and curvature of their log probability, averaged over the offset's spread: without the average
the curvature inside a wide interval is 0 and at its edge far too large.
Working rows only decide where points lie; the points' weights hold the rows' own densities.
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
        Precision and mean of the offset that each predictor calls for.
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
        """Return working rows before anything is known of offsets.

        Rows far beyond all that errors and offsets explain count little; brackets become
        normals of their middles, and counts have weight 0.
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
        """Return working rows at the offsets that all of them give.

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
            # The offset adds a share of the row's own variance. With the share kept the mean
            # variance is solved for, where putting it in takes a pass for each factor df + 1.
            weight[:, exact] = (self.df + 1 - share) / (self.df * row_variance + square)
        here = np.concatenate([np.flatnonzero(~self.rows.exact), np.arange(n, offset.shape[1])])
        if len(here):
            weight[:, here], mean[:, here] = self._intervals(here, offset, spread)
        return replace(self, weight=weight, mean=mean)

    def _intervals(
        self, here: np.ndarray, offset: FloatArray, spread: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return working weights and responses of intervals' ends."""
        rows, n = self.rows, len(self.rows.upper)
        of_row = np.concatenate([np.arange(n), rows.counts])[here]
        row_variance = self.variance[:, of_row]
        if self.df is not None:  # the normal of the same Fisher information
            row_variance = row_variance * (self.df + 3) / (self.df + 1)
        is_lower, is_count = here >= n, rows.is_count[of_row]
        high = np.where(is_lower, np.inf, self.error[:, here])
        low = np.where(is_lower, self.error[:, here], -np.inf)
        low = np.where(is_count, low, high - (rows.upper - rows.lower)[of_row])
        at, spread = offset[:, here], spread[:, here]
        sd = np.sqrt(spread + row_variance)
        alpha, beta = (low - at) / sd, (high - at) / sd
        log_p = _NORMAL.log_probability(alpha, beta, None)

        def ratio(z: FloatArray) -> tuple[FloatArray, FloatArray]:
            value = np.exp(np.where(np.isfinite(z), -0.5 * z * z - log_p, -np.inf))
            value = value / math.sqrt(2 * math.pi)
            return value, np.where(np.isfinite(z), z, 0.0) * value

        (a, a_z), (b, b_z) = ratio(alpha), ratio(beta)
        gradient = (a - b) / sd
        precision = np.maximum(gradient**2 + (b_z - a_z) / sd**2, 0.0)
        with np.errstate(all="ignore"):
            mean = at + np.where(precision > 0, gradient / precision, 0.0)
        usable = np.isfinite(precision) & np.isfinite(mean)
        return np.where(usable, precision, 0.0), np.where(usable, mean, 0.0)
