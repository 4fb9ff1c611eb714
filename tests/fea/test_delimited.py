"""Text of cells between separators: what is recognised, and what is refused with its line."""

from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.fea.delimited import read_delimited
from ridgebayes.fea.record import FileError, Given

CONTROLLED = (("", ".08"), ("0.08", ""), ("", ""))
GOOD = "a,b,Q\n0.03,0.01,4\n0.02,0.04,6\n"


class Read(NamedTuple):
    frame: pd.DataFrame
    row: np.ndarray
    lines: np.ndarray
    messages: list[str]


def read(text, numeric=("a", "b", "Q"), path="mine.csv", **how):
    content = text if isinstance(text, bytes) else text.encode()
    problems = FileError(path, Given(**how))
    source = read_delimited(content, problems)
    cells = source.read(set(numeric), problems)
    problems.raise_all(source)
    rows = cells.index.to_numpy()
    return Read(cells, rows, source.lines[rows], problems.messages)


def refusal(text, **options):
    with pytest.raises(rb.InputError) as caught:
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


@pytest.mark.parametrize(("mark", "separator"), [(",", ";"), (".", ",")])
def test_read__decimals_are_the_numbers_python_reads(mark, separator):
    values = np.random.default_rng(1).random(2000) * 10.0 ** np.arange(-10, 10).repeat(100)
    rows = "".join(f"{v!r}".replace(".", mark) + f"{separator}1\n" for v in values.tolist())
    assert read(f"a{separator}b\n{rows}", ("a", "b")).frame["a"].tolist() == values.tolist()


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("0,03;0.01;4", "line 2, column 'a' = '0,03': expected a finite number, with a point"),
        ("1,234;2;4\n5,678;2;6", "cells such as '1,234' may have a decimal comma or thousands"),
        ("1.234;25;4\n-5.678;2;6", "cells such as '1.234' may have a decimal point or thousands"),
        ("1.234,5;1.5;4", "column 'a' = '1.234,5': expected a finite number"),
        ("1,23,456;1;4", "column 'a' = '1,23,456': expected a finite number"),
        ("1 23;1;4", "column 'a' = '1 23': expected a finite number"),
        ("1'23;1;4", "expected a finite number"),
    ],
)
def test_read__marks_that_could_mean_two_things_are_refused(rows, words):
    assert words in refusal(f"a;b;Q\n{rows}\n")


@pytest.mark.parametrize(
    ("rows", "number", "said"),
    [
        ('"0,03";"1";4', 0.03, "separator ';', decimal comma"),
        ("1.234,5;1;4", 1234.5, "decimal comma, '.' between thousands"),
        ("1,234,567;1.5;4", 1234567, "decimal point, ',' between thousands"),
        ("1 234,5;0,1;4", 1234.5, "decimal comma, ' ' between thousands"),
        ("1'234.5;0.1;4", 1234.5, 'decimal point, "\'" between thousands'),
        ("1\xa0234;0,1;4", 1234, "decimal comma"),
        ("1.234;0.012;4", 1.234, "decimal point"),
    ],
)
def test_read__marks_between_thousands_are_recognised_and_said(rows, number, said):
    cells = read(f"a;b;Q\n{rows}\n")
    assert cells.frame["a"].tolist() == [number]
    assert said in cells.messages[0]


@pytest.mark.parametrize(("decimal", "number"), [("comma", 1.234), ("point", 1234)])
def test_read__a_doubtful_mark_is_what_the_user_says(decimal, number):
    for cell, expected in (("1,234", number), ("1.234", 1234 / number * 1.234)):
        read_number = read(f"a;b;Q\n{cell};2;4\n", decimal=decimal).frame["a"]
        assert read_number.tolist() == pytest.approx([expected], rel=1e-12)  # rounding


@pytest.mark.parametrize("word", ["n/a", "-", "NaN"])
def test_read__words_for_nothing_are_empty_where_the_user_says_so(word):
    text = f"a,b,Q\n1,{word},4\n"
    assert f"'{word}': expected a finite number" in refusal(text)
    assert "--empty" in refusal(text)
    assert np.isnan(read(text, empty=(word,)).frame["b"]).all()


@pytest.mark.parametrize("blank", [" ", "\xa0", "\u2009", "\u202f", "\u3000"])
def test_read__blanks_beside_a_number_are_passed_over(blank):
    cells = read(f"a,b,Q\n0.24,{blank}\N{MINUS SIGN}.08{blank},4\n")  # so a typeset minus is read
    assert cells.frame["b"].tolist() == [-0.08]


