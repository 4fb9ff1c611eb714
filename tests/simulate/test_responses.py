"""What a scene does under loads, against transition loads and against the sums it has to give."""

import math

import numpy as np
import pytest

from ridgebayes import InputError, Scene, contact_at_loads, edge_forces, ridge_forces
from ridgebayes.contact.contact_solution import load_factor
from ridgebayes.contact.halfplane import transition_loads
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.scene.scene import Texture
from ridgebayes.simulate.responses import EDGE_COLUMNS, FORCE_COLUMNS, RESPONSE_COLUMNS

A, B = 0.012, 0.03


def scene_with(**texture):
    return Scene(textures=(Texture(a_over_R=A, b_over_R=B, **texture),))


def test_contact_at_loads__counts_change_at_the_transition_loads():
    p = transition_loads(A, B, 3).p_over_E(A + B)
    found = contact_at_loads(scene_with(), np.concatenate([p * (1 - 1e-5), p * (1 + 1e-5)]))
    assert found.columns.tolist() == RESPONSE_COLUMNS
    assert found["Q"].tolist() == [2, 4, 6, 4, 6, 8]
    assert set(found["status"]) == {"ok"}
    assert not found["p_over_E"].is_monotonic_increasing  # rows stand as loads were given
    assert found.sort_values("p_over_E")["approach_over_R"].is_monotonic_increasing


@pytest.mark.parametrize(
    "changed", [{}, {"offset": 0.5}, {"offset": 0.2, "groove_depth_over_R": 5e-4}, {"offset": -0.3}]
)
def test_ridge_forces__are_the_load_and_pressures_the_forces(changed):
    scene = scene_with(**changed)
    found = ridge_forces(scene, [0.004], solver="half-plane")
    assert found.columns.tolist() == FORCE_COLUMNS
    times = np.ones(len(found))
    if changed.get("offset", 0.0) in (0.0, 0.5):  # the right half, and what lies below the centre
        times = np.where(found["left_over_R"] < 0, 1, 2)
    assert (found["share"] * times).sum() == pytest.approx(1, rel=1e-12)  # balance
    width = found["right_over_R"] - found["left_over_R"]
    # p is force per projected area 2 R: mean pressure x width / (2 R) adds up to it.
    total = (found["mean_pressure_over_E"] * width * times).sum() / 2
    assert total == pytest.approx(0.004, rel=1e-12)
    count = contact_at_loads(scene, [0.004], solver="half-plane")["Q"].iloc[0]
    assert (times * (found["land"] == "ridge")).sum() == count


def test_contact_at_loads__refuse_bad_input():
    with pytest.raises(InputError, match="expected auto, half-plane or two-scale"):
        contact_at_loads(scene_with(), [0.01], solver="hertz")
    with pytest.raises(InputError, match="offset: expected a number, got 'uniform'"):
        ridge_forces(scene_with(offset="uniform"), [0.01])
    with pytest.raises(InputError, match="offset: expected a number, got 'uniform'"):
        edge_forces(scene_with(offset="uniform"), [0.01])


def test_edge_forces__are_those_of_the_contact_that_ridge_forces_tells():
    scene = scene_with(offset=0.2, groove_depth_over_R=5e-4)
    found = edge_forces(scene, [0.004, 0.002])
    assert found.columns.tolist() == EDGE_COLUMNS
    assert found["p_over_E"].drop_duplicates().tolist() == [0.004, 0.002]
    contacts = ridge_forces(scene, [0.004, 0.002], solver="half-plane", rel_tol=1e-8)
    for side, end in ((-1, "left_over_R"), (1, "right_over_R")):
        edges = found[found["side"] == side].reset_index(drop=True)
        np.testing.assert_array_equal(edges["x_over_R"], contacts[end])
        assert edges[["land", "ridge"]].equals(contacts[["land", "ridge"]])
    np.testing.assert_allclose(found["G"], 0.375 * found["K"] ** 2, rtol=1e-12)  # algebra
    assert found["lateral_force"].nunique() == 2


OFFSETS = (np.arange(32) + 0.5) / 64


@pytest.mark.slow
def test_contact_at_loads__of_a_uniform_offset_counts_the_events_at_every_offset():
    p = np.array([2e-4, 3e-3])
    found = contact_at_loads(scene_with(offset="uniform"), p, solver="half-plane")
    W, counts = load_factor(0.5) * p, []
    for offset in OFFSETS:
        events = reaching_loads(Profile(A, B, offset=offset), W_max=W.max(), rel_tol=1e-5)
        at = np.searchsorted(events.W, W, side="right")
        counts.append(np.concatenate([[events.Q[0] - 1], events.Q])[at])
    np.testing.assert_allclose(found["Q"], np.mean(counts, axis=0), rtol=1e-12)  # algebra
    assert set(found["status"]) == {"ok"}


@pytest.mark.slow
def test_contact_at_loads__of_fine_ridges_anywhere_are_the_contact_over_the_pitch():
    # Many ridges: a contact of width 2 w touches (2 w + a) over the pitch of them on average. It is
    # wider than Hertz's by its edge constant, a fraction of a pitch on either side.
    a, W = 0.002, 0.5 * 0.05**2
    scene = Scene(textures=(Texture(a_over_R=a, b_over_R=a, offset="uniform"),))
    found = contact_at_loads(scene, [W / load_factor(0.5)], solver="half-plane", rel_tol=1e-4)
    assert found["Q"].iloc[0] == pytest.approx((2 * math.sqrt(2 * W) + a) / (2 * a), abs=1.0)
