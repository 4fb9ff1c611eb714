import numpy as np
import pytest

from ridgebayes.contact import hertz

# Algebra: a handful of roundings, condition 1 (the square doubles it).
ROUNDING = 1e-14


def test_constant_is_the_printed_one():
    # Reference: 1.382, printed with eq. (3) of doi:10.1016/j.ijssolstr.2019.06.026.
    assert round(float(hertz.hertz_constant()), 3) == 1.382


def test_half_width_and_load_invert_each_other():
    w = np.geomspace(1e-6, 1.0, 7)
    back = hertz.half_width(hertz.load_of_half_width(w, nu=0.3), nu=0.3)
    np.testing.assert_allclose(back, w, rtol=ROUNDING)


def test_half_width_is_that_of_the_textbook():
    # Reference: Johnson (1985) eq. (4.43), w^2 = 4 P' R / (pi E*), in SI units.
    R, E, nu, p = 0.008, 60e3, 0.45, 700.0
    line_load, modulus = 2.0 * R * p, E / (1.0 - nu**2)
    w = np.sqrt(4.0 * line_load * R / (np.pi * modulus))
    np.testing.assert_allclose(hertz.half_width(p / E, nu=nu) * R, w, rtol=ROUNDING)


@pytest.mark.parametrize("nu", [0.0, 0.5])
def test_transition_loads_are_where_ridge_units_are_whole(nu):
    Q = np.arange(2, 40, 2)
    load = hertz.transition_load(Q, 0.012, 0.03, nu=nu)
    # Algebra: as above, and a division by the pitch.
    np.testing.assert_allclose(hertz.ridge_units(load, 0.012, 0.03, nu=nu), Q, rtol=ROUNDING)
