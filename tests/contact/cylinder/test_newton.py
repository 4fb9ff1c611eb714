"""Equilibrium: the same state by rise, load or corner, in few steps, or a message."""

import functools

import numpy as np
import pytest

from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.faces import proximal_corner
from ridgebayes.contact.cylinder.newton import Control, NotConvergedError, solve
from ridgebayes.contact.rigid_profile import Profile

COARSE = 8
AB = (0.06, 0.03)


@functools.cache
def body(nu=0.3, *, friction=0.0, ab=AB):
    profile = Profile(*ab) if ab else None
    return Cylinder(profile, p_max=0.02, nu=nu, friction=friction, edges=COARSE)


@functools.cache
def pressed(rise=0.01):
    """A ridged state far from its first transition."""
    return solve(body().problem, body().unloaded(), Control("rise", rise))[0]


def load(one, state):
    """Line load of what is meshed."""
    gaps = one.problem.gaps(state, state, np.zeros(len(one.problem.faces), dtype=bool))
    return one.problem.load(state, gaps)


def same(one, other):
    assert one.rise == pytest.approx(other.rise, rel=1e-8)  # solver's tolerances, next ones too
    np.testing.assert_allclose(one.u, other.u, atol=1e-9)
    np.testing.assert_allclose(one.pressure, other.pressure, atol=1e-6 * other.pressure.max())


def test_corner__leads_to_the_state_of_its_load_and_rise():
    one = body()
    corner = proximal_corner(one.profile, 1, one._height)
    apart = one.problem.corner_distance(pressed(), corner)[0]
    by_corner = solve(one.problem, pressed(), Control("corner", 0.7 * apart, corner))[0]
    assert one.problem.corner_distance(by_corner, corner)[0] == pytest.approx(
        0.7 * apart, abs=2e-11
    )
    same(solve(one.problem, pressed(), Control("load", load(one, by_corner)))[0], by_corner)
    same(solve(one.problem, pressed(), Control("rise", by_corner.rise))[0], by_corner)


def test_solution__is_in_equilibrium_and_presses_only_where_it_touches():
    one, state = body(), pressed()
    gaps = one.problem.gaps(state, state, np.zeros(len(one.problem.faces), dtype=bool))
    inner = one.problem.solid.assemble(state.u, state.p).force.ravel()
    outer = one.problem.force(state, gaps)
    total = np.abs(outer).sum()
    # The solver's tolerances: 1e-9 of the load, 1e-11 of the gap.
    assert np.abs((inner - outer)[one.problem.free]).max() < 1e-9 * total
    on = state.pressure > 0
    assert 5 < on.sum() < len(on)
    assert np.abs(gaps.gap[on]).max() < 1e-11
    assert gaps.gap[~on].min() > -1e-11
    # The mid-plane holds what the ridges push, and nothing else pushes up.
    held = np.setdiff1d(np.arange(len(inner)), one.problem.free)
    up = held[held % 2 == 1]
    assert -inner[up].sum() == pytest.approx(load(one, state), rel=1e-8)


@pytest.mark.slow
def test_solve__follows_the_rim_past_round_corners_to_the_state_of_short_steps():
    """In one step nodes of the rim snap past corners, and the potential curves down on the way."""
    problem = Cylinder(Profile(0.06, 0.03, corner=0.006), p_max=0.05, edges=4).problem
    first = solve(problem, problem.unloaded(), Control("rise", 0.005))[0]
    state = first
    for rise in (0.02, 0.04, 0.06):
        state = solve(problem, state, Control("rise", rise))[0]
    same(solve(problem, first, Control("rise", 0.06))[0], state)


def test_no_equilibrium__is_said():
    with pytest.raises(NotConvergedError, match=r"inside out|equilibrium in 30|singular|valley"):
        solve(body().problem, pressed(), Control("rise", 0.9))


# -------------------------------------------------------------------------------------- friction


@functools.cache
def rubbed(friction, ab=AB, nu=0.3):
    one = body(nu, friction=friction, ab=ab)
    state = one.unloaded()
    for rise in (2e-4, 1e-3, 2e-3):
        state = solve(one.problem, state, Control("rise", rise))[0]
    return one, state


@pytest.mark.slow
@pytest.mark.parametrize("ab", [AB, None])
@pytest.mark.parametrize("friction", [0.05, 0.3])
def test_shear__is_at_most_the_frictions(ab, friction):
    one, state = rubbed(friction, ab)
    on = state.pressure > 0
    assert np.abs(state.shear).max() > 0
    # Rounding, and what stays of a step of the kinds: 1e-9 of the load.
    excess = np.abs(state.shear) - friction * state.pressure
    assert (excess * one.problem.faces.length).max() < 1e-8 * load(one, state)
    assert not state.shear[~on].any()


@pytest.mark.slow
@pytest.mark.parametrize("ab", [AB, None])
def test_friction__of_a_body_below_half_pulls_the_contact_inwards(ab):
    """At nu = 0.3 the surface moves inwards under pressure; friction acts against that."""
    one, state = rubbed(0.3, ab)
    level = np.array([face.angle == 0.0 for face in one.problem.faces.faces])[
        one.problem.faces.face
    ]
    assert (state.shear * one.problem.faces.length)[level].sum() > 0
