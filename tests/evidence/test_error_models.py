"""Error models weighed: planted ones are found again, and weights are what evidences say."""

import math

import numpy as np
import pandas as pd
import pytest
from scipy.special import softmax

import ridgebayes as rb
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.evidence import LogEvidence, candidates
from ridgebayes.evidence.error_models import (
    AS_GOOD,
    _main_pairs,
    error_model_weights,
    mean_evidence,
    printed_error_model,
    weigh_error_models,
)
from ridgebayes.evidence.tables import evidence_table
from ridgebayes.inference.presets import QUICK, STANDARD
from ridgebayes.model.noise import AUTO, Noise, error_models_for
from ridgebayes.model.observations import Observations
from ridgebayes.model.prior_files import priors_of, resolve_priors

TAU = 0.06  # of planted offsets; a row's own error is 0.01


def planted(structure, *, seed=1, n_series=1):
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
    copies = [frame.assign(series=f"rig {i}") for i in range(n_series)]
    return rb.ContactTable.from_frame(pd.concat(copies))


def observations(structure, **known):
    return Observations.from_table(planted(structure, **known))


def evidence_of(values):
    return evidence_table({key: [LogEvidence("laplace", v, 0.0)] for key, v in values.items()})


# --- what rows say --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def weighed():
    """Modified under every error model, by the structure that was planted."""
    found = {}

    def weigh(structure):
        if structure not in found:
            data = observations(structure)
            noises = error_models_for(AUTO, data.n_series)
            found[structure] = weigh_error_models(data, [rb.Modified()], noises, seed=3)
        return found[structure]

    return weigh


@pytest.mark.parametrize(
    "structure",
    [
        *("iid", "texture", "step", "step-smooth"),
        pytest.param("iid:student", marks=pytest.mark.long),
    ],
)
def test_planted__structure_has_the_highest_or_second_highest_weight(weighed, structure):
    means = mean_evidence(weighed(structure).evidence)
    assert len(means) == 10
    assert structure in means["noise"].tolist()[:2]
    assert printed_error_model(weighed(structure).evidence).name == structure


def test_weights__are_the_softmax_of_the_evidences_of_what_was_drawn(weighed):
    found = weighed("texture")
    used = found.evidence[found.evidence["used"]].set_index("noise")["log_evidence"]
    assert len(used) == 10
    drawn = found.posteriors("modified")
    weights = error_model_weights(found.evidence, "modified", drawn)
    share = pd.Series(softmax(used), used.index)
    expected = share[share.index.isin(drawn) & (share > 0.01)]
    assert {"texture", "texture:student", "texture+step"} <= set(expected.index)
    expected /= expected.sum()
    assert weights == pytest.approx(expected.to_dict(), rel=1e-12)  # algebra
    assert math.isclose(sum(weights.values()), 1.0, rel_tol=1e-14)


def test_drawn__is_what_may_carry_weight_and_only_that(weighed):
    found = weighed("texture")
    values = {noise: one.evidence.value for (_, noise), one in found.candidates.items()}
    best = max(values.values())
    for (_, noise), one in found.candidates.items():
        if one.left_to:
            assert one.posterior is None
        elif values[noise] > best - 4.6:  # one per cent
            assert one.posterior.noise.name == noise
            assert one.posterior.converged
        elif values[noise] < best - 10:
            assert one.posterior is None


def test_drawn__a_form_out_of_reach_takes_the_draws_of_a_quick_run():
    noises = [Noise("texture"), Noise("step")]
    found = weigh_error_models(observations("texture"), [rb.Modified(), rb.Classic()], noises)
    sizes = {
        key: len(one.posterior.coordinates)
        for key, one in found.candidates.items()
        if one.posterior is not None
    }
    assert sizes["modified", "texture"] == 4 * STANDARD.n_draw
    assert sizes["classic", "step"] == 4 * QUICK.n_draw
    best = found.evidence.groupby("form")["log_evidence"].max()
    assert best["classic"] < best["modified"] - 12


def test_main_pairs__are_printed_or_much_of_their_forms_average():
    values = {"iid": 0.0, "texture": 0.5, "step": -0.5, "texture+step": -3.0}
    found = {("a", noise): [LogEvidence("laplace", v, 0.1)] for noise, v in values.items()}
    found |= {("b", noise): [LogEvidence("laplace", -20.0, 0.1)] for noise in values}
    # By hand: shares of a are 0.31, 0.50, 0.19, 0.02, of b a quarter each; iid is printed.
    expected = {("a", "iid"), ("a", "texture"), ("b", "iid")}
    assert _main_pairs(evidence_table(found)) == expected
    none = {key: [LogEvidence("laplace", math.nan, math.nan, "no mode")] for key in found}
    assert _main_pairs(evidence_table(none)) == set()


# --- Student errors with shared offsets -----------------------------------------------------------


