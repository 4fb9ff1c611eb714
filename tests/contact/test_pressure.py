"""Pressures on given intervals, against closed forms and plain quadrature of the logarithm."""

import math

import numpy as np
import pytest
from scipy import integrate

from ridgebayes.contact.intervals import Intervals
from ridgebayes.contact.pressure import solve_pressure
from ridgebayes.contact.rigid_profile import Kinks

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


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("x", [0.0, 0.013, 0.031, -0.044, 0.07, 0.4])
def test_recession__is_the_integral_of_the_logarithm(mirrored, x):
    ends = [(-0.01, 0.01), (0.03, 0.05)] if mirrored else [(-0.04, -0.01), (0.012, 0.03)]
    height = np.array([[2e-4, 0.0, 1e-5], [0.0, 0.0, 0.0]])
    found = solve_pressure(intervals_of(*ends, mirrored=mirrored), height, 3e-3, 16)
    # Quadrature: scipy's own tolerance over an integrable logarithm.
    assert float(found.recession(x)) == pytest.approx(recession_by_quadrature(found, x), rel=1e-7)


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
    n = np.where(half.left < 0, 32, 16)  # the whole one's
    found = solve_pressure(half, level[: len(own)], 8e-3, n, kinks_of(half, own, 0.005))
    expected = solve_pressure(whole, level, 8e-3, 32, kinks_of(whole, twice, 0.005))
    x = np.concatenate([np.linspace(-0.16, 0.16, 65), [0.4, -0.7], kinks, -kinks])
    # Discretisation: of 16 coefficients, which neighbours' surfaces take.
    np.testing.assert_allclose(found.recession(x), expected.recession(x), rtol=0, atol=1e-8)
    touched = np.any([(low <= abs(x)) & (abs(x) <= high) for low, high in ends], axis=0)
    # Discretisation: of neighbours' orders beyond the 16th.
    np.testing.assert_allclose(found.surface(x)[touched], -depth(x)[touched], rtol=0, atol=1e-8)
