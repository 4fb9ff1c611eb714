"""The figures of predictive checks: they show the records, and all of their text can be read."""

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.checks.predictive_checks import QUANTITIES, PredictiveChecks, prior_bands
from ridgebayes.drawing.posterior import plot_posterior_checks
from ridgebayes.drawing.predictions import plot_prior_bands
from ridgebayes.drawing.style import rows_by_texture
from ridgebayes.report.figures.gallery import exact_rows, quantities_of
from tests.drawn import model_of


def checks(n, p_of_first=None):
    rng = np.random.default_rng(n)
    replicated = 0.02 + 0.01 * rng.standard_normal((500, n))
    observed = 0.025 + 1e-4 * rng.standard_normal((500, n))
    if p_of_first is not None:
        inside = 0 <= p_of_first <= 1
        observed[:, 0] = np.quantile(replicated[:, 0], 1 - p_of_first) if inside else -p_of_first
    return PredictiveChecks(tuple(QUANTITIES)[:n], observed, replicated)


@pytest.fixture(scope="module")
def bands(paper):
    model = model_of(paper, rb.Hybrid())
    return prior_bands(model, n_draw=500), exact_rows(model.data)


def drawn_checks(found):
    return plot_posterior_checks("hybrid", quantities_of(found))


def panels(figure):
    return [axes for axes in figure.axes if axes.get_visible()]


@pytest.mark.parametrize("n", [1, 2, 4, 5])
def test_checks__no_text_is_clipped_or_lies_on_other_text(n, faults):
    figure = drawn_checks(checks(n))
    assert len(panels(figure)) == n
    assert faults(figure) == ([], [])


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 2, 4, 9])
def test_bands__no_text_is_clipped_or_lies_on_other_text(bands, n, faults):
    table, rows = bands
    kept = list(rows_by_texture(rows))[:n]
    here = [pair in kept for pair in zip(table["a_over_R"], table["b_over_R"], strict=True)]
    figure = plot_prior_bands(table[here], rows, "hybrid")
    assert len(panels(figure)) == n
    assert faults(figure) == ([], [])


def test_checks__show_the_observed_value_and_the_p_value():
    found = checks(3, p_of_first=0.1)
    axes = panels(drawn_checks(found))
    for i, one in enumerate(axes):
        (line,) = one.lines
        assert line.get_xdata()[0] == pytest.approx(found.observed[:, i].mean())  # rounding
        p = found.p_values[found.names[i]]
        assert one.get_title() == f"{QUANTITIES[found.names[i]]}\n$p$ = {p:.2f}"
    assert "0.1" in axes[0].get_title()
    ends = [drawn_checks(checks(1, p)).axes[0].get_title() for p in (-1, 2)]
    assert [title.split("\n")[1] for title in ends] == ["$p$ < 0.01", "$p$ > 0.99"]


def test_bands__show_median_ends_and_rows(bands, paper):
    table, rows = bands
    first = panels(plot_prior_bands(table, rows, "hybrid"))[0]
    a, b = table.iloc[0][["a_over_R", "b_over_R"]]
    own = table[(table["a_over_R"] == a) & (table["b_over_R"] == b)]
    median, dots = first.lines
    np.testing.assert_array_equal(median.get_ydata(), np.exp(own["median"]))
    loads = paper.calibration.column("p_over_E")[
        (paper.calibration.column("a_over_R") == a) & (paper.calibration.column("b_over_R") == b)
    ]
    np.testing.assert_allclose(np.sort(dots.get_ydata()), np.sort(loads), rtol=1e-14)  # rounding
    corners = first.collections[0].get_paths()[0].vertices[:, 1].round(12)
    for side in ("lower", "upper"):
        assert set(np.exp(own[side]).round(12)) <= set(corners.tolist())


def test_no_bands_are_bad_input(bands):
    with pytest.raises(rb.InputError, match="bands: expected at least one, got none"):
        plot_prior_bands(pd.DataFrame(columns=bands[0].columns), bands[1], "hybrid")
