"""The verdict: every grade at its boundaries, by evidences and prior ranges given by hand."""

import io
import json
import math

import numpy as np
import pandas as pd
import pytest

from ridgebayes import Noise
from ridgebayes.comparison.bayes_factors import summed_bayes_factors
from ridgebayes.comparison.verdict import GRADES, verdict_of
from ridgebayes.evidence.prior_sensitivity import SENSITIVITY_COLUMNS
from ridgebayes.evidence.tables import evidence_table
from ridgebayes.inference.log_evidence import LogEvidence

NO_SENSITIVITY = pd.DataFrame(columns=SENSITIVITY_COLUMNS)
LITTLE = 2.0**-20  # so that every sum below is exact


def evidence_of(values):
    """Return `evidence.csv` of log evidences by form, or by form and error model."""
    pairs = {key if isinstance(key, tuple) else (key, "iid"): v for key, v in values.items()}
    return evidence_table({pair: [LogEvidence("quadrature", v, 0.0)] for pair, v in pairs.items()})


def told_apart(one, other):
    return False


def verdict(values, *changes, same_loads=told_apart):
    """Return the verdict, each change being (prior, factor, log evidences by form)."""
    rows = [
        (prior, factor, form, value)
        for prior, factor, changed in changes
        for form, value in changed.items()
    ]
    sensitivity = pd.DataFrame(rows, columns=SENSITIVITY_COLUMNS)
    return verdict_of(evidence_of(values), sensitivity, Noise(), same_loads)


# --- grades ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ln_bf", "low", "grade"),
    [
        (5.0, 3 + LITTLE, "decisive"),
        (5.0, 3.0, "supports"),
        (5 - LITTLE, 4.0, "supports"),
        (3.0, LITTLE, "supports"),
        (40.0, LITTLE, "supports"),
        (3.0, 0.0, "undecided"),
        (40.0, -LITTLE, "undecided"),
        (3 - LITTLE, LITTLE, "leans"),
        (2.0, LITTLE, "leans"),
        (2.0, 0.0, "undecided"),
        (2 - LITTLE, 1.0, "undecided"),
        (0.0, 0.0, "undecided"),
    ],
)
def test_grade__at_each_boundary(ln_bf, low, grade):
    found = verdict(
        {"classic": 100.0, "modified": 100 + ln_bf},
        ("sigma", 0.1, {"classic": 50.0, "modified": 50 + low}),
    )
    assert (found.grade, found.ln_bf, found.ln_bf_range) == (grade, ln_bf, (low, ln_bf))
    assert grade in GRADES


@pytest.mark.parametrize(
    ("ln_bf", "grade"), [(5.0, "decisive"), (3.0, "supports"), (2.0, "leans"), (1.9, "undecided")]
)
def test_grade__without_sensitivity_rests_on_the_evidences_alone(ln_bf, grade):
    found = verdict({"classic": 0.0, "modified": ln_bf})
    assert (found.grade, found.ln_bf_range) == (grade, (ln_bf, ln_bf))


def test_one_form__has_no_verdict():
    assert verdict({"modified": 10.0}) is None
    failed = {
        ("classic", "iid"): [LogEvidence("bridge", math.nan, math.nan, "no overlap")],
        ("modified", "iid"): [LogEvidence("bridge", 1.0, 0.1)],
    }
    assert verdict_of(evidence_table(failed), NO_SENSITIVITY, Noise(), told_apart) is None


def test_a_form_that_could_not_be_fitted__leaves_the_verdict_open():
    sure = evidence_of({"classic": 0.0, "modified": 50.0})
    given = sure, NO_SENSITIVITY, Noise(), told_apart
    assert verdict_of(*given).grade == "decisive"
    found = verdict_of(*given, ["hybrid"])
    assert found.grade == "undecided"
    assert found.why == "hybrid could not be fitted, and may be better"


# --- the range over priors ------------------------------------------------------------------------


def test_range__another_form_ahead_under_one_prior_is_undecided_and_says_which():
    found = verdict(
        {"hybrid": 20.0, "modified": 10.0},
        ("c2", 0.3, {"hybrid": 21.0, "modified": 10.0}),
        ("c2", 10.0, {"hybrid": 9.0, "modified": 10.0}),
    )
    assert (found.grade, found.form) == ("undecided", "hybrid")
    assert found.ln_bf_range == (-1.0, 11.0)
    assert "c2 prior's scale times 10" in found.why
    assert "another form is ahead" in found.why


