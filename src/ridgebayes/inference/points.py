"""Unbiased estimates of the integral over scores, for rows that are not normal.

Each draw of the outer parameters gets new random points around a normal approximation
(`ridgebayes.inference.working_rows`). The scores have two blocks: the *first* block has a score for
each texture, the *rest* all other scores. Given the rest, the integral is a product of
one-dimensional integrals over the textures' scores, each with separate points. The mean weight is
unbiased, and a point selected in proportion to its weight is a draw of the scores (Andrieu &
Roberts 2009, doi:10.1214/07-AOS574).
"""

import itertools
import math
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from ridgebayes._types import LOG_2PI, FloatArray
from ridgebayes.inference.precision import Precision
from ridgebayes.inference.proposal import log_mean
from ridgebayes.inference.working_rows import WorkingRows
from ridgebayes.model.design import DesignMatrix
from ridgebayes.model.linear_algebra import solve_lower
from ridgebayes.model.offsets import Root
from ridgebayes.model.rows import Rows
from ridgebayes.model.tails import Tail

# Points have a logistic distribution, which has closed forms, and a kurtosis like that of a Student
# distribution with nine degrees of freedom. With this scale its peak is about as high as the
# standard normal's.
_POINT_SCALE = 0.65
_MIN_TAIL_PROBABILITY = np.finfo(float).eps  # keeps points finite
_MIN_REST_POINT = 8  # points of the rest, of which two are drawn from the prior
_N_INNER_POINT = 8  # points of a texture's score for each point of the rest
_MIN_INFORMED_PIVOT = 1.02  # scores with a smaller pivot in `Precision` get normal points
# Working rows are updated until nine of ten draws have no predictor whose precision changes by more
# than a tenth; points need no better approximation. Student rows with outliers and few degrees of
# freedom take the most passes.
_MAX_PASSES, _MAX_PRECISION_CHANGE, _MAX_UNSETTLED_SHARE = 5, 0.1, 0.1


class Estimate(NamedTuple):
    """Log density of outer parameters with the scores integrated out, and a draw of the scores.

    Parameters
    ----------
    log_density : ndarray of float, shape (n_draw,)
        Log posterior density of the outer parameters' normal scores, not normalised: exact for
        normal rows, else the log of an unbiased estimate.
    from_half : ndarray of float, shape (n_draw,)
        The same density, estimated from half of the points.
    scores : ndarray of float, shape (n_draw, n_level)
        Draws of the scores; empty for normal rows, see `LatentIntegral.draw`.
    """

    log_density: FloatArray
    from_half: FloatArray
    scores: FloatArray


class Batch(NamedTuple):
    """Rows at many draws of the outer parameters.

    Parameters
    ----------
    error : ndarray of float, shape (n_draw, n_predictor)
        Errors without offsets.
    scale : ndarray of float, shape (n_draw, n_row)
        Scale of each row's own error.
    df : ndarray of float, shape (n_draw, 1), or None
        Degrees of freedom of Student errors.
    root : Root
        Factor L of the offsets' covariance.
    prior_variance : ndarray of float, shape (n_draw, n_predictor)
        Prior variance of each predictor's offset.
    """

    error: FloatArray
    scale: FloatArray
    df: FloatArray | None
    root: Root
    prior_variance: FloatArray


class Approximation(NamedTuple):
    """Normal approximation of the scores: means of both blocks, mean offsets, and precision."""

    first: FloatArray
    rest: FloatArray
    offset: FloatArray
    precision: Precision


