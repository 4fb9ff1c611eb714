"""What a journal gives back, and what it does not trust."""

import json

import pytest

from ridgebayes import InputError
from ridgebayes.runtime.journal import Journal

GIVEN = {"texture": {"a": 0.1, "offset": "uniform"}, "tol": 1e-8}


@pytest.fixture
def journal(tmp_path):
    return Journal(tmp_path / "j")


def only(journal):
    (path,) = journal.folder.iterdir()
    return path


def test_find__gives_what_was_kept_to_the_last_bit(journal):
    found = [0.1 + 0.2, 5e-324, 1e308, -0.0, None, "µ", [1, {"a": 1 / 3}]]
    assert not journal.exists()
    assert journal.find(GIVEN) is None
    journal.keep(GIVEN, found)
    again = Journal(journal.folder)
    assert again.exists()
    assert repr(again.find(dict(reversed(GIVEN.items())))) == repr(found)
    assert (journal.n_kept, again.n_found, again.n_damaged) == (1, 1, 0)


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: "",
        lambda text: text[: len(text) // 2],
        lambda text: text.replace("0.25", "0.26"),
        lambda text: text.replace("1e-08", "1e-07"),
        lambda text: "[1]",
        lambda text: json.dumps({"found": [0.25]}),
        lambda text: "\0" * len(text),
    ],
)
def test_find__what_is_damaged_counts_as_missing(journal, damage):
    journal.keep(GIVEN, [0.25])
    path = only(journal)
    text = path.read_text()
    assert damage(text) != text
    path.write_text(damage(text))
    assert journal.find(GIVEN) is None
    assert (journal.n_found, journal.n_damaged) == (0, 1)
    journal.keep(GIVEN, [0.25])
    assert journal.find(GIVEN) == [0.25]


def test_keep__where_nothing_can_be_written_says_where(tmp_path):
    (tmp_path / "file").write_text("")
    journal = Journal(tmp_path / "file" / "j")
    with pytest.raises(InputError, match=r"file/j/\w+\.json: cannot be written: Not a directory"):
        journal.keep(GIVEN, 1)
