"""Gaps and forces between a body and rigid faces: derivatives, balance, invariance."""

import functools

import numpy as np
import pytest

from ridgebayes.contact.cylinder.contact_problem import State
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.rigid_profile import Profile

COARSE = 8
STEP = 1e-6


@functools.cache
def body():
    """A half model on ridges: tops, walls and round corners, with friction."""
    return Cylinder(
        Profile(0.06, 0.03, offset=0.2, corner=0.01), p_max=0.02, friction=0.5, edges=COARSE
    )


def state(seed=1, size=2e-4, rise=3e-3):
    """A body a little bent, pressed and rubbed where it meets a ridge; not in equilibrium."""
    problem, rng = body().problem, np.random.default_rng(seed)
    x, y = problem.solid.points.T
    u = size * np.stack([np.sin(3 * x + y), np.cos(2 * x) * y], axis=-1)
    n = len(problem.faces)
    return State(u, problem.solid.no_pressure(), rng.uniform(0, 1, n), rng.uniform(-1, 1, n), rise)


def moved(one, du=None, rise=0.0):
    u = one.u if du is None else one.u + du.reshape(-1, 2)
    return State(u, one.p, one.pressure, one.shear, one.rise + rise)


def nothing_left_out():
    return np.zeros(len(body().problem.faces), dtype=bool)


def touched(one, before=None):
    return body().problem.gaps(one, before or one, nothing_left_out())


def direction(seed=2):
    """Smooth, as large as the body."""
    rng = np.random.default_rng(seed)
    x, y = body().problem.solid.points.T
    a, b = rng.uniform(1, 3, 2)
    return np.stack([np.cos(a * x + y), np.sin(b * x) + y], axis=-1).ravel()


def measured(one):
    """Segments near enough for the gap to stay finite under a small change."""
    gap = touched(one).gap
    return np.isfinite(gap) & (np.abs(gap) < 1e-2)


def test_gap__has_the_derivative_by_the_nodes():
    one, way = state(), direction()
    where = measured(one)
    assert where.sum() > 20
    up, down = (touched(moved(one, sign * STEP * way)).gap[where] for sign in (1, -1))
    expected = (touched(one).normal @ way / body().problem.faces.length)[where]
    # Finite difference: second order in the step; a ray that changes its edge has a kink.
    np.testing.assert_allclose((up - down) / (2 * STEP), expected, atol=1e-5)


@pytest.mark.parametrize(("pressed", "rubbed"), [(1, 0), (0, 1), (1, 1)])
def test_contact_stiffness__is_the_derivative_of_the_force(pressed, rubbed):
    one, way, problem = state(), direction(), body().problem
    on = measured(one)
    one = State(one.u, one.p, pressed * on * one.pressure, rubbed * on * one.shear, one.rise)
    up, down = (
        problem.force(other, touched(other))
        for other in (moved(one, sign * STEP * way) for sign in (1, -1))
    )
    slope = (up - down) / (2 * STEP)
    expected = problem.contact_stiffness(one, touched(one)) @ way
    # Finite difference: second order in the step, but rays that change edges.
    assert np.abs(slope - expected).max() < 1e-3 * np.abs(expected).max()
