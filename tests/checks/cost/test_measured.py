"""Timing of one setting, the front of the best ones, and what is said of them."""

import time

import numpy as np
import pandas as pd
import pytest

from ridgebayes.checks.cost.measured import COST_COLUMNS, Setting, cheapest, measure, pareto


def setting(compute):
    return Setting("task", "method", "knob", compute, "truth")


def test_measure__counts_runs_and_gives_a_row_a_quantity():
    calls = []

    def compute():
        calls.append(1)
        time.sleep(0.011)
        return {"mean": -0.25, "sd": 0.5}

    rows = measure(setting(compute), repeats=4)
    assert [(row["quantity"], row["error"]) for row in rows] == [("mean", 0.25), ("sd", 0.5)]
    assert all(set(row) == set(COST_COLUMNS) for row in rows)
    assert rows[0]["repeats"] == 4
    assert len(calls) == 5  # and one for the memory
    assert rows[0]["wall_s"] > 0.011 > rows[0]["cpu_s"]


def test_measure__runs_what_is_quick_often_and_warm():
    calls = []
    (row,) = measure(setting(lambda: calls.append(1) or {"x": 0.0}), repeats=2)
    assert (row["repeats"], len(calls)) == (25, 27)


def test_measure__memory_is_that_of_arrays():
    (row,) = measure(setting(lambda: {"x": float(np.ones(2**20).sum())}), repeats=1)
    assert row["peak_MiB"] == pytest.approx(8.0, abs=0.1)  # objects of Python beside it


def test_measure__a_failure_is_a_row():
    def fails():
        raise ValueError("no such thing")

    (row,) = measure(setting(fails))
    assert row["status"] == "failed: no such thing"
    assert np.isnan(row["error"])
    assert set(row) == set(COST_COLUMNS)


@pytest.fixture
def frame():
    rows = [("slow", 3.0, 1e-4), ("good", 1.0, 5e-3), ("worse", 2.0, 2e-2), ("quick", 0.1, 0.08)]
    return pd.DataFrame(
        {
            "task": "t",
            "method": [name for name, _, _ in rows],
            "setting": "s",
            "quantity": "q",
            "cpu_s": [cpu for _, cpu, _ in rows],
            "error": [error for _, _, error in rows],
            "status": "ok",
        }
    )


def test_pareto__is_what_no_other_beats_in_both(frame):
    assert frame["method"][pareto(frame)].tolist() == ["slow", "good", "quick"]


def test_pareto__leaves_failures_out(frame):
    frame.loc[1, "status"] = "failed: x"
    assert frame["method"][pareto(frame)].tolist() == ["slow", "worse", "quick"]


def test_cheapest__names_the_quickest_that_is_good_enough(frame):
    said = cheapest(frame)
    assert [line.split(" by ")[1].split(" (")[0] for line in said] == ["quick", "good", "slow"]
    assert cheapest(frame[:0]) == []
    assert cheapest(frame[3:])[1] == "t, q: nothing here reaches 0.01."
