"""Gaps and forces between a body and rigid faces: derivatives, balance, invariance."""

import functools

import numpy as np
import pytest

from ridgebayes.contact.cylinder.contact_problem import State
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.faces import Corner
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


def level(faces):
    """Segments of the ridges' tops, without their corners."""
    tops = np.array([face.angle == 0.0 and not face.radius for face in faces.faces])
    return tops[faces.face]


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


def test_gap__falls_by_what_the_ridges_rise_under_a_level_face():
    one, problem = state(), body().problem
    tops = level(problem.faces)
    where = measured(one) & tops
    fallen = touched(one).gap[where] - touched(moved(one, rise=1e-4)).gap[where]
    np.testing.assert_allclose(fallen, 1e-4, rtol=1e-9)  # rounding


def test_rise__is_the_whole_body_sinking():
    one, problem = state(), body().problem
    risen = touched(moved(one, rise=1e-4)).gap
    sunk = touched(moved(one, du=-1e-4 * problem.up)).gap
    where = measured(one)
    np.testing.assert_allclose(risen[where], sunk[where], atol=1e-13)  # rounding


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


def test_bending__of_a_convex_potential_is_the_part_that_stiffens():
    """Without its share that is positive: never positive, and what is left out never negative."""
    one, problem = state(), body().problem
    one = State(one.u, one.p, np.where(measured(one), one.pressure, 0.0), 0 * one.shear, one.rise)
    gaps = touched(one)
    whole = problem.contact_stiffness(one, gaps)
    convex = problem.contact_stiffness(one, gaps, share=0.0)
    half = problem.contact_stiffness(one, gaps, share=0.5)
    assert abs(half - 0.5 * (whole + convex)).max() < 1e-12 * abs(whole).max()  # rounding
    nodes = np.unique(problem._rim)
    dofs = np.stack([2 * nodes, 2 * nodes + 1], axis=-1).ravel()
    size = np.abs(whole).max()
    for matrix, sign in ((convex, -1.0), (whole - convex, 1.0)):
        values = np.linalg.eigvalsh(sign * matrix[dofs][:, dofs].toarray())
        assert values.min() > -1e-12 * size  # rounding
        assert values.max() > 1e-3 * size


def test_slip__of_a_level_shift_is_the_shift():
    before, problem = state(), body().problem
    tops = level(problem.faces)
    shift = np.tile([1e-5, 0.0], problem.solid.n_node)
    gaps = touched(moved(before, shift), before)
    where = measured(before) & tops
    slip = gaps.slip / problem.faces.length
    np.testing.assert_allclose(slip[where], 1e-5, atol=1e-15)  # rounding


def test_slip__of_ridge_and_body_together_is_nothing():
    before, problem = state(), body().problem
    gaps = touched(moved(before, 1e-4 * problem.up, rise=1e-4), before)
    where = measured(before)
    np.testing.assert_allclose(gaps.slip[where] / problem.faces.length[where], 0, atol=1e-14)


def test_force__of_level_faces_is_pressure_and_shear_times_length():
    one, problem = state(), body().problem
    tops = level(problem.faces)
    on = measured(one) & tops
    one = State(one.u, one.p, np.where(on, one.pressure, 0), np.where(on, one.shear, 0), one.rise)
    force = problem.force(one, touched(one)).reshape(-1, 2).sum(axis=0)
    length = problem.faces.length
    # Rounding. A pressure on a gap acts along the ridge's normal and the body's slope.
    assert force[1] == pytest.approx(one.pressure @ length, rel=1e-12)
    assert problem.load(one, touched(one)) == pytest.approx(one.pressure @ length, rel=1e-12)
    tilted = State(one.u, one.p, 0 * one.pressure, one.shear, one.rise)
    across = problem.force(tilted, touched(tilted)).reshape(-1, 2).sum(axis=0)
    np.testing.assert_allclose(across, [one.shear @ length, 0.0], atol=1e-15)


def test_left_out__segments_have_an_infinite_gap():
    one, out = state(), body().problem.faces.of_ridge(1)
    gap = body().problem.gaps(one, one, out).gap
    assert np.isinf(gap[out]).all()
    np.testing.assert_array_equal(gap[~out], touched(one).gap[~out])


def test_apart__has_the_derivative_by_the_nodes_and_falls_with_the_rise():
    one, way, problem = state(), direction(), body().problem
    corner = Corner(1, (0.15, -0.98), 0.01)
    value, row = problem.corner_distance(one, corner)
    up, down = (
        problem.corner_distance(moved(one, sign * STEP * way), corner)[0] for sign in (1, -1)
    )
    # Finite difference: second order in the step.
    assert (up - down) / (2 * STEP) == pytest.approx(row @ way, rel=1e-6)
    higher, lower = (
        problem.corner_distance(moved(one, rise=sign * STEP), corner)[0] for sign in (1, -1)
    )
    assert (higher - lower) / (2 * STEP) == pytest.approx(-row @ problem.up, rel=1e-6)
    sharp = problem.corner_distance(one, Corner(1, corner.centre, 0.0))[0]
    assert value == pytest.approx(sharp - 0.01, abs=1e-15)  # rounding
