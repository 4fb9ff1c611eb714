r"""The likelihood of rows whose shared offsets have no closed-form integral.

Student errors, brackets and counts leave no normal integral over the offsets. They are sampled
beside the parameters instead, in coordinates that take the dependence out: were the rows normal,
of the same middles and widths, the scores given the parameters would be normal with mean m and
Cholesky factor R of the precision, and ``xi = R' (scores - m)`` standard normal. The rows are not,
so xi is only nearly so; the Jacobian keeps the density exact.
"""

import math

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.model.conditional_offsets import (
    Design,
    OffsetPosterior,
    Root,
    given_rows,
    products_given,
)
from ridgebayes.model.rows import Rows
from ridgebayes.model.shared_offsets import Offsets, OffsetsGiven
from ridgebayes.model.tails import Tail

_LOG_2PI = math.log(2 * math.pi)
_PASSES = 3  # outliers' weights settle; what is left is the sampler's to correct


class SampledOffsets:
    """Likelihood of any rows given offsets, and a normal approximation with them integrated out.

    Parameters
    ----------
    rows : Rows
        Rows.
    offsets : Offsets
        What they share.
    tail : Tail
        Distribution of the rows' own errors.
    """

    def __init__(self, rows: Rows, offsets: Offsets, tail: Tail) -> None:
        self._rows, self._offsets, self._tail = rows, offsets, tail
        self._design = Design(offsets.codes, offsets.n_level)
        self._design_next = Design(offsets.codes_next, offsets.n_level)
        self.n_latent = offsets.n_level

    def marginal(self, log_rates: FloatArray, eta: FloatArray) -> FloatArray:
        """Return Laplace's approximation of the log-likelihood with the offsets integrated out.

        Shape (...), from (..., n_texture) and (..., n_noise).
        """
        at_centre = np.zeros((*eta.shape[:-1], self.n_latent))
        return self.joint(log_rates, eta, at_centre) + 0.5 * self.n_latent * _LOG_2PI

    def products(self, eta: FloatArray, columns: FloatArray) -> FloatArray:
        """Return X' inverse(Sigma) X of columns (n_obs, m), rows taken as normal, (..., m, m)."""
        weight = 1 / self._rows.normal_variance(eta, self._tail)
        return products_given(self._design, self._offsets.root(eta), weight, columns)

    def joint(self, log_rates: FloatArray, eta: FloatArray, latent: FloatArray) -> FloatArray:
        """Return log-likelihood + log density of the scores + log Jacobian of xi, shape (...)."""
        root, given = self._approximation(log_rates, eta)
        scores = given.at(latent)
        rows = self._rows_given(log_rates, eta, root.times(scores)).sum(axis=-1)
        prior = -0.5 * ((scores**2).sum(axis=-1) + self.n_latent * _LOG_2PI)
        return rows + prior - 0.5 * given.log_det

    def pointwise(self, log_rates: FloatArray, eta: FloatArray, latent: FloatArray) -> FloatArray:
        """Return log p(row | offsets), shape (n_draw, n_obs)."""
        root, given = self._approximation(log_rates, eta)
        return self._rows_given(log_rates, eta, root.times(given.at(latent)))

    def given(self, log_rates: FloatArray, eta: FloatArray, latent: FloatArray) -> OffsetsGiven:
        """Return the sampled offsets, for each of many draws."""
        root, given = self._approximation(log_rates, eta)
        return OffsetsGiven(self._offsets, eta, root, given.at(latent), None)

    def _rows_given(self, log_rates: FloatArray, eta: FloatArray, b: FloatArray) -> FloatArray:
        offset, after = self._design.spread(b), self._design_next.spread(b)
        df = eta[..., -1] if self._tail.parameter_names else None
        return self._rows.log_likelihood(log_rates, eta[..., 0], self._tail, df, offset, after)

    def _approximation(
        self, log_rates: FloatArray, eta: FloatArray
    ) -> tuple[Root, OffsetPosterior]:
        """Return L, and the scores given the rows taken as normal."""
        root, residual = self._offsets.root(eta), self._residual(log_rates)
        weight = 1 / self._rows.normal_variance(eta, self._tail)
        given = given_rows(self._design, root, weight, residual)
        if not self._tail.parameter_names:
            return root, given
        _, extra = self._rows.centre
        own, df = eta[..., :1] ** 2 + self._rows.rel_se**2, eta[..., -1:]
        for _ in range(_PASSES):
            # A t is a normal of unknown variance: this is its mean given what the residual may be.
            left = residual - self._design.spread(root.times(given.mean))
            square = left * left + given.variance(root.loading(self._design))
            variance = (df * own + square) / (df + 1) + extra
            given = given_rows(self._design, root, 1 / variance, residual)
        return root, given

    def _residual(self, log_rates: FloatArray) -> FloatArray:
        return self._rows.centre[0] + 2 * log_rates[..., self._rows.texture]
