"""Pressures on given intervals, against closed forms and plain quadrature of the logarithm."""

import math

import numpy as np
import pytest
from scipy import integrate

from ridgebayes.contact.intervals import Intervals, solve_pressure
from ridgebayes.contact.rigid_profile import Kinks

FLAT = np.zeros((1, 1))
S = np.linspace(-1.0, 1.0, 9)


def intervals_of(*ends, mirrored=False):
    left, right = np.array(ends, dtype=float).T
    return Intervals(left, right, mirrored)


def kinks_of(intervals, at, r):
    """Kinks at |x| = at, one an interval, beyond which a parabola of curvature 1/r falls away."""
    centre, half = intervals.centre, intervals.half_width
    at = np.array(at)
    inside = np.stack([intervals.left < -at, intervals.right > at])
    cosines = np.clip(np.stack([centre + at, at - centre]) / half, -1, 1)
    return Kinks(half**2 / r, np.where(inside, np.arccos(cosines), 0.0))


def two_strips(alpha, beta, W):
    """Closed form on [-beta, -alpha] and [alpha, beta]: in t = x^2 a tilted flat punch.

    -int p ln|t - tau| dtau = d - t/2 for p(t) dt = q dx. Returns the approach, and q sqrt(1-s^2)
    of the right strip as a function of s.
    """
    middle, half = 0.5 * (beta**2 + alpha**2), 0.5 * (beta**2 - alpha**2)
    approach = 0.5 * middle + 0.5 * W * math.log(2.0 / half)

    def strength(s):
        x = 0.5 * (alpha + beta) + 0.5 * (beta - alpha) * s
        r = (x**2 - middle) / half
        # 1 - r^2 is 1 - s^2 times the factor below.
        w = 0.5 * (beta - alpha)
        factor = (w / half) ** 2 * (x + alpha) * (x + beta)
        return 2 * x * (0.5 * W - 0.5 * half * r) / (math.pi * half * np.sqrt(factor))

    return approach, strength


def recession_by_quadrature(found, x):
    """-int q ln|x - xi| dxi over every interval and mirror image, in the angle of each."""
    total = 0.0
    for i, (centre, w) in enumerate(
        zip(found.intervals.centre, found.intervals.half_width, strict=True)
    ):
        whole = found.intervals.mirrored and not (found.intervals.straddles and i == 0)
        for sign in (1.0, -1.0) if whole else (1.0,):

            def integrand(theta, i=i, centre=centre, w=w, sign=sign):
                s = np.array([math.cos(theta)])
                q = float(found.pressure(s)[i, 0]) * w  # dx = w sin(theta) dtheta
                return -q * math.log(abs(x - sign * (centre + w * s[0])) or 1e-300)

            at = (sign * x - centre) / w
            points = [math.acos(at)] if -1 < at < 1 else None
            total += integrate.quad(integrand, 0, math.pi, points=points, limit=400)[0]
    return total


@pytest.mark.parametrize("W", [1e-12, 1e-4, 0.1])
def test_press__one_interval_of_hertz_half_width_is_hertz(W):
    w = math.sqrt(2 * W)
    found = solve_pressure(intervals_of((-w, w)), FLAT, W, 8)
    # Rounding: of a solve of nine unknowns.
    np.testing.assert_allclose(found.pressure(S)[0], w * (1 - S**2) / math.pi, atol=1e-13 * w)
    assert found.approach == pytest.approx(0.25 * w**2 + W * math.log(2 / w), rel=1e-13)
    assert np.abs(found.singular).max() < 1e-13 * W
    assert np.abs(found.outward).max() < 1e-12 * w


@pytest.mark.parametrize("factor", [1.0, 3.0, 100.0])
def test_press__a_fixed_interval_is_the_flat_punch_and_the_parabola(factor):
    w = 0.02
    W = factor * 0.5 * w**2
    found = solve_pressure(intervals_of((-w, w)), FLAT, W, 6)
    # x^2/2 = w^2/4 (1 + T_2), and the flat punch is W/(pi w sqrt(1 - s^2)).
    expected = (W - 0.5 * w**2 * (2 * S**2 - 1)) / (math.pi * w)
    np.testing.assert_allclose(found.pressure(S)[0], expected, atol=1e-13 * W / w)  # rounding
    assert found.load == pytest.approx(W, rel=1e-14)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("alpha", [0.1, 0.02, 1e-3])
