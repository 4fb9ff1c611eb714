"""Predictions for a scene: its values are drawn together with the posteriors'."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.axes import Spread
from ridgebayes.contact.scaling import reduced_load
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms.arguments import even_counts, loads, numbers
from ridgebayes.predict.extrapolation import (
    GROOVE,
    LOAD,
    OFFSET,
    RATIO,
    RIDGE,
    TEXTURE,
    CalibratedRange,
    Flags,
    Q,
)
from ridgebayes.predict.joint_draws import MOST_TEXTURES, PredictiveSampler, textures_of
from ridgebayes.predict.load_distribution import LoadDistribution
from ridgebayes.predict.load_draws import LoadDraws
from ridgebayes.predict.predictive_cdf import of_share
from ridgebayes.predict.q_distribution import QDistribution, heavy_parts, shares
from ridgebayes.scene.draws import SceneDraws, draw_scene
from ridgebayes.scene.scene import Scene
from ridgebayes.scene.units import load_to_si, number_and_unit

NEGLIGIBLE = 1e-6  # P(Q >= n) at the highest load under which no further n is computed
NO_UNIT = "p/E"
_N_DRAW = 10_240  # bodies: as many as `predict` has draws of independent rows
_SEED = 0  # of the scene's draws: the same scene has the same ones in all predictions
_RARE = 0.01  # share of draws beyond the calibrated range up to which nothing is flagged: as a
# part of a mixture of that weight
_LARGEST_Q, _BLOCK = 2_000, 8

Averaged = Sequence[tuple[Posterior, float]]


def q_of_scene(
    averaged: Averaged,
    scene: Scene,
    *,
    load: ArrayLike | None = None,
    p_over_E: ArrayLike | None = None,
    kind: str = "simulation",
) -> QDistribution:
    """Return the distribution of Q of a scene, see `Predictive.predict`.

    Parameters
    ----------
    averaged : sequence of (Posterior, float)
        Posteriors and their weights.
    scene : Scene
        With a texture or several, then the first axis of the result.
    load, p_over_E : array_like of float, shape (...), optional
        Loads in the scene's unit, or texts with units; or p/E. The scene's own if not given.
    kind : str, optional
        As in `Predictive.predict`.

    Returns
    -------
    QDistribution
        Distribution with the shape of the loads.
    """
    if load is not None and p_over_E is not None:
        raise InputError("load and p_over_E: expected one of them, got both")
    values: FloatArray | None
    if p_over_E is None:
        values, unit = _loads(load)
    else:
        values, unit = loads(p_over_E), NO_UNIT
    each = [SceneLoads.of(averaged, one, unit, kind) for one in scene.apart]
    found = [one.q_distribution(values, kind) for one in each]
    if len(found) == 1:
        return found[0]
    n_step = max(one.survival.shape[-1] for one in found)
    pads = [(0, n_step - one.survival.shape[-1]) for one in found]
    survival = [
        np.pad(one.survival, [(0, 0)] * (one.survival.ndim - 1) + [pad])
        for one, pad in zip(found, pads, strict=True)
    ]
    places = {name: np.stack([one.places[name] for one in found]) for name in found[0].places}
    flags = np.stack([one.flags for one in found])
    return replace(found[0], survival=np.stack(survival), flags=flags, places=places)


def load_of_scene(
    averaged: Averaged, scene: Scene, count: ArrayLike, *, kind: str = "simulation"
) -> LoadDistribution:
    """Return the distribution of loads of a scene, see `Predictive.predict_load`.

    Parameters
    ----------
    averaged : sequence of (Posterior, float)
        Posteriors and their weights.
    scene : Scene
        Scene with one texture.
    count : array_like of int, shape (...), dimensionless
        Even counts of at least 4.
    kind : str, optional
        As in `Predictive.predict_load`.

    Returns
    -------
    LoadDistribution
        In the scene's unit.
    """
    if len(scene.textures) != 1:
        raise InputError(
            f"scene: expected one texture, got {len(scene.textures)}; `scene.apart` has a scene of "
            "each"
        )
    counts = even_counts(count, least=4).astype(np.int64)
    return SceneLoads.of(averaged, scene, None, kind).load_distribution(counts, kind)


def load_unit(scene: Scene) -> str:
    """Return the unit of a scene's load, ``p/E`` where it has none."""
    found = scene.body.load_unit
    return NO_UNIT if found is None else found[0]


