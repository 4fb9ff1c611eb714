from fractions import Fraction

import pytest

import ridgebayes as rb
from ridgebayes.scene.units import Body, to_si

UNITS = """
[body]
radius = "12 mm"
youngs_modulus = "60 kPa"
[texture]
ridge_width = "0.25 mm"
groove_width = "0.25 mm"
[load]
force = "5 N"
length = "12 mm"
"""


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
    with pytest.raises(rb.InputError, match="must be a number and a unit of length") as raised:
        to_si(text, "length")
    assert repr(text) in str(raised.value)


def test_body__of_a_scene_knows_its_load_as_written(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(UNITS)
    body = rb.Scene.from_toml(path).body
    assert body.load == "5 N on 12 mm"
    # Algebra: 5 N over 2 R times the length times E.
    assert body.p_over_E("5 N") == 5 / (2 * 0.012 * 0.012 * 60e3)
    assert rb.Scene.from_toml(path).p_over_E == body.p_over_E("5 N")


def test_body__lengths_are_over_the_radius():
    assert Body.of("8 mm", None).over_radius("250 um") == 0.03125


@pytest.mark.parametrize("text", ["5", "mm", "", "5 mm", "5 N/s"])
def test_body__what_is_no_load_is_refused(text):
    with pytest.raises(rb.InputError, match="expected a number and a unit of a load, such as '60"):
        Body.of("8 mm", "60 kPa").p_over_E(text)
