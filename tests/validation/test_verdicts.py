"""Counts of the verdict study, and their figure."""

import pandas as pd

from tests.validation.verdicts import Cell, drawn, summarised
from tests.validation.verdicts_figure import plot_verdicts

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


def test_figure__bars_of_a_cell_fill_it():
    nine, four = plot_verdicts(summarised(FOUND)).axes
    assert [axes.get_title() for axes in (nine, four)] == [
        "9 textures, 3 tables a cell",
        "4 textures, 1 tables a cell",
    ]
    first = [bar for bar in nine.patches if round(bar.get_y() + 0.4) == 0]
    assert sum(abs(bar.get_width()) for bar in first) > 1 - 1e-12


def test_drawn__two_series_lie_five_percent_apart():
    table = drawn(Cell("modified", "series", 9, 0))
    assert sorted(table.frame["series"].unique()) == ["one", "two"]
    assert len(drawn(Cell("classic", "iid 0.03", 4, 3)).textures) == 4
