"""Events found together, against those found one by one, and single ridges in closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest

from ridgebayes.contact import reaching
from ridgebayes.contact.all_events import Events, all_events
from ridgebayes.contact.reaching import reaching_loads
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
