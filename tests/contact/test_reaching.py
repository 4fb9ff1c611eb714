"""Loads that reach ridges, against closed forms, the Galerkin solution and each other's limits."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize

from ridgebayes.contact import reaching
from ridgebayes.contact.all_events import Events
from ridgebayes.contact.contact_solution import solve_contact
from ridgebayes.contact.halfplane import transition_loads
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile

A, B = 0.012, 0.03
W_MAX = 1.1e-2


def covered_loads(a, b, n):
    """W of the fully covered transitions: another basis, another program."""
    table = transition_loads(a, b, n)
    assert table.status == ("ok",) * n
    return 4 / math.pi * table.F * (a + b) ** 2


@pytest.mark.parametrize(
    ("a", "b"), [(0.012, 0.03), (0.032, 0.01), (0.012, 0.09), (2e-6, 0.02), (0.1, 1e-3)]
)
def test_reaching_loads__are_those_of_the_galerkin_solution(a, b):
    W = covered_loads(a, b, 4)
    found = reaching_loads(Profile(a, b), W_max=1.001 * W[-1])
    assert found.status == ("ok",) * 4
    assert np.array_equal(found.Q, [4, 6, 8, 10])
    # Tolerance: 1e-8 asked for, of each solution.
    np.testing.assert_allclose(found.W, W, rtol=2e-8)


@pytest.mark.parametrize(("a", "b"), [(0.012, 0.03), (0.2, 0.01), (1e-4, 0.05)])
def test_reaching_loads__the_first_pair_has_a_closed_load(a, b):
    """In t = x^2 two ridges are one punch: W = w sinh(tau)/tau, t = middle + w cosh(tau)."""
    inner, outer, corner = 0.5 * b, 0.5 * b + a, 1.5 * b + a
    w = 0.5 * (outer**2 - inner**2)
    tau = math.acosh((corner**2 - 0.5 * (outer**2 + inner**2)) / w)
    W = w * math.sinh(tau) / tau
    found = reaching_loads(Profile(a, b), W_max=1.01 * W)
    assert found.status == ("ok",)
    assert found.W[0] == pytest.approx(W, rel=1e-8)  # tolerance


@pytest.mark.parametrize(("a", "b"), [(0.012, 0.03), (0.1, 0.01), (1e-4, 0.05)])
def test_reaching_loads__the_first_pair_beside_a_ridge_has_a_closed_load(a, b):
    """One covered ridge: W = w^2 sinh(2 tau)/(4 tau), corner at w cosh(tau)."""
    w = 0.5 * a
    tau = math.acosh((w + b) / w)
    W = w**2 * math.sinh(2 * tau) / (4 * tau)
    for offset in (-0.5, 0.5):
        found = reaching_loads(Profile(a, b, offset=offset), W_max=1.01 * W)
        assert found.status == ("ok",)
        assert np.array_equal(found.Q, [3])
        assert found.W[0] == pytest.approx(W, rel=1e-8)  # tolerance


@pytest.mark.parametrize(("offset", "depth"), [(0.0, 1e-5), (0.0, 5e-5), (0.1, 5e-5), (-0.1, 5e-5)])
def test_reaching_loads__ridges_beside_a_floor_that_is_touched_alone_are_events(offset, depth):
    """Up to the ridges the contact on the floor is Hertz's, whose gap has a closed form."""
    x = 0.5 * B - abs(offset) * (A + B)  # the nearest corner

    def gap(w):
        root = math.sqrt(x * x - w * w)
        return 0.5 * (x * root - w * w * math.log((x + root) / w)) - depth

    w = optimize.brentq(gap, 1e-6 * x, x * (1 - 1e-12), xtol=1e-16)
    profile = Profile(A, B, depth=depth, offset=offset)
    assert solve_contact(profile, 0.4 * w**2).Q == 0
    found = reaching_loads(profile, W_max=0.505 * w**2)
    assert found.status == ("ok",)
    assert np.array_equal(found.Q, [2 if offset == 0.0 else 1])
    assert found.W[0] == pytest.approx(0.5 * w**2, rel=1e-8)  # tolerance


