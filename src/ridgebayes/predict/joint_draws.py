"""Random loads and counts of many bodies, each with its own texture and posterior draw."""

from collections.abc import Callable, Sequence
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
from ridgebayes.predict.load_draws import MAX_Q, Columns
from ridgebayes.predict.posterior_loads import PosteriorLoads

# Textures whose loads are computed exactly, and nodes in a/pitch from which loads of more textures
# are interpolated: within 0.03 % for a/pitch from 0.05 to 0.95.
MOST_TEXTURES = 16


def textures_of(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a/R, b/R and a/pitch of n textures, shape (n, 3)."""
    return np.stack([a, b, a / (a + b)], axis=1)


class _NodeLoads:
    """Log loads of all draws at several nodes, stored for each count."""

    def __init__(self, at_nodes: Sequence[Callable[[IntArray], Columns]]) -> None:
        self._at_nodes = at_nodes
        self._stored: dict[int, Columns] = {}

    def at(self, count: int) -> Columns:
        """Return mean and standard deviation at a count, both (n_node, n_draw)."""
        if count not in self._stored:
            columns = [np.hstack(at(np.array([count]))).T for at in self._at_nodes]
            self._stored[count] = tuple(np.stack(columns, axis=1))
        return self._stored[count]


class RatioLoads:
    """Log loads of a posterior's draws at new textures of pitch R.

    A spline over logit(a/pitch) interpolates ``load^(-1/2)``, which is 0 if a draw never reaches
    the count.

    Parameters
    ----------
    loads : PosteriorLoads
        Loads of a posterior's draws.
    low, high : float
        Range of a/pitch.

    Attributes
    ----------
    loads : PosteriorLoads
        The same loads.

    Raises
    ------
    InputError
        If the form's loads are not proportional to the squared pitch.
    """

    def __init__(self, loads: PosteriorLoads, low: float, high: float) -> None:
        loads.check_scaling(low)
        self.loads = loads
        self._axis = Axis.over(special.logit(low), special.logit(high), MOST_TEXTURES)
        nodes = special.expit(self._axis.nodes).tolist()
        self._nodes = _NodeLoads([partial(_roots, loads, node) for node in nodes])

    def at_count(self, count: int, which: IntArray | slice, ratio: ArrayLike) -> Columns:
        """Return the result of `at` for one count, both (m,), with deviations above 0."""
        mean, sd = self.at(ratio, which, [count])
        return mean[:, 0], np.maximum(sd[:, 0], np.finfo(np.float64).tiny)

    def at(self, ratio: ArrayLike, which: IntArray | slice, counts: Sequence[int]) -> Columns:
        """Return mean and standard deviation of log loads at nu = 0.5.

        Parameters
        ----------
        ratio : array_like of float, shape (m,) or ()
            a/pitch for each draw, or one value for all draws.
        which : ndarray of int, shape (m,), or slice
            Indices of posterior draws.
        counts : sequence of int, shape (n,)
            Counts.

        Returns
        -------
        tuple of ndarray of float, shape (m, n)
            The mean is infinite if a draw never reaches the count.
        """
        weights = self._axis.weights(np.atleast_1d(special.logit(ratio))).T
        at_counts = [
            [(weights * x[:, which]).sum(axis=0) for x in self._nodes.at(count)] for count in counts
        ]
        root, sd = np.maximum(at_counts, 0).transpose(1, 2, 0)
        with np.errstate(divide="ignore"):
            return -2 * np.log(root), sd


def _roots(loads: PosteriorLoads, ratio: float, counts: IntArray) -> Columns:
    mean, sd = loads.at_ratio(ratio, counts)
    return np.exp(-0.5 * mean), sd


class PredictiveSampler:
    """Sampler of loads and Q from one posterior, for bodies whose textures may all differ.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    seen : Spread
        Range of `textures_of` all bodies, with at most `MOST_TEXTURES` distinct textures stored.
    kind : str, optional
        ``simulation``, or ``curve`` for loads without errors and offsets.

    Raises
    ------
    InputError
        If there are more than 16 textures and the form's loads are not proportional to the squared
        pitch.

    Notes
    -----
    Up to 16 distinct textures are treated as in `predict`. More textures are treated as new
    textures, whose loads `RatioLoads` interpolates.
    """

    def __init__(self, fit: Posterior, seen: Spread, kind: str = "simulation") -> None:
        self.loads = loads = PosteriorLoads(fit, kind)
        self.calibrated, self._seen = CalibratedRange.of(fit), seen
        if seen.distinct is None:
            self._ratio_loads = RatioLoads(loads, float(seen.low[2]), float(seen.high[2]))
        else:
            textures = seen.distinct[:, :2].tolist()
            self._texture_loads = _NodeLoads([partial(loads.at, (a, b)) for a, b in textures])

    def draw(
        self, textures: FloatArray, p: FloatArray, nu: FloatArray, rng: np.random.Generator
    ) -> tuple[IntArray, IntArray, Flags]:
        """Draw counts.

        Parameters
        ----------
        textures : ndarray of float, shape (m, 3)
            Result of `textures_of`.
        p : ndarray of float, shape (m, L)
            Loads p/E.
        nu : ndarray of float, shape (m,)
            Poisson's ratios.
        rng : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        Q : ndarray of int, shape (m, L)
            Even counts; the counts of a body never decrease as the load increases.
        draw_index : ndarray of int, shape (m,)
            Row of the posterior's `draws` used for each body.
        flags : ndarray of uint8, shape (m, L)
            Flags of quantities beyond the calibrated range.
        """
        which = rng.integers(len(self.loads), size=len(p))
        score = special.ndtri(rng.random(len(p)))
        with np.errstate(divide="ignore"):
            y = np.log(p)
        Q, is_reached = np.full(p.shape, 2), np.ones(p.shape, dtype=bool)
        unit = -np.log(reduced_load(1.0, nu))
        for i in range(MAX_Q // 2):
            mean, sd = self.log_loads(textures, unit, which, np.array([i]))
            # All counts of a body use one score, so its loads must be reached in order.
            is_reached &= y >= mean + sd * score[:, None]
            Q += 2 * is_reached
            if not is_reached.any():
                calibrated = self.calibrated
                flags = calibrated.load_flags(p, nu[:, None]) | calibrated.count_flags(Q)
                flags |= calibrated.texture_flags(*textures[:, :2].T)[:, None]
                return Q, which * self.loads.stride, flags
        raise InputError(f"loads: expected counts up to {MAX_Q}, got more")

    def log_loads(
        self, textures: FloatArray, unit: FloatArray, which: IntArray, ids: IntArray
    ) -> Columns:
        """Return mean and standard deviation of log loads at which bodies reach counts 4 + 2 ids.

        Parameters
        ----------
        textures : ndarray of float, shape (m, 3)
            Result of `textures_of`.
        unit : ndarray of float, shape (m,)
            Logarithm of the body's load for a load of 1 at nu = 0.5.
        which : ndarray of int, shape (m,)
            Index of the posterior draw of each body.
        ids : ndarray of int, shape (n,)
            Indices of the counts 4 + 2 ids.

        Returns
        -------
        tuple of ndarray of float, shape (m, n)
            The mean is infinite for counts that the body cannot reach.
        """
        a, b, ratio = textures.T
        counts = 4 + 2 * ids
        if self._seen.distinct is None:
            mean, sd = self._ratio_loads.at(ratio, which, counts.tolist())
            mean += 2 * np.log(a + b)[:, None]
        else:
            place = self._seen.place(textures), which
            at_counts = [[x[place] for x in self._texture_loads.at(n)] for n in counts.tolist()]
            mean, sd = np.array(at_counts).transpose(1, 2, 0)
        return self.loads.within_body(mean + unit[:, None], a[:, None], b[:, None], counts), sd