def _loads(load: ArrayLike | None) -> tuple[FloatArray | None, str | None]:
    """Return loads as numbers, and the unit that texts have."""
    unit = None
    if load is None:
        return None, unit
    texts = np.asarray(load)
    if texts.dtype.kind == "U":
        parts = [number_and_unit(text) for text in texts.ravel().tolist()]
        units = {unit for _, unit in parts}
        if len(units) > 1:
            raise InputError(f"load: expected one unit, got {', '.join(sorted(units))}")
        load, unit = np.array([number for number, _ in parts]).reshape(texts.shape), units.pop()
    values = numbers("load", load)
    if not np.all((values > 0) & np.isfinite(values)):
        raise InputError(f"load: expected finite loads > 0, got {load!r}")
    return values, unit


def _factor(scene: Scene, bodies: SceneDraws, unit: str) -> FloatArray:
    """Return the load at which p = E of each body, in a unit."""
    if unit == NO_UNIT:
        return np.ones(len(bodies.nu))
    _, dimension = load_to_si(f"1 {unit}")
    size = scene.body.p_over_E(f"1 {unit}")  # refuses what the scene does not have
    body = {
        "youngs_modulus": scene.body.modulus,
        "radius": scene.body.radius,
        "length": scene.body.length,
    }
    needed = {"pressure": 1, "line load": 2, "force": 3}[dimension]
    factor = np.full(len(bodies.nu), 1 / size)
    for name, median in list(body.items())[:needed]:
        if name in bodies.physical and median is not None:
            factor = factor * (bodies.physical[name] / float(median))
    return factor


