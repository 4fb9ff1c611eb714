"""Log loads of each draw of a posterior, at any texture: the scale law, and series in a/pitch.

Loads of a body scale with the square of the pitch. The other factor is smooth in a/pitch: it
is computed at some nodes and kept as a Chebyshev series for each draw.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.polynomial import chebyshev

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import Texture
from ridgebayes.inference.posterior import Posterior
from ridgebayes.predict.posterior_loads import PosteriorLoads
from ridgebayes.predict.q_distribution import shares

_N_NODE = 11
_LEAST_SCALE = 1e-12
Series = FloatArray  # shape (n_term, n_draw)


class DrawnLoads:
    """Location and scale of the log load of a count, of each draw of one posterior, at nu = 0.5.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    low, high : float
        Range of a/pitch.

    Raises
    ------
    InputError
        If the form's loads do not go with the square of the pitch.

    Notes
    -----
    Textures are new ones, with offsets of their own. `at_calibrated` gives those that keep theirs.
    """

    def __init__(self, fit: Posterior, low: float, high: float) -> None:
        self._middle, self._half = 0.5 * (low + high), max(0.5 * (high - low), 1e-9)
        self._nodes = self._middle + self._half * chebyshev.chebpts1(_N_NODE)
        self.fit, self._loads = fit, PosteriorLoads(fit)
        self._loads.check_scaling(float(self._nodes[0]))
        self.has_mean = self._loads.has_mean
        self._to_series = np.linalg.inv(
            chebyshev.chebvander(chebyshev.chebpts1(_N_NODE), _N_NODE - 1)
        )
        self._series: dict[int, tuple[Series, Series]] = {}

    @property
    def n_draw(self) -> int:
        """Draws."""
        return len(self._loads)

    def series(self, count: int) -> tuple[Series, Series]:
        """Return the series in a/pitch of location and scale at a pitch of 1."""
        if count not in self._series:
            at_nodes = [self._loads.at_ratio(x, np.array([count])) for x in self._nodes.tolist()]
            nodes = zip(*at_nodes, strict=True)
            with np.errstate(invalid="ignore"):
                location, scale = (self._to_series @ np.stack(x)[:, :, 0] for x in nodes)
            self._series[count] = location, scale
        return self._series[count]

    def at(
        self, count: int, which: IntArray | slice, ratio: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return location and scale of draws at a pitch of 1, each at its own a/pitch, (n,)."""
        x = (ratio - self._middle) / self._half
        with np.errstate(invalid="ignore"):
            location, scale = (
                chebyshev.chebval(x, terms[:, which], tensor=False) for terms in self.series(count)
            )
        return np.nan_to_num(location, nan=np.inf), np.maximum(scale, _LEAST_SCALE)

    def mean_log_load(self, texture: Texture, count: int) -> float:
        """Return the mean of a count's log load at a texture; infinite if a draw has none."""
        if count <= 2:
            return -math.inf
        a, b = texture
        x = (a / (a + b) - self._middle) / self._half
        mean = float(chebyshev.chebval(x, self.series(count)[0].mean(axis=1)))
        return math.inf if math.isnan(mean) else mean + 2 * math.log(a + b)

    def at_calibrated(self, texture: Texture, count: int) -> tuple[FloatArray, FloatArray]:
        """Return location and scale at a texture that was calibrated on, shape (n_draw,)."""
        location, scale = self._loads.at(texture, np.array([count]))
        return location[:, 0], np.array(scale[:, 0])


def drawn_loads(
    averaged: Sequence[tuple[Posterior, float]], ratios: tuple[float, float]
) -> list[tuple[DrawnLoads, float]]:
    """Return the loads of posteriors over a range of a/pitch, with weights that sum to 1."""
    weights = shares([weight for _, weight in averaged]).tolist()
    return [
        (DrawnLoads(fit, *ratios), weight)
        for (fit, _), weight in zip(averaged, weights, strict=True)
    ]
