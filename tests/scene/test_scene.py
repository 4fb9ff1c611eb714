from pathlib import Path

import pytest

from ridgebayes import InputError, Scene
from ridgebayes.scene.scene import Texture, as_scene

SCENES = Path(__file__).parents[2] / "data" / "scenes"

WHOLE = """
[body]
radius = "8 mm"
youngs_modulus = "60 kPa"
poissons_ratio = 0.45
[texture]
ridge_width = "0.25 mm"
groove_width = "250 um"
groove_depth = "0.4 mm"
corner_radius = "5 um"
offset = "uniform"
[load]
max = "1.2 kPa"
friction = 0.3
[accuracy]
relative = 0.01
"""


@pytest.fixture
def read(tmp_path):
    def read_text(text):
        path = tmp_path / "scene.toml"
        path.write_text(text, encoding="utf-8")
        return Scene.from_toml(path)

    return read_text


@pytest.fixture
def refused(read):
    def message(text):
        with pytest.raises(InputError) as raised:
            read(text)
        assert "scene.toml" in str(raised.value)
        return str(raised.value)

    return message


def test_every_key_arrives(read):
    scene = read(WHOLE)
    assert scene == Scene(
        textures=(
            Texture(
                a_over_R=0.03125,
                b_over_R=0.03125,
                groove_depth_over_R=0.05,
                corner_radius_over_R=0.000625,
                offset="uniform",
            ),
        ),
        nu=0.45,
        p_over_E=0.02,
        friction=0.3,
        relative=0.01,
    )


def test_a_force_is_spread_over_the_diameter_and_the_length(read):
    text = WHOLE.replace('max = "1.2 kPa"', 'force = "0.3072 N"\nlength = "16 mm"')
    # F/(2 R length) = 0.3072 N/(16 mm x 16 mm) = 1.2 kPa
    assert read(text).p_over_E == read(WHOLE).p_over_E


def test_several_textures_with_role_and_load(read):
    scene = read(
        """
        [[texture]]
        ridge_width = 0.012
        groove_width = 0.03
        [[texture]]
        ridge_width = 0.012
        groove_width = 0.09
        role = "held-out"
        max_p_over_E = 0.045
        """
    )
    assert [t.role for t in scene.textures] == ["calibration", "held-out"]
    assert [t.max_p_over_E for t in scene.textures] == [None, 0.045]


def test_shipped_scenes_are_what_they_say():
    assert Scene.from_toml(SCENES / "paper.toml") == Scene.paper()
    grip = Scene.from_toml(SCENES / "fingertip_grip.toml")
    assert grip == Scene.of([(0.03125, 0.03125)], relative=0.01)


def test_written_scenes_are_read_back(tmp_path, read):
    third = Scene.of([(0.1 / 3.0, 1e-5)], p_over_E=1e-7, nu=0.0, relative=1e-12)
    for number, scene in enumerate((Scene.paper(), read(WHOLE), third)):
        scene.to_toml(tmp_path / f"{number}.toml")
        assert Scene.from_toml(tmp_path / f"{number}.toml") == scene


