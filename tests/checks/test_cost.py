"""Errors and run times of the presets."""

import pytest

import ridgebayes as rb
from ridgebayes.checks.cost import COST_COLUMNS


def test_cost__keep_every_promise(paper):
    costs = rb.cost(paper.frame, "modified", rng=3)
    assert list(costs) == list(COST_COLUMNS)
    assert costs["status"].unique().tolist() == ["ok"]
    assert (costs["error"] < costs["target_error"]).all()
    assert (costs["cpu_s"] > 0).all()
    by_preset = costs.set_index(["task", "preset"])["error"]
    # Discretisation: 4 coefficients a strip, then 8.
    assert by_preset["loads", "standard"] < by_preset["loads", "quick"] / 10


def test_cost__of_no_loads_say_why(paper):
    costs = rb.cost(paper.frame[:1].assign(p_over_E=1e-4), rb.Modified(), elements=True, rng=3)
    failed = costs[costs["status"] != "ok"]
    assert failed["task"].tolist() == ["finite elements"] * 3
    assert failed["status"].str.contains("a transition under p/E = 0.0001").all()
    assert failed["cpu_s"].isna().all()
    with pytest.raises(rb.InputError, match=r"a_over_R = -0.01: input should be greater than 0"):
        rb.cost(paper, texture=(-0.01, 0.03))


@pytest.mark.long
def test_cost__of_finite_elements_are_below_the_meshes_standard_error():
    table = rb.generate(rb.Scene.of([(0.032, 0.01)], p_over_E=0.0045))
    costs = rb.cost(table, rb.Modified(), elements=True, rng=3)
    elements = costs[costs["method"].str.startswith("finite elements")].set_index("preset")
    assert elements["error"].isna().tolist() == [False, False, True]
    # Discretisation: three standard errors of each mesh, which share them with the finest.
    assert (elements["error"][:2] < 3 * elements["target_error"][:2]).all()
