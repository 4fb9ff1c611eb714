"""Figures: what they show is there, nothing is clipped, no text lies on other text."""

import functools
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from ridgebayes.checks.load_errors import percent_errors
from ridgebayes.checks.report_data import report_data
from ridgebayes.drawing.forms import plot_bayes_factors, plot_percent_errors
from ridgebayes.drawing.predictions import plot_bands
from ridgebayes.drawing.style import COLOURS, as_bytes, styled, symbol
from ridgebayes.report.figures.gallery import Gallery, corner_of
from ridgebayes.runtime.pool import workers
from tests.figure_texts import clipped_and_overlapping, drawn_texts

FORMS = ("classic", "power-law", "modified", "hybrid")
RANKED = ("hybrid", "modified", "power-law", "classic")
NAMES = (
    "evidence",
    "prior-sensitivity",
    "bands-first",
    "bands",
    "held-out",
    "percent-error",
    "slopes",
    "posterior-checks",
    "prior-bands",
)


@pytest.fixture(scope="session")
def full(gallery):
    return gallery


@pytest.fixture(scope="session")
def texts(full):
    """The texts of a figure that is laid out once."""
    return functools.cache(lambda name: drawn_texts(full[name]))


@pytest.fixture(scope="session")
def bare(gallery_of, single):
    return gallery_of("single", single)


def test_evidence_figure_shows_the_number_with_error_models_summed_out():
    methods = ["summed out", "importance", "bridge"]
    ln_bf = [-6.0, -26.0, -26.5]
    factors = pd.DataFrame({"form": "modified", "method": methods, "ln_bf": ln_bf, "ln_bf_se": 0.1})
    figure = plot_bayes_factors(factors, "hybrid", "texture+step")
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    under = [f"{method} (texture+step)" for method in sorted(methods[1:])]
    assert sorted(labels) == sorted(["error models summed out", *under])
    assert [text.get_text() for text in figure.axes[0].texts] == ["\N{MINUS SIGN}6.0"]


def test_gallery_has_every_figure_of_a_full_comparison(full):
    assert list(full) == [*NAMES, *(f"corner-{form}" for form in RANKED)]


@pytest.mark.parametrize("name", [*NAMES, *(f"corner-{form}" for form in FORMS)])
def test_no_text_is_clipped_or_lies_on_other_text(full, texts, name):
    assert clipped_and_overlapping(full[name], texts(name)) == ([], [])


@pytest.mark.parametrize("name", [*NAMES, *(f"corner-{form}" for form in FORMS)])
def test_text_is_9_pt_or_more_where_a4_is_as_wide_as_the_figure(full, texts, name):
    scale = min(1.0, 190 / 25.4 / full[name].get_figwidth())  # a page less its margins
    small = {text.get_text() for text, _ in texts(name) if scale * text.get_size() < 9}
    assert small == set()


@pytest.mark.long
def test_no_text_is_clipped_or_lies_on_other_text_with_five_forms(reference):
    for name, figure in Gallery(report_data(reference)).items():
        assert (name, *clipped_and_overlapping(figure)) == (name, [], [])


@pytest.mark.long
def test_no_text_is_clipped_with_hostile_labels(odd, bare):
    for name, figure in (*Gallery(report_data(odd)).items(), *bare.items()):
        assert (name, *clipped_and_overlapping(figure)) == (name, [], [])


def test_the_check_itself_sees_overlap_and_clipping():
    with styled():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(2, 2))
        axes = figure.subplots()
        axes.text(0.5, 0.5, "one text on")
        axes.text(0.5, 0.5, "another text")
        axes.text(3.0, 0.5, "outside")
    clipped, overlapping = clipped_and_overlapping(figure)
    assert "outside" in clipped
    assert ("one text on", "another text") in overlapping


def test_one_form_has_no_comparison_figures(bare):
    assert not {"evidence", "prior-sensitivity", "slopes"} & set(bare)
    assert {"bands", "held-out", "corner-modified"} <= set(bare)


def test_percent_error_lines_are_the_table(comparison):
    errors = percent_errors(comparison)
    figure = plot_percent_errors(errors)
    assert len(figure.axes) == 6
    part = errors[(errors["form"] == "hybrid") & (errors["coefficients"] == "calibrated")]
    last = part[["a_over_R", "b_over_R"]].eq(part[["a_over_R", "b_over_R"]].iloc[-1]).all(axis=1)
    lines = [
        line
        for line in figure.axes[5].lines
        if line.get_color() == COLOURS["hybrid"] and line.get_linestyle() == "-"
    ]
    np.testing.assert_array_equal(lines[0].get_ydata(), part["percent"][last])


