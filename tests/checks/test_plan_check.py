"""The check of a plan's estimates: scenes spread over the space, and what it calls honest."""

import dataclasses
import math

import numpy as np
import pytest

from ridgebayes.checks.plan_check import check_plans, sobol_scenes
from ridgebayes.contact import halfplane, hertz
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.scene.estimates import plan

COLUMNS = [
    "scene",
    "a_over_R",
    "b_over_R",
    "depth_over_R",
    "corner_over_R",
    "offset",
    "nu",
    "p_over_E",
    "relative",
    "effect",
    "number",
    "estimate",
    "simulated",
    "true_change",
    "honest",
]
EFFECTS = ["ridges", "offset", "groove floor", "corner radius"]
QUICK = (0, 4, 9, 10)  # few ridges, loose accuracies
FLOORED = 10  # whose floor changes loads by more than wanted


@pytest.fixture(scope="module")
def scenes():
    return sobol_scenes(16)


@pytest.fixture(scope="module")
def checked(scenes):
    said = []
    return check_plans([scenes[i] for i in QUICK], progress=said.append), said


def coordinates(scene):
    """Where a scene lies between the ends of each stated range, 0 to 1; the load apart."""
    (texture,) = scene.textures
    a, b = texture.a_over_R, texture.b_over_R
    ends = [
        (a, 0.003, 0.05),
        (b / a, 0.1, 5.0),
        (texture.groove_depth_over_R / b, 0.01, 0.3),
        (texture.corner_radius_over_R / a, 0.001, 0.4),
        (texture.offset, 0.0003, 0.5),
        (scene.relative, 0.003, 0.1),
    ]
    places = [math.log(value / low) / math.log(high / low) for value, low, high in ends]
    return [*places, scene.nu / 0.5]


def test_sobol_scenes__lie_within_the_stated_ranges_and_fill_them():
    places = np.array([coordinates(scene) for scene in sobol_scenes(64, rng=3)])
    # Rounding: values go through a logarithm.
    assert places.min() >= -1e-12
    assert places.max() <= 1 + 1e-12
    # A Sobol sequence of 64 puts four points into each sixteenth of every coordinate.
    counts = [np.histogram(place, bins=16, range=(0, 1))[0] for place in places.T]
    # But for the fourth: a corner is no larger than a shallow floor lets it be.
    assert np.array_equal(np.delete(counts, 3, axis=0), np.full((6, 16), 4))
    for scene in sobol_scenes(64, rng=3):
        (texture,) = scene.textures
        corner, depth = texture.corner_radius_over_R, texture.groove_depth_over_R
        assert corner <= min(0.4 * texture.a_over_R, 2 * depth) * (1 + 1e-12)  # rounding


def test_sobol_scenes__reach_one_to_six_pitches_and_a_transition():
    pitches = []
    for scene in sobol_scenes(64):
        (texture,) = scene.textures
        a, b = texture.a_over_R, texture.b_over_R
        width = float(hertz.half_width(scene.p_over_E, nu=scene.nu))
        first = halfplane.transition_loads(a, b, 1).p_over_E(a + b, nu=scene.nu)[0]
        assert scene.p_over_E > first
        assert width <= 6.001 * (a + b)  # rounding
        assert width >= min(a + b, 0.3) * 0.999  # rounding
        pitches.append(width / (a + b))
    assert min(pitches) < 1.5
    assert max(pitches) > 5.5


def test_sobol_scenes__are_the_same_twice_and_others_with_another_seed():
    assert sobol_scenes(8, rng=5) == sobol_scenes(8, rng=5)
    assert sobol_scenes(8, rng=5) == sobol_scenes(16, rng=5)[:8]
    assert sobol_scenes(8, rng=5) != sobol_scenes(8, rng=6)
    assert sobol_scenes(8) == sobol_scenes(8, rng=0)


