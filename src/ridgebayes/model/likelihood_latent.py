r"""The likelihood of rows whose shared offsets have no closed-form integral.

Student errors, brackets and counts leave no normal integral over the offsets' standard normal
scores. Were the rows normal, of the same middles and widths, the scores given the parameters would
be normal with mean m and Cholesky factor R of the precision, and ``xi = R' (scores - m)`` standard
normal. The rows are not, so xi is only nearly so. Two ways integrate over xi:

- where each row looks at one level of one factor, the integral is a product of one-dimensional
  ones: the trapezoidal rule in t, ``xi = sinh(a t) / a``, whose error falls exponentially with the
  number of nodes;
- otherwise importance sampling about the normal approximation: the mean of

  .. math:: w(\xi) = \hat p \prod_i \frac{p(y_i \mid f_i)}{N(r_i; f_i, v_i)},

  f being the rows' offsets at xi, r and v the rows' middles and variances taken as normal, and
  p-hat the closed form of those.

Nodes and points are shifted or drawn afresh for each draw of the parameters. Both estimates are
unbiased then, and an offset taken in proportion to its weight is one of the exact posterior.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import ComputationError
from ridgebayes.model.conditional_offsets import Design, products_given
from ridgebayes.model.normal_rows import NormalRows
from ridgebayes.model.offsets_given import OffsetsGiven
from ridgebayes.model.rows import Rows
from ridgebayes.model.shared_offsets import Offsets, SmoothOffsets
from ridgebayes.model.tails import Tail

_LOG_2PI = math.log(2 * math.pi)
_STRETCH = 0.7  # a of sinh(a t) / a: tails that outliers need, for nodes
# The same for points, and how much wider than the normal approximation they lie per 1 / (1 + df):
# it is the curvature at the rows' middle, beyond which Student rows let offsets go further. By the
# variance of the weights at draws of posteriors of texture+step and step-smooth, df about 1.2.
_STRETCH_POINTS, _WIDER = 0.5, 0.8
_NARROW = 1e-3  # least share of it
_STEP, _HALF = 0.25, 24  # the one-dimensional rule: 49 nodes, to 47 sds
# Of estimates that no more than so many points are asked for, every second one: of a posterior's
# draws 256 were mostly within 0.01, of outliers within 0.3.
_FEW_POINTS = 8
_HUGE = 1e300
MOST_OFFSETS = 600  # of points: all offsets move all rows there
# Numbers at a time where draws x points x rows are needed: caches hold them.
_CHUNK = 200_000


class Estimate(NamedTuple):
    """A likelihood with the offsets integrated out, and an offset drawn, for each of many draws.

    Parameters
    ----------
    log_density : ndarray of float, shape (n_draw,)
        Log of an unbiased estimate.
    log_joint : ndarray of float, shape (n_draw,)
        What `SampledOffsets.joint` is at `latent`.
    latent : ndarray of float, shape (n_draw, n_latent)
        Scores of the offsets drawn.
    """

    log_density: FloatArray
    log_joint: FloatArray
    latent: FloatArray


class SampledOffsets:
    """Likelihood of any rows given offsets, and estimates with them integrated out.

    Parameters
    ----------
    rows : Rows
        Rows.
    offsets : Offsets
        What they share.
    tail : Tail
        Distribution of the rows' own errors.

    Raises
    ------
    ComputationError
        If points would be drawn of too many offsets.
    """

    def __init__(self, rows: Rows, offsets: Offsets, tail: Tail) -> None:
        self._rows, self._offsets, self._tail = rows, offsets, tail
        self._design = Design(offsets.codes, offsets.n_level)
        self._normal = NormalRows(rows, offsets, tail)
        independent = self._design.diagonal and not isinstance(offsets, SmoothOffsets)
        self.is_product = independent and not len(self._normal.counts)
        self.n_latent = offsets.n_level
        if not self.is_product and offsets.n_level > MOST_OFFSETS:
            raise ComputationError(
                f"{offsets.n_level} offsets of rows with Student errors, brackets or counts; "
                f"expected at most {MOST_OFFSETS}, since what a likelihood call takes grows with "
                "offsets times rows"
            )
        # Numbers that `marginal` holds at a time for each draw.
        self.n_held = (2 * _HALF + 1) * len(rows.upper) if self.is_product else 1

    def marginal(self, log_rates: FloatArray, eta: FloatArray) -> FloatArray:
        """Return the log-likelihood with the offsets integrated out.

        Shape (...), from (..., n_texture) and (..., n_noise). By the one-dimensional rule where it
        applies, else Laplace's approximation.
        """
        if self.is_product:
            top, share = _shares(self._lines(log_rates, eta)[2])
            value: FloatArray = (top + np.log(share.sum(axis=-1))).sum(axis=-1)
            return value
        if eta.ndim == 2 and len(log_rates) == len(eta):
            return self._in_parts(self._laplace, log_rates, eta)
        return self._laplace(log_rates, eta)

    def estimated(
        self, log_rates: FloatArray, eta: FloatArray, rng: np.random.Generator, n_point: int
    ) -> Estimate:
        """Estimate the likelihood at draws (n_draw, n_texture) and (n_draw, n_noise)."""
        way, n_held = self._from_lines, self.n_held
        if not self.is_product:
            way, n_held = self._from_points, n_point * (len(self._rows.upper) + 2 * self.n_latent)
        n_at_once = max(_CHUNK // n_held, 1)
        parts = [
            way(log_rates[i : i + n_at_once], eta[i : i + n_at_once], rng, n_point)
            for i in range(0, len(eta), n_at_once)
        ]
        return Estimate(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def _laplace(self, log_rates: FloatArray, eta: FloatArray) -> FloatArray:
        """Return Laplace's approximation about the mean of the scores, rows taken as normal."""
        root, given, *_ = self._normal.given(self._residual(log_rates), eta)
        rows = self._rows_given(log_rates, eta, root.times(given.mean)).sum(axis=-1)
        value: FloatArray = rows - 0.5 * ((given.mean**2).sum(axis=-1) + given.log_det)
        return value

    def _lines(
        self,
        log_rates: FloatArray,
        eta: FloatArray,
        shift: FloatArray | float = 0.0,
        every: int = 1,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return scores at nodes of each level, log densities, log weights: (..., level, node)."""
        _, given, *_ = self._normal.given(self._residual(log_rates), eta)
        step, half = every * _STEP, _HALF // every
        t: FloatArray = step * (np.arange(-half, half + 1.0)[:, None] + shift)
        xi, log_volume = _stretched(t, _STRETCH)
        scores = given.mean[..., None, :] + xi / given.pivots[..., None, :]
        each = eta[..., None, :]
        offsets = self._offsets.root(each).times(scores)
        rows = self._rows_given(log_rates[..., None, :], each, offsets)
        log_joint = self._design.gather(rows) - 0.5 * (scores * scores + _LOG_2PI)
        log_weight = log_joint + log_volume + math.log(step) - np.log(given.pivots)[..., None, :]
        nodes, joint, weight = (np.swapaxes(x, -1, -2) for x in (scores, log_joint, log_weight))
        return nodes, joint, weight

    def _from_lines(
        self, log_rates: FloatArray, eta: FloatArray, rng: np.random.Generator, n_point: int
    ) -> Estimate:
        """Estimate level by level, by nodes shifted at random."""
        shift = rng.random((len(eta), 1, self.n_latent)) - 0.5
        every = 2 if n_point <= _FEW_POINTS else 1
        scores, log_joint, log_weight = self._lines(log_rates, eta, shift, every)
        top, share = _shares(log_weight)
        place = _picked(share, rng)[..., None]
        latent, joint = (np.take_along_axis(x, place, axis=-1)[..., 0] for x in (scores, log_joint))
        total = top + np.log(share.sum(axis=-1))
        return Estimate(total.sum(axis=-1), joint.sum(axis=-1), latent)

    def _from_points(
        self, log_rates: FloatArray, eta: FloatArray, rng: np.random.Generator, n_point: int
    ) -> Estimate:
        """Estimate by points about the normal approximation."""
        root, given, weight, site = self._normal.given(self._residual(log_rates), eta)
        z = rng.standard_normal((len(eta), n_point, self.n_latent))
        # A priori offsets are normal; the more the rows know of one, the longer are its tails.
        known = np.maximum(1 - given.pivots**-2, _NARROW)[:, None]
        wider = _WIDER / (1 + eta[:, -1:, None]) if self._tail.parameter_names else 0.0
        width = 1 + known * wider
        xi, log_volume = _stretched(z, _STRETCH_POINTS * known)
        xi, log_volume = width * xi, log_volume + np.log(width)
        design = self._normal.design
        mean = design.spread(root.times(given.mean))
        offset = mean[:, None] + xi @ given.half(root.loading(design))
        rows = self._rows_at(log_rates[:, None], eta[:, None], offset)
        left, off = site - mean, site[:, None] - offset
        closed = (weight * left * left).sum(axis=-1) + (given.mean**2).sum(axis=-1) + given.log_det
        log_in_xi = rows.sum(axis=-1) + 0.5 * (weight[:, None] * off * off).sum(axis=-1)
        log_in_xi -= 0.5 * closed[:, None]
        log_in_xi -= 0.5 * (xi * xi + _LOG_2PI).sum(axis=-1)
        log_weight = log_in_xi + (log_volume + 0.5 * (z * z + _LOG_2PI)).sum(axis=-1)
        top, share = _shares(log_weight)
        chosen = np.arange(len(eta)), _picked(share, rng)
        total = top + np.log(share.mean(axis=1))
        return Estimate(total, log_in_xi[chosen] + 0.5 * given.log_det, given.at(xi[chosen]))

    def products(self, eta: FloatArray, columns: FloatArray) -> FloatArray:
        """Return X' inverse(Sigma) X of columns (n_obs, m), rows taken as normal, (..., m, m).

        The last column is the rows' residuals: they tell which rows are outliers.
        """
        residual = np.broadcast_to(columns[:, -1], (*eta.shape[:-1], len(columns)))
        root, weight = self._normal.weights(residual, eta)
        # Outliers and wide intervals tell less than is expected of them a priori. Of other rows the
        # expected information serves, which does not hang on what they are.
        weight = self._normal.by_row(weight)
        weight = np.minimum(weight, 1 / self._rows.normal_variance(eta, self._tail))
        return products_given(self._design, root, weight, columns)

    def joint(self, log_rates: FloatArray, eta: FloatArray, latent: FloatArray) -> FloatArray:
        """Return the log-likelihood given the scores + log density of these, shape (...)."""
        rows = self.pointwise(log_rates, eta, latent).sum(axis=-1)
        value: FloatArray = rows - 0.5 * (latent * latent + _LOG_2PI).sum(axis=-1)
        return value

    def pointwise(self, log_rates: FloatArray, eta: FloatArray, latent: FloatArray) -> FloatArray:
        """Return log p(row | scores), shape (..., n_obs)."""
        if eta.ndim == 2 and len(log_rates) == len(eta) == len(latent):
            return self._in_parts(self._pointwise, log_rates, eta, latent)
        return self._pointwise(log_rates, eta, latent)

    def given(self, log_rates: FloatArray, eta: FloatArray, latent: FloatArray) -> OffsetsGiven:
        """Return the offsets drawn, for each of many draws."""
        return OffsetsGiven(self._offsets, eta, self._offsets.root(eta), latent, None)

    def _in_parts(
        self, function: Callable[..., FloatArray], log_rates: FloatArray, *others: FloatArray
    ) -> FloatArray:
        """Return a function of (n_draw, ...) arrays, worked out for some draws at a time."""
        n_at_once = max(_CHUNK // (len(self._rows.upper) * self.n_latent), 1)
        parts = [slice(i, i + n_at_once) for i in range(0, len(log_rates), n_at_once)]
        return np.concatenate([function(*(x[p] for x in (log_rates, *others))) for p in parts])

    def _pointwise(self, log_rates: FloatArray, eta: FloatArray, latent: FloatArray) -> FloatArray:
        return self._rows_given(log_rates, eta, self._offsets.root(eta).times(latent))

    def _rows_given(self, log_rates: FloatArray, eta: FloatArray, b: FloatArray) -> FloatArray:
        return self._rows_at(log_rates, eta, self._normal.design.spread(b))

    def _rows_at(self, log_rates: FloatArray, eta: FloatArray, offset: FloatArray) -> FloatArray:
        df = eta[..., -1] if self._tail.parameter_names else None
        ends = self._normal.at_ends(offset)
        return self._rows.log_likelihood(log_rates, eta[..., 0], self._tail, df, *ends)

    def _residual(self, log_rates: FloatArray) -> FloatArray:
        return self._rows.centre[0] + 2 * log_rates[..., self._rows.texture]


def _stretched(t: FloatArray, stretch: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Return sinh(a t) / a, and the log of its slope."""
    return np.sinh(stretch * t) / stretch, np.log(np.cosh(stretch * t))


def _shares(log_weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the largest log weight of the last axis, and weights in its units."""
    log_weight = np.where(np.isnan(log_weight), -np.inf, log_weight)
    top = np.maximum(log_weight.max(axis=-1), -_HUGE)
    return top, np.exp(log_weight - top[..., None])


def _picked(share: FloatArray, rng: np.random.Generator) -> IntArray:
    """Return an index of the last axis, drawn in proportion to weights."""
    ladder = np.cumsum(share, axis=-1)
    passed = ladder < rng.random((*share.shape[:-1], 1)) * ladder[..., -1:]
    value: IntArray = np.minimum(passed.sum(axis=-1), share.shape[-1] - 1)
    return value
