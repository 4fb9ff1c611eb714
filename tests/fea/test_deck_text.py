"""Decks: ridges where the scene has them, and text that the package's own reader of decks reads."""

import math
import re
from itertools import pairwise

import numpy as np
import pytest

from ridgebayes import InputError, Scene
from ridgebayes.contact import hertz
from ridgebayes.fea.deck import read_deck
from ridgebayes.fea.deck_text import REACTION, SURFACE, deck_text, pressed_disk
from ridgebayes.scene.scene import Texture

A, B = 0.06, 0.03


def disk(nu=0.49, friction=0.0, **texture):
    one = Texture(a_over_R=A, b_over_R=B, **texture)
    return pressed_disk(Scene(textures=(one,), nu=nu, p_over_E=0.004, friction=friction), edges=4)


@pytest.fixture(params=["calculix", "abaqus"])
def program(request):
    return request.param


@pytest.fixture
def deck(tmp_path):
    def read(text):
        (tmp_path / "run.inp").write_text(text)
        return read_deck(tmp_path / "run.inp")

    return read


def test_deck__has_the_mesh_and_its_sets(deck, program):
    one = disk()
    found = deck(deck_text(one, program))
    number = one.numbers
    rim = one.rim[number[one.rim] > 0]
    assert found.nsets[SURFACE] == number[rim].tolist()
    np.testing.assert_allclose(
        found.coordinates(found.nsets[SURFACE]), one.mesh.points[rim], rtol=1e-12
    )
    # Rounding of the mesh's sines.
    assert max(abs(found.nodes[n][1]) for n in found.nsets[REACTION]) < 1e-15
    assert max(abs(found.nodes[n][0]) for n in found.nsets["NAX"]) < 1e-15
    assert len(found.elements) == len(one.cells) + len(one.blocks)
    assert len(found.nsets["NRID"]) == 4 * len(one.blocks)


@pytest.mark.parametrize(("program", "nu"), [("calculix", 0.45), ("abaqus", 0.45), ("abaqus", 0.5)])
def test_deck__has_the_scene_s_material(deck, program, nu):
    text = deck_text(disk(nu=nu), program)
    found = deck(text)
    assert pytest.approx(1.0, rel=1e-9) == found.E  # ten digits are written
    assert found.nu == pytest.approx(nu, abs=1e-9)
    assert ("TYPE=CPE8RH" in text) == (program == "abaqus")


@pytest.mark.parametrize(
    ("program", "nu", "message"),
    [
        ("calculix", 0.5, r"nu = 0\.5: expected at most 0\.499 for CalculiX"),
        ("ansys", 0.49, "--format ansys: expected calculix or abaqus"),
    ],
)
def test_deck__what_a_program_cannot_do_is_refused(program, nu, message):
    with pytest.raises(InputError, match=message):
        deck_text(disk(nu=nu), program)


def test_steps__are_one_a_level_downwards(program):
    one = disk()
    text = deck_text(one, program)
    levels = [float(v) for v in re.findall(rf"^{REACTION},2,2,-(\S+)$", text, re.MULTILINE)]
    np.testing.assert_allclose(levels, one.displacements, rtol=1e-11)  # twelve digits
    assert text.count("*STEP,") == text.count("*END STEP") == len(levels)
    assert text.count(f"*NODE PRINT,NSET={SURFACE}") == len(levels)


def test_surfaces__of_the_ridges_have_tops_and_walls_but_no_seams(deck, program):
    def faces(one):
        text = deck_text(one, program)
        block = text.split("*SURFACE,NAME=RIDGES,TYPE=ELEMENT\n")[1].split("*")[0]
        return [line.split(",") for line in block.split()]

    sharp = disk()
    assert [face for _, face in faces(sharp)] == ["S3", "S2", "S4"] * len(sharp.blocks)
    rounded = disk(corner_radius_over_R=0.01)
    per_ridge = [face for _, face in faces(rounded)]
    n_ridge = len(sharp.blocks)
    # Slices share sides at the same height: a wall only at each end of a ridge.
    assert per_ridge.count("S2") == per_ridge.count("S4") == n_ridge
    assert per_ridge.count("S3") == len(rounded.blocks)


def test_ridges__of_slices_are_one_body_whose_slices_share_nodes(deck, program):
    r = 0.01
    one = disk(corner_radius_over_R=r)
    found = deck(deck_text(one, program))
    rigid = [found.nodes[n] for n in found.nsets["NRID"]]
    assert len(set(rigid)) == len(rigid)
    n_ridge = len(disk().blocks)
    assert len(rigid) == 2 * len(one.blocks) + 2 * n_ridge
    slices = [set(nodes) for number, nodes in found.elements.items() if number > len(one.cells)]
    assert sum(len(a & b) == 2 for a, b in pairwise(slices)) == len(one.blocks) - n_ridge


