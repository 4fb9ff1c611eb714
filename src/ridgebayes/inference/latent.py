r"""The integral over the scores of shared offsets and of log K, for many draws at once.

Given the outer parameters and normal rows with weights W and residuals r, the scores are normal
with precision ``M = I + L' Z' W Z L`` and mean ``M^-1 L' Z' W r``, and

.. math:: r' \Sigma^{-1} r = \sum W (r - Z L \hat s)^2 + \hat s'\hat s, \qquad
          \log|\Sigma| = \log|M| - \sum \log W,

where Sigma is the covariance of the rows. No large numbers cancel in these sums. If smooth offsets
have at least as many levels as there are groups of rows, Sigma itself is factorised. Rows that are
not normal have no closed form, see `ridgebayes.inference.points`.
"""

import math
from typing import NamedTuple

import numpy as np

from ridgebayes._types import BATCH_SIZE, LOG_2PI, BoolArray, FloatArray
from ridgebayes.inference.points import Batch, Estimate, PointIntegral
from ridgebayes.inference.precision import Precision
from ridgebayes.model.design import DesignMatrix
from ridgebayes.model.linear_algebra import cholesky_or_nan, solve_lower
from ridgebayes.model.model import Model
from ridgebayes.model.offsets import Root
from ridgebayes.model.rows import RowGroups
from ridgebayes.runtime.memory import keep_freed_memory


