"""Scenes at large deformation: which solver a plan chooses, and what it says of its loads."""

import math

import numpy as np
import pandas as pd
import pytest

from ridgebayes import InputError, Scene, contact_at_loads, generate, plan, ridge_forces
from ridgebayes.contact import two_scale
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.contact.two_scale import CHECKED, REACH, load_of, relative_error
from ridgebayes.scene.scene import Texture
from ridgebayes.table.datafiles import data_path

A, B = 0.0625, 0.05
HARD = Scene.of([(A, B)], p_over_E=0.45, relative=0.01)


def test_generate__two_scale_loads_are_the_half_planes_at_large_deformation():
    scene = Scene.of([(A, B)], p_over_E=0.15)
    found = generate(scene, solver="two-scale").frame
    half_plane = generate(scene, solver="half-plane").frame
    n = len(found)
    expected = load_of(half_plane["p_over_E"][:n])
    np.testing.assert_allclose(found["p_over_E"], expected, rtol=1e-8)  # the tolerance of loads
    np.testing.assert_allclose(found["rel_se"], relative_error(expected, Profile(A, B)), rtol=1e-6)
    # A load above the scene's at large deformation is not below it at small strain.
    assert len(half_plane) >= n
    assert set(found["status"]) == {"ok"}
    assert found["source"].str.contains("two-scale effects=ridges.finite-body").all()


@pytest.mark.parametrize("texture", [{"corner_radius_over_R": 0.1 * A}, {"offset": 0.2}])
def test_generate__two_scale_takes_corners_and_offsets_along(texture):
    scene = Scene(textures=(Texture(a_over_R=A, b_over_R=B, **texture),), p_over_E=0.05)
    found, half_plane = (generate(scene, solver=one).frame for one in ("two-scale", "half-plane"))
    same = half_plane["p_over_E"][: len(found)]
    np.testing.assert_allclose(found["p_over_E"], load_of(same), rtol=1e-7)


def test_generate__says_which_loads_nobody_has_checked():
    frame = generate(HARD).frame
    assert frame["solver"].unique().tolist() == ["two-scale"]
    beyond = frame["p_over_E"] > CHECKED
    assert beyond.any()
    assert (frame["status"][~beyond] == "ok").all()
    assert frame["status"][beyond].str.startswith("not checked").all()
    assert (np.diff(frame["rel_se"]) > 0).all()


@pytest.mark.parametrize("relative", [None, 0.01])
def test_generate__refuses_a_load_that_no_solver_reaches(relative):
    scene = Scene.of([(A, B)], p_over_E=0.6, relative=relative)
    with pytest.raises(InputError, match=r"p/E = 0\.6; expected at most p/E = 0\.5"):
        generate(scene)
    assert len(generate(scene, solver="half-plane").frame)


@pytest.mark.parametrize(
    ("widths", "p", "relative", "solver"),
    [
        ((0.02, 0.1), 0.002, 0.01, "half-plane"),
        ((0.02, 0.1), 0.08, 0.01, "two-scale"),
        ((0.02, 0.1), 0.08, 1e-4, "cylinder-fe"),
        ((0.02, 0.1), 0.3, 1e-4, "two-scale"),
        ((0.02, 0.1), 0.08, None, "half-plane"),
        ((0.02, 0.1), 0.2, None, "two-scale"),
        ((5e-4, 5e-4), 0.08, 0.01, "two-scale"),  # with 390 transitions
    ],
)
def test_plan__chooses_the_cheapest_solver_right_to_the_accuracy(widths, p, relative, solver):
    (one,) = plan(Scene.of([widths], p_over_E=p, relative=relative))
    assert one.solver == solver
    named = {effect.name: effect for effect in one.effects}["finite body and large deformation"]
    assert named.simulated == (solver != "half-plane")


def test_contact_at_loads__counts_change_at_two_scale_loads():
    loads = generate(Scene.of([(A, B)], p_over_E=0.15), solver="two-scale").frame["p_over_E"]
    p = np.concatenate([loads * (1 - 1e-5), loads * (1 + 1e-5)])
    found = contact_at_loads(HARD, p, solver="two-scale")
    Q = 4 + 2 * np.arange(len(loads))
    assert found["Q"].tolist() == [*(Q - 2), *Q]
    assert (found["rel_se"] > 0).all()


def test_contact_at_loads__says_what_is_beyond():
    found = contact_at_loads(HARD, [0.1, 0.4, REACH * 1.01])
    assert [text.split(":")[0] for text in found["status"]] == ["ok", "not checked", "not computed"]
    assert found["half_width_over_R"].notna().tolist() == [True, True, False]
    assert math.isnan(found["rel_se"].iloc[2])


