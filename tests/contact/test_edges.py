"""Forces on edges: against the energy, the centroid of the pressure, and a punch's closed form."""

import math

import numpy as np
import pytest

from ridgebayes.contact.contact_solution import solve_contact
from ridgebayes.contact.edges import edge_forces
from ridgebayes.contact.rigid_profile import Profile

NU, TOL = 0.3, 1e-10
MODULUS = 1 / (1 - NU**2)


def solved(profile, W):
    found = solve_contact(profile, W, rel_tol=TOL)
    assert found.status == "ok"
    return found


def potential(found):
    """Potential at constant load over E R^2: elastic energy less the load's work."""
    pressing, where = found.pressing, found.pressing.intervals
    centre, half, series = where.centre, where.half_width, pressing.coefficients
    # Integral of q x^2, from x = centre + half s and the series of q.
    second = series[:, 0] * (centre**2 + half**2 / 2)
    second = math.pi * (second + series[:, 1] * centre * half + series[:, 2] * half**2 / 4)
    # u = d - x^2/2 where pressure acts.
    energy = 0.25 * (pressing.load * pressing.approach - 0.5 * second @ where.weight)
    return math.pi * MODULUS * (energy - 0.5 * pressing.load * pressing.approach)


# Offset, load over pitch^2, free ends: full cover on both sides, one outer ridge partial, both.
CASES = [(0.2, 1.4, 0), (-0.3, 2.0, 1), (0.1, 0.8, 2), (0.45, 1.6, 2), (0.3, 4.0, 1)]


@pytest.mark.parametrize(("offset", "load", "n_free"), CASES)
def test_edge_forces__are_the_change_of_energy_and_the_moment(offset, load, n_free):
    a, b, step = 0.012, 0.03, 1e-3
    W = load * (a + b) ** 2
    found = edge_forces(solved(Profile(a, b, offset=offset), W), NU)
    assert (found.K == 0).sum() == n_free
    signed, whole = (found.side * found.G).sum(), found.G.sum()
    assert abs(signed) > 1e-4 * whole  # else nothing is compared
    # The centroid: moment balance of a round body.
    assert abs(signed - found.lateral) < 1e-6 * whole
    # Ridges move to the left as the offset grows; a fourth-order difference.
    places = [offset + k * step for k in (-2, -1, 1, 2)]
    energy = np.array([potential(solved(Profile(a, b, offset=o), W)) for o in places])
    slope = energy @ np.array([1, -8, 8, -1]) / (12 * step)
    assert abs(signed + slope / (a + b)) < 1e-6 * whole


@pytest.mark.parametrize("centre", [0.0, 0.5])
def test_edge_forces__vanish_over_a_grooves_or_ridges_centre(centre):
    a, b = 0.022, 0.02
    exact = edge_forces(solved(Profile(a, b, offset=centre), 0.002), NU)
    assert exact.lateral == 0
    assert abs((exact.side * exact.G).sum()) < 1e-12 * exact.G.sum()
    # Beside it the whole is solved, without symmetry; the force is odd there.
    near = edge_forces(solved(Profile(a, b, offset=centre - 1e-7), 0.002), NU)
    assert abs(near.lateral) < 1e-6 * near.G.sum()
    np.testing.assert_allclose(near.x, exact.x, atol=1e-7)
    np.testing.assert_allclose(near.G, exact.G, rtol=1e-4, atol=1e-9)
    assert near.ridge.tolist() == exact.ridge.tolist()
    assert near.side.tolist() == exact.side.tolist()


def test_edge_forces__of_a_single_flat_punch_have_their_closed_form():
    # Grooves so wide that no other ridge is there: P on the half-width c, a parabola on top.
    a, W = 0.02, 0.01
    found = edge_forces(solved(Profile(a, 50.0, offset=0.5), W), NU)
    c, P = 0.5 * a, 0.5 * math.pi * MODULUS * W
    # The flat punch's pressure P/(pi sqrt(c^2 - x^2)) less what the parabola takes from its ends.
    K = P / math.sqrt(math.pi * c) - 0.25 * math.sqrt(math.pi) * MODULUS * c**1.5
    np.testing.assert_allclose(found.K, K, rtol=1e-9)
    np.testing.assert_allclose(found.G, K**2 / (2 * MODULUS), rtol=1e-9)
    assert found.x.tolist() == pytest.approx([-c, c])


def test_edge_forces__round_corners_have_no_singularity_but_a_lateral_force():
    a, b, W, corner = 0.022, 0.02, 0.002, 0.002
    found = edge_forces(solved(Profile(a, b, corner=corner, offset=0.2), W), NU)
    assert not found.K.any()
    assert not found.G.any()
    sharp = edge_forces(solved(Profile(a, b, offset=0.2), W), NU)
    assert 0.01 * abs(sharp.lateral) < abs(found.lateral) < 10 * abs(sharp.lateral)
