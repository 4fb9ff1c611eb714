"""Files of others: text, TOML, and what libraries cannot read refused in their words."""

import sys

import pytest

from ridgebayes import InputError
from ridgebayes.runtime.reading import decoded, extra, read_toml, refusing


def test_refusing__says_where_and_what_the_library_says():
    message = r"\Amine\.csv: no way; expected numbers\Z"
    kinds = (KeyError, ValueError)
    with (
        pytest.raises(InputError, match=message),
        refusing("mine.csv", *kinds, rule="; expected numbers"),
    ):
        raise ValueError("no\nway")


def test_decoded__has_no_mark_and_newlines_alone():
    assert decoded(b"\xef\xbb\xbfa\r\nb\rc\xc3\xa4", "t.csv") == "a\nb\ncä"


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"a\nb\0", "t.csv, line 2: a zero byte: not a text file, or not UTF-8"),
        (b"a\nb\n\xe4", "t.csv, line 3: byte 0xe4 is not UTF-8; expected UTF-8"),
    ],
)
def test_decoded__names_the_line_of_what_is_no_text(content, told):
    with pytest.raises(InputError) as caught:
        decoded(content, "t.csv")
    assert str(caught.value) == told


@pytest.mark.parametrize("text", ["a = ", "a = 1\na = 2", "x = " + 5000 * "["])
def test_read_toml__refuses_what_is_none(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"mine\.toml: not TOML: "):
        read_toml(path)


def test_extra__says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    message = r"\At\.xlsx: needs openpyxl: pip install 'ridgebayes\[excel\]'\Z"
    with pytest.raises(InputError, match=message):
        extra("openpyxl", "excel", "t.xlsx: needs openpyxl")
