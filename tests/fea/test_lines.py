"""Lines of text files: numbers and nodes in them."""

from pathlib import Path

import numpy as np
import pytest

from ridgebayes.errors import InputError
from ridgebayes.fea.lines import Line, NodeTable, Printed, on, read_lines


@pytest.mark.parametrize(
    ("word", "value"),
    [("-9.6261E-04", -9.6261e-4), ("5000.", 5000.0), ("-.5", -0.5), ("1.5-104", 1.5e-104)],
)
def test_finite__reads_what_fortran_prints(word, value):
    assert Line(Path("a"), 1, word).finite(word) == value


@pytest.mark.parametrize("word", ["1_0", "nan", "inf", "1e999", "0x10", "\u0661", "", "1,5", "."])
def test_finite__refuses_what_python_alone_would_read(word):
    with pytest.raises(InputError, match=r"a, line 7: .*expected a finite number"):
        Line(Path("a"), 7, word).finite(word)


@pytest.mark.parametrize("word", ["1.5", "3", "x"])
def test_node__is_whole_and_new(word):
    line = Line(Path("a"), 7, word)
    with pytest.raises(InputError, match=f"a, line 7: .*{word}"):
        line.node(word, {3})
    assert line.node("4", {3}) == 4


def test_read_lines__a_last_line_without_an_end_is_told(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(b"one\r\ntwo\nthr")
    assert [line.text for line in read_lines(path)] == ["one", "two"]
    last = read_lines(path, unfinished=True)[-1]
    assert (last.number, last.text, last.ended) == (3, "thr", False)


def test_node_table__has_no_number_where_a_node_has_no_row(tmp_path):
    lines = [Line(tmp_path, 2, "7 1.0 2.0")]
    table = NodeTable(Line(tmp_path, 1, ""), "RIM", "", ["U1", "U2"], lines)
    assert table.has("U2")
    assert not table.has("U2", "RF2")
    np.testing.assert_array_equal(table.of([3, 7], "U2", "U1"), [[np.nan] * 2, [2.0, 1.0]])
    assert table.of([], "U1", "U2").shape == (0, 2)


class Letters(Printed):
    def __init__(self):
        super().__init__()
        self.seen = []

    @on("ab")
    def two(self, line, match):
        self.seen.append((line.number, match[0].strip()))

    @on("a")
    def one(self, line, match):
        self.table = NodeTable(line, "RIM", "")

    def row(self, line, table):
        self.seen.append((line.number, table.nodes))


def test_printed__gives_a_line_to_the_first_pattern_or_else_to_the_table(tmp_path):
    reader = Letters()
    for number, text in enumerate(("xab", "  abc", "a", "xab"), start=4):
        reader.take(Line(tmp_path, number, text))
    assert reader.seen == [(5, "ab"), (7, "RIM")]
