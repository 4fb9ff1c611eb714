"""The study of a plan's estimates: scenes spread over the space, and what it calls honest."""

import dataclasses
import math

import numpy as np
import pytest

from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.scene.estimates import plan
from studies.plan import check_plans, sobol_scenes

EFFECTS = ["ridges", "offset", "groove floor", "corner radius"]
QUICK = (0, 4, 9, 10)  # few ridges, loose accuracies
FLOORED = 10  # whose floor changes loads by more than wanted


@pytest.fixture(scope="module")
def scenes():
    return sobol_scenes(16)


@pytest.fixture(scope="module")
def checked(scenes):
    return check_plans([scenes[i] for i in QUICK])


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


def test_check_plans__finds_estimates_honest(checked):
    assert checked["scene"].tolist() == [number for number in (1, 2, 3, 4) for _ in EFFECTS]
    assert checked["effect"].tolist() == EFFECTS * len(QUICK)
    assert checked["honest"].all()
    # What honest means, from the columns alone.
    left_out = checked[~checked["simulated"]]
    assert (left_out["true_change"] <= left_out["relative"]).all()
    most = 10 * np.maximum(checked["true_change"], 0.01 * checked["relative"])
    assert (checked["estimate"] <= most).all()
    assert checked["simulated"].nunique() == 2


def test_check_plans__true_change_is_that_of_the_loads_with_and_without(checked, scenes):
    number, scene = QUICK.index(FLOORED) + 1, scenes[FLOORED]
    (texture,) = scene.textures
    own = checked[checked["scene"] == number].set_index("effect")
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

    monkeypatch.setattr("studies.plan.plan", enlarged)
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