def test_contact_at_loads__takes_effects_at_its_loads_and_not_at_the_scenes():
    texture = Texture(a_over_R=0.02, b_over_R=0.06, groove_depth_over_R=0.002, max_p_over_E=0.001)
    scene = Scene(textures=(texture,), relative=0.01)
    found = contact_at_loads(scene, [0.02, 0.09])
    pd.testing.assert_frame_equal(found, contact_at_loads(scene, [0.02, 0.09], solver="two-scale"))
    # Large deformation does not press the surface below the floor that it touches.
    grooves = ridge_forces(scene, [0.02, 0.09])["penetration_over_R"]
    assert found["penetration_over_R"].max() == grooves.max() == 0.002


@pytest.mark.slow
@pytest.mark.parametrize("name", ["light_touch", "firm_grip", "hard_press"])
def test_generate__shipped_fingertips_run_to_their_load(name):
    scene = Scene.from_toml(data_path(f"scenes/fingertip_{name}.toml"))
    frame = generate(scene).frame
    assert set(frame["status"]) == {"ok"}
    assert (frame["rel_se"] < scene.relative).all() if "rel_se" in frame else True
    next_one = generate(scene.model_copy(update={"p_over_E": 1.5 * scene.p_over_E})).frame
    assert next_one["Q"].iloc[: len(frame)].tolist() == frame["Q"].tolist()


STIFF = ((0.5, 2.0), (0.5, 9.0))


@pytest.fixture
def narrowed(monkeypatch):
    """Bodies of another material, 0.2 p narrower than neo-Hookean ones; no finite elements."""
    found = np.array([0.0, 0.0, -0.2, 0.0]), 0.4
    monkeypatch.setattr(two_scale, "stiffening_of", lambda nu, ogden: found)


def of_material(ogden=STIFF, **given):
    return Scene.of([(A, B)], p_over_E=0.02, **given).model_copy(update={"ogden": ogden})


def test_plan__weighs_the_material(narrowed):
    effects = {}
    for relative in (None, 0.005, 0.3):
        (one,) = plan(of_material(relative=relative))
        effects[relative] = next(effect for effect in one.effects if effect.name == "material")
        assert ("material" in one.simulated) == (relative != 0.3)
        assert one.solver == ("half-plane" if relative == 0.3 else "two-scale")
        assert "finite body and large deformation" in one.simulated or relative == 0.3
    # 1/(1 - 0.2 p)^2 at the load of the last transition.
    assert pytest.approx(effects[None].estimate, rel=0.1) == 0.4 * 0.02
    assert effects[None].number == 5.5
    (soft,) = plan(Scene.of([(A, B)]))
    effect = next(effect for effect in soft.effects if effect.name == "material")
    assert (effect.number, effect.estimate, effect.simulated) == (2.0, 0.0, False)


@pytest.mark.parametrize("solver", ["auto", "two-scale"])
def test_generate__takes_the_material_along(narrowed, solver):
    found = generate(of_material(), solver=solver).frame
    half_plane = generate(of_material(), solver="half-plane").frame["p_over_E"][: len(found)]
    expected = load_of(half_plane, 0.5, STIFF)
    np.testing.assert_allclose(found["p_over_E"], expected, rtol=1e-8)  # the tolerance of loads
    assert (expected > load_of(half_plane)).all()
    assert found["source"].str.contains("effects=ridges.material").all()


def test_generate__refuses_loads_beyond_a_materials_own_reach(narrowed):
    scene = of_material().model_copy(update={"p_over_E": 0.45})
    with pytest.raises(InputError, match=r"expected at most p/E = 0\.4, as far as its material"):
        generate(scene, solver="two-scale")


@pytest.mark.parametrize("relative", [None, 0.01])
def test_generate__refuses_high_loads_of_bodies_softer_in_volume_than_were_computed(relative):
    scene = Scene.of([(A, B)], p_over_E=0.2, nu=0.2, relative=relative)
    with pytest.raises(InputError, match=r"at most p/E = 0\.1: .* poissons_ratio is under 0\.3"):
        generate(scene)
    assert len(generate(scene, solver="half-plane").frame)


def test_contact_at_loads__computes_no_high_loads_of_such_bodies():
    scene = Scene.of([(A, B)], nu=0.2)
    low, high = contact_at_loads(scene, [0.02, 0.2])["status"]
    assert low == "ok"
    assert high.startswith("not computed")
