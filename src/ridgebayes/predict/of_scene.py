"""Predictions for a scene, whose uncertain values are drawn together with the posteriors."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.axes import Spread
from ridgebayes.contact.scaling import reduced_load
from ridgebayes.errors import InputError
from ridgebayes.inference.chains import N_KEPT
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms.arguments import even_counts, loads, numbers
from ridgebayes.predict.extrapolation import (
    GROOVE,
    LOAD,
    OFFSET,
    RATIO,
    RIDGE,
    ROUNDING,
    TEXTURE,
    CalibratedRange,
    Flags,
    Q,
)
from ridgebayes.predict.joint_draws import MOST_TEXTURES, PredictiveSampler, textures_of
from ridgebayes.predict.load_distribution import LoadDistribution
from ridgebayes.predict.load_draws import LoadDraws
from ridgebayes.predict.posterior_loads import DRAWS_DIVISOR
from ridgebayes.predict.q_distribution import MIN_HEAVY, QDistribution, heavy_parts, shares, stacked
from ridgebayes.scene.draws import draw_scene
from ridgebayes.scene.scene import Scene
from ridgebayes.scene.units import load_to_si, number_and_unit

NO_UNIT = "p/E"
_SEED = 0  # a scene has the same draws in all predictions

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
        Scene with one or more textures. Several textures are the first axis of the result.
    load, p_over_E : array_like of float, shape (...), optional
        Loads in the scene's unit or as texts with units, or p/E. The load of the scene if neither
        is given.
    kind : str, optional
        As in `Predictive.predict`.

    Returns
    -------
    QDistribution
        Distributions with the shape of the loads.
    """
    if load is not None and p_over_E is not None:
        raise InputError("load and p_over_E: expected only one of the two, got both")
    values: FloatArray | None
    if p_over_E is None:
        values, unit = _loads(load)
    else:
        values, unit = loads(p_over_E), NO_UNIT
    parts = [_SceneLoads(averaged, part, unit, kind).q_distribution(values) for part in scene.apart]
    return parts[0] if len(parts) == 1 else stacked(parts)


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
        Distributions of the load in the scene's unit.
    """
    if len(scene.textures) != 1:
        raise InputError(
            f"scene: expected one texture, got {len(scene.textures)}; `scene.apart` has a scene of "
            "each"
        )
    counts = even_counts(count, least=4).astype(np.int64)
    return _SceneLoads(averaged, scene, None, kind).load_distribution(counts)


def load_unit(scene: Scene) -> str:
    """Return the unit of a scene's load, ``p/E`` if the scene has no load unit."""
    load = scene.body.load_unit
    return NO_UNIT if load is None else load[0]


def _loads(load: ArrayLike | None) -> tuple[FloatArray | None, str | None]:
    """Return loads as numbers and, if they are texts, their unit."""
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


