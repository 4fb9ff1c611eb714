"""Text of cells between separators: what is recognised, and what is refused with its line."""

import numpy as np
import pytest

from ridgebayes.errors import InputError
from ridgebayes.fea.delimited import DelimitedText

GOOD = "a,b,Q\n0.03,0.01,4\n0.02,0.04,6\n"


def read(text, numeric=("a", "b", "Q"), path="mine.csv"):
    content = text if isinstance(text, bytes) else text.encode()
    return DelimitedText(path, content).read(set(numeric))


def refusal(text, **options):
    with pytest.raises(InputError) as caught:
        read(text, **options)
    assert "mine.csv" in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("tail", ["", "\n\n", "  \n", ",,\n,,\n"])
def test_read__separators_line_ends_and_blank_lines_change_nothing(separator, end, mark, tail):
    text = (GOOD + tail).replace(",", separator).replace("\n", end)
    cells = read(mark + text.encode())
    assert cells.frame["a"].tolist() == [0.03, 0.02]
    assert cells.frame["Q"].tolist() == [4, 6]
    assert cells.lines[1] == 3


def test_read__decimal_commas_are_recognised_and_said():
    cells = read("a;b;Q\n0,032;1e-2;4\n+1,5;,25;6\n")
    assert cells.frame["a"].tolist() == [0.032, 1.5]
    assert cells.frame["b"].tolist() == [0.01, 0.25]
    assert "decimal comma" in cells.messages[0]


def test_read__decimal_commas_are_the_numbers_python_reads():
    values = np.random.default_rng(1).random(2000) * 10.0 ** np.arange(-10, 10).repeat(100)
    text = "a;b\n" + "".join(f"{v!r};1\n".replace(".", ",") for v in values.tolist())
    assert read(text, ("a", "b")).frame["a"].tolist() == values.tolist()


def test_read__decimal_points_are_the_numbers_python_reads():
    values = np.random.default_rng(2).random(2000) * 10.0 ** np.arange(-10, 10).repeat(100)
    text = "a,b\n" + "".join(f"{v!r},1\n" for v in values.tolist())
    assert read(text, ("a", "b")).frame["a"].tolist() == values.tolist()


def test_read__text_columns_may_hold_both_marks():
    cells = read("a;b;n\n0,5;1;1.5, or so\n", ("a", "b"))
    assert cells.frame["n"].tolist() == ["1.5, or so"]


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (
            "0,03;0.01;4",
            "line 2, column 'a' = '0,03': but line 2, column 'b' = '0.01': expected one",
        ),
        ("1,234;2;4\n5,678;2;6", "column 'a' = '1,234': may be a decimal comma or a thousands"),
        ("1.234,5;1;4", "column 'a' = '1.234,5': expected a finite number"),
        ("1,234,567;1;4", "column 'a' = '1,234,567': expected a finite number"),
        ("1 234;1;4", "column 'a' = '1 234': expected a finite number"),
        ("1'234;1;4", "expected a finite number"),
    ],
)
def test_read__marks_that_could_mean_two_things_are_refused(rows, words):
    assert words in refusal(f"a;b;Q\n{rows}\n")


def test_read__quoted_decimal_commas_between_commas_are_refused():
    text = refusal('a,b,Q\n"0,03",1,4\n')
    assert "line 2, column 'a' = '0,03': expected a point for decimals" in text


@pytest.mark.parametrize(
    "cell", ["1e400", "-1e999", "inf", "nan", "true", "TRUE", "0x10", "1_0", "1d5", "١", "5%", "."]
)
@pytest.mark.parametrize("other", ["1", "0", "0.5"])
def test_read__what_is_no_finite_number_is_refused_with_line_and_column(cell, other):
    text = refusal(f"a,b,Q\n{other},1,4\n{cell},2,6\n")
    assert f"mine.csv, line 3, column 'a' = {cell!r}: expected a finite number" in text


