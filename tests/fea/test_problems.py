"""Complaints are gathered, told once, and say what the user can do."""

import numpy as np
import pytest

from ridgebayes.fea.problems import FileError


class Source:
    where = "mine.csv"

    def spot(self, row, name):
        return f"line {row + 2}"

    def typed(self, row, name):
        return f"{name}{row}"


def told(problems):
    with pytest.raises(FileError) as caught:
        problems.raise_all(Source())
    return caught.value


def test_problems__nothing_noted_is_no_error():
    FileError("mine.csv").raise_all(Source())


def test_problems__equal_complaints_are_one_line_and_each_cell_is_told_once():
    problems = FileError("mine.csv")
    problems.cells(np.arange(9), "F", "expected a number")
    problems.cells(np.array([3]), "F", "expected above 0")
    problems.cells(np.array([2]), "a", "expected above 0")
    error = told(problems)
    assert error.wrong == [
        "column 'F', 9 cells: expected a number: "
        "line 2 = 'F0', line 3 = 'F1', line 4 = 'F2' and 6 more",
        "mine.csv, line 4, column 'a' = 'a2': expected above 0",
    ]
    assert error.is_broken


def test_problems__needs_carry_the_options_that_supply_them():
    problems = FileError("mine.csv")
    problems.need("no R", R="? mm")
    problems.need("no R", R="9 mm")
    problems.need("no a", {"a": "w1"})
    error = told(problems)
    assert (error.options, error.mapping, error.is_broken) == ({"R": "? mm"}, {"a": "w1"}, False)
    assert str(error) == "mine.csv: 2 values missing or unclear\n  no R\n  no a"
