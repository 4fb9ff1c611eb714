"""Forms under error models, weighed: planted error models are found again, and who is selected."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.special import softmax

import ridgebayes as rb
from ridgebayes import ComputationError, Noise
from ridgebayes.evidence.pairs import weigh_pairs
from ridgebayes.evidence.tables import (
    EVIDENCE_COLUMNS,
    MAX_SELECTED_GAP,
    error_model_weights,
    evidence_table,
    mean_evidence,
    selected_error_model,
    used_evidence,
)
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.posterior import posterior_of
from ridgebayes.inference.presets import QUICK
from ridgebayes.model.noise import AUTO, error_models_for
from ridgebayes.model.observations import Observations

TAU = 0.06  # of planted offsets; a row's own error is 0.01


def planted(structure, *, seed=1):
    """Rows of six textures that Modified made, with errors of one structure."""
    rng, rows = np.random.default_rng(seed), []
    pitches, shares = np.linspace(0.03, 0.06, 6), np.tile([0.3, 0.5, 0.7], 2)
    steps = dict(zip((4, 6, 8, 10, 12), TAU * rng.standard_normal(5), strict=True))
    for pitch, share in zip(pitches, shares, strict=True):
        own = TAU * rng.standard_normal()
        for Q, of_step in steps.items():
            draw = rng.standard_t(1.5) if "student" in structure else rng.standard_normal()
            error = 0.01 * draw
            if "texture" in structure:
                error += own
            if structure == "step-smooth":
                error += TAU * math.sin(1.5 * math.log(Q / 2 - 1) + 3 * share)
            elif "step" in structure:
                error += of_step
            load = ((Q / 2 - 1) * pitch / 1.4) ** 2 * math.exp(error)
            rows.append((share * pitch, (1 - share) * pitch, Q, load))
    frame = pd.DataFrame(rows, columns=["a_over_R", "b_over_R", "Q", "p_over_E"])
    return Observations.from_table(rb.ContactTable.from_frame(frame))


@pytest.fixture(scope="module")
def few():
    noises = [Noise("texture"), Noise("step"), Noise("iid", "student")]
    forms = [rb.Modified(), rb.Classic()]
    return weigh_pairs(planted("texture"), forms, noises, seed=3, accuracy=QUICK)


@pytest.mark.parametrize(
    "structure",
    ["texture", *(pytest.param(n, marks=pytest.mark.long) for n in ("step-smooth", "iid:student"))],
)
def test_planted__error_model_is_selected_or_the_second_best(structure):
    found = weigh_pairs(planted(structure), [rb.Modified()], error_models_for(AUTO, 1), seed=3)
    means = mean_evidence(found.evidence)
    assert len(means) == 10
    assert structure in means["noise"].tolist()[:2]
    assert selected_error_model(found.evidence).name == structure


def numbers(found):
    return [
        (key, one.evidence, b"" if one.drawn is None else one.drawn.u.tobytes())
        for key, one in found.weighed.items()
    ]


def test_weigh_pairs__same_seed_same_bytes_with_workers_and_without(few):
    data = planted("texture")
    forms = [rb.Modified(), rb.Classic()]
    noises = [Noise("texture"), Noise("step"), Noise("iid", "student")]
    with ThreadPoolExecutor(2) as executor:
        again = weigh_pairs(data, forms, noises, seed=3, accuracy=QUICK, executor=executor)
    assert numbers(again) == numbers(few)
    # And whatever is weighed beside them.
    alone = weigh_pairs(data, [rb.Modified()], [Noise("step")], seed=3, accuracy=QUICK)
    assert alone.weighed["modified", "step"].drawn.u.tobytes() == (
        few.weighed["modified", "step"].drawn.u.tobytes()
    )
    other = weigh_pairs(data, [rb.Modified()], [Noise("step")], seed=4, accuracy=QUICK)
    assert other.evidence["log_evidence"][0] != alone.evidence["log_evidence"][0]


def test_weigh_pairs__says_why_a_pair_has_no_evidence(observed):
    data = observed(np.arange(2_001) % 4, 4, -7.0 + 0.01 * np.cos(np.arange(2_001)))
    found = weigh_pairs(data, [rb.Modified()], [Noise(), Noise("texture", "student")])
    row = found.evidence.set_index("noise").loc["texture:student"]
    assert math.isnan(row["log_evidence"])
    assert "texture:student: 2001 rows; expected at most 2000" in row["status"]
    assert not row["used"]
    assert found.weighed["modified", "texture:student"].drawn is None
    assert found.weights("modified") == {"iid": 1.0}
    assert list(found.posteriors(["modified"], "iid", 1_000)["modified"]) == ["iid"]


def test_weights__are_the_softmax_of_the_evidences(few):
    used = used_evidence(few.evidence)
    own = used[used["form"] == "modified"].set_index("noise")["log_evidence"]
    expected = pd.Series(softmax(own), own.index)
    expected = expected[expected > 0.01] / expected[expected > 0.01].sum()
    assert few.weights("modified") == pytest.approx(expected.to_dict(), rel=1e-12)  # algebra
    assert few.form_share("modified") + few.form_share("classic") == pytest.approx(1, rel=1e-12)
    assert few.form_share("classic") < 1e-4


def test_posteriors__are_of_what_carries_weight_or_is_printed(few):
    found = few.posteriors(["modified", "classic"], "step", 4_000)
    assert set(found["modified"]) == {"step", *few.weights("modified")}
    sizes = {name: one.chains.log_density.size for name, one in found["modified"].items()}
    assert sizes["texture"] >= few.weights("modified")["texture"] * 4_000
    # A form out of reach keeps the draws of its evidence.
    step = few.weighed["classic", "step"].drawn
    assert found["classic"]["step"].chains.log_density.size == step.log_density.size
    for name, one in found["modified"].items():
        assert one.noise.name == name
        assert one.evidence == few.weighed["modified", name].evidence
        assert one.sampler == "importance"


def evidence_of(values):
    return evidence_table({key: [LogEvidence("importance", v, 0.0)] for key, v in values.items()})


def test_posteriors__that_do_not_converge_are_drawn_again_with_twice_the_draws(few, monkeypatch):
    made = []

    def never_converged(model, drawn, seed):
        made.append(drawn.log_density.size)
        return replace(posterior_of(model, drawn, seed), convergence_failures=("R-hat",))

    monkeypatch.setattr("ridgebayes.evidence.pairs.posterior_of", never_converged)
    few.posteriors(["modified"], "step", 0)
    assert made
    assert made[1::2] == [2 * n for n in made[::2]]


@pytest.mark.parametrize(
    ("values", "selected"),
    [
        ({"iid": 0.0, "texture": MAX_SELECTED_GAP - 0.01, "texture+step:student": 0.5}, "iid"),
        (
            {
                "iid": 0.0,
                "texture": MAX_SELECTED_GAP + 0.01,
                "texture+step": MAX_SELECTED_GAP + 0.02,
            },
            "texture",
        ),
        ({"iid": 0.0, "texture+step": 9.0, "step-smooth": 8.5, "step-smooth:student": 9.0}, None),
        ({"texture": 3.0, "step": 3.1, "texture+step": 3.2}, "step"),
    ],
)
def test_selected__is_the_simplest_of_those_within_1_1_of_the_best(values, selected):
    found = selected_error_model(evidence_of({("modified", n): v for n, v in values.items()}))
    # Three parameters against five: sigma and two taus; sigma, tau and two lengths.
    assert found.name == (selected or "texture+step")


def test_selected__forms_are_summed_out_and_none_is_said():
    values = {
        ("classic", "iid"): 4.0,
        ("modified", "iid"): -50.0,
        ("classic", "texture"): 3.5,
        ("modified", "texture"): 5.0,
    }
    # ln mean: iid 4 - ln 2, texture 5.2 - ln 2: 1.2 apart.
    assert selected_error_model(evidence_of(values)).name == "texture"
    values["classic", "iid"] = 4.2
    assert selected_error_model(evidence_of(values)).name == "iid"
    none = evidence_table({("a", "iid"): [LogEvidence("importance", math.nan, math.nan, "why")]})
    with pytest.raises(ComputationError, match="under any error model: why"):
        selected_error_model(none)


def test_evidence_table__prior_odds_are_shared_by_the_error_models_of_a_form():
    values = {("a", "iid"): 1.0, ("a", "step"): 3.0, ("b", "iid"): 2.0, ("b", "step"): 4.0}
    found = {key: [LogEvidence("importance", math.log(v), 0.0)] for key, v in values.items()}
    table = evidence_table(found, {"a": 3.0})  # 3 to 1, by 1 + 3 to 2 + 4
    np.testing.assert_allclose(table["prior_probability"], [3 / 8, 3 / 8, 1 / 8, 1 / 8], rtol=1e-14)
    expected = np.array([3, 9, 2, 4]) / 18
    np.testing.assert_allclose(table["model_probability"], expected, rtol=1e-14)  # algebra
    equal = evidence_table(found)
    pd.testing.assert_frame_equal(evidence_table(found, {"a": 2.0, "b": 2.0}), equal)
    assert set(equal["prior_probability"]) == {0.25}
    weights = [error_model_weights(one, "a") for one in (table, equal)]
    assert weights[0] == pytest.approx(weights[1], rel=1e-14)


def test_evidence_table__uses_the_first_that_can_be_used():
    bad = LogEvidence("importance", 9.0, 0.1, "importance weights: Pareto k 0.90, above 0.7")
    kept = replace(bad, value=-20.0).kept()
    good = LogEvidence("bridge", 2.0, 0.01)
    found = evidence_table({("a", "iid"): [bad, good], ("b", "iid"): [kept]})
    assert found.columns.tolist() == EVIDENCE_COLUMNS
    assert found["used"].tolist() == [False, True, True]
    share = 1 / (1 + math.exp(-22))
    np.testing.assert_allclose(found["model_probability"], [np.nan, share, 1 - share], rtol=1e-6)
    assert found["prior_probability"].tolist() == [0.5] * 3
    assert error_model_weights(found, "c") == {}
    found = evidence_of({("a", "iid"): 0.0, ("a", "step"): -3.0, ("a", "texture"): -6.0})
    least = 1 / (1 + math.exp(-3))  # a two-thousandth is left out, a twentieth is not
    expected = {"iid": least, "step": 1 - least}
    assert error_model_weights(found, "a") == pytest.approx(expected, rel=1e-12)  # algebra
