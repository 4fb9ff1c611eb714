"""Which effects a scene calls for: estimates against true changes found without them."""

import math

import numpy as np
import pandas as pd
import pytest

from ridgebayes import Scene, generate, plan, read_table
from ridgebayes.contact import halfplane, hertz
from ridgebayes.contact.contact_solution import solve_contact
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.scene.effects import plan_table
from ridgebayes.scene.scene import Texture
from ridgebayes.table.datafiles import CALCULIX_FE, data_path

A, B, P = 0.02, 0.03, 0.006
DEEPEST = 1.9e-3  # about how deep the surface hangs into the middle groove of (A, B) at P
FURTHER = {
    "offset": {"offset": 0.1},
    "groove floor": {"groove_depth_over_R": 0.6 * DEEPEST},
    "corner radius": {"corner_radius_over_R": 0.2 * A},
}
FINITE_BODY = "finite body and large deformation"


def scene_with(a=A, b=B, *, p_over_E=P, nu=0.5, relative=None, friction=0.0, **texture):
    texture = Texture(a_over_R=a, b_over_R=b, **texture)
    return Scene(
        textures=(texture,), p_over_E=p_over_E, nu=nu, relative=relative, friction=friction
    )


def planned(*widths, **given):
    (one,) = plan(scene_with(*widths, **given))
    return one, {effect.name: effect for effect in one.effects}


def reduced(p_over_E, nu=0.5):
    return 4 / math.pi * (1 - nu**2) * p_over_E


def true_change(one, other, W_max):
    """Largest relative difference of the events of two profiles under a load."""
    loads = []
    for profile in (one, other):
        found = reaching_loads(profile, W_max=1.5 * W_max, rel_tol=1e-7)
        assert set(found.status) == {"ok"}
        loads.append(dict(zip(found.Q.tolist(), found.W.tolist(), strict=True)))
    shared = [Q for Q in loads[0] if Q in loads[1] and min(each[Q] for each in loads) <= W_max]
    assert shared
    return max(abs(loads[1][Q] / loads[0][Q] - 1) for Q in shared)


def test_plan_table__has_exactly_these_columns_and_a_row_an_effect():
    textures = (Texture(a_over_R=A, b_over_R=B), Texture(a_over_R=0.032, b_over_R=0.01))
    plans = plan(Scene(textures=textures, p_over_E=P))
    table = plan_table(plans)
    assert list(table.columns) == [
        "effect",
        "number",
        "estimated_rel_change",
        "simulated",
        "reason",
        "cost_s",
        "texture",
    ]
    assert table["effect"].tolist() == 2 * [
        "ridges",
        "partial contact",
        "offset",
        "groove floor",
        "corner radius",
        "Poisson's ratio",
        FINITE_BODY,
        "material",
        "friction",
        "adhesion",
        "viscoelasticity",
        "compliance of the ridges",
        "third dimension",
    ]
    assert table["texture"].tolist() == 13 * ["a0.02_b0.03"] + 13 * ["a0.032_b0.01"]
    assert table["texture"].isin(generate(Scene(textures=textures)).frame["texture"]).all()
    assert table["reason"].str.len().gt(0).all()
    assert list(plan_table([]).columns) == list(table.columns)


def test_plan__of_what_is_not_there_is_no_effect():
    _, effects = planned()
    for name in FURTHER:
        assert (effects[name].estimate, effects[name].simulated) == (0.0, False)


@pytest.mark.parametrize("name", FURTHER)
def test_plan__simulates_what_is_above_the_wanted_accuracy_and_only_that(name):
    field = {"offset": "offset", "groove floor": "depth", "corner radius": "corner"}[name]
    (value,) = FURTHER[name].values()
    effects = planned(**FURTHER[name])[1]
    estimate = effects[name].estimate
    assert 1e-4 < estimate < 0.5
    # Neglected together with the body's deformation, by half as much again as both estimates.
    together = 1.5 * (estimate + effects[FINITE_BODY].estimate)
    one, effects = planned(**FURTHER[name], relative=1.001 * together)
    assert not effects[name].simulated
    assert "within the required" in effects[name].reason
    assert one.profile == Profile(A, B)
    one, effects = planned(**FURTHER[name], relative=0.999 * together)
    assert effects[name].simulated
    assert "above the required" in effects[name].reason
    assert getattr(one.profile, field) == value
    # Estimates do not depend on the required accuracy.
    assert effects[name].estimate == estimate


def test_plan__weighs_together_what_it_neglects():
    both = FURTHER["offset"] | {"corner_radius_over_R": 0.4 * A}
    sizes = {name: planned(**both)[1][name].estimate for name in ("offset", "corner radius")}
    large, small = sorted(sizes, key=sizes.get, reverse=True)
    # Each of them alone would be neglected.
    relative = 1.5 * sizes[large] + 0.75 * sizes[small]
    effects = planned(**both, relative=relative)[1]
    assert (effects[large].simulated, effects[small].simulated) == (True, False)
    assert "with all neglected effects above the required" in effects[large].reason


@pytest.mark.parametrize(("a", "b", "nu"), [(A, B, 0.5), (0.032, 0.01, 0.3), (0.012, 0.03, 0.0)])
def test_plan__says_of_ridges_the_exact_difference_of_two_solutions(a, b, nu):
    _, effects = planned(a, b, nu=nu)
    ridged = halfplane.transition_loads(a, b, 32).p_over_E(a + b, nu=nu)
    smooth = hertz.transition_load(4 + 2 * np.arange(32), a, b, nu=nu)
    under = ridged <= P
    expected = np.max(np.abs(smooth[under] / ridged[under] - 1))
    # Tolerance: the plan solves to 1e-6, this to 1e-8.
    assert effects["ridges"].estimate == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(("a", "b", "p"), [(A, B, P), (0.012, 0.03, 0.004)])
