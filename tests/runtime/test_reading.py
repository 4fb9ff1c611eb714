"""What libraries cannot read is refused in their words, and nothing else is."""

import pytest

from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import refusing


def test_refusing__says_where_and_what_the_library_says():
    message = r"\Amine\.csv: no way; expected numbers\Z"
    kinds = (KeyError, ValueError)
    with (
        pytest.raises(InputError, match=message),
        refusing("mine.csv", *kinds, rule="; expected numbers"),
    ):
        raise ValueError("no\nway")


def test_refusing__cuts_what_the_library_says():
    with pytest.raises(InputError, match=r"\Amine\.csv: xxxxx\Z"), refusing("mine.csv", most=5):
        raise OSError(20 * "x")


def test_refusing__lets_a_refusal_through():
    with pytest.raises(InputError, match=r"\Amine\.csv, line 3: odd\Z"), refusing("other"):
        raise InputError("mine.csv, line 3: odd")


def test_refusing__lets_other_kinds_through():
    with pytest.raises(TypeError, match="a bug"), refusing("mine.csv", ValueError):
        raise TypeError("a bug")
