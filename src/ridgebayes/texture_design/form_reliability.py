"""First-order reliability: the nearest failure in standard normal space, by SLSQP.

Coefficients enter by the normal distribution of the log load that they give, errors by their
scale; widths, body and load by their own distributions. Each way to fail (a count not reached, or
passed) and each posterior has a nearest point; P(failure) is the sum of Phi(-beta) over ways to
fail, averaged over posteriors.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import optimize, special

from ridgebayes._types import FloatArray, Json
from ridgebayes.contact.scaling import reduced_load
from ridgebayes.errors import InputError
from ridgebayes.texture_design.bodies import Bodies
from ridgebayes.texture_design.drawn_loads import DrawnLoads
from ridgebayes.texture_design.goals import Load
from ridgebayes.texture_design.sensitivity import COEFFICIENTS, NOISE, Sources

_STEP = 1e-5
_TRUSTED = 0.2  # of the probability: largest difference from Monte Carlo
_PRECISE = 0.1  # of it: largest standard error of Monte Carlo
_TOLERANCE = 1e-6


@dataclass(frozen=True)
class _Mode:
    """One way to fail under one posterior: a count not reached (sign 1), or passed (-1)."""

    loads: DrawnLoads
    count: int
    load: Load
    sign: float


def form_reliability(sources: Sources, probability: float, se: float) -> Json:
    """Return the reliability index of a case, and whether to trust it.

    Parameters
    ----------
    sources : Sources
        Texture and case.
    probability, se : float
        Of failure, by Monte Carlo.

    Returns
    -------
    dict
        beta, probability (of failure), trusted, why (if not), monte_carlo, monte_carlo_se, and
        importance: the squared direction cosines by source at the nearest failure.
    """
    about: Json = {"beta": None, "probability": None, "trusted": False}
    told: Json = {"monte_carlo": probability, "monte_carlo_se": se, "importance": {}}
    try:
        names = _names(sources)
        found = [
            (weight, *_nearest(sources, names, mode))
            for loads, weight in sources.loads
            for mode in _modes(sources, loads)
        ]
    except (InputError, np.linalg.LinAlgError) as error:
        return about | {"why": str(error)} | told
    if not found:
        return about | {"why": "the goal cannot fail"} | told
    total = sum(weight * float(special.ndtr(-beta)) for weight, beta, _ in found)
    _, _, point = max(found, key=lambda one: one[0] * special.ndtr(-one[1]))
    if point is None or not 0 < total < 1:
        return about | {"why": "no nearest failure was found"} | told
    told["importance"] = _importance(sources, names, point)
    why = ""
    if any(one is None for _, _, one in found):
        why = "a nearest failure was not found"
    elif not 0 < se <= _PRECISE * probability:
        why = "Monte Carlo is too coarse to compare with"
    elif abs(total - probability) > _TRUSTED * probability:
        why = "it differs from Monte Carlo by more than 20 %"
    about = {"beta": float(-special.ndtri(total)), "probability": total, "trusted": not why}
    return about | ({"why": why} if why else {}) | told


def _modes(sources: Sources, loads: DrawnLoads) -> list[_Mode]:
    case = sources.value.case
    found = [_Mode(loads, n, load, 1.0) for n, load in case.at_least if n > 2]
    return found + [_Mode(loads, n, load, -1.0) for n, load in case.below]


def _names(sources: Sources) -> list[str]:
    """Return the coordinates: places of the scene, two widths, coefficients, the error."""
    found: list[str] = []
    uncertain = sources.scene.uncertain
    if uncertain is not None:
        lost = [name for name, one in uncertain.sources.items() if not one.has_quantiles]
        lost += [name for one in uncertain.joint if one.draws is not None for name in one.of]
        if lost:
            raise InputError(f"{', '.join(lost)}: draws, not functions of normal scores")
        found += list(uncertain.sources)
    if sources.tolerance.size and not sources.tolerance.is_worst:
        found += ["tolerance", "tolerance"]
    return [*found, COEFFICIENTS, NOISE]


def _nearest(sources: Sources, names: list[str], mode: _Mode) -> tuple[float, FloatArray | None]:
    """Return beta of one way to fail and the nearest failure; None where none was found."""

    def limit(u: FloatArray) -> float:
        return float(_limit(sources, names, mode, u[None])[0])

    def gradient(u: FloatArray) -> FloatArray:
        steps = _STEP * np.eye(len(u))
        values = _limit(sources, names, mode, np.concatenate([u + steps, u - steps]))
        return (values[: len(u)] - values[len(u) :]) / (2 * _STEP)

    start, origin = np.zeros(len(names)), limit(np.zeros(len(names)))
    slope = gradient(start)
    if np.any(slope):
        start = -origin * slope / (slope @ slope)
    found = optimize.minimize(
        lambda u: float(u @ u),
        np.clip(start, -8, 8),
        jac=lambda u: 2 * u,
        method="SLSQP",
        constraints={"type": "eq", "fun": limit, "jac": gradient},
        options={"maxiter": 200, "ftol": 1e-10},
    )
    beta = float(np.copysign(np.sqrt(found.fun), origin))
    reached = np.isfinite(found.fun) and abs(limit(found.x)) < _TOLERANCE
    return (beta, found.x) if reached else (np.copysign(np.inf, origin), None)


def _limit(sources: Sources, names: list[str], mode: _Mode, u: FloatArray) -> FloatArray:
    """Return how far the log load lies on the safe side at points u (n, dimension), shape (n,)."""
    score: Mapping[str, FloatArray] = dict(zip(names, u.T, strict=True))
    given: dict[str, FloatArray] = {}
    uncertain = sources.scene.uncertain
    if uncertain is not None:
        given |= uncertain.at_scores({name: score[name] for name in uncertain.sources})
    given["tolerance"] = np.zeros((2, len(u)))
    if "tolerance" in names:
        first = names.index("tolerance")
        given["tolerance"] = u[:, first : first + 2].T
    bodies = Bodies.draw(sources.scene, sources.tolerance, len(u), 0, given)
    made = bodies.widths(*sources.texture, sources.value.corner)
    a, b = (np.broadcast_to(width, len(u)) for width in made)
    log_p = np.log(reduced_load(mode.load.p_over_E(bodies.units), bodies.nu))
    location, spread, scale = (np.empty(len(u)) for _ in range(3))
    for i, ratio in enumerate((a / (a + b)).tolist()):
        own = mode.loads.at(mode.count, slice(None), np.asarray(ratio))
        location[i], spread[i] = own[0].mean(), own[0].std()
        scale[i] = np.sqrt(np.mean(own[1] ** 2))
    error = score[NOISE]
    if mode.loads.df is not None:
        error = special.stdtrit(np.median(mode.loads.df), special.ndtr(error))
    log_load = location + spread * score[COEFFICIENTS] + scale * error + 2 * np.log(a + b)
    value: FloatArray = mode.sign * (log_p - log_load)
    return value


def _importance(sources: Sources, names: list[str], point: FloatArray) -> dict[str, float]:
    share = point**2 / max(float(point @ point), 1e-300)
    of_source = {one: group for group, members in sources.groups.items() for one in members}
    found: dict[str, float] = {}
    for name, one in zip(names, share.tolist(), strict=True):
        group = of_source.get(name, name)
        found[group] = found.get(group, 0.0) + one
    return found
