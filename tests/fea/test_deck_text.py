"""Decks as text: what CalculiX and Abaqus read, by the package's own reader of decks."""

import re

import numpy as np
import pytest

from ridgebayes.errors import InputError
from ridgebayes.fea.deck import read_deck
from ridgebayes.fea.deck_text import REACTION, SURFACE, deck_text
from ridgebayes.fea.pressed_disk import pressed_disk
from ridgebayes.scene.scene import Scene, Texture

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
        found.coordinates(found.nsets[SURFACE], "deck"), one.mesh.points[rim], rtol=1e-12
    )
    # Rounding of the mesh's sines.
    assert max(abs(found.nodes[n][1]) for n in found.nsets[REACTION]) < 1e-15
    assert max(abs(found.nodes[n][0]) for n in found.nsets["NAX"]) < 1e-15
    assert len(found.elements) == len(one.cells) + len(one.blocks)
    assert len(found.nsets["NRID"]) == 4 * len(one.blocks)


def test_deck__has_the_scene_s_material(deck, program):
    found = deck(deck_text(disk(nu=0.45), program))
    assert pytest.approx(1.0, rel=1e-9) == found.E  # ten digits are written
    assert found.nu == pytest.approx(0.45, abs=1e-9)


def test_deck__of_abaqus_may_be_incompressible(deck):
    found = deck(deck_text(disk(nu=0.5), "abaqus"))
    assert (found.E, found.nu) == (pytest.approx(1.0, rel=1e-9), 0.5)
    assert "TYPE=CPE8RH" in deck_text(disk(nu=0.5), "abaqus")


def test_deck__of_calculix_may_not():
    with pytest.raises(InputError, match=r"nu = 0\.5: expected at most 0\.499 for CalculiX"):
        deck_text(disk(nu=0.5), "calculix")


def test_deck__of_another_program_is_refused():
    with pytest.raises(InputError, match="--format ansys: expected calculix or abaqus"):
        deck_text(disk(), "ansys")


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


def test_friction__is_in_the_interaction(program):
    assert "*FRICTION" not in deck_text(disk(), program)
    after = deck_text(disk(friction=0.3), program).split("*FRICTION\n")[1]
    assert after.startswith("0.3,1000000\n" if program == "calculix" else "0.3\n")
