from functools import partial

import numpy as np
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes.scene.units import with_error

BODY = {"radius": "8 mm", "youngs_modulus": "60 kPa ± 20 %"}
TEXTURE = {"ridge_width": "0.3 mm", "groove_width": "0.25 mm"}
LOAD = {"force": "0.35 N", "length": "20 mm"}


def scene_of(body=BODY, texture=TEXTURE, load=LOAD):
    return rb.Scene.from_dict({"body": body, "texture": texture, "load": load})


@pytest.fixture(scope="module")
def fit():
    return rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)


def test_predict__of_an_uncertain_modulus_is_the_average_over_moduli(fit):
    scene = scene_of()
    score = stats.norm.ppf((np.arange(2000) + 0.5) / 2000)
    texture = scene.textures[0]
    each = fit.predict(
        texture.a_over_R, texture.b_over_R, scene.p_over_E * np.exp(-0.2 * score)
    ).survival.mean(axis=0)
    found = fit.predict(scene)
    for n in (6, 8, 10):
        expected = each[n // 2 - 1] if n // 2 <= len(each) else 0.0
        # Monte Carlo: five standard errors of 10,240 bodies, and one body.
        se = np.sqrt(expected * (1 - expected) / 10_240)
        assert abs(float(found.at_least(n)) - expected) < 5 * se + 1e-4
    assert abs(float(found.at_least(8)) - 0.15) < 0.02
    assert found.to_dataframe()["load"].tolist() == pytest.approx([0.35], rel=1e-12)  # rounding
    assert found.to_dataframe()["load_unit"].tolist() == ["N"]
    assert fit.predict(scene.at_medians()).at_least(8) < 1e-6
    round_scene = scene_of(texture=TEXTURE | {"corner_radius": "9 um ± 5 %"})
    words = "corner_radius of the scene: no effect on predictions"
    design = partial(rb.design, fit, goal="P(Q >= 4) >= 0.9", sizes={"step": 0.01})
    for answer in (fit.predict, partial(fit.predict_load, Q=8), design):
        with pytest.warns(rb.CautionWarning, match=words) as caught:
            answer(round_scene)
        assert [one.filename for one in caught] == [__file__]


@pytest.mark.slow
@pytest.mark.parametrize("width", ["0.3 mm", pytest.param("0.3 mm ± 3 %", marks=pytest.mark.long)])
def test_predict__radius_and_widths_are_drawn_as_friction_inputs_draw_them(fit, width):
    texture = {"ridge_width": width, "groove_width": "0.25 mm"}
    scene = scene_of({"radius": "8 mm ± 5 %", "youngs_modulus": "60 kPa ± 20 %"}, texture)
    drawn = rb.friction_inputs(fit, scene, 1, n=4000, rng=3)["Q"].to_numpy()
    for n in (6, 8):
        share = float(fit.predict(scene).at_least(n))
        # Monte Carlo: five standard errors of 4,000 draws.
        assert abs((drawn >= n).mean() - share) < 5 * np.sqrt(share * (1 - share) / 4000) + 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["iid", "texture", "iid:student"])
def test_predict__a_certain_scene_is_predicted_as_its_texture(noise):
    fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise=noise, rng=1)
    body = {"radius": "10 mm", "youngs_modulus": "60 kPa"}
    texture = {"ridge_width": "0.22 mm", "groove_width": "0.2 mm"}
    scene = scene_of(body, texture, {"max": "0.36 kPa"})
    plain = fit.predict(0.022, 0.02, [0.003, 0.006, 0.009])
    found = fit.predict(scene, load=["0.18 kPa", "0.36 kPa", "0.54 kPa"])
    # Monte Carlo: other draws of the same posterior.
    assert np.abs(found.at_least(6) - plain.at_least(6)).max() < 0.01
    loads, own = fit.predict_load(0.022, 0.02, [6, 8]), fit.predict_load(scene, Q=[6, 8])
    assert np.allclose(own.median(), 60 * loads.median(), rtol=2e-3)
    assert own.to_dataframe()["load_unit"].tolist() == ["kPa", "kPa"]


