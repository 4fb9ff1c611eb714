"""Q against load shows what was observed, and no more."""

import numpy as np
import pandas as pd
import pytest

from ridgebayes.drawing.predictions import plot_bands


def _bands(most):
    p = np.linspace(0.0, most, 50)
    columns = {"form": "hybrid", "a_over_R": 0.02, "b_over_R": 0.02, "p_over_E": p, "prob": 0.9}
    frame = pd.DataFrame(columns | {"q_lower": 2, "q_upper": 4, "extrapolation": False})
    return pd.concat([frame.assign(kind_of_band=kind) for kind in ("simulation", "curve")])


def _rows(counts, loads, lower=np.nan):
    columns = {"a_over_R": 0.02, "b_over_R": 0.02, "Q": counts, "p_over_E": loads}
    frame = pd.DataFrame(columns | {"p_over_E_lower": lower})
    return frame.assign(nu=0.5, solver="lab", series="", role="calibration")


@pytest.mark.parametrize(("first", "start"), [(4, 0.0), (8, 0.01)])
def test_observed_steps__begin_at_zero_only_with_the_first_transition(first, start):
    figure = plot_bands(_bands(0.02), _rows([first, first + 2], [0.01, 0.015]), "hybrid")
    (line, dots) = figure.axes[0].lines
    assert line.get_xdata()[0] == start
    assert list(dots.get_ydata()) == [first, first + 2]


def test_loads__in_a_unit_are_those_of_the_bands_and_of_the_rows():
    rows = _rows([4, 6], [0.01, 0.015], [0.009, 0.013])
    (axes,) = plot_bands(_bands(0.02), rows, "hybrid", unit=(60.0, "$kPa$")).axes
    assert axes.get_xlim()[1] == pytest.approx(1.2)
    assert axes.lines[1].get_xdata() == pytest.approx([0.6, 0.9])
    (bars,) = (one for one in axes.collections if hasattr(one, "get_segments"))
    assert bars.get_segments()[0][:, 0] == pytest.approx([0.54, 0.6])
    assert axes.get_xlabel() == "load in \\$kPa\\$ (square-root scale)\n= $p/E$ times 60 \\$kPa\\$"


def test_increments__are_drawn_and_named():
    rows = _rows([4, 6], [0.01, 0.015], [0.009, 0.013])
    figure = plot_bands(_bands(0.02), rows, "hybrid")
    (bars,) = (one for one in figure.axes[0].collections if hasattr(one, "get_segments"))
    ends = [segment.tolist() for segment in bars.get_segments()]
    assert ends == [[[0.009, 3], [0.01, 3]], [[0.013, 5], [0.015, 5]]]
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "increment" in names
    without = plot_bands(_bands(0.02), _rows([4, 6], [0.01, 0.015]), "hybrid")
    assert "increment" not in [text.get_text() for text in without.legends[0].get_texts()]


@pytest.mark.slow
@pytest.mark.parametrize(
    "most",
    [
        pytest.param(most, marks=[pytest.mark.long] * (i % 2))
        for i, most in enumerate(np.geomspace(3e-4, 3.0, 23).tolist())
    ],
)
def test_labels__of_loads_do_not_meet_and_counts_are_even(most, faults):
    tables = [(_bands(most), _rows([4], [most / 2])) for _ in range(3)]
    bands, rows = (
        pd.concat(one.assign(a_over_R=0.02 + 0.01 * i) for i, one in enumerate(group))
        for group in zip(*tables, strict=True)
    )
    figure = plot_bands(bands, rows, "hybrid", untitled=True)
    assert faults(figure) == ([], [])
    assert all(count % 2 == 0 for count in figure.axes[0].get_yticks())
    assert sum(0 <= load <= most for load in figure.axes[0].get_xticks()) >= 2


def _named(bands, rows):
    figure = plot_bands(bands, rows, "hybrid")
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_legend__names_what_there_is_and_no_more():
    bands, rows = _bands(0.02), _rows([4, 6], [0.01, 0.015])
    assert _named(bands, rows) == ["observed", "curve, 90 %", "simulation, 90 %"]
    beyond = bands.assign(extrapolation=bands["p_over_E"] > 0.01)
    alone = beyond[beyond["kind_of_band"] == "simulation"]
    assert _named(alone, rows.iloc[:0]) == ["simulation, 90 %", "extrapolation"]
    elsewhere = rows.assign(a_over_R=0.03)
    assert _named(bands, elsewhere) == ["curve, 90 %", "simulation, 90 %"]
