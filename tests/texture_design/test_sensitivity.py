"""Shares and measurements against closed forms."""

import numpy as np
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes.texture_design.bodies import Bodies, Tolerance
from ridgebayes.texture_design.goal_values import Value, ratio_loads
from ridgebayes.texture_design.goals import parse_goals
from ridgebayes.texture_design.next_simulation import next_simulation
from ridgebayes.texture_design.sensitivity import (
    SIMULATION,
    Sources,
    drawn_check,
    sobol_shares,
    what_to_measure,
)

TEXTURE = (0.022, 0.02)
SD_MODULUS, SD_LOAD = 0.2, 0.1


@pytest.fixture(scope="module")
def fit(fits):
    return fits["modified"]


@pytest.fixture(scope="module")
def log_load(fit):
    """Mean and sd of ln(p/E) of the eighth edge: coefficient and error."""
    a, b = TEXTURE
    log_loads = np.log(fit.form.load(8, a, b, fit.draws[:, :1]))
    return log_loads.mean(), np.sqrt(log_loads.var() + (fit.draws[:, 1] ** 2).mean())


def sources_at(fit, log_median, goal="P(Q >= 8) >= 0.9", tolerance=None):
    """A body whose modulus and load are log-normal: ln(p/E) is normal."""
    pressure = float(60e3 * np.exp(log_median))
    scene = rb.Scene.from_dict(
        {
            "body": {"radius": "8 mm", "youngs_modulus": f"lognormal(60 kPa, {SD_MODULUS})"},
            "texture": {"ridge_width": "0.18 mm", "groove_width": "0.16 mm"},
            "load": {"max": f"lognormal({pressure!r} Pa, {SD_LOAD})"},
        }
    )
    made = Tolerance.parse(tolerance)
    bodies = Bodies.draw(scene, made, 1_000, 1)
    loads = ratio_loads(fit.averaged, bodies.ratios([TEXTURE]))
    (asked,) = parse_goals(goal)
    return Sources(scene, made, loads, TEXTURE, Value(0.0, 0.0, asked.cases[0], (0.0, 0.0)))


def first_order(share, t):
    """The first-order index of a normal of this share of the variance, for an indicator z > t."""
    p = stats.norm.sf(t)
    both = stats.multivariate_normal(cov=[[1, share], [share, 1]]).cdf([-t, -t])
    return (both - p**2) / (p - p**2)


def test_sobol_shares__of_a_failure_by_normal_logs(fit, log_load):
    mean, sd = log_load
    total = np.hypot(np.hypot(SD_MODULUS, SD_LOAD), sd)
    sources = sources_at(fit, mean + 0.5 * total)
    found = sobol_shares(sources, 5).set_index(["of", "source"])
    assert list(found.loc["failure"].index) == ["body", "load", "coefficients", "error model"]
    for name, own in (("body", SD_MODULUS), ("load", SD_LOAD)):
        row = found.loc["failure", name]
        share = (own / total) ** 2
        assert row["first_order"] == pytest.approx(
            first_order(share, 0.5), abs=3 * row["first_order_se"]
        )
        # What all others leave open.
        assert row["total_order"] == pytest.approx(
            1 - first_order(1 - share, 0.5), abs=3 * row["total_order_se"]
        )


def test_what_to_measure__resolves_what_the_closed_form_says(fit, log_load):
    mean, sd = log_load
    total = np.hypot(np.hypot(SD_MODULUS, SD_LOAD), sd)
    found = what_to_measure(sources_at(fit, mean + 0.5 * total), 7)
    found = found.set_index(["measure", "spread_left"])
    assert found.index[0] == ("body.youngs_modulus", 0.0)
    known = {(name, left) for name in ("body.youngs_modulus", "load.max") for left in (0.0, 0.5)}
    assert set(found.index) == known | {(SIMULATION, 0.0)}
    for name, own in (("body.youngs_modulus", SD_MODULUS), ("load.max", SD_LOAD)):
        for left in (0.0, 0.5):
            # Monte Carlo: of 128 values, their variance has a relative error of 0.12.
            expected = first_order((1 - left**2) * (own / total) ** 2, 0.5)
            assert found.loc[(name, left), "resolved"] == pytest.approx(expected, rel=0.4)
    assert (found["probability_low"] <= found["probability_high"]).all()


def test_sources__that_a_scene_correlates_are_one_group(fit):
    scene = {
        "body": {"radius": "8 mm", "youngs_modulus": "lognormal(60 kPa, 20 %)"},
        "texture": {"ridge_width": "0.18 mm", "groove_width": "0.16 mm"},
        "load": {"max": "lognormal(0.6 kPa, 10 %)"},
        "joint": [{"of": ["body.youngs_modulus", "load.max"], "correlation": [[1, 0.5], [0.5, 1]]}],
    }
    sizes = {"a": (0.02, 0.03), "b": (0.02, 0.03), "step": 0.005}
    found = rb.design(fit, rb.Scene.from_dict(scene), "P(Q >= 6) >= 0.5", sizes=sizes)
    assert set(found.shares["source"]) == {"body and load", "coefficients", "error model"}
    assert "body.youngs_modulus, load.max" in set(found.measure["measure"])


def test_next_simulation__of_two_forms_that_differ_is_where_they_differ(fits, fit):
    hybrid = fits["hybrid"]
    textures = [(0.012, 0.03), (0.022, 0.02), (0.04, 0.01)]
    forms = [hybrid.averaged, fit.averaged]
    found = next_simulation(forms, textures, 1)
    assert list(found["form_a"]) == 3 * ["hybrid"]
    assert (found["information"].diff().dropna() <= 0).all()
    assert (found["information"] <= np.log(2) + 0.05).all()
    assert found["p_over_E"].max() <= 0.0201
    # The same form twice cannot be told apart.
    same = next_simulation([fit.averaged, fit.averaged], textures, 1)
    assert same["information"].max() == pytest.approx(0, abs=1e-12)
    assert next_simulation([fit.averaged], textures, 1).empty


# By hand: Q is 2, 4 or 6 with probabilities 0.2, 0.5 and 0.3, its mean 4.2 and its variance 1.96.
@pytest.mark.parametrize(("text", "value"), [("sd(Q) <= 1", 1.4), ("P(Q >= 6) >= 0.4", 0.3)])
def test_drawn_check__scatters_as_its_standard_error_says(text, value):
    class Drawn:
        def draw(self, n, seed):
            return np.random.default_rng(seed).choice([2, 4, 6], n, p=[0.2, 0.5, 0.3])

        def outcome(self, Q):
            return Q, Q < 6

    (goal,) = parse_goals(text)
    checks = [drawn_check(Drawn(), goal, seed) for seed in range(100)]
    found, se = ([check[name] for check in checks] for name in ("probability", "se"))
    assert np.mean(found) == pytest.approx(value, abs=4 * np.mean(se) / 10)  # Monte Carlo
    # The scatter of 100 values has a relative standard error of 7 %.
    assert np.std(found, ddof=1) == pytest.approx(np.mean(se), rel=4 / np.sqrt(200))
