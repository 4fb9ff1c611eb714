"""Check of a design by draws, sources of its uncertainty, and effects of measurements.

Sources are independent groups, and each draw is a function of them. One uniform number picks the
form, another the error model, and a third the coefficients: a draw of the posterior, sorted by
load. A normal score gives the error of a load. The scene gives body, load and widths; values that
it correlates are one group.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import pandas as pd
from scipy import stats

from ridgebayes._types import BoolArray, FloatArray, IntArray, Json
from ridgebayes.contact.scaling import Texture
from ridgebayes.predict.joint_draws import RatioLoads
from ridgebayes.runtime.randomness import stream, streams
from ridgebayes.scene.scene import Scene
from ridgebayes.scene.uncertain import Uncertain
from ridgebayes.texture_design.bodies import Bodies, Tolerance, median_units
from ridgebayes.texture_design.goal_values import N_DRAW, PlacedDraws, PosteriorDraws, Value
from ridgebayes.texture_design.goals import Goal

FORM, NOISE, COEFFICIENTS = "form", "error model", "coefficients"
SIMULATION = "a simulation of this texture"
_GROUPS = {"body": "body", "load": "load", "texture": "tolerance"}  # by section of a scene
_N_CHECK = 100_000  # draws of the check
_MAX_SE = 0.1  # largest standard error of a reported share
_N_OUTER = math.isqrt(N_DRAW)  # measurements
N_INNER = 2 * _N_OUTER  # draws of each
_QUANTILES = (0.05, 0.95)  # of the probability after a measurement
_SPREADS_LEFT = (0.0, 0.5)  # shares of a source's sd after a measurement
Draws = Mapping[str, FloatArray]  # by source; draws are along the last axis


@dataclass(frozen=True, eq=False)
class Sources:
    """Independent sources on which the counts of a texture depend.

    Parameters
    ----------
    scene : Scene
        The scene.
    tolerance : Tolerance
        Tolerance of the widths.
    loads : sequence of (RatioLoads, float)
        Loads of each posterior's draws, and its weight.
    texture : (float, float)
        The texture.
    value : Value
        Value of the goal at the texture; its case and corner are used.
    """

    scene: Scene
    tolerance: Tolerance
    loads: Sequence[tuple[RatioLoads, float]]
    texture: Texture
    value: Value

    def draw(self, n: int, seed: int) -> dict[str, FloatArray]:
        """Return n draws of each source."""
        draws: dict[str, FloatArray] = dict(self._uncertain.draw(n, streams(seed)))
        if self._has_drawn_widths:
            draws["tolerance"] = stream(seed, "tolerance").standard_normal((2, n))
        for name in (FORM, NOISE, COEFFICIENTS):
            draws[name] = stream(seed, name).random(n)
        return draws | {"score": stream(seed, "score").standard_normal(n)}

    def draw_measured(self, members: Sequence[str], left: float, seed: int) -> Draws:
        """Return blocks of draws; each block has its own measured values of some sources.

        A share `left` of the measured sources' spread, in normal scores, remains. It is 0 except
        for the tolerance and for distributions of the scene.
        """
        n = _N_OUTER * N_INNER
        draws, measurements = self.draw(n, seed), self.draw(_N_OUTER, seed + 1)
        in_part = bool(left) and members != ["tolerance"]
        score = draws
        if in_part:
            score = self._uncertain.scores(n, streams(seed))
            measurements = self._uncertain.scores(_N_OUTER, streams(seed + 1))
        measured = {
            name: left * score[name]
            + math.sqrt(1 - left**2) * np.repeat(measurements[name], N_INNER, axis=-1)
            for name in members
        }
        if in_part:
            measured = self._uncertain.at_scores(score | measured, streams(seed))
        return {**draws, **measured}

    def may_be_measured_in_part(self, members: Sequence[str]) -> bool:
        """Return whether draws of these sources are functions of normal scores."""
        drawn = (name for name, source in self._uncertain.sources.items() if source.has_quantiles)
        return set(members) <= {"tolerance", *drawn}

    @property
    def groups(self) -> dict[str, list[str]]:
        """Sources by group; groups that the scene correlates are merged."""
        places = {name: _GROUPS[name.partition(".")[0].partition("[")[0]] for name in self._places}
        for correlated in self._uncertain.joint:
            merged = " and ".join(dict.fromkeys(places[name] for name in correlated.of))
            old = {places[name] for name in correlated.of}
            places = {k: merged if v in old else v for k, v in places.items()}
        if self._has_drawn_widths:
            places["tolerance"] = "tolerance"
        n_form = len({loads.loads.fit.form.name for loads, _ in self.loads})
        places |= {COEFFICIENTS: COEFFICIENTS} | ({FORM: FORM} if n_form > 1 else {})
        places |= {NOISE: NOISE, "score": NOISE}
        return {
            group: [name for name in places if places[name] == group] for group in places.values()
        }

    @property
    def measurable(self) -> dict[str, list[str]]:
        """Sources that a measurement determines, by name of the measurement."""
        groups = [list(correlated.of) for correlated in self._uncertain.joint]
        taken = {name for group in groups for name in group}
        groups += [[name] for name in self._places if name not in taken]
        if self.tolerance.size and "tolerance" in self.groups:
            groups.append(["tolerance"])
        members = {", ".join(group): group for group in groups}
        return members | {SIMULATION: [FORM, NOISE, COEFFICIENTS, "score"]}

    def outcome(self, draws: Draws) -> tuple[FloatArray, FloatArray]:
        """Return Q at the case's highest load, and whether the case fails, both (n,)."""
        units = median_units(self.scene)
        highest = max(self.value.case.loads, key=lambda load: load.p_over_E(units)[0])
        Q, failed = np.full(len(draws["score"]), 2.0), np.zeros(len(draws["score"]))
        for here, which, placed in self._placed(draws):
            error = draws["score"][here]
            low, high = placed.window(self.value.case)
            failed[here] = ~((low < error) & (error <= high))
            count, reached, alive = 4, np.full(len(which), 2.0), np.ones(len(which), dtype=bool)
            while (alive := alive & (error <= placed.threshold(count, highest))).any():
                reached += 2 * alive
                count += 2
            Q[here] = reached
        return Q, failed

    def probability(self, draws: Draws) -> FloatArray:
        """Return the probability of the case for each draw, over errors of loads, shape (n,)."""
        values = np.empty(len(draws["score"]))
        for here, _, placed in self._placed(draws):
            values[here] = placed.probability(self.value.case)
        return values

    @property
    def _uncertain(self) -> Uncertain:
        return self.scene.uncertain or Uncertain({}, {})

    @property
    def _has_drawn_widths(self) -> bool:
        return bool(self.tolerance.size) and not self.tolerance.is_worst

    @property
    def _places(self) -> list[str]:
        joint = [name for correlated in self._uncertain.joint for name in correlated.of]
        return list(dict.fromkeys([*self._uncertain.sources, *joint]))

    def _placed(self, draws: Draws) -> list[tuple[BoolArray, IntArray, PlacedDraws]]:
        """Return for each posterior a mask of draws, their posterior draws, and their loads."""
        n = len(draws["score"])
        bodies = Bodies.draw(self.scene, self.tolerance, n, 0, draws)
        forms = np.array([loads.loads.fit.form.name for loads, _ in self.loads])
        weights = np.array([weight for _, weight in self.loads])
        names = list(dict.fromkeys(forms))
        by_form = np.array([weights[forms == name].sum() for name in names])
        form = _picked(draws[FORM], by_form)
        placed = []
        for i, name in enumerate(names):
            of_form = np.flatnonzero(forms == name)
            noise = _picked(draws[NOISE], weights[of_form])
            for k, j in enumerate(of_form.tolist()):
                here = (form == i) & (noise == k)
                if not here.any():
                    continue
                loads = self.loads[j][0]
                place = (draws[COEFFICIENTS][here] * len(loads.loads)).astype(np.int64)
                which = self._order(loads)[place]
                part = PosteriorDraws(loads, 1.0, which, bodies.subset(here))
                placed.append((here, which, PlacedDraws(part, *self.texture, self.value.corner)))
        return placed

    def _order(self, loads: RatioLoads) -> IntArray:
        """Return the order of a posterior's draws by load, which is comparable between forms."""
        (a, b), case = self.texture, self.value.case
        count = max([4, *(n for n, _ in (*case.at_least, *case.below))])
        location, _ = loads.at_count(count, slice(None), a / (a + b))
        return np.argsort(location, kind="stable")


