"""The rigid profile: where each land is, and what may not be asked for."""

import math

import numpy as np
import pytest

from ridgebayes.contact.rigid_profile import Profile, RigidSegment
from ridgebayes.errors import InputError

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


def test_profile__the_ends_of_each_rule_are_kept():
    assert Profile(A, B, depth=math.inf, corner=0.5 * A, offset=-0.5).pitch == A + B
    # As deep as round corners are: their parabola falls by half the radius.
    assert Profile(A, B, depth=0.25 * A, corner=0.5 * A).depth == 0.25 * A
    with pytest.raises(
        InputError, match=r"^depth = .*; expected at least half the corners' radius"
    ):
        Profile(A, B, depth=0.2499 * A, corner=0.5 * A)


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


def test_profile__the_centre_is_over_the_groove_before_ridge_0_or_over_it():
    assert Profile(A, B).ridge(0).start == 0.5 * B
    assert Profile(A, B).ridge(-1).stop == pytest.approx(-0.5 * B, rel=1e-14)  # rounding
    for offset in (-0.5, 0.5):
        over = Profile(A, B, offset=offset).ridge(0)
        assert (over.start, over.stop) == (-0.5 * A, 0.5 * A)


def test_profile__the_body_moves_right_by_the_offset():
    # Relative to the body, the lands move left.
    moved = Profile(A, B, offset=0.1).ridge(0).start - Profile(A, B).ridge(0).start
    assert moved == pytest.approx(-0.1 * (A + B), rel=1e-13)  # rounding


def test_profile__is_mirrored_over_the_middle_of_a_land_only():
    given = [-0.5, -0.2, 0.0, 1e-12, 0.5]
    found = [Profile(A, B, offset=offset).mirrored for offset in given]
    assert found == [True, False, True, False, True]


@pytest.mark.parametrize("offset", [-0.49, -0.31, 0.17, 0.4, 0.49])
@pytest.mark.parametrize("depth", [math.inf, 1e-3])
@pytest.mark.parametrize("reach", [0.2, 5 * (A + B), A + B])
def test_lands__are_all_within_reach_in_order(offset, depth, reach):
    profile = Profile(A, B, depth=depth, offset=offset)
    segments = profile.segments(reach)
    starts = [land.start for land in segments]
    assert starts == sorted(starts)
    ridges = {land.ridge for land in segments if land.ridge is not None}
    expected = set()
    for number in range(-50, 50):
        land = profile.ridge(number)
        if land.start < 0 < land.stop or min(abs(land.start), abs(land.stop)) <= reach:
            expected.add(number)
    assert ridges == expected
    n_floor = sum(land.ridge is None for land in segments)
    assert n_floor == 0 if math.isinf(depth) else abs(n_floor - len(ridges)) <= 1


@pytest.mark.parametrize("offset", [-0.5, 0.0, 0.5])
def test_lands__of_a_mirrored_profile_are_the_right_half(offset):
    segments = Profile(A, B, depth=1e-3, offset=offset).segments(0.2)
    assert segments[0].start == pytest.approx(-segments[0].stop, rel=1e-14)  # rounding
    assert segments[0].ridge == (None if offset == 0.0 else 0)
    assert all(land.start > 0 for land in segments[1:])


def test_height__is_flat_between_corners_and_a_parabola_in_them():
    land = RigidSegment(3, 1.0, 2.0, corner=0.25)
    assert land.flat == (1.25, 1.75)
    x = np.array([[1.25, 1.5, 1.75], [1.0, 1.125, 2.0]])
    expected = [[0.0, 0.0, 0.0], [0.125, 0.125**2 / 0.5, 0.125]]
    assert np.array_equal(land.height(x), expected)


def test_height__of_a_sharp_land_is_its_depth():
    land = RigidSegment(None, 1.0, 2.0, depth=0.1)
    assert np.array_equal(land.height(np.array([1.0, 1.7])), [0.1, 0.1])
    assert land.flat == (1.0, 2.0)
