"""Evidences found anew where a prior could decide the grade: which changes, and which forms."""

import math

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.comparison.deciding_priors import with_deciding_priors
from ridgebayes.evidence import LogEvidence
from ridgebayes.evidence.prior_sensitivity import BOUNDS, SENSITIVITY_COLUMNS
from ridgebayes.evidence.tables import evidence_table
from ridgebayes.inference.presets import QUICK


def asked(ln_bf, changes, anew=(), noises=("iid", "step")):
    """Return the calls for evidences, and what the table says after them.

    Two forms, and a third far behind; `changes` has lead, least and most by (prior, factor), `anew`
    the leads that are found.
    """
    base = {"classic": ln_bf, "hybrid": 0.0, "modified": -100.0}
    evidence = evidence_table(
        {
            (form, noise): [LogEvidence("quadrature", value, 0.0)]
            for form, value in base.items()
            for noise in noises
        }
    )
    rows = []
    for (prior, factor), (lead, least, most) in changes.items():
        rows.append((prior, factor, "classic", ln_bf, ln_bf, ln_bf))
        rows.append((prior, factor, "hybrid", ln_bf - lead, ln_bf - most, ln_bf - least))
        rows.append((prior, factor, "modified", -100.0, -100.0, -100.0))
    calls, found = [], iter(anew)

    def evidences(prior, factor, names):
        calls.append((prior, factor, *sorted(names)))
        log_n = math.log(len(noises))
        return {"classic": 50 + log_n, "hybrid": 50 - next(found) + log_n}

    frame = pd.DataFrame(rows, columns=SENSITIVITY_COLUMNS + BOUNDS)
    told = with_deciding_priors(evidence, frame, evidences)
    assert list(told) == SENSITIVITY_COLUMNS
    assert len(told) == len(frame)
    value = told.set_index(["form", "prior", "factor"])["log_evidence"]
    for prior, factor, *_ in calls:  # error models summed out: their mean, not their sum
        assert value["classic", prior, factor] == pytest.approx(50.0, rel=1e-12)
    return calls, (value["classic"] - value["hybrid"]).to_dict()


LOST = ("sigma", 0.1)


@pytest.mark.parametrize(
    ("ln_bf", "lead", "least", "most", "is_anew"),
    [
        (10.0, -1.0, -1.0, 9.0, True),  # told to be behind, which is not sure
        (10.0, 9.0, -1.0, 9.0, True),  # told to be ahead, which is not sure
        (10.0, 9.0, 3.0, 9.0, True),  # decisive is at stake
        (10.0, 9.0, 3.01, 9.0, False),
        (4.0, 3.0, 0.0, 4.0, True),  # only the sign is
        (4.0, 3.0, 0.01, 4.0, False),
        (1.9, 1.0, -5.0, 4.0, False),  # undecided whatever is found
        (10.0, -1.0, -1.0, -0.6, False),  # behind, and sure enough
        (10.0, math.nan, math.nan, math.nan, True),  # draws led nowhere
    ],
)
def test_a_change_of_a_prior__is_looked_at_anew_where_it_may_cost_the_grade(
    ln_bf, lead, least, most, is_anew
):
    calls, leads = asked(ln_bf, {LOST: (lead, least, most)}, [7.0])
    assert calls == ([(*LOST, "classic", "hybrid")] if is_anew else [])
    assert leads[LOST] == pytest.approx(7.0 if is_anew else lead, rel=1e-12)


def test_several_changes__come_one_by_one_until_the_others_cannot_cost_the_grade():
    changes = {
        ("sigma", 0.1): (9.0, -2.0, 9.0),
        ("sigma", 0.3): (9.0, 1.0, 9.0),
        ("tau_step", 0.1): (9.0, -8.0, 9.0),
        ("df", 10.0): (9.0, 5.0, 9.0),
    }
    # A lead of 8 and one of 7 leave `decisive` at stake: what may be 1 is looked at as well.
    calls, _ = asked(10.0, changes, [8.0, 7.0, 6.0])
    assert [call[0] for call in calls] == ["tau_step", "sigma", "sigma"]
    # A lead of 2: only the sign is left at stake.
    calls, _ = asked(10.0, changes, [2.0, 7.0])
    assert [call[:2] for call in calls] == [("tau_step", 0.1), ("sigma", 0.1)]
    # Behind: nothing is.
    calls, leads = asked(10.0, changes, [-1.0])
    assert [call[0] for call in calls] == ["tau_step"]
    assert leads["tau_step", 0.1] == pytest.approx(-1.0, rel=1e-12)


def test_a_sure_change__that_costs_the_grade_spares_the_others():
    changes = {("c", 10.0): (-1.0, -1.0, -1.0), ("sigma", 0.1): (9.0, -2.0, 9.0)}
    assert asked(10.0, changes)[0] == []


def test_evidences_anew__never_fall_below_what_draws_tell():
    # Of Hybrid draws tell 10 - 1; what is found anew, 50 - 43, is less.
    calls, leads = asked(10.0, {LOST: (9.0, -2.0, 1.0)}, [43.0])
    assert [call[:2] for call in calls] == [LOST]
    assert leads[LOST] == pytest.approx(50.0 - 9.0, rel=1e-12)


@pytest.mark.parametrize("prior", ["c", "K", "nugget"])
def test_priors_of_coefficients_and_the_nugget__stay_as_draws_tell(prior):
    assert asked(10.0, {(prior, 0.1): (9.0, -5.0, 9.0)})[0] == []


def test_loads_with_10_percent_noise__have_the_lead_that_a_whole_comparison_finds():
    # Under a narrow prior of sigma independent rows lose a hundred in ln evidence. Those of Hybrid,
    # which were not drawn, kept what they had, and Hybrid seemed ahead by 35.
    rng = np.random.default_rng(4)
    Q, texture = np.tile([4, 6, 8, 10, 12], 4), np.repeat(np.arange(4), 5)
    a, b = np.array([[0.012, 0.03], [0.022, 0.02], [0.03, 0.01], [0.018, 0.045]])[texture].T
    load = rb.Classic().load(Q, a, b) * np.exp(0.1 * rng.standard_normal(20))
    frame = pd.DataFrame({"a_over_R": a, "b_over_R": b, "nu": 0.5, "Q": Q, "p_over_E": load})
    found = rb.compare(frame, accuracy=QUICK)
    assert (found.verdict.form, found.verdict.grade) == ("classic", "decisive")
    told = found.prior_sensitivity.set_index(["prior", "factor", "form"])["log_evidence"]
    lead = told["sigma", 0.1, "classic"] - told["sigma", 0.1, "hybrid"]
    narrow = {"noise": {"sigma": "halfnormal(0.005)"}}  # a tenth of 0.05
    other = rb.compare(frame, ["classic", "hybrid"], priors=narrow, accuracy=QUICK)
    assert abs(lead) > 5  # there is something to be seen
    # Monte Carlo: standard errors of two evidences of forms that are far from their rows.
    assert abs(lead - other.verdict.ln_bf) < 4 * 0.2
