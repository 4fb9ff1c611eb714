"""Likelihoods of rows that share nothing."""

import math

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.model.conditional_offsets import weighted_products
from ridgebayes.model.rows import RowGroups, Rows
from ridgebayes.model.tails import Tail


class IndependentRows:
    """Any rows and tail, one by one.

    Parameters
    ----------
    rows : Rows
        Rows.
    tail : Tail
        Distribution of their errors.

    Attributes
    ----------
    n_held : int
        Numbers that each draw of the parameters takes.
    """

    n_latent = 0

    def __init__(self, rows: Rows, tail: Tail) -> None:
        self._rows, self._tail = rows, tail
        self.n_held = len(rows.upper)

    def marginal(self, log_rates: FloatArray, eta: FloatArray) -> FloatArray:
        """Return the log-likelihood, shape (...), from (..., n_texture) and (..., n_noise)."""
        value: FloatArray = self._each(log_rates, eta).sum(axis=-1)
        return value

    def pointwise(self, log_rates: FloatArray, eta: FloatArray, latent: FloatArray) -> FloatArray:
        """Return each row's log-likelihood, shape (..., n_obs)."""
        return self._each(log_rates, eta)

    def products(self, eta: FloatArray, columns: FloatArray) -> FloatArray:
        """Return X' inverse(Sigma) X of columns (n_obs, m), rows taken as normal, (..., m, m)."""
        return weighted_products(1 / self._rows.normal_variance(eta, self._tail), columns)

    def given(self, log_rates: FloatArray, eta: FloatArray, latent: FloatArray) -> None:
        """Return nothing: rows share no offsets."""

    def _each(self, log_rates: FloatArray, eta: FloatArray) -> FloatArray:
        df = eta[..., -1] if self._tail.parameter_names else None
        return self._rows.log_likelihood(log_rates, eta[..., 0], self._tail, df)


class IndependentNormalRows(IndependentRows):
    """Exact rows with normal errors: per texture a number, a mean and a sum of squares.

    Parameters
    ----------
    rows : Rows
        Exact rows.
    tail : Tail
        The normal.
    """

    def __init__(self, rows: Rows, tail: Tail) -> None:
        super().__init__(rows, tail)
        self.groups = groups = RowGroups.of(rows)
        self.n_held = len(groups.n)
        # Groups by known error: of those alike in it only sums are needed, draw by draw.
        rel_se, level = np.unique(groups.rel_se, return_inverse=True)
        order = np.argsort(level, kind="stable")
        self._level_variance = rel_se**2
        self._level_n = np.bincount(level, groups.n)
        self._level_squares = np.bincount(level, groups.sum_of_squares)
        self._level_begins = np.searchsorted(level[order], np.arange(len(rel_se)))
        self._n, self._mean, texture = groups.n[order], groups.mean[order], groups.texture[order]
        is_all = np.array_equal(texture, np.arange(rows.texture.max() + 1))
        self._texture = slice(None) if is_all else texture

    def marginal(self, log_rates: FloatArray, eta: FloatArray) -> FloatArray:
        r = self._mean + 2 * log_rates[..., self._texture]
        r *= r
        if len(self._level_n) == 1:
            squares = (r @ self._n)[..., None]
        else:
            squares = np.add.reduceat(self._n * r, self._level_begins, axis=-1)
        variance = eta[..., :1] ** 2 + self._level_variance
        misfit = (self._level_squares + squares) / variance
        value: FloatArray = -0.5 * (self._level_n * np.log(2 * math.pi * variance) + misfit).sum(
            axis=-1
        )
        return value

    def gradient(self, log_rates: FloatArray, eta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return d marginal by the log rate of each group's texture, and by sigma.

        Returns
        -------
        by_log_rate : ndarray of float, shape (..., n_group)
            In the order of `groups`.
        by_sigma : ndarray of float, shape (...)
            Of all rows.
        """
        groups = self.groups
        r = groups.mean + 2 * log_rates[..., groups.texture]
        variance = eta[..., :1] ** 2 + groups.rel_se**2
        misfit = (groups.sum_of_squares + groups.n * r * r) / variance
        by_sigma = eta[..., 0] * ((misfit - groups.n) / variance).sum(axis=-1)
        return -2 * groups.n * r / variance, by_sigma
