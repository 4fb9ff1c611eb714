"""The figures of predictive checks: they show the records, and all of their text can be read."""

import numpy as np
import pandas as pd
import pytest

from ridgebayes.checks.predictive_checks import QUANTITIES, PredictiveChecks, prior_bands
from ridgebayes.drawing.style import as_bytes
from ridgebayes.errors import InputError
from ridgebayes.model.forms import Hybrid
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations
from ridgebayes.report.figures.predictive_checks import plot_posterior_checks, plot_prior_bands


def checks(n, p_of_first=None):
    rng = np.random.default_rng(n)
    replicated = 0.02 + 0.01 * rng.standard_normal((500, n))
    observed = 0.025 + 1e-4 * rng.standard_normal((500, n))
    if p_of_first is not None:
        inside = 0 <= p_of_first <= 1
        observed[:, 0] = np.quantile(replicated[:, 0], 1 - p_of_first) if inside else -p_of_first
    return PredictiveChecks("hybrid", "iid", tuple(QUANTITIES)[:n], observed, replicated, 0)


@pytest.fixture(scope="module")
def bands(paper):
    model = Model(Observations.from_table(paper), Hybrid())
    return prior_bands(model, n_draw=500), model.data


def panels(figure):
    return [axes for axes in figure.axes if axes.get_visible()]


@pytest.mark.parametrize("n", [1, 2, 4, 5])
def test_checks__no_text_is_clipped_or_lies_on_other_text(n, faults):
    figure = plot_posterior_checks(checks(n))
    assert len(panels(figure)) == n
    assert faults(figure) == ([], [])


@pytest.mark.parametrize("n", [1, 2, 4, 9])
def test_bands__no_text_is_clipped_or_lies_on_other_text(bands, n, faults):
    table, data = bands
    kept = data.textures[:n]
    here = [pair in kept for pair in zip(table["a_over_R"], table["b_over_R"], strict=True)]
    figure = plot_prior_bands(table[here], data, "hybrid")
    assert len(panels(figure)) == n
    assert faults(figure) == ([], [])


def test_checks__show_the_observed_value_and_the_p_value():
    found = checks(3, p_of_first=0.1)
    axes = panels(plot_posterior_checks(found))
    for i, one in enumerate(axes):
        (line,) = one.lines
        assert line.get_xdata()[0] == pytest.approx(found.observed[:, i].mean())  # rounding
        p = found.p_values[found.names[i]]
        assert one.get_title() == f"{QUANTITIES[found.names[i]]}\n$p$ = {p:.3f}"
    assert "0.1" in axes[0].get_title()
    ends = [plot_posterior_checks(checks(1, p)).axes[0].get_title() for p in (-1, 2)]
    assert [title.split("\n")[1] for title in ends] == ["$p$ < 0.001", "$p$ > 0.999"]


def test_bands__show_median_ends_and_rows(bands):
    table, data = bands
    first = panels(plot_prior_bands(table, data, "hybrid"))[0]
    a, b = table.iloc[0][["a_over_R", "b_over_R"]]
    own = table[(table["a_over_R"] == a) & (table["b_over_R"] == b)]
    median, dots = first.lines
    np.testing.assert_array_equal(median.get_ydata(), np.exp(own["median"]))
    rows = data.texture == data.textures.index((a, b))
    np.testing.assert_array_equal(np.sort(dots.get_ydata()), np.sort(np.exp(data.log_load[rows])))
    corners = first.collections[0].get_paths()[0].vertices[:, 1].round(12)
    for side in ("lower", "upper"):
        assert set(np.exp(own[side]).round(12)) <= set(corners.tolist())


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_equal_records_give_equal_bytes(bands, kind):
    first, again = (as_bytes(plot_posterior_checks(checks(2)), kind) for _ in range(2))
    assert first == again
    first, again = (as_bytes(plot_prior_bands(*bands, "hybrid"), kind) for _ in range(2))
    assert first == again


def test_no_bands_are_bad_input(bands):
    with pytest.raises(InputError, match="bands: expected at least one, got none"):
        plot_prior_bands(pd.DataFrame(columns=bands[0].columns), bands[1], "hybrid")
