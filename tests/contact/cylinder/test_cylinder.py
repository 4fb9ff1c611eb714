"""The pressed cylinder against Hertz, the half-plane's transitions, its energy and its mirror."""

import functools
import math
import re
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from ridgebayes import InputError, read_table
from ridgebayes.contact import hertz
from ridgebayes.contact.cylinder.cylinder import Cylinder, Transition, transition_curve
from ridgebayes.contact.cylinder.newton import Control, NotConvergedError, solve
from ridgebayes.contact.halfplane import transition_loads
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.table.datafiles import CALCULIX_FE, data_path
from tests.contact.cylinder.energy import stored_energy

COARSE = 8
A, B = 0.0032, 0.001  # so little that a disk is a half-plane to the discretisation
WIDE = Profile(0.06, 0.03)


@functools.cache
def flat(nu=0.3, *, p_max=0.01, edges=8):
    return Cylinder(None, p_max=p_max, nu=nu, edges=edges)


@functools.cache
def reached(profile, p_max, *, nu=0.3, edges=8, **others):
    one = Cylinder(profile, p_max=p_max, nu=nu, edges=edges, **others)
    return tuple(one.transitions(p_max))


def loads(found):
    return np.array([one.p_over_E for one in found])


def width(one, state):
    """Half-width of the contact of a half model: half of the last segment is its error."""
    return one.problem.faces.length[state.pressure > 0].sum()


# ----------------------------------------------------------------------------------------- smooth


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.5])
def test_smooth__contact_is_as_wide_as_hertzs(nu):
    one = flat(nu, p_max=0.001, edges=12)
    state = one.at_load(0.001, one.unloaded())
    # Discretisation: one segment.
    expected = float(hertz.half_width(0.001, nu=nu))
    assert width(one, state) == pytest.approx(expected, abs=one.problem.faces.length[0])


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.3, 0.5])
def test_smooth__pressure_is_hertzs(nu):
    one = flat(nu, p_max=0.001, edges=12)
    state = one.at_load(0.001, one.unloaded())
    w, length = float(hertz.half_width(0.001, nu=nu)), one.problem.faces.length[0]
    x = length * (np.arange(len(state.pressure)) + 0.5)
    inside = x < 0.8 * w
    expected = 4 * 0.001 / (math.pi * w) * np.sqrt(1 - (x[inside] / w) ** 2)
    # Discretisation, and the finite width of the contact (w/R = 0.04).
    np.testing.assert_allclose(state.pressure[inside], expected, rtol=0.01)


@pytest.mark.slow
def test_smooth__is_pressed_to_a_quarter_of_the_modulus():
    one = flat(0.5, p_max=0.25)
    state = one.unloaded()
    rises = []
    for p in (0.05, 0.15, 0.25):
        state = one.at_load(p, state)
        assert one.p_over_E(state) == pytest.approx(p, rel=1e-8)  # the solver's tolerance
        rises.append(state.rise)
    assert rises[0] < rises[1] < rises[2] < 0.5


@pytest.mark.long
@pytest.mark.slow
def test_work__of_the_load_is_the_stored_energy():
    one = flat(0.3)
    rises = 0.5 * 0.03 * (1 - np.cos(np.linspace(0, np.pi, 17)))
    state, works = one.unloaded(), [0.0]
    for rise in rises[1:]:
        state = solve(one.problem, state, Control("rise", rise))[0]
        works.append(2 * one.p_over_E(state))  # line load over E R of both halves
    x, w = rises, np.array(works)
    work = np.sum(np.diff(x) * 0.5 * (w[1:] + w[:-1]))
    energy = 2 * stored_energy(one.problem.solid, state.u)
    # Trapezium of 16 steps; segments that come into contact one by one.
    assert energy == pytest.approx(work, rel=1e-2)


# --------------------------------------------------------------------------------- the half-plane


@pytest.mark.slow
def test_transitions__of_tiny_ridges_are_the_half_planes():
    expected = transition_loads(A, B, 2).p_over_E(A + B, nu=0.49)
    found = reached(Profile(A, B), 1.001 * expected[1], nu=0.49, edges=16)
    assert [one.Q for one in found] == [4, 6]
    assert [one.ridge for one in found] == [1, 2]
    np.testing.assert_allclose(loads(found), expected, rtol=2e-3)  # discretisation


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize(
    ("others", "tolerance"),
    [
        pytest.param({"offset": 0.2}, 1e-2, id="off centre", marks=pytest.mark.long),
        pytest.param({"offset": 0.5}, 5e-3, id="over a ridge"),
        pytest.param({"corner": A / 10}, 1e-2, id="round corners"),
    ],
)
def test_transitions__of_tiny_profiles_are_the_half_planes(others, tolerance):
    profile = Profile(A, B, **others)
    expected = reaching_loads(profile, W_max=profile.pitch**2, rel_tol=1e-6)
    assert set(expected.status) == {"ok"}
    p = math.pi / 4 / (1 - 0.3**2) * expected.W
    found = reached(profile, 1.01 * p[-1], edges=10)
    assert [one.Q for one in found] == expected.Q.tolist()
    np.testing.assert_allclose(loads(found), p, rtol=tolerance)  # discretisation: 10 edges


# --------------------------------------------------------------------------------------- symmetry


@pytest.mark.slow
def test_transitions__of_the_half_model_are_those_of_the_whole():
    half = reached(WIDE, 5e-3)
    both = reached(Profile(0.06, 0.03, offset=1e-7), 5e-3)
    # Both of a pair at once, but for the offset.
    assert [one.Q for one in half] == [4]
    assert [one.Q for one in both] == [2, 3, 4]
    # Q = 2 comes at once.
    assert both[0].p_over_E < 1e-4 * half[0].p_over_E
    np.testing.assert_allclose(loads(both[1:]), half[0].p_over_E, rtol=1e-4)


