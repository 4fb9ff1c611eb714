"""Closed sums of a kink's series, against long series and quadrature."""

import math

import numpy as np
import pytest
from scipy import integrate

from ridgebayes.contact.rigid_profile import Kinks

# Both ends, one end, nearly the whole interval, and a thin layer.
KINKS = Kinks(np.array([1.3, 0.7, 2.0]), np.array([[0.4, 0.0, 2.9], [1.2, 0.3, 0.01]]))
N = 400


def depth(i, s):
    """The rigid surface below the ridges' tops."""
    left, right = np.cos(KINKS.angle[:, i])
    return 0.5 * KINKS.bend[i] * (np.maximum(s - right, 0) ** 2 + np.maximum(-s - left, 0) ** 2)


@pytest.mark.parametrize("i", range(3))
@pytest.mark.parametrize("order", [0, 1, 2, 7, 60])
def test_series__are_chebyshev_coefficients(i, order):
    factor = 1 if order == 0 else 2
    breaks = [math.pi - KINKS.angle[0, i], KINKS.angle[1, i]]
    value, _ = integrate.quad(
        lambda t: depth(i, math.cos(t)) * math.cos(order * t),
        0,
        math.pi,
        points=breaks,
        limit=800,
        epsabs=1e-11,
    )
    # Quadrature: asked for to 1e-11.
    assert KINKS.series(61)[i, order] == pytest.approx(factor * value / math.pi, abs=1e-11)


def test_strengths__are_the_sums_of_all_orders():
    order = np.arange(1024)
    few = Kinks(KINKS.bend, np.array([[0.4, 0.0, 2.2], [1.2, 0.9, 0.8]]))
    at = np.array([math.pi, 0.0, 0.7, 2.0])
    waves = np.exp(-36 * (order / 1024) ** 8) * np.cos(order * at[:, None])
    expected = (few.series(1024) * order) @ waves.T
    # Discretisation: of the filter, over n^-2.
    np.testing.assert_allclose(few.strengths(at), expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("s", [-40.0, -20.0, -3.0, -1.2, -0.9, 0.0, 0.5, 0.99, 1.01, 1.5, 30.0])
def test_harmonic__is_the_series_and_the_surface_within(s):
    z = math.exp(-math.acosh(max(abs(s), 1.0)))
    waves = z ** np.arange(N) * np.cos(np.arange(N) * math.acos(min(max(s, -1.0), 1.0)))
    found = KINKS.harmonic(np.full((1, 3), s))[0]
    # Discretisation: of 400 orders that fall as n^-3, or quicker outside; else rounding.
    atol = 2e-13 if abs(s) > 1.1 else 2e-6
    np.testing.assert_allclose(found, KINKS.series(N) @ waves, rtol=0, atol=atol)
    if abs(s) <= 1:
        np.testing.assert_allclose(found, [depth(i, s) for i in range(3)], atol=1e-14)  # algebra
