"""What rows tell of shared offsets, draw by draw, at the textures that predictions ask for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import Texture
from ridgebayes.model.cholesky import Factor, InverseFactor
from ridgebayes.model.conditional_offsets import FullRoot, square_sum
from ridgebayes.model.shared_offsets import AnyRoot, Offsets, SmoothOffsets

_AT_ONCE = 2**20  # numbers of loadings


@dataclass(frozen=True, eq=False)
class OffsetsGiven:
    """What rows tell of shared offsets, for each of many draws of the parameters.

    Parameters
    ----------
    offsets : Offsets
        Structure.
    eta : ndarray of float, shape (n_draw, n_noise)
        The error model's parameters.
    root : DiagonalRoot, FullRoot, DenseFactor or InverseFactor
        L of the same draws.
    mean : ndarray of float, shape (n_draw, n_level)
        Scores: their mean, or the scores themselves where they were sampled.
    factor : DenseFactor, BorderedFactor, InverseFactor or None
        Of their precision; None where they were sampled.
    """

    offsets: Offsets
    eta: FloatArray
    root: AnyRoot
    mean: FloatArray
    factor: Factor | InverseFactor | None

    def inverted(self) -> "OffsetsGiven":
        """Return the same in half the memory, quicker to ask for many textures."""
        root = self.root.inverted() if isinstance(self.root, FullRoot) else self.root
        factor = self.factor
        if factor is not None and not isinstance(factor, InverseFactor):
            factor = factor.inverted()
        return replace(self, root=root, factor=factor)

    def at(self, texture: Texture, Q: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance of a texture's offsets, both of shape (n_draw, n_Q)."""
        loading, variance = self.offsets.loading(self.eta, texture, Q, self.root)
        levels, mean, factor = self.offsets.levels_of(texture), self.mean, self.factor
        if len(levels) < self.offsets.n_level:
            mean, factor = mean[:, levels], None if factor is None else factor.of(levels)
        return _mean_and_variance(mean, factor, loading, variance)

    def at_all(self, textures: Sequence[Texture], Q: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance at many textures, both of shape (n_texture, n_draw, n_Q)."""
        if not isinstance(self.offsets, SmoothOffsets):
            each = [self.at(texture, Q) for texture in textures]
        else:  # which are places alike: systems of many right sides are quicker solved
            n = max(_AT_ONCE // (len(self.eta) * self.offsets.n_level * len(Q)), 1)
            each = []
            for i in range(0, len(textures), n):
                a, b = np.array(textures[i : i + n]).T
                ratio, steps = np.repeat(a / (a + b), len(Q)), np.tile(Q, len(a))
                loading, variance = self.offsets.loading_at(self.eta, ratio, steps, self.root)
                both = _mean_and_variance(self.mean, self.factor, loading, variance)
                split = (np.split(values, len(a), axis=1) for values in both)
                each += list(zip(*split, strict=True))
        mean, variance = (np.stack(values) for values in zip(*each, strict=True))
        return mean, variance


def _mean_and_variance(
    mean: FloatArray, factor: Factor | InverseFactor | None, loading: FloatArray, rest: FloatArray
) -> tuple[FloatArray, FloatArray]:
    variance = rest if factor is None else rest + square_sum(factor.solve(loading))
    return np.einsum("dl,dlq->dq", mean, loading), variance


@dataclass(frozen=True, eq=False)
class OffsetsInParts:
    """What rows tell of offsets for draws of which some are worked out at a time.

    Parameters
    ----------
    parts : tuple of OffsetsGiven
        Of some draws, then of the next.
    """

    parts: tuple[OffsetsGiven, ...]

    def at(self, texture: Texture, Q: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance of a texture's offsets, both of shape (n_draw, n_Q)."""
        mean, variance = zip(*(one.at(texture, Q) for one in self.parts), strict=True)
        return np.concatenate(mean), np.concatenate(variance)


class TabulatedOffsets:
    """The same at some textures, of which all draws are kept instead of what these follow from.

    Parameters
    ----------
    parts : iterable of callable
        Each makes the `OffsetsGiven` of some draws; they follow each other, made one by one.
    textures : sequence of (float, float)
        The textures that will be asked for.
    """

    def __init__(
        self, parts: Sequence[Callable[[], OffsetsGiven]], textures: Sequence[Texture]
    ) -> None:
        self._parts, self._places = parts, {texture: i for i, texture in enumerate(textures)}
        self._known: dict[bytes, tuple[FloatArray, FloatArray]] = {}

    def at(self, texture: Texture, Q: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance of a texture's offsets, both of shape (n_draw, n_Q)."""
        if Q.tobytes() not in self._known:
            self._known[Q.tobytes()] = self._tabulated(Q)
        mean, variance = self._known[Q.tobytes()]
        return mean[self._places[texture]], variance[self._places[texture]]

    def _tabulated(self, Q: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return both at all textures, (n_texture, n_draw, n_Q)."""
        found = []
        for part in self._parts:
            found.append(part().at_all(list(self._places), Q))
        mean, variance = (np.concatenate(x, axis=1) for x in zip(*found, strict=True))
        return mean, variance
