"""Values of a scene that are distributions: in files and in programs, drawn jointly."""

import pickle

import numpy as np
import pytest
from scipy import stats

from ridgebayes import InputError, Scene, generate
from ridgebayes.scene.draws import draw_scene

FILE = """
[body]
radius = "8 mm"
youngs_modulus = "lognormal(60 kPa, 20 %)"
poissons_ratio = "uniform(0.45, 0.5)"
[texture]
ridge_width = "normal(0.25 mm, 5 %)"
groove_width = "truncated(normal(0.2 mm, 0.02 mm), 0, inf)"
[load]
max = "0.6 kPa"
[[joint]]
of = ["texture.ridge_width", "texture.groove_width"]
correlation = [[1.0, -0.9], [-0.9, 1.0]]
"""


@pytest.fixture
def read(tmp_path):
    def scene(*changes):
        text = FILE
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "scene.toml"
        path.write_text(text)
        return Scene.from_toml(path)

    return scene


def test_from_toml__has_the_medians(read):
    scene = read()
    assert scene.textures[0].a_over_R == 0.03125
    assert scene.textures[0].b_over_R == pytest.approx(0.025, rel=1e-12)
    assert scene.nu == 0.475
    assert scene.p_over_E == 0.01
    assert scene.uncertain_names == (
        "body.youngs_modulus",
        "body.poissons_ratio",
        "texture.ridge_width",
        "texture.groove_width",
    )
    plain = scene.at_medians()
    assert plain.uncertain_names == ()
    assert plain.p_over_E == 0.01


def test_draw_scene__are_the_distributions_of_the_file(read):
    n = 20_000
    drawn = draw_scene(read(), n, 3)
    log_E = np.log(drawn.physical["youngs_modulus"])
    # Monte Carlo: five standard errors.
    assert np.median(log_E) == pytest.approx(np.log(60e3), abs=5 * 1.25 * 0.2 / n**0.5)
    assert log_E.std() == pytest.approx(0.2, rel=5 / (2 * n) ** 0.5)
    a, b = drawn.profile["a"], drawn.profile["b"]
    assert a.std() == pytest.approx(0.05 * 0.03125, rel=5 / (2 * n) ** 0.5)
    assert np.corrcoef(a, b)[0, 1] == pytest.approx(-0.9, abs=5 * 0.19 / n**0.5)
    assert abs(np.corrcoef(a, log_E)[0, 1]) < 5 / n**0.5  # independent
    np.testing.assert_allclose(drawn.p_over_E, 600 / drawn.physical["youngs_modulus"])
    assert drawn.nu.min() >= 0.45
    assert (drawn.physical["radius"] == 0.008).all()
    again, other = draw_scene(read(), n, 3), draw_scene(read(), n, 4)
    assert (again.profile["a"] == a).all()
    assert not (other.profile["a"] == a).any()


@pytest.mark.parametrize("groove", ["array", "scipy", "rows", "normal"])
def test_scenes_are_equal_by_their_distributions(groove):
    def scene(sd):
        sample = np.random.default_rng(1).normal([0.02, 0.01], sd, (30, 2))
        width = {
            "array": sample[:, 0],
            "scipy": stats.norm(0.01, sd),
            "normal": "normal(0.01, 5 %)",
        }
        texture = {"ridge_width": f"normal(0.02, {sd})", "groove_width": width.get(groove, 0.01)}
        of = ["texture.ridge_width", "texture.groove_width"]
        joint = {"of": of, "correlation": [[1.0, 900 * sd], [900 * sd, 1.0]]}
        if groove == "rows":
            texture, joint = dict.fromkeys(texture, 0.01), {"of": of, "draws": sample}
        return Scene.from_dict({"texture": texture, "joint": [joint]})

    one = scene(0.001)
    for same in (pickle.loads(pickle.dumps(one)), scene(0.001)):
        assert (same == one, hash(same)) == (True, hash(one))
    assert one != scene(0.0011)
    assert one != one.at_medians()


def test_from_dict__takes_what_a_program_has():
    draws = np.array([0.02, 0.021, 0.022, 0.023, 0.024])
    body = {"youngs_modulus": "50 kPa", "radius": stats.norm(8e-3, 1e-4)}
    texture = {
        "ridge_width": 8e-3 * draws,
        "groove_width": lambda rng: 1e-4 * (1 + rng.random()),
        "offset": stats.uniform(-0.25, 0.5),
    }
    scene = Scene.from_dict({"body": body, "texture": texture, "load": {"line": "8 N/m"}})
    assert scene.textures[0].a_over_R == pytest.approx(0.022)
    assert scene.textures[0].offset == pytest.approx(0.0)
    drawn = draw_scene(scene, 2_000, 1)
    R = drawn.physical["radius"]
    width = drawn.profile["a"] * R / 8e-3
    assert np.unique(width.round(9)).tolist() == draws.tolist()
    assert abs(drawn.profile["offset"]).max() <= 0.25
    assert 1e-4 <= (drawn.profile["b"] * R).min() < (drawn.profile["b"] * R).max() <= 2e-4
    np.testing.assert_allclose(drawn.p_over_E, 8 / (2 * R * 50e3))
    # The body has the median of a program's radius, beside values with units.
    assert scene.body.p_over_E("8 N/m") == pytest.approx(scene.p_over_E, rel=1e-12)  # rounding


