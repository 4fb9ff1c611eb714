"""Designs: their probabilities against `predict` and drawn counts, and what is recommended."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.predict.q_distribution import mix_q
from ridgebayes.texture_design.bodies import Bodies, Tolerance
from ridgebayes.texture_design.goal_values import GoalValues, ratio_loads
from ridgebayes.texture_design.goals import Load, parse_goals

SCENE = {
    "body": {"radius": "lognormal(8 mm, 3 %)", "youngs_modulus": "lognormal(60 kPa, 15 %)"},
    "texture": {"ridge_width": "0.18 mm", "groove_width": "0.16 mm"},
    "load": {"max": "lognormal(0.6 kPa, 10 %)"},
}
COARSE = {"a": (0.01, 0.045), "b": (0.01, 0.04), "step": 0.005}


@pytest.fixture(scope="module")
def fit(fits):
    return fits["hybrid"]


@pytest.fixture(scope="module")
def uncertain():
    return rb.Scene.from_dict(SCENE)


def values_of(source, scene, tolerance, textures, n=16_384, seed=3):
    made = Tolerance.parse(tolerance, scene.body)
    loads = ratio_loads(source.averaged, Bodies.draw(scene, made, n, seed).ratios(textures))
    return GoalValues(loads, lambda size: Bodies.draw(scene, made, size, seed), n)


TEXTURES = [(0.02, 0.03), (0.022, 0.02), (0.03, 0.012), (0.015, 0.03)]


def test_values__of_certain_bodies_are_those_of_predict(fit):
    loads = [0.003, 0.008]
    values = values_of(fit, rb.Scene.of([(0.02, 0.02)], nu=0.4), None, TEXTURES)
    for a, b in TEXTURES:
        q = fit.predict(a, b, loads, nu=0.4)
        for i, p in enumerate(loads):
            for n in (4, 6, 8, 10, 12):
                at_least, exactly, spread = parse_goals(
                    f"P(Q >= {n}) >= 0.5; P(Q = {n}) >= 0.5; sd(Q) <= 9", [Load(p)]
                )
                # The same draws of coefficients: discretisation, of eleven nodes.
                assert values.at(at_least, a, b).value == pytest.approx(
                    float(q.at_least(n)[i]), abs=2e-3
                )
                assert values.at(exactly, a, b).value == pytest.approx(float(q.pmf(n)[i]), abs=2e-3)
            assert values.at(spread, a, b).value == pytest.approx(float(q.std()[i]), abs=5e-3)


@pytest.mark.long
def test_values__of_a_mixture_are_those_of_predict(paper):
    noises = {"hybrid": "texture+step", "power-law": "iid", "modified": "step-smooth"}
    noises["classic"] = "step:student"
    parts = [rb.calibrate(paper, form, noise=noise, rng=1) for form, noise in noises.items()]
    source = SimpleNamespace(averaged=list(zip(parts, (0.4, 0.3, 0.2, 0.1), strict=True)))
    values = values_of(source, rb.Scene.of([(0.02, 0.02)]), None, TEXTURES)
    goal, load = parse_goals("P(Q >= 8) >= 0.5", [Load(0.0085)])[0], 0.0085
    for a, b in TEXTURES:
        q = mix_q([one.predict(a, b, load) for one in parts], (0.4, 0.3, 0.2, 0.1))
        found = values.at(goal, a, b)
        # Monte Carlo: the power law's K of a new texture is drawn anew.
        assert found.value == pytest.approx(float(q.at_least(8)), abs=4 * found.se + 3e-3)


@pytest.mark.long
def test_values__of_uncertain_bodies_are_averages_of_predict(fit, uncertain):
    rng, n, sd = np.random.default_rng(8), 1_000, 0.05
    z = rng.standard_normal((5, n))
    radius, modulus = np.exp(0.03 * z[0]), np.exp(0.15 * z[1])
    p = 0.01 * np.exp(0.1 * z[2]) / modulus
    goal = parse_goals("P(6 <= Q <= 8) >= 0.5")[0]
    values = values_of(fit, uncertain, "5 %", TEXTURES)
    for a, b in TEXTURES[:2]:
        made = a * (1 + sd * z[3]) / radius, b * (1 + sd * z[4]) / radius
        q = fit.predict(*made, p)
        each = q.at_least(6) - q.at_least(10)
        found = values.at(goal, a, b)
        se = np.hypot(each.std() / np.sqrt(n), found.se)
        assert found.value == pytest.approx(each.mean(), abs=4 * se)


@pytest.mark.parametrize(
    ("load", "same"),
    [
        ({"max": "0.6 kPa"}, "0.6 kPa"),
        ({"line": "9.6 N/m"}, "9.6 N/m"),
        ({"force": "0.1 N", "length": "normal(10 mm, 5 %)"}, "100 mN"),
    ],
)
def test_values__of_a_load_with_a_unit_are_those_of_each_body(fit, load, same):
    scene = rb.Scene.from_dict(SCENE | {"load": load})
    values = values_of(fit, scene, None, TEXTURES)
    goals = [
        parse_goals(f"P(Q >= 8 at {at}) >= 0.5", body=scene.body)[0]
        for at in (same, "100 %", "p/E = 0.01")
    ]
    found = [values.at(goal, 0.022, 0.02).value for goal in goals]
    assert found[0] == pytest.approx(found[1], rel=1e-12)  # algebra: the same load
    # Where modulus and radius vary, so does the p/E of a load.
    assert abs(found[0] - found[2]) > 0.02


def test_values__the_worst_corner_is_the_worst_of_textures(fit):
    scene = rb.Scene.of([(0.02, 0.02)], p_over_E=0.009)
    goal, (a, b) = parse_goals("P(Q >= 8) >= 0.5")[0], (0.022, 0.02)
    found = values_of(fit, scene, "worst 4 %", TEXTURES).at(goal, a, b)
    assert found.corner == (1.0, 1.0)
    assert found.value == pytest.approx(
        float(fit.predict(1.04 * a, 1.04 * b, 0.009).at_least(8)), abs=2e-3
    )


def random_goals(n):
    rng = np.random.default_rng(21)
    for i in range(n):
        least = int(rng.choice([4, 6, 8, 10]))
        kinds = [f"P(Q >= {least})", f"P({least} <= Q <= {least + 2})"]
        kinds += [f"P(Q <= {least})", f"P(Q(30 %) < {least} <= Q(100 %))"]
        text = f"{rng.choice(kinds)} >= {rng.uniform(0.5, 0.97):.3f}"
        tolerance = str(rng.choice(["5 %", "0.0006", "worst 3 %"]))
        objective = str(rng.choice(["margin", "max-pitch", "min-pitch", "min-groove", "max-ridge"]))
        yield pytest.param(
            text, tolerance, objective, i, marks=pytest.mark.long if i > 2 else (), id=text
        )


@pytest.mark.long
@pytest.mark.parametrize(("text", "tolerance", "objective", "seed"), list(random_goals(10)))
def test_design__recommended_probability_is_that_of_drawn_counts(
    fit, uncertain, text, tolerance, objective, seed
):
    found = rb.design(
        fit, uncertain, text, sizes=COARSE, tolerance=tolerance, objective=objective, rng=seed
    )
    row, check = found.best, found.check
    assert check["n"] == 100_000
    se = np.hypot(row["probability_se"], check["se"])
    assert row["probability"] == pytest.approx(check["probability"], abs=3 * se)
    assert row["probability_se"] < 0.005
    if found.feasible:
        assert found.goals[0].margin(check["probability"]) > -3 * check["se"]


@pytest.mark.long
def test_design__objectives_choose_among_the_feasible(fit, uncertain):
    pitches = {}
    for objective in ("max-pitch", "min-pitch", "max-groove"):
        found = rb.design(
            fit, uncertain, "P(Q >= 8) >= 0.9", sizes=COARSE, objective=objective, rng=1
        )
        row = found.recommended
        assert row["feasible"]
        assert not row["extrapolation"]
        pitches[objective] = row["a_over_R"] + row["b_over_R"]
        inside = found.designs[found.designs["feasible"] & ~found.designs["extrapolation"]]
        sure = inside[inside["margin"] >= 2 * inside["probability_se"]]
        if objective == "max-groove":
            assert row["b_over_R"] == sure["b_over_R"].max()
        else:
            best = getattr(sure["a_over_R"] + sure["b_over_R"], objective[:3])()
            assert pitches[objective] == pytest.approx(best)
    assert pitches["min-pitch"] < pitches["max-pitch"]


def test_design__the_smallest_load_is_the_first_that_will_do(fit):
    scene = rb.Scene.of([(0.02, 0.02)], p_over_E=0.01)
    options = {"sizes": {"a": (0.02, 0.03), "b": (0.02, 0.03), "step": 0.005}, "rng": 1}
    found = rb.design(fit, scene, "P(Q >= 6) >= 0.9", objective="min-load", **options)
    share = float(found.best["load"].removesuffix(" %")) / 100
    form = "averaged over hybrid and one error model."
    assert found.conditions == f"At p/E {0.01 * share:.3g}, with widths made exactly, {form}"
    assert 0.05 < share < 1
    for less, feasible in ((share, True), (share - 0.05, False)):
        at = rb.design(fit, scene, "P(Q >= 6) >= 0.9", loads=[0.01 * less], **options)
        assert at.feasible is feasible


def test_design__an_unmet_goal_says_what_load_or_pitch_would_do(fit):
    scene = rb.Scene.of([(0.02, 0.02)], p_over_E=0.01)
    found = rb.design(fit, scene, "P(Q >= 20) >= 0.9004", sizes=COARSE, rng=1)
    assert found.recommended is None
    # No texture comes near: the nearest is the finest, not the farthest.
    best = found.best
    assert (best["a_over_R"], best["b_over_R"]) == (0.01, 0.01)
    a, b, limits = best["a_over_R"], best["b_over_R"], found.limits
    assert f"largest probability found is {best['probability']:.4g}, and 0.9004 w" in limits["why"]
    wide, load = limits["width_factor"], limits["load_factor"]
    assert 1 < load < 10
    assert wide == pytest.approx(load**-0.5, rel=1e-3)  # loads go with the pitch's square
    for at in ((a, b, 0.01 * load), (wide * a, wide * b, 0.01)):
        # The same draws of coefficients: discretisation, of eleven nodes.
        assert float(fit.predict(*at).at_least(20)) == pytest.approx(0.9, abs=3e-3)
    assert json.loads(found.to_json())["limits"] == limits
    assert "nearest" in repr(found)


def test_design__a_goal_that_nothing_would_meet_says_so(fit):
    scene = rb.Scene.of([(0.02, 0.02)], p_over_E=0.01)
    found = rb.design(fit, scene, "P(Q = 40) >= 0.999", sizes=COARSE | {"a": (0.02, 0.02)}, rng=1)
    assert (found.limits["load_factor"], found.limits["width_factor"]) == (None, None)
    assert "no load to p/E 0.33 and no other pitch would do" in found.limits["why"]


@pytest.mark.slow
def test_design__extrapolation_is_marked_and_not_chosen_while_one_inside_will_do(fit, uncertain):
    sizes = {"a": (0.002, 0.022), "b": (0.002, 0.022), "step": 0.005}
    found = rb.design(fit, uncertain, "P(Q >= 6) >= 0.9", sizes=sizes, objective="min-pitch", rng=1)
    beyond = found.designs[found.designs["extrapolation"]]
    assert beyond["feasible"].any()
    assert set(beyond["extrapolation_of"]) >= {"a/R,b/R"}
    assert not found.best["extrapolation"]
    only = rb.design(fit, uncertain, "P(Q >= 6) >= 0.9", sizes=sizes | {"a": (0.002, 0.006)}, rng=1)
    assert only.best["extrapolation"]


@pytest.mark.slow
def test_design__the_same_seed_gives_the_same_design(fit, uncertain):
    texts = [
        rb.design(fit, uncertain, "P(Q >= 8) >= 0.9", sizes=COARSE, rng=4).to_json()
        for _ in range(2)
    ]
    assert texts[0] == texts[1]


def test_design__is_a_record_like_the_others(fit, uncertain):
    found = rb.design(
        fit, uncertain, ["P(Q >= 6) >= 0.9", "sd(Q) <= 1.5"], sizes=COARSE, tolerance="5 %", rng=1
    )
    assert "recommended" in repr(found)
    assert "<table" in found._repr_html_()
    frame = found.to_dataframe()
    assert list(frame) == [
        *("a_over_R", "b_over_R", "probability", "probability_se", "feasible"),
        *("extrapolation", "extrapolation_of", "margin", "goal"),
    ]
    assert set(frame["goal"]) == {1, 2}
    assert found.plot().get_xlabel() == "ridge width $a/R$"
    told = json.loads(found.to_json())
    assert told["goals"] == ["P(Q >= 6) >= 0.9", "sd(Q) <= 1.5"]
    assert set(told["check"]) == {"goal", "n", "probability", "se"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"sizes": {"a": (0.03, 0.02)}}, "a: expected bounds 0 < LO <= HI over R, got 0.03:0.02"),
        ({"sizes": {"b": (-0.1, 0.02)}}, "b: expected bounds"),
        ({"sizes": {"c": 1}}, "sizes: expected a, b and step, got 'c'"),
        ({"sizes": {"step": -1.0}}, "step: expected above 0, got -1.0"),
        ({"sizes": {"a": (0.011, 0.012), "step": 0.01}}, "a: no multiple of the step 0.01"),
        ({"sizes": {"step": 1e-5}}, "step: expected at most 40,000 textures"),
        ({"tolerance": "4 mm"}, "tolerance: expected at most 20% of the smallest width"),
        ({"tolerance": "much"}, "tolerance 'much': expected a tolerance such as '5 %'"),
        ({"tolerance": "30 %"}, "tolerance '30 %': expected 0 to 20%"),
        ({"tolerance": "0.01"}, "tolerance: expected at most 20% of the smallest width"),
        ({"loads": "0.02:0.01:3"}, "loads: '0.02:0.01:3': expected one load, LO:HI:N"),
        ({"loads": []}, "loads: expected at least one"),
        ({"loads": [0.6]}, "p/E = 0.6; expected p/E of at most 0.5"),
        ({"objective": "best"}, "objective: expected one of margin, max-pitch"),
    ],
)
def test_design__bad_options_are_refused(fit, uncertain, options, expected):
    with pytest.raises(rb.InputError) as refused:
        rb.design(fit, uncertain, "P(Q >= 8) >= 0.9", **options)
    assert expected in str(refused.value)


@pytest.mark.slow
def test_design__widths_are_uncertain_by_the_scene_or_by_a_tolerance(fit):
    texture = {"ridge_width": "normal(0.2 mm, 5 %)", "groove_width": "0.16 mm"}
    scene = rb.Scene.from_dict(SCENE | {"texture": texture})
    with pytest.raises(rb.InputError, match="expected only one of the two, got both"):
        rb.design(fit, scene, "P(Q >= 8) >= 0.9", sizes=COARSE, tolerance="5 %")
    found = rb.design(fit, scene, "P(Q >= 8) >= 0.9", sizes=COARSE)
    assert "tolerance" in set(found.shares["source"])
    assert "with widths that vary as in the scene, averaged over" in found.conditions
