"""Scores of several forms on what is left out: those of each cross-validation, side by side."""

import pytest

import ridgebayes as rb
from ridgebayes.checks.cross_validation import LEFT_OUT_COLUMNS, cross_validate, left_out_scores
from ridgebayes.checks.folds import Fold
from ridgebayes.errors import ComputationError
from ridgebayes.inference.importance import Effort

EFFORT = Effort(n_round=2, n_per_round=384, n_draw=128)
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


def test_left_out_scores__name_folds_that_failed_and_give_their_form_no_score(
    fe_table, monkeypatch
):
    found, first = Fold.found, fe_table.calibration.labels[0]

    def failing(fold):
        if fold.name == first and fold.known.model.form.name == "modified":
            raise ComputationError("no draws")
        return found(fold)

    monkeypatch.setattr(Fold, "found", failing)
    scores = left_out_scores(fe_table, FORMS, leaves=["texture"], effort=EFFORT)
    assert scores["failed"].tolist() == [f"{first}: no draws", ""]
    assert scores["log_score"].isna().tolist() == [True, False]
    assert scores["stacking_weight"].tolist() == [0, 1]
