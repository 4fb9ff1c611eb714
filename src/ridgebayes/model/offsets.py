r"""Shared offsets: their levels, their prior covariance, and their values at new textures.

Offsets enter a row's log load linearly: ``eta = mean + Z x``, with ``x = L s`` and standard normal
scores s. The levels have two blocks. The *first* block has a level for each texture, with a
diagonal L; a level is the sum of the texture offset and the power law's log K, since both shift all
rows of a texture by one amount. The *rest* has the levels of steps, series, or places of a smooth
function; a place is a point (log h, a/pitch).
"""

from dataclasses import dataclass

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import Texture
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.model.design import DesignMatrix
from ridgebayes.model.linear_algebra import cholesky_or_nan, solve_lower
from ridgebayes.model.noise import SERIES, SMOOTH, Noise
from ridgebayes.model.observations import Observations

MAX_OTHER_LEVELS = 600  # levels of the rest; the cost of a likelihood grows with their cube


@dataclass(frozen=True, eq=False)
class Root:
    """The factor L at many draws: offsets are L times standard normal scores.

    Parameters
    ----------
    first : ndarray of float, shape (..., n_first)
        Standard deviations of the first block.
    rest : ndarray of float, shape (..., n_rest, n_rest)
        Lower Cholesky factor of the rest's covariance.
    """

    first: FloatArray
    rest: FloatArray

    def times(self, first: FloatArray, rest: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return L s."""
        return self.first * first, (self.rest @ rest[..., None])[..., 0]

    def transposed_times(
        self, first: FloatArray, rest: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return L' x."""
        return self.first * first, (rest[..., None, :] @ self.rest)[..., 0, :]

    def inside(self, border: FloatArray, corner: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return border and corner of L' G L, for G from `DesignMatrix.gram`."""
        border = border * self.first[..., None, :]
        transpose = np.swapaxes(self.rest, -1, -2)
        if corner.ndim == border.ndim:
            return transpose @ border, transpose @ (corner @ self.rest)
        return transpose @ border, transpose @ (corner[..., None] * self.rest)


class Offsets:
    """Shared offsets of an error model, including the power law's log K, for given rows.

    Parameters
    ----------
    noise : Noise
        Error model.
    data : Observations
        Rows.
    slope_sd : ndarray of float, shape (n_texture,), optional
        Standard deviation of each texture's log load under the prior of its K.

    Raises
    ------
    InputError
        If the error model has series, but all rows belong to one series.
    ComputationError
        If there are more than 600 levels in addition to textures.
    """

    def __init__(
        self, noise: Noise, data: Observations, slope_sd: FloatArray | None = None
    ) -> None:
        factors, names = noise.factors, noise.parameter_names
        self._noise, self._data = noise, data
        if SERIES in factors and data.n_series < 2:
            raise InputError(
                f"noise {noise.name!r}: expected rows of at least two series or sources, got one"
            )
        self.slope_sd = slope_sd
        self.nugget = noise.nugget
        self._column = {name: i for i, name in enumerate(names)}
        self._length_columns = [i for name, i in self._column.items() if name.startswith("length_")]
        self._has_factor = {name: name in factors for name in ("texture", "step", SMOOTH, SERIES)}
        self._texture = {texture: j for j, texture in enumerate(data.textures)}
        self._steps = _steps(data)
        ratio = data.a_over_R / (data.a_over_R + data.b_over_R)
        # The lower end of a count is a second predictor, the load of Q + 2, with other offsets.
        counts = np.flatnonzero(data.is_count)
        texture = np.concatenate([data.texture, data.texture[counts]])
        series = np.concatenate([data.series, data.series[counts]])
        # A count of 2 does not depend on load(2), which is 0; its first predictor has an infinite
        # error, and its level is arbitrary.
        placed_counts = np.where(data.is_count & (data.Q == 2), data.Q + 2, data.Q)
        Q = np.concatenate([placed_counts, data.Q[counts] + 2])
        levels: list[IntArray] = []
        self.n_smooth = self.n_rest = 0
        if self._has_factor["step"]:
            levels.append(np.searchsorted(self._steps, Q))
            self.n_rest = len(self._steps)
        if self._has_factor[SMOOTH]:
            places = _coordinates(Q, ratio[texture])
            _, first, codes = np.unique(
                places.round(9), axis=0, return_index=True, return_inverse=True
            )
            self._places = places[first]
            self.n_smooth = self.n_rest = len(first)
            levels.append(codes.reshape(-1))
            self._axes = [_squares(column) for column in self._places.T]
        if self._has_factor[SERIES]:
            levels.append(self.n_rest + series)
            self.n_rest += data.n_series
        if self.n_rest > MAX_OTHER_LEVELS:
            raise ComputationError(
                f"{noise.name}: {self.n_rest} offsets of steps, places and series; expected at "
                f"most {MAX_OTHER_LEVELS}, since a likelihood call costs their cube"
            )
        has_first = self._has_factor["texture"] or slope_sd is not None
        self.n_first = len(data.textures) if has_first else 0
        self.n_level = self.n_first + self.n_rest
        rest = np.array(levels, dtype=np.int64).reshape(len(levels), len(Q))
        self.design = DesignMatrix(texture if has_first else None, self.n_first, rest, self.n_rest)

    def own(self) -> "Offsets":
        """Return the error model's offsets without the power law's log K."""
        return self if self.slope_sd is None else Offsets(self._noise, self._data)

    def tau(self, name: str, eta: FloatArray) -> FloatArray:
        """Return the scale of a factor's offsets, shape (...); 0 if the model lacks the factor."""
        if not self._has_factor[SMOOTH if name == "step" and self._has_factor[SMOOTH] else name]:
            return np.zeros(eta.shape[:-1])
        value: FloatArray = eta[..., self._column[f"tau_{name}"]]
        return value

    def root(self, eta: FloatArray) -> Root:
        """Return L at error model parameters (..., n_noise)."""
        return Root(self.first_root(eta), self._rest_root(eta))

    def of_predictors(self, eta: FloatArray, scores: FloatArray) -> FloatArray:
        """Return each predictor's offset, shape (..., n), for `scores` (..., n_level)."""
        first, rest = scores[..., : self.n_first], scores[..., self.n_first :]
        return self.design.spread(*self.root(eta).times(first, rest))

    def first_root(self, eta: FloatArray) -> FloatArray:
        """Return the standard deviations of the first block, shape (..., n_first)."""
        tau = self.tau("texture", eta)[..., None]
        if self.slope_sd is None:
            return np.broadcast_to(tau, (*eta.shape[:-1], self.n_first))
        return np.hypot(tau, self.slope_sd)

    def _rest_root(self, eta: FloatArray) -> FloatArray:
        lead, n, r = eta.shape[:-1], self.n_smooth, self.n_rest
        if n and n == r:
            return cholesky_or_nan(self._covariance(eta))
        root = np.zeros((*lead, r, r))
        if n:
            root[..., :n, :n] = cholesky_or_nan(self._covariance(eta))
        n_step = len(self._steps) if self._has_factor["step"] else 0
        steps, series = np.arange(n_step), np.arange(n_step + n, r)
        root[..., steps, steps] = self.tau("step", eta)[..., None]
        root[..., series, series] = self.tau(SERIES, eta)[..., None]
        return root

    def _covariance(self, eta: FloatArray) -> FloatArray:
        """Return the smooth offset's covariance at its places, shape (..., n_place, n_place)."""
        lead, n = eta.shape[:-1], self.n_smooth
        covariance = np.empty((*lead, n * n))
        covariance[...] = self.tau("step", eta)[..., None] ** 2
        for (squares, pairs), column in zip(self._axes, self._length_columns, strict=True):
            length = eta[..., column]
            with np.errstate(over="ignore", under="ignore", divide="ignore"):
                factor = np.exp(-0.5 * squares / length[..., None] ** 2)
            covariance *= np.take(factor, pairs, axis=-1)
        covariance[..., :: n + 1] *= 1 + self.nugget
        return covariance.reshape(*lead, n, n)

    def covariance(self, design: DesignMatrix, eta: FloatArray) -> FloatArray:
        """Return the covariance of the predictors' offsets, (..., n, n).

        Parameters
        ----------
        design : DesignMatrix
            Predictors, a selection of `Offsets.design`.
        eta : ndarray of float, shape (..., n_noise)
            Parameters of an error model with a smooth offset.
        """
        place, n = design.rest[0], self.n_smooth
        value = self._covariance(eta)
        if not np.array_equal(place, np.arange(n)):
            value = value.reshape(*eta.shape[:-1], n * n)[..., place[:, None] * n + place]
        if design.first is not None:
            first_block = np.where(
                np.eye(self.n_first, dtype=bool), self.first_root(eta)[..., None], 0.0
            )
            value = value + (first_block**2)[..., design.first[:, None], design.first]
        for series in design.rest[1:]:
            tau = self.tau(SERIES, eta)[..., None, None]
            value = value + tau**2 * (series[:, None] == series)
        return value

    def prior_variance(self, eta: FloatArray) -> FloatArray:
        """Return the prior variance of each predictor's offset, shape (..., n)."""
        grouped = np.zeros((*eta.shape[:-1], self.design.n))
        if self.design.first is not None:
            grouped += self.first_root(eta)[..., self.design.first] ** 2
        others = self.tau("step", eta) ** 2 + self.tau(SERIES, eta) ** 2
        value: FloatArray = grouped + others[..., None]
        return value

    def prepared(self, eta: FloatArray, scores: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Return the arrays that `at` needs for smooth offsets; None for other error models.

        Parameters
        ----------
        eta : ndarray of float, shape (n_draw, n_noise)
            Error model parameters.
        scores : ndarray of float, shape (n_draw, n_level)
            Scores of all levels.

        Returns
        -------
        inverse : ndarray of float, shape (n_draw, n_place, n_place)
            Inverse of L at the calibrated places.
        weights : ndarray of float, shape (n_draw, n_place)
            Inverse covariance times the offsets at these places.
        """
        n = self.n_smooth
        if not n:
            return None
        factor = self._rest_root(eta)[:, :n, :n]
        inverse = solve_lower(factor, np.broadcast_to(np.eye(n), factor.shape))
        smooth_scores = scores[:, self.n_first : self.n_first + n]
        return inverse, np.einsum("dml,dm->dl", inverse, smooth_scores)

    def at(
        self,
        texture: Texture,
        Q: IntArray,
        eta: FloatArray,
        scores: FloatArray,
        prepared: tuple[FloatArray, FloatArray] | None,
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance of a texture's offsets given the scores of all levels.

        Parameters
        ----------
        texture : (float, float)
            a/R and b/R.
        Q : ndarray of int, shape (n_Q,)
            Counts.
        eta : ndarray of float, shape (n_draw, n_noise)
            Error model parameters.
        scores : ndarray of float, shape (n_draw, n_level)
            Scores.
        prepared : tuple or None
            Result of `prepared` for the same draws.

        Returns
        -------
        mean, variance : ndarray of float, both of shape (n_draw, n_Q)
            Calibrated textures and steps keep their inferred offsets; new textures, new steps and
            the new series draw from the offsets' prior. A smooth offset follows from the calibrated
            places. Outside their range of log h and a/pitch, where no data test the smoothness, the
            variance increases by ``tau^2 (1 - exp(-d^2/2))``, with d the distance from the range in
            units of the lengths.
        """
        mean = np.zeros((len(eta), len(Q)))
        variance = np.zeros((len(eta), len(Q))) + self.tau(SERIES, eta)[:, None] ** 2
        first, rest = scores[:, : self.n_first], scores[:, self.n_first :]
        if self._has_factor["texture"]:
            tau, j = self.tau("texture", eta)[:, None], self._texture.get(texture)
            if j is None:
                variance = variance + tau**2
            else:
                mean = mean + tau * first[:, [j]]
        if self._has_factor["step"]:
            place = np.searchsorted(self._steps, Q)
            is_calibrated = np.append(self._steps, -1)[place] == Q
            tau = self.tau("step", eta)[:, None]
            mean = mean + np.where(
                is_calibrated, tau * rest[:, np.where(is_calibrated, place, 0)], 0.0
            )
            variance = variance + np.where(is_calibrated, 0.0, tau**2)
        if prepared is not None:
            smooth_mean, smooth_variance = self._smooth_at(texture, Q, eta, *prepared)
            mean, variance = mean + smooth_mean, variance + smooth_variance
        return mean, variance

    def _smooth_at(
        self,
        texture: Texture,
        Q: IntArray,
        eta: FloatArray,
        inverse: FloatArray,
        weights: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance of the smooth offset at a texture and counts."""
        variance = self.tau("step", eta)[:, None] ** 2
        new = _coordinates(Q, np.full(len(Q), texture[0] / (texture[0] + texture[1])))
        squares = (self._places[:, None] - new) ** 2
        low, high = self._places.min(axis=0), self._places.max(axis=0)
        beyond = np.maximum(np.maximum(low - new, new - high) - 1e-9, 0)
        with np.errstate(over="ignore", under="ignore"):
            scale = eta[:, self._length_columns] ** -2.0
            correlation = np.exp(-0.5 * np.einsum("lqx,dx->dlq", squares, scale))
            widening = -np.expm1(-0.5 * np.einsum("qx,dx->dq", beyond**2, scale))
        shared = variance[..., None] * correlation
        rest = np.maximum(variance - ((inverse @ shared) ** 2).sum(axis=-2), 0)
        return np.einsum("dl,dlq->dq", weights, shared), rest + variance * widening


def _steps(data: Observations) -> IntArray:
    """Return the counts whose loads determine the rows' densities."""
    counts = data.Q[~data.is_count | (data.Q >= 4)]
    return np.unique(np.concatenate([counts, data.Q[data.is_count] + 2]))


def _coordinates(Q: IntArray, ratio: FloatArray) -> FloatArray:
    """Return log h and a/pitch, shape (n, 2)."""
    return np.stack([np.log(Q / 2 - 1), ratio], axis=-1)


def _squares(column: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return squared distances of a coordinate's distinct values, and the index of each pair.

    The kernel is a product over coordinates, so that each factor is needed at few distances only.
    """
    _, first, code = np.unique(column.round(9), return_index=True, return_inverse=True)
    values = column[first]
    squares = ((values[:, None] - values) ** 2).ravel()
    return squares, (code[:, None] * len(values) + code).ravel()
