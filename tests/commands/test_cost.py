"""`ridgebayes cost`: the files, and that better settings are better."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.checks.cost import posteriors
from ridgebayes.checks.cost.measured import COST_COLUMNS
from ridgebayes.commands import cost
from ridgebayes.commands.cost import CostRequest, cost_job


@pytest.fixture(scope="module")
def costs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("costs") / "out"
    request = CostRequest(rb.paper_sweep(), elements=False, repeats=1)
    with pytest.MonkeyPatch.context() as patch:
        # Every move, but none with so many walkers that it takes most of the time.
        patch.setattr(posteriors, "_WALKERS", dict.fromkeys(posteriors._WALKERS, (32,)))
        return folder, cost_job(folder, request)


def test_cost_job__shares_out_among_workers(tmp_path, monkeypatch):
    monkeypatch.setattr(cost, "_TASKS", {"posteriors": cost._TASKS["posteriors"]})
    monkeypatch.setattr(posteriors, "_WALKERS", {"mixture": (32,)})
    frame = cost_job(tmp_path / "out", CostRequest(rb.paper_sweep(), repeats=1), workers=2)
    assert set(frame["task"]) == {"posterior"}
    assert set(frame["status"]) == {"ok"}
    names = {"cost.csv", "cost.html", "cost-posterior.png", "cost-posterior.svg"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names
    assert "is reached most cheaply by" in (tmp_path / "out/cost.html").read_text(encoding="utf-8")


@pytest.mark.long
def test_cost_job__writes_a_table_a_page_and_figures(costs):
    folder, frame = costs
    tasks = ["loads", "small-strain-loads", "100th-transition", "posterior"]
    figures = {f"cost-{task}.{kind}" for task in tasks for kind in ("png", "svg")}
    assert {path.name for path in folder.iterdir()} == {"cost.csv", "cost.html"} | figures
    written = pd.read_csv(folder / "cost.csv")
    assert list(written) == [*COST_COLUMNS, "pareto"]
    assert len(written) == len(frame)
    assert set(frame["status"]) == {"ok"}
    page = (folder / "cost.html").read_text()
    assert page.count("<img") == len(tasks)
    assert "is reached most cheaply by" in page


def error(frame, task, method, setting, quantity):
    rows = frame[(frame["task"] == task) & (frame["method"] == method)]
    rows = rows[(rows["setting"] == setting) & (rows["quantity"] == quantity)]
    return rows["error"].item()


@pytest.mark.long
def test_cost_job__errors_fall_as_settings_are_turned_up(costs):
    _, frame = costs
    loads = ("small-strain loads", "half-plane")
    few, more = (
        error(frame, *loads, f"{n} coefficients a strip", "largest relative error") for n in (3, 6)
    )
    assert more < 0.01 * few
    assert more < 1e-6
    # Monte Carlo: 65,536 draws, whose 5 % quantile has the largest error, 2.1 of a mean's; five.
    draws = ("posterior", "importance sampling", "preset reference")
    for quantity in ("mean", "sd", "5 % quantile"):
        assert error(frame, *draws, quantity) < 5 * 2.1 / np.sqrt(65_536 * 0.8)
    # Monte Carlo: five standard errors, of about 0.002.
    assert error(frame, *draws, "ln Z") < 0.01
    for method in frame.loc[frame["task"] == "posterior", "method"].unique():
        if method.startswith("emcee"):
            assert error(frame, "posterior", method, "4 x 32 walkers", "ln Z") < 0.05


@pytest.mark.long
def test_load_settings__measure_forms_against_the_equation(costs):
    _, frame = costs
    of_loads = frame[frame["task"] == "loads"].set_index(["method", "setting"])["error"]
    assert of_loads["half-plane", "tolerance 1e-8"] < 1e-8
    assert 0.01 < of_loads["hybrid form", "printed coefficients"] < 0.2


def test_cost__as_a_command_takes_a_scene(command, monkeypatch):
    requests = []

    def canned(folder, request, **options):
        requests.append(request)
        return pd.DataFrame(columns=[*COST_COLUMNS, "pareto"])

    monkeypatch.setattr("ridgebayes.commands.cost.cost_job", canned)
    Path("my.toml").write_text(
        "[texture]\nridge_width = 0.03\ngroove_width = 0.02\n[load]\np_over_E = 0.01\n"
    )
    said = command("cost", "my.toml", "--no-elements", "-o", "out")
    assert (said.code, said.out) == (0, "out: 0 rows; look at out/cost.html\n")
    (asked,) = requests
    assert (asked.texture, asked.p_max, asked.elements) == ((0.03, 0.02), 0.01, False)
    assert asked.table.textures == ((0.03, 0.02),)