def test_friction__is_in_the_interaction(program):
    assert "*FRICTION" not in deck_text(disk(), program)
    after = deck_text(disk(friction=0.3), program).split("*FRICTION\n")[1]
    assert after.startswith("0.3,1000000\n" if program == "calculix" else "0.3\n")


def scene(p_over_E=0.006, nu=0.49, **texture):
    return Scene(textures=(Texture(a_over_R=A, b_over_R=B, **texture),), nu=nu, p_over_E=p_over_E)


def test_blocks__are_the_ridges_and_just_touch_the_disk():
    disk = pressed_disk(scene())
    starts = [block[3, 0] for block in disk.blocks]
    np.testing.assert_allclose(starts, B / 2 + (A + B) * np.arange(len(starts)), rtol=1e-14)
    widths = [block[2, 0] - block[3, 0] for block in disk.blocks]
    np.testing.assert_allclose(widths, A, rtol=1e-13)  # rounding
    top = disk.blocks[0][3, 1]
    assert top == pytest.approx(-math.sqrt(1 - (B / 2) ** 2), abs=1e-15)


def test_blocks__of_round_corners_are_slices_of_an_arc_that_touches():
    r = 0.2 * A
    disk = pressed_disk(scene(corner_radius_over_R=r))
    first = [block for block in disk.blocks if block[2, 0] <= B / 2 + A * (1 + 1e-12)]
    top = np.concatenate([block[3:1:-1] for block in first])
    left = top[top[:, 0] < B / 2 + r]
    centre = np.array([B / 2 + r, top[:, 1].max() - r])
    np.testing.assert_allclose(np.hypot(*(left - centre).T), r, rtol=1e-12)
    # The disk and the arc touch: their centres are 1 + r apart.
    assert np.hypot(*centre) == pytest.approx(1 + r, rel=1e-12)
    widths = [block[2, 0] - block[3, 0] for block in first]
    assert sum(widths) == pytest.approx(A, rel=1e-12)


def test_blocks__of_a_floor_lie_under_the_grooves():
    disk = pressed_disk(scene(groove_depth_over_R=0.01))
    *ridges, floor = disk.blocks
    assert floor[2, 1] == pytest.approx(ridges[0][2, 1] - 0.01, abs=1e-15)
    assert floor[0, 0] < 0
    assert floor[1, 0] == max(block[1, 0] for block in ridges)


def test_levels__rise_past_the_highest_load():
    disk = pressed_disk(scene())
    assert np.all(np.diff(disk.displacements) > 0)
    # Smooth, and stiffer than on ridges: 1.2 times this displacement goes beyond the load.
    w = float(hertz.half_width(0.006, nu=0.49))
    p = 2 * 0.006 * (1 - 0.49**2) / math.pi
    assert disk.displacements[-1] > 1.2 * p * (2 * math.log(4 / w) - 1)


def test_mesh__is_finer_where_more_edges_are_asked_for():
    coarse, fine = (len(pressed_disk(scene(), edges=edges).cells) for edges in (6, 24))
    assert fine > 1.5 * coarse
    disk = pressed_disk(scene(), edges=12)
    rim = disk.mesh.points[disk.rim]
    length = np.hypot(*np.diff(rim, axis=0).T)
    at = np.abs(rim[:-1, 0] - B / 2) < 0.002
    assert length[at].max() < 0.5 * A / 36 * 1.2  # half an edge a third of A / 12 long


@pytest.mark.parametrize(
    ("given", "edges", "message"),
    [
        (Scene.of([(0.02, 0.02), (0.03, 0.02)]), 12, "2 textures; a deck is of one texture"),
        (scene(offset=0.25), 12, r"offset = 0\.25; a deck's body is centred"),
        (scene(), 1, r"edges = 1; expected 2 to 200 on a ridge"),
        (scene(), math.nan, "edges = nan; expected 2 to 200"),
        (scene().model_copy(update={"ogden": ((1.0, 9.0),)}), 12, "material is neo-Hookean"),
        (scene(0.6), 12, r"the contact is 1\.\d+ R wide; expected under 0\.9 R"),
        (Scene.of([(0.4, 0.2)], p_over_E=0.1, nu=0.4), 12, "ridge 3 lies outside the disk"),
    ],
)
def test_pressed_disk__refuses(given, edges, message):
    with pytest.raises(InputError, match=message):
        pressed_disk(given, edges=edges)