def test_student__without_gain_is_left_to_its_normal_twin(weighed):
    found = weighed("texture")
    student = found.candidates["modified", "texture:student"]
    assert student.left_to == "texture"
    drawn = found.posteriors("modified")
    assert drawn["texture:student"] is drawn["texture"]
    # It keeps its own evidence, so that its weight counts.
    row = found.evidence.query("noise == 'texture:student'").iloc[0]
    assert row["used"]
    assert row["model_probability"] > 0.01


def test_student__with_gain_is_drawn_itself(weighed):
    found = weighed("iid:student")
    for structure in ("texture", "step"):
        values = [
            found.candidates["modified", name].evidence.value
            for name in (structure, f"{structure}:student")
        ]
        assert values[1] > values[0]
        assert found.candidates["modified", f"{structure}:student"].left_to == ""
        drawn = found.posteriors("modified")[f"{structure}:student"]
        assert drawn.noise.name == f"{structure}:student"


def test_student__of_independent_rows_is_never_left(weighed):
    assert weighed("texture").candidates["modified", "iid:student"].left_to == ""


def test_student__without_its_twin_is_not_left():
    noises = [Noise("texture", "student"), Noise("iid")]
    found = weigh_error_models(observations("texture"), [rb.Modified()], noises)
    assert found.candidates["modified", "texture:student"].left_to == ""


def test_student__left_to_a_twin_that_cannot_be_drawn_says_why(monkeypatch):
    def refuse(task, model, *_):
        if task.noise.name == "texture":
            raise ComputationError("no draws")
        return drawn(task, model, *_)

    drawn = candidates._drawn
    monkeypatch.setattr(candidates, "_drawn", refuse)
    noises = [Noise("texture"), Noise("texture", "student"), Noise()]
    found = weigh_error_models(observations("texture"), [rb.Modified()], noises, seed=3)
    left = found.candidates["modified", "texture:student"]
    assert (left.left_to, left.evidence.status) == ("texture", "no draws")
    used = found.evidence.query("used")
    assert used["noise"].tolist() == ["iid"]
    assert np.isfinite(used["model_probability"]).all()


# --- a power law of many textures -----------------------------------------------------------------


def test_exact_draws__are_averaged_over_like_any_others(monkeypatch):
    monkeypatch.setattr("ridgebayes.inference.posterior.N_TEXTURE_WALKED", 3)
    noises = [Noise(), Noise("step")]
    monkeypatch.setattr("ridgebayes.results.error_models_for", lambda noise, n_series: noises)
    found = weigh_error_models(observations("iid"), [rb.PowerLaw()], noises, seed=3)
    drawn = found.posteriors("power-law")
    assert {name: one.sampler for name, one in drawn.items()} == {
        "iid": "exact",
        "step": "importance",
    }
    fit = rb.calibrate(planted("iid"), rb.PowerLaw(), rng=1)
    assert (fit.noise.name, fit.sampler) == ("iid", "exact")
    assert fit.error_model_weights["iid"] > fit.error_model_weights["step"] > 0.01
    assert [one.noise.name for one, _ in fit.averaged] == ["iid", "step"]


# --- the printed one ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "printed"),
    [
        ({"iid": 0.0, "texture": AS_GOOD - 0.01, "texture+step:student": 0.5}, "iid"),
        ({"iid": 0.0, "texture": AS_GOOD + 0.01, "texture+step": AS_GOOD + 0.02}, "texture"),
        ({"iid": 0.0, "texture+step": 9.0, "step-smooth": 8.5, "step-smooth:student": 9.0}, None),
        ({"texture": 3.0, "step": 3.1, "texture+step": 3.2}, "step"),
    ],
)
def test_printed__is_the_simplest_of_those_within_1_1_of_the_best(values, printed):
    found = printed_error_model(evidence_of({("modified", n): v for n, v in values.items()}))
    # Three parameters against five: sigma and two taus; sigma, tau and two lengths.
    assert found.name == (printed or "texture+step")


def test_printed__forms_are_summed_out():
    values = {
        ("classic", "iid"): 4.0,
        ("modified", "iid"): -50.0,
        ("classic", "texture"): 3.5,
        ("modified", "texture"): 5.0,
    }
    # ln mean: iid 4 - ln 2, texture 5.2 - ln 2: 1.2 apart.
    assert printed_error_model(evidence_of(values)).name == "texture"
    values["classic", "iid"] = 4.2
    assert printed_error_model(evidence_of(values)).name == "iid"


def test_printed__says_why_there_is_none():
    found = {("a", "iid"): [LogEvidence("laplace", math.nan, math.nan, "no interior mode")]}
    with pytest.raises(ComputationError, match="under any error model: no interior mode"):
        printed_error_model(evidence_table(found))


@pytest.mark.long
def test_printed__rows_without_misfit_have_shared_offsets_of_no_size():
    textures = [(0.012, 0.01), (0.022, 0.02), (0.032, 0.03)]
    rows = [
        {"a_over_R": a, "b_over_R": b, "Q": q, "p_over_E": float(rb.Modified().load(q, a, b))}
        for a, b in textures
        for q in (4, 6, 8)
    ]
    table = rb.ContactTable.from_frame(pd.DataFrame(rows))
    fit = rb.calibrate(table, rb.Modified())
    # Loads are taken to have a relative error of at least 1e-8; c is the root of one.
    assert fit.noise.factors
    assert abs(fit.draws[:, 0].mean() - 1.38) < 5e-8