def _picked(uniform: FloatArray, weights: FloatArray) -> IntArray:
    """Return the index that each uniform number picks among weights."""
    return np.searchsorted(np.cumsum(weights / weights.sum())[:-1], uniform, side="right")


def drawn_check(sources: Sources, goal: Goal, seed: int) -> Json:
    """Estimate the probability of a goal's worst case (or sd of Q) from independent draws."""
    n = _N_CHECK
    Q, failed = sources.outcome(sources.draw(n, seed))
    if goal.is_spread:
        value, fourth = float(Q.std()), float(((Q - Q.mean()) ** 4).mean())
        se = math.sqrt(max(fourth - value**4, 0.0) / n) / (2 * value) if value else 0.0
    else:
        value = 1 - float(failed.mean())
        # If no draw or every draw meets the goal, the error is as if one draw differed.
        se = math.sqrt(max(value * (1 - value), 1 / n) / n)
    return {"goal": goal.text, "n": n, "probability": value, "se": se}


def sobol_shares(sources: Sources, seed: int) -> pd.DataFrame:
    """Return the share of each group in the variance of Q, and in that of failure.

    Returns
    -------
    pandas.DataFrame
        Columns of, source, first_order (alone), total_order (with all interactions), and their
        standard errors. An output with a standard error above 0.1, such as rare failures, has no
        rows.
    """
    groups = sources.groups
    sample, other = (sources.draw(N_DRAW, seed_of_draws) for seed_of_draws in (seed, seed + 1))
    mixed = [sample | {name: other[name] for name in names} for names in groups.values()]
    # Each array has shape (output, draw).
    f_A, f_B, *f_AB = (np.stack(sources.outcome(draws)) for draws in (sample, other, *mixed))
    rows = []
    for i, output in enumerate(("Q", "failure")):
        f = np.stack([f_A[i], f_B[i]])
        if not np.ptp(f):
            continue
        mixed_f = np.stack(f_AB)[:, i]
        func = {"f_A": f[:1], "f_B": f[1:], "f_AB": mixed_f[:, None]}
        indices = stats.sobol_indices(func=func, n=N_DRAW)
        first, total = np.ravel(indices.first_order), np.ravel(indices.total_order)
        # Both indices are ratios of means, whose errors follow to first order.
        A, B = f - f.mean()
        AB, variance = mixed_f - f.mean(), (A**2 + B**2) / 2
        residuals = (
            B * (AB - A) - np.outer(first, variance),
            (AB - A) ** 2 / 2 - np.outer(total, variance),
        )
        se = np.std(residuals, axis=-1) / variance.mean() / math.sqrt(N_DRAW)
        if se.max() < _MAX_SE:
            columns = zip(first, se[0], total, se[1], strict=True)
            rows += [(output, name, *row) for name, row in zip(groups, columns, strict=True)]
    names = ["of", "source", "first_order", "first_order_se", "total_order", "total_order_se"]
    return pd.DataFrame(rows, columns=names)


