"""What reports show, computed from tables that are not the embedded sweep."""

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.checks.report_data import Consequence, consequence_of, report_data
from ridgebayes.model.forms import form_named
from ridgebayes.report.figures.gallery import figures_of


def test_panels__of_counts_alone_go_beyond_each_textures_loads():
    form = form_named("modified")
    a, b, p = np.meshgrid([0.02], [0.01, 0.02], [0.001, 0.004, 0.016], indexing="ij")
    q = form.count(p, a, b)
    columns = {"a_over_R": a, "b_over_R": b, "p_over_E": p, "Q": q}
    frame = pd.DataFrame({name: values.ravel() for name, values in columns.items()})
    table = rb.read_table(frame.assign(kind="count"))
    bands = report_data(rb.compare(table, [form], noise="iid", accuracy="quick")).bands
    highest = bands.groupby(["a_over_R", "b_over_R"])["p_over_E"].max()
    # Definition: a panel ends 1.6 times beyond its texture's highest load.
    assert highest.tolist() == pytest.approx([1.6 * 0.016] * 2, rel=1e-12)
    assert bands["q_mean"].notna().all()


def test_panels__of_more_textures_than_a_figure_holds_have_those_shown_first():
    form, rng = form_named("modified"), np.random.default_rng(1)
    # Of b/a the middle ones first: the narrowest, the widest and the middle come last.
    b = np.r_[np.linspace(0.012, 0.018, 6), np.linspace(0.022, 0.028, 6), 0.005, 0.05, 0.02]
    columns = {
        "a_over_R": np.repeat(0.02, 30),
        "b_over_R": np.repeat(b, 2),
        "Q": np.tile([4, 6], 15),
    }
    loads = form.load(columns["Q"], columns["a_over_R"], columns["b_over_R"], np.array([1.38]))
    columns["p_over_E"] = loads * np.exp(0.01 * rng.standard_normal(30))
    table = rb.read_table(pd.DataFrame(columns))
    data = report_data(rb.compare(table, [form], noise="iid", accuracy="quick"))
    drawn = list(dict.fromkeys(data.bands["b_over_R"]))
    assert [b for _, b in data.textures] == [0.005, 0.05, 0.02]
    assert drawn == [*b[:9], *b[12:]]  # in the table's order
    first = figures_of(data)["bands-first"]()
    assert sum(axes.get_visible() for axes in first.axes) == 3


def test_consequence_of__is_that_of_fitted_textures_up_to_their_largest_loads():
    columns = ["form", "a_over_R", "p_over_E", "q_median", "q_lower", "q_upper"]
    rows = [
        ("hybrid", 0.01, 0.001, 4, 4, 6),
        ("hybrid", 0.01, 0.002, 8, 6, 10),
        ("hybrid", 0.01, 0.004, 10, 6, 20),  # beyond what was seen
        ("modified", 0.01, 0.001, 4, 4, 4),
        ("modified", 0.01, 0.002, 6, 6, 6),
        ("modified", 0.01, 0.004, 20, 6, 60),
        ("hybrid", 0.02, 0.001, 4, 2, 40),  # held out
        ("modified", 0.02, 0.001, 40, 4, 4),
    ]
    bands = pd.DataFrame(rows, columns=columns).assign(b_over_R=0.02, kind_of_band="simulation")
    curve = bands.assign(kind_of_band="curve", q_median=100, q_upper=200)
    seen = pd.DataFrame({"a_over_R": [0.01], "b_over_R": [0.02], "p_over_E": [0.003]})
    both = pd.concat([bands, curve])
    assert consequence_of(both, "hybrid", "modified", seen) == Consequence(1, "modified", 2, 4)
    assert consequence_of(both, "hybrid", "", seen) == Consequence(1, "", 0, 4)
