"""A deck through CalculiX itself and back: the package's own loads by another program."""

import os
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from ridgebayes import Scene, generate
from ridgebayes.contact.cylinder.faces import first_height
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.fea.calculix import read_calculix
from ridgebayes.fea.deck import Run, read_deck
from ridgebayes.fea.deck_text import REACTION, SURFACE, deck_text, pressed_disk
from ridgebayes.fea.read import import_files
from ridgebayes.fea.record import Given
from ridgebayes.scene.scene import Texture

SOLVER = shutil.which("ccx") or shutil.which("ccx_2.20")
if SOLVER is None and os.environ.get("RIDGEBAYES_NEEDS_CCX"):
    raise RuntimeError("no ccx on the path; RIDGEBAYES_NEEDS_CCX requires it")
pytestmark = [
    pytest.mark.ccx,
    pytest.mark.skipif(SOLVER is None, reason="CalculiX (ccx) is not installed"),
]

A, B, NU = 0.12, 0.03, 0.49


def solve(scene, levels, folder):
    """Run some levels of a scene's deck, five elements a ridge."""
    deck = pressed_disk(scene, edges=5)
    deck = replace(deck, displacements=deck.displacements[levels])
    (folder / "run.inp").write_text(deck_text(deck, "calculix"))
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [SOLVER, "-i", "run"], cwd=folder, env=environment, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:]


@pytest.fixture(scope="module")
def scene():
    return Scene.of([(A, B)], p_over_E=0.013, nu=NU)


@pytest.fixture(scope="module")
def run(scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("calculix")
    # Without friction a state does not depend on the way: seven of the levels below the transition
    # are left out, and the two beyond it.
    solve(scene, slice(7, 12), folder)
    given = {"texture": (A, B), "nu": f"{NU}", "surface": SURFACE, "reaction": REACTION}
    return lambda **more: import_files([folder / "run.dat"], Given(**given, **more))


def test_run__agrees_with_the_package_s_own_elements(run, scene):
    found, own = run().table.frame, generate(scene, solver="cylinder-fe").frame
    assert found["Q"].tolist() == own["Q"].tolist() == [4]
    # Discretisation: five elements a ridge in CalculiX, and its penalty.
    np.testing.assert_allclose(found["p_over_E"], own["p_over_E"], rtol=0.01)
    assert 0 < found["rel_se"].iloc[0] < 0.01


@pytest.mark.long
def test_run__on_round_corners_has_no_way_into_the_flats(tmp_path):
    r = 0.1 * A
    texture = Texture(a_over_R=A, b_over_R=B, corner_radius_over_R=r)
    solve(Scene(textures=(texture,), p_over_E=0.013, nu=NU), slice(6, 8), tmp_path)
    facts = Given(deck=tmp_path / "run.inp", surface=SURFACE, reaction=REACTION)
    paths, deck = [tmp_path / "run.dat"], read_deck(tmp_path / "run.inp")
    x, y = read_calculix(Run(A, B, paths=paths, facts=facts, deck=deck)).at[-1].T
    top = first_height(Profile(A, B, corner=r))
    on = (x > B / 2 + r) & (x < B / 2 + A - r) & (y < top + 1e-6)
    assert on.sum() > 3
    # The penalty's overlap is the pressure over 1e5 E/R; at an edge of the contact it is larger.
    assert (top - y[on]).max() < 2e-5