@pytest.mark.parametrize(
    "prior", ["sigma", "tau_texture", "tau_step", "tau_series", "length_h", "df", "nugget"]
)
def test_range__a_prior_of_the_error_model_moves_in_all_forms(prior):
    found = verdict(
        {"classic": 4.0, "modified": 10.0}, (prior, 0.1, {"classic": 1.0, "modified": 7.0})
    )
    assert found.ln_bf_range == (6.0, 6.0)


@pytest.mark.parametrize("prior", ["c", "c2", "K"])
def test_range__a_prior_of_forms_moves_one_form_at_a_time(prior):
    found = verdict(
        {"classic": 4.0, "modified": 10.0}, (prior, 0.3, {"classic": 1.0, "modified": 7.0})
    )
    # The best form's alone: 7 - 4; the other's alone: 10 - 1.
    assert found.ln_bf_range == (3.0, 9.0)


def test_range__is_over_the_strongest_other_form_wherever_it_is():
    found = verdict(
        {"classic": 0.0, "power-law": 5.0, "modified": 10.0},
        ("K", 10.0, {"classic": 0.0, "power-law": 2.0, "modified": 10.0}),
        ("c", 10.0, {"classic": 7.0, "power-law": 5.0, "modified": 10.0}),
    )
    assert found.over == "power-law"
    assert found.ln_bf_range == (3.0, 8.0)


def test_range__a_form_without_an_evidence_is_in_none():
    values = {"classic": 4.0, "modified": 10.0}
    found = verdict(values, ("c", 0.3, {"hybrid": 99.0, "classic": 4.0, "modified": 9.0}))
    assert found.ln_bf_range == (5.0, 6.0)


def test_range__a_change_without_an_evidence_changes_nothing():
    values = {"classic": 4.0, "modified": 10.0}
    found = verdict(values, ("sigma", 0.1, {"classic": math.nan, "modified": math.nan}))
    assert found == verdict(values)


# --- the range over error models ------------------------------------------------------------------


def under_two(share, lead_of_other):
    """Evidences under iid, where Modified leads by 10, and under step, of the given weight."""
    step = math.log(share / (1 - share))
    return {
        ("classic", "iid"): -10.0,
        ("modified", "iid"): 0.0,
        ("classic", "step"): step,
        ("modified", "step"): step - lead_of_other,
    }


def test_error_model__alone_counts_above_one_per_cent():
    below, above = (verdict(under_two(share, 8.0)) for share in (0.0099, 0.0102))
    assert above.grade == "undecided"
    assert above.ln_bf_range[0] == pytest.approx(-8.0, abs=1e-12)
    assert "error model step alone" in above.why
    assert below.ln_bf_range[0] == pytest.approx(below.ln_bf)
    assert (set(below.error_model_weights), set(above.error_model_weights)) == (
        {"iid"},
        {"iid", "step"},
    )


def test_error_model__weights_are_with_forms_summed_out():
    values = {
        ("classic", "iid"): math.log(0.1),
        ("modified", "iid"): math.log(0.3),
        ("classic", "step"): math.log(0.2),
        ("modified", "step"): math.log(0.4),
    }
    found = verdict(values)
    assert found.error_model_weights == pytest.approx({"step": 0.6, "iid": 0.4}, rel=1e-14)
    assert found.ln_bf == pytest.approx(math.log(0.7 / 0.3), rel=1e-13)  # algebra
    summed = summed_bayes_factors(evidence_of(values)).iloc[0]
    assert found.ln_bf == pytest.approx(-summed["ln_bf"], rel=1e-14)


def test_error_model__whose_evidence_failed_a_check_moves_the_range():
    evidence = evidence_of(under_two(0.2, 8.0))
    of_step = (evidence["form"] == "classic") & (evidence["noise"] == "step")
    evidence.loc[of_step, "used"] = False
    found = verdict_of(evidence, NO_SENSITIVITY, Noise(), told_apart)
    step = math.log(0.2 / 0.8)
    modified = np.logaddexp(0.0, step - 8.0)  # two error models, of 0.5 each
    assert found.ln_bf_range[0] == pytest.approx(modified - np.logaddexp(-10.0, step), rel=1e-12)
    assert "classic under step, whose evidence is uncertain" in found.why