@pytest.mark.parametrize(
    "cell",
    ["1e400", "-1e999", "inf", "nan", "true", "TRUE", "0x10", "1_0", "1d5", "١", "5%", "."]
    + [f"{before}{c}{after}" for c in map(chr, range(28, 32)) for before, after in CONTROLLED],
)
@pytest.mark.parametrize("other", ["1", "0", "0.5"])
def test_read__what_is_no_finite_number_is_refused_with_line_and_column(cell, other):
    text = refusal(f"a,b,Q\n{other},1,4\n{cell},2,6\n")
    assert f"mine.csv, line 3, column 'a' = {cell!r}: expected a finite number" in text


def test_read__a_quoted_line_break_moves_the_lines_below():
    text = refusal('a,b,n\n1,1,"two\nlines"\n1,x,y\n', numeric=("a", "b"))
    assert "line 4, column 'b' = 'x'" in text


@pytest.mark.parametrize("row", ["\r,0.5,4", '"",0.5,4', " \n,0.5,4"])
def test_read__an_empty_first_cell_stays_where_it_is(row):
    frame = read(f"a,b,Q\n{row}\n1,2,6\n").frame
    np.testing.assert_array_equal(frame["a"], [np.nan, 1])
    assert frame["b"].tolist() == [0.5, 2]


def test_delimited__a_title_with_commas_leaves_columns_between_blanks():
    text = "# R = 8 mm, E = 60 kPa, nu = 0.5\n# a   b  Q\n1 2 4\n1  2 6\n1 2 8\n"
    cells = read(text)
    assert cells.frame["Q"].tolist() == [4, 6, 8]


@pytest.mark.parametrize(
    "text",
    [
        "# a,b,Q\n# mesh fine, run 3\n1,2,4\n#second\n1,2,6\n",
        "#a;b;Q\n1;2;4\n# 1;2;3\n1;2;6\n",
        "# a b Q\n# units: none\n1 2 4\n# this is fine\n1 2 6\n# end\n",
        "My rig,,\na,b,Q\n1,2,4\na,b,Q\n1,2,6\n",
    ],
)
def test_delimited__comments_among_the_rows_are_passed_over_and_said(text):
    cells = read(text, ("a", "b"))
    assert cells.frame["Q"].tolist() == [4, 6]
    lines = [i for i, line in enumerate(text.split("\n"), start=1) if line[:1] == "1"]
    assert list(cells.lines) == lines
    assert "passed over: " in " ".join(cells.messages)


@pytest.mark.parametrize("labels", [("#1", "#2"), ("# 1", "# 2")])
def test_delimited__labels_that_begin_with_a_hash_are_no_comments(labels):
    text = "name,a,b,Q\n" + "".join(f"{label},1,2,4\n" for label in labels)
    assert read(text).frame["name"].tolist() == list(labels)


@pytest.mark.parametrize(
    ("text", "b", "n"),
    [
        ("a;b;Q\n0,5;2;4\n0,25;-1,5e-3;6\n", [2, -1.5e-3], []),
        ('"a","b","Q"\n"0.5","2","4"\n"0.25","","6"\n', [2, np.nan], []),
        ('"a","b","Q"\n"0,5","2","4"\n"0,25",3,6\n', [2, 3], []),
        ('"a";"b";"Q"\n"0,5";"2";"4"\n"0,25";"3";"6"', [2, 3], []),
        ('a,b,Q,n\n0.5,2,4,"x, y"\n0.25,2,6,"z"\n', [2, 2], ["x, y", "z"]),
        ('a,b,Q,n\n0.5,2,4,"say ""x"""\n0.25,2,6,z\n', [2, 2], ['say "x"', "z"]),
        ('a,b,Q,n\n0.5,2,4,"two\nlines"\n0.25,2,6,z\n', [2, 2], ["two\nlines", "z"]),
        ('a,b,Q,n\n0.5,2,4,5"\n0.25,2,6,z\n', [2, 2], ['5"', "z"]),
    ],
)
def test_read__quotes_hold_marks_and_lines(text, b, n):
    frame = read(text).frame
    assert (frame["a"].tolist(), frame["Q"].tolist()) == ([0.5, 0.25], [4, 6])
    np.testing.assert_array_equal(frame["b"], b)
    assert frame.get("n", pd.Series()).tolist() == n


