r"""The integral over the scores of shared offsets and of log K, for many draws at once.

With rows of weights W and residuals r the scores of normal rows are normal given the outer
parameters, with precision ``M = I + L' Z' W Z L`` and mean ``M^-1 L' Z' W r``, and

.. math:: r' \Sigma^{-1} r = \sum W (r - Z L \hat s)^2 + \hat s'\hat s, \qquad
          \log|\Sigma| = \log|M| - \sum \log W,

in which no large numbers cancel. Student, bracket and count rows have no closed form: points are
drawn around the inner mode, afresh for each draw of the outer parameters. Their mean weight is an
unbiased estimate of the integral, and a point taken in proportion to its weight is a draw of the
scores (Andrieu & Roberts 2009, doi:10.1214/07-AOS574).
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from ridgebayes._types import FloatArray
from ridgebayes.inference.sites import Sites
from ridgebayes.model.linear_algebra import cholesky_or_nan, solve_lower
from ridgebayes.model.model import Model
from ridgebayes.model.offsets import Design, Root
from ridgebayes.model.rows import RowGroups

_LOG_2PI = math.log(2 * math.pi)
_NUMBERS_AT_ONCE = 2**20  # numbers in the largest array of a batch, 8 MB
# Points are logistic: a closed form, and tails as those of a Student distribution of nine degrees
# of freedom. Of this scale the peak is the standard normal's, nearly.
_POINT_SCALE = 0.65
_EDGE = 1e-12  # least probability beyond a point
_INNER_POINTS = 8  # of textures' scores, for each point of the other scores
_INFORMED = 1.02  # pivot of M from which rows say anything of a score, whose prior is normal
# Passes in which sites settle. Student rows' variances take longer than intervals.
_PASSES, _PASSES_STUDENT = 2, 5


class Estimate(NamedTuple):
    """Log density of outer parameters with the scores integrated out, and a draw of the scores.

    Parameters
    ----------
    log_density : ndarray of float, shape (n_draw,)
        Log posterior density of the outer parameters' normal scores, not normalised: exact for
        normal rows, else the log of an unbiased estimate.
    from_half : ndarray of float, shape (n_draw,)
        The same by half of the points.
    scores : ndarray of float, shape (n_draw, n_level)
        Draws of the scores; of normal rows none, see `LatentIntegral.draw`.
    """

    log_density: FloatArray
    from_half: FloatArray
    scores: FloatArray


@dataclass(frozen=True, eq=False)
class Precision:
    """Cholesky factor of M = I + L' Z' W Z L, whose first block is diagonal.

    Parameters
    ----------
    root : Root
        L.
    diagonal : ndarray of float, shape (..., n_first)
        Factor of the first block.
    border : ndarray of float, shape (..., n_rest, n_first)
        The rest's first columns.
    corner : ndarray of float, shape (..., n_rest, n_rest)
        The rest's last columns, lower triangular.
    """

    root: Root
    diagonal: FloatArray
    border: FloatArray
    corner: FloatArray

    @classmethod
    def of(cls, design: Design, root: Root, weight: FloatArray) -> "Precision":
        """Factorise; NaN for draws whose matrix is not positive definite to rounding.

        The cost grows with the textures and with the cube of the other levels.
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
    def pivots(self) -> FloatArray:
        """Diagonal of the factor, shape (..., n_first + n_rest)."""
        corner = np.diagonal(self.corner, axis1=-2, axis2=-1)
        return np.concatenate([self.diagonal, corner], axis=-1)

    @property
    def log_volume(self) -> FloatArray:
        """Half of log |M|, shape (...)."""
        value: FloatArray = np.log(self.pivots).sum(axis=-1)
        return value

    def half(self, first: FloatArray, rest: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return R^-1 x of columns (..., n, m), M = R R'."""
        first = first / self.diagonal[..., None]
        if self.diagonal.shape[-1] and self.corner.shape[-1]:
            rest = rest - self.border @ first
        return first, solve_lower(self.corner, rest)

    def back(self, first: FloatArray, rest: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return R'^-1 x of columns (..., n, m)."""
        rest = solve_lower(self.corner, rest, transposed=True)
        if self.diagonal.shape[-1] and self.corner.shape[-1]:
            first = first - np.swapaxes(self.border, -1, -2) @ rest
        return first / self.diagonal[..., None], rest

    def solve(self, first: FloatArray, rest: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return M^-1 x of one column, (..., n)."""
        both = self.back(*self.half(first[..., None], rest[..., None]))
        return both[0][..., 0], both[1][..., 0]

    def predictor_variance(self, design: Design) -> FloatArray:
        """Return the variance of each predictor's offset given the rows, shape (n_draw, n)."""
        root, n_draw = self.root, len(self.diagonal)
        variance = np.zeros((n_draw, design.n))
        rest = np.zeros((n_draw, design.n_rest, design.n))
        for levels in design.rest:
            if root.is_dense:
                rest += np.swapaxes(root.rest, -1, -2)[:, :, levels]
            else:
                rest[:, levels, np.arange(design.n)] += root.rest[:, levels]
        if design.first is not None:
            own = (root.first / self.diagonal)[:, design.first]
            variance += own**2
            rest -= self.border[:, :, design.first] * own[:, None, :]
        variance += (solve_lower(self.corner, rest) ** 2).sum(axis=-2)
        return variance


class LatentIntegral:
    """Integrates the scores out of a model's posterior.

    Parameters
    ----------
    model : Model
        Latent Gaussian model.
    """

    def __init__(self, model: Model) -> None:
        self.model, self.rows, self.tail = model, model.rows, model.tail
        self.design = model.offsets.design
        self.n_level = model.offsets.n_level
        self._by_texture = np.argsort(self.rows.texture, kind="stable")
        self._n_in_texture = np.bincount(self.rows.texture)
        self._richtmyer = np.sqrt(_primes(max(self.design.n_rest, 1))) % 1.0
        self._begins = np.cumsum(self._n_in_texture) - self._n_in_texture
        self._groups: RowGroups | None = None
        if model.is_normal:
            first = self.design.first
            levels = self.design.rest if first is None else np.vstack([first, self.design.rest])
            self._groups = groups = RowGroups.of(self.rows, levels)
            self._group_design = Design(
                None if first is None else first[groups.row],
                self.design.n_first,
                self.design.rest[:, groups.row],
                self.design.n_rest,
            )

    @property
    def is_exact(self) -> bool:
        """Whether the log density is no estimate: normal rows, or rows that share nothing."""
        return self.model.is_normal or not self.n_level

    def _n_points(self, n_point: int) -> tuple[int, int]:
        """Return points of the rest, and points of the textures' scores for each of these."""
        if not self.design.n_rest:
            return 1, n_point
        if not self.design.n_first:
            return n_point, 1
        return max(n_point // 4, 4), _INNER_POINTS

    def _numbers(self, n_point: int) -> int:
        """Return the size of the largest array that one draw needs."""
        n_first, n_rest, n = self.design.n_first, self.design.n_rest, self.design.n
        if self._groups is not None:
            n, n_point = len(self._groups.n), 1
        elif self.n_level:
            n_point = math.prod(self._n_points(n_point))
        n_column = len(self.model.outer_names) + 2
        most = max(n * max(n_point, n_column), (n_rest + n_point) * (n_first + n_rest))
        return max(most, 1)

    def n_at_once(self, n_point: int) -> int:
        """Return how many draws fit in a batch whose arrays stay in a processor's cache."""
        return max(_NUMBERS_AT_ONCE // self._numbers(n_point), 1)

    def prepared(self, eta: FloatArray) -> "Prepared":
        """Return what depends on error model parameters (n_draw, n_noise) alone."""
        with np.errstate(all="ignore"):
            root = self.model.offsets.root(eta)
            if self._groups is None:
                return Prepared(eta, root, None)
            weight = self._groups.n / self._group_variance(eta)
            return Prepared(eta, root, Precision.of(self._group_design, root, weight))

    def estimated(
        self,
        u: FloatArray,
        rng: np.random.Generator,
        n_point: int,
        prepared: "Prepared | None" = None,
    ) -> Estimate:
        """Return the log density of outer parameters, and a draw of the scores.

        Parameters
        ----------
        u : ndarray of float, shape (n_draw, n_outer)
            Normal scores of the outer parameters.
        rng : numpy.random.Generator
            Source of the points.
        n_point : int
            Points for each draw, a multiple of four; normal rows need none.
        prepared : Prepared, optional
            Where it is known for these draws.
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
            log_rates, eta, possible = self._parts(u)
            nothing = np.empty((len(u), 0))
            if self.n_level or self._groups is not None:
                prepared = self.prepared(eta) if prepared is None else prepared
            if self._groups is not None and prepared is not None:
                value = self._normal(log_rates, prepared)[0]
                found = Estimate(value, value, nothing)
            elif not self.n_level:
                error, scale, df = self._errors(log_rates, eta)
                value = self.rows.log_density(error, scale, self.tail, df).sum(axis=-1)
                found = Estimate(value, value, nothing)
            elif prepared is not None:
                found = self._by_points(log_rates, prepared, rng, n_point)
            prior = self.model.log_outer_prior(u)
            value, from_half = (
                np.where(possible & np.isfinite(x), x + prior, -np.inf) for x in found[:2]
            )
        return Estimate(value, from_half, found.scores)

    def approximate(self, u: FloatArray, prepared: "Prepared") -> FloatArray:
        """Return the log density of draws, by Laplace's approximation where it is not exact.

        A smooth function without noise, for the search of modes.
        """
        if self.is_exact:
            return self._estimated(u, np.random.default_rng(0), 4, prepared).log_density
        with np.errstate(all="ignore"):
            log_rates, eta, possible = self._parts(u)
            batch = _Batch(*self._errors(log_rates, eta), prepared.root, eta)
            normal = self._approximated(batch)
            left = batch.error - normal.offset
            value = self.rows.log_density(left, batch.scale, self.tail, batch.df).sum(axis=-1)
            value -= 0.5 * ((normal.first**2).sum(axis=-1) + (normal.rest**2).sum(axis=-1))
            value += self.model.log_outer_prior(u) - normal.precision.log_volume
        return np.where(possible & np.isfinite(value), value, -np.inf)

    def draw(self, u: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Draw the scores given outer parameters and normal rows, shape (n_draw, n_level)."""
        n, parts = max(_NUMBERS_AT_ONCE // self._numbers(1), 1), []
        for i in range(0, len(u), n):
            log_rates, eta, _ = self._parts(u[i : i + n])
            with np.errstate(all="ignore"):
                _, precision, first, rest = self._normal(log_rates, self.prepared(eta))
            normal = rng.standard_normal((len(eta), self.n_level))
            n_first = self.design.n_first
            more = precision.back(normal[:, :n_first, None], normal[:, n_first:, None])
            both = (first + more[0][..., 0], rest + more[1][..., 0])
            parts.append(np.concatenate(both, axis=1))
        return np.concatenate(parts)

    def _parts(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return log rates, error model parameters, and which draws have positive rates."""
        theta = self.model.outer_theta(u)
        log_rates = self.model.outer_log_rates(theta)
        possible = np.isfinite(log_rates).all(axis=-1)
        if not possible.all():
            log_rates = np.where(possible[:, None], log_rates, 0.0)
        return log_rates, theta[:, self.model.n_outer_coefficient :], possible

    def _errors(
        self, log_rates: FloatArray, eta: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        df = eta[:, -1:] if self.tail.parameter_names else None
        return self.rows.errors(log_rates), self.rows.scale(eta[:, 0]), df

    def _group_variance(self, eta: FloatArray) -> FloatArray:
        assert self._groups is not None
        value: FloatArray = eta[:, :1] ** 2 + self.rows.rel_se[self._groups.row] ** 2
        return value

    def _normal(
        self, log_rates: FloatArray, prepared: "Prepared"
    ) -> tuple[FloatArray, Precision, FloatArray, FloatArray]:
        """Return the log-likelihood of normal rows, and precision and mean of the scores."""
        groups, design = self._groups, self._group_design
        assert groups is not None
        variance, precision = self._group_variance(prepared.eta), prepared.precision
        assert precision is not None
        residual = groups.mean + 2 * log_rates[:, self.rows.texture[groups.row]]
        weight, root = groups.n / variance, prepared.root
        constant = groups.n * np.log(2 * math.pi * variance) + groups.sum_of_squares / variance
        if not self.n_level:
            square = constant + weight * residual**2
            return -0.5 * square.sum(axis=-1), precision, root.first, root.rest
        pull = root.transposed_times(*design.gather(weight * residual))
        first, rest = precision.solve(*pull)
        left = residual - design.spread(*root.times(first, rest))
        square = (weight * left**2 + constant).sum(axis=-1)
        square += (first**2).sum(axis=-1) + (rest**2).sum(axis=-1)
        return -0.5 * square - precision.log_volume, precision, first, rest

    def products(self, columns: FloatArray, prepared: "Prepared") -> FloatArray:
        """Return X' S^-1 X of columns of the rows, S the covariance of rows taken as normal.

        Parameters
        ----------
        columns : ndarray of float, shape (n_row, m)
            X. The last column is the residuals of the rows' middles, by which Student rows are
            weighed: outliers count little.
        prepared : Prepared
            Of the error model parameters.

        Returns
        -------
        ndarray of float, shape (n_draw, m, m)
            By Woodbury's identity.
        """
        with np.errstate(all="ignore"):
            if self._groups is not None:
                columns, design = columns[self._groups.row], self._group_design
                weight, precision = (
                    self._groups.n / self._group_variance(prepared.eta),
                    (prepared.precision),
                )
            else:
                design, n = self.design, len(columns)
                weight = self._working_weights(columns[:, -1], prepared.eta)
                columns = np.concatenate([columns, np.zeros((design.n - n, columns.shape[1]))])
                precision = Precision.of(design, prepared.root, weight)
            m = columns.shape[1]
            pairs = (columns[:, :, None] * columns[:, None, :]).reshape(len(columns), m * m)
            value = (weight @ pairs).reshape(-1, m, m)
            if not self.n_level or precision is None:
                return value
            pulls = [
                prepared.root.transposed_times(*design.gather(weight * column))
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
        """Return weights of predictors as if rows were normal; those of lower ends are 0.

        Rows far beyond all that offsets and errors explain are outliers, and count little.
        """
        n = len(self.rows.upper)
        df = eta[:, -1:] if self.tail.parameter_names else None
        variance = self.rows.scale(eta[:, 0]) ** 2 + self.rows.centre[1]
        far = variance + self.model.offsets.prior_variance(eta)[:, :n]
        weight = self.tail.weight(residual / np.sqrt(far), df) / variance
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
            Exact for normal rows, from the diagonal of the inverse covariance; of rows that share
            nothing their own log density.

        Raises
        ------
        ValueError
            If rows that are not normal share offsets.
        """
        if not self.is_exact:
            raise ValueError("rows that are not normal share offsets")
        n = max(_NUMBERS_AT_ONCE // (self.design.n * max(self.design.n_rest, 1)), 1)
        parts = [self._given_others(u[i : i + n]) for i in range(0, len(u), n)]
        return np.concatenate(parts)

    def rows_given_offsets(self, theta: FloatArray, scores: FloatArray) -> FloatArray:
        """Return each row's log density given parameters and offsets, shape (n_draw, n_row).

        Parameters
        ----------
        theta : ndarray of float, shape (n_draw, n_parameter)
            All parameters, K included.
        scores : ndarray of float, shape (n_draw, n_level)
            Scores of the error model's own offsets.
        """
        eta, own = theta[:, self.model.n_coefficient :], self.model.offsets.own()
        with np.errstate(all="ignore"):
            offset = 0.0
            if own.n_level:
                first, rest = scores[:, : own.n_first], scores[:, own.n_first :]
                offset = own.design.spread(*own.root(eta).times(first, rest))
            error = self.rows.errors(self.model.log_rates(theta), offset)
            df = eta[:, -1:] if self.tail.parameter_names else None
            return self.rows.log_density(error, self.rows.scale(eta[:, 0]), self.tail, df)

    def _given_others(self, u: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            log_rates, eta, possible = self._parts(u)
            error, scale, df = self._errors(log_rates, eta)
            if not self.n_level:
                value = self.rows.log_density(error, scale, self.tail, df)
                return np.where(possible[:, None], value, -np.inf)
            weight, design, root = scale**-2.0, self.design, self.model.offsets.root(eta)
            precision = Precision.of(design, root, weight)
            mean = precision.solve(*root.transposed_times(*design.gather(weight * error)))
            left = weight * (error - design.spread(*root.times(*mean)))
            variance = precision.predictor_variance(design)
            diagonal = weight - weight**2 * variance
            value = 0.5 * (np.log(diagonal) - _LOG_2PI - left**2 / diagonal)
        return np.where(possible[:, None], value, -np.inf)

    def _offset(self, root: Root, first: FloatArray, rest: FloatArray) -> FloatArray:
        return self.design.spread(*root.times(first, rest))

    def _approximated(self, batch: "_Batch") -> "_Normal":
        """Return the scores' normal approximation: rows stand for normals of their own."""
        sites = Sites.begun(
            self.rows, batch.error, batch.scale, self.tail, batch.df, self._far(batch)
        )
        for _ in range(_PASSES if batch.df is None else _PASSES_STUDENT):
            given = self._given(sites, batch.root)
            variance = given.precision.predictor_variance(self.design)
            sites = sites.renewed(given.offset, variance)
        return self._given(sites, batch.root)

    def _far(self, batch: "_Batch") -> FloatArray:
        return self.model.offsets.prior_variance(batch.eta)

    def _given(self, sites: "Sites", root: Root) -> "_Normal":
        precision = Precision.of(self.design, root, sites.weight)
        pull = root.transposed_times(*self.design.gather(sites.weight * sites.mean))
        first, rest = precision.solve(*pull)
        return _Normal(first, rest, self._offset(root, first, rest), precision)

    def _by_points(
        self, log_rates: FloatArray, prepared: "Prepared", rng: np.random.Generator, n_point: int
    ) -> Estimate:
        """Return estimates of the log-likelihood from points around a normal approximation."""
        n_first = self.design.n_first
        batch = _Batch(*self._errors(log_rates, prepared.eta), prepared.root, prepared.eta)
        normal = self._approximated(batch)
        n_outer, n_inner = self._n_points(n_point)
        rest, log_weight = self._rest_points(normal, rng, n_outer)
        first, log_first = self._first_points(batch, normal, rest, rng, n_inner)
        if n_first:
            # Given the rest the integral is a product of one over each texture's score.
            log_weight = log_weight + _log_mean(log_first).sum(axis=-1)
            first = _chosen(first, log_first, rng)
        else:
            log_weight, first = log_weight + log_first[0], first[0]
        log_weight = np.where(np.isnan(log_weight), -np.inf, log_weight)
        scores = _chosen(np.concatenate([first, rest], axis=-1), log_weight[..., None], rng)
        if n_outer > 1:
            return Estimate(_log_mean(log_weight), _log_mean(log_weight[::2]), scores)
        from_half = _log_mean(log_first[::2]).sum(axis=-1)[0]
        return Estimate(log_weight[0], from_half, scores)

    def _rest_points(
        self, normal: "_Normal", rng: np.random.Generator, n: int
    ) -> tuple[FloatArray, FloatArray]:
        """Return points of the rest's scores, (n, n_draw, n_rest), and log prior over density."""
        corner, n_rest = normal.precision.corner, self.design.n_rest
        if not n_rest:
            return normal.rest[None], np.zeros((1, len(normal.rest)))
        pivots = np.diagonal(corner, axis1=-2, axis2=-1)
        informed = (pivots > _INFORMED)[..., None]
        # A Richtmyer sequence, shifted at random for each draw: any one point is uniform.
        u = rng.random((*pivots.shape, 1)) + np.arange(n) * self._richtmyer[:, None]
        u = np.clip(u % 1.0, _EDGE, 1 - _EDGE)
        t = np.where(informed, _logistic(u), ndtri(u))
        log_t = np.where(informed, _log_logistic(t), -0.5 * (t * t + _LOG_2PI)).sum(axis=-2)
        rest = normal.rest[..., None] + solve_lower(corner, t, transposed=True)
        log_density = log_t + np.log(pivots).sum(axis=-1)[:, None]
        log_prior = -0.5 * (rest**2 + _LOG_2PI).sum(axis=-2)
        return np.moveaxis(rest, -1, 0), (log_prior - log_density).T

    def _first_points(
        self,
        batch: "_Batch",
        normal: "_Normal",
        rest: FloatArray,
        rng: np.random.Generator,
        n: int,
    ) -> tuple[FloatArray, FloatArray]:
        """Return points of the textures' scores given points of the rest, and log weights.

        Parameters
        ----------
        batch : _Batch
            Rows.
        normal : _Normal
            Normal approximation of the scores.
        rest : ndarray of float, shape (n_outer, n_draw, n_rest)
            Points of the rest.
        rng : numpy.random.Generator
            Source of the points.
        n : int
            Points of each.

        Returns
        -------
        first, log_weight : ndarray of float, both of shape (n, n_outer, n_draw, n_first)
            Rows' density times prior over the points' density. Without textures one point of no
            scores, and the log density of all rows, shape (1, n_outer, n_draw).
        """
        precision, root = normal.precision, batch.root
        nothing = np.zeros((*rest.shape[:-1], self.design.n_first))
        offset = self.design.spread(*root.times(nothing, rest))
        error = batch.error - offset
        if not self.design.n_first:
            log_rows = self.rows.log_density(error, batch.scale, self.tail, batch.df)
            return np.empty((1, *rest.shape[:-1], 0)), log_rows.sum(axis=-1)[None]
        moved = np.einsum("pdr,drf->pdf", rest - normal.rest, precision.border)
        centre = normal.first - moved / precision.diagonal
        by_rows = self.tail.parameter_names != () and bool(self.rows.exact.all())
        n_at_rows = n // 4 if by_rows else 0
        # Strata of equal probability, since the integral is one-dimensional and smooth: twice, so
        # that every second point makes an estimate, too.
        n_strata = (n - n_at_rows) // 2 if n > 1 else 1
        u = np.repeat(np.arange(n_strata), min(n, 2))[:, None, None, None]
        u = (u + rng.random((len(u), *centre.shape))) / n_strata
        u = np.clip(u, _EDGE, 1 - _EDGE)
        first = centre + _logistic(u) / precision.diagonal
        if n_at_rows:
            first = np.concatenate([first, self._at_rows(batch, error, rng, n_at_rows)])
        shifted = error - (root.first * first)[..., self.design.first]
        log_rows = self.rows.log_density(shifted, batch.scale, self.tail, batch.df)
        joint = np.add.reduceat(log_rows[..., self._by_texture], self._begins, axis=-1)
        t = (first - centre) * precision.diagonal
        log_q = _log_logistic(t) + np.log(precision.diagonal)
        if n_at_rows:
            top = np.maximum.reduceat(log_rows[..., self._by_texture], self._begins, axis=-1)
            each = np.exp(log_rows - top[..., self.rows.texture])
            mean = np.add.reduceat(each[..., self._by_texture], self._begins, axis=-1)
            log_mean = top + np.log(mean / self._n_in_texture) + np.log(root.first)
            share = n_at_rows / n
            log_q = np.logaddexp(log_q + math.log(1 - share), log_mean + math.log(share))
        log_weight = joint - 0.5 * (first**2 + _LOG_2PI) - log_q
        return first, np.where(np.isnan(log_weight), -np.inf, log_weight)

    def _at_rows(
        self, batch: "_Batch", error: FloatArray, rng: np.random.Generator, n: int
    ) -> FloatArray:
        """Return textures' scores that put a row, picked at random, at an error of its own.

        Student rows may have an inner mode at each of them. The density of these points is the
        mean of the rows' own densities.
        """
        u = rng.random((n, *error.shape[:-1], len(self._begins)))
        stratum = np.arange(n) // 2 if n > 1 else np.zeros(1)  # each twice, as of other points
        pick = (stratum[:, None, None, None] + u) / (stratum[-1] + 1) * self._n_in_texture
        row = self._by_texture[self._begins + np.minimum(pick.astype(int), self._n_in_texture - 1)]
        scale = np.broadcast_to(batch.scale, (*error.shape[1:-1], len(self.rows.upper)))
        own = np.take_along_axis(np.broadcast_to(scale, row.shape[:-1] + scale.shape[-1:]), row, -1)
        here = np.take_along_axis(
            np.broadcast_to(error, row.shape[:-1] + error.shape[-1:]), row, -1
        )
        t = self.tail.rvs(rng, batch.df, row.shape)
        return np.nan_to_num((here - own * t) / batch.root.first, posinf=1e30, neginf=-1e30)


class Prepared(NamedTuple):
    """What depends on error model parameters alone, for many draws.

    Parameters
    ----------
    eta : ndarray of float, shape (n_draw, n_noise)
        Error model parameters.
    root : Root
        L.
    precision : Precision or None
        M of normal rows.
    """

    eta: FloatArray
    root: Root
    precision: Precision | None


class _Batch(NamedTuple):
    """Rows of many draws."""

    error: FloatArray
    scale: FloatArray
    df: FloatArray | None
    root: Root
    eta: FloatArray


class _Normal(NamedTuple):
    """Normal approximation of the scores: means, the offsets that they make, and precision."""

    first: FloatArray
    rest: FloatArray
    offset: FloatArray
    precision: Precision


def _primes(n: int) -> FloatArray:
    """Return the first n primes."""
    found: list[int] = []
    candidate = 2
    while len(found) < n:
        if all(candidate % prime for prime in found if prime * prime <= candidate):
            found.append(candidate)
        candidate += 1
    return np.array(found, float)


def _logistic(u: FloatArray) -> FloatArray:
    """Return the values of the points' distribution below which the probability is u."""
    value: FloatArray = _POINT_SCALE * np.log(u / (1 - u))
    return value


def _log_logistic(t: FloatArray) -> FloatArray:
    """Return the log density of the points' distribution."""
    z = np.abs(t) / _POINT_SCALE
    value: FloatArray = -z - 2 * np.log1p(np.exp(-z)) - math.log(_POINT_SCALE)
    return value


def _log_mean(x: FloatArray) -> FloatArray:
    """Return the log of the mean of exponentials over the first axis."""
    top = x.max(axis=0)
    value: FloatArray = np.where(top == -np.inf, 0.0, top)
    return value + np.log(np.exp(x - value).mean(axis=0))


def _chosen(scores: FloatArray, log_weight: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return one point of each draw (and level), by weight; points are on the first axis."""
    top = log_weight.max(axis=0)
    ladder = np.cumsum(np.exp(log_weight - np.where(top == -np.inf, 0.0, top)), axis=0)
    place = (ladder < rng.random(ladder.shape[1:]) * ladder[-1]).sum(axis=0)
    place = np.minimum(place, len(scores) - 1)
    return np.take_along_axis(scores, np.broadcast_to(place, scores.shape[1:])[None], axis=0)[0]
