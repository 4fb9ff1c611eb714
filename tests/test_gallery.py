"""Every script of the gallery asks a question, and draws the figure that is stored beside it."""

import ast
import re

import matplotlib.image
import numpy as np
import pytest
from docs.make_gallery import SCRIPTS, draw

IN_MAKE_TEST = "who_carries_the_load"


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_script__asks_a_question_and_its_figure_is_stored(path):
    title = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))).partition("\n\n")[0]
    assert re.fullmatch(r"[A-Z].+\?", title)
    assert path.with_suffix(".png").stat().st_size > 5_000


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
    draw(path, tmp_path / "now.png")
    now, stored = grey(tmp_path / "now.png"), grey(path.with_suffix(".png"))
    assert now.shape == stored.shape
    # Other libraries draw other letters and other numbers, by little.
    assert np.abs(now - stored).mean() < 0.02
    assert stored.std() > 0.02  # it is not blank
