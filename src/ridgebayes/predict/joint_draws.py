"""Draws of Q from a posterior predictive, each on its own texture, over all loads at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.axes import Axis, Spread
from ridgebayes.contact.scaling import Texture, reduced_load
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms import PowerLaw
from ridgebayes.predict.extrapolation import CalibratedRange, Flags
from ridgebayes.predict.predictive_cdf import PosteriorLoads, n_draws

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
    go with the square of the pitch, and between ratios of ridge to pitch the form's log load is
    interpolated by a polynomial through 9 of them. Offsets are those of the nearest of these.
    """

    def __init__(self, fit: Posterior, seen: Spread, kind: str = "simulation") -> None:
        self._kind = kind
        self._fit, self._stride = fit, -(-len(fit.draws) // n_draws(fit))
        self._range, self._seen = CalibratedRange.of(fit), seen
        self._axis: Axis | None = None
        if seen.distinct is not None:
            self._textures = [(a, b) for a, b, _ in seen.distinct.tolist()]
            self._loads = PosteriorLoads.of(fit, n_draws(fit), kind)
        else:
            self._axis = Axis.over(seen.low[2], seen.high[2], _N_RATIO)
            self._textures = [(x, 1 - x) for x in self._axis.nodes.tolist()]
            self._loads = PosteriorLoads.of_new_ones(fit, self._textures[0][0])
        self._known: dict[int, list[tuple[FloatArray, FloatArray, FloatArray]]] = {}

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
        which = rng.integers(len(self._loads.theta), size=len(p))
        u = rng.random(len(p))
        score = special.ndtri(u)
        if self._loads.df is not None:
            score = special.stdtrit(self._loads.df[which], u)
        a, b, ratio = textures.T
        near = self._near(textures)
        with np.errstate(divide="ignore"):
            y = np.log(reduced_load(p, nu[:, None]))
        if self._axis is not None:
            y = y - 2 * np.log(a + b)[:, None]
        last = self._last(textures)
        Q, alive, block = np.full(p.shape, 2), np.ones(p.shape, dtype=bool), 0
        while alive.any():
            if 2 * _Q_BLOCK * block > _LARGEST_Q:
                raise InputError(f"loads: expected counts up to {_LARGEST_Q}, got more")
            for location, scale in self._log_loads(ratio, near, which, block):
                # One score a draw: a load cannot reach a further ridge before a nearer one.
                alive &= (y >= (location + scale * score)[:, None]) & (last[:, None] > Q)
                Q += 2 * alive
            block += 1
        flags = self._range.load_flags(p, nu[:, None]) | self._range.count_flags(Q)
        flags |= self._range.texture_flags(a, b)[:, None]
        return PredictiveDraws(Q, which * self._stride, flags)

    @property
    def n_draw(self) -> int:
        """How many draws of the posterior there are."""
        return len(self._loads.theta)

    def df(self, which: IntArray) -> FloatArray | None:
        """Return degrees of freedom of the errors of some draws; None where these are normal."""
        return None if self._loads.df is None else self._loads.df[which]

    def log_loads(
        self, textures: FloatArray, nu: FloatArray, which: IntArray, ids: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return location and scale of log p/E at which bodies reach counts 4 + 2 ids.

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
        found = np.empty((2, len(nu), len(ids)))
        near, last = self._near(textures), self._last(textures)
        for block in np.unique(ids // _Q_BLOCK).tolist():
            columns = self._log_loads(textures[:, 2], near, which, block)
            for j in np.flatnonzero(ids // _Q_BLOCK == block):
                found[:, :, j] = columns[ids[j] % _Q_BLOCK]
        shift = -np.log(reduced_load(1.0, nu))
        if self._axis is not None:
            shift = shift + 2 * np.log(textures[:, 0] + textures[:, 1])
        location = np.where(4 + 2 * ids <= last[:, None], found[0] + shift[:, None], np.inf)
        return location, found[1]

    def _near(self, textures: FloatArray) -> IntArray:
        """Return which texture each is, or the nearest of those between which it lies."""
        if self._axis is None:
            return self._seen.place(textures)
        return np.asarray(np.abs(textures[:, 2, None] - self._axis.nodes).argmin(axis=1))

    def _last(self, textures: FloatArray) -> FloatArray:
        """Return the last count: under Student errors that of contact over the whole width.

        Tails leave some probability to any count.
        """
        if self._loads.df is None:
            return np.full(len(textures), np.inf)
        a, b, _ = textures.T
        return np.asarray(2 + 2 * np.floor(np.maximum(1 - b / 2, 0) / (a + b)))

    def _log_loads(
        self, ratio: FloatArray, near: IntArray, which: IntArray, block: int
    ) -> Sequence[tuple[FloatArray, FloatArray]]:
        """Return location and scale of each body's log load of the counts of a block, at nu 0.5."""
        if block not in self._known:
            counts = 4 + 2 * (np.arange(_Q_BLOCK) + _Q_BLOCK * block)
            self._known[block] = [self._at(texture, counts) for texture in self._textures]
        own, location, scale = (np.stack(each) for each in zip(*self._known[block], strict=True))
        if self._axis is None:
            return list(zip(location[near, which].T, scale[near, which].T, strict=True))
        found = location[near, which]
        if not isinstance(self._fit.form, PowerLaw):
            with np.errstate(invalid="ignore"):
                apart = np.einsum("mj,jmq->mq", self._axis.weights(ratio), own[:, which])
                found = np.nan_to_num(found - own[near, which] + apart, nan=np.inf)
        return list(zip(found.T, scale[near, which].T, strict=True))

    def _at(self, texture: Texture, Q: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        own = np.log(self._loads.load(texture, Q, 0.5))
        location, scale = self._loads.log_load(texture, Q, 0.5, self._kind)
        return own, location, np.array(scale)
