"""Damaged files: some hundred of them, with a fixed seed."""

import importlib.util
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

# By its file, so that it does not matter from which folder pytest was started.
_SPEC = importlib.util.spec_from_file_location("fuzzing", Path(__file__).with_name("fuzzing.py"))
fuzzing = importlib.util.module_from_spec(_SPEC)
sys.modules["fuzzing"] = fuzzing
_SPEC.loader.exec_module(fuzzing)

N_MUTANT = 16  # of each kind of file; thousands by `python -m tests.fea.fuzzing`


@pytest.mark.parametrize("name", sorted(fuzzing.TARGETS))
def test_targets__read_what_is_whole(name, tmp_path):
    target = fuzzing.TARGETS[name]
    path = tmp_path / target.file_name
    path.write_bytes(target.content)
    found = target.read(path)
    assert target.doubt(target.content, found) == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(fuzzing.TARGETS))
def test_mutants__are_refused_in_words_or_read_as_they_stand(name, tmp_path):
    rng = np.random.default_rng([20, *name.encode()])
    counts = fuzzing.attack(fuzzing.TARGETS[name], N_MUTANT, rng, tmp_path)
    assert counts["refused"] > (N_MUTANT / 3 if name.startswith("columns") else 0)
    assert counts["read"] + counts["refused"] + counts["same bytes"] == N_MUTANT


@pytest.mark.parametrize(
    ("name", "old", "new", "other"),
    [
        # A mapping may leave out what the table's headers tell.
        ("map, used", b'b = "Groove width [mm]"\n', b"", (b'"8 mm"', b'"9 mm"')),
        ("map, used", b'line = "Line load [N/m]"\n', b"", (b'"60 kPa"', b'"61 kPa"')),
        # Empty cells beyond the header are none.
        ("columns, contract", b"0.0087,0.49,s1\n", b"0.0087,0.49,,\n", (b"0.0195", b"0.0196")),
    ],
)
def test_doubt__is_none_of_what_is_read_in_other_words(tmp_path, name, old, new, other):
    target = fuzzing.TARGETS[name]
    path = tmp_path / target.file_name
    mutant = other_number(target.content, old, new)
    path.write_bytes(mutant)
    found = target.read(path)
    assert target.doubt(mutant, found) == ""
    assert "the file has" in target.doubt(other_number(mutant, *other), found)


def test_attack__sees_a_number_that_is_not_in_the_file(tmp_path):
    target = fuzzing.TARGETS["columns, contract"]

    def read(path):
        path.write_text(path.read_text().replace("0.49", "0.48").replace("0.0087", "0.0088"))
        return target.read(path)

    wrong = fuzzing.Target(
        "wrong", target.file_name, target.content, read, target.doubt, lambda content, rng: content
    )
    with pytest.raises(AssertionError, match=r"wrong: the file has"):
        fuzzing.attack(wrong, 1, np.random.default_rng(1), tmp_path)


def other_number(content, old=b"", new=b""):
    assert old in content
    return content.replace(old, new, 1)


def other_state(content):
    """Put the second state in place of the first."""
    first, second = (fuzzing._in_space(one).tobytes() for one in fuzzing._SERIES["moved"][:2])
    return other_number(content, first, second)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("series, XDMF", partial(other_number, old=b'Value="0.01179', new=b'Value="0.01189')),
        ("series, XDMF of text", partial(other_number, old=b'Value="0.0117', new=b'Value="0.011')),
        ("series, HDF5", other_state),
        ("series, VTU ascii", lambda content: fuzzing._VTUS["series, VTU ascii"][2]),
        ("series, VTU binary", lambda content: fuzzing._VTUS["series, VTU binary"][2]),
        ("series, VTU appended", lambda content: fuzzing._VTUS["series, VTU appended"][2]),
        ("contact print", partial(other_number, old=b" -1.980000E-02", new=b" -1.990000E-02")),
        ("status", partial(other_number, old=b"0.500000E+00  0.5", new=b"0.600000E+00  0.5")),
        ("map", partial(other_number, old=b"8 mm", new=b"9 mm")),
        ("map, used", partial(other_number, old=b"8 mm", new=b"9 mm")),
    ],
)
@pytest.mark.parametrize("swapped", [False, True])
def test_attack__sees_that_another_file_was_read(tmp_path, name, change, swapped):
    target = fuzzing.TARGETS[name]
    one, other = target.content, change(target.content)
    if swapped:
        one, other = other, one

    def read(path):
        path.write_bytes(other)
        return target.read(path)

    wrong = fuzzing.Target(
        name, target.file_name, one, read, target.doubt, lambda content, rng: content
    )
    with pytest.raises(AssertionError, match=f"{name}: "):
        fuzzing.attack(wrong, 1, np.random.default_rng(1), tmp_path)
