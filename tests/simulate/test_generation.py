import math

import numpy as np
import pytest

from ridgebayes import InputError, Scene, generate, read_table
from ridgebayes.contact import halfplane, hertz
from ridgebayes.contact.contact_solution import solve_contact
from ridgebayes.contact.cylinder import cylinder
from ridgebayes.contact.cylinder.cylinder import Transition
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.scene.scene import Texture
from ridgebayes.table.datafiles import PAPER_SWEEP, data_path


def scene_with(**texture):
    return Scene(textures=(Texture(a_over_R=0.032, b_over_R=0.01, **texture),))


def test_shipped_sweep_is_todays_output():
    shipped, today = read_table(data_path(PAPER_SWEEP)).frame, generate(Scene.paper()).frame
    for column in ("a_over_R", "b_over_R", "Q", "nu", "texture", "role", "solver", "status"):
        assert shipped[column].tolist() == today[column].tolist()
    # Algebra: the same equations under another BLAS; rounding is 1e-14.
    np.testing.assert_allclose(shipped["p_over_E"], today["p_over_E"], rtol=1e-12)


def test_rows_stop_at_the_load_and_include_it():
    third = generate(Scene.of([(0.032, 0.01)])).frame["p_over_E"].iloc[2]
    assert generate(Scene.of([(0.032, 0.01)], p_over_E=third)).frame["Q"].tolist() == [4, 6, 8]
    below = np.nextafter(third, 0.0)
    assert generate(Scene.of([(0.032, 0.01)], p_over_E=below)).frame["Q"].tolist() == [4, 6]


@pytest.mark.parametrize(("a", "b"), [(1e-5, 0.02), (0.012, 0.03), (0.03, 1e-3)])
def test_no_transition_below_the_load_is_missed(a, b):
    """Thin ridges are reached before a smooth body would pass as many pitches."""
    frame = generate(Scene.of([(a, b)], p_over_E=0.1)).frame
    loads = halfplane.transition_loads(a, b, 64).p_over_E(a + b)
    assert len(frame) == np.count_nonzero(loads <= 0.1)


def test_hertz_rows_are_the_closed_form():
    table = generate(Scene.of([(0.032, 0.01)], nu=0.3), solver="hertz")
    frame = table.frame
    expected = hertz.transition_load(frame["Q"], 0.032, 0.01, nu=0.3)
    np.testing.assert_allclose(frame["p_over_E"], expected, rtol=1e-15)  # algebra
    next_one = hertz.transition_load(frame["Q"].max() + 2, 0.032, 0.01, nu=0.3)
    assert frame["p_over_E"].max() <= 0.02 < next_one
    assert set(frame["solver"]) == {"hertz"}
    assert set(frame["nu"]) == {0.3}
    assert frame["source"].str.fullmatch(r"ridgebayes \S+ hertz effects=none").all()


@pytest.mark.parametrize(
    ("relative", "rel_tol", "used"),
    [(None, None, "1e-08"), (0.01, None, "1e-08"), (1e-10, None, "1e-10"), (1e-10, 1e-4, "0.0001")],
)
def test_tolerance_is_the_tightest_unless_given(relative, rel_tol, used):
    # A load so low that finite elements would not know better.
    scene = Scene.of([(0.032, 0.01)], p_over_E=0.001, relative=relative)
    table = generate(scene, rel_tol=rel_tol)
    assert table.frame["source"].iloc[0].endswith(f"rel_tol={used}")


def test_rows_that_missed_the_tolerance_say_so():
    frame = generate(Scene.of([(0.032, 0.01)]), rel_tol=1e-15).frame
    assert frame["status"].str.startswith("not converged").all()
    assert frame["p_over_E"].notna().all()


def test_rows_that_were_not_computed_stand_without_a_load(monkeypatch):
    halfplane._table.cache_clear()
    monkeypatch.setattr(halfplane, "MAX_UNKNOWNS", 30)
    frame = generate(Scene.of([(0.012, 0.01)])).frame
    monkeypatch.undo()
    halfplane._table.cache_clear()
    whole = generate(Scene.of([(0.012, 0.01)])).frame
    assert frame["Q"].tolist() == whole["Q"].tolist()
    missing = frame["p_over_E"].isna()
    assert 0 < missing.sum() < len(frame)
    assert (frame["status"] == "ok").tolist() == (~missing).tolist()
    assert frame["status"][missing].str.contains("over the cap").all()


def test_a_texture_no_solve_can_serve_does_not_vanish():
    frame = generate(Scene.of([(0.03, 1e-12)], p_over_E=0.01)).frame
    assert frame["Q"].tolist() == [4, 6, 8, 10]  # Hertz: 1.382 sqrt(0.01) is 4.6 pitches
    assert frame["p_over_E"].isna().all()


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        (scene_with(groove_depth_over_R=0.05), "groove floor"),
        (scene_with(corner_radius_over_R=1e-3), "corner radius"),
        (scene_with(offset=0.25), "offset"),
        (scene_with(offset="uniform"), "offset"),
    ],
)
def test_what_hertz_cannot_simulate_is_refused(scene, said):
    with pytest.raises(InputError, match=rf"textures\[1\]: {said}: is not simulated by 'hertz'"):
        generate(scene, solver="hertz")


