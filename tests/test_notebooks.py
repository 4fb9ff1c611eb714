"""Every notebook runs from top to bottom; those with outputs in git show the same again."""

import re
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
STORED = [path for path in NOTEBOOKS if path.stem in {"design"}]  # with their outputs
NUMBER = r"(?<![\w.])-?\d+(?:\.\d+)?(?![\w.])"


def test_notebooks__are_all_known():
    assert [path.name for path in NOTEBOOKS] == [
        "design.ipynb",
        "friction.ipynb",
        "quickstart.ipynb",
    ]


@pytest.mark.parametrize(
    "path", [path for path in NOTEBOOKS if path not in STORED], ids=lambda path: path.stem
)
def test_notebook__is_stored_without_outputs(path):
    notebook = nbformat.read(path, as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert code
    assert all(not cell.outputs and cell.execution_count is None for cell in code)


# Jupyter's own start-up warnings are not ours to act on; errors in a cell raise all the same.
@pytest.mark.filterwarnings("ignore")
def test_quickstart__runs_and_leaves_a_report(tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    notebook = nbformat.read(FOLDER / "quickstart.ipynb", as_version=4)
    resources = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=600, kernel_name="python3", resources=resources).execute()
    assert (tmp_path / "report.html").stat().st_size > 10_000
    shown = [
        output
        for cell in notebook.cells
        if cell.cell_type == "code"
        for output in cell.outputs
        if "image/png" in output.get("data", {})
    ]
    assert len(shown) == 4


def shown(notebook):
    """Return the texts that a notebook shows, and how many figures."""
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    outputs = [output for cell in code for output in cell.outputs]
    data = [output.get("data", {}) for output in outputs]
    texts = [
        output.get("text", one.get("text/plain", ""))
        for output, one in zip(outputs, data, strict=True)
        if "image/png" not in one
    ]
    return texts, sum("image/png" in one for one in data)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_notebook__shows_again_what_is_stored(path, tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    stored, again = (nbformat.read(path, as_version=4) for _ in range(2))
    resources = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(again, timeout=600, kernel_name="python3", resources=resources).execute()
    (texts, n_figure), (new_texts, n_new_figure) = shown(stored), shown(again)
    assert n_figure == n_new_figure > 0
    assert len(texts) == len(new_texts) > 0
    for text, new in zip(texts, new_texts, strict=True):
        assert re.sub(NUMBER, "", text).split() == re.sub(NUMBER, "", new).split()
        numbers, new_numbers = (re.findall(NUMBER, one) for one in (text, new))
        # Another version of a library may sample otherwise: Monte Carlo, and steps of a lattice.
        np.testing.assert_allclose(
            np.array(new_numbers, float), np.array(numbers, float), rtol=0.15, atol=0.05
        )


@pytest.mark.filterwarnings("ignore")
def test_friction__runs_and_narrows_the_band(tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    notebook = nbformat.read(FOLDER / "friction.ipynb", as_version=4)
    resources = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=600, kernel_name="python3", resources=resources).execute()
    texts, n_figure = shown(notebook)
    assert n_figure == 2
    band = re.search(r"mu at the largest load: ([\d.]+) to ([\d.]+)", "".join(texts))
    assert float(band[2]) < 4 * float(band[1])
