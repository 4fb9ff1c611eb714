"""Draws of a scene's values: all alike where it is certain of them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ridgebayes._types import BoolArray, FloatArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.randomness import Streams, streams
from ridgebayes.scene.scene import Scene
from ridgebayes.table.columns import LARGEST_LOAD, LARGEST_WIDTH, LEAST_WIDTH


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
        Radius and length (m) and Young's modulus (Pa), where the scene has units.
    """

    profile: dict[str, FloatArray]
    nu: FloatArray
    p_over_E: FloatArray
    physical: dict[str, FloatArray] = field(default_factory=dict)


def draw_scene(
    scene: Scene, n: int, seed: int, draws: Mapping[str, FloatArray] | None = None
) -> SceneDraws:
    """Draw the values of a scene.

    Parameters
    ----------
    scene : Scene
        Scene of one texture.
    n : int
        Draws.
    seed : int
        The same seed gives the same draws.
    draws : mapping of str to ndarray of float, shape (n,), optional
        Draws of the values that are not certain, as `Uncertain.draw` returns them.

    Returns
    -------
    SceneDraws

    Raises
    ------
    InputError
        If there are several textures, or a draw breaks a rule of a scene.
    """
    return _next(scene, n, streams(seed), draws)


def scene_blocks(scene: Scene, n: int, seed: int, size: int) -> Iterator[SceneDraws]:
    """Yield the n draws of `draw_scene`, some at a time; joint rows of scipy.stats may be others.

    Raises
    ------
    InputError
        As `draw_scene`.
    """
    random = streams(seed)
    for first in range(0, n, size):
        yield _next(scene, min(size, n - first), random, None)


def _next(
    scene: Scene, n: int, random: Streams, draws: Mapping[str, FloatArray] | None
) -> SceneDraws:
    if len(scene.textures) != 1:
        raise InputError(f"scene: expected one texture, got {len(scene.textures)}")
    texture = scene.textures[0]
    values: dict[str, Any] = {
        "a": texture.a_over_R,
        "b": texture.b_over_R,
        "depth": texture.groove_depth_over_R or np.inf,
        "corner": texture.corner_radius_over_R,
        "offset": texture.offset,
        "nu": scene.nu,
        "p_over_E": scene.highest_load(texture),
    }
    physical: dict[str, Any] = {}
    if scene.uncertain is not None:
        drawn = scene.uncertain.draw(n, random) if draws is None else draws
        derived = scene.uncertain.derived(drawn)
        # A ratio of values that are certain stays the exact one: it names a calibrated texture.
        values |= {name: value for name, value in derived.items() if np.ndim(value)}
        if texture.max_p_over_E is not None:
            values["p_over_E"] = texture.max_p_over_E
        physical = {
            place.partition(".")[2]: drawn.get(place, float(median))
            for place, median in scene.body.sizes.items()
            if median is not None
        }
    if isinstance(values["offset"], str):
        values["offset"] = random("scene", "offset").uniform(-0.5, 0.5, n)
    values, physical = (
        {name: np.array(np.broadcast_to(value, n), float) for name, value in some.items()}
        for some in (values, physical)
    )
    _check(values)
    profile = {name: values.pop(name) for name in ("a", "b", "depth", "corner", "offset")}
    return SceneDraws(profile, values["nu"], values["p_over_E"], physical)


def _check(drawn: dict[str, FloatArray]) -> None:
    """Refuse draws that break a rule of a scene."""
    a, depth, corner = drawn["a"], drawn["depth"], drawn["corner"]
    for name in ("a", "b"):
        _refuse(name, drawn, (drawn[name] >= LEAST_WIDTH) & (drawn[name] <= LARGEST_WIDTH), "> 0")
    _refuse("corner", drawn, (corner >= 0) & (corner <= 0.5 * a), "0 to half the ridge width")
    _refuse("depth", drawn, (depth > 0) & (2 * depth >= corner), "> 0, at least half the corner")
    _refuse("offset", drawn, np.abs(drawn["offset"]) <= 0.5, "-0.5 to 0.5 pitches")
    _refuse("nu", drawn, (drawn["nu"] >= 0) & (drawn["nu"] <= 0.5), "0 to 0.5")
    p = drawn["p_over_E"]
    _refuse("p_over_E", drawn, (p > 0) & (p <= LARGEST_LOAD), "finite and > 0")


def _refuse(name: str, drawn: dict[str, FloatArray], holds: BoolArray, rule: str) -> None:
    if not holds.all():
        bad = drawn[name][~holds]
        raise InputError(
            f"scene: {name} (over R or E): {len(bad)} of {len(holds)} draws break a rule: expected "
            f"{rule}, got {bad[0]:g}; a truncated distribution keeps within bounds"
        )
