"""Loads and lengths with units, over the modulus and the radius of a body."""

import pytest

import ridgebayes as rb
from ridgebayes.scene.body import Body
from ridgebayes.scene.toml import read_body
from ridgebayes.table.datafiles import data_path

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


def test_body__of_a_scene_knows_its_load_as_written(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(UNITS)
    body = read_body(path)
    assert body.load == "5 N on 12 mm"
    # Algebra: 5 N over 2 R times the length times E.
    assert body.p_over_E("5 N") == 5 / (2 * 0.012 * 0.012 * 60e3)
    assert rb.Scene.from_toml(path).p_over_E == body.p_over_E("5 N")


@pytest.mark.parametrize(("old", "new"), [('force = "5 N"', 'line = "5 N/m"')])
def test_body__of_a_line_load(tmp_path, old, new):
    path = tmp_path / "scene.toml"
    path.write_text(UNITS.replace(old, new).replace('length = "12 mm"', ""))
    body = read_body(path)
    assert body.load == "5 N/m"
    assert body.p_over_E("5 N/m") == rb.Scene.from_toml(path).p_over_E == 5 / (0.024 * 60e3)


def test_body__of_a_scene_without_units_is_empty():
    assert read_body(data_path("scenes/paper.toml")) == Body()


def test_body__lengths_are_over_the_radius():
    assert Body.of("8 mm", None).over_radius("250 um") == 0.03125


@pytest.mark.parametrize("text", ["5", "mm", "", "5 mm", "5 N/s"])
def test_body__what_is_no_load_is_refused(text):
    with pytest.raises(rb.InputError, match="expected a number and a unit of a load, such as '60"):
        Body.of("8 mm", "60 kPa").p_over_E(text)