def test_press__two_strips_are_their_closed_form(mirrored, alpha):
    beta, W = 0.12, 0.02
    ends = [(alpha, beta)] if mirrored else [(-beta, -alpha), (alpha, beta)]
    found = solve_pressure(intervals_of(*ends, mirrored=mirrored), np.zeros((len(ends), 1)), W, 120)
    approach, strength = two_strips(alpha, beta, W)
    # Discretisation: exponential, decayed; less so at the corner of the narrowest groove.
    rtol = 1e-11 if alpha > 0.01 else 1e-6
    np.testing.assert_allclose(found.pressure(S)[-1], strength(S), rtol=rtol)
    assert found.approach == pytest.approx(approach, rel=1e-13)  # rounding
    assert found.load == pytest.approx(W, rel=1e-13)


def test_press__the_free_end_of_two_strips_is_where_their_closed_form_says():
    alpha, W = 0.02, 1e-3
    beta = math.sqrt(alpha**2 + 2 * W)  # W = (beta^2 - alpha^2)/2
    found = solve_pressure(intervals_of((alpha, beta), mirrored=True), FLAT, W, 40)
    assert abs(found.singular[1][0]) < 1e-12 * W  # rounding
    assert found.singular[0][0] > 0.1 * W


def test_outward__is_newtons_step_and_gains_twice_the_digits():
    alpha, W = 0.02, 1e-3
    beta = math.sqrt(alpha**2 + 2 * W)
    errors = []
    for off in (1e-2, 1e-3, 1e-4):
        end = beta * (1 + off)
        found = solve_pressure(intervals_of((alpha, end), mirrored=True), FLAT, W, 40)
        errors.append(abs(end + found.outward[1][0] - beta) / beta)
    # Order: quadratic in the distance, with a constant of order one.
    assert all(error < off**2 for error, off in zip(errors, (2e-2, 2e-3, 2e-4), strict=True))
    assert 80 < errors[0] / errors[1] < 120


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("x", [0.0, 0.013, 0.031, -0.044, 0.07, 0.4])
def test_recession__is_the_integral_of_the_logarithm(mirrored, x):
    ends = [(-0.01, 0.01), (0.03, 0.05)] if mirrored else [(-0.04, -0.01), (0.012, 0.03)]
    height = np.array([[2e-4, 0.0, 1e-5], [0.0, 0.0, 0.0]])
    found = solve_pressure(intervals_of(*ends, mirrored=mirrored), height, 3e-3, 16)
    # Quadrature: scipy's own tolerance over an integrable logarithm.
    assert float(found.recession(x)) == pytest.approx(recession_by_quadrature(found, x), rel=1e-7)


def test_press__the_body_lies_on_the_rigid_surface_between_collocation_points_too():
    s = np.linspace(-1, 1, 101)
    intervals = intervals_of((-0.05, -0.02), (-0.004, 0.004), (0.03, 0.06))
    height = np.array([[0.0, 0.0, 0.0], [3e-4, 1e-5, 2e-5], [0.0, -1e-5, 0.0]])
    found = solve_pressure(intervals, height, 4e-3, 24)
    for centre, w, row in zip(intervals.centre, intervals.half_width, height, strict=True):
        rigid = np.polynomial.chebyshev.chebval(s, row)
        # Discretisation: exponential, decayed.
        np.testing.assert_allclose(found.surface(centre + w * s), -rigid, atol=1e-13)


def test_press__a_mirrored_half_is_the_whole():
    height = np.array([[2e-4, 0.0, 1e-5], [0.0, 1e-5, 0.0]])
    half = solve_pressure(
        intervals_of((-0.01, 0.01), (0.03, 0.05), mirrored=True), height, 3e-3, 20
    )
    mirror = height[1] * [1, -1, 1]
    ends = (-0.05, -0.03), (-0.01, 0.01), (0.03, 0.05)
    whole = solve_pressure(intervals_of(*ends), np.stack([mirror, *height]), 3e-3, 40)
    # Rounding: 1e-12 of the dense solve.
    np.testing.assert_allclose(half.forces, whole.forces[1:], rtol=1e-12)
    assert half.approach == pytest.approx(whole.approach, rel=1e-12)
    np.testing.assert_allclose(half.pressure(S), whole.pressure(S)[1:], rtol=1e-10)
    assert half.load == pytest.approx(3e-3, rel=1e-13)
    assert np.array_equal(half.intervals.weight, [1.0, 2.0])
    assert half.intervals.straddles
    assert not whole.intervals.straddles


