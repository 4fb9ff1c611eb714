"""Loads and counts of many bodies, each with a texture and a draw of a posterior of its own."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.axes import Axis, Spread
from ridgebayes.contact.scaling import reduced_load
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.predict.extrapolation import CalibratedRange, Flags
from ridgebayes.predict.load_draws import COUNTS_AT_ONCE, LARGEST_Q, Columns
from ridgebayes.predict.posterior_loads import PosteriorLoads, widest_count

MOST_TEXTURES = 16
_N_RATIO = 13  # from a/pitch 0.05 to 0.95: loads within 0.03 %


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


class _KeptLoads:
    """Log loads of all draws at some nodes, kept for each count."""

    def __init__(self, at_nodes: Sequence[Callable[[IntArray], Columns]]) -> None:
        self._at_nodes = at_nodes
        self._kept: dict[int, Columns] = {}

    def of(self, counts: Sequence[int]) -> list[Columns]:
        """Return location and standard deviation for each count, both (n_node, n_draw)."""
        missing = [count for count in counts if count not in self._kept]
        if missing:
            at_nodes = [at(np.array(missing)) for at in self._at_nodes]
            location, sd = (np.stack(values) for values in zip(*at_nodes, strict=True))
            for j, count in enumerate(missing):
                self._kept[count] = location[:, :, j], sd[:, :, j]
        return [self._kept[count] for count in counts]


class RatioLoads:
    """Log loads of a posterior's draws at new textures of pitch R, by a spline over logit(a/pitch).

    The spline is one of ``load^(-1/2)``, which is 0 where a draw's rate reaches no ridge.

    Parameters
    ----------
    loads : PosteriorLoads
        Loads of a posterior's draws.
    low, high : float
        Range of a/pitch.

    Raises
    ------
    InputError
        If the form's loads do not go with the square of the pitch.
    """

    def __init__(self, loads: PosteriorLoads, low: float, high: float) -> None:
        loads.check_scaling(low)
        self._loads = loads
        self._axis = Axis.over(special.logit(low), special.logit(high), _N_RATIO)
        nodes = special.expit(self._axis.nodes).tolist()
        self._nodes = _KeptLoads([partial(self._roots, node) for node in nodes])

    def _roots(self, ratio: float, counts: IntArray) -> Columns:
        location, sd = self._loads.at_ratio(ratio, counts)
        return np.exp(-0.5 * location), sd

    def at(self, ratio: ArrayLike, which: IntArray | slice, counts: Sequence[int]) -> Columns:
        """Return location and standard deviation of log loads at nu = 0.5.

        Parameters
        ----------
        ratio : array_like of float, shape (m,) or ()
            a/pitch of each draw, or of all.
        which : ndarray of int, shape (m,), or slice
            Draws of the posterior.
        counts : sequence of int, shape (n,)
            Counts.

        Returns
        -------
        tuple of ndarray of float, shape (m, n)
            The location is infinite where a draw reaches no further ridge.
        """
        weights = self._axis.weights(np.atleast_1d(special.logit(ratio))).T
        location, sd = [], []
        for at_nodes in self._nodes.of(counts):
            root, spread = ((weights * x[:, which]).sum(axis=0) for x in at_nodes)
            with np.errstate(divide="ignore"):
                location.append(-2 * np.log(np.maximum(root, 0)))
            sd.append(np.maximum(spread, 0))
        return np.stack(location, axis=-1), np.stack(sd, axis=-1)


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
    Up to 16 distinct textures are each treated as `predict` does. More of them are new ones, whose
    loads go with the square of the pitch, see `RatioLoads`.
    """

    def __init__(self, fit: Posterior, seen: Spread, kind: str = "simulation") -> None:
        self.loads = PosteriorLoads(fit, kind)
        self._range, self._seen = CalibratedRange.of(fit), seen
        self._new: RatioLoads | None = None
        if seen.distinct is None:
            self._new = RatioLoads(self.loads, float(seen.low[2]), float(seen.high[2]))
        else:
            textures = seen.distinct[:, :2].tolist()
            self._few = _KeptLoads([partial(self.loads.at, (a, b)) for a, b in textures])

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
        for first in range(0, LARGEST_Q // 2, COUNTS_AT_ONCE):
            ids = np.arange(first, first + COUNTS_AT_ONCE)
            location, sd = self.log_loads(textures, nu, which, ids)
            for load in (location + sd * score[:, None]).T:
                # One score a draw: a load cannot reach a further ridge before a nearer one.
                alive &= y >= load[:, None]
                Q += 2 * alive
            if not alive.any():
                flags = self._range.load_flags(p, nu[:, None]) | self._range.count_flags(Q)
                flags |= self._range.texture_flags(*textures[:, :2].T)[:, None]
                return PredictiveDraws(Q, which * self.loads.stride, flags)
        raise InputError(f"loads: expected counts up to {LARGEST_Q}, got more")

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
        a, b, ratio = textures.T
        counts = 4 + 2 * ids
        if self._new is not None:
            location, sd = self._new.at(ratio, which, counts.tolist())
            location = location + 2 * np.log(a + b)[:, None]
        else:
            place = self._seen.place(textures), which
            at_textures = ([values[place] for values in x] for x in self._few.of(counts.tolist()))
            location, sd = (np.stack(x, axis=-1) for x in zip(*at_textures, strict=True))
        location = location - np.log(reduced_load(1.0, nu))[:, None]
        if not self.loads.has_mean:
            location[counts > widest_count(a, b)[:, None]] = np.inf
        return location, sd
