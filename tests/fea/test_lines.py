"""Lines of text files: numbers and nodes in them."""

from pathlib import Path

import pytest

from ridgebayes.errors import InputError
from ridgebayes.fea.lines import Line, read_lines


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


def test_read_lines__a_last_line_without_an_end_is_told(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(b"one\r\ntwo\nthr")
    assert [line.text for line in read_lines(path)] == ["one", "two"]
    last = read_lines(path, unfinished=True)[-1]
    assert (last.number, last.text, last.ended) == (3, "thr", False)
