"""Draws of a scene's values: all alike where it is certain of them."""

from dataclasses import dataclass, field

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.randomness import stream
from ridgebayes.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class SceneDraws:
    """Joint draws of the values of a scene with one texture, each of shape (n_draw,).

    Parameters
    ----------
    profile : dict of str to ndarray of float
        a, b, depth, corner (over R) and offset (pitches), as of `contact.rigid_profile.Profile`.
    nu : ndarray of float
        Poisson's ratio.
    p_over_E : ndarray of float
        Highest load.
    physical : dict of str to ndarray of float
        Radius (m) and Young's modulus (Pa), where the scene has units.
    """

    profile: dict[str, FloatArray]
    nu: FloatArray
    p_over_E: FloatArray
    physical: dict[str, FloatArray] = field(default_factory=dict)


def draw_scene(scene: Scene, n: int, seed: int) -> SceneDraws:
    """Draw the values of a scene.

    Parameters
    ----------
    scene : Scene
        Of one texture.
    n : int
        Draws.
    seed : int
        The same seed gives the same draws.

    Returns
    -------
    SceneDraws

    Raises
    ------
    InputError
        If there are several textures.
    """
    if len(scene.textures) != 1:
        raise InputError(f"scene: expected one texture, got {len(scene.textures)}")
    texture = scene.textures[0]
    values = {
        "a": texture.a_over_R,
        "b": texture.b_over_R,
        "depth": texture.groove_depth_over_R or np.inf,
        "corner": texture.corner_radius_over_R,
    }
    profile = {name: np.full(n, float(value)) for name, value in values.items()}
    if texture.offset == "uniform":
        profile["offset"] = stream(seed, "offset").uniform(-0.5, 0.5, n)
    else:
        profile["offset"] = np.full(n, float(texture.offset))
    return SceneDraws(profile, np.full(n, scene.nu), np.full(n, scene.highest_load(texture)))