# ------------------------------------------------------------------------------------------ loads


@pytest.mark.slow
def test_transitions__are_those_of_calculix():
    frame = read_table(data_path(CALCULIX_FE)).frame
    frame = frame[(frame["series"] == "fine") & (frame["Q"] <= 6)]
    found = loads(Cylinder(Profile(0.032, 0.01), nu=0.49, p_max=0.0045).transitions(0.004))
    # Reference: 0.1 %; discretisation of the default mesh: 0.1 %.
    np.testing.assert_allclose(found, frame["p_over_E"], rtol=2e-3)


@pytest.mark.long
@pytest.mark.slow
def test_transitions__converge_with_the_mesh():
    """Where a quarter of a corner has edges enough; sharp ones have no order to be seen."""
    profile = Profile(0.06, 0.03, corner=0.015)
    first, second, third = (reached(profile, 4.7e-3, edges=n)[0].p_over_E for n in (12, 24, 48))
    # Discretisation: first order would halve the steps between doubled meshes; they shrink by 5.
    assert abs(third - second) < 0.4 * abs(second - first)
    assert abs(third / second - 1) < 1.5e-3


@pytest.mark.slow
def test_transition__has_the_state_in_which_its_corner_touches():
    one = Cylinder(WIDE, p_max=5e-3, nu=0.3, edges=COARSE)
    (first,) = one.transitions(5e-3)
    assert one.p_over_E(first.state) == first.p_over_E
    assert not first.state.pressure[one.problem.faces.of_ridge(1)].any()
    beyond = one.at_load(1.2 * first.p_over_E, first.state)
    assert beyond.pressure[one.problem.faces.of_ridge(1)].any()


def test_transitions__after_too_many_failures_are_given_up(monkeypatch):
    tried = []

    def fails(problem, start, control, **others):
        tried.append(control.target)
        if len(tried) > 2:
            raise NotConvergedError("no equilibrium")
        return solve(problem, start, control, **others)

    monkeypatch.setattr("ridgebayes.contact.cylinder.cylinder.solve", fails)
    one = Cylinder(WIDE, p_max=5e-3, nu=0.3, edges=COARSE)
    Q, p_over_E, status = transition_curve(one, 5e-3, most_failures=3)
    assert (Q.tolist(), np.isnan(p_over_E).tolist()) == ([4], [True])
    assert re.fullmatch(r"not converged: at p/E = [\d.e-]+: no equilibrium", status[0])
    assert len(tried) == 2 + 3


@pytest.mark.slow
@pytest.mark.parametrize("offset", [0.0, pytest.param(0.3, marks=pytest.mark.long)])
def test_transitions__after_one_that_is_known_are_those_with_all_stops(offset):
    p_max = 0.01 if offset else 0.02
    one = Cylinder(replace(WIDE, offset=offset), p_max=p_max, nu=0.3, edges=COARSE)
    first, *others = one.transitions(p_max)
    later = list(one.transitions(p_max, after=first))
    assert [(each.ridge, each.Q) for each in later] == [(each.ridge, each.Q) for each in others]
    loads = [each.p_over_E for each in others]
    # Ten times the tolerance of forces.
    np.testing.assert_allclose([each.p_over_E for each in later], loads, rtol=1e-8)
    assert later


def test_curve__after_a_known_one_says_which_count_was_not_reached(monkeypatch):
    fails = Mock(side_effect=NotConvergedError("no equilibrium"))
    monkeypatch.setattr("ridgebayes.contact.cylinder.cylinder.solve", fails)
    one = Cylinder(WIDE, p_max=5e-3, nu=0.3, edges=COARSE)
    Q, p_over_E, _ = transition_curve(one, 5e-3, after=Transition(2, 6, 1e-3, one.unloaded()))
    assert (Q.tolist(), np.isnan(p_over_E).tolist()) == ([8], [True])


@pytest.mark.slow
def test_at_load__forgets_its_way_without_friction():
    one = flat()
    straight = one.at_load(0.005, one.unloaded())
    around = one.at_load(0.005, one.at_load(0.01, one.at_load(0.002, one.unloaded())))
    np.testing.assert_allclose(around.u, straight.u, atol=1e-9)  # the solver's tolerance


# --------------------------------------------------------------------------------------- friction


@pytest.mark.long
def test_friction__delays_transitions_below_half():
    rough, smooth = reached(WIDE, 5e-3, friction=0.1), reached(WIDE, 5e-3)
    assert len(rough) == len(smooth) == 1
    assert 1.001 < rough[0].p_over_E / smooth[0].p_over_E < 1.1


# ------------------------------------------------------------------------------------------- rules


@pytest.mark.parametrize(
    ("values", "rule"),
    [
        ({"friction": -0.1}, "friction = -0.1; expected >= 0"),
        ({"friction": math.nan}, "friction = nan; expected >= 0"),
        ({"p_max": 0.0}, "p_max = 0.0; expected over 0 and at most 1"),
        ({"p_max": 1.1}, "p_max = 1.1; expected over 0 and at most 1"),
        ({"p_max": math.nan}, "p_max = nan; expected over 0 and at most 1"),
        ({"nu": 0.6}, "nu = 0.6; expected 0 to 0.5"),
    ],
)
def test_values__against_their_rules_are_refused(values, rule):
    with pytest.raises(InputError, match=rule):
        Cylinder(WIDE, **({"p_max": 1e-3} | values))


def test_elements__beyond_the_rule_are_refused():
    with pytest.raises(InputError, match="elements at 60 edges a ridge; expected at most 40000"):
        Cylinder(Profile(0.002, 0.002), p_max=0.02, edges=60)
