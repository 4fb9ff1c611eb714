"""Forms beside the table: percent errors, slopes, held-out loads and their bands."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.checks.load_errors import (
    held_out_loads,
    percent_errors,
    shown_textures,
    slopes_table,
)

PAPER_TEXTURES = (0.032, 0.01), (0.012, 0.09), (0.032, 0.03)


def test_shown_textures_are_few_and_far_apart(comparison, reference):
    assert shown_textures(comparison) == PAPER_TEXTURES
    assert shown_textures(reference) == ((0.032, 0.01), (0.022, 0.02))


def test_shown_textures_of_another_table_are_its_extremes(comparison):
    frame = comparison.table.frame.copy()
    frame[["a_over_R", "b_over_R"]] *= 2
    frame["texture"] = "t" + frame["texture"]
    other = replace(comparison, table=rb.ContactTable.from_frame(frame))
    assert shown_textures(other)[:2] == ((0.064, 0.02), (0.024, 0.18))
    assert len(shown_textures(other)) == 3


def test_percent_errors_use_the_reduced_load(reference):
    # Algebra: nu = 0.49 in the rows, so p_form = s^2 0.75/(1 - 0.49^2).
    errors = percent_errors(reference, [(0.022, 0.02)])
    row = errors.query("form == 'modified' and coefficients == 'published' and Q == 6").iloc[0]
    load = (2 * 0.042 / 1.38) ** 2 * 0.75 / (1 - 0.49**2)
    assert row["percent"] == pytest.approx(100 * (load / row["p_over_E"] - 1))


def test_errors_of_brackets_are_those_of_their_nearest_loads(comparison):
    # Algebra: the prediction itself inside a bracket, else its nearer end.
    fit, frame = comparison.fits["modified"], comparison.table.frame
    a, b, q = frame["a_over_R"], frame["b_over_R"], frame["Q"]
    c = float(f"{fit.summary['mean'][0]:.12g}")
    load = ((q / 2 - 1) * (a + b) / c) ** 2
    ends = np.array([[0.9, 1.1], [1.05, 1.1], [0.8, 0.9]])[np.arange(len(frame)) % 3]
    lower, upper = (load.to_numpy() * ends.T).tolist()
    brackets = frame.assign(p_over_E_lower=lower, p_over_E=upper)
    found = replace(comparison, table=rb.ContactTable.from_frame(brackets))
    errors = percent_errors(found, comparison.table.textures)
    errors = errors[(errors["form"] == "modified") & (errors["coefficients"] == "calibrated")]
    expected = 100 * (np.array([1, 1 / 1.05, 1 / 0.9]) - 1)
    assert len(errors) == len(frame)
    place = frame.reset_index().merge(errors[["a_over_R", "b_over_R", "Q", "percent"]])
    np.testing.assert_allclose(place["percent"], expected[place.index % 3], atol=1e-9)
    held_out = held_out_loads(found)
    assert held_out["p_over_E_observed"].tolist() != held_out["p_over_E_nearest"].tolist()
    mine = held_out[held_out["form"] == "modified"]
    overlap = mine["p_over_E_lower"].le(mine["p_over_E_observed"]) & mine["p_over_E_upper"].ge(
        mine["p_over_E_observed_lower"]
    )
    assert mine["inside"].tolist() == overlap.tolist()
    assert mine["inside"].any()


def test_slopes_of_modified_are_two_c_over_pitch(comparison):
    slopes = slopes_table(comparison).query("form == 'modified'")
    c = comparison.fits["modified"].draws[:, 0].mean()
    np.testing.assert_allclose(slopes["K"] * slopes["pitch"], 2 * c, rtol=1e-12)
    assert (slopes["K_lower"] < slopes["K"]).all()
    assert "half-plane" not in set(slopes["form"])


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


def test_held_out_loads_of_nothing_held_out_is_empty(comparison):
    assert not len(held_out_loads(replace(comparison, table=comparison.table.calibration)))


def test_rows_of_a_body_off_centre_are_in_no_table_of_errors(comparison):
    frame = comparison.table.frame
    a, b = PAPER_TEXTURES[0]
    own = frame[(frame["a_over_R"] == a) & (frame["b_over_R"] == b)].iloc[:3]
    away = own.assign(Q=[4, 5, 6], offset_over_R=0.005, role="held-out")  # odd counts too
    table = rb.ContactTable.from_frame(pd.concat([frame, away], ignore_index=True))
    found = replace(comparison, table=table)
    assert shown_textures(found) == PAPER_TEXTURES
    pd.testing.assert_frame_equal(percent_errors(found), percent_errors(comparison))
    pd.testing.assert_frame_equal(held_out_loads(found), held_out_loads(comparison))
    alone = pd.concat([comparison.table.calibration.frame, away], ignore_index=True)
    assert held_out_loads(replace(comparison, table=rb.ContactTable.from_frame(alone))).empty
