"""What a comparison says, arranged: factors against one form, prior scales, ranking, problems."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from ridgebayes import Noise
from ridgebayes.comparison.ranking import (
    best_form,
    factors_by_method,
    forms_by_probability,
    predicting,
    problems,
    sensitivity_factors,
)


def test_factors_by_method_are_differences_and_agree(comparison):
    factors = factors_by_method(comparison, "hybrid").set_index(["form", "method"])
    pair = comparison.bayes_factors.query("form_a == 'modified' and form_b == 'hybrid'").iloc[0]
    assert factors.loc[("modified", "importance"), "ln_bf"] == pytest.approx(pair["ln_bf"])
    against = factors_by_method(comparison, "modified").set_index(["form", "method"])
    for method in ("importance", "bridge"):
        ln_bf, se = against.loc[("hybrid", method), ["ln_bf", "ln_bf_se"]]
        assert abs(ln_bf - 4.5241) < 4 * se + 5e-5  # Monte Carlo; four printed digits
        assert factors.loc[("modified", method), "ln_bf"] == pytest.approx(-ln_bf, abs=1e-12)


def test_sensitivity_at_the_default_scale_is_the_bayes_factor(comparison):
    table = sensitivity_factors(comparison, "hybrid")
    at_one = table[np.isclose(table["factor"], 1) & (table["form"] == "modified")]
    used = comparison.evidence[comparison.evidence["used"]].set_index("form")["log_evidence"]
    np.testing.assert_allclose(at_one["ln_bf"], used["modified"] - used["hybrid"], atol=1e-12)
    assert set(table["prior"]) == {"c", "c2", "K", "sigma"}


def test_predicting__is_what_errors_grow_by_without_the_form_and_without_the_offset(comparison):
    smooth = Noise("step-smooth")
    left_out = pd.DataFrame(
        {
            "form": ["classic", "hybrid"] * 2,
            "leave": ["texture"] * 2 + ["step"] * 2,
            "mean_crps": [0.03, 0.01, 9.0, 1.0],
        }
    )
    coverage = pd.DataFrame(
        {
            "form": "hybrid",
            "noise": ["step-smooth", "iid"] * 2,
            "prob": [0.9, 0.9, 0.5, 0.5],
            "mean_width": [0.02, 0.1, 1.0, 1.0],
        }
    )
    known = replace(comparison, noise=smooth, left_out=left_out, coverage=coverage)
    found = predicting(known)
    assert found.without_form == pytest.approx(3.0, rel=1e-14)
    assert found.without_offset == pytest.approx(5.0, rel=1e-14)
    for lacking in (
        replace(known, noise=Noise("step")),
        replace(known, left_out=pd.DataFrame()),
        replace(known, left_out=left_out[left_out["form"] != "classic"]),
        replace(known, left_out=left_out.assign(mean_crps=np.nan)),
        replace(known, coverage=coverage[coverage["noise"] != "iid"]),
    ):
        assert predicting(lacking) is None


def test_sensitivity_leaves_out_priors_that_no_form_has(odd):
    assert "c2" not in set(sensitivity_factors(odd, odd.best)["prior"])


def test_sensitivity_of_an_unknown_form_or_an_empty_table_is_empty(comparison):
    assert not len(sensitivity_factors(comparison, "half-plane"))
    empty = replace(comparison, prior_sensitivity=pd.DataFrame())
    assert not len(sensitivity_factors(empty, "hybrid"))


def test_ranking_and_problems(comparison, single):
    assert forms_by_probability(comparison) == ["hybrid", "modified", "power-law", "classic"]
    assert best_form(comparison) == "hybrid"
    assert comparison.verdict.over == "modified"
    pair = comparison.bayes_factors.query("form_a == 'modified' and form_b == 'hybrid'")
    se = pair["ln_bf_se"].iloc[0]
    # Monte Carlo: four standard errors; reference: four printed digits.
    assert abs(comparison.verdict.ln_bf - 4.5241) < 4 * se + 5e-5
    assert single.verdict is None
    assert problems(comparison) == ()
    assert problems(single)