def test_from_dict__takes_joint_draws():
    rng = np.random.default_rng(1)
    rows = rng.uniform(1, 2, (50, 2)) * [0.02, 0.01]
    texture = {"ridge_width": 0.03, "groove_width": 0.015}
    of = ["texture.ridge_width", "texture.groove_width"]
    scene = Scene.from_dict({"texture": texture, "joint": [{"of": of, "draws": rows}]})
    assert scene.uncertain_names == tuple(of)
    drawn = draw_scene(scene, 300, 1).profile
    both = {(a, b) for a, b in zip(drawn["a"].tolist(), drawn["b"].tolist(), strict=True)}
    assert both <= {(a, b) for a, b in rows.tolist()}
    assert len(both) > 40
    normal = stats.multivariate_normal([0.03, 0.015], [[1e-6, 5e-7], [5e-7, 1e-6]])
    scene = Scene.from_dict({"texture": texture, "joint": [{"of": of, "draws": normal}]})
    drawn = draw_scene(scene, 20_000, 1).profile
    assert np.corrcoef(drawn["a"], drawn["b"])[0, 1] == pytest.approx(0.5, abs=0.03)
    for section, words in (
        ({"of": of, "draws": rows[:, :1]}, "joint.draws: expected finite rows of 2"),
        ({"of": of}, "expected either correlation or draws"),
        ({"of": of, "draws": [[1.0, 2.0], [1.0]]}, "joint.draws: expected finite rows of 2"),
        ({"of": [of[0], of[0]], "draws": rows}, "joint.of: expected names without repeats"),
    ):
        with pytest.raises(InputError, match=words):
            Scene.from_dict({"texture": texture, "joint": [section]})


def test_from_dict__refuses_a_callable_of_no_number():
    for given in ("x", np.ones(3)):
        texture = {"ridge_width": lambda rng, given=given: given, "groove_width": 0.015}
        with pytest.raises(InputError, match="expected a callable that returns a number, got"):
            Scene.from_dict({"texture": texture})


def test_draw_scene__a_uniform_offset_is_anywhere():
    scene = Scene.from_dict(
        {"texture": {"ridge_width": 0.02, "groove_width": 0.02, "offset": "uniform"}}
    )
    offset = draw_scene(scene, 1_000, 1).profile["offset"]
    assert stats.kstest(offset, stats.uniform(-0.5, 1).cdf).pvalue > 1e-4


def test_generate__takes_medians_and_says_so(read):
    table, plain = generate(read()), generate(read().at_medians())
    assert table.frame["p_over_E"].equals(plain.frame["p_over_E"])
    assert table.frame["source"].str.contains("medians=body.youngs_modulus").all()
    assert not plain.frame["source"].str.contains("medians").any()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "5 %",
            "40 %",
            "ridge_width = .normal.*must be > 0, got a distribution that reaches -0.00035",
        ),
        ("60 kPa", "60 mm", "youngs_modulus.*'60 mm': must be a number and a unit of pressure"),
        ("60 kPa", "60", "with a unit, but body.youngs_modulus.*without"),
        ("(60 kPa, 20 %)", "(60 kPa)", r"expected lognormal\(median, log_sd\)"),
        ("-0.9", "-1.9", "joint.correlation: expected a symmetric matrix"),
        ("-0.9], [", "0.9], [", "joint.correlation: expected a symmetric matrix"),
        ("-0.9], [", "], [", "joint.correlation: expected a symmetric matrix"),
        ('of = ["texture.ridge', 'of = ["texture.bridge', "joint.of: .*'texture.bridge_width'"),
        ("0.45, 0.5", "0.4, 0.6", "ratio = 'uniform.*: input .* equal to 0.5, got .* reaches 0.6;"),
        ("uniform(0.45, 0.5)", "0.48 ± 5 %", "ratio = '0.48 ± 5 %': .* got .* reaches 0.648"),
        ("[load]", 'offset = "normal(0.4, 0.1)"\n[load]', "must be .* from -0.5 to 0.5, .* got"),
        ("[load]", 'corner_radius = "normal(9 um, 9 um)"\n[load]', "corner_radius = .* >= 0, got"),
        (
            "normal(0.25 mm, 5 %)",
            "empirical(w.csv, w)",
            "ridge_width = '[^']*': .*w.csv, row 7, w: expected a",
        ),
        ("normal(0.25 mm", "normel(0.25 mm", "expected one of normal"),
    ],
)
def test_from_toml__bad_distributions_are_one_error(read, tmp_path, old, new, words):
    (tmp_path / "w.csv").write_text("w\n" + "0.2 mm\n" * 5 + "wide\n" * 6)
    with pytest.raises(InputError, match=words) as refused:
        read((old, new))
    assert "\n" not in str(refused.value)
    assert "scene.toml" in str(refused.value)


def test_draw_scene__draws_beyond_bounds_are_refused():
    body = {"poissons_ratio": lambda rng: rng.normal(0.48, 0.05)}
    scene = Scene.from_dict({"body": body, "texture": {"ridge_width": 0.02, "groove_width": 0.02}})
    with pytest.raises(
        InputError, match=r"nu .*of 1000 draws break a rule: expected from 0 to 0.5"
    ):
        draw_scene(scene, 1_000, 1)
    for array, got in (
        (np.array(["x"]), "str32 of shape .1,"),
        (np.ones((2, 2)), "float64 of .*2, 2"),
    ):
        with pytest.raises(
            InputError, match=f"expected a row of finite draws, got {got}"
        ) as refused:
            Scene.from_dict({"texture": {"ridge_width": array, "groove_width": 0.02}})
        assert "\n" not in str(refused.value)


def test_to_toml__refuses_what_it_would_lose(read, tmp_path):
    with pytest.raises(InputError, match="distributions cannot be written"):
        read().to_toml(tmp_path / "x.toml")
    read().at_medians().to_toml(tmp_path / "x.toml")
