"""Smooth cylinders of other materials at finite strain."""

import math
from functools import cache

import numpy as np
import pytest

from ridgebayes._types import NEO_HOOKEAN
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.smooth import half_width, half_widths, stiffening
from ridgebayes.contact.two_scale import width_ratio

MOONEY = ((0.5, 2.0), (0.5, -2.0))
STIFF = ((0.5, 2.0), (0.5, 12.0))
LOADS = (0.1,)


@cache
def widths(ogden, nu=0.5, edges=12.0):
    body = Cylinder(None, p_max=0.11, nu=nu, edges=edges, ogden=ogden)
    return np.array(list(half_widths(body, LOADS)))


def test_half_width__ends_where_hertzs_pressure_does():
    x = (np.arange(60) + 0.5) * 0.01
    pressure = np.sqrt(np.maximum(1.0 - (x / 0.4321) ** 2, 0.0))
    assert half_width(x, pressure) == pytest.approx(0.4321, rel=1e-10)  # rounding


@pytest.mark.long
def test_half_widths__of_mooney_and_rivlins_body_are_the_neo_hookean_ones():
    # In plane strain both invariants are the same: only Newton's tolerance is left.
    np.testing.assert_allclose(widths(MOONEY), widths(NEO_HOOKEAN), rtol=1e-4)


@pytest.mark.long
def test_half_widths__narrow_as_the_body_stiffens():
    some = [widths(((1 - share, 2.0), (share, 12.0))) for share in (0.02, 0.5)]
    soft = widths(NEO_HOOKEAN)
    few, half = (1 - float((one / soft)[0]) for one in some)
    assert 0.0 < few < half
    # Order: in proportion to a small share, and less than that to a large one.
    assert 10.0 < half / few < 25.0
    assert half > 0.07


@pytest.mark.long
@pytest.mark.parametrize("nu", [0.5, 0.45])
def test_stiffening__is_that_of_a_finer_mesh(nu):
    found, reach = stiffening(nu, STIFF, 6)
    assert reach == 0.5
    finer = widths(STIFF, nu, 32.0) / widths(NEO_HOOKEAN, nu, 32.0)
    ratio = np.polynomial.polynomial.polyval(np.sqrt(LOADS), found) + 1
    np.testing.assert_allclose(ratio, finer, atol=2.5e-3)  # discretisation
    product = width_ratio(0.3, nu, STIFF) / width_ratio(0.3, nu)
    assert product == pytest.approx(1 + np.polyval(found[::-1], math.sqrt(0.3)), rel=1e-12)