def test_read__a_quoted_line_break_moves_the_lines_below():
    text = refusal('a,b,n\n1,1,"two\nlines"\n1,x,y\n', numeric=("a", "b"))
    assert "line 4, column 'b' = 'x'" in text


@pytest.mark.parametrize("word", ["true", "False"])
def test_read__a_column_of_truth_values_is_not_ones_and_zeros(word):
    assert f"line 2, column 'b' = {word!r}" in refusal(f"a,b,Q\n1,{word},4\n2,{word},4\n")


@pytest.mark.parametrize("row", ["\r,0.5,4", '"",0.5,4', " \n,0.5,4"])
def test_read__an_empty_first_cell_stays_where_it_is(row):
    frame = read(f"a,b,Q\n{row}\n1,2,6\n").frame
    np.testing.assert_array_equal(frame["a"], [np.nan, 1])
    assert frame["b"].tolist() == [0.5, 2]


@pytest.mark.parametrize("cell", ["=1+1", " =A1", '"=1,5"'])
def test_delimited__formulas_are_refused_in_any_column(cell):
    assert "line 3, column 'n' = '" in refusal(f"a,b,n\n1,2,ok=1\n1,2,{cell}\n")


def test_delimited__an_equals_sign_within_text_is_none():
    assert read("a,b,n\n1,2,x=1\n1,2,a;=b\n", ("a", "b")).frame["n"].tolist() == ["x=1", "a;=b"]


def test_delimited__ragged_rows_name_their_lines():
    text = refusal("a,b,Q\n1,2,3\n1,2\n\n1,2,3,4\n")
    assert "line 3: '1,2' has 2 cells: expected 3 cells" in text
    assert "line 5: '1,2,3,4' has 4 cells" in text


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("n,b\né,1\n".encode("latin-1"), "line 2: byte 0xe9 is not UTF-8"),
        (GOOD.encode("utf-16"), "line 1: begins as UTF-16"),
        (GOOD.encode("utf-16-be"), "line 1: a zero byte"),
        (b"a,b\n1,2\n1,\0\n", "line 3: a zero byte"),
        (b"\xef\xbb\xbf \n", "the file is empty"),
        (b"a,b\n", "no rows below the header"),
        (b"a,b\n\n,\n", "no rows below the header"),
        (b"a\n1\n", "one column only"),
        (b"a,a\n1,2\n", "column 2 = 'a': expected each header once"),
        (b"a, a \n1,2\n", "expected each header once"),
        (b"a,\n1,2\n", "column 2 has cells but no header"),
        (b"a,=b\n1,2\n", "formulas"),
        (b'a,b\n1,"2\n', "not CSV"),
        (b'a,b\n1,"2"x\n', "line 2: not CSV"),
    ],
)
def test_delimited__what_is_no_table_is_refused_in_words(content, words):
    assert words in refusal(content, numeric=())


@pytest.mark.parametrize(
    ("header", "words"),
    [
        (",".join(map(str, range(2001))), "2001 columns; expected at most 2000"),
        ("a," + 501 * "_", "expected at most 500 characters"),
    ],
)
def test_delimited__absurd_headers_are_refused(header, words):
    assert words in refusal(f"{header}\n1,2\n", numeric=())


def test_read__a_long_cell_of_digits_is_refused_soon():
    # Backtracking over its digits would take minutes.
    assert "column 'a'" in refusal(f"a,b,Q\n{130_000 * '9'}x,1,4\n")


def test_delimited__a_cell_without_end_is_refused():
    assert "field larger" in refusal('a,b\n1,"' + 200_000 * "x" + '"\n', numeric=("a",))


def test_read__own_columns_become_numbers_only_where_nothing_is_lost():
    cells = read("a,n,m\n1,1,007\n2,2,8\n", ("a",))
    assert cells.frame["n"].tolist() == [1, 2]
    assert cells.frame["m"].tolist() == ["007", "8"]


def test_read__a_column_without_name_or_cells_is_passed_over():
    assert list(read("a,b,\n1,2,\n", ("a", "b")).frame) == ["a", "b"]