@pytest.mark.slow
@pytest.mark.parametrize("shape", [{}, {"corner": 1e-3}, {"depth": 1e-3}])
@pytest.mark.parametrize("offset", [0.0, 0.5])
def test_reaching_loads__a_pair_is_two_ridges_at_one_load(shape, offset):
    pairs = reaching_loads(Profile(A, B, offset=offset, **shape), W_max=3e-3, rel_tol=1e-6)
    off = abs(offset - 1e-4)
    single = reaching_loads(Profile(A, B, offset=off, **shape), W_max=3.1e-3, rel_tol=1e-6)
    assert set(pairs.status) == set(single.status) == {"ok"}
    n = len(pairs.W)
    # Over a groove the second ridge is reached at almost no load, which is no event of the pairs.
    first = 1 if offset == 0.0 else 0
    found = single.W[first : first + 2 * n].reshape(n, 2)
    # Order: first in an offset of 1e-4, nearly as much to either side.
    np.testing.assert_allclose(found.mean(axis=1), pairs.W, rtol=1e-4)
    np.testing.assert_allclose(found[:, 0], pairs.W, rtol=5e-3)


@pytest.mark.parametrize("shape", [{}, {"offset": 0.3}, {"offset": 0.5, "corner": 1e-3}])
def test_reaching_loads__q_steps_there_and_nowhere_else(shape):
    profile = Profile(A, B, **shape)
    found = reaching_loads(profile, W_max=4e-3, rel_tol=1e-6)
    assert set(found.status) == {"ok"}
    for W, Q in zip(found.W.tolist(), found.Q.tolist(), strict=True):
        # Tolerance: penetration is seen from 1e-6 of the load on.
        before, after = (solve_contact(profile, W * (1 + way * 1e-3)) for way in (-1, 1))
        assert (before.status, after.status) == ("ok", "ok")
        assert before.Q < after.Q == Q
    middles = np.sqrt(found.W[1:] * found.W[:-1])
    assert [solve_contact(profile, float(W)).Q for W in middles] == found.Q[:-1].tolist()


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.1, 0.05])
def test_reaching_loads__go_on_where_contact_covers_a_round_corner(share):
    """On the way to far ridges the last one touched is covered up to its walls."""
    a, b = 0.022, 0.02
    found = reaching_loads(Profile(a, b, corner=share * a), W_max=0.089)
    assert set(found.status) == {"ok"}
    assert found.Q[-1] == 22
    sharp = reaching_loads(Profile(a, b), W_max=0.089)
    # Order: the share of the body's width that corners take away, which falls as it widens.
    apart = np.abs(found.W / sharp.W - 1)
    assert apart.max() < 5e-3
    assert apart[4:].max() < 2e-3


def test_reaching_loads__of_narrow_grooves_between_round_ridges_are_all_found():
    """Corners keep contacts apart where grooves have no width: loads have a limit."""
    found = [
        reaching_loads(Profile(0.03, b, corner=2e-3), W_max=0.044, rel_tol=1e-6)
        for b in (1e-4, 1e-6, 1e-12)
    ]
    for one in found:
        assert one.status == ("ok",) * 9
    apart = [np.abs(one.W / found[-1].W - 1).max() for one in found[:2]]
    # Order: first in b/a, some of which is the pitch's.
    assert apart[1] < 3e-6 + 1.5e-2 * apart[0] < 3e-4


@pytest.mark.parametrize("rel_tol", [1e-8, 1e-6, 1e-4])
def test_reaching_loads__of_narrow_grooves_are_as_many_at_any_tolerance(rel_tol):
    found = reaching_loads(Profile(0.03, 1e-4, corner=2e-3), W_max=0.05, rel_tol=rel_tol)
    assert found.status == ("ok",) * 10


@pytest.mark.parametrize("offset", [0.0, 0.2])
def test_reaching_loads__of_grooves_too_narrow_say_so(offset):
    found = reaching_loads(Profile(0.03, 1e-9, offset=offset), W_max=1e-3)
    assert np.isnan(found.W).tolist() == [True]
    assert found.status[0].startswith("not computed: some ")
    assert found.status[0].endswith(" unknowns with a/R = 0.03, b/R = 1e-09; cap 4000")