def what_to_measure(sources: Sources, seed: int) -> pd.DataFrame:
    """Return how the goal's probability changes if one source is known better.

    Returns
    -------
    pandas.DataFrame
        Columns measure, spread_left (share of the source's sd that remains: 0, a perfect
        measurement, or 0.5), resolved (expected share of the variance of meeting the goal that is
        removed), probability_low and probability_high (90 % interval of the probability after the
        measurement). The most informative measurement is first.
    """
    rows = []
    measurements = enumerate(sources.measurable.items(), start=1)
    for (k, (name, members)), left in product(measurements, _SPREADS_LEFT):
        if left and not sources.may_be_measured_in_part(members):
            continue
        draws = sources.draw_measured(members, left, seed + 2 * k)
        met = 1 - sources.outcome(draws)[1] if name == SIMULATION else sources.probability(draws)
        within = met.reshape(_N_OUTER, N_INNER)
        share = within.mean(axis=1)
        total = share.mean() * (1 - share.mean())
        noise = within.var(axis=1, ddof=1).mean() / N_INNER
        resolved = (share.var(ddof=1) - noise) / total if total else 0.0
        low, high = np.quantile(share, _QUANTILES)
        rows.append((name, left, min(max(resolved, 0.0), 1.0), low, high))
    frame = pd.DataFrame(
        rows, columns=["measure", "spread_left", "resolved", "probability_low", "probability_high"]
    )
    return frame.sort_values(
        ["spread_left", "resolved"], ascending=[True, False], kind="stable", ignore_index=True
    )
