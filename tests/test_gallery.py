"""Every script of the gallery asks a question, and draws the figure that is stored for it."""

import ast
import re
import runpy
from pathlib import Path

import matplotlib as mpl
import matplotlib.image
import numpy as np
import pytest
from matplotlib import pyplot as plt

DOCS = Path(__file__).parents[1] / "docs"
SCRIPTS = sorted((DOCS / "gallery").glob("*.py"))
STORED = {path.stem: f"images/sphx_glr_{path.stem}_001.png" for path in SCRIPTS}
IN_MAKE_TEST = "who_carries_the_load"


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_script__asks_a_question_and_shows_its_stored_figure(path):
    words = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    title, line = words.splitlines()[:2]
    assert re.fullmatch(r"[A-Z].+\?", title)
    assert line == "=" * len(title)
    assert f".. image:: {STORED[path.stem]}\n   :alt: {title}" in words


def test_stored_figures__are_those_of_the_scripts():
    found = (DOCS / "examples" / "images").glob("*.png")
    assert {f"images/{path.name}" for path in found} == set(STORED.values())


def grey(path):
    """Return the brightness of a figure, in blocks of 10 pixels."""
    picture = matplotlib.image.imread(path)[..., :3].mean(axis=-1)
    high, wide = (n // 10 for n in picture.shape)
    return picture[: 10 * high, : 10 * wide].reshape(high, 10, wide, 10).mean(axis=(1, 3))


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=[pytest.mark.long] * (path.stem != IN_MAKE_TEST))
        for path in SCRIPTS
    ],
)
def test_script__draws_what_is_stored(path, tmp_path):
    plt.close("all")
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.use("Agg")
        runpy.run_path(str(path))
        (number,) = plt.get_fignums()
        plt.figure(number).savefig(tmp_path / "now.png")
        plt.close("all")
    now, stored = grey(tmp_path / "now.png"), grey(DOCS / "examples" / STORED[path.stem])
    assert now.shape == stored.shape
    # Other libraries draw other letters and other numbers, by little.
    assert np.abs(now - stored).mean() < 0.02
    assert stored.std() > 0.02  # it is not blank