def test_predict_load__of_an_uncertain_modulus_scales_with_it(fit):
    found = fit.predict_load(scene_of(), Q=8)
    certain = fit.predict_load(scene_of().at_medians(), Q=8)
    low, high = found.interval(0.9)
    own_low, own_high = certain.interval(0.9)
    # Errors of logarithms add in quadrature; Monte Carlo of 10,240 bodies.
    own_sd = np.log(own_high / own_low) / 2 / stats.norm.ppf(0.95)
    sd = np.log(high / low) / 2 / stats.norm.ppf(0.95)
    assert sd == pytest.approx(np.hypot(own_sd, 0.2), rel=0.03)
    p = float(fit.predict(scene_of()).at_least(8))
    assert float(found.cdf(0.35)) == pytest.approx(p, abs=1e-9)  # rounding of logarithms


def test_predict__of_p_over_E_the_modulus_cancels(fit):
    uncertain = fit.predict(scene_of(), p_over_E=[0.005, 0.01])
    certain = fit.predict(scene_of().at_medians(), p_over_E=[0.005, 0.01])
    assert np.array_equal(uncertain.survival, certain.survival)


def test_predict__of_several_textures_has_them_first(fit):
    textures = [TEXTURE, {"ridge_width": "0.2 mm", "groove_width": "0.2 mm"}]
    scene = scene_of(texture=textures)
    found = fit.predict(scene, load=[0.1, 0.35])
    assert found.shape == (2, 2)
    alone = fit.predict(scene_of(texture=textures[1]), load=[0.1, 0.35])
    n = alone.survival.shape[-1]
    assert np.allclose(found.survival[1, :, :n], alone.survival, atol=0.01)  # Monte Carlo
    with pytest.raises(rb.InputError, match="scene: expected one texture, got 2"):
        fit.predict_load(scene, Q=8)
    assert fit.predict_load(scene.apart[1], Q=8).shape == ()


def test_plots__of_a_scene_have_loads_in_its_unit(fit):
    scene = scene_of(load={"max": "1.2 kPa"})
    bands = fit.predict(scene, load=["0.3 kPa", "0.6 kPa", "1.2 kPa"]).plot()
    assert bands.get_xlabel().startswith("load (kPa)")
    assert bands.get_xlim()[1] == pytest.approx(1.2, rel=1e-12)  # rounding
    one = fit.predict_load(scene, Q=8)
    curve = one.plot()
    assert curve.get_xlabel() == "load (kPa)"
    assert curve.get_xlim()[0] < one.median() < curve.get_xlim()[1]
    several = fit.predict_load(scene, Q=[4, 6, 8]).plot()
    assert several.get_ylabel().startswith("load (kPa)")


def test_predict__off_centre_is_flagged(fit):
    scene = scene_of(texture={**TEXTURE, "offset": 0.25}, load={"max": "0.3 kPa"})
    found = fit.predict(scene)
    assert found.extrapolation_of().tolist() == "offset"
    assert found.to_dataframe()["offset_pitches"].tolist() == [0.25]


def test_predict__of_a_comparison_is_the_mixture(comparison):
    parts = [
        (fit.predict(scene_of()).at_least(8), comparison.probabilities[name])
        for name, fit in comparison.fits.items()
    ]
    expected = sum(share * weight for share, weight in parts)
    assert comparison.predict(scene_of()).at_least(8) == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"load": ["1 kPa", "1 N"]}, "expected one unit, got N, kPa"),
        ({"load": -1.0}, "expected finite loads > 0"),
        ({"load": "1 N", "p_over_E": 0.01}, "expected only one of the two, got both"),
        ({"b_over_R": 0.02}, "b_over_R: expected no value beside a Scene"),
        ({"nu": 0.4}, "nu: expected no value beside a Scene"),
        ({"kind": "other"}, "kind: expected one of"),
    ],
)
def test_predict__refuses_what_a_scene_cannot_answer(fit, arguments, message):
    with pytest.raises(rb.InputError, match=message):
        fit.predict(scene_of(), **arguments)


def test_predict__without_a_scene_needs_widths_and_loads(fit):
    with pytest.raises(rb.InputError, match="or a Scene"):
        fit.predict(0.022, 0.02)
    with pytest.raises(rb.InputError, match="or a Scene and Q"):
        fit.predict_load(0.022, Q=8)
    with pytest.raises(rb.InputError, match="or a Scene and Q"):
        fit.predict_load(0.022, 0.02)


@pytest.mark.parametrize("text", ["60 kPa ± 0 kPa", "60 kPa ± 2 mm", "60 kPa ± kPa", "1 ± 2 ± 3"])
def test_with_error__refuses_what_is_no_error(text):
    with pytest.raises(rb.InputError, match="expected a value and its error"):
        with_error(text)