@pytest.mark.parametrize("notes", ["By Foo 12\n\nRows: 2\n", "#end,,\n,,\n", "\nBy me, 3.12.25\n"])
def test_delimited__notes_below_the_rows_are_passed_over_and_said(notes):
    cells = read("a,b,Q\n1,2,4\n1,2,6\n" + notes, ("a", "b"))
    assert len(cells.frame) == 2
    assert "passed over below the rows" in " ".join(cells.messages)


@pytest.mark.parametrize("row", ["1", "texture7,,", "Exported by Foo,12", "My rig,.5"])
def test_delimited__a_row_that_is_cut_off_is_no_note(row):
    assert "line 3" in refusal(f"a,b,Q\n1,2,4\n{row}\n")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"n,b\n\x81,1\n", "line 2: byte 0x81 is not UTF-8"),
        (GOOD.encode("utf-16")[:-1], "line 1: a zero byte: not a text file"),
        (GOOD.encode("utf-16-be"), "line 1: a zero byte"),
        (b"a,b\n1,2\n1,\0\n", "line 3: a zero byte"),
        (b"\xef\xbb\xbf \n", "the file is empty"),
        (b"a,b\n", "no rows below the header"),
        *((b"a,b\n" + below + b",\n", "no rows below the header") for below in (b"\n", b"a,b\n")),
        (b"a\n1\n", "one column only"),
        ("a,b,Q\n1,2,3\n1,2\n\n1,2,3,4\n", "line 3: '1,2' has 2 cells, line 5: '1,2,3,4' has 4"),
        *((f"a,b\n1,o=1\n1,{add}\n", "line 3, column 'b' = '") for add in ("=1", " =A", '"=1,5"')),
        (b"a,=b\n1,2\n", "formulas"),
        (b'a,b\n1,"2\n', "not CSV"),
        (b'a,b\n1,"2"x\n', "line 2: not CSV"),
        (",".join(map(str, range(2001))).encode() + b"\n1,2\n", "2001 columns: expected at most"),
    ],
)
def test_delimited__what_is_no_table_is_refused_in_words(content, words):
    assert words in refusal(content, numeric=())


def test_read__a_long_cell_of_digits_is_refused_soon():
    # Backtracking over its digits would take minutes.
    assert "column 'a'" in refusal(f"a,b,Q\n{130_000 * '9'}x,1,4\n")


@pytest.mark.parametrize(
    ("text", "headers"),
    [
        ("a,b,\n1,2,\n", ["a", "b"]),
        ("a, a ,p [Pa],p [Pa]\n1,2,3,4\n", ["a", "a #2", "p [Pa]", "p #4 [Pa]"]),
        ("Test 7\n1,2,3\n4,5,6\n", ["column 1", "column 2", "column 3"]),
    ],
)
def test_read__headers_that_are_empty_or_missing_or_stand_twice_stay_apart(text, headers):
    assert list(read(text, ("a",)).frame) == headers


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (GOOD.encode("utf-16"), "UTF-16"),
        (GOOD.replace("Q", "Q\N{MICRO SIGN}").encode("cp1252"), "read as Windows-1252"),
    ],
)
def test_read__other_encodings_are_read_and_said(content, said):
    cells = read(content, ("a",))
    assert cells.frame["a"].tolist() == [0.03, 0.02]
    assert any(said in line for line in cells.messages)


@pytest.mark.parametrize(
    ("tail", "words"),
    [
        ("", ""),
        ("\n", ""),
        (",,,\n", ""),
        ("# mean of three runs,,,\n", "passed over: 1 comment such as '# mean of three runs,,,'"),
        (' "0.5",1,4,x\n', "column 'a' = ' \"0.5\"': expected a finite number"),
        ("1e999,1,4,\n", "column 'a' = '1e999': expected a finite number"),
        ("1,2\n", ": '1,2' has 2 cells: expected 4 cells"),
    ],
)
@pytest.mark.parametrize("top", ["", "Test 7\n\n"])
def test_read__rows_below_good_ones_are_told(top, tail, words):
    text = top + "a,b,Q,note\n0.1,.5,4,007\n-1e-3,,6, nan\n" + tail
    first = 2 + 2 * bool(top)
    if "expected" in words:
        told = refusal(text)
        assert f"mine.csv, line {first + 2}" in told
    else:
        cells = read(text)
        told = "; ".join(cells.messages)
        assert cells.lines.tolist() == [first, first + 1]
        assert cells.row.tolist() == [0, 1]
        assert cells.frame.to_csv(index=False) == "a,b,Q,note\n0.1,0.5,4.0,007\n-0.001,,6.0, nan\n"
    assert words in told
