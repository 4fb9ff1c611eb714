"""An independent check of a goal's value: counts drawn one by one, as `friction_inputs` does."""

from collections.abc import Callable, Sequence

import numpy as np

from ridgebayes._types import Json
from ridgebayes.contact.axes import Spread
from ridgebayes.contact.scaling import Texture
from ridgebayes.inference.posterior import Posterior
from ridgebayes.predict.joint_draws import MOST_TEXTURES, PredictiveSampler, textures_of
from ridgebayes.runtime.randomness import stream
from ridgebayes.texture_design.bodies import Bodies
from ridgebayes.texture_design.goal_values import Value
from ridgebayes.texture_design.goals import Goal


def drawn_check(
    averaged: Sequence[tuple[Posterior, float]],
    draw_bodies: Callable[[int, int], Bodies],
    goal: Goal,
    texture: Texture,
    value: Value,
    n: int,
    seed: int,
) -> Json:
    """Return n, the probability of a goal's worst case (or the sd of Q) by n draws, and its se.

    Parameters
    ----------
    averaged : sequence of (Posterior, float)
        Posteriors and their weights.
    draw_bodies : callable
        Draws of bodies, from their number and a seed.
    goal : Goal
        The goal.
    texture : (float, float)
        The texture.
    value : Value
        Which case and corner to look at.
    n, seed : int
        Draws and their seed.
    """
    bodies = draw_bodies(n, seed)
    a, b = (np.broadcast_to(width, n) for width in bodies.widths(*texture, value.corner))
    textures, seen = textures_of(a, b), Spread(MOST_TEXTURES)
    seen.add(textures)
    loads = value.case.loads
    p = np.stack([load.p_over_E(bodies.units) for load in loads], axis=1)
    rng = stream(seed, "check")
    weight = np.array([share for _, share in averaged])
    part = rng.choice(len(weight), size=n, p=weight / weight.sum())
    Q = np.empty(p.shape, dtype=np.int64)
    for j, (fit, _) in enumerate(averaged):
        here = np.flatnonzero(part == j)
        if len(here):
            sampler = PredictiveSampler(fit, seen)
            Q[here] = sampler.draw(textures[here], p[here], bodies.nu[here], rng).Q
    if goal.is_spread:
        sd = float(Q[:, 0].std())
        fourth = float(((Q[:, 0] - Q[:, 0].mean()) ** 4).mean())
        se = np.sqrt(max(fourth - sd**4, 0.0) / n) / (2 * sd) if sd else 0.0
        return {"n": n, "probability": sd, "se": float(se)}
    met = np.ones(n, dtype=bool)
    for count, load in value.case.at_least:
        met &= Q[:, loads.index(load)] >= count
    for count, load in value.case.below:
        met &= Q[:, loads.index(load)] < count
    share = float(met.mean())
    # If no draw or every draw meets the goal, the error is as if one draw differed.
    return {"n": n, "probability": share, "se": float(np.sqrt(max(share * (1 - share), 1 / n) / n))}