def test_reaching_loads__a_floor_delays_ridges_and_a_deep_one_does_not():
    bare = reaching_loads(Profile(A, B), W_max=W_MAX)
    deep = reaching_loads(Profile(A, B, depth=1.0), W_max=W_MAX)
    assert np.array_equal(bare.W, deep.W)
    touched = reaching_loads(Profile(A, B, depth=6e-4), W_max=W_MAX, rel_tol=1e-6)
    assert set(touched.status) == {"ok"}
    n = len(touched.W)
    assert 0 < n <= len(bare.W)
    # What a floor carries does not press the ridges down.
    assert np.all(bare.W[:n] * (1 - 1e-6) < touched.W)


def test_reaching_loads__stop_at_the_most_events_asked_for():
    few = reaching_loads(Profile(A, B), W_max=W_MAX, n_max=2)
    many = reaching_loads(Profile(A, B), W_max=W_MAX)
    np.testing.assert_allclose(few.W, many.W[:2], rtol=1e-8)  # tolerance
    assert len(many.W) > 2


def scenes(n, seed):
    """Ridges of all shapes; round and sharp; bodies anywhere."""
    rng = np.random.default_rng(seed)
    for i in range(n):
        a = math.exp(rng.uniform(math.log(0.02), math.log(0.05)))
        b = a / math.exp(rng.uniform(math.log(0.2), math.log(5)))
        corner = (rng.uniform(0.01, 0.5) * a, 0.02 * a, 0.0)[i % 3]
        offset = (0.0, 0.5, rng.uniform(-0.5, 0.5))[(i // 3) % 3]
        profile = Profile(a, b, corner=corner, offset=offset)
        yield profile, 30 * profile.pitch**2


# A floor is touched after some of the events.
FLOORS = [(Profile(0.03, 0.05, depth=3e-3, corner=2e-3, offset=o), 0.05) for o in (0.0, 0.2)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("profile", "W_max"),
    [*(pytest.param(*scene, marks=pytest.mark.long) for scene in scenes(9, 3)), *FLOORS],
    ids=str,
)
def test_reaching_loads__found_together_are_those_found_one_by_one(profile, W_max, monkeypatch):
    """By `solve_contact`: actual contacts instead of moments of ridges, event by event."""
    together = reaching_loads(profile, W_max=W_max)
    monkeypatch.setattr(reaching, "all_events", lambda *_, **__: Events(np.empty(0), "none"))
    floor = replace(profile, depth=min(profile.depth, 1.0))  # one that is never touched
    single = reaching_loads(floor, W_max=W_max)
    assert together.status == single.status == ("ok",) * len(single.W)
    assert np.array_equal(together.Q, single.Q)
    np.testing.assert_allclose(together.W, single.W, rtol=2e-8)  # tolerance, of each


@pytest.mark.parametrize("seed", range(20))
def test_reaching_loads__of_narrow_ridges_are_all_found(seed):
    """Contacts that have just begun, on one side, and their tiny forces."""
    offset = np.random.default_rng(seed).uniform(-0.5, 0.5)
    found = reaching_loads(Profile(0.02, 0.02, corner=2e-3, offset=offset), W_max=0.02)
    assert set(found.status) == {"ok"}
    assert (np.diff(found.W) > 0).all()
    assert 1.3 * found.W[-1] > 0.02  # the next one lies beyond


def test_reaching_loads__of_ridges_that_contact_has_just_reached_are_all_found():
    """At every second event the contact on a ridge of a body nearly over a groove is new."""
    profile = Profile(0.7578946056, 0.2421053944, offset=0.0344323108)
    found = reaching_loads(profile, W_max=24.5)
    assert found.status == ("ok",) * 14
    W = float(found.W[0])
    with_next = solve_contact(profile, W * (1 + 1e-6))
    assert (solve_contact(profile, W * (1 - 1e-6)).Q, with_next.Q) == (1, 2)


def test_reaching_loads__over_floors_are_found_at_a_coarse_tolerance():
    profile = Profile(0.0466, 0.0302, depth=0.00245)
    coarse, fine = (reaching_loads(profile, W_max=0.12, rel_tol=tol) for tol in (1e-3, 1e-6))
    assert set(coarse.status) == set(fine.status) == {"ok"}
    np.testing.assert_allclose(coarse.W, fine.W, rtol=1e-3)  # tolerance