class PointIntegral:
    """Estimator of the integral over scores from random points.

    Parameters
    ----------
    rows : Rows
        Rows.
    design : DesignMatrix
        Levels of the rows' predictors.
    tail : Tail
        Distribution of the rows' own errors.
    """

    def __init__(self, rows: Rows, design: DesignMatrix, tail: Tail) -> None:
        self.rows, self.design, self.tail = rows, design, tail
        self._richtmyer = np.sqrt(_primes(max(design.n_rest, 1))) % 1.0
        # This order groups the rows by texture.
        self._order = np.argsort(rows.texture, kind="stable")
        n_in_texture = np.bincount(rows.texture)
        self._begins = np.cumsum(n_in_texture) - n_in_texture
        # Intervals add no mode of their own to the density of a texture's score.
        self._peaks = self._order[rows.exact[self._order]]
        self._n_peak = np.bincount(rows.texture[self._peaks], minlength=len(n_in_texture))

    def n_points(self, n_point: int) -> tuple[int, int]:
        """Return the number of points of the rest, and of texture scores for each of these."""
        if not self.design.n_rest:
            return 1, n_point
        if not self.design.n_first:
            return n_point, 1
        # Densities of intervals are smooth, so that few points suffice; Student rows can have
        # several modes.
        n_few = min(max(n_point // 4, _N_INNER_POINT // 2), _N_INNER_POINT)
        n_inner = _N_INNER_POINT if self.rows.exact.all() else n_few
        return max(n_point // 4, _MIN_REST_POINT), n_inner

    def approximation(self, batch: Batch) -> Approximation:
        """Return the scores' normal approximation, with each row replaced by a normal row."""
        working = WorkingRows.begun(
            self.rows, batch.error, batch.scale, self.tail, batch.df, batch.prior_variance
        )
        for _ in range(_MAX_PASSES):
            normal = self._scores_given(working, batch.root)
            variance = normal.precision.predictor_variance(self.design)
            before, working = working.weight, working.renewed(normal.offset, variance)
            changed = np.abs(working.weight - before) * variance > _MAX_PRECISION_CHANGE
            if changed.any(axis=1).mean() < _MAX_UNSETTLED_SHARE:
                break
        return self._scores_given(working, batch.root)

    def _scores_given(self, working: WorkingRows, root: Root) -> Approximation:
        """Return the normal distribution of the scores given working rows."""
        precision = Precision.of(self.design, root, working.weight)
        pull = root.transposed_times(*self.design.gather(working.weight * working.mean))
        first, rest = precision.solve(*pull)
        return Approximation(first, rest, self.design.spread(*root.times(first, rest)), precision)

    def estimated(self, batch: Batch, rng: np.random.Generator, n_point: int) -> Estimate:
        """Return estimates of the log-likelihood, and a draw of the scores for each."""
        n_first = self.design.n_first
        normal = self.approximation(batch)
        n_outer, n_inner = self.n_points(n_point)
        rest, log_weight = self._rest_points(normal, batch.df, rng, n_outer)
        first, log_first = self._first_points(batch, normal, rest, rng, n_inner)
        if n_first:
            # Given the rest, the integral is a product of integrals over the textures' scores.
            log_weight = log_weight + log_mean(log_first).sum(axis=-1)
            first = _select(first, log_first, rng)
        else:
            log_weight, first = log_weight + log_first[0], first[0]
        log_weight = np.where(np.isnan(log_weight), -np.inf, log_weight)
        scores = _select(np.concatenate([first, rest], axis=-1), log_weight[..., None], rng)
        if n_outer > 1:
            return Estimate(log_mean(log_weight), log_mean(log_weight[::2]), scores)
        from_half = log_mean(log_first[::2]).sum(axis=-1)[0]
        return Estimate(log_weight[0], from_half, scores)

    def _rest_points(
        self, normal: Approximation, df: FloatArray | None, rng: np.random.Generator, n: int
    ) -> tuple[FloatArray, FloatArray]:
        """Return points of the rest, (n, n_draw, n_rest), and log prior over proposal density."""
        corner, n_rest = normal.precision.corner, self.design.n_rest
        if not n_rest:
            return normal.rest[None], np.zeros((1, len(normal.rest)))
        pivots = np.diagonal(corner, axis1=-2, axis2=-1)
        informed = (pivots > _MIN_INFORMED_PIVOT)[..., None]
        # A Richtmyer sequence with a random shift for each draw, so that each point is uniform.
        u = rng.random((*pivots.shape, 1)) + np.arange(n) * self._richtmyer[:, None]
        u = np.clip(u % 1.0, _MIN_TAIL_PROBABILITY, 1 - _MIN_TAIL_PROBABILITY)
        # The points' tail is that of Student's distribution with 1/(k s) degrees of freedom, k the
        # bend and s the logistic scale; the density of m rows has m df. Tails heavier than Cauchy's
        # are not needed.
        bend: FloatArray | float = 0.0
        if df is not None:
            df_of_score = df[..., None] * len(self.rows.upper) / n_rest
            bend = 1 / (_POINT_SCALE * np.maximum(df_of_score, 1.0))
        t = np.where(informed, _points(u, bend), ndtri(u))
        rest = normal.rest[..., None] + solve_lower(corner, t, transposed=True)
        # Outliers, and intervals that contradict each other, leave mass where the normal
        # approximation has none. Two points are drawn from the prior, so that every second point
        # gives an estimate too.
        from_prior = np.arange(n) < 2
        rest = np.where(from_prior, ndtri(u), rest)
        t = np.swapaxes(corner, -1, -2) @ (rest - normal.rest[..., None])
        log_t = np.where(informed, _log_points(t, bend), -0.5 * (t * t + LOG_2PI)).sum(axis=-2)
        log_density = log_t + np.log(pivots).sum(axis=-1)[:, None]
        log_prior = -0.5 * (rest**2 + LOG_2PI).sum(axis=-2)
        share = from_prior.mean()
        terms = math.log1p(-share) + log_density, math.log(share) + log_prior
        log_density = np.logaddexp(*terms)
        return np.moveaxis(rest, -1, 0), (log_prior - log_density).T

    def _first_points(
        self,
        batch: Batch,
        normal: Approximation,
        rest: FloatArray,
        rng: np.random.Generator,
        n: int,
    ) -> tuple[FloatArray, FloatArray]:
        """Return points of the textures' scores given points of the rest, and log weights.

        Parameters
        ----------
        batch : Batch
            Rows.
        normal : Approximation
            Normal approximation of the scores.
        rest : ndarray of float, shape (n_outer, n_draw, n_rest)
            Points of the rest.
        rng : numpy.random.Generator
            Source of the points.
        n : int
            Points per texture score and point of the rest.

        Returns
        -------
        first, log_weight : ndarray of float, both of shape (n, n_outer, n_draw, n_first)
            Points, and log of the rows' density times prior over the points' density. Without
            texture scores there is one empty point, and the weight is the log density of all rows,
            shape (1, n_outer, n_draw).
        """
        precision, root = normal.precision, batch.root
        zeros = np.zeros((*rest.shape[:-1], self.design.n_first))
        offset = self.design.spread(*root.times(zeros, rest))
        error = batch.error - offset
        if not self.design.n_first:
            log_rows = self.rows.log_density(error, batch.scale, self.tail, batch.df)
            return np.empty((1, *rest.shape[:-1], 0)), log_rows.sum(axis=-1)[None]
        moved = np.einsum("pdr,drf->pdf", rest - normal.rest, precision.border)
        centre = normal.first - moved / precision.diagonal
        # With normal rows the density of a score is log-concave, and has no mode far away.
        n_wide = 2 * max(n // 8, 1) if self.tail.parameter_names else 0
        # Strata of equal probability suit a smooth one-dimensional integral. Each stratum has two
        # points, so that every second point gives an estimate too.
        n_strata = (n - n_wide) // 2
        stratum = np.repeat(np.arange(n_strata), 2)[:, None, None, None]
        u = (stratum + rng.random((len(stratum), *centre.shape))) / n_strata
        u = np.clip(u, _MIN_TAIL_PROBABILITY, 1 - _MIN_TAIL_PROBABILITY)
        first = centre + _points(u) / precision.diagonal
        if n_wide:
            first = np.concatenate([first, self._wide_points(batch, error, rng, n_wide)])
        shifted = error - (root.first * first)[..., self.design.first]
        log_rows = self.rows.log_density(shifted, batch.scale, self.tail, batch.df)
        joint = np.add.reduceat(log_rows[..., self._order], self._begins, axis=-1)
        t = (first - centre) * precision.diagonal
        log_q = _log_points(t) + np.log(precision.diagonal)
        log_prior = -0.5 * (first**2 + LOG_2PI)
        if n_wide:
            at_peaks = np.exp(log_rows) * self.rows.exact
            wide = root.first * np.add.reduceat(at_peaks[..., self._order], self._begins, axis=-1)
            log_wide = np.log(wide + np.exp(log_prior)) - np.log1p(self._n_peak)
            share = n_wide / n
            log_q = np.logaddexp(log_q + math.log(1 - share), log_wide + math.log(share))
        log_weight = joint + log_prior - log_q
        return first, np.where(np.isnan(log_weight), -np.inf, log_weight)

    def _wide_points(
        self, batch: Batch, error: FloatArray, rng: np.random.Generator, n: int
    ) -> FloatArray:
        """Return texture scores from the prior, or at which a random row has a random error.

        The density of a texture's score can have a mode near each exact Student row, and a mode
        where the prior is high and all rows are outliers. The density of these points is the mean
        of the prior and of the rows' error densities.
        """
        u = rng.random((n, *error.shape[:-1], len(self._n_peak)))
        stratum = (np.arange(n) // 2)[:, None, None, None]  # two points each, as above
        pick = ((stratum + u) / (stratum[-1] + 1) * (self._n_peak + 1)).astype(int)
        points = rng.standard_normal(u.shape)
        if not len(self._peaks):
            return points
        begins = np.cumsum(self._n_peak) - self._n_peak
        row = self._peaks[np.minimum(begins + pick, len(self._peaks) - 1)]
        row_error = np.take_along_axis(error[None], row, -1)
        row_scale = np.take_along_axis(batch.scale[None, None], row, -1)
        row_error = row_error - row_scale * self.tail.rvs(rng, batch.df, row.shape)
        at_rows = np.nan_to_num(row_error / batch.root.first, posinf=1e30, neginf=-1e30)
        return np.where(pick < self._n_peak, at_rows, points)


def _primes(n: int) -> FloatArray:
    """Return the first n primes."""
    primes = (k for k in itertools.count(2) if all(k % j for j in range(2, math.isqrt(k) + 1)))
    return np.array(list(itertools.islice(primes, n)), float)


def _points(u: FloatArray, bend: FloatArray | float = 0.0) -> FloatArray:
    """Return quantiles sinh(k z)/k at probabilities u, with z logistic and k the bend."""
    z = _POINT_SCALE * np.log(u / (1 - u))
    return np.asarray(np.sinh(bend * z) / bend if np.any(bend) else z)


def _log_points(t: FloatArray, bend: FloatArray | float = 0.0) -> FloatArray:
    """Return the log density of the points' distribution."""
    bent = bend * t
    z = np.abs(np.arcsinh(bent) / bend if np.any(bend) else t) / _POINT_SCALE
    value: FloatArray = -z - 2 * np.log1p(np.exp(-z)) - math.log(_POINT_SCALE)
    return value - 0.5 * np.log1p(bent * bent)


def _select(scores: FloatArray, log_weight: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Select one point on the first axis at random by weight, for each draw (and level)."""
    top = log_weight.max(axis=0)
    cumulative = np.cumsum(np.exp(log_weight - np.where(top == -np.inf, 0.0, top)), axis=0)
    index = (cumulative < rng.random(cumulative.shape[1:]) * cumulative[-1]).sum(axis=0)
    index = np.minimum(index, len(scores) - 1)
    index = np.broadcast_to(index, scores.shape[1:])[None]
    return np.asarray(np.take_along_axis(scores, index, axis=0)[0])