class LatentIntegral:
    """Integral of a model's posterior over the scores of its offsets.

    Parameters
    ----------
    model : Model
        Latent Gaussian model.
    """

    def __init__(self, model: Model) -> None:
        keep_freed_memory()
        self.model, self.rows, self.tail = model, model.rows, model.tail
        self.design = model.offsets.design
        self.n_level = model.offsets.n_level
        # The log density is exact if rows are normal or share no offsets.
        self.is_exact = model.is_normal or not self.n_level
        self._points = PointIntegral(self.rows, self.design, self.tail)
        self._groups: RowGroups | None = None
        self._factorises_rows = False
        if model.is_normal:
            first = self.design.first
            levels = self.design.rest if first is None else np.vstack([first, self.design.rest])
            self._groups = groups = RowGroups.of(self.rows, levels)
            self._group_design = DesignMatrix(
                None if first is None else first[groups.row],
                self.design.n_first,
                self.design.rest[:, groups.row],
                self.design.n_rest,
            )
            # With a level per group, factorising Sigma is cheaper: M also needs the factor L.
            self._factorises_rows = model.offsets.n_smooth >= len(groups.n)

    def n_at_once(self, n_point: int) -> int:
        """Return the number of draws whose arrays fit in a processor's cache together."""
        n_first, n_rest, n = self.design.n_first, self.design.n_rest, self.design.n
        if self._groups is not None:
            n, n_point = len(self._groups.n), 1
        elif self.n_level:
            n_point = math.prod(self._points.n_points(n_point))
        n_column = len(self.model.outer_names) + 2
        most = max(n * max(n_point, n_column), (n_rest + n_point) * (n_first + n_rest))
        return max(BATCH_SIZE // max(most, 1), 1)

    def prepared(self, eta: FloatArray) -> "Prepared":
        """Return the factors that depend only on error model parameters (n_draw, n_noise)."""
        with np.errstate(all="ignore"):
            if self._factorises_rows:
                return Prepared(eta, None, None, self._row_factor(eta))
            root = self.model.offsets.root(eta)
            if self._groups is None:
                return Prepared(eta, root, None, None)
            precision = Precision.of(self._group_design, root, self._group_weight(eta))
            return Prepared(eta, root, precision, None)

    def _row_factor(self, eta: FloatArray) -> FloatArray:
        """Return the Cholesky factor of the covariance of the groups' means."""
        covariance = self.model.offsets.covariance(self._group_design, eta)
        n = covariance.shape[-1]
        covariance.reshape(len(eta), n * n)[:, :: n + 1] += 1 / self._group_weight(eta)
        return cholesky_or_nan(covariance)

    def estimated(
        self,
        u: FloatArray,
        rng: np.random.Generator,
        n_point: int,
        prepared: "Prepared | None" = None,
    ) -> Estimate:
        """Return the log density of outer parameters, and a draw of the scores for each.

        Parameters
        ----------
        u : ndarray of float, shape (n_draw, n_outer)
            Normal scores of the outer parameters.
        rng : numpy.random.Generator
            Source of the points.
        n_point : int
            Points per draw, a multiple of four; normal rows need none.
        prepared : Prepared, optional
            Factors of these draws; computed if not given.
        """
        n = self.n_at_once(n_point)
        if prepared is not None or len(u) <= n:
            return self._estimated(u, rng, n_point, prepared)
        parts = [self._estimated(u[i : i + n], rng, n_point, None) for i in range(0, len(u), n)]
        return Estimate(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def _estimated(
        self, u: FloatArray, rng: np.random.Generator, n_point: int, prepared: "Prepared | None"
    ) -> Estimate:
        with np.errstate(all="ignore"):
            log_rates, eta, possible = self._rates_and_noise(u)
            no_scores = np.empty((len(u), 0))
            if self.n_level or self._groups is not None:
                prepared = self.prepared(eta) if prepared is None else prepared
            if self._groups is not None and prepared is not None:
                value = self._log_likelihood(log_rates, prepared)
                estimate = Estimate(value, value, no_scores)
            elif not self.n_level:
                error, scale, df = self._errors(log_rates, eta)
                value = self.rows.log_density(error, scale, self.tail, df).sum(axis=-1)
                estimate = Estimate(value, value, no_scores)
            elif prepared is not None:
                batch = self._batch(log_rates, prepared)
                estimate = self._points.estimated(batch, rng, n_point)
            prior = self.model.log_outer_prior(u)
            value, from_half = (
                np.where(possible & np.isfinite(x), x + prior, -np.inf) for x in estimate[:2]
            )
        return Estimate(value, from_half, estimate.scores)

    def approximate(self, u: FloatArray, prepared: "Prepared") -> FloatArray:
        """Return the log density of draws, by Laplace's approximation if it is not exact.

        The search for modes needs this smooth function, since estimates are noisy.
        """
        if self.is_exact:
            return self._estimated(u, np.random.default_rng(0), 4, prepared).log_density
        with np.errstate(all="ignore"):
            log_rates, _, possible = self._rates_and_noise(u)
            batch = self._batch(log_rates, prepared)
            normal = self._points.approximation(batch)
            error = batch.error - normal.offset
            value = self.rows.log_density(error, batch.scale, self.tail, batch.df).sum(axis=-1)
            value -= 0.5 * ((normal.first**2).sum(axis=-1) + (normal.rest**2).sum(axis=-1))
            value += self.model.log_outer_prior(u) - normal.precision.log_volume
        return np.where(possible & np.isfinite(value), value, -np.inf)

    def draw(self, u: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Draw the scores given outer parameters and normal rows, shape (n_draw, n_level)."""
        n, parts = self.n_at_once(1), []
        for i in range(0, len(u), n):
            log_rates, eta, _ = self._rates_and_noise(u[i : i + n])
            with np.errstate(all="ignore"):
                root = self.model.offsets.root(eta)
                precision = Precision.of(self._group_design, root, self._group_weight(eta))
                first, rest = self._mean(self._residual(log_rates), eta, root, precision)
            normal = rng.standard_normal((len(eta), self.n_level))
            n_first = self.design.n_first
            deviation = precision.back(normal[:, :n_first, None], normal[:, n_first:, None])
            scores = (first + deviation[0][..., 0], rest + deviation[1][..., 0])
            parts.append(np.concatenate(scores, axis=1))
        return np.concatenate(parts)

    def _rates_and_noise(self, u: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return log rates, error model parameters, and a mask of draws with positive rates."""
        theta = self.model.outer_theta(u)
        log_rates = self.model.outer_log_rates(theta)
        possible = np.asarray(np.isfinite(log_rates).all(axis=-1))
        if not possible.all():
            log_rates = np.where(possible[:, None], log_rates, 0.0)
        return log_rates, theta[:, self.model.n_outer_coefficient :], possible

    def _errors(
        self, log_rates: FloatArray, eta: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        df = eta[:, -1:] if self.tail.parameter_names else None
        return self.rows.errors(log_rates), self.rows.scale(eta[:, 0]), df

    def _batch(self, log_rates: FloatArray, prepared: "Prepared") -> Batch:
        error, scale, df = self._errors(log_rates, prepared.eta)
        prior_variance = self.model.offsets.prior_variance(prepared.eta)
        return Batch(error, scale, df, prepared.scores_root, prior_variance)

    def _group_weight(self, eta: FloatArray) -> FloatArray:
        """Return the precision of each group's mean, shape (n_draw, n_group)."""
        assert self._groups is not None
        variance = eta[:, :1] ** 2 + self.rows.rel_se[self._groups.row] ** 2
        value: FloatArray = self._groups.n / variance
        return value

    def _residual(self, log_rates: FloatArray) -> FloatArray:
        """Return the residuals of the groups' means, shape (n_draw, n_group)."""
        assert self._groups is not None
        value: FloatArray = (
            self._groups.mean + 2 * log_rates[:, self.rows.texture[self._groups.row]]
        )
        return value

    def _mean(
        self, residual: FloatArray, eta: FloatArray, root: Root, precision: Precision
    ) -> tuple[FloatArray, FloatArray]:
        """Return the mean of the scores given normal rows."""
        pull = self._group_design.gather(self._group_weight(eta) * residual)
        return precision.solve(*root.transposed_times(*pull))

    def _log_likelihood(self, log_rates: FloatArray, prepared: "Prepared") -> FloatArray:
        """Return the log-likelihood of normal rows, shape (n_draw,)."""
        groups, (eta, root, precision, row_factor) = self._groups, prepared
        assert groups is not None
        residual = self._residual(log_rates)
        weight = self._group_weight(eta)
        variance = groups.n / weight
        square: FloatArray = groups.n * np.log(2 * math.pi * variance)
        square += groups.sum_of_squares / variance
        if row_factor is not None:
            half = solve_lower(row_factor, residual[..., None])[..., 0]
            pivots = np.diagonal(row_factor, axis1=-2, axis2=-1)
            square += half**2 + np.log(weight) + 2 * np.log(pivots)
        elif root is not None and precision is not None and self.n_level:
            first, rest = self._mean(residual, eta, root, precision)
            remaining = residual - self._group_design.spread(*root.times(first, rest))
            square += weight * remaining**2
            of_scores = (first**2).sum(axis=-1) + (rest**2).sum(axis=-1)
            value: FloatArray = square.sum(axis=-1) + of_scores + 2 * precision.log_volume
            return -0.5 * value
        else:
            square += weight * residual**2
        return np.asarray(-0.5 * square.sum(axis=-1))

    def products(self, columns: FloatArray, prepared: "Prepared") -> FloatArray:
        """Return X' S^-1 X by Woodbury's identity, S the covariance of rows treated as normal.

        Parameters
        ----------
        columns : ndarray of float, shape (n_row, m)
            X. The last column has the residuals of the rows' middles, which give the weights of
            Student rows, so that outliers have little weight.
        prepared : Prepared
            Factors at the error model parameters.

        Returns
        -------
        ndarray of float, shape (n_draw, m, m)
            Products for each draw.
        """
        with np.errstate(all="ignore"):
            if self._groups is not None:
                columns, design = columns[self._groups.row], self._group_design
                weight, precision = self._group_weight(prepared.eta), prepared.precision
            else:
                design, n = self.design, len(columns)
                weight = self._working_weights(columns[:, -1], prepared.eta)
                columns = np.concatenate([columns, np.zeros((design.n - n, columns.shape[1]))])
                precision = Precision.of(design, prepared.scores_root, weight)
            if prepared.row_factor is not None:
                half = solve_lower(prepared.row_factor, columns[None])
                return np.swapaxes(half, -1, -2) @ half
            m = columns.shape[1]
            pairs = (columns[:, :, None] * columns[:, None, :]).reshape(len(columns), m * m)
            value = (weight @ pairs).reshape(-1, m, m)
            if not self.n_level or precision is None:
                return value
            pulls = [
                prepared.scores_root.transposed_times(*design.gather(weight * column))
                for column in columns.T
            ]
            first, rest = (np.stack(block, axis=-1) for block in zip(*pulls, strict=True))
            half = np.concatenate(precision.half(first, rest), axis=-2)
            return value - np.swapaxes(half, -1, -2) @ half

    def middles(self, log_rates: FloatArray) -> FloatArray:
        """Return the residuals of the rows' middles, shape (..., n_row)."""
        middle = self.rows.centre[0]
        if self._groups is not None:
            middle = self._groups.mean[self._groups.of_row]
        return middle + 2 * log_rates[..., self.rows.texture]

    def _working_weights(self, residual: FloatArray, eta: FloatArray) -> FloatArray:
        """Return weights of predictors as if rows were normal; lower ends of counts have weight 0.

        Rows with residuals far larger than offsets and errors explain get small weights.
        """
        n = len(self.rows.upper)
        df = eta[:, -1:] if self.tail.parameter_names else None
        variance = self.rows.scale(eta[:, 0]) ** 2 + self.rows.centre[1]
        total = variance + self.model.offsets.prior_variance(eta)[:, :n]
        weight = self.tail.weight(residual / np.sqrt(total), df) / variance
        return np.concatenate([weight, np.zeros((len(eta), self.design.n - n))], axis=-1)

    def rows_given_others(self, u: FloatArray) -> FloatArray:
        """Return each row's log density given the outer parameters and all other rows.

        Parameters
        ----------
        u : ndarray of float, shape (n_draw, n_outer)
            Normal scores.

        Returns
        -------
        ndarray of float, shape (n_draw, n_row)
            Exact for normal rows, from the diagonal of the inverse covariance. Rows that share no
            offsets have their unconditional log density.
        """
        n = max(BATCH_SIZE // (self.design.n * max(self.design.n_rest, 1)), 1)
        parts = [self._given_others(u[i : i + n]) for i in range(0, len(u), n)]
        return np.concatenate(parts)

    def rows_given_offsets(self, theta: FloatArray, scores: FloatArray) -> FloatArray:
        """Return each row's log density given parameters and offsets, shape (n_draw, n_row).

        Parameters
        ----------
        theta : ndarray of float, shape (n_draw, n_parameter)
            All parameters, K included.
        scores : ndarray of float, shape (n_draw, n_level)
            Scores of the error model's offsets, without log K.
        """
        eta, offsets = theta[:, self.model.n_coefficient :], self.model.offsets.own()
        with np.errstate(all="ignore"):
            offset = offsets.of_predictors(eta, scores)
            error = self.rows.errors(self.model.log_rates(theta), offset)
            df = eta[:, -1:] if self.tail.parameter_names else None
            return self.rows.log_density(error, self.rows.scale(eta[:, 0]), self.tail, df)

    def log_likelihoods(self, theta: FloatArray, scores: FloatArray, df: FloatArray) -> FloatArray:
        """Return log-likelihoods of Student rows given offsets, with other degrees of freedom.

        Draws have outer parameters `theta` (n_draw, n_outer), whose degrees of freedom are replaced
        by each of `df` (n,), and `scores` (n_draw, n_level) of all offsets, log K included. The
        result has shape (n_draw, n).
        """
        eta = theta[:, self.model.n_outer_coefficient :]
        with np.errstate(all="ignore"):
            error, scale, _ = self._errors(self.model.outer_log_rates(theta), eta)
            error = error - self.model.offsets.of_predictors(eta, scores)
            values = [
                self.rows.log_density(error, scale, self.tail, np.full((len(theta), 1), each))
                for each in df
            ]
        return np.stack([value.sum(axis=-1) for value in values], axis=-1)

    def _given_others(self, u: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            log_rates, eta, possible = self._rates_and_noise(u)
            error, scale, df = self._errors(log_rates, eta)
            if not self.n_level:
                value = self.rows.log_density(error, scale, self.tail, df)
                return np.where(possible[:, None], value, -np.inf)
            weight, design, root = scale**-2.0, self.design, self.model.offsets.root(eta)
            precision = Precision.of(design, root, weight)
            mean = precision.solve(*root.transposed_times(*design.gather(weight * error)))
            pull = weight * (error - design.spread(*root.times(*mean)))
            variance = precision.predictor_variance(design)
            diagonal = weight - weight**2 * variance
            value = 0.5 * (np.log(diagonal) - LOG_2PI - pull**2 / diagonal)
        return np.where(possible[:, None], value, -np.inf)


class Prepared(NamedTuple):
    """Factors that depend only on the error model's parameters, for many draws.

    Parameters
    ----------
    eta : ndarray of float, shape (n_draw, n_noise)
        Error model parameters.
    root : Root or None
        L; None if `row_factor` is used.
    precision : Precision or None
        M of normal rows, unless `row_factor` is used.
    row_factor : ndarray of float, shape (n_draw, n_group, n_group), or None
        Lower Cholesky factor of the rows' covariance, if it is used instead of L and M.
    """

    eta: FloatArray
    root: Root | None
    precision: Precision | None
    row_factor: FloatArray | None

    @property
    def scores_root(self) -> Root:
        """L, for models that integrate over scores."""
        assert self.root is not None
        return self.root