def test_all_problems_are_in_one_message(refused):
    text = WHOLE.replace("poissons_ratio = 0.45", "poissons_ratio = 0.6\ncolour = 'red'")
    text = text.replace('"0.25 mm"', '"-0.25 mm"').replace('"250 um"', '"250 kPa"')
    lines = refused(text).split("\n")
    assert len(lines) == 4
    for line, parts in zip(
        sorted(lines),
        [
            ("body.colour = 'red'", "unknown key"),
            ("body.poissons_ratio = 0.6", "less than or equal to 0.5"),
            ("texture.groove_width = '250 kPa'", "a unit of length"),
            ("texture.ridge_width = '-0.25 mm'", "must be > 0"),
        ],
        strict=True,
    ):
        assert "scene.toml" in line
        assert all(part in line for part in parts), line


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"8 mm"', "8.0", "everywhere or nowhere"),
        ('radius = "8 mm"', "", "body.radius: missing"),
        ('youngs_modulus = "60 kPa"', "", "body.youngs_modulus: missing; load.max needs it"),
        ("friction", "p_over_E = 0.1\nfriction", "load.max, load.p_over_E: give one of them"),
        ('max = "1.2 kPa"', 'force = "1 N"', "load.length: missing; a force is spread over it"),
        ('max = "1.2 kPa"', 'force = "1 kPa"', "load.force = '1 kPa': must be a number and a unit"),
        ('offset = "uniform"', "offset = 0.7", "texture.offset = 0.7: must be a fraction"),
        ('offset = "uniform"', "offset = true", "texture.offset = True: must be a fraction"),
        ('offset = "uniform"', 'role = "held_out"', "texture.role = 'held_out'"),
        ('ridge_width = "0.25 mm"', "", "texture.ridge_width: missing; expected a value"),
        ('"0.25 mm"', "true", "texture.ridge_width = True: must be a number, or text"),
        ('"0.25 mm"', "nan", "texture.ridge_width = nan: must be finite"),
        ('"0.25 mm"', "[1]", "texture.ridge_width = [1]: must be a number, or text"),
        ('"0.25 mm"', '"1e999 m"', "texture[1]: a_over_R = inf"),
        ('"0.25 mm"', '"1e-999 m"', "a_over_R = 0.0"),
        ('"5 um"', '"0.2 mm"', "texture[1]: corner_radius_over_R = 0.025: must be from 0 to half"),
        ('"5 um"', '"-5 um"', "texture.corner_radius = '-5 um': must be >= 0"),
        ("relative = 0.01", "relative = 0", "accuracy.relative = 0"),
        ("relative = 0.01", 'relative = "1 %"', "accuracy.relative = '1 %'"),
        ("[accuracy]", "[acuracy]", "{'relative': 0.01}: unknown key; did you mean accuracy?"),
        ("groove_width", "grove_width", "unknown key; did you mean groove_width?"),
        ("groove_width", "width", "unknown key; did you mean ridge_width or groove_width?"),
        ("friction", "nu", "load.nu = 0.3: unknown key; expected one of max, line, force"),
        ("friction", "radius", "load.radius = 0.3: unknown key; it belongs to [body]"),
        (
            '"0.25 mm"',
            '"0,25 mm"',
            "'0,25 mm': has a decimal comma; expected a point, such as '0.2",
        ),
        ('"0.25 mm"', "0,25 mm", 'has a decimal comma; expected ridge_width = "0.25 mm"'),
        ('"0.25 mm"', "0,25", "ridge_width = 0,25: has a decimal comma; expected"),
        ('"0.25 mm"', "0.25 mm  # wide", 'a unit without quotes; expected ridge_width = "0.25 mm"'),
        ('"8 mm"', '"8 kPa"', "body.radius = '8 kPa': must be a number and a unit of length, such"),
        ('max = "1.2 kPa"', 'max = "2 N"', "unit of pressure, such as '60 kPa'"),
        ('max = "1.2 kPa"', 'line = "2"', "unit of line load, such as '20 N/m'"),
        ("[body]", "[body", "not a TOML file"),
    ],
)
def test_each_rule_is_told(refused, old, new, said):
    assert said in refused(WHOLE.replace(old, new, 1))


def test_a_required_key_that_is_misspelt_is_told_once(refused):
    assert refused(WHOLE.replace("groove_width", "grove_width", 1)).count("groove_width") == 1


def test_a_scene_without_a_texture_is_refused(refused):
    assert "texture: missing" in refused("[load]\np_over_E = 0.1\n")
    assert "texture = []" in refused("texture = []\n")
    assert "texture[1] = 3" in refused("texture = [3]\n")


