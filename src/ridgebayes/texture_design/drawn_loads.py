"""Log loads of each draw of a posterior, at any texture with a pitch of 1."""

import math
from collections.abc import Sequence

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import Texture
from ridgebayes.inference.posterior import Posterior
from ridgebayes.predict.joint_draws import RatioLoads
from ridgebayes.predict.posterior_loads import PosteriorLoads
from ridgebayes.predict.q_distribution import shares


class DrawnLoads:
    """Location and scale of the log load of a count at nu = 0.5, for each draw of a posterior.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    low, high : float
        Range of a/pitch.

    Raises
    ------
    InputError
        If the form's loads are not proportional to the square of the pitch.

    Notes
    -----
    Textures are new, with new offsets. In `at_calibrated`, textures keep their inferred offsets.
    """

    def __init__(self, fit: Posterior, low: float, high: float) -> None:
        self.fit, self._loads = fit, PosteriorLoads(fit)
        self._new = RatioLoads(self._loads, low, high)
        self.has_mean = self._loads.has_mean

    @property
    def n_draw(self) -> int:
        """Number of draws."""
        return len(self._loads)

    def at(
        self, count: int, which: IntArray | slice, ratio: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return location and scale of draws at a pitch of 1, each with its a/pitch, (n,)."""
        location, scale = self._new.at(ratio, which, [count])
        # Draws without error would divide by 0.
        return location[:, 0], np.maximum(scale[:, 0], np.finfo(np.float64).tiny)

    def mean_log_load(self, texture: Texture, count: int) -> float:
        """Return the mean of a count's log load at a texture; infinite if a draw has none."""
        if count <= 2:
            return -math.inf
        a, b = texture
        location, _ = self.at(count, slice(None), np.array(a / (a + b)))
        return float(location.mean()) + 2 * math.log(a + b)

    def at_calibrated(self, texture: Texture, count: int) -> tuple[FloatArray, FloatArray]:
        """Return location and scale at a calibrated texture, shape (n_draw,)."""
        location, scale = self._loads.at(texture, np.array([count]))
        return location[:, 0], np.array(scale[:, 0])


def drawn_loads(
    averaged: Sequence[tuple[Posterior, float]], ratios: tuple[float, float]
) -> list[tuple[DrawnLoads, float]]:
    """Return the loads of posteriors for a range of a/pitch, with weights that sum to 1."""
    weights = shares([weight for _, weight in averaged]).tolist()
    loads = [DrawnLoads(fit, *ratios) for fit, _ in averaged]
    return list(zip(loads, weights, strict=True))
