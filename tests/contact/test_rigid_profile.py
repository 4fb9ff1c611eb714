"""The rigid profile: where each land is, and what may not be asked for."""

import math

import pytest

from ridgebayes import InputError
from ridgebayes.contact.rigid_profile import Profile

A, B = 0.012, 0.03


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("a", 0.0),
        ("a", -1.0),
        ("a", math.inf),
        ("a", math.nan),
        ("b", 0.0),
        ("b", math.inf),
        ("b", math.nan),
        ("depth", 0.0),
        ("depth", -1e-3),
        ("depth", math.nan),
        ("corner", -1e-9),
        ("corner", 0.5 * A * (1 + 1e-12)),
        ("corner", math.nan),
        ("offset", 0.5000001),
        ("offset", -0.6),
        ("offset", math.nan),
    ],
)
def test_profile__a_value_that_breaks_its_rule_is_named(name, value):
    with pytest.raises(InputError, match=rf"^{name} = .*; expected "):
        Profile(**({"a": A, "b": B} | {name: value}))
