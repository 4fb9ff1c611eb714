"""Figures: what they show is there, nothing is clipped, no text lies on other text."""

import itertools
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from ridgebayes.checks.load_errors import percent_errors, slopes_table
from ridgebayes.comparison.ranking import factors_by_method
from ridgebayes.drawing.style import COLOURS, MARKERS, as_bytes, lay_out, plain, styled, symbol
from ridgebayes.errors import InputError
from ridgebayes.report.figures import begin_gallery, gallery, save_figures
from ridgebayes.report.figures.bands import bands_figure
from ridgebayes.report.figures.evidence import forest_figure
from ridgebayes.report.figures.forms import percent_error_figure, slope_figure
from ridgebayes.report.figures.gallery import _drawn
from ridgebayes.report.figures.posterior import corner_figure
from ridgebayes.runtime.pool import workers

FORMS = ("classic", "power-law", "modified", "hybrid")
NAMES = (
    "evidence",
    "prior-sensitivity",
    "bands",
    "held-out",
    "percent-error",
    "slopes",
    "smooth-cylinder",
    "posterior-checks",
    "prior-bands",
)


def drawn_texts(figure):
    """Return (text, bounding box) of every text that is drawn, ticks outside the axes left out."""
    with styled():
        lay_out(figure)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        renderer = canvas.get_renderer()
        found = []
        for axes in figure.axes:
            if not axes.get_visible():
                continue
            texts = [axes.title, axes.xaxis.label, axes.yaxis.label, *axes.texts]
            for axis in (axes.xaxis, axes.yaxis):
                for tick in axis._update_ticks():
                    texts += [tick.label1] if tick.label1.get_visible() else []
            found += texts
        for legend in figure.legends:
            found += legend.get_texts()
        found += [figure._suptitle] if figure._suptitle is not None else []
        return [
            (text, text.get_window_extent(renderer))
            for text in found
            if text.get_visible() and text.get_text().strip()
        ]


def clipped_and_overlapping(figure):
    texts = drawn_texts(figure)
    width, height = figure.bbox.width, figure.bbox.height
    clipped = [
        text.get_text()
        for text, box in texts
        if box.x0 < -1 or box.y0 < -1 or box.x1 > width + 1 or box.y1 > height + 1
    ]
    # The box of slanted text is mostly empty: only straight text is compared.
    straight = [(text, box) for text, box in texts if text.get_rotation() % 90 == 0]
    overlapping = [
        (one.get_text(), other.get_text())
        for (one, a), (other, b) in itertools.combinations(straight, 2)
        if min(a.x1, b.x1) - max(a.x0, b.x0) > 1 and min(a.y1, b.y1) - max(a.y0, b.y0) > 1
    ]
    return clipped, overlapping


def test_gallery_has_every_figure_of_a_full_comparison(comparison):
    wanted = [*NAMES, *(f"{kind}-{form}" for form in FORMS for kind in ("corner", "traces"))]
    assert set(gallery(comparison)) == set(wanted)


@pytest.mark.parametrize(
    "name", [*NAMES, *(f"{k}-{f}" for f in FORMS for k in ("corner", "traces"))]
)
def test_no_text_is_clipped_or_lies_on_other_text(comparison, name):
    assert clipped_and_overlapping(gallery(comparison)[name].figure) == ([], [])


def test_no_text_is_clipped_or_lies_on_other_text_with_five_forms(reference):
    for name, plate in gallery(reference).items():
        assert (name, *clipped_and_overlapping(plate.figure)) == (name, [], [])


def test_no_text_is_clipped_with_hostile_labels(odd, single):
    for plate in (*gallery(odd).values(), *gallery(single).values()):
        assert (plate.name, *clipped_and_overlapping(plate.figure)) == (plate.name, [], [])


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


def test_one_form_has_no_comparison_figures(single):
    assert not {"evidence", "prior-sensitivity", "slopes"} & set(gallery(single))
    assert {"bands", "held-out", "corner-modified", "traces-modified"} <= set(gallery(single))


def test_percent_error_lines_are_the_table(comparison):
    errors = percent_errors(comparison)
    figure = percent_error_figure(errors)
    assert len(figure.axes) == 6
    part = errors[
        (errors["form"] == "hybrid")
        & (errors["coefficients"] == "calibrated")
        & (errors["a_over_R"] == 0.012)
        & (errors["b_over_R"] == 0.09)
    ]
    lines = [
        line
        for line in figure.axes[5].lines
        if line.get_color() == COLOURS["hybrid"] and line.get_linestyle() == "-"
    ]
    np.testing.assert_array_equal(lines[0].get_ydata(), part["percent"])


