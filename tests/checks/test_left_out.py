"""Scores of several forms on what is left out: those of each cross-validation, side by side."""

import math

import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.checks.cross_validation import LEFT_OUT_COLUMNS, cross_validate, left_out_scores

EFFORT = {"n_round": 2, "n_per_round": 400, "n_draw": 256}
FORMS = (rb.Modified(), rb.Hybrid())


@pytest.fixture(scope="module")
def scores(fe_table):
    return left_out_scores(fe_table, FORMS, rng=3, effort=EFFORT)


def test_left_out_scores__are_those_of_each_cross_validation(scores, fe_table):
    assert scores.columns.tolist() == LEFT_OUT_COLUMNS
    assert scores["form"].tolist() == ["modified", "hybrid"] * 2
    assert scores["leave"].tolist() == ["texture"] * 2 + ["step"] * 2
    for row in scores.to_dict("records"):
        form = rb.Hybrid() if row["form"] == "hybrid" else rb.Modified()
        alone = cross_validate(fe_table, form, leave=row["leave"], rng=3, effort=EFFORT)
        assert row["log_score"] == alone.elpd
        assert row["log_score_se"] == alone.elpd_se
        assert row["mean_crps"] == alone.mean_crps
        assert row["n_fold"] == len(alone.folds)
        assert row["failed"] == ""


def test_left_out_scores__weights_of_one_kind_of_fold_sum_to_one(scores):
    for _, part in scores.groupby("leave"):
        assert part["stacking_weight"].sum() == pytest.approx(1, abs=1e-9)  # algebra


def test_left_out_scores__leave_out_what_there_is_one_of(fe_table):
    frame = fe_table.calibration.frame
    first = frame[frame["a_over_R"] == frame["a_over_R"].iloc[0]]
    one = rb.ContactTable.from_frame(first)
    found = left_out_scores(one, [rb.Modified()], rng=3, effort=EFFORT)
    assert found["leave"].tolist() == ["step"]
    assert found["stacking_weight"].tolist() == [1]


def test_left_out_scores__name_folds_that_failed_and_give_their_form_no_score():
    # Rows that Modified makes exactly, but for one texture's: without it there is no mode.
    a, b, Q = 0.02, 0.02, [4, 6, 8]
    loads = [rb.Modified().load(q, a, b, [1.4]) for q in Q]
    frame = pd.concat(
        [
            pd.DataFrame({"a_over_R": a, "b_over_R": b, "Q": Q, "p_over_E": loads}),
            pd.DataFrame({"a_over_R": a, "b_over_R": 0.03, "Q": [4], "p_over_E": [1e-3]}),
        ]
    )
    table = rb.ContactTable.from_frame(frame)
    found = left_out_scores(table, [rb.Modified()], leaves=["texture"], effort=EFFORT)
    assert "no interior mode" in found["failed"].iloc[0]
    assert math.isnan(found["log_score"].iloc[0])
    assert math.isnan(found["stacking_weight"].iloc[0])