def test_every_drawn_value_lies_inside_its_axes(full):
    for name in NAMES:
        for axes in full[name].axes:
            if not axes.get_visible():
                continue
            low, high = sorted(axes.get_ylim())
            for line in axes.lines:
                if line.get_transform() == axes.transData:
                    y = np.asarray(line.get_ydata(), dtype=float)
                    assert y[np.isfinite(y)].min(initial=low) >= low
                    assert y[np.isfinite(y)].max(initial=high) <= high


def test_observed_steps_rise_at_the_observed_loads(comparison, full):
    axes = full["bands"].axes[0]
    dots = next(line for line in axes.lines if line.get_marker() == ".")
    frame = comparison.table.frame
    own = frame[(frame["a_over_R"] == 0.012) & (frame["b_over_R"] == 0.01)]
    np.testing.assert_array_equal(dots.get_xdata(), own["p_over_E"])
    np.testing.assert_array_equal(dots.get_ydata(), own["Q"])


def test_extrapolation_looks_different(comparison, full):
    panels = {axes.get_title(): axes for axes in full["bands"].axes}
    held_out = next(axes for title, axes in panels.items() if "held out" in title)
    inside = next(axes for title, axes in panels.items() if "0.022$" in title or "0.022," in title)

    def hatched_from(axes):
        hatched = [patch for patch in axes.collections if patch.get_hatch()]
        paths = [path for patch in hatched for path in patch.get_paths()]
        return min(path.vertices[:, 0].min() for path in paths)

    rows = comparison.table.calibration.frame
    assert hatched_from(held_out) < rows["p_over_E"].min()  # all of it
    assert hatched_from(inside) > rows["p_over_E"].max()  # what lies above every calibrated load


def test_bands_say_how_many_textures_are_left_out(comparison):
    bands = pd.DataFrame(
        {
            "form": "hybrid",
            "kind_of_band": ["curve", "simulation"] * 13,
            "a_over_R": np.repeat(np.arange(1, 14) / 100, 2),
            "b_over_R": 0.02,
            "p_over_E": 0.01,
            "q_lower": 4,
            "q_upper": 6,
            "prob": 0.9,
            "extrapolation": False,
        }
    )
    figure = plot_bands(bands, comparison.table.frame, "hybrid")
    assert "12 of 13 textures" in figure._suptitle.get_text()


def test_corner_of_many_parameters_shows_some_and_says_so(comparison):
    fit = comparison.fits["power-law"]
    figure = corner_of(fit, most=4)
    assert len(figure.axes) == 16
    assert "4 of 10 parameters" in figure._suptitle.get_text()
    assert symbol("sigma") in [axes.get_xlabel() for axes in figure.axes]


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_equal_fits_give_equal_bytes_whatever_the_user_has_set(comparison, kind):
    import matplotlib

    with styled():
        first = as_bytes(corner_of(comparison.fits["modified"]), kind)
    with matplotlib.rc_context({"font.size": 20, "svg.hashsalt": None, "axes.grid": False}):
        with styled():
            figure = corner_of(comparison.fits["modified"])
        assert as_bytes(figure, kind) == first


def test_gallery_of_workers_is_the_same_to_the_last_byte(single, bare):
    with workers(2) as pool:
        elsewhere = Gallery(report_data(replace(single)), pool)
        assert list(elsewhere) == list(bare)
        for name in ("bands", "held-out", "corner-modified"):
            for kind in ("png", "svg"):
                assert elsewhere.file(name, kind) == bare.file(name, kind)
        assert not elsewhere._figures  # none was drawn here


def test_save_writes_png_and_svg_and_nothing_else(bare, tmp_path):
    names = bare.save(tmp_path / "figures")
    assert sorted(path.name for path in (tmp_path / "figures").iterdir()) == sorted(names)
    assert {name.split(".")[-1] for name in names} == {"png", "svg"}
    assert len(names) == 2 * len(bare)
    assert (tmp_path / "figures" / "bands.png").read_bytes().startswith(b"\x89PNG")
    svg = (tmp_path / "figures" / "bands.svg").read_text(encoding="utf-8")
    assert "<script>" not in svg
    assert "dc:date" not in svg