@dataclass(frozen=True, eq=False)
class SceneLoads:
    """Loads at which an uncertain body reaches counts, in the unit of its scene.

    Parameters
    ----------
    scene : Scene
        Scene with one texture.
    draws : LoadDraws
        A column for each of the counts 4, 6, 8, ...: loads over `unit`.
    bodies : SceneDraws
        Draws of the scene that `draws` are of.
    unit : str
        Unit of loads, ``p/E`` where the scene has none.
    factor : ndarray of float, shape (n_draw,)
        Load at which p = E of each body, in `unit`.
    ranges : sequence of CalibratedRange
        Calibrated ranges of the posteriors with enough weight.
    """

    scene: Scene
    draws: LoadDraws
    bodies: SceneDraws
    unit: str
    factor: FloatArray
    ranges: Sequence[CalibratedRange]

    @classmethod
    def of(
        cls, averaged: Sequence[tuple[Posterior, float]], scene: Scene, unit: str | None, kind: str
    ) -> "SceneLoads":
        """Draw bodies, each with a draw of a posterior, as many of each as it has weight."""
        share = shares([weight for _, weight in averaged])
        counts = [of_share(_N_DRAW, one) for one in share.tolist()]
        bodies = draw_scene(scene, sum(counts), _SEED)
        textures = textures_of(bodies.profile["a"], bodies.profile["b"])
        seen = Spread(MOST_TEXTURES)
        seen.add(textures)
        parts, first = [], 0
        for (fit, _), n in zip(averaged, counts, strict=True):
            here = slice(first, first + n)
            sampler = PredictiveSampler(fit, seen, kind)
            which = np.resize(np.arange(sampler.n_draw), n)
            columns = partial(sampler.log_loads, textures[here], bodies.nu[here], which)
            parts.append(LoadDraws(np.full(n, 1 / n), sampler.df(which), columns))
            first += n
        draws = LoadDraws.joined(zip(parts, share.tolist(), strict=True))
        heavy = np.flatnonzero(heavy_parts(share)).tolist()
        ranges = [CalibratedRange.of(averaged[i][0]) for i in heavy]
        unit = load_unit(scene) if unit is None else unit
        return cls(scene, draws, bodies, unit, _factor(scene, bodies, unit), ranges)

    def q_distribution(self, load: FloatArray | None, kind: str) -> QDistribution:
        """Return the distribution of Q at loads in the unit; None is the scene's own load."""
        p = self.bodies.p_over_E[:, None]
        if load is not None:
            p = load.ravel() / self.factor[:, None]
        survival = self._survival(np.log(p))
        flags = self._texture_flags()
        beyond = self._share(reduced_load(p, self.bodies.nu[:, None]) > self._load_max) > _RARE
        flags = flags | np.where(beyond, LOAD, 0).astype(np.uint8)
        shape = np.shape(load) if load is not None else ()
        size = 1.0 if self.unit == NO_UNIT else self.scene.body.p_over_E(f"1 {self.unit}")
        own = np.array(self.scene.highest_load(self.scene.textures[0]) / size)
        shown = own if load is None else load
        places = {"p_over_E": shown * size, "load": shown}
        return QDistribution(
            survival.reshape(*shape, -1),
            flags.reshape(shape),
            min(one.Q_max for one in self.ranges),
            kind,
            np.nan,
            self._where(shape) | places,
        )

    def load_distribution(self, count: IntArray, kind: str) -> LoadDistribution:
        """Return the distribution of the load, in the unit, that reaches even counts."""
        beyond = count > min(one.Q_max for one in self.ranges)
        flags = self._texture_flags() | np.where(beyond, Q, 0).astype(np.uint8)
        own = replace(self.draws, columns=self._in_unit)
        own_load = self.factor / reduced_load(1.0, self.bodies.nu)
        highest = np.full(count.shape, float(np.median(own_load)) * self._load_max)
        where = {"kind_of_band": np.array(kind), **self._where(count.shape), "Q": count}
        place = (count - 4) // 2
        return LoadDistribution.of(own, place, flags, highest, where)

    def _in_unit(self, ids: IntArray) -> tuple[FloatArray, FloatArray]:
        location, scale = self.draws.columns(ids)
        return location + np.log(self.factor)[:, None], scale

    def _survival(self, y: FloatArray) -> FloatArray:
        """Return P(Q >= 2), P(Q >= 4), ... at log p/E of each body, (n_draw, n_load)."""
        columns = [np.ones(y.shape[1])]
        for first in range(0, _LARGEST_Q // 2, _BLOCK):
            location, scale = self.draws.columns(np.arange(first, first + _BLOCK))
            for mean, sd in zip(location.T, scale.T, strict=True):
                share = self.draws.cdf(y, mean[:, None], sd[:, None])
                # One noise draw cannot reach a further ridge before a nearer one.
                columns.append(np.minimum(share, columns[-1]))
                if columns[-1].max() < NEGLIGIBLE:
                    return np.stack(columns, axis=-1)
        raise InputError(f"load: expected counts up to {_LARGEST_Q}, got more")

    def _share(self, holds: np.ndarray) -> FloatArray:
        return np.tensordot(self.draws.weight, holds, axes=1)

    def _texture_flags(self) -> Flags:
        """Return the flags of what lies beyond the calibrated range in more than rare draws."""
        profile = self.bodies.profile
        found = OFFSET if np.any(profile["offset"] != 0) else 0
        for one in self.ranges:
            flags = one.texture_flags(profile["a"], profile["b"])
            for bit in (RATIO, RIDGE, GROOVE, TEXTURE):
                found |= bit if self._share((flags & bit) > 0) > _RARE else 0
        return np.array(found, dtype=np.uint8)

    @property
    def _load_max(self) -> float:
        """The highest calibrated load p/E, reduced to nu = 0.5."""
        return min(one.load_max for one in self.ranges) * (1 + 1e-12)  # but for rounding

    def _where(self, shape: tuple[int, ...]) -> dict[str, np.ndarray]:
        """Return medians of the body, for tables."""
        texture = self.scene.textures[0]
        medians: dict[str, float | str] = {
            "a_over_R": texture.a_over_R,
            "b_over_R": texture.b_over_R,
            "offset_pitches": np.nan if isinstance(texture.offset, str) else texture.offset,
            "nu": self.scene.nu,
            "load_unit": self.unit,
        }
        return {name: np.broadcast_to(one, shape) for name, one in medians.items()}
