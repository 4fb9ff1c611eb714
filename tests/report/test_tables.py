"""What stands behind the report: least squares, smooth cylinder, errors, slopes, ranking."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.checks.held_out import held_out_loads
from ridgebayes.checks.least_squares import fit_by_least_squares, power_law_r_squared
from ridgebayes.checks.load_errors import (
    PAPER_TEXTURES,
    percent_errors,
    shown_textures,
    slopes_table,
)
from ridgebayes.checks.smooth import r_squared, smooth_cylinder
from ridgebayes.comparison.ranking import (
    best_form,
    factors_by_method,
    forms_by_probability,
    problems,
    runner_up,
    sensitivity_factors,
)
from ridgebayes.contact.hertz import load_of_half_width
from ridgebayes.errors import InputError


def test_least_squares_finds_the_reference_coefficients(paper):
    # Reference: least squares on Q, 41 calibration rows, last digit +-1.
    hybrid = fit_by_least_squares(rb.Hybrid(), paper).coefficients
    assert hybrid["c1"] == pytest.approx(1.3486, abs=1e-4)
    assert hybrid["c2"] == pytest.approx(0.01801, abs=1e-5)
    assert fit_by_least_squares(rb.Modified(), paper).coefficients["c"] == pytest.approx(
        1.3844, abs=1e-4
    )


def test_least_squares_is_the_normal_equations(paper):
    # Algebra: Q' = 2 + 2 s (c1/L + c2/A) is linear in c1 and c2.
    frame = paper.calibration.frame
    s, a = np.sqrt(frame["p_over_E"]), frame["a_over_R"]
    columns = np.stack([2 * s / (a + frame["b_over_R"]), 2 * s / a], axis=1)
    q = frame["Q"].to_numpy() - 2.0
    theta, (residual,), *_ = np.linalg.lstsq(columns, q, rcond=None)
    covariance = np.linalg.inv(columns.T @ columns) * residual / (len(q) - 2)
    found = fit_by_least_squares(rb.Hybrid(), paper)
    assert list(found.coefficients.values()) == pytest.approx(theta, rel=1e-7)
    errors = list(found.standard_errors.values())
    assert errors == pytest.approx(np.sqrt(np.diag(covariance)), rel=1e-5)
    assert found.r_squared == pytest.approx(1 - residual / np.sum((q - q.mean()) ** 2), rel=1e-9)
    assert found.n_row == 41


def test_least_squares_needs_as_many_rows_as_coefficients(paper):
    one = rb.ContactTable.from_frame(paper.frame.head(1))
    with pytest.raises(InputError, match="1 rows given"):
        fit_by_least_squares(rb.Hybrid(), one)
    found = fit_by_least_squares(rb.Modified(), one)
    assert found.coefficients["c"] > 0
    assert np.isnan(found.standard_errors["c"])


def test_least_squares_does_not_take_the_power_law(paper):
    with pytest.raises(InputError, match="printed coefficients"):
        fit_by_least_squares(rb.PowerLaw(), paper)


def test_power_law_r_squared_leaves_out_textures_of_one_count(paper):
    frame = paper.frame
    keep = (frame["a_over_R"] == 0.012) & (frame["b_over_R"] == 0.01)
    keep |= (frame["a_over_R"] == 0.032) & (frame["Q"] == 4)
    found = power_law_r_squared(rb.ContactTable.from_frame(frame[keep]))
    assert list(found) == [(0.012, 0.01)]


def test_smooth_half_plane_is_hertz_and_elements_are_stiffer():
    half_plane, small, _ = smooth_cylinder()
    # Algebra: one closed form solved two ways.
    assert half_plane.worst_load_error < 1e-13
    assert half_plane.r_squared == pytest.approx(1, abs=1e-13)
    assert small.p_over_E[-1] == pytest.approx(1.026 * load_of_half_width(0.2), rel=1e-12)
    assert small.count[-1] == pytest.approx(2 + (0.4 - 0.03) / 0.052, rel=1e-12)
    assert small.worst_load_error == pytest.approx(1 - 1 / 1.026, rel=1e-12)


def test_r_squared_of_no_variation_is_not_a_number():
    assert np.isnan(r_squared(np.array([4.0, 4.0]), np.array([4.0, 4.1])))


def test_shown_textures_are_the_papers_where_there_are(comparison, reference):
    assert shown_textures(comparison) == PAPER_TEXTURES
    assert shown_textures(reference) == ((0.032, 0.01), (0.022, 0.02))


def test_shown_textures_of_another_table_are_its_extremes(comparison):
    frame = comparison.table.frame.copy()
    frame[["a_over_R", "b_over_R"]] *= 2
    frame["texture"] = "t" + frame["texture"]
    other = replace(comparison, table=rb.ContactTable.from_frame(frame))
    assert shown_textures(other) == ((0.064, 0.02), (0.024, 0.18))


def test_percent_errors_by_hand(comparison):
    errors = percent_errors(comparison, [(0.032, 0.01)])
    row = errors.query("form == 'modified' and coefficients == 'printed' and Q == 4").iloc[0]
    assert row["percent"] == pytest.approx(100 * ((0.042 / 1.38) ** 2 / row["p_over_E"] - 1))
    assert not len(errors.query("form == 'power-law' and coefficients == 'printed'"))


def test_percent_errors_use_the_reduced_load(reference):
    # Algebra: nu = 0.49 in the rows, so p_form = s^2 0.75/(1 - 0.49^2).
    errors = percent_errors(reference, [(0.022, 0.02)])
    row = errors.query("form == 'modified' and coefficients == 'printed' and Q == 6").iloc[0]
    load = (2 * 0.042 / 1.38) ** 2 * 0.75 / (1 - 0.49**2)
    assert row["percent"] == pytest.approx(100 * (load / row["p_over_E"] - 1))


def test_percent_errors_of_no_texture_is_an_empty_table(comparison):
    assert list(percent_errors(comparison, [])) == list(percent_errors(comparison))


def test_slopes_of_modified_are_two_c_over_pitch(comparison):
    slopes = slopes_table(comparison).query("form == 'modified'")
    c = comparison.fits["modified"].draws[:, 0].mean()
    np.testing.assert_allclose(slopes["K"] * slopes["pitch"], 2 * c, rtol=1e-12)
    assert (slopes["K_lower"] < slopes["K"]).all()
    assert "half-plane" not in set(slopes["form"])


def test_factors_by_method_are_differences_and_agree(comparison):
    factors = factors_by_method(comparison, "hybrid").set_index(["form", "method"])
    assert factors.loc[("modified", "bridge"), "ln_bf"] == pytest.approx(
        comparison.bayes_factors.query("form_a == 'modified' and method == 'bridge'")["ln_bf"].iloc[
            0
        ]
    )
    # Reference: savage-dickey 4.5241 within 0.02, Modified over Hybrid is its negative.
    assert factors.loc[("modified", "savage-dickey"), "ln_bf"] == pytest.approx(-4.5241, abs=0.02)
    against = factors_by_method(comparison, "modified").set_index(["form", "method"])
    assert against.loc[("hybrid", "savage-dickey"), "ln_bf"] == pytest.approx(4.5241, abs=0.02)


def test_sensitivity_at_the_default_scale_is_the_bayes_factor(comparison):
    table = sensitivity_factors(comparison, "hybrid")
    at_one = table[np.isclose(table["factor"], 1) & (table["form"] == "modified")]
    np.testing.assert_allclose(at_one["ln_bf"], -4.5241, atol=1e-3)
    assert set(table["prior"]) == {"c", "c2", "K", "sigma"}


def test_sensitivity_leaves_out_priors_that_no_form_has(odd):
    assert "c2" not in set(sensitivity_factors(odd, odd.best)["prior"])


def test_sensitivity_of_an_unknown_form_or_an_empty_table_is_empty(comparison):
    assert not len(sensitivity_factors(comparison, "half-plane"))
    empty = replace(comparison, prior_sensitivity=pd.DataFrame())
    assert not len(sensitivity_factors(empty, "hybrid"))


def test_ranking_and_runner_up(comparison, single):
    assert forms_by_probability(comparison) == ["hybrid", "modified", "power-law", "classic"]
    assert best_form(comparison) == "hybrid"
    second = runner_up(comparison)
    assert (second.form, round(second.ln_bf, 2)) == ("modified", 4.52)
    assert runner_up(single) is None
    assert problems(comparison) == ()
    assert problems(single)


def test_held_out_loads_say_inside_or_outside(comparison):
    loads = held_out_loads(comparison)
    assert set(loads["Q"]) == {4, 6, 8}
    assert loads.query("form == 'hybrid'")["inside"].all()
    assert not loads.query("form == 'modified'")["inside"].any()
    expected = (loads["p_over_E_lower"] <= loads["p_over_E_observed"]) & (
        loads["p_over_E_observed"] <= loads["p_over_E_upper"]
    )
    assert (loads["inside"] == expected).all()


def test_the_power_law_speaks_only_of_textures_it_has_a_k_for(comparison, reference):
    loads = held_out_loads(comparison)
    assert (loads["prior_alone"] == (loads["form"] == "power-law")).all()
    assert not held_out_loads(reference)["prior_alone"].any()


def test_held_out_loads_without_weights_is_empty(single):
    evidence = single.evidence.assign(used=False)
    assert not len(held_out_loads(replace(single, evidence=evidence)))


def test_held_out_loads_of_nothing_held_out_is_empty(comparison):
    assert not len(held_out_loads(replace(comparison, table=comparison.table.calibration)))
