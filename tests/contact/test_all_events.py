"""Events found together, against those found one by one, and single ridges in closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest

from ridgebayes.contact import reaching
from ridgebayes.contact.all_events import Events, all_events
from ridgebayes.contact.contact_solution import bearing_half_width, solve_contact
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.ridge_contacts import RidgeContacts
from ridgebayes.contact.ridge_row import RidgeRow
from ridgebayes.contact.rigid_profile import Profile

TOL = 1e-8


def one_by_one(monkeypatch, profile, W_max):
    """Loads by `solve_contact`: collocation, and each event by itself."""
    floor = profile if profile.depth < 1.0 else replace(profile, depth=1.0)  # is never touched
    with monkeypatch.context() as only:
        only.setattr(reaching, "all_events", lambda *_, **__: Events(np.empty(0), "none"))
        return reaching_loads(floor, W_max=W_max, rel_tol=TOL)


def scenes(n, seed):
    """Ridges of all shapes; round and sharp; bodies anywhere."""
    rng = np.random.default_rng(seed)
    for i in range(n):
        a = math.exp(rng.uniform(math.log(0.02), math.log(0.05)))
        b = a / math.exp(rng.uniform(math.log(0.2), math.log(5)))
        corner = (rng.uniform(0.01, 0.5) * a, 0.02 * a, 0.0)[i % 3]
        offset = (0.0, 0.5, rng.uniform(-0.5, 0.5))[(i // 3) % 3]
        yield Profile(a, b, corner=corner, offset=offset)


def agree(together, single):
    assert set(single.status) <= {"ok"}
    assert together.status == single.status
    assert np.array_equal(together.Q, single.Q)
    np.testing.assert_allclose(together.W, single.W, rtol=2 * TOL)  # tolerance, of each


@pytest.mark.slow
@pytest.mark.parametrize("profile", list(scenes(9, 3)), ids=str)
def test_all_events__are_those_found_one_by_one(profile, monkeypatch):
    W_max = 30 * profile.pitch**2
    assert all_events(profile, W_max=W_max, n_max=100, rel_tol=TOL).why == ""
    agree(reaching_loads(profile, W_max=W_max), one_by_one(monkeypatch, profile, W_max))


@pytest.mark.slow
@pytest.mark.parametrize("offset", [0.0, 0.2])
def test_reaching_loads__over_floors_are_those_found_one_by_one(offset, monkeypatch):
    """Together as far as no floor is touched, and one by one from there."""
    profile, W_max = Profile(0.03, 0.05, depth=3e-3, corner=2e-3, offset=offset), 0.05
    together = all_events(profile, W_max=W_max, n_max=100, rel_tol=TOL)
    assert len(together.W)
    assert together.why
    agree(reaching_loads(profile, W_max=W_max), one_by_one(monkeypatch, profile, W_max))


@pytest.mark.parametrize("seed", range(20))
def test_all_events__of_narrow_ridges_are_all_found(seed):
    """Contacts that have just begun, on one side, and their tiny forces."""
    rng = np.random.default_rng(seed)
    profile = Profile(0.02, 0.02, corner=2e-3, offset=rng.uniform(-0.5, 0.5))
    found = all_events(profile, W_max=0.02, n_max=100, rel_tol=1e-6)
    assert found.why == ""
    assert (np.diff(found.W) > 0).all()
    assert found.W[-1] > 0.02 > found.W[-4]


@pytest.mark.parametrize("corner", [0.0, 1e-3, 5e-3, 0.015])
@pytest.mark.parametrize("W", [1e-4, 1e-2, 0.2])
def test_bearing_half_width__holds_what_is_in_contact(corner, W):
    for b in (1e-4, 1e-3, 0.03):
        profile = Profile(0.03, b, corner=corner, offset=0.3)
        half_width = bearing_half_width(profile, W)
        assert 0.5 * profile.a - corner <= half_width <= 0.5 * profile.a
        found = solve_contact(profile, W, rel_tol=1e-4)
        assert found.status == "ok"
        for segment, (left, right) in found.covered.items():
            middle = 0.5 * (segment.start + segment.stop)
            assert max(middle - left, right - middle) <= half_width * (1 + 1e-12)  # rounding


@pytest.mark.parametrize("corner", [0.3, 0.05])
@pytest.mark.parametrize("w", [0.96, 0.999])
def test_ridge_contacts__of_a_round_ridge_below_the_centre_have_a_closed_load(w, corner):
    """docs/derivations/contact.md, "Kinks"; lengths in half-widths of the ridge."""
    phi = math.asin((1 - corner) / w)
    load = w**2 / 2 + (w**2 * (math.pi / 2 - phi) - (1 - corner) * w * math.cos(phi)) / (
        math.pi * corner
    )
    field = np.zeros((6, 1))
    field[:3, 0] = 0.25, 0.0, 0.25  # the parabola x^2/2
    ends = np.ones((2, 1))
    for _ in range(30):
        force = np.array([load / math.pi])
        contacts = RidgeContacts(field, force, ends, corner, 1 - corner)
        ends = ends + contacts.steps
    # Rounding times the condition of a thin layer.
    np.testing.assert_allclose(ends, w, rtol=1e-9)


@pytest.mark.parametrize("corner", [0.0, 2e-3])
@pytest.mark.parametrize("offset", [0.0, 0.5, 0.2, -0.3])
def test_ridge_row__fields_are_the_potentials_of_all_other_ridges(offset, corner):
    """At Chebyshev points of each ridge, less what the ridge's own moments make there."""
    n, m, points = 5, 12, 40
    row = RidgeRow.of(Profile(0.02, 0.03, corner=corner, offset=offset), n, m, 0.009)
    moments = np.random.default_rng(2).normal(size=(n, m)) * 0.5 ** np.arange(m)
    if row.over_ridge:
        moments[0, 1::2] = 0.0  # it is its own mirror image
    found = row.fields(moments[..., None])[..., 0]
    angle = (np.arange(points) + 0.5) * math.pi / points
    waves = np.cos(np.arange(m)[:, None] * angle)
    own = np.append(math.pi * math.log(2), math.pi / np.arange(1, m))
    own[0] += row.shift
    for i, centre in enumerate(row.centre):
        x = centre + row.half_width * np.cos(angle)
        potential = np.einsum("xnm,nm->x", row.potentials(x), moments)
        if i < n:
            potential -= (own * moments[i]) @ waves
        expected = waves @ potential * (2 / points)
        expected[0] *= 0.5
        scale = np.abs(expected).max()
        np.testing.assert_allclose(found[i], expected, rtol=0, atol=1e-13 * scale)  # rounding