@pytest.mark.slow
def test_small_strain_of_the_whole_cylinder_is_that_of_another_code():
    reference = read_table(data_path("fea/small_strain.csv")).frame
    reference = reference[
        (reference["solver"] == "small-strain half disk")
        & (reference["nu"] == 0.49)
        & (reference["a_over_R"] == 0.032)
        & (reference["p_over_E"] < 0.01)
    ]
    scene = Scene.of([(0.032, 0.01)], p_over_E=0.01, nu=0.49)
    frame = generate(scene, solver="cylinder-linear", accuracy="quick").frame
    assert frame["Q"].tolist() == reference["Q"].tolist() == [4, 6, 8]
    # Reference: 0.05 %; discretisation: as rel_se says.
    np.testing.assert_allclose(frame["p_over_E"], reference["p_over_E"], rtol=4.5e-3)
    assert set(frame["rel_se"]) == {4e-3}
    assert set(frame["solver"]) == {"cylinder-linear"}
    assert frame["source"].str.endswith("cylinder-linear effects=ridges+finite-body").all()


def test_small_strain_of_the_whole_cylinder_is_refused_where_it_knows_too_little():
    for changed, said in (({"offset": 0.25}, "offset"), ({"corner_radius_over_R": 1e-3}, "corner")):
        with pytest.raises(InputError, match=f"{said}.*: is not simulated by 'cylinder-linear'"):
            generate(scene_with(**changed), solver="cylinder-linear")
    with pytest.raises(InputError, match="elements at 24 edges a ridge; expected at most 40000"):
        generate(Scene.of([(0.001, 0.001)]), solver="cylinder-linear")
    with pytest.raises(InputError, match=r"no transition under p/E = 0\.0005"):
        generate(
            Scene.of([(0.06, 0.09)], p_over_E=5e-4), solver="cylinder-linear", accuracy="quick"
        )


def test_friction_that_changes_loads_is_refused_on_a_half_plane():
    textures = scene_with().textures
    with pytest.raises(InputError, match=r"friction = 0.3: changes loads by up to 0\.0"):
        generate(Scene(textures=textures, friction=0.3, nu=0.3), solver="half-plane")
    without = generate(Scene(textures=textures))
    incompressible = generate(Scene(textures=textures, friction=0.3))
    assert incompressible.digest() == without.digest()


@pytest.mark.slow
@pytest.mark.parametrize(
    "changed",
    [
        {"offset": 0.25},
        {"groove_depth_over_R": 3e-4},
        {"corner_radius_over_R": 2e-3},
        pytest.param(
            {"offset": -0.1, "corner_radius_over_R": 1e-3, "groove_depth_over_R": 5e-4},
            marks=pytest.mark.long,
        ),
    ],
)
def test_rows_of_other_effects_are_the_events_of_their_profile(changed):
    scene = scene_with(**changed)
    table = generate(scene, rel_tol=1e-6).frame
    texture = scene.textures[0]
    profile = Profile(
        texture.a_over_R,
        texture.b_over_R,
        texture.groove_depth_over_R or math.inf,
        texture.corner_radius_over_R,
        texture.offset,
    )
    # Each load is where the count of a separate solution changes.
    for Q, p in zip(table["Q"], table["p_over_E"], strict=True):
        counts = [
            solve_contact(profile, 4 / math.pi * 0.75 * p * (1 + change), rel_tol=1e-7).Q
            for change in (-1e-5, 1e-5)  # tolerance asked for: 1e-6
        ]
        assert counts[0] < Q == counts[1]
    assert set(table["offset_over_R"]) == {texture.offset * (texture.a_over_R + texture.b_over_R)}
    assert table["source"].str.contains("effects=ridges").all()


@pytest.mark.slow
def test_a_uniform_offset_is_curves_at_evenly_spaced_ones():
    table = generate(scene_with(offset="uniform"), rel_tol=1e-6).frame
    pitch = sum(scene_with().textures[0].model_dump()[name] for name in ("a_over_R", "b_over_R"))
    offsets = np.unique(table["offset_over_R"]) / pitch
    np.testing.assert_allclose(offsets, (2 * np.arange(8) + 1) / 32, rtol=1e-12)


@pytest.mark.slow
def test_auto_leaves_out_what_does_not_matter():
    # A corner of a hundredth of a ridge: under one per cent.
    scene = scene_with(corner_radius_over_R=2e-4)
    wanted = scene.model_copy(update={"relative": 0.02, "p_over_E": 0.01})
    loose, exact = generate(wanted), generate(wanted, solver="half-plane", rel_tol=1e-6)
    assert loose.frame["source"].str.contains("effects=ridges rel_tol").all()
    assert exact.frame["source"].str.contains(r"effects=ridges\+corner-radius").all()
    ratio = loose.frame["p_over_E"] / exact.frame["p_over_E"]
    assert 1e-5 < abs(ratio - 1).max() < 0.02


