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


@pytest.mark.parametrize("offset", [-0.5, -0.3, 0.0, 0.2, 0.5])
@pytest.mark.parametrize("number", [-7, -1, 0, 1, 12])
def test_profile__ridges_and_floors_alternate_without_a_gap(offset, number):
    profile = Profile(A, B, depth=1e-3, offset=offset)
    ridge, floor, following = (
        profile.ridge(number),
        profile.floor_after(number),
        profile.ridge(number + 1),
    )
    # Rounding: of a few sums.
    assert ridge.stop - ridge.start == pytest.approx(A, rel=1e-13)
    assert floor.stop - floor.start == pytest.approx(B, rel=1e-13)
    assert floor.start == pytest.approx(ridge.stop, abs=1e-15)
    assert floor.stop == following.start
    assert (ridge.ridge, floor.ridge, ridge.depth, floor.depth) == (number, None, 0.0, 1e-3)
    assert floor.corner == 0.0
