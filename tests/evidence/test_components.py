"""Inclusion Bayes factors of the error model's components, against sums made by hand."""

import math

import numpy as np
import pandas as pd
import pytest

from ridgebayes.evidence.components import COMPONENT_COLUMNS, component_table
from ridgebayes.evidence.tables import evidence_table
from ridgebayes.inference.log_evidence import LogEvidence

# Evidences of two forms, small enough to be summed by hand; no evidence is a zero.
BY_HAND = {
    "iid": (1.0, 3.0),
    "texture": (2.0, 6.0),
    "step": (10.0, 50.0),
    "texture+step": (0.5, 1.5),
    "step-smooth": (400.0, None),
    "series": (1.0, 1.0),
    "step:student": (20.0, 4.0),
    "texture:student": (None, None),
}
SE = 0.1


def evidence(table, se=SE):
    found = {}
    for noise, values in table.items():
        for form, value in zip(("modified", "hybrid"), values, strict=True):
            log = math.nan if value is None else math.log(value)
            status = "no interior mode" if value is None else "ok"
            found[form, noise] = [LogEvidence("importance", log, se, status)]
    return evidence_table(found)


def ln_ratio(having, others):
    """Log of the ratio of two means, from pairs as they are written above."""
    one, other = (
        sum(sum(v or 0 for v in BY_HAND[name]) for name in names) / len(names)
        for names in (having, others)
    )
    return math.log(one / other)


@pytest.mark.parametrize(
    ("component", "having"),
    [
        ("texture", ["texture", "texture+step", "texture:student"]),
        ("step", ["step", "texture+step", "step:student"]),
        ("smooth", ["step-smooth"]),
        ("series", ["series"]),
        ("student", ["step:student", "texture:student"]),
    ],
)
def test_components__are_ratios_of_mean_evidences(component, having):
    row = component_table(evidence(BY_HAND)).set_index("component").loc[component]
    others = [name for name in BY_HAND if name not in having]
    assert row["ln_bf"] == pytest.approx(ln_ratio(having, others), rel=1e-13)  # algebra
    # The prior odds of a component are numbers of error models, so that it has the posterior odds:
    odds = row["probability"] / (1 - row["probability"])
    by_hand = math.exp(row["ln_bf"]) * len(having) / len(others)
    assert odds == pytest.approx(by_hand, rel=1e-12)


def test_components__have_the_error_of_both_means():
    row = component_table(evidence(BY_HAND)).set_index("component").loc["series"]
    others = np.array([v or 0.0 for name in BY_HAND if name != "series" for v in BY_HAND[name]])
    share = others / others.sum()
    expected = SE * math.hypot(math.hypot(0.5, 0.5), math.sqrt((share**2).sum()))
    assert row["ln_bf_se"] == pytest.approx(expected, rel=1e-12)  # algebra


@pytest.mark.parametrize(
    ("times", "se", "reading"),
    [
        (math.exp(0.9), 0.0, "undecided"),
        (math.exp(1.1), 0.0, "positive for it"),
        (math.exp(1.1), 0.6, "undecided"),
        (math.exp(-3.1), 0.0, "strong against it"),
        (math.exp(5.1), 0.0, "very strong for it"),
    ],
)
def test_components__reading_has_size_and_side(times, se, reading):
    table = {"iid": (1.0, 1.0), "texture": (times, times)}
    (found,) = component_table(evidence(table, se)).to_dict("records")
    assert (found["component"], found["reading"]) == ("texture", reading)


@pytest.mark.parametrize(
    "table",
    [
        {"step-smooth": (1.0, 2.0)},
        {"iid": (1.0, 2.0), "step": (None, None)},
    ],
    ids=["one error model", "one with an evidence"],
)
def test_components__of_one_error_model_are_none(table):
    found = component_table(evidence(table))
    assert list(found) == COMPONENT_COLUMNS
    assert found.empty


def test_components__that_all_error_models_have_are_left_out():
    found = component_table(evidence({"step": (1.0, 2.0), "texture+step": (3.0, 4.0)}))
    assert found["component"].tolist() == ["texture"]


def test_components__use_the_used_evidence_alone():
    table = evidence(BY_HAND)
    walked = table.assign(method="bridge", used=False, log_evidence=99.0)
    both = pd.concat([table, walked], ignore_index=True)
    pd.testing.assert_frame_equal(component_table(both), component_table(table))
