"""Counts of the verdict study, and their figure."""

import pandas as pd

from studies.verdicts import Cell, drawn, summarised

FOUND = pd.DataFrame(
    [
        ("hybrid", "iid 0.01", 9, "decisive", "hybrid"),
        ("hybrid", "iid 0.01", 9, "supports", "modified"),
        ("hybrid", "iid 0.01", 9, "undecided", "modified"),
        ("hybrid c2 = 0.03", "iid 0.01", 4, "decisive", "hybrid"),
    ],
    columns=["truth", "errors", "n_texture", "grade", "form"],
)


def test_summarised__counts_the_right_and_the_wrong_form_of_each_grade():
    rows = summarised(FOUND).to_dict("tight")["data"]
    assert rows == [
        ["hybrid", "iid 0.01", 9, 3, "decisive", 1, 0],
        ["hybrid", "iid 0.01", 9, 3, "supports", 0, 1],
        ["hybrid", "iid 0.01", 9, 3, "undecided", 0, 1],
        ["hybrid c2 = 0.03", "iid 0.01", 4, 1, "decisive", 1, 0],
    ]


def test_drawn__two_series_lie_five_percent_apart():
    table = drawn(Cell("modified", "series", 9, 0))
    assert sorted(table.frame["series"].unique()) == ["one", "two"]
    assert len(drawn(Cell("classic", "iid 0.03", 4, 3)).textures) == 4
