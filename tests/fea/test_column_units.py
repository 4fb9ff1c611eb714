"""Units of headers, and exact quotients."""

from fractions import Fraction

import numpy as np
import pytest

from ridgebayes.errors import InputError
from ridgebayes.fea.words import (
    column_unit,
    divided,
)


@pytest.mark.parametrize(
    ("key", "header", "explicit", "factor"),
    [
        ("a", "w [mm]", None, Fraction(1, 1000)),
        ("a", "w", "inch", Fraction(127, 5000)),
        ("E", "E, MPa", None, Fraction(10**6)),
        ("E", "E [N/mm²]", None, Fraction(10**6)),
        ("line", "P (kN/m)", None, Fraction(1000)),
        ("a", "w [-]", None, Fraction(1)),
        ("a", "w [mm]", "mm", Fraction(1, 1000)),
        ("nu", "nu [-]", None, Fraction(1)),
        ("nu", "nu (of Poisson)", None, Fraction(1)),
        ("rel_se", "error [%]", None, Fraction(1, 100)),
    ],
)
def test_column_unit__converts_exactly(key, header, explicit, factor):
    assert column_unit(key, header, explicit, "mine.csv")[1] == factor


@pytest.mark.parametrize(
    ("key", "header", "explicit"),
    [
        ("a", "w [kPa]", None),
        ("a", "w [Mm^9]", None),
        ("a", "w [mm; of R]", None),
        ("a", "w (total)", None),
        ("E", "E [mpa]", None),
        ("a", "w [mm]", "um"),
        ("a", "w mm", None),
        ("nu", "nu [mm]", None),
        ("nu", "nu", "kPa"),
    ],
)
def test_column_unit__what_is_no_such_unit_is_refused(key, header, explicit):
    with pytest.raises(InputError, match=r"^mine\.csv, header .*expected "):
        column_unit(key, header, explicit, "mine.csv")


def test_divided__gives_the_numbers_a_person_would_write():
    rng = np.random.default_rng(3)
    wide = rng.integers(1, 10_000, 300)
    # Equality with the one correctly rounded quotient of whole numbers.
    assert divided(wide / 1000 * 1e-3, np.array(8.0 * 1e-3)).tolist() == (wide / 8000).tolist()


def test_divided__keeps_empty_cells_and_overflows_to_infinity():
    found = divided(np.array([1.0, np.nan, 1e308, -1e308]), np.array(1e-10))
    np.testing.assert_array_equal(found, [1e10, np.nan, np.inf, -np.inf])