@pytest.mark.slow
def test_finite_elements_and_two_scales_agree_where_the_body_is_large_beside_its_contact():
    """The half-plane is off by more than 1 % here, and both of them by less."""
    scene = Scene.of([(0.06, 0.02)], p_over_E=0.02, nu=0.45, relative=0.01)
    chosen, frame = generate(scene).frame, generate(scene, solver="cylinder-fe").frame
    assert chosen["solver"].unique().tolist() == ["two-scale"]
    error = np.hypot(chosen["rel_se"], frame["rel_se"])
    assert (np.abs(chosen["p_over_E"] / frame["p_over_E"] - 1) < 1.96 * error).all()
    assert frame["source"].str.contains(r"effects=ridges\+finite-body").all()
    assert (frame["rel_se"] == 1e-3).all()
    assert frame["status"].tolist() == ["ok", "ok"]
    half_plane = generate(scene, solver="half-plane").frame
    assert "rel_se" not in half_plane or not half_plane["rel_se"].any()
    ratio = frame["p_over_E"].to_numpy() / half_plane["p_over_E"].to_numpy()
    # Discretisation: finite elements are right to 0.2 %. The surface of a compressible body draws
    # in by (1 - 2 nu)(1 + nu) = 0.145 times its pressure p/w.
    assert ratio[0] - 1 == pytest.approx(2 * 0.145 * 0.00337 / 0.083, abs=0.004)
    assert 0.01 < ratio[1] - 1 < 0.04


@pytest.fixture
def stopping(monkeypatch):
    """Let the fine mesh stop after Q = 6, and coarser ones after a count."""
    until = {24: 6, 10: 10, "failures": [], "after": []}

    def transition_curve(body, p_max, *, seen, most_failures, after):
        edges = 10 if body.profile.corner else 24
        until["failures"].append(most_failures)
        until["after"].append(after and after.Q)
        Q = np.arange(4, until[edges] + 3, 2)
        for count in Q[:-1]:
            seen(Transition(count // 2 - 1, int(count), 1e-6 * (100 + edges) * count**2, None))
        load = np.where(until[edges] < Q, math.nan, 1e-6 * (100 + edges) * Q**2)
        status = ["ok"] * (len(Q) - 1) + ["not converged: at p/E = 0.001"]
        end = len(Q) if edges == 24 or until[10] < 10 else -1
        return Q[:end], load[:end], tuple(status[:end])

    monkeypatch.setattr(cylinder, "transition_curve", transition_curve)
    return until


def test_a_coarser_mesh_takes_over_where_the_fine_one_stops(stopping):
    scene, bodies = Scene.of([(0.06, 0.02)], p_over_E=0.02), []
    frame = generate(scene, solver="cylinder-fe", pressed=lambda *found: bodies.append(found)).frame
    assert frame["Q"].tolist() == [4, 6, 8, 10]
    expected = [124e-6 * 4**2, 124e-6 * 6**2, 110e-6 * 8**2, 110e-6 * 10**2]
    assert frame["p_over_E"].tolist() == pytest.approx(expected, rel=1e-12)  # rounding
    # The coarse mesh has round corners, and says so.
    assert frame["rel_se"].tolist() == [1e-3, 1e-3, *[math.hypot(4e-3, 2e-3)] * 2]
    assert frame["source"].str.contains("corners=a/20").tolist() == [False, False, True, True]
    assert [one.profile.corner for _, one, _ in bodies] == [0.0, 0.05 * 0.06]
    assert frame["edges"].tolist() == [24, 24, 10, 10]
    assert [[one.Q for one in reached] for _, _, reached in bodies] == [[4, 6], [8, 10]]
    # A mesh that sticks to a sharp corner is given up sooner, where another mesh goes on.
    assert stopping["failures"] == [2, cylinder.MOST_FAILURES]
    assert stopping["after"] == [None, 6]


def test_textures_without_a_row_are_all_named():
    scene = Scene.of([(0.012, 0.01), (0.012, 0.09), (0.032, 0.03)], p_over_E=5e-4)
    with pytest.raises(InputError) as raised:
        generate(scene)
    lines = str(raised.value).split("\n")
    assert len(lines) == 2
    assert "textures[2] = (0.012, 0.09): no transition under p/E = 0.0005" in lines[0]
    assert "the first is at 0.004812" in lines[0]


def test_a_load_with_too_many_transitions_is_refused():
    with pytest.raises(InputError, match="over 65536 transitions"):
        generate(Scene.of([(1e-6, 1e-6)], p_over_E=0.1), solver="hertz")


def test_unknown_solvers_are_refused():
    with pytest.raises(InputError, match="'abaqus': must be one of auto, hertz, half-plane"):
        generate(Scene.of([(0.032, 0.01)]), solver="abaqus")
