"""Where the header stands."""

import pytest

from ridgebayes.errors import InputError
from ridgebayes.fea.layout import find_layout
from ridgebayes.fea.problems import FileError

HEADER, ROW = ["Ridge [mm]", "Groove [mm]", "Q", "F"], ["0.2", "0,1", "4", "1'000.5"]


def layout(*rows, **options):
    return find_layout(list(enumerate(rows, start=1)), "mine.csv", **options)


@pytest.mark.parametrize(
    "titles",
    [
        [],
        [["Test 7"]],
        [["Radius", "8", "mm"], ["by", "me", "on", "3.4."]],
        [["Ridges of a cylinder", "", "", ""], ["Load in N", "", "", ""]],
    ],
)
def test_find_layout__passes_over_titles(titles):
    found = layout(*titles, HEADER, ROW, ROW)
    assert found.headers == HEADER
    assert found.first == len(titles) + 1


def test_find_layout__a_row_of_units_joins_the_header_where_it_has_none():
    found = layout(["Ridge", "Groove [um]", "Q", "F"], ["mm", "um", "-", "(N/mm)"], ROW)
    assert found.headers == ["Ridge [mm]", "Groove [um]", "Q", "F [N/mm]"]
    assert found.first == 2
    assert found.messages == ("mine.csv: units in line 2",)


def test_find_layout__rows_above_the_header_are_not_lost_as_titles():
    with pytest.raises(
        FileError, match=r"numbers above the header in line 3, in line 1, 2"
    ) as told:
        layout(ROW, ROW, HEADER, ROW)
    assert told.value.options == {"header_row": "3"}
    assert layout(ROW, ROW, HEADER, ROW, header_row=3).first == 3


def test_find_layout__numbers_may_be_headers_among_words():
    assert layout(["a_over_R", "b_over_R", "4", "6", "8"], ["1", "2", "3", "4", "5"]).first == 1


def test_find_layout__a_bad_cell_is_no_header():
    assert layout(HEADER, ROW, ["0.2", "n/a", "none", "x"], ROW, ROW).first == 1


def test_find_layout__without_a_header_columns_have_numbers():
    found = layout(ROW, ROW)
    assert (found.headers[-1], found.first) == ("column 4", 0)
    assert layout(HEADER, ROW, header_row=0).first == 0


def test_find_layout__the_user_has_the_last_word():
    assert layout(HEADER, ["w", "x", "y", "z"], ROW, header_row=2).headers == ["w", "x", "y", "z"]
    with pytest.raises(InputError, match=r"--header-row 7"):
        layout(HEADER, ROW, header_row=7)
