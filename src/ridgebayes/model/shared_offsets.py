r"""Offsets that rows share: which rows share which, and how they vary together.

Offsets have levels (a texture, a step, a series, a place in the plane of log h and a/pitch). A
priori they are normal with covariance ``L L'``, so that ``L`` times standard normal scores are
offsets. The score vector is what is integrated out, or sampled, elsewhere; this module knows no
data but where the rows are.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import Texture
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.model.cholesky import DenseFactor, InverseFactor, cholesky_or_nan
from ridgebayes.model.conditional_offsets import DiagonalRoot, FullRoot, Root
from ridgebayes.model.noise import SERIES, Noise
from ridgebayes.model.observations import Observations

LARGEST_SMOOTH = 600  # places; the cost of a likelihood call grows with their cube
LARGEST_CROSSED = 600  # offsets of steps and series beside others; the same
AnyRoot = Root | DenseFactor | InverseFactor


class Offsets(ABC):
    """Offsets of one structure at the places of some rows.

    `eta` holds the error model's parameters, in its own order, on the last axis.
    """

    n_level: int
    n_held: int  # numbers that a draw's scores given rows take, at most
    codes: IntArray  # level of each row in each factor, shape (n_factor, n_row)
    codes_next: IntArray  # the same at each row's Q + 2, for counts

    @abstractmethod
    def root(self, eta: FloatArray) -> Root:
        """Return L for each draw of `eta`."""

    @abstractmethod
    def levels_of(self, texture: Texture) -> IntArray:
        """Return the levels whose scores tell of a texture's offsets; given these no others do."""

    @abstractmethod
    def loading(
        self, eta: FloatArray, texture: Texture, Q: IntArray, root: AnyRoot
    ) -> tuple[FloatArray, FloatArray]:
        """Return how offsets of one texture follow from the scores, given L of the same draws.

        Returns
        -------
        loading : ndarray of float, shape (..., n, n_Q)
            The offset's mean is the scores of the levels `levels_of` times this.
        rest : ndarray of float, shape (..., n_Q)
            Variance of the offset that the scores say nothing of.
        """


class GroupedOffsets(Offsets):
    """One offset per texture, per step, per series, or several of these: all independent.

    Parameters
    ----------
    noise : Noise
        Structure without ``step-smooth``.
    data : Observations
        Rows.
    """

    def __init__(self, noise: Noise, data: Observations) -> None:
        self._factors = noise.factors
        names = noise.parameter_names
        self._taus = [names.index(f"tau_{factor}") for factor in self._factors]
        self._texture = {texture: j for j, texture in enumerate(data.textures)}
        self._steps = _steps(data)
        sizes = {"texture": len(data.textures), "step": len(self._steps), SERIES: data.n_series}
        self._sizes = [sizes[factor] for factor in self._factors]
        self._first = np.concatenate([[0], np.cumsum(self._sizes)[:-1]])
        self.n_level = sum(self._sizes)
        n_first, n_rest = self._sizes[0], sum(self._sizes[1:])
        self.n_held = n_first * (1 + n_rest) + n_rest**2
        if n_rest > LARGEST_CROSSED:
            beside = " and ".join({SERIES: "series", "step": "steps"}[f] for f in self._factors[1:])
            raise ComputationError(
                f"{noise.name}: {n_rest} offsets of {beside}; expected at most {LARGEST_CROSSED}, "
                "since the cost of a likelihood call grows with their cube"
            )
        later = np.where(data.is_count, data.Q + 2, data.Q)
        self.codes_next = self._codes(data.texture, later, data.series)
        # A count of 2 says nothing of load(2): its own step is a dummy, never looked at.
        self.codes = self._codes(data.texture, np.where(data.Q == 2, later, data.Q), data.series)

    def root(self, eta: FloatArray) -> Root:
        pairs = zip(self._taus, self._sizes, strict=True)
        scale = [np.repeat(eta[..., [tau]], n, axis=-1) for tau, n in pairs]
        return DiagonalRoot(np.concatenate(scale, axis=-1))

    def loading(
        self, eta: FloatArray, texture: Texture, Q: IntArray, root: AnyRoot
    ) -> tuple[FloatArray, FloatArray]:
        levels = self.levels_of(texture)
        loading = np.zeros((*eta.shape[:-1], len(levels), len(Q)))
        rest = np.zeros((*eta.shape[:-1], len(Q)))
        index = np.full(len(Q), self._texture.get(texture, -1))
        codes = self._codes(index, Q, np.full(len(Q), -1))  # what is predicted is a new series
        for tau, own in zip(self._taus, codes, strict=True):
            for i, level in enumerate(own.tolist()):
                if level >= 0:
                    loading[..., np.searchsorted(levels, level), i] = eta[..., tau]
                else:
                    rest[..., i] += eta[..., tau] ** 2
        return loading, rest

    def levels_of(self, texture: Texture) -> IntArray:
        levels, n_first = np.arange(self.n_level), self._sizes[0]
        if self._factors[0] != "texture":
            return levels
        own = self._texture.get(texture, -1)
        value: IntArray = levels[(levels >= n_first) | (levels == own)]
        return value

    def _codes(self, texture: IntArray, Q: IntArray, series: IntArray) -> IntArray:
        step = np.searchsorted(self._steps, Q)
        known = step < len(self._steps)
        known[known] = self._steps[step[known]] == Q[known]
        levels = {"texture": texture, "step": np.where(known, step, -1), SERIES: series}
        found = [
            np.where(levels[factor] >= 0, levels[factor] + first, -1)
            for factor, first in zip(self._factors, self._first.tolist(), strict=True)
        ]
        return np.stack(found)


