"""The figure of the ECDF test: it shows the record, and all of its text can be read."""

import itertools

import numpy as np
import pytest

from ridgebayes.drawing.style import as_bytes
from ridgebayes.errors import InputError
from tests.validation.uniformity import ranks_to_pit, uniformity
from tests.validation.uniformity_figure import plot_uniformity

RNG = np.random.default_rng(3)
UNIFORM = uniformity(RNG.random(500))
BENT = uniformity(RNG.beta(1.3, 1, 500))
RANKS = uniformity(ranks_to_pit(RNG.integers(0, 64, 500), 63), n_draw=63)
FEW = uniformity(RNG.random(20), 0.95)


def panels(figure):
    return [axes for axes in figure.axes if axes.get_visible()]


def band(axes):
    """Return the corners of the shaded band, sorted."""
    return sorted(map(tuple, axes.collections[0].get_paths()[0].vertices.round(12).tolist()))


@pytest.mark.parametrize("n_panel", [1, 2, 3, 4, 7])
def test_no_text_is_clipped_or_lies_on_other_text(n_panel, faults):
    names = ["c", "K[a0.012_b0.01]", "a $name$ longer than any title", "hybrid", "c1", "c2", "df"]
    found = itertools.cycle([UNIFORM, BENT, FEW, RANKS])
    figure = plot_uniformity(dict(zip(names[:n_panel], found, strict=False)))
    assert len(panels(figure)) == n_panel
    assert faults(figure) == ([], [])


@pytest.mark.parametrize("found", [UNIFORM, BENT, RANKS, FEW])
def test_lines_and_band_are_the_record(found):
    (axes,) = panels(plot_uniformity({"c": found}))
    observed = next(line for line in axes.lines if len(line.get_xdata()) == len(found.z) + 2)
    np.testing.assert_array_equal(observed.get_xdata(), [0, *found.z, 1])
    np.testing.assert_array_equal(observed.get_ydata(), [0, *(found.ecdf - found.z), 0])
    corners = band(axes)
    for side in (found.lower, found.upper):
        assert set(zip(found.z.round(12), (side - found.z).round(12), strict=True)) <= set(corners)


def test_points_outside_are_marked_and_only_those():
    inside, bent = panels(plot_uniformity({"c": UNIFORM, "c1": BENT}))
    assert [len(line.get_xdata()) for line in inside.lines if line.get_marker() == "."] == [0]
    (dots,) = [line for line in bent.lines if line.get_marker() == "."]
    outside = (BENT.ecdf < BENT.lower) | (BENT.ecdf > BENT.upper)
    assert outside.any()
    np.testing.assert_array_equal(dots.get_xdata(), BENT.z[outside])
    np.testing.assert_array_equal(dots.get_ydata(), (BENT.ecdf - BENT.z)[outside])


def test_titles_tell_name_size_and_p_value():
    figure = plot_uniformity({"sigma": UNIFORM, "power-law": BENT, "$x$": FEW})
    titles = [axes.get_title() for axes in panels(figure)]
    assert titles == [
        f"$\\sigma$\n500 values, $p$ = {UNIFORM.p_value:.3f}",
        "Power law\n500 values, $p$ < 0.001",
        f"\\$x\\$\n20 values, $p$ = {FEW.p_value:.3f}",
    ]


def test_legend_tells_the_probabilities_and_what_is_there():
    def texts(results):
        return [text.get_text() for text in plot_uniformity(results).legends[0].get_texts()]

    label = "band of a uniform sample's whole ECDF, "
    assert texts({"c": UNIFORM}) == ["observed", f"{label}99 %"]
    assert texts({"c": BENT, "c1": FEW}) == ["observed", f"{label}95 % or 99 %", "outside"]


def test_scale_is_shared_by_samples_of_one_size_only():
    one, other = panels(plot_uniformity({"c": UNIFORM, "c1": BENT}))
    assert one.get_ylim() == other.get_ylim()
    one, other = panels(plot_uniformity({"c": UNIFORM, "c1": FEW}))
    assert one.get_ylim() != other.get_ylim()


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_equal_records_give_equal_bytes_whatever_the_user_has_set(kind):
    import matplotlib

    first = as_bytes(plot_uniformity({"c": BENT}), kind)
    with matplotlib.rc_context({"font.size": 20, "svg.hashsalt": None, "axes.grid": False}):
        assert as_bytes(plot_uniformity({"c": BENT}), kind) == first


def test_no_results_are_bad_input():
    with pytest.raises(InputError, match="results: expected at least one, got none"):
        plot_uniformity({})