# --- which are weighed, under which priors --------------------------------------------------------


def test_candidates__of_a_table_of_two_series_are_twenty():
    one, two = (error_models_for(AUTO, n) for n in (1, 2))
    assert (len(one), len(two)) == (10, 20)
    assert {noise.name for noise in two} - {noise.name for noise in one} == {
        "series",
        "series:student",
        *(
            f"{structure}+series{tail}"
            for structure in ("texture", "step", "texture+step", "step-smooth")
            for tail in ("", ":student")
        ),
    }
    assert error_models_for("texture", 1) == [Noise("texture")]
    assert error_models_for(Noise("step"), 1) == [Noise("step")]


def test_priors_of__are_the_forms_own_and_what_its_error_model_has():
    given = {
        "modified": {"c": rb.LogNormal(1.3, 0.2)},
        "hybrid": {"c2": rb.Normal(0.0, 0.1)},
        "noise": {"sigma": rb.HalfNormal(0.1), "tau_step": rb.HalfNormal(0.2)},
    }
    assert priors_of(given, rb.Modified(), Noise("texture")) == {
        "c": rb.LogNormal(1.3, 0.2),
        "sigma": rb.HalfNormal(0.1),
    }
    assert set(priors_of(given, rb.Hybrid(), Noise("step"))) == {"c2", "sigma", "tau_step"}
    assert priors_of(given, rb.Classic(), Noise()) == {"sigma": rb.HalfNormal(0.1)}
    assert priors_of(None, rb.Classic(), Noise()) == {}


def test_priors__move_the_evidences_of_those_that_have_them():
    data, noises = observations("iid"), [Noise(), Noise("texture")]
    given = {"noise": {"tau_texture": rb.HalfNormal(0.3)}}
    plain, wide = (
        weigh_error_models(data, [rb.Modified()], noises, priors=priors, seed=3)
        for priors in (None, given)
    )
    values = [
        {noise: one.evidence.value for (_, noise), one in found.candidates.items()}
        for found in (plain, wide)
    ]
    assert values[0]["iid"] == values[1]["iid"]
    # Ten times as wide about a tau that is nearly 0: a tenth of the density there.
    assert values[1]["texture"] - values[0]["texture"] == pytest.approx(-math.log(10), abs=0.5)


@pytest.mark.parametrize(
    ("priors", "message"),
    [
        ({"cubic": {}}, r"priors: expected one of hybrid, modified, noise, got 'cubic'"),
        ({"noise": {"tau_step": rb.HalfNormal(1.0)}}, r"expected one of sigma, .*got 'tau_step'"),
        ({"modified": {"c2": rb.Normal(0.0, 1.0)}}, r"c2"),
    ],
)
def test_priors__of_what_nothing_has_are_refused(priors, message):
    with pytest.raises(InputError, match=message):
        resolve_priors(
            priors, [rb.Modified(), rb.Hybrid()], [Noise("texture")], observations("iid")
        )


# --- a fit that averages --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fit():
    return rb.calibrate(planted("texture"), rb.Modified(), rng=1)


def test_calibrate__averages_by_default(fit, weighed):
    assert (fit.noise.name, fit.sampler, fit.converged) == ("texture", "importance", True)
    assert next(iter(fit.posteriors)) == "texture"
    # The evidences of the others are of another seed here: Monte Carlo.
    found = weighed("texture")
    expected = error_model_weights(found.evidence, "modified", found.posteriors("modified"))
    assert fit.error_model_weights == pytest.approx(expected, abs=0.03)
    shares = [weight for _, weight in fit.averaged]
    assert math.isclose(sum(shares), 1.0, rel_tol=1e-14)
    # Left to its twin, the Student one adds its weight to the twin's draws.
    together = fit.error_model_weights["texture"] + fit.error_model_weights["texture:student"]
    assert fit.averaged[0] == (fit, pytest.approx(together, rel=1e-14))


def test_calibrate__predictions_are_the_mixture_of_its_posteriors(fit):
    from ridgebayes.predict.predict import predict_load, predict_q

    where = (0.03, 0.02)
    load = fit.predict_load(*where, 8)
    for p in load.interval(0.6):
        parts = [w * predict_load(one, *where, 8, share=w).cdf(p) for one, w in fit.averaged]
        assert len(parts) > 1
        assert float(load.cdf(p)) == pytest.approx(float(sum(parts)), rel=1e-12)  # algebra
    p = np.geomspace(1e-3, 0.01, 5)
    for kind in ("curve", "simulation"):
        predicted = [predict_q(one, *where, p, kind=kind, share=w) for one, w in fit.averaged]
        parts = [w * q.mean() for q, (_, w) in zip(predicted, fit.averaged, strict=True)]
        np.testing.assert_allclose(fit.predict(*where, p, kind=kind).mean(), sum(parts), rtol=1e-12)
