import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes

import ridgebayes as rb
from ridgebayes.drawing import records
from tests.drawn import loads_of

SURVIVAL = np.array([[1.0, 0.75, 0.25], [1.0, 1.0, 0.5]])


@pytest.fixture(autouse=True)
def _without_a_display():
    matplotlib.use("Agg")
    yield
    records.pyplot.close("all")


def q_distribution():
    places = {"a_over_R": 0.02, "b_over_R": 0.01, "nu": 0.5, "p_over_E": np.array([0.01, 0.02])}
    places = {name: np.broadcast_to(value, 2) for name, value in places.items()}
    return rb.QDistribution(SURVIVAL, np.zeros(2, np.uint8), 6, "simulation", places=places)


def load_distribution(log_mean=-5.0):
    return loads_of(np.array([log_mean]), np.array([0.1]), np.ones(1))


DRAWN = {
    "table": rb.paper_sweep,
    "plan": lambda: rb.plan(rb.Scene.of([(0.02, 0.03)]))[0],
    "counts": q_distribution,
    "count": lambda: rb.QDistribution(SURVIVAL[0], np.zeros((), np.uint8), 6, "curve"),
    "load": load_distribution,
}


def test_plot__the_legend_of_many_textures_covers_nothing_and_is_whole():
    axes = rb.paper_sweep().plot()  # ten textures
    axes.figure.canvas.draw()
    legend, panel = axes.get_legend().get_window_extent(), axes.get_window_extent()
    assert len(axes.get_legend().get_texts()) == 10
    assert legend.x0 > panel.x1
    whole = axes.figure.bbox
    assert legend.x1 <= whole.x1
    assert legend.y0 >= 0
    few = rb.read_table(rb.paper_sweep().frame.iloc[:12]).plot()
    few.figure.canvas.draw()
    assert few.get_legend().get_window_extent().x1 < few.get_window_extent().x1


@pytest.mark.parametrize("record", DRAWN.values(), ids=DRAWN)
def test_plot__draws_on_new_axes_or_those_given_and_returns_them(record):
    one = record()
    new = one.plot()
    assert isinstance(new, Axes)
    assert new.has_data()
    assert one.plot(new) is new
    new.figure.canvas.draw()
    assert "<table" in one._repr_html_()
    assert isinstance(one.to_dataframe(), pd.DataFrame)
    assert len(repr(one)) < 200


def test_plot_of_a_table__names_its_curves_and_says_how_many_are_not_shown():
    frame = rb.paper_sweep().frame
    axes = rb.ContactTable.from_frame(frame).plot()
    assert axes.get_legend().get_texts()[0].get_text() == "a0.012_b0.01"
    more = [frame.assign(series=str(i)) for i in range(2)]
    axes = rb.ContactTable.from_frame(pd.concat(more)).plot()
    assert axes.get_legend().get_texts()[0].get_text().endswith("series 0")
    assert axes.get_title() == "the first 12 of 20"


def test_plot_of_a_table__rounds_long_labels():
    rows = {"a_over_R": 0.25 / 9, "b_over_R": 0.2 / 9, "Q": [4, 6], "p_over_E": [0.001, 0.004]}
    axes = rb.ContactTable.from_frame(pd.DataFrame(rows)).plot()
    (text,) = axes.get_legend().get_texts()
    assert text.get_text() == "a0.027778_b0.022222"


def test_plot_of_a_table__refuses_one_without_a_row_to_draw():
    frame = rb.paper_sweep().frame.assign(status="not converged")
    with pytest.raises(rb.InputError, match="table: expected a row with status ok to plot"):
        rb.ContactTable.from_frame(frame).plot()


def test_draw_loads__has_an_interval_for_each_count():
    rows = {"a_over_R": 0.02, "b_over_R": 0.01, "Q": [4, 6], "kind_of_band": "curve", "prob": 0.9}
    ends = {"p_over_E_median": [1, 2], "p_over_E_lower": [0.9, 1.8], "p_over_E_upper": [1.2, 2.1]}
    axes = records.draw_loads(pd.DataFrame(rows | ends), None)
    assert len(axes.containers) == 1
    assert axes.get_yscale() == "log"


def test_draw_errors_and_forms__show_every_row():
    ends = {"p_over_E_median": [1.1], "p_over_E_lower": [0.9], "p_over_E_upper": [1.2]}
    told = {"p_over_E_observed": [1.0], "kind_of_band": "simulation", "prob": 0.9}
    axes = records.draw_errors(pd.DataFrame(ends | told), "hybrid", None)
    assert axes.get_title() == "Hybrid"
    forms = {"form": ["hybrid", "classic"], "ln_bf": [0.0, -9.0], "model_probability": [1.0, 1e-4]}
    axes = records.draw_forms(pd.DataFrame(forms), None)
    assert [text.get_text() for text in axes.get_yticklabels()] == ["Hybrid", "Classic"]
    assert len(axes.patches) == 2