@pytest.mark.parametrize("textures", [(0.02, 0.03), [(0.02,)], ["wide"], None])
def test_scene_of__what_is_no_pair_of_widths_is_refused(textures):
    with pytest.raises(InputError, match=r"textures: .*; expected pairs of widths over R"):
        Scene.of(textures)


def test_two_textures_alike_are_refused(refused):
    one = "[[texture]]\nridge_width = 0.012\ngroove_width = 0.03\n"
    assert "textures 1 and 2 have the same widths" in refused(one + one)


def test_a_byte_order_mark_is_passed_over(tmp_path):
    (tmp_path / "notepad.toml").write_text(WHOLE, encoding="utf-8-sig")
    assert len(Scene.from_toml(tmp_path / "notepad.toml").textures) == 1


def test_files_that_cannot_be_read_are_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.toml: cannot be read"):
        Scene.from_toml(tmp_path / "nowhere.toml")
    (tmp_path / "latin.toml").write_bytes(b"# \xe9\n")
    with pytest.raises(InputError, match=r"latin\.toml: not a TOML file in UTF-8"):
        Scene.from_toml(tmp_path / "latin.toml")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"p_over_E": 0.0}, "p_over_E = 0.0"),
        ({"nu": 0.51}, "nu = 0.51"),
        ({"textures": ()}, r"textures = \(\)"),
        ({"depth": 1.0}, "depth = 1.0"),
    ],
)
def test_records_refuse_with_input_errors(values, said):
    texture = Texture(a_over_R=0.01, b_over_R=0.01)
    with pytest.raises(InputError, match=said):
        Scene(**({"textures": (texture,)} | values))


def test_as_scene__takes_a_scene_or_a_path_and_nothing_else(tmp_path):
    scene = Scene.of([(0.02, 0.03)], p_over_E=0.005)
    scene.to_toml(tmp_path / "s.toml")
    assert as_scene(scene) is scene
    assert as_scene(str(tmp_path / "s.toml")) == as_scene(tmp_path / "s.toml") == scene
    with pytest.raises(InputError, match="scene: expected a Scene or a path, got float"):
        as_scene(0.02)


def test_ogden__is_read_written_and_neo_hookean_if_not_given(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(
        "[body]\nogden = [[0.6, 2], [0.4, 9.5]]\n[texture]\nridge_width = 0.1\ngroove_width = 0.1\n"
    )
    scene = Scene.from_toml(path)
    assert scene.ogden == ((0.6, 2.0), (0.4, 9.5))
    scene.to_toml(path)
    assert Scene.from_toml(path) == scene
    plain = Scene.of([(0.1, 0.1)])
    assert plain.ogden == ((1.0, 2.0),)
    plain.to_toml(path)
    assert "ogden" not in path.read_text()


@pytest.mark.parametrize(
    ("written", "rule"),
    [
        ("0.5", "one to three pairs"),
        ("[]", "one to three pairs"),
        ("[[0.5, 2], [0.5]]", "one to three pairs"),
        ("[[0.5, 2], 0.5]", "one to three pairs"),
        ('[["1", 2]]', "one to three pairs"),
        ("[[true, 2]]", "one to three pairs"),
        ("[[0.25, 2], [0.25, 3], [0.25, 4], [0.25, 5]]", "one to three pairs"),
        ("[[0.5, 2], [0.4, 9]]", "sum to 1"),
        ("[[1.5, 2], [-0.5, 9]]", "shares > 0"),
        ("[[1, 0]]", "exponents from 0.5 to 30"),
        ("[[1, nan]]", "exponents from 0.5 to 30"),
        ("[[1, -31]]", "exponents from 0.5 to 30"),
    ],
)
def test_ogden__is_refused_where_it_is_no_material(tmp_path, written, rule):
    path = tmp_path / "scene.toml"
    path.write_text(
        f"[body]\nogden = {written}\n[texture]\nridge_width = 0.1\ngroove_width = 0.1\n"
    )
    with pytest.raises(InputError, match=rf"body\.ogden = .*{rule}"):
        Scene.from_toml(path)