def test_check_plans__finds_estimates_honest(checked):
    found, _ = checked
    assert list(found.columns) == COLUMNS
    assert found["scene"].tolist() == [number for number in (1, 2, 3, 4) for _ in EFFECTS]
    assert found["effect"].tolist() == EFFECTS * len(QUICK)
    assert found["honest"].all()
    # What honest means, from the columns alone.
    left_out = found[~found["simulated"]]
    assert (left_out["true_change"] <= left_out["relative"]).all()
    most = 10 * np.maximum(found["true_change"], 0.01 * found["relative"])
    assert (found["estimate"] <= most).all()
    assert found["simulated"].nunique() == 2


def test_check_plans__says_of_each_row_which_scene_it_is(checked, scenes):
    found, said = checked
    assert said == [f"scene {number} of 4" for number in (1, 2, 3, 4)]
    for number, i in enumerate(QUICK, start=1):
        own, scene = found[found["scene"] == number], scenes[i]
        (texture,) = scene.textures
        for column, value in {
            "a_over_R": texture.a_over_R,
            "b_over_R": texture.b_over_R,
            "depth_over_R": texture.groove_depth_over_R,
            "corner_over_R": texture.corner_radius_over_R,
            "offset": texture.offset,
            "nu": scene.nu,
            "p_over_E": scene.p_over_E,
            "relative": scene.relative,
        }.items():
            assert set(own[column]) == {value}
        effects = {effect.name: effect for effect in plan(scene)[0].effects}
        for row in own.to_dict("records"):
            effect = effects[row["effect"]]
            assert (row["number"], row["estimate"], row["simulated"]) == (
                effect.number,
                effect.estimate,
                effect.simulated,
            )


def test_check_plans__true_change_is_that_of_the_loads_with_and_without(checked, scenes):
    found, _ = checked
    number, scene = QUICK.index(FLOORED) + 1, scenes[FLOORED]
    (texture,) = scene.textures
    own = found[found["scene"] == number].set_index("effect")
    assert own["simulated"].to_dict() == {
        "ridges": True,
        "offset": False,
        "groove floor": True,
        "corner radius": False,
    }
    sharp = Profile(texture.a_over_R, texture.b_over_R)
    planned = dataclasses.replace(sharp, depth=texture.groove_depth_over_R)
    round_too = dataclasses.replace(planned, corner=texture.corner_radius_over_R)
    W_max = 4 / math.pi * (1 - scene.nu**2) * scene.p_over_E

    def loads(profile):
        return reaching_loads(profile, W_max=1.3 * W_max).W

    for name, other in (("groove floor", sharp), ("corner radius", round_too)):
        one, another = loads(planned), loads(other)
        n = min(len(one), len(another))
        asked_for = np.minimum(one[:n], another[:n]) <= W_max
        expected = np.max(np.abs(another[:n] / one[:n] - 1)[asked_for])
        # Tolerance: the check solves to 1e-6, a change is the difference of two.
        assert own.loc[name, "true_change"] == pytest.approx(expected, abs=1e-5)


def test_check_plans__finds_out_estimates_that_are_far_too_large(scenes, monkeypatch):
    def enlarged(scene):
        (one,) = plan(scene)
        effects = [
            dataclasses.replace(effect, estimate=60 * effect.estimate) for effect in one.effects
        ]
        return [dataclasses.replace(one, effects=tuple(effects))]

    monkeypatch.setattr("ridgebayes.checks.plan_check.plan", enlarged)
    own = check_plans([scenes[FLOORED]]).set_index("effect")
    assert own["honest"].to_dict() == {
        "ridges": True,
        "offset": False,
        "groove floor": False,
        "corner radius": False,
    }


def test_check_plans__finds_out_estimates_that_neglect_too_much(scenes, monkeypatch):
    monkeypatch.setattr("ridgebayes.scene.estimates._SAFETY", 1e-3)
    own = check_plans([scenes[FLOORED]]).set_index("effect")
    assert own.loc["groove floor", "true_change"] > scenes[FLOORED].relative
    assert not own.loc["groove floor", "simulated"]
    assert not own.loc["groove floor", "honest"]


def test_check_plans__is_the_same_twice(checked, scenes):
    found, _ = checked
    again = check_plans([scenes[QUICK[0]]])
    assert again.equals(found[found["scene"] == 1])
