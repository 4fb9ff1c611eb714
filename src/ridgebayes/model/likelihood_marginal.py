"""The likelihood of exact rows with normal errors and shared offsets, offsets integrated out."""

import math
from dataclasses import replace

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.model.cholesky import Factor, cholesky_or_nan, solve_lower
from ridgebayes.model.conditional_offsets import (
    Design,
    OffsetPosterior,
    Root,
    given_rows,
    precision_root,
    products_given,
)
from ridgebayes.model.offsets_given import OffsetsGiven
from ridgebayes.model.rows import RowGroups, Rows
from ridgebayes.model.shared_offsets import Offsets, SmoothOffsets

_LOG_2PI = math.log(2 * math.pi)
_WORKED_OUT = ("_last", "_means", "_last_whole")
_LARGEST_KEPT = 2**24  # bytes of factors that are kept for the next call
_ALONE = 1e-5  # share of a row's precision left by its offset below which too few digits are right
_CHUNK = 2_000_000  # numbers held at a time where draws x levels x rows are needed


class IntegratedOffsets:
    """Closed-form likelihood; its cost grows with levels, not with the rows: see `precision_root`.

    Parameters
    ----------
    rows : Rows
        Exact rows.
    offsets : Offsets
        What they share.
    """

    n_latent = 0

    def __init__(self, rows: Rows, offsets: Offsets) -> None:
        self._rows, self._offsets = rows, offsets
        self._groups = RowGroups.of(rows, offsets.codes)
        self._design = Design(offsets.codes[:, self._groups.row], offsets.n_level)
        # Coordinates and density ask for the same factors one after the other.
        self._last: tuple[object, Root, Factor] | None = None
        # And products are asked for of the same columns again and again.
        self._means: tuple[FloatArray, FloatArray] | None = None

    def __getstate__(self) -> dict[str, object]:
        """Leave behind what can be worked out again: factors may be a hundred times the rest."""
        return vars(self) | {name: None for name in vars(self) if name in _WORKED_OUT}

    def marginal(self, log_rates: FloatArray, eta: FloatArray) -> FloatArray:
        """Return the log-likelihood, shape (...), from (..., n_texture) and (..., n_noise)."""
        groups, variance = self._groups, self._variance(eta)
        root, given = self._given(log_rates, eta)
        left = self._residual(log_rates) - self._design.spread(root.times(given.mean))
        misfit = ((groups.sum_of_squares + groups.n * left * left) / variance).sum(axis=-1)
        misfit += (given.mean**2).sum(axis=-1) + given.log_det
        value: FloatArray = -0.5 * (
            misfit + (groups.n * (np.log(variance) + _LOG_2PI)).sum(axis=-1)
        )
        return value

    def products(self, eta: FloatArray, columns: FloatArray) -> FloatArray:
        """Return X' inverse(Sigma) X of columns (n_obs, m) that groups of rows share, (..., m, m).

        Of residuals the means of groups serve: what products with other columns need.
        """
        root, factor = self._factors(eta)
        weight = self._groups.n / self._variance(eta)
        return products_given(self._design, root, weight, self._group_means(columns), factor)

    def pointwise(self, log_rates: FloatArray, eta: FloatArray, latent: FloatArray) -> FloatArray:
        """Return log p(row | all other rows), shape (n_draw, n_obs), from (n_draw, ...).

        With S the diagonal of the rows' precision and alpha the precision times the residual, a row
        is normal given the others, at alpha/S from its value, with variance 1/S.
        """
        n_draw, n_group = len(eta), len(self._groups.n)
        per_chunk = max(_CHUNK // (self._offsets.n_level * n_group), 1)
        return np.concatenate(
            [
                self._conditional(log_rates[i : i + per_chunk], eta[i : i + per_chunk])
                for i in range(0, n_draw, per_chunk)
            ]
        )

    def given(self, log_rates: FloatArray, eta: FloatArray, latent: FloatArray) -> OffsetsGiven:
        """Return what the rows tell of the offsets, for each of many draws."""
        root, given = self._given(log_rates, eta)
        self._last = None  # who asked holds them, and no density is asked for next
        return OffsetsGiven(self._offsets, eta, root, given.mean, given.factor)

    def _factors(self, eta: FloatArray) -> tuple[Root, Factor]:
        """Return L and the Cholesky factor of the scores' precision."""
        key = eta.shape, eta.tobytes()
        if self._last is not None and self._last[0] == key:
            return self._last[1], self._last[2]
        root, weight = self._offsets.root(eta), self._groups.n / self._variance(eta)
        factor = precision_root(self._design, root, weight)
        if factor.nbytes <= _LARGEST_KEPT:
            self._last = key, root, factor
        return root, factor

    def _conditional(self, log_rates: FloatArray, eta: FloatArray) -> FloatArray:
        groups, of_row, variance = self._groups, self._groups.of_row, self._variance(eta)
        root, given = self._given(log_rates, eta)
        left = self._residual(log_rates) - self._design.spread(root.times(given.mean))
        # What is left may be 1e-9 of the offset, whose last digits a second pass puts right.
        amiss = root.transposed_times(self._design.gather(groups.n / variance * left)) - given.mean
        about = replace(given, mean=np.zeros_like(given.mean))
        step = about.at(given.half(amiss[..., None])[..., 0])
        left = left - self._design.spread(root.times(step))
        share = 1 - given.row_variance(root, self._design) / variance
        precision, pull = share / variance, left / variance
        # Of an offset that one row tells of, next to nothing is left of the 1; row and offset
        # cancel too. Such a row is scored by what the others tell of its offset.
        alone = (share < _ALONE) & (groups.n == 1)
        for group in np.flatnonzero(alone.any(axis=0)).tolist():
            draws = alone[:, group]
            error, wide = self._given_others(log_rates[draws], eta[draws], group)
            precision[draws, group] = 1 / wide
            pull[draws, group] = error / wide
        pull = pull[:, of_row] + (self._rows.upper - groups.mean[of_row]) / variance[:, of_row]
        return _log_normal(precision[:, of_row], pull)

    def _given_others(
        self, log_rates: FloatArray, eta: FloatArray, group: int
    ) -> tuple[FloatArray, FloatArray]:
        """Return the error of a single row's prediction by all other rows, and its variance."""
        root, variance = self._offsets.root(eta), self._variance(eta)
        weight, residual = self._groups.n / variance, self._residual(log_rates)
        weight[:, group] = 0
        others = given_rows(self._design, root, weight, residual)
        own = Design(self._design.codes[:, [group]], self._offsets.n_level)
        error = residual[:, group] - own.spread(root.times(others.mean))[:, 0]
        return error, variance[:, group] + others.row_variance(root, own)[:, 0]

    def _given(self, log_rates: FloatArray, eta: FloatArray) -> tuple[Root, OffsetPosterior]:
        root, factor = self._factors(eta)
        weight, residual = self._groups.n / self._variance(eta), self._residual(log_rates)
        return root, given_rows(self._design, root, weight, residual, factor)

    def _group_means(self, columns: FloatArray) -> FloatArray:
        if self._means is None or self._means[0] is not columns:
            groups = self._groups
            mean = np.zeros((len(groups.n), columns.shape[1]))
            np.add.at(mean, groups.of_row, columns / groups.n[groups.of_row, None])
            self._means = columns, mean
        return self._means[1]

    def _residual(self, log_rates: FloatArray) -> FloatArray:
        return self._groups.mean + 2 * log_rates[..., self._groups.texture]

    def _variance(self, eta: FloatArray) -> FloatArray:
        return eta[..., :1] ** 2 + self._groups.rel_se**2


class IntegratedSmoothOffsets(IntegratedOffsets):
    """The same where offsets are as many as groups of rows: one factor serves, not two.

    Parameters
    ----------
    rows : Rows
        Exact rows.
    offsets : SmoothOffsets
        What they share.
    """

    def __init__(self, rows: Rows, offsets: SmoothOffsets) -> None:
        super().__init__(rows, offsets)
        self._smooth = offsets
        self._last_whole: tuple[object, FloatArray] | None = None

    def marginal(self, log_rates: FloatArray, eta: FloatArray) -> FloatArray:
        """Return the log-likelihood; a group is normal by its mean, and by its scatter about it."""
        groups, residual = self._groups, self._residual(log_rates)
        if eta.ndim > 2 and np.array_equal(eta, np.broadcast_to(eta[..., :1, :], eta.shape)):
            # Many coefficients beside one error model, axis by axis: one factor serves them all.
            eta, factor = eta[..., :1, :], self._whole_factor(eta[..., 0, :])
            half = np.swapaxes(solve_lower(factor, np.swapaxes(residual, -1, -2)), -1, -2)
            factor = factor[..., None, :, :]
        else:
            factor = self._whole_factor(eta)
            half = solve_lower(factor, residual[..., None])[..., 0]
        variance = self._variance(eta)
        misfit = half**2 + 2 * np.log(np.diagonal(factor, axis1=-2, axis2=-1)) + _LOG_2PI
        scatter = groups.sum_of_squares / variance + np.log(groups.n)
        scatter = scatter + (groups.n - 1) * (np.log(variance) + _LOG_2PI)
        value: FloatArray = -0.5 * (misfit + scatter).sum(axis=-1)
        return value

    def products(self, eta: FloatArray, columns: FloatArray) -> FloatArray:
        half = solve_lower(self._whole_factor(eta), self._group_means(columns))
        return np.swapaxes(half, -1, -2) @ half

    def _conditional(self, log_rates: FloatArray, eta: FloatArray) -> FloatArray:
        # As smooth offsets have it, sigma may be 1e-8 of tau: nothing here is taken from 1. A
        # group's rows have the precision of their mean, over n^2, and that of their scatter.
        groups, of_row, variance = self._groups, self._groups.of_row, self._variance(eta)
        factor = self._whole_factor(eta)
        inverse = solve_lower(factor, np.broadcast_to(np.eye(len(groups.n)), factor.shape))
        half = inverse @ self._residual(log_rates)[..., None]
        precision = (inverse**2).sum(axis=-2) / groups.n**2 + (1 - 1 / groups.n) / variance
        pull = (np.swapaxes(inverse, -1, -2) @ half)[..., 0] / groups.n
        pull = pull[:, of_row] + (self._rows.upper - groups.mean[of_row]) / variance[:, of_row]
        return _log_normal(precision[:, of_row], pull)

    def _whole_factor(self, eta: FloatArray) -> FloatArray:
        """Return the Cholesky factor of the covariance of the groups' means."""
        key = eta.shape, eta.tobytes()
        if self._last_whole is not None and self._last_whole[0] == key:
            return self._last_whole[1]
        groups, index = self._groups, np.arange(len(self._groups.n))
        covariance = self._smooth.covariance(eta, self._smooth.codes[:, groups.row])
        covariance[..., index, index] += self._variance(eta) / groups.n
        factor = cholesky_or_nan(covariance)
        if factor.nbytes <= _LARGEST_KEPT:
            self._last_whole = key, factor
        return factor


def _log_normal(precision: FloatArray, pull: FloatArray) -> FloatArray:
    """Return log densities of rows pull/precision off, of that precision."""
    return 0.5 * (np.log(precision) - _LOG_2PI - pull * pull / precision)