class _SceneLoads:
    """Loads at which an uncertain body with one texture reaches counts, in the scene's unit."""

    def __init__(self, averaged: Averaged, scene: Scene, unit: str | None, kind: str) -> None:
        """Draw bodies, and posterior draws in proportion to the posteriors' weights."""
        self._scene, self._kind = scene, kind
        self._unit = load_unit(scene) if unit is None else unit
        self._size = 1.0 if self._unit == NO_UNIT else scene.body.p_over_E(f"1 {self._unit}")
        share = shares([weight for _, weight in averaged])
        counts = np.maximum(N_KEPT * share, N_KEPT // DRAWS_DIVISOR).round().astype(int).tolist()
        self._bodies = bodies = draw_scene(scene, sum(counts), _SEED)
        textures = textures_of(bodies.profile["a"], bodies.profile["b"])
        seen = Spread(MOST_TEXTURES)
        seen.add(textures)
        parts, first = [], 0
        for (fit, _), n in zip(averaged, counts, strict=True):
            here = slice(first, first + n)
            sampler = PredictiveSampler(fit, seen, kind)
            which = np.resize(np.arange(len(sampler.loads)), n)
            columns = partial(sampler.log_loads, textures[here], bodies.nu[here], which)
            parts.append(LoadDraws.uniform(n, columns, sampler.loads.has_mean))
            first += n
        self._draws = LoadDraws.joined(zip(parts, share.tolist(), strict=True))
        heavy = np.flatnonzero(heavy_parts(share)).tolist()
        self._ranges = [CalibratedRange.of(averaged[i][0]) for i in heavy]
        self._load_max = min(calibrated.load_max for calibrated in self._ranges) * (1 + ROUNDING)
        self._Q_max = min(calibrated.Q_max for calibrated in self._ranges)
        self._factor = self._factors()

    def q_distribution(self, load: FloatArray | None) -> QDistribution:
        """Return the distribution of Q at loads in the unit, or at the scene's load for None."""
        factor, value = self._factor, np.ones(1)
        if load is None:
            factor = 1 / self._bodies.p_over_E  # loads relative to the load of each body
        else:
            value = load.ravel()
        p = value / factor[:, None]
        survival = self._draws.shifted(np.log(factor)).reaching(np.log(value))
        beyond = self._share(reduced_load(p, self._bodies.nu[:, None]) > self._load_max) > MIN_HEAVY
        flags = self._texture_flags() | np.where(beyond, LOAD, 0).astype(np.uint8)
        shape = np.shape(load) if load is not None else ()
        highest = self._scene.highest_load(self._scene.textures[0])
        shown = np.array(highest / self._size) if load is None else load
        return QDistribution(
            survival.reshape(*shape, -1),
            flags.reshape(shape),
            self._Q_max,
            self._kind,
            {**self._medians(shape), "p_over_E": shown * self._size, "load": shown},
        )

    def load_distribution(self, count: IntArray) -> LoadDistribution:
        """Return the distribution of the load, in the unit, that reaches each even count."""
        flags = self._texture_flags() | np.where(count > self._Q_max, Q, 0).astype(np.uint8)
        unit_load = np.median(self._factor / reduced_load(1.0, self._bodies.nu))
        highest = np.full(count.shape, float(unit_load) * self._load_max)
        where = {"kind_of_band": np.array(self._kind), **self._medians(count.shape), "Q": count}
        draws = self._draws.shifted(np.log(self._factor))
        return LoadDistribution(draws, (count - 4) // 2, flags, highest, where)

    def _factors(self) -> FloatArray:
        """Return the load in the unit at which p = E, for each body."""
        body, physical = self._scene.body, self._bodies.physical
        factor = np.full(len(self._bodies.nu), 1 / self._size)
        if self._unit == NO_UNIT:
            return factor
        needed = {"pressure": 1, "line load": 2, "force": 3}[load_to_si(f"1 {self._unit}")[1]]
        for place, median in list(body.sizes.items())[:needed]:
            name = place.partition(".")[2]
            if name in physical and median is not None:
                factor = factor * (physical[name] / float(median))
        return factor

    def _share(self, is_true: np.ndarray) -> FloatArray:
        return np.tensordot(self._draws.weight, is_true, axes=1)

    def _texture_flags(self) -> Flags:
        """Return flags of quantities beyond the calibrated range in more than 1 % of the draws."""
        profile = self._bodies.profile
        total = OFFSET if np.any(profile["offset"] != 0) else 0
        for calibrated in self._ranges:
            flags = calibrated.texture_flags(profile["a"], profile["b"])
            for bit in (RATIO, RIDGE, GROOVE, TEXTURE):
                total |= bit if self._share((flags & bit) > 0) > MIN_HEAVY else 0
        return np.array(total, dtype=np.uint8)

    def _medians(self, shape: tuple[int, ...]) -> dict[str, np.ndarray]:
        """Return table columns with the medians of the body."""
        texture = self._scene.textures[0]
        medians: dict[str, float | str] = {
            "a_over_R": texture.a_over_R,
            "b_over_R": texture.b_over_R,
            "offset_pitches": np.nan if isinstance(texture.offset, str) else texture.offset,
            "nu": self._scene.nu,
            "load_unit": self._unit,
        }
        return {name: np.broadcast_to(value, shape) for name, value in medians.items()}