class SmoothOffsets(Offsets):
    r"""A Gaussian process in x = (log h, a/pitch), squared exponential in both.

    .. math:: \tau^2 \exp(-\tfrac12 (\Delta \log h/\ell_h)^2 - \tfrac12 (\Delta r/\ell_r)^2)

    Textures of one a/pitch share it, as the half-plane's scale law has it. Beyond the calibrated
    range of either coordinate nothing has tested the smoothness: there a second, independent
    process with the variance ``tau^2 (1 - exp(-d^2/2))`` widens the offset, d being the distance
    from the range in lengths. It vanishes inside, so no likelihood knows of it.

    With series each of these has an independent offset beside it; their levels follow the places.

    Parameters
    ----------
    noise : Noise
        Structure ``step-smooth`` or ``step-smooth+series``.
    data : Observations
        Rows.
    """

    def __init__(self, noise: Noise, data: Observations) -> None:
        names = noise.parameter_names
        self._tau = names.index("tau_step")
        self._lengths = [names.index("length_h"), names.index("length_ratio")]
        self._tau_series = names.index("tau_series") if SERIES in noise.factors else None
        self._nugget = noise.nugget
        ratio = data.a_over_R / (data.a_over_R + data.b_over_R)
        here = _coordinates(data.Q, ratio[data.texture])
        later = _coordinates(np.where(data.is_count, data.Q + 2, data.Q), ratio[data.texture])
        # A count of 2 says nothing of load(2): its own place is a dummy, never looked at.
        here = np.where(np.isfinite(here), here, later)
        both = np.concatenate([here, later])
        _, first, codes = np.unique(both.round(9), axis=0, return_index=True, return_inverse=True)
        self._places = both[first]
        n_place, codes = len(self._places), codes.reshape(2, len(data))
        self.codes, self.codes_next = codes[:1], codes[1:]
        self.n_level = n_place
        if self._tau_series is not None:
            self.n_level += data.n_series
            self.codes, self.codes_next = (np.stack([one, n_place + data.series]) for one in codes)
        self.n_held = 2 * self.n_level**2
        if self._tau_series is not None:  # rows of two levels each: their loadings, and a copy
            self.n_held += 2 * self.n_level * len(data)
        if n_place > LARGEST_SMOOTH:
            raise ComputationError(
                f"step-smooth: {n_place} places of Q and a/pitch; expected at most "
                f"{LARGEST_SMOOTH}, since the cost of a likelihood call grows with their cube"
            )
        # The kernel is a product: each factor is worked out on its own few values.
        self._axes = []
        for column in self._places.T:
            _, first, code = np.unique(column.round(9), return_index=True, return_inverse=True)
            values = column[first]
            squares = ((values[:, None] - values) ** 2).ravel()
            self._axes.append((squares, (code[:, None] * len(values) + code).ravel()))

    def root(self, eta: FloatArray) -> Root:
        factor = cholesky_or_nan(self._covariance(eta))
        if self._tau_series is None:
            return FullRoot(factor)
        n = self.n_level
        whole = np.zeros((*eta.shape[:-1], n, n))
        whole[..., : len(self._places), : len(self._places)] = factor
        series = np.arange(len(self._places), n)
        whole[..., series, series] = eta[..., self._tau_series, None]
        return FullRoot(whole)

    def loading(
        self, eta: FloatArray, texture: Texture, Q: IntArray, root: AnyRoot
    ) -> tuple[FloatArray, FloatArray]:
        return self.loading_at(
            eta, np.full(len(Q), texture[0] / (texture[0] + texture[1])), Q, root
        )

    def loading_at(
        self, eta: FloatArray, ratio: FloatArray, Q: IntArray, root: AnyRoot
    ) -> tuple[FloatArray, FloatArray]:
        """Return what `loading` does at places of any textures, a/pitch and count of each."""
        at = _coordinates(Q, ratio)
        variance, lengths = eta[..., self._tau] ** 2, eta[..., self._lengths]
        squares = (self._places[:, None] - at) ** 2
        low, high = self._places.min(axis=0), self._places.max(axis=0)
        beyond = np.maximum(np.maximum(low - at, at - high) - 1e-9, 0)
        with np.errstate(over="ignore", under="ignore"):
            correlation = np.exp(-0.5 * np.einsum("lqx,...x->...lq", squares, lengths**-2.0))
            widening = -np.expm1(-0.5 * np.einsum("qx,...x->...q", beyond**2, lengths**-2.0))
        assert not isinstance(root, DiagonalRoot)  # it varies together
        shared = np.zeros((*eta.shape[:-1], self.n_level, len(Q)))
        shared[..., : len(self._places), :] = variance[..., None, None] * correlation
        loading = root.solve(shared)
        rest = np.maximum(variance[..., None] - (loading**2).sum(axis=-2), 0)
        rest = rest + variance[..., None] * widening
        if self._tau_series is not None:  # what is predicted is a new series
            rest = rest + eta[..., self._tau_series, None] ** 2
        return loading, rest

    def levels_of(self, texture: Texture) -> IntArray:
        return np.arange(self.n_level)

    def covariance(self, eta: FloatArray, codes: IntArray) -> FloatArray:
        """Return the covariance a priori of rows' offsets, shape (..., n, n).

        Parameters
        ----------
        eta : ndarray of float, shape (..., n_noise)
            The error model's parameters.
        codes : ndarray of int, shape (n_factor, n)
            Levels of the rows, some of `codes`.
        """
        place, n = codes[0], codes.shape[1]
        covariance = self._covariance(eta)
        if n != len(self._places) or np.any(place != np.arange(n)):
            covariance = covariance[..., place[:, None], place]
        if self._tau_series is not None:
            same = codes[1][:, None] == codes[1]
            covariance = covariance + eta[..., self._tau_series, None, None] ** 2 * same
        return covariance

    def _covariance(self, eta: FloatArray) -> FloatArray:
        """Return the smooth offset's covariance at its places, shape (..., n_place, n_place)."""
        lead, n = eta.shape[:-1], len(self._places)
        covariance = np.empty((*lead, n * n))
        covariance[...] = eta[..., self._tau, None] ** 2
        for (squares, pairs), length in zip(self._axes, self._lengths, strict=True):
            with np.errstate(over="ignore", under="ignore", divide="ignore"):
                factor = np.exp(-0.5 * squares / eta[..., length, None] ** 2)
            covariance *= np.take(factor, pairs, axis=-1)
        covariance[..., :: n + 1] *= 1 + self._nugget
        return covariance.reshape(*lead, n, n)


def offsets_of(noise: Noise, data: Observations) -> Offsets | None:
    """Return the offsets of an error model at some rows, or None where rows share nothing.

    Raises
    ------
    InputError
        If the error model has series and the rows are all of one.
    ComputationError
        If a smooth offset has too many places.
    """
    if not noise.factors:
        return None
    if SERIES in noise.factors and data.n_series < 2:
        raise InputError(
            f"noise {noise.name!r}: expected rows of at least two series or sources, got one"
        )
    kind = SmoothOffsets if "step-smooth" in noise.factors else GroupedOffsets
    return kind(noise, data)


def _steps(data: Observations) -> IntArray:
    """Return every count at which a row depends on a load."""
    own = data.Q[~data.is_count | (data.Q >= 4)]
    return np.unique(np.concatenate([own, data.Q[data.is_count] + 2]))


def _coordinates(Q: IntArray | Sequence[int], ratio: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore"):
        return np.stack([np.log(np.asarray(Q) / 2 - 1), ratio], axis=-1)
