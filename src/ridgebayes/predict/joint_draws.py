"""Loads and counts of many bodies, each with a texture and a draw of a posterior of its own."""

from dataclasses import dataclass

import numpy as np
from scipy import special

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.axes import Axis, Spread
from ridgebayes.contact.scaling import reduced_load
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.predict.extrapolation import CalibratedRange, Flags
from ridgebayes.predict.load_draws import Columns
from ridgebayes.predict.posterior_loads import PosteriorLoads, widest_count

MOST_TEXTURES, _N_RATIO = 16, 9
_LARGEST_Q = 2_000
_Q_BLOCK = 16


@dataclass(frozen=True, eq=False)
class PredictiveDraws:
    """Counts drawn for m bodies at L loads each.

    Parameters
    ----------
    Q : ndarray of int, shape (m, L)
        Even counts; of one body they never fall as the load rises.
    draw_index : ndarray of int, shape (m,)
        Row of the posterior's `draws` that each sample used.
    flags : ndarray of uint8, shape (m, L)
        Quantities beyond the calibrated range.
    """

    Q: IntArray
    draw_index: IntArray
    flags: Flags


def textures_of(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return widths over R, and the share of ridges, of n textures, shape (n, 3)."""
    return np.stack([a, b, a / (a + b)], axis=1)


class PredictiveSampler:
    """Draws Q from one posterior for bodies whose textures may all differ.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    seen : Spread
        Of `textures_of` all bodies, that keeps `MOST_TEXTURES`.
    kind : str, optional
        ``simulation``, or ``curve`` for the form's own loads.

    Raises
    ------
    InputError
        If textures vary and the form does not depend on lengths over the pitch alone.

    Notes
    -----
    Up to 16 distinct textures are each treated as `predict` does. More of them are new ones: loads
    go with the square of the pitch, and between ratios of ridge to pitch log loads and their
    standard deviations are interpolated by a spline through 9 of them.
    """

    def __init__(self, fit: Posterior, seen: Spread, kind: str = "simulation") -> None:
        self.loads = PosteriorLoads(fit, kind)
        self._range, self._seen = CalibratedRange.of(fit), seen
        self._axis: Axis | None = None
        if seen.distinct is None:
            self._axis = Axis.over(seen.low[2], seen.high[2], _N_RATIO)
            self.loads.check_scaling(float(self._axis.low))
        self._blocks: dict[int, Columns] = {}

    def draw(
        self, textures: FloatArray, p: FloatArray, nu: FloatArray, rng: np.random.Generator
    ) -> PredictiveDraws:
        """Draw counts.

        Parameters
        ----------
        textures : ndarray of float, shape (m, 3)
            What `textures_of` returns of them.
        p : ndarray of float, shape (m, L)
            Loads p/E.
        nu : ndarray of float, shape (m,)
            Poisson's ratios.
        rng : numpy.random.Generator
            Source of randomness.
        """
        which = rng.integers(len(self.loads), size=len(p))
        score = special.ndtri(rng.random(len(p)))
        with np.errstate(divide="ignore"):
            y = np.log(p)
        Q, alive = np.full(p.shape, 2), np.ones(p.shape, dtype=bool)
        for first in range(0, _LARGEST_Q // 2, _Q_BLOCK):
            ids = np.arange(first, first + _Q_BLOCK)
            location, sd = self.log_loads(textures, nu, which, ids)
            for load in (location + sd * score[:, None]).T:
                # One score a draw: a load cannot reach a further ridge before a nearer one.
                alive &= y >= load[:, None]
                Q += 2 * alive
            if not alive.any():
                flags = self._range.load_flags(p, nu[:, None]) | self._range.count_flags(Q)
                flags |= self._range.texture_flags(*textures[:, :2].T)[:, None]
                return PredictiveDraws(Q, which * self.loads.stride, flags)
        raise InputError(f"loads: expected counts up to {_LARGEST_Q}, got more")

    def log_loads(
        self, textures: FloatArray, nu: FloatArray, which: IntArray, ids: IntArray
    ) -> Columns:
        """Return location and standard deviation of log p/E at which bodies reach counts 4 + 2 ids.

        Parameters
        ----------
        textures : ndarray of float, shape (m, 3)
            What `textures_of` returns of them.
        nu : ndarray of float, shape (m,)
            Poisson's ratios.
        which : ndarray of int, shape (m,)
            Draw of the posterior of each.
        ids : ndarray of int, shape (n,)
            Numbers of counts.

        Returns
        -------
        tuple of ndarray of float, shape (m, n)
            The location is infinite beyond the last count that a body can have.
        """
        location, sd = np.empty((2, len(nu), len(ids)))
        for block in np.unique(ids // _Q_BLOCK).tolist():
            here = ids // _Q_BLOCK == block
            if block not in self._blocks:
                counts = 4 + 2 * (np.arange(_Q_BLOCK) + _Q_BLOCK * block)
                self._blocks[block] = self._at_nodes(counts)
            columns = [values[:, :, ids[here] % _Q_BLOCK] for values in self._blocks[block]]
            location[:, here], sd[:, here] = (self._of_bodies(x, textures, which) for x in columns)
        a, b, _ = textures.T
        location -= np.log(reduced_load(1.0, nu))[:, None]
        if self._axis is not None:
            location += 2 * np.log(a + b)[:, None]
        if not self.loads.has_mean:
            location[4 + 2 * ids > widest_count(a, b)[:, None]] = np.inf
        return location, sd

    def _at_nodes(self, counts: IntArray) -> Columns:
        """Return location and sd at each texture, or ratio of the axis, (n_node, n_draw, n_Q)."""
        if self._seen.distinct is not None:
            nodes = [self.loads.at((a, b), counts) for a, b, _ in self._seen.distinct.tolist()]
        else:
            assert self._axis is not None
            nodes = [self.loads.at_ratio(ratio, counts) for ratio in self._axis.nodes.tolist()]
        location, sd = (np.stack(values) for values in zip(*nodes, strict=True))
        return location, sd

    def _of_bodies(self, values: FloatArray, textures: FloatArray, which: IntArray) -> FloatArray:
        """Return the values of bodies, (m, n_Q), from those at nodes."""
        if self._axis is None:
            value: FloatArray = values[self._seen.place(textures), which]
            return value
        with np.errstate(invalid="ignore"):
            value = np.einsum("mj,jmq->mq", self._axis.weights(textures[:, 2]), values[:, which])
        return np.asarray(np.nan_to_num(value, nan=np.inf))
