"""The search of a function's minimum by its values: quadratics have closed forms."""

import numpy as np
import pytest

from ridgebayes.inference.mode_search import hessian, scale, searched, widths

CENTRE = np.array([0.3, -1.2, 0.05])
# One direction bends 1e4 times more than another, and the first two depend on each other.
CURVATURE = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1e4]])


def bowl(x):
    away = x - CENTRE
    return 0.5 * np.einsum("...i,ij,...j->...", away, CURVATURE, away)


def test_searched__finds_the_centre_of_a_bowl_that_is_sharp_in_one_direction():
    found, _ = searched(bowl, np.zeros(3), 1e-3)
    # The slope at which the search ends, over the least curvature.
    assert np.all(np.abs(found - CENTRE) < 2e-3)


def counted(function):
    calls = []

    def called(x):
        calls.append(x)
        return function(x)

    return called, calls


def test_searched__from_a_known_spread_takes_fewer_calls():
    first, spread = searched(bowl, np.zeros(3), 1e-3)
    again, calls = counted(bowl)
    found, _ = searched(again, first + 0.05, 1e-3, spread=spread)
    plain, calls_without = counted(bowl)
    searched(plain, first + 0.05, 1e-3)
    assert np.all(np.abs(found - CENTRE) < 2e-3)
    assert len(calls) < len(calls_without)


def test_searched__of_a_rough_function_does_not_look_for_digits_that_it_has_not():
    def rough(x):
        return 1e-3 * bowl(x) + 2e-3 * np.sin(1e4 * x).sum(axis=-1)

    seen, calls = counted(rough)
    found, _ = searched(seen, np.zeros(3), 1e-6, smooth=False)
    assert rough(found) <= rough(np.zeros(3)) + 1e-9
    # Each call is one point with its slope, or a step that tells the scale: it was 51.
    assert len(calls) < 40


def test_hessian__of_a_bowl_is_its_curvature():
    # Differences of fourth order are exact for a quadratic: rounding alone.
    np.testing.assert_allclose(hessian(bowl, CENTRE), CURVATURE, rtol=1e-6, atol=1e-6)


def test_scale__shrinks_only_where_the_function_bends_sharply():
    factors = scale(bowl, CENTRE)
    assert factors[:2].tolist() == [1.0, 1.0]
    # Two steps of 0.1 raise the bowl by 100, of a sixteenth of that by 100 / 256.
    assert factors[2] == 1 / 16


def test_widths__of_a_normal_are_its_sds_and_of_two_humps_what_spans_them():
    sds = np.array([0.003, 0.2, 1.1])

    def normal(x):
        return 0.5 * (x * x / sds**2).sum(axis=-1)

    # The rule's nodes double: a tenth; the widest is cut at four.
    np.testing.assert_allclose(widths(normal, np.zeros(3)), sds, rtol=0.1)

    def humps(x):
        return -np.log(np.exp(-0.5 * (x / 0.01) ** 2) + np.exp(-0.5 * ((x - 1) / 0.3) ** 2))[..., 0]

    # Seen from the narrow one, which has a thirtieth of the mass.
    assert widths(humps, np.zeros(1))[0] == pytest.approx(1.03, rel=0.1)