def test_every_drawn_value_lies_inside_its_axes(comparison):
    for name in (*NAMES, "traces-hybrid"):
        for axes in gallery(comparison)[name].figure.axes:
            if not axes.get_visible():
                continue
            low, high = sorted(axes.get_ylim())
            for line in axes.lines:
                if line.get_transform() == axes.transData:
                    y = np.asarray(line.get_ydata(), dtype=float)
                    assert y[np.isfinite(y)].min(initial=low) >= low
                    assert y[np.isfinite(y)].max(initial=high) <= high


def test_observed_steps_rise_at_the_observed_loads(comparison):
    axes = gallery(comparison)["bands"].figure.axes[0]
    dots = next(line for line in axes.lines if line.get_marker() == ".")
    frame = comparison.table.frame
    own = frame[(frame["a_over_R"] == 0.012) & (frame["b_over_R"] == 0.01)]
    np.testing.assert_array_equal(dots.get_xdata(), own["p_over_E"])
    np.testing.assert_array_equal(dots.get_ydata(), own["Q"])


def test_extrapolation_looks_different(comparison):
    panels = {axes.get_title(): axes for axes in gallery(comparison)["bands"].figure.axes}
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
    figure = bands_figure(bands, comparison.table.frame, "hybrid")
    assert "12 of 13 textures" in figure._suptitle.get_text()


def test_forest_points_are_the_factors(comparison):
    factors = factors_by_method(comparison, "hybrid")
    axes = forest_figure(factors, "hybrid").axes[0]
    drawn = [line.get_xdata()[0] for line in axes.lines if len(line.get_xdata()) == 1]
    assert set(np.round(factors["ln_bf"], 9)) <= set(np.round(drawn, 9))


def test_slope_figure_shows_every_power_law_texture(comparison):
    slopes = slopes_table(comparison)
    axes = slope_figure(slopes[slopes["form"] != "classic"]).axes[0]
    own = slopes[slopes["form"] == "power-law"].sort_values("pitch")["K"]
    assert any(np.array_equal(line.get_ydata(), own) for line in axes.lines)


def test_corner_of_many_parameters_shows_some_and_says_so(comparison):
    fit = comparison.fits["power-law"]
    import ridgebayes.report.figures.posterior as posterior

    most = posterior.MOST_PARAMETERS
    try:
        posterior.MOST_PARAMETERS = 4
        figure = corner_figure(fit)
    finally:
        posterior.MOST_PARAMETERS = most
    assert len(figure.axes) == 16
    assert "4 of 10 parameters" in figure._suptitle.get_text()
    assert symbol("sigma") in [axes.get_xlabel() for axes in figure.axes]


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_equal_fits_give_equal_bytes_whatever_the_user_has_set(comparison, kind):
    import matplotlib

    with styled():
        first = as_bytes(corner_figure(comparison.fits["modified"]), kind)
    with matplotlib.rc_context({"font.size": 20, "svg.hashsalt": None, "axes.grid": False}):
        with styled():
            figure = corner_figure(comparison.fits["modified"])
        assert as_bytes(figure, kind) == first


def test_gallery_is_drawn_once_and_forgotten_with_its_comparison(single):
    copy = replace(single)
    assert gallery(copy) is gallery(copy)
    assert copy in _drawn
    size = len(_drawn)
    del copy
    assert len(_drawn) == size - 1


def test_gallery_of_workers_is_the_same_to_the_last_byte(single):
    here, elsewhere = replace(single), replace(single)
    with workers(2) as pool:
        begin_gallery(elsewhere, pool)
        drawn = gallery(elsewhere)
    own = gallery(here)
    assert list(drawn) == list(own)
    for name in ("bands", "held-out", "corner-modified"):
        assert drawn[name].png == own[name].png
        assert drawn[name].svg == own[name].svg


def test_save_figures_writes_png_and_svg_and_nothing_else(single, tmp_path):
    names = save_figures(single, tmp_path / "figures")
    assert sorted(path.name for path in (tmp_path / "figures").iterdir()) == sorted(names)
    assert {name.split(".")[-1] for name in names} == {"png", "svg"}
    assert (tmp_path / "figures" / "bands.png").read_bytes().startswith(b"\x89PNG")
    svg = (tmp_path / "figures" / "bands.svg").read_text(encoding="utf-8")
    assert "<script>" not in svg
    assert "dc:date" not in svg


def test_a_folder_that_cannot_be_made_is_bad_input(single, tmp_path):
    (tmp_path / "figures").write_text("a file", encoding="utf-8")
    with pytest.raises(InputError, match="cannot write figures"):
        save_figures(single, tmp_path / "figures")


def test_every_form_has_a_colour_and_a_marker_of_its_own():
    assert len(set(COLOURS.values())) == len(COLOURS)
    assert len(set(MARKERS.values())) == len(MARKERS)
    assert set(COLOURS) == set(MARKERS)


def test_text_from_outside_is_cut_and_not_interpreted():
    assert plain("x" * 30) == "x" * 23 + "…"
    assert plain("$a$") == r"\$a\$"
