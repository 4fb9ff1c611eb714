"""`ridgebayes cost`: one table of errors and run times."""

from pathlib import Path

import pandas as pd

from ridgebayes.checks.cost import COST_COLUMNS

SCENE = "[texture]\nridge_width = 0.03\ngroove_width = 0.02\n[load]\np_over_E = 0.01\n"


def test_cost__writes_one_table_of_a_scene(command):
    Path("my.toml").write_text(SCENE)
    said = command("cost", "my.toml", "--no-elements", "-o", "out")
    assert said.code == 0
    assert [path.name for path in Path("out").iterdir()] == ["cost.csv"]
    costs = pd.read_csv("out/cost.csv")
    assert list(costs) == list(COST_COLUMNS)
    assert set(costs["preset"]) == {"quick", "standard", "reference"}
    assert set(costs["task"]) == {"posterior", "evidence", "loads"}
    heading, *rows, written = said.out.splitlines()
    assert heading.split() == list(COST_COLUMNS[:-1])
    assert (len(rows), written) == (9, "Written: out/cost.csv")