def test_plan__leaves_out_a_floor_below_the_deepest_penetration_which_changes_nothing(a, b, p):
    x = np.linspace(0.0, 0.5 * b, 301)  # half of the middle groove, where it is deepest
    deepest = -solve_contact(Profile(a, b), reduced(p)).pressing.surface(x).min()
    without = reaching_loads(Profile(a, b), W_max=reduced(p))
    below = reaching_loads(Profile(a, b, depth=1.01 * deepest), W_max=reduced(p))
    assert np.array_equal(below.Q, without.Q)
    np.testing.assert_allclose(below.W, without.W, rtol=2e-8)  # tolerance: 1e-8 of each
    effect = planned(a, b, p_over_E=p, groove_depth_over_R=1.01 * deepest)[1]["groove floor"]
    assert (effect.estimate, effect.simulated) == (0.0, False)
    assert effect.reason.endswith("the floor is not touched")
    # Tolerance: the plan presses to 1e-5.
    assert effect.number == pytest.approx(1 / 1.01, rel=1e-4)
    # One well above it does change loads, and is said to.
    assert true_change(Profile(a, b), Profile(a, b, depth=0.6 * deepest), reduced(p)) > 0.01
    assert planned(a, b, p_over_E=p, groove_depth_over_R=0.6 * deepest)[1]["groove floor"].simulated


@pytest.mark.slow
@pytest.mark.parametrize(
    ("a", "b", "depth", "corner", "p"),
    [
        (0.02, 0.03, 0.0008, 0.0, 0.01),
        (0.012, 0.03, 0.001, 0.0, 0.004),
        (0.032, 0.01, math.inf, 0.004, 0.01),
        (0.02, 0.02, math.inf, 0.006, 0.006),
    ],
)
def test_plan__estimates_floor_and_corners_as_large_as_they_are(a, b, depth, corner, p):
    given = {"corner_radius_over_R": corner}
    given |= {"groove_depth_over_R": depth} if math.isfinite(depth) else {}
    _, effects = planned(a, b, p_over_E=p, relative=1e-3, **given)
    effect = effects["corner radius" if corner else "groove floor"]
    true = true_change(Profile(a, b), Profile(a, b, depth, corner), reduced(p))
    assert true > 0.01
    assert 0.5 * true <= effect.estimate <= 2 * true


@pytest.mark.slow
def test_plan__estimates_floor_and_corners_beside_each_other():
    a, b, depth, corner = 0.02, 0.02, 6e-4, 1e-3
    _, effects = planned(a, b, groove_depth_over_R=depth, corner_radius_over_R=corner)
    both, sharp = Profile(a, b, depth, corner), Profile(a, b)
    for name, other in (
        ("groove floor", Profile(a, b, math.inf, corner)),
        ("corner radius", Profile(a, b, depth)),
    ):
        alone = Profile(a, b, depth) if name == "groove floor" else Profile(a, b, math.inf, corner)
        true = max(true_change(other, both, reduced(P)), true_change(sharp, alone, reduced(P)))
        assert 0.5 * true <= effects[name].estimate <= 2 * true


def test_plan__takes_a_path():
    path = data_path("scenes/sharp_pair.toml")
    pd.testing.assert_frame_equal(plan_table(plan(path)), plan_table(plan(Scene.from_toml(path))))


def test_plan__looks_at_the_load_of_the_texture_before_that_of_the_scene():
    given = ({"max_p_over_E": P, "p_over_E": 0.02}, {}, {"p_over_E": 0.02})
    # As tables, in which an unknown number is equal to an unknown number.
    own, scenes, larger = (plan_table([planned(**one)[0]]) for one in given)
    pd.testing.assert_frame_equal(own, scenes, check_exact=True)
    assert not own.equals(larger)


def test_plan__says_of_the_finite_body_what_finite_elements_find():
    frame = read_table(data_path(CALCULIX_FE)).frame
    frame = frame[frame["role"] == "calibration"]
    assert len(frame) == 8
    for row in frame.to_dict("records"):
        a, b, nu = row["a_over_R"], row["b_over_R"], row["nu"]
        k = row["Q"] // 2 - 1
        half_plane = halfplane.transition_loads(a, b, k).p_over_E(a + b, nu=nu)[-1]
        found = abs(row["p_over_E"] / half_plane - 1)
        _, effects = planned(a, b, nu=nu, p_over_E=half_plane * (1 + 1e-6))
        # A factor, not a tolerance: the estimate is of the order of the truth.
        assert 1 / 2 <= effects[FINITE_BODY].estimate / found <= 2


def test_plan__says_of_friction_at_most_that_of_full_stick():
    sizes = [planned(friction=f, nu=0.0)[1]["friction"].estimate for f in (0.1, 0.2, 0.5, 2.0)]
    assert sizes[1] == pytest.approx(2 * sizes[0], rel=1e-12)  # rounding
    # A flat punch that sticks: stiffer by (1 - nu) ln(3 - 4 nu)/(1 - 2 nu), ln 3 at nu = 0.
    assert sizes[2] == sizes[3] == pytest.approx(math.log(3) - 1, rel=1e-12)  # rounding
    effect = planned(friction=0.5, nu=0.0, relative=0.01)[1]["friction"]
    assert effect.simulated
    assert effect.reason.endswith("above the required 1 %: finite elements")