@pytest.mark.parametrize("straddles", [False, True])
def test_recession__with_kinks_in_a_mirrored_half_is_that_of_the_whole(straddles):
    """And the surface lies on the rigid one, at its kinks too, on either side."""
    ends = [(-0.05, 0.05), (0.06, 0.1), (0.12, 0.15)] if straddles else [(0.01, 0.05), (0.06, 0.1)]
    mirror = [(-right, -left) for left, right in ends[::-1] if left > 0]
    half, whole = intervals_of(*ends, mirrored=True), intervals_of(*mirror, *ends)
    kinks = np.array([0.03, 0.08, 0.14])
    own = kinks[: len(ends)]
    twice = np.concatenate([own[: -len(mirror) - 1 : -1], own])

    def depth(x):
        kink = kinks[np.searchsorted([0.055, 0.11], np.abs(x))]
        return 100 * np.maximum(np.abs(x) - kink, 0.0) ** 2

    level = np.zeros((len(twice), 1))
    found = solve_pressure(half, level[: len(own)], 8e-3, 16, kinks_of(half, own, 0.005))
    expected = solve_pressure(whole, level, 8e-3, 32, kinks_of(whole, twice, 0.005))
    x = np.concatenate([np.linspace(-0.16, 0.16, 65), [0.4, -0.7], kinks, -kinks])
    # Discretisation: of 16 coefficients, which neighbours' surfaces take.
    np.testing.assert_allclose(found.recession(x), expected.recession(x), rtol=0, atol=1e-8)
    touched = np.any([(low <= abs(x)) & (abs(x) <= high) for low, high in ends], axis=0)
    # Discretisation: of neighbours' orders beyond the 16th.
    np.testing.assert_allclose(found.surface(x)[touched], -depth(x)[touched], rtol=0, atol=1e-8)


def test_press__its_error_falls_exponentially_in_the_coefficients():
    alpha, beta, W = 0.02, 0.12, 0.02
    exact, _ = two_strips(alpha, beta, W)
    m = np.array([3, 4, 5, 6])
    errors = [
        abs(
            solve_pressure(intervals_of((alpha, beta), mirrored=True), FLAT, W, int(n)).approach
            - exact
        )
        for n in m
    ]
    log_rho = math.acosh((alpha + 0.5 * (alpha + beta)) / (0.5 * (beta - alpha)))
    slope = np.polyfit(m, np.log(errors), 1)[0]
    # Discretisation: rho^-m or quicker (rho^-2m), rho that of the mirror image's edge.
    assert slope < -log_rho


@pytest.mark.parametrize("beyond", [0.2, 1e-3, 1e-8])
def test_press__ends_beyond_kinks_are_free_at_a_closed_load(beyond):
    """x^2/2 and beyond |x| = c a parabola of curvature 1/r."""
    w, r = 0.05, 0.01
    c = w * (1 - beyond)
    angle = math.asin(c / w)
    W = 0.5 * w**2 + (w**2 * (0.5 * math.pi - angle) - c * w * math.cos(angle)) / (math.pi * r)
    intervals = intervals_of((-w, w))
    found = solve_pressure(intervals, FLAT, W, 10, kinks_of(intervals, [c], r))
    # Rounding: of sums in closed form.
    assert np.abs(found.singular).max() < 1e-13 * found.coefficients[0, 0]
    assert np.abs(found.outward).max() < 1e-12 * w
    assert found.load == pytest.approx(W, rel=1e-13)


def test_tail__is_what_neighbours_add_not_what_a_kink_has():
    intervals = intervals_of((-0.05, 0.05))
    alone = solve_pressure(intervals, FLAT, 4e-3, 10, kinks_of(intervals, [0.04], 0.01))
    assert alone.tail < 1e-12  # rounding: it has no neighbours
    near = solve_pressure(intervals_of((-0.06, -0.001), (0.001, 0.06)), np.zeros((2, 1)), 4e-3, 6)
    far = solve_pressure(intervals_of((-0.06, -0.03), (0.03, 0.06)), np.zeros((2, 1)), 4e-3, 6)
    assert near.tail > 1e-2 > 1e-3 > far.tail


def test_surface_by_load__is_the_difference_of_two_loads_at_the_same_ends():
    ends, x = [(-0.01, 0.01), (0.03, 0.05)], np.array([0.0, 0.004, 0.02, 0.045, 0.2])
    intervals = intervals_of(*ends, mirrored=True)
    kinks = kinks_of(intervals, [0.005, 0.046], 0.002)
    low, high = (solve_pressure(intervals, np.zeros((2, 1)), W, 12, kinks) for W in (1e-3, 3e-3))
    slope = (high.surface(x) - low.surface(x)) / 2e-3
    # Rounding: surfaces are linear in the load.
    np.testing.assert_allclose(low.surface_by_load(x), slope, rtol=0, atol=1e-11)
