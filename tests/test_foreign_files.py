"""Strangers' files: imported by two commands at most, the second being what the first printed."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import ridgebayes as rb
from tests.foreign_files import foreign_files

FILES = foreign_files()
SOUND = [one for one in FILES if not one.mistakes]
BROKEN = [one for one in FILES if one.mistakes]


def filled_in(words, said):
    """Put in what a file does not say, where the command has marks for it."""
    before = [None, *words[:-1]]
    out = []
    for option, word in zip(before, words, strict=True):
        if "?" in word:
            key = option.removeprefix("--")
            if key == "map":
                key = word.partition("=")[0]
                word = word.replace("?", said[key])
            else:
                word = said[key]
        out.append(word)
    return out


def test_foreign_files__are_at_least_25():
    assert len({one.name for one in FILES}) == len(FILES) >= 25


@pytest.mark.slow
@pytest.mark.parametrize("one", SOUND, ids=lambda one: one.name)
def test_import__of_a_foreign_file_takes_two_commands(one, command):
    Path(one.name).write_bytes(one.content)
    first = command("import", one.name)
    assert first.code == 2
    line = first.err.splitlines()[-1].strip()
    assert line.startswith("ridgebayes import "), first.err
    words = filled_in(shlex.split(line)[1:], one.said)
    second = command(*words)
    assert (second.code, second.err) == (0, ""), line
    frame = rb.read_table(words[words.index("-o") + 1]).frame
    columns = list(one.truth)
    order = ["a_over_R", "b_over_R", "Q"]
    got = frame.sort_values(order)[columns].to_numpy(dtype=float)
    expected = one.truth.sort_values(order).to_numpy(dtype=float)
    # Printed digits: loads have nine decimals of N/mm, twelve digits in other units.
    np.testing.assert_allclose(got, expected, rtol=one.digits, atol=1e-12)


@pytest.mark.parametrize("one", BROKEN, ids=lambda one: one.name)
def test_import__of_a_broken_file_names_all_mistakes_at_once(one, command):
    Path(one.name).write_bytes(one.content)
    said = command("import", one.name, "-o", "t.csv")
    assert said.code == 2
    assert not Path("t.csv").exists()
    for text in one.mistakes:
        assert re.search(re.escape(text), said.err), (text, said.err)
