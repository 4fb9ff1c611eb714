"""What reports show, computed from tables that are not the embedded sweep."""

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.checks.report_data import Consequence, consequence_of, report_data
from ridgebayes.model.forms import form_named


def test_panels__of_counts_alone_go_beyond_each_textures_loads():
    form = form_named("modified")
    a, b, p = np.meshgrid([0.02], [0.01, 0.02], [0.001, 0.004, 0.016], indexing="ij")
    q = form.count(p, a, b)
    columns = {"a_over_R": a, "b_over_R": b, "p_over_E": p, "Q": q}
    frame = pd.DataFrame({name: values.ravel() for name, values in columns.items()})
    table = rb.read_table(frame.assign(kind="count"))
    settings = rb.SampleSettings(n_walker=16, n_step_max=100)
    bands = report_data(rb.compare(table, [form], noise="iid", settings=settings)).bands
    highest = bands.groupby(["a_over_R", "b_over_R"])["p_over_E"].max()
    # Definition: a panel ends 1.6 times beyond its texture's highest load.
    assert highest.tolist() == pytest.approx([1.6 * 0.016] * 2, rel=1e-12)
    assert bands["q_mean"].notna().all()


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
