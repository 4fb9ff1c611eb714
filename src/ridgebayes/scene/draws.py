"""Joint draws of a scene's values; certain values are constant."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.randomness import Streams, streams
from ridgebayes.scene import fields
from ridgebayes.scene.scene import Scene
from ridgebayes.scene.units import loads_at_modulus
from ridgebayes.table.columns import LARGEST_LOAD


@dataclass(frozen=True, eq=False)
class SceneDraws:
    """Joint draws of the values of a scene with one texture, each of shape (n_draw,).

    Parameters
    ----------
    profile : dict of str to ndarray of float
        a, b, depth, corner (over R) and offset (pitches), as in `contact.rigid_profile.Profile`.
    nu : ndarray of float
        Poisson's ratio.
    p_over_E : ndarray of float
        Highest load.
    physical : dict of str to ndarray of float
        Radius and length (m) and Young's modulus (Pa), if the scene has units.
    loads_at_modulus : dict of str to ndarray of float
        Loads in SI units at which p = E, by their kind, see `units.loads_at_modulus`.
    """

    profile: dict[str, FloatArray]
    nu: FloatArray
    p_over_E: FloatArray
    physical: dict[str, FloatArray]
    loads_at_modulus: dict[str, FloatArray]


def draw_scene(
    scene: Scene, n: int, random: Streams | int, draws: Mapping[str, FloatArray] | None = None
) -> SceneDraws:
    """Draw the values of a scene.

    Parameters
    ----------
    scene : Scene
        Scene of one texture.
    n : int
        Draws.
    random : Streams or int
        Random streams, continued from one block of draws to the next, or a seed. Equal seeds give
        equal draws.
    draws : mapping of str to ndarray of float, shape (n,), optional
        Draws of the uncertain values, as returned by `Uncertain.draw`.

    Returns
    -------
    SceneDraws

    Raises
    ------
    InputError
        If the scene has several textures, or a draw breaks a rule of a scene.
    """
    if len(scene.textures) != 1:
        raise InputError(f"scene: expected one texture, got {len(scene.textures)}")
    texture = scene.textures[0]
    random = streams(random) if isinstance(random, int) else random
    values = texture.shape | {"nu": scene.nu, "p_over_E": scene.highest_load(texture)}
    drawn: Mapping[str, FloatArray] = {}
    if scene.uncertain is not None:
        drawn = scene.uncertain.draw(n, random) if draws is None else draws
        derived = scene.uncertain.derived(drawn)
        if texture.max_p_over_E is not None:
            derived["p_over_E"] = texture.max_p_over_E
        # Certain values keep their exact ratios, which identify calibrated textures.
        values |= {name: value for name, value in derived.items() if np.ndim(value)}
    sizes = {
        place: None if median is None else drawn.get(place, float(median))
        for place, median in scene.body.sizes.items()
    }
    physical: dict[str, Any] = {}
    if scene.uncertain is not None:
        physical = {place.partition(".")[2]: x for place, x in sizes.items() if x is not None}
    if isinstance(values["offset"], str):
        values["offset"] = random("scene", "offset").uniform(-0.5, 0.5, n)
    values, physical, loads = (
        {name: np.array(np.broadcast_to(value, n), float) for name, value in group.items()}
        for group in (values, physical, loads_at_modulus(*sizes.values()))
    )
    _check(values)
    nu, p_over_E = values.pop("nu"), values.pop("p_over_E")
    return SceneDraws(values, nu, p_over_E, physical, loads)


def _check(drawn: dict[str, FloatArray]) -> None:
    """Refuse draws that break a rule of a scene."""
    offset, nu, p = drawn["offset"], drawn["nu"], drawn["p_over_E"]
    rules = fields.shape_rules(drawn) | {
        "offset": (np.abs(offset) <= 0.5, "from -0.5 to 0.5 pitches"),
        "nu": ((nu >= 0) & (nu <= 0.5), "from 0 to 0.5"),
        "p_over_E": ((p > 0) & (p <= LARGEST_LOAD), "finite and > 0"),
    }
    for name, (holds, rule) in rules.items():
        if not holds.all():
            bad = drawn[name][~holds]
            raise InputError(
                f"scene: {name} (over R or E): {len(bad)} of {len(holds)} draws break a rule: "
                f"expected {rule}, got {bad[0]:g}; a truncated distribution keeps within bounds"
            )
