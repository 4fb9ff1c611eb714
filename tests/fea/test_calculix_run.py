"""A deck through CalculiX itself and back: the package's own loads by another program."""

import functools
import os
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from ridgebayes.fea.calculix import read_calculix
from ridgebayes.fea.deck_text import REACTION, SURFACE, deck_text, pressed_disk
from ridgebayes.fea.surface import Body
from ridgebayes.scene.scene import Scene
from ridgebayes.simulate.generation import generate

SOLVER = shutil.which("ccx") or shutil.which("ccx_2.20")
if SOLVER is None and os.environ.get("RIDGEBAYES_NEEDS_CCX"):
    raise RuntimeError("no ccx on the path, and RIDGEBAYES_NEEDS_CCX asks for it")
pytestmark = [
    pytest.mark.ccx,
    pytest.mark.skipif(SOLVER is None, reason="CalculiX (ccx) is not installed"),
]

A, B, NU = 0.12, 0.03, 0.49


@pytest.fixture(scope="module")
def scene():
    return Scene.of([(A, B)], p_over_E=0.013, nu=NU)


@pytest.fixture(scope="module")
def run(scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("calculix")
    deck = pressed_disk(scene, edges=5)
    # Without friction a state does not depend on the way: seven of the levels below the transition
    # are left out, and the two beyond it.
    deck = replace(deck, displacements=deck.displacements[7:12])
    (folder / "run.inp").write_text(deck_text(deck, "calculix"))
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [SOLVER, "-i", "run"], cwd=folder, env=environment, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:]
    return functools.partial(
        read_calculix,
        folder / "run.dat",
        Body(A, B, NU),
        deck=folder / "run.inp",
        surface=SURFACE,
        reaction=REACTION,
    )


def test_run__agrees_with_the_package_s_own_elements(run, scene):
    found, own = run().table.frame, generate(scene, solver="cylinder-fe").frame
    assert found["Q"].tolist() == own["Q"].tolist() == [4]
    # Discretisation: five elements a ridge in CalculiX, and its penalty.
    np.testing.assert_allclose(found["p_over_E"], own["p_over_E"], rtol=0.01)
    assert 0 < found["rel_se"].iloc[0] < 0.01


def test_run__brackets_contain_the_load(run):
    load, bracket = run().table.frame.iloc[0], run(brackets=True).table.frame.iloc[0]
    assert bracket["p_over_E_lower"] < load["p_over_E"] <= bracket["p_over_E"]
    assert bracket["rel_se"] == 0
