"""Predictions for a scene, whose uncertain values are drawn together with the posteriors."""

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.axes import Spread
from ridgebayes.contact.scaling import reduced_load
from ridgebayes.errors import InputError
from ridgebayes.inference.chains import N_KEPT
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms.arguments import even_counts, loads, numbers
from ridgebayes.predict.extrapolation import CalibratedRange, Flags, common_flags
from ridgebayes.predict.joint_draws import MOST_TEXTURES, PredictiveSampler, textures_of
from ridgebayes.predict.load_distribution import LoadDistribution, mix_loads
from ridgebayes.predict.load_draws import Columns, survival
from ridgebayes.predict.posterior_loads import DRAWS_DIVISOR
from ridgebayes.predict.q_distribution import QDistribution, mix_q, shares, stacked
from ridgebayes.scene.draws import draw_scene
from ridgebayes.scene.scene import Scene
from ridgebayes.scene.units import load_to_si, number_and_unit

NO_UNIT = "p/E"
_SEED = 0  # a scene has the same draws in all predictions

Averaged = Sequence[tuple[Posterior, float]]

# Values of a scene that change its loads, and that no form has.
_NO_EFFECT = ("groove_depth", "corner_radius", "ogden", "friction")


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
    values, unit = _loads(load) if p_over_E is None else (loads(p_over_E), NO_UNIT)
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
    return (scene.body.load_unit or [NO_UNIT])[0]


def _loads(load: ArrayLike | None) -> tuple[FloatArray | None, str | None]:
    """Return loads as numbers and, if they are texts, their unit."""
    if load is None:
        return None, None
    texts, units = np.asarray(load), set[str]()
    if texts.dtype.kind == "U":
        parts = [number_and_unit(text) for text in texts.ravel().tolist()]
        units = {unit for _, unit in parts}
        load = np.array([number for number, _ in parts]).reshape(texts.shape)
    if len(units) > 1:
        raise InputError(f"load: expected one unit, got {', '.join(sorted(units))}")
    values = numbers("load", load)
    if not np.all((values > 0) & np.isfinite(values)):
        raise InputError(f"load: expected finite loads > 0, got {load!r}")
    return values, next(iter(units), None)


class _SceneLoads:
    """Loads at which an uncertain body with one texture reaches counts, in the scene's unit."""

    def __init__(self, averaged: Averaged, scene: Scene, unit: str | None, kind: str) -> None:
        """Draw bodies, and posterior draws in proportion to the posteriors' weights."""
        self._scene, self._kind = scene, kind
        self._unit = load_unit(scene) if unit is None else unit
        self._size = 1.0 if self._unit == NO_UNIT else scene.body.p_over_E(f"1 {self._unit}")
        fits, self._weights = zip(*averaged, strict=True)
        counts = np.maximum(N_KEPT * shares(self._weights), N_KEPT // DRAWS_DIVISOR).round()
        ends = np.cumsum(counts.astype(int))
        self._bodies = bodies = draw_scene(scene, int(ends[-1]), _SEED)
        self._textures = textures_of(bodies.profile["a"], bodies.profile["b"])
        seen = Spread(MOST_TEXTURES)
        seen.add(self._textures)
        self._samplers = [PredictiveSampler(fit, seen, kind) for fit in fits]
        self._bodies_of = np.split(np.arange(ends[-1]), ends[:-1])

    def q_distribution(self, load: FloatArray | None) -> QDistribution:
        """Return the distribution of Q at loads in the unit, or at the scene's load for None."""
        highest = self._scene.highest_load(self._scene.textures[0]) / self._size
        shown = np.asarray(highest if load is None else load)
        # Without a load, loads are relative to the load of each body.
        factor = 1 / self._bodies.p_over_E if load is None else self._factor()
        value = np.ones(1) if load is None else shown.ravel()
        p, shape = value / factor[:, None], shown.shape
        places = {**self._places, "p_over_E": shown * self._size, "load": shown}
        flags_of = cache(partial(self._flags, p))  # posteriors of the same rows have the same

        def part(sampler: PredictiveSampler, here: IntArray) -> QDistribution:
            reached = survival(self._columns(sampler, here, factor), np.log(value))
            flags, Q_max = flags_of(sampler.calibrated), sampler.calibrated.Q_max
            reached = reached.reshape(*shape, reached.shape[1])
            return QDistribution(reached, flags.reshape(shape), Q_max, self._kind, places)

        return mix_q(map(part, self._samplers, self._bodies_of), self._weights)

    def load_distribution(self, count: IntArray) -> LoadDistribution:
        """Return the distribution of the load, in the unit, that reaches each even count."""
        factor = self._factor()
        unit = float(np.median(factor / reduced_load(1.0, self._bodies.nu)))
        places = {"kind_of_band": np.array(self._kind), **self._places, "Q": count}

        def part(sampler: PredictiveSampler, here: IntArray) -> LoadDistribution:
            calibrated = sampler.calibrated
            return LoadDistribution(
                np.full(len(here), 1 / len(here)),
                self._columns(sampler, here, factor),
                (count - 4) // 2,
                self._flags(np.zeros((1, 1)), calibrated)[0] | calibrated.count_flags(count),
                np.full(count.shape, calibrated.limit * unit),
                places,
                sampler.loads.has_mean,
            )

        return mix_loads(map(part, self._samplers, self._bodies_of), self._weights)

    def _columns(
        self, sampler: PredictiveSampler, here: IntArray, factor: FloatArray
    ) -> Callable[[IntArray], Columns]:
        """Return the columns of log loads of some bodies, with the load at which p = E."""
        unit = np.log(factor / reduced_load(1.0, self._bodies.nu))
        which = np.resize(np.arange(len(sampler.loads)), len(here))
        return partial(sampler.log_loads, self._textures[here], unit[here], which)

    def _factor(self) -> FloatArray:
        """Return the load in the unit at which p = E, for each body."""
        if self._unit == NO_UNIT:
            return np.ones(len(self._textures))
        one, kind = load_to_si(f"1 {self._unit}")
        return self._bodies.loads_at_modulus[kind] / float(one)

    def _flags(self, p: FloatArray, calibrated: CalibratedRange) -> Flags:
        """Return flags of quantities beyond the calibrated range in more than 1 % of bodies."""
        a, b, offset = (self._bodies.profile[name][:, None] for name in ("a", "b", "offset"))
        of_loads = calibrated.load_flags(p, self._bodies.nu[:, None])
        return common_flags(of_loads | calibrated.texture_flags(a, b, offset))

    @property
    def _places(self) -> dict[str, Any]:
        """Table columns with the medians of the body."""
        texture = self._scene.textures[0]
        return {
            "a_over_R": texture.a_over_R,
            "b_over_R": texture.b_over_R,
            "offset_pitches": np.nan if isinstance(texture.offset, str) else texture.offset,
            "nu": self._scene.nu,
            "load_unit": self._unit,
        }


def without_effect(scene: Scene | None, *more: str) -> list[str]:
    """Return a warning that names the values of a scene that predictions do not use, if any.

    `more` are further values without effect. A distribution has none either, whatever its median.
    """
    parts = () if scene is None else (scene, *scene.textures)
    given = {name for part in parts for name in part.model_dump(exclude_defaults=True)}
    given |= set() if scene is None else {n.rpartition(".")[2] for n in scene.uncertain_names}
    names = sorted({name.removesuffix("_over_R") for name in given} & {*_NO_EFFECT, *more})
    rule = "no effect on predictions, which hold for ridges and bodies like those of fitted rows"
    return [f"{', '.join(names)} of the scene: {rule}"] if names else []
