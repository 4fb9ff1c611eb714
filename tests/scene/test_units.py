from fractions import Fraction

import pytest

from ridgebayes.errors import InputError
from ridgebayes.scene.units import to_si


@pytest.mark.parametrize(
    ("text", "dimension", "si"),
    [
        ("0.25 mm", "length", Fraction(1, 4000)),
        ("5um", "length", Fraction(1, 200_000)),
        ("5 µm", "length", Fraction(1, 200_000)),
        (" -1.5e-3 m ", "length", Fraction(-3, 2000)),
        ("1 inch", "length", Fraction(127, 5000)),
        ("60 kPa", "pressure", Fraction(60_000)),
        ("0.06 N/mm^2", "pressure", Fraction(60_000)),
        ("20 N/m", "line load", Fraction(20)),
        ("3 kg / s**2", "line load", Fraction(3)),
    ],
)
def test_quantities_convert_exactly(text, dimension, si):
    assert to_si(text, dimension) == si


def test_ratios_are_the_numbers_a_person_would_write():
    assert float(to_si("0.1 mm", "length") / to_si("3 mm", "length")) == 0.1 / 3.0
    assert float(to_si("0.096 mm", "length") / to_si("8 mm", "length")) == 0.012


@pytest.mark.parametrize(
    "text",
    [
        "3",
        "mm",
        "",
        "2 * 3 mm",
        "3 foo",
        "3 kPa",
        "3 m**999999",
        "nan mm",
        "1_0 mm",
        "3 m)",
        "3 'x'",
        "3 m/0",
        "1 degC",
        "3 mm mm",
        "(3, 4) mm",
    ],
)
def test_what_is_no_length_is_named_with_the_rule(text):
    with pytest.raises(InputError, match="must be a number and a unit of length") as raised:
        to_si(text, "length")
    assert repr(text) in str(raised.value)
