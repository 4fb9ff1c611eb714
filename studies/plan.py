"""Estimates of effects against true changes: ``python -m studies.plan``.

It plans scenes spread over the space and switches each effect over. ``plan-check.csv`` has a row
for each scene and effect, ``plan-check.png`` shows estimates against true changes.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy.stats import qmc

from ridgebayes._types import FloatArray, Rng
from ridgebayes.contact import halfplane, hertz
from ridgebayes.contact.contact_solution import load_factor
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.drawing.style import COLOURS, WIDTH, as_bytes, new_figure, shared_legend, styled
from ridgebayes.runtime.randomness import seed_of
from ridgebayes.scene.effects import Plan, full_profile
from ridgebayes.scene.estimates import plan
from ridgebayes.scene.scene import Scene, Texture

_PLACE = ["a_over_R", "b_over_R", "depth_over_R", "corner_over_R", "offset", "nu", "p_over_E"]
_FOUND = ["effect", "number", "estimate", "simulated", "true_change", "honest"]
CHECK_COLUMNS = ["scene", *_PLACE, "relative", *_FOUND]
TOO_LARGE = 10.0  # times the truth: an estimate that is more says nothing
# Changes under a hundredth of the wanted accuracy need no exact estimate.
_NEGLIGIBLE = 0.01
_TOLERANCE = 1e-6
_OUT = Path(__file__).parents[1] / "docs" / "validation"
_FIELDS = {"groove floor": "depth", "corner radius": "corner", "offset": "offset"}
_MARKS = {
    "ridges": ("D", COLOURS["hybrid"]),
    "offset": ("o", COLOURS["modified"]),
    "groove floor": ("s", COLOURS["power-law"]),
    "corner radius": ("^", COLOURS["classic"]),
}


def sobol_scenes(n: int = 32, *, rng: Rng = 0) -> list[Scene]:
    """Return scenes of one texture each, spread by a Sobol sequence.

    Parameters
    ----------
    n : int, optional
        How many; a power of two is spread most evenly.
    rng : int or numpy.random.Generator, optional
        Seed of the sequence's scrambling.

    Returns
    -------
    list of Scene
        Ridges of 0.003 to 0.05 R, grooves 0.1 to 5 times as wide, a floor at 0.01 to 0.3 of the
        groove's width, corners of 0.001 to 0.4 of the ridge's width (twice the floor's depth at
        most), an offset of 0.0003 to 0.5 pitches, loads that reach 1 to 6 pitches, accuracies of
        0.3 to 10 %.
    """
    sequence = qmc.Sobol(8, rng=np.random.default_rng(seed_of(rng)))
    points = sequence.random_base2(math.ceil(math.log2(n)))[:n]
    low = np.array([0.003, 0.1, 0.01, 0.001, 0.0003, 0.0, 1.2, 0.003])
    high = np.array([0.05, 5.0, 0.3, 0.4, 0.5, 0.5, 6.0, 0.1])
    values, logarithmic = low + points * (high - low), [0, 1, 2, 3, 4, 7]
    least, most = np.log(low[logarithmic]), np.log(high[logarithmic])
    values[:, logarithmic] = np.exp(least + points[:, logarithmic] * (most - least))
    return [_scene(row) for row in values.tolist()]


def _scene(place: Sequence[float]) -> Scene:
    a, groove, depth, corner, offset, nu, pitches, relative = place
    b = groove * a
    texture = Texture(
        a_over_R=a,
        b_over_R=b,
        groove_depth_over_R=depth * b,
        corner_radius_over_R=min(corner * a, 2 * depth * b),
        offset=offset,
    )
    reach = min(pitches * (a + b), 0.3)
    load = float(hertz.load_of_half_width(reach, nu=nu))
    first = halfplane.transition_loads(a, b, 1).p_over_E(a + b, nu=nu)[0]
    return Scene(
        textures=(texture,), nu=nu, p_over_E=max(load, 1.05 * float(first)), relative=relative
    )


def check_plans(scenes: list[Scene]) -> pd.DataFrame:
    """Switch each effect of each scene over, and compare the true change with its estimate.

    Parameters
    ----------
    scenes : list of Scene
        Scenes of one texture each.

    Returns
    -------
    pandas.DataFrame
        Columns `CHECK_COLUMNS`, a row for each scene and effect. `true_change` is the largest
        relative change of a transition load when the effect alone is switched over, all else as
        planned; NaN where a solution failed. `honest`: what is neglected changes loads by no more
        than the accuracy wanted, and no estimate is over ten times the true change, unless both
        are under a hundredth of that accuracy.
    """
    rows = []
    for number, scene in enumerate(scenes, start=1):
        rows += _rows(number, scene, plan(scene)[0])
    return pd.DataFrame(rows, columns=CHECK_COLUMNS)


def _rows(number: int, scene: Scene, one: Plan) -> list[list[object]]:
    """Return a row of `CHECK_COLUMNS` for each effect that can be switched over."""
    texture = one.texture
    place: list[object] = [texture.a_over_R, texture.b_over_R, texture.groove_depth_over_R]
    place += [texture.corner_radius_over_R, texture.offset, scene.nu, scene.p_over_E]
    given = full_profile(texture)
    planned = one.profile or Profile(texture.a_over_R, texture.b_over_R)
    W_max = load_factor(scene.nu) * scene.highest_load(texture)
    base = _loads(planned, 1.3 * W_max)
    rows = []
    for effect in one.effects:
        if effect.name == "ridges":
            true = effect.estimate  # it is the difference of two solutions, nothing is estimated
        elif effect.name in _FIELDS:
            field = _FIELDS[effect.name]
            without = Profile(texture.a_over_R, texture.b_over_R)
            source = without if effect.simulated else given
            other = replace(planned, **{field: getattr(source, field)})
            true = _change(base, _loads(other, 1.3 * W_max), W_max)
        else:
            continue
        found = [effect.name, effect.number, effect.estimate, effect.simulated, true]
        honest = _honest(effect.estimate, true, scene, effect.simulated)
        rows.append([number, *place, scene.relative, *found, honest])
    return rows


def _honest(estimate: float, true: float, scene: Scene, simulated: bool) -> bool:
    wanted = scene.relative or _TOLERANCE
    if math.isnan(true) or (not simulated and not true <= wanted):
        return False
    floor = _NEGLIGIBLE * wanted
    return not estimate > TOO_LARGE * max(true, floor)


def _loads(profile: Profile, W_max: float) -> dict[int, float]:
    """Return the load from which on at least Q ridges are touched, by Q."""
    found = reaching_loads(profile, W_max=W_max, rel_tol=_TOLERANCE)
    if not all(status == "ok" for status in found.status):
        return {}
    loads: dict[int, float] = {}
    for Q, W in zip(found.Q.tolist(), found.W.tolist(), strict=True):
        for count in range(3, Q + 1):
            loads.setdefault(count, W)
    return loads


def _change(base: dict[int, float], other: dict[int, float], W_max: float) -> float:
    """Return the largest relative change of a load that the scene asks for, at counts of both."""
    shared = [
        Q for Q in base if Q in other and Q >= 4 and Q % 2 == 0 and min(base[Q], other[Q]) <= W_max
    ]
    if not shared:
        return math.nan
    changes: FloatArray = np.array([other[Q] / base[Q] - 1 for Q in shared])
    return float(np.abs(changes).max())


@styled()
def plot_plan_check(frame: pd.DataFrame) -> Figure:
    """Draw estimates against true changes.

    Parameters
    ----------
    frame : pandas.DataFrame
        Columns of plan-check.csv.

    Returns
    -------
    matplotlib.figure.Figure
        Left: estimate over truth, between the truth itself and ten times it where honest; right:
        the true change of what was neglected, over the accuracy wanted.
    """
    figure = new_figure(WIDTH, 4.6)
    left, right = figure.subplots(1, 2)
    least = 1e-6
    for name, (marker, colour) in _MARKS.items():
        rows = frame[frame["effect"] == name]
        true = np.maximum(rows["true_change"].to_numpy(float), least)
        estimate = np.maximum(rows["estimate"].to_numpy(float), least)
        simulated = rows["simulated"].to_numpy(bool)
        for which, face in ((simulated, colour), (~simulated, "none")):
            left.plot(
                true[which],
                estimate[which],
                marker,
                color=colour,
                markerfacecolor=face,
                markersize=5,
                label=name if face != "none" else None,
            )
        off = rows[~simulated]
        wanted = off["relative"].to_numpy(float)
        share = np.maximum(off["true_change"].to_numpy(float), least * wanted) / wanted
        right.plot(wanted, share, marker, color=colour, markerfacecolor="none", markersize=5)
    ends = np.array([least, 3.0])
    left.plot(ends, ends, color="#000000", linewidth=0.8)
    left.plot(ends, 10 * ends, color="#000000", linewidth=0.8, linestyle=":")
    left.set(xlabel="true change", ylabel="estimate", ylim=(least / 2, 10))
    right.axhline(1, color="#000000", linewidth=0.8)
    right.set(xlabel="target accuracy", ylabel="true change of neglected effects over target")
    for axes in (left, right):
        axes.set(xscale="log", yscale="log")
        axes.minorticks_off()
    shared_legend(figure, left, at="upper", n_column=4)
    return figure


def main() -> None:
    """Plan and check the scenes, write the table and its figure, and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=32)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=_OUT)
    asked = parser.parse_args()
    frame = check_plans(sobol_scenes(asked.scenes, rng=asked.seed))
    asked.out.mkdir(parents=True, exist_ok=True)
    frame.to_csv(asked.out / "plan-check.csv", index=False)
    (asked.out / "plan-check.png").write_bytes(as_bytes(plot_plan_check(frame), "png"))
    print(f"{int(frame['honest'].sum())} of {len(frame)} estimates are reliable")


if __name__ == "__main__":
    main()