def test_error_model__under_which_the_best_form_has_no_evidence_leaves_it_undecided():
    values = under_two(0.2, 8.0)
    del values["modified", "step"]
    found = verdict(values)
    assert (found.form, found.grade) == ("modified", "undecided")
    assert found.ln_bf_range[0] == -math.inf
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["ln_bf_range"][0] is None


# --- forms that no row can tell apart -------------------------------------------------------------


@pytest.mark.parametrize(
    ("best", "over"), [("modified", "power-law"), ("hybrid", "modified"), ("classic", "mine")]
)
def test_alike__forms_that_reach_the_same_loads(best, over):
    asked = []

    def same(*pair):
        asked.append(pair)
        return True

    values = {"half-plane": 0.0, over: 10.0, best: 30.0}
    found = verdict(values, same_loads=same)
    assert asked == [(best, over)]
    assert (found.grade, found.form, found.over) == ("undecided", best, over)
    names = " and ".join(sorted([best, over]))
    assert found.why == (
        f"{names} can predict the same loads at all fitted rows: only their priors differ"
    )
    assert verdict(values).grade == "decisive"


@pytest.mark.parametrize("noise", ["texture", "texture+step", "texture+series", "texture:student"])
@pytest.mark.parametrize(("share", "grade"), [(0.51, "undecided"), (0.49, "decisive")])
def test_alike__power_law_and_modified_where_most_weight_has_texture_offsets(noise, share, grade):
    values = {}
    for form, lead in (("modified", 0.0), ("power-law", -10.0)):
        values[form, "step"] = lead + math.log(1 - share)
        values[form, noise] = lead + math.log(share)
    found = verdict(values)
    assert found.grade == grade
    assert ("same where each texture has an offset" in found.why) == (grade == "undecided")
    hybrid = {("hybrid" if form == "modified" else form, n): v for (form, n), v in values.items()}
    assert verdict(hybrid).grade == "decisive"


# --- what a reader of another mind needs ----------------------------------------------------------


@pytest.mark.parametrize(
    "values", [{"a": 0.0, "b": 2.0}, {"a": 0.0, "b": -3.0, "c": 1.0}, {"a": 0.0, "b": 30.0}]
)
def test_min_prior_probability__leads_to_a_posterior_one_of_95_per_cent(values):
    found = verdict(values)
    p, others = found.min_prior_probability, [v for f, v in values.items() if f != found.form]
    mine = p * math.exp(values[found.form])
    theirs = (1 - p) * np.mean(np.exp(others))
    assert mine / (mine + theirs) == pytest.approx(0.95, rel=1e-12)  # Bayes


def test_modified_and_power_law__are_alike_where_each_series_is_one_texture():
    values = {("modified", "series"): 20.0, ("power-law", "series"): 0.0}
    given = evidence_of(values), NO_SENSITIVITY, Noise("series"), told_apart
    assert verdict_of(*given).grade == "decisive"
    found = verdict_of(*given, series_are_textures=True)
    assert found.grade == "undecided"
    assert found.why.startswith("modified and power-law are the same where each texture has an")


# --- files ----------------------------------------------------------------------------------------


def back(frame):
    return pd.read_csv(io.StringIO(frame.to_csv(index=False)))


@pytest.mark.parametrize("frame", ["as it is", "turned"])
def test_round_trip__the_tables_alone_give_the_same_verdict(comparison, frame):
    evidence, sensitivity = comparison.evidence, comparison.prior_sensitivity
    if frame == "turned":
        evidence, sensitivity = evidence[::-1], sensitivity[::-1]
    again = verdict_of(back(evidence), back(sensitivity), comparison.noise, told_apart)
    mine = comparison.verdict
    assert (again.form, again.grade, again.over) == (mine.form, mine.grade, mine.over)
    numbers = ("ln_bf", "ln_bf_range", "min_prior_probability", "error_model_weights")
    for name in numbers:
        # Decimals of a CSV file, read to the last digit but one.
        assert getattr(again, name) == pytest.approx(getattr(mine, name), rel=1e-12), name
    assert again.why == mine.why


def test_to_dict__has_the_keys_of_the_contract():
    found = verdict({"classic": 0.0, "modified": 6.0}).to_dict()
    assert set(found) == {
        "form",
        "grade",
        "ln_bf",
        "ln_bf_range",
        "over",
        "min_prior_probability",
        "error_model",
        "error_model_weights",
        "why",
    }
    assert json.loads(json.dumps(found)) == found
