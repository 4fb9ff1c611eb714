r"""Offsets that rows share: which rows share which, and how they vary a priori.

Offsets enter a row's log load linearly: ``eta = mean + Z x``, with ``x = L s`` and standard normal
scores s. Levels are of two blocks. The *first* has one level for each texture, and L is diagonal
there; the power law's log K stands in it beside the texture offset, since both shift all rows of a
texture alike. The *rest* holds steps, series, or the places of a smooth function.
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

MAX_OTHER_LEVELS = 600  # beside textures; a likelihood call costs their cube


@dataclass(frozen=True, eq=False)
class Root:
    """L of many draws: offsets are L times standard normal scores.

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
        """Return border and corner of L' G L, G as `DesignMatrix.gram` returns it."""
        border = border * self.first[..., None, :]
        turned = np.swapaxes(self.rest, -1, -2)
        if corner.ndim == border.ndim:
            return turned @ border, turned @ (corner @ self.rest)
        half = np.sqrt(corner)[..., None] * self.rest
        # NumPy computes a matrix times its own transpose with half the work.
        return turned @ border, np.swapaxes(half, -1, -2) @ half


class Offsets:
    """Offsets of an error model, and of the power law's log K, at the places of some rows.

    Parameters
    ----------
    noise : Noise
        Error model.
    data : Observations
        Rows.
    slope_sd : ndarray of float, shape (n_texture,), optional
        Standard deviation of each texture's log load by the prior of its K.

    Raises
    ------
    InputError
        If the error model has series and the rows are all of one.
    ComputationError
        If there are more than 600 levels beside the textures'.
    """

    def __init__(
        self, noise: Noise, data: Observations, slope_sd: FloatArray | None = None
    ) -> None:
        factors, names = noise.factors, noise.parameter_names
        self._made_of = noise, data
        if SERIES in factors and data.n_series < 2:
            raise InputError(
                f"noise {noise.name!r}: expected rows of at least two series or sources, got one"
            )
        self.slope_sd = slope_sd
        self.nugget = noise.nugget
        self._at = {name: i for i, name in enumerate(names)}
        self._has = {name: name in factors for name in ("texture", "step", SMOOTH, SERIES)}
        self._texture = {texture: j for j, texture in enumerate(data.textures)}
        self._steps = _steps(data)
        ratio = data.a_over_R / (data.a_over_R + data.b_over_R)
        # The lower end of a count is the load of Q + 2, with offsets of its own.
        counts = np.flatnonzero(data.is_count)
        texture = np.concatenate([data.texture, data.texture[counts]])
        series = np.concatenate([data.series, data.series[counts]])
        # A count of 2 says nothing of load(2): its own level is a dummy of infinite load.
        placed_counts = np.where(data.is_count & (data.Q == 2), data.Q + 2, data.Q)
        Q = np.concatenate([placed_counts, data.Q[counts] + 2])
        levels: list[IntArray] = []
        self.n_smooth = self.n_rest = 0
        if self._has["step"]:
            levels.append(np.searchsorted(self._steps, Q))
            self.n_rest = len(self._steps)
        if self._has[SMOOTH]:
            places = _coordinates(Q, ratio[texture])
            _, first, codes = np.unique(
                places.round(9), axis=0, return_index=True, return_inverse=True
            )
            self._places = places[first]
            self.n_smooth = self.n_rest = len(first)
            levels.append(codes.reshape(-1))
            self._axes = [_squares(column) for column in self._places.T]
        if self._has[SERIES]:
            levels.append(self.n_rest + series)
            self.n_rest += data.n_series
        if self.n_rest > MAX_OTHER_LEVELS:
            raise ComputationError(
                f"{noise.name}: {self.n_rest} offsets of steps, places and series; expected at "
                f"most {MAX_OTHER_LEVELS}, since a likelihood call costs their cube"
            )
        has_first = self._has["texture"] or slope_sd is not None
        self.n_first = len(data.textures) if has_first else 0
        self.n_level = self.n_first + self.n_rest
        rest = np.array(levels, dtype=np.int64).reshape(len(levels), len(Q))
        self.design = DesignMatrix(texture if has_first else None, self.n_first, rest, self.n_rest)

    def own(self) -> "Offsets":
        """Return the error model's offsets alone, without the power law's log K."""
        return self if self.slope_sd is None else Offsets(*self._made_of)

    def tau(self, name: str, eta: FloatArray) -> FloatArray:
        """Return the scale of a factor's offsets, shape (...); 0 where it has none."""
        if not self._has[SMOOTH if name == "step" and self._has[SMOOTH] else name]:
            return np.zeros(eta.shape[:-1])
        value: FloatArray = eta[..., self._at[f"tau_{name}"]]
        return value

    def root(self, eta: FloatArray) -> Root:
        """Return L at error model parameters (..., n_noise)."""
        return Root(self.first_root(eta), self._rest_root(eta))

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
        n_step = len(self._steps) if self._has["step"] else 0
        steps, series = np.arange(n_step), np.arange(n_step + n, r)
        root[..., steps, steps] = self.tau("step", eta)[..., None]
        root[..., series, series] = self.tau(SERIES, eta)[..., None]
        return root

    def _covariance(self, eta: FloatArray) -> FloatArray:
        """Return the smooth offset's covariance at its places, shape (..., n_place, n_place)."""
        lead, n = eta.shape[:-1], self.n_smooth
        covariance = np.empty((*lead, n * n))
        covariance[...] = self.tau("step", eta)[..., None] ** 2
        for (squares, pairs), length in zip(self._axes, self._lengths(eta), strict=True):
            with np.errstate(over="ignore", under="ignore", divide="ignore"):
                factor = np.exp(-0.5 * squares / length[..., None] ** 2)
            covariance *= np.take(factor, pairs, axis=-1)
        covariance[..., :: n + 1] *= 1 + self.nugget
        return covariance.reshape(*lead, n, n)

    def covariance(self, design: DesignMatrix, eta: FloatArray) -> FloatArray:
        """Return the covariance of a design's predictors by smooth and other offsets, (..., n, n).

        Parameters
        ----------
        design : DesignMatrix
            Rows of `Offsets.design`.
        eta : ndarray of float, shape (..., n_noise)
            Error model parameters; the error model has a smooth offset.
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

    def _lengths(self, eta: FloatArray) -> tuple[FloatArray, FloatArray]:
        return eta[..., self._at["length_h"]], eta[..., self._at["length_ratio"]]

    def prior_variance(self, eta: FloatArray) -> FloatArray:
        """Return the variance a priori of each predictor's offset, shape (..., n)."""
        grouped = np.zeros((*eta.shape[:-1], self.design.n))
        if self.design.first is not None:
            grouped += self.first_root(eta)[..., self.design.first] ** 2
        others = self.tau("step", eta) ** 2 + self.tau(SERIES, eta) ** 2
        value: FloatArray = grouped + others[..., None]
        return value

    def prepared(self, eta: FloatArray, scores: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Return what smooth offsets at new places follow from; None without these.

        Parameters
        ----------
        eta : ndarray of float, shape (n_draw, n_noise)
            Error model parameters.
        scores : ndarray of float, shape (n_draw, n_level)
            Scores of all levels.

        Returns
        -------
        inverse : ndarray of float, shape (n_draw, n_place, n_place)
            L^-1 of the places.
        weights : ndarray of float, shape (n_draw, n_place)
            Their offsets times the inverse covariance.
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
            What `prepared` returns for the same draws.

        Returns
        -------
        mean, variance : ndarray of float, both of shape (n_draw, n_Q)
            A texture, a step or a place with rows keeps its offset; a new one, and the new series
            that is predicted, draws its own. Beyond the calibrated range of log h or a/pitch
            nothing has tested the smoothness: there a second, independent process with the variance
            ``tau^2 (1 - exp(-d^2/2))`` widens the offset, d being the distance from the range in
            lengths.
        """
        mean = np.zeros((len(eta), len(Q)))
        variance = np.zeros((len(eta), len(Q))) + self.tau(SERIES, eta)[:, None] ** 2
        first, rest = scores[:, : self.n_first], scores[:, self.n_first :]
        if self._has["texture"]:
            tau, j = self.tau("texture", eta)[:, None], self._texture.get(texture)
            if j is None:
                variance = variance + tau**2
            else:
                mean = mean + tau * first[:, [j]]
        if self._has["step"]:
            place = np.searchsorted(self._steps, Q)
            is_calibrated = np.append(self._steps, -1)[place] == Q
            tau = self.tau("step", eta)[:, None]
            mean = mean + np.where(
                is_calibrated, tau * rest[:, np.where(is_calibrated, place, 0)], 0.0
            )
            variance = variance + np.where(is_calibrated, 0.0, tau**2)
        if prepared is not None:
            more = self._smooth_at(texture, Q, eta, *prepared)
            mean, variance = mean + more[0], variance + more[1]
        return mean, variance

    def _smooth_at(
        self,
        texture: Texture,
        Q: IntArray,
        eta: FloatArray,
        inverse: FloatArray,
        weights: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        variance = self.tau("step", eta)[:, None] ** 2
        at = _coordinates(Q, np.full(len(Q), texture[0] / (texture[0] + texture[1])))
        squares = (self._places[:, None] - at) ** 2
        low, high = self._places.min(axis=0), self._places.max(axis=0)
        beyond = np.maximum(np.maximum(low - at, at - high) - 1e-9, 0)
        with np.errstate(over="ignore", under="ignore"):
            scale = np.stack(self._lengths(eta), axis=-1) ** -2.0
            correlation = np.exp(-0.5 * np.einsum("lqx,dx->dlq", squares, scale))
            widening = -np.expm1(-0.5 * np.einsum("qx,dx->dq", beyond**2, scale))
        shared = variance[..., None] * correlation
        rest = np.maximum(variance - ((inverse @ shared) ** 2).sum(axis=-2), 0)
        return np.einsum("dl,dlq->dq", weights, shared), rest + variance * widening


def _steps(data: Observations) -> IntArray:
    """Return every count at which a row depends on a load."""
    counts = data.Q[~data.is_count | (data.Q >= 4)]
    return np.unique(np.concatenate([counts, data.Q[data.is_count] + 2]))


def _coordinates(Q: IntArray, ratio: FloatArray) -> FloatArray:
    """Return log h and a/pitch, shape (n, 2)."""
    return np.stack([np.log(Q / 2 - 1), ratio], axis=-1)


def _squares(column: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return squared distances of distinct values, and where each pair of places finds its own.

    The kernel is a product: each factor is computed at its own few values.
    """
    _, first, code = np.unique(column.round(9), return_index=True, return_inverse=True)
    values = column[first]
    squares = ((values[:, None] - values) ** 2).ravel()
    return squares, (code[:, None] * len(values) + code).ravel()
