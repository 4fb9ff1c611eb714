"""What reports show, computed from tables that are not the embedded sweep."""

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.checks.report_data import report_data
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
