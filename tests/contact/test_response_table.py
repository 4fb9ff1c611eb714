"""Interpolated contacts, against the contacts themselves."""

import numpy as np
import pytest

from ridgebayes import ComputationError, InputError
from ridgebayes.contact.axes import Spread
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.response_table import (
    CLOSEST,
    MOST_DISTINCT,
    ResponseTable,
    shapes_of,
    solved,
)
from ridgebayes.contact.rigid_profile import Profile

A, B = 0.022, 0.02


def profiles(n=1, a=A, b=B, depth=np.inf, corner=0.0, offset=0.0):
    columns = (a, b, depth, corner, offset)
    return np.column_stack([np.broadcast_to(np.asarray(one, float), n) for one in columns])


def table_of(bodies):
    """The table of some bodies, looked at in two blocks."""
    seen = Spread(MOST_DISTINCT)
    for part in np.array_split(shapes_of(bodies), 2):
        if len(part):
            seen.add(part)
    return ResponseTable(seen)


def worst(bodies, Q, n=6, seed=1):
    """Largest relative error of lengths and forces, and of K over the largest K."""
    table, rng = table_of(bodies), np.random.default_rng(seed)
    bodies = bodies[rng.integers(len(bodies), size=n)]
    wanted = 0.5 * (0.5 * Q * (bodies[:, 0] + bodies[:, 1])) ** 2 * rng.uniform(0.3, 2.0, n)
    found = table.at(bodies, Q, wanted)
    errors = []
    for i in range(n):
        exact = solved(bodies[i], Q, float(found.W[i]))
        for name in ("length", "extent", "penetration", "share", "largest_share"):
            errors.append(abs(getattr(found, name)[i] / getattr(exact, name)[0] - 1))
        errors.append(np.abs(found.x[i] - exact.x).max() / exact.extent[0])
        K = exact.K.max()
        errors.append(0.1 * np.abs(found.K[i] - exact.K).max() / K if K else 0.0)
    return max(errors)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changed", "Q"),
    [
        ({}, 2),
        ({}, 8),
        ({"offset": -0.2}, 4),
        pytest.param({"corner": 0.002}, 4, marks=pytest.mark.slow),
        pytest.param({"depth": 6e-4}, 6, marks=pytest.mark.slow),
        # As low as round corners reach, and below it by rounding.
        pytest.param({"depth": 6.25e-4, "corner": 1.25e-3}, 4, marks=pytest.mark.slow),
    ],
)
def test_response_table__of_one_body_is_its_contact(changed, Q):
    # Discretisation: third order between 25 places, closer where an end becomes free.
    assert worst(profiles(**changed), Q) < 3e-4


@pytest.mark.long
@pytest.mark.parametrize(("Q", "log_sd"), [(2, 0.1), (6, 0.1), (6, 0.02)])
def test_response_table__of_many_textures_is_the_contact_of_each(Q, log_sd):
    rng, n = np.random.default_rng(2), 500
    spread = np.exp(log_sd * rng.standard_normal((2, n)))
    bodies = profiles(n, a=A * spread[0], b=B * spread[1])
    assert worst(bodies, Q) < 3e-4


def test_solved__names_the_values_of_a_contact_that_cannot_be():
    with pytest.raises(ComputationError, match=r"groove_width 0.909, .* got Q = 2 for 6, ok"):
        solved(profiles()[0], 6, 1e-5)


@pytest.mark.long
def test_response_table__of_round_ridges_whose_grooves_may_close_is_the_contact_of_each():
    bodies = profiles(100, b=np.linspace(1e-6, B, 100), corner=0.002)
    assert worst(bodies, 4, n=8) < 3e-4


@pytest.mark.long
@pytest.mark.slow
def test_response_table__of_many_offsets_is_roughly_the_contact_of_each():
    offset = np.random.default_rng(3).uniform(-0.45, 0.45, 100)
    # Linear between 17 offsets, which ends are free changes between them.
    assert worst(profiles(100, offset=offset), 4, n=12) < 0.02


def test_response_table__holds_a_count_that_is_there_but_for_a_moment():
    # Nearly over a ridge's centre ridges come in pairs, and even counts hardly at all.
    (body,) = bodies = profiles(offset=0.499)
    found = table_of(bodies).at(bodies, 4, np.array([0.002]))
    exact = solved(body, 4, float(found.W[0]))
    np.testing.assert_allclose(found.x, exact.x, atol=1e-4)


def test_response_table__loads_are_the_nearest_of_that_count():
    events = reaching_loads(Profile(A, B), W_max=0.01)
    low, high = events.W[1], events.W[2]  # Q = 6
    bodies = profiles(3)
    found = table_of(bodies).at(bodies, 6, np.array([0.5 * low, 0.5 * (low + high), 2 * high]))
    assert low < found.W[0] < low * (1 + CLOSEST)
    assert found.W[1] == 0.5 * (low + high)
    assert high * (1 - CLOSEST) < found.W[2] < high


def test_response_table__refuses_what_it_cannot_hold():
    with pytest.raises(InputError, match="over a ridge's centre counts are odd"):
        table_of(profiles(offset=0.5)).at(profiles(offset=0.5), 4, np.array([0.002]))
    rng = np.random.default_rng(1)
    a, corner, depth = (x * rng.uniform(0.9, 1.1, 100) for x in (A, 0.002, 6e-4))
    with pytest.raises(InputError, match="too many values vary at once"):
        table_of(profiles(100, a=a, corner=corner, depth=depth))
    with pytest.raises(InputError, match=r"groove_width: expected .* 0\.6 % of ridge_width, got"):
        table_of(profiles(100, b=np.linspace(1e-6, B, 100)))
