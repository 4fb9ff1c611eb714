"""Bayes factors, probabilities and scores: identities, reference numbers, and every refusal."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.comparison.bayes_factors import BAYES_FACTOR_COLUMNS, reading
from ridgebayes.comparison.ranking import factors_by_method
from ridgebayes.evidence.pairs import MIN_FORM_PROBABILITY, weigh_pairs
from ridgebayes.evidence.prior_sensitivity import scale_factors
from ridgebayes.predict.predict import load_places, predict_load, predict_q, q_places
from ridgebayes.report import render_report
from tests.drawn import model_of

# Ends at its first check, where no autocorrelation time can have settled: never converged.
QUICK = rb.SampleSettings(n_walker=16, n_step_max=100)
FORMS = (rb.Classic(), rb.PowerLaw(), rb.Modified(), rb.Hybrid())
LOO_COLUMNS = ["form", "noise", "elpd", "se", "p", "n_bad_k", "stacking_weight"]
# Log evidences of the 41 rows, tensor Gauss-Legendre quadrature to 2e-9, four decimals printed.
REFERENCE = {"hybrid": 83.3869, "modified": 78.8628, "classic": 19.1987}


@pytest.fixture(scope="module")
def pair(paper):
    """Two forms under two error models, walked too briefly."""
    few = rb.ContactTable.from_frame(paper.calibration.frame.query("Q <= 8"))
    return rb.compare(few, [rb.Hybrid(), rb.Modified()], rng=1, accuracy="quick")


def factors_of(comparison):
    rows = comparison.bayes_factors
    return {(row.form_a, row.form_b): row.ln_bf for row in rows.itertuples()}


# --- evidence -----------------------------------------------------------------------------------


def test_evidence__of_forms_out_of_reach_is_not_walked_for(comparison):
    methods = comparison.evidence.groupby("form", sort=False)["method"].agg(list).to_dict()
    # Forms of a probability under 1e-4 are not walked.
    shares = comparison.probabilities
    assert {form for form, share in shares.items() if share > MIN_FORM_PROBABILITY} == {
        "modified",
        "hybrid",
    }
    assert methods == {
        "classic": ["importance"],
        "power-law": ["importance"],
        "modified": ["importance", "bridge"],
        "hybrid": ["importance", "bridge"],
    }
    assert set(comparison.evidence["noise"]) == {"iid"}
    assert set(comparison.evidence["prior_probability"]) == {0.25}


@pytest.fixture(scope="module")
def odds(paper):
    """Two forms by rows that favour Hybrid by exp(4.5), 90 to 1: equal, and 200 to 1 against it."""
    asked = [rb.Modified(), rb.Hybrid()]
    return [
        rb.compare(paper, asked, noise="iid", rng=1, accuracy="quick", prior_odds=prior)
        for prior in (None, {"modified": 200.0})
    ]


def test_prior_odds__move_probabilities_and_averages_and_no_bayes_factor(odds):
    equal, own = odds
    assert own.prior_probabilities == pytest.approx({"modified": 200 / 201, "hybrid": 1 / 201})
    ln_bf = own.bayes_factors["ln_bf"].iloc[0]  # of Modified over Hybrid
    assert ln_bf == pytest.approx(-4.52, abs=0.05)  # Monte Carlo; 4.5241 by quadrature
    expected = 200 * math.exp(ln_bf) / (200 * math.exp(ln_bf) + 1)
    assert own.probabilities["modified"] == pytest.approx(expected, rel=1e-12)  # algebra
    assert (equal.best, own.best) == ("hybrid", "modified")
    assert [weight for _, weight in own.averaged] == pytest.approx(
        [expected, 1 - expected], rel=1e-12
    )
    pd.testing.assert_frame_equal(own.bayes_factors, equal.bayes_factors)
    assert own.verdict == equal.verdict
    place = (0.022, 0.02, 0.009)
    parts = [fit.predict(*place).at_least(8) for fit in own.fits.values()]
    mixed = expected * parts[0] + (1 - expected) * parts[1]
    assert float(own.predict(*place).at_least(8)) == pytest.approx(mixed, abs=0.01)  # Monte Carlo


def test_prior_odds__are_told_in_words_where_they_were_set(odds):
    equal, own = (render_report(one, ".md") for one in odds)
    assert "at equal prior odds" in equal
    assert "of your own" not in equal
    assert "at prior probabilities of your own, Modified 0.995 and Hybrid 0.0050" in own
    assert "**The evidence supports Hybrid among the forms compared.**" in own
    assert "at equal prior odds" not in own
    assert "Modified and Modified" not in own


@pytest.mark.parametrize(
    ("prior", "words"),
    [
        ({"classic": 2}, r"forms that are compared \(modified\), got 'classic'"),
        ({"Modified": 2}, "got 'Modified'"),
        ({"modified": 0}, "prior odds: modified: expected a finite number > 0, got 0"),
        ({"modified": math.inf}, "got inf"),
        ({"modified": math.nan}, "got nan"),
        ({"modified": "2"}, "got '2'"),
        ({"modified": True}, "got True"),
        ([2], r"prior odds: expected a mapping of forms to numbers, got \[2\]"),
    ],
)
def test_prior_odds__that_make_no_sense_are_refused(paper, prior, words):
    with pytest.raises(rb.InputError, match=words):
        rb.compare(paper, rb.Modified(), noise="iid", prior_odds=prior)


@pytest.mark.parametrize("method", ["importance", "bridge"])
def test_evidence__of_the_paper_sweep_is_the_reference(comparison, method):
    rows = comparison.evidence[comparison.evidence["method"] == method].set_index("form")
    known = set(REFERENCE) & set(rows.index)
    assert {"modified", "hybrid"} <= known
    for form in known:
        value, se = rows.loc[form, ["log_evidence", "log_evidence_se"]]
        assert 0 < se < 0.05
        # Monte Carlo: four standard errors; four printed digits.
        assert abs(value - REFERENCE[form]) < 4 * se + 1e-4, form


def test_probabilities__are_the_softmax_of_the_used_evidences(comparison):
    used = comparison.evidence[comparison.evidence["used"]].set_index("form")["log_evidence"]
    weight = {form: math.exp(value - 80.0) for form, value in used.items()}
    for form, share in comparison.probabilities.items():
        # Algebra: rounding of exponents near 60.
        assert math.isclose(share, weight[form] / sum(weight.values()), rel_tol=1e-12)
    assert math.isclose(sum(comparison.probabilities.values()), 1.0, rel_tol=1e-14)
    assert comparison.best == "hybrid"


# --- Bayes factors --------------------------------------------------------------------------------


def test_bayes_factors__one_row_per_unordered_pair(comparison):
    frame = comparison.bayes_factors
    assert list(frame) == BAYES_FACTOR_COLUMNS
    pairs = [frozenset(pair) for pair in itertools.combinations([f.name for f in FORMS], 2)]
    assert [frozenset(pair) for pair in factors_of(comparison)] == pairs
    assert set(frame["method"]) == {"importance"}


def test_bayes_factors__are_the_difference_of_the_log_evidences(comparison):
    used = comparison.evidence[comparison.evidence["used"]].set_index("form")
    for row in comparison.bayes_factors.itertuples():
        a, b = used.loc[row.form_a], used.loc[row.form_b]
        assert row.ln_bf == a["log_evidence"] - b["log_evidence"]
        assert math.isclose(row.ln_bf_se**2, a["log_evidence_se"] ** 2 + b["log_evidence_se"] ** 2)
        assert math.isclose(10.0**row.log10_bf, math.exp(row.ln_bf), rel_tol=1e-12)


def test_one_form__has_all_the_probability_and_no_factor(paper):
    alone = rb.compare(paper, [rb.Modified()], noise="iid", accuracy="quick")
    assert alone.probabilities == {"modified": 1.0}
    share = np.nextafter(1.0, 0.0)  # a sum over error models may be rounded
    rounded = alone.evidence.assign(model_probability=share)
    assert replace(alone, evidence=rounded).probabilities == {"modified": 1.0}
    assert list(alone.bayes_factors) == BAYES_FACTOR_COLUMNS
    assert len(alone.bayes_factors) == 0


# --- error models weighed first -------------------------------------------------------------------


def test_error_models__are_summed_out_and_one_is_printed(pair):
    used = pair.evidence[pair.evidence["used"]]
    assert not pair.evidence.duplicated(["form", "noise", "method"]).any()
    assert set(used.groupby("form")["noise"].nunique()) == {used["noise"].nunique()}
    assert used["noise"].nunique() > 2
    assert not used["noise"].str.endswith("student").any()  # a quick comparison
    assert math.isclose(used["model_probability"].sum(), 1.0, rel_tol=1e-12)
    factors = factors_by_method(pair, pair.best)
    assert factors["method"].tolist() == ["summed out", "importance"]
    (summed,) = pair.bayes_factors.query("noise == 'summed out'")["ln_bf"]
    assert -factors["ln_bf"].iloc[0] == pytest.approx(abs(summed), rel=1e-12)
    # The verdict's number is that of the average, not of the printed error model.
    assert pair.verdict.ln_bf == pytest.approx(abs(summed), rel=1e-12)


def test_error_models__those_of_weight_have_posteriors(pair):
    for fit in pair.fits.values():
        assert set(fit.posteriors) == {pair.noise.name, *fit.error_model_weights}
        assert math.isclose(sum(fit.error_model_weights.values()), 1.0, rel_tol=1e-12)
        assert min(fit.error_model_weights.values()) >= 0.01
        for name, one in fit.posteriors.items():
            assert one.noise.name == name


def test_error_models__priors_are_of_forms_and_of_noise(paper):
    given = {"modified": {"c": rb.LogNormal(1.3, 0.2)}, "noise": {"sigma": rb.HalfNormal(0.1)}}
    forms = [rb.Hybrid(), rb.Modified()]
    found = rb.compare(paper, forms, noise="iid", priors=given, accuracy="quick")
    seen = {name: fit.model.priors for name, fit in found.fits.items()}
    assert seen["modified"]["c"] == rb.LogNormal(1.3, 0.2)
    assert seen["modified"]["sigma"] == seen["hybrid"]["sigma"] == rb.HalfNormal(0.1)
    with pytest.raises(rb.InputError, match=r"priors: expected one of .*noise.*, got 'classic'"):
        rb.compare(paper, forms, noise="iid", priors={"classic": {}})


# --- in words -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ln_bf", "se", "words"),
    [
        (1.0, 0.0, "positive for a (Kass & Raftery)"),
        (3.0, 0.0, "strong for a (Kass & Raftery)"),
        (5.0, 0.0, "very strong for a (Kass & Raftery)"),
        (-0.999999, 0.0, "undecided"),
        (-1.0, 0.0, "positive for b (Kass & Raftery)"),
        # Within two standard errors of none, however large.
        (6.0, 3.0, "very strong for a (Kass & Raftery)"),
        (6.0, 3.000001, "undecided"),
        (-6.0, 3.000001, "undecided"),
        (math.nan, 0.1, "undecided"),
    ],
)
def test_reading__at_each_boundary(ln_bf, se, words):
    assert reading(ln_bf, se, "a", "b", None) == words


@pytest.mark.parametrize(("ln_bf", "words"), [(0.5, "undecided"), (4.0, "strong for a")])
def test_reading__ends_with_the_caution_of_the_error_model(ln_bf, words):
    text = reading(ln_bf, 0.0, "a", "b", "rows are not independent")
    assert text.startswith(words)
    assert text.endswith("; rows are not independent")


def test_iid__every_factor_carries_the_caution(comparison):
    assert comparison.bayes_factors["reading"].str.endswith("; rows are not independent").all()


# --- prior scales ---------------------------------------------------------------------------------


def test_prior_sensitivity__covers_the_factors_of_every_scale_and_form(comparison):
    frame = comparison.prior_sensitivity
    assert list(frame) == ["prior", "factor", "form", "log_evidence"]
    assert set(frame["prior"]) == {"c", "c2", "K", "sigma"}
    assert not frame.duplicated(["prior", "factor", "form"]).any()
    for prior, part in frame.groupby("prior"):
        factors = scale_factors(prior)
        assert len(part) == len(FORMS) * len(factors)
        # What is known of mechanics is doubted less: c, c1 and c2 from 0.3 times their scale.
        assert (min(factors), max(factors)) == (0.3 if prior in ("c", "c2") else 0.1, 10.0)
        assert 1.0 in factors
    assert frame["log_evidence"].notna().all()


# --- predictive scores ----------------------------------------------------------------------------


def test_loo__stacking_weights_sum_to_one_and_favour_the_best(comparison):
    weights = comparison.loo.set_index("form")["stacking_weight"]
    assert math.isclose(weights.sum(), 1.0, rel_tol=1e-12)
    assert (weights >= 0).all()
    assert weights.idxmax() == comparison.loo.set_index("form")["elpd"].idxmax() == "hybrid"


def test_loo__without_row_likelihoods_is_an_empty_table(paper, monkeypatch):
    monkeypatch.setattr("ridgebayes.inference.posterior.MAX_LOG_LIKELIHOOD_SIZE", 0)
    found = rb.compare(paper, [rb.Modified()], noise="iid", accuracy="quick")
    assert list(found.loo) == LOO_COLUMNS
    assert len(found.loo) == 0


# --- averages over forms --------------------------------------------------------------------------


def mixed(comparison, **shares):
    """Return the comparison with probabilities given by hand, so that the mix is a real one."""
    evidence = pd.DataFrame({"form": list(shares), "model_probability": list(shares.values())})
    own = evidence.assign(used=True, noise=comparison.noise.name)
    return replace(comparison, evidence=own)


def test_predict__is_the_mix_by_probability(comparison):
    fits, shares = comparison.fits, {"classic": 0.25, "hybrid": 0.75}
    p = np.geomspace(1e-4, 0.02, 7)
    q = mixed(comparison, **shares).predict(0.022, 0.02, p)
    # Each with so many of its draws as it weighs.
    alone = {f: predict_q(fits[f], q_places(0.022, 0.02, p), share=w) for f, w in shares.items()}
    for n in (4, 6, 8, 10, 12):
        parts = [w * alone[f].at_least(n) for f, w in shares.items()]
        np.testing.assert_allclose(q.at_least(n), sum(parts), rtol=1e-13, atol=0)  # algebra
    parts = [w * alone[f].mean() for f, w in shares.items()]
    np.testing.assert_allclose(q.mean(), sum(parts), rtol=1e-13)


def test_predict_load__is_the_mix_by_probability(comparison):
    fits, shares = comparison.fits, {"classic": 0.25, "hybrid": 0.75}
    load = mixed(comparison, **shares).predict_load(0.022, 0.02, Q=8)
    place = load_places(0.022, 0.02, 8)
    alone = {f: predict_load(fits[f], place, share=w) for f, w in shares.items()}
    for p in (0.004, 0.006, 0.008, 0.012):
        parts = [w * alone[f].cdf(p) for f, w in shares.items()]
        assert math.isclose(load.cdf(p), sum(parts), rel_tol=1e-12)  # algebra


# --- the record, and what goes wrong --------------------------------------------------------------


def test_complete__needs_every_form_fitted_and_converged(comparison, fits):
    assert comparison.complete
    assert not replace(comparison, failures={"classic": "no mode"}).complete
    lacking = {
        **comparison.fits,
        "hybrid": replace(fits["hybrid"], convergence_failures=("c1: too short",)),
    }
    assert not replace(comparison, fits=lacking).complete


@pytest.mark.parametrize("names", [[], ["hybrid", "classic", "hybrid"]])
def test_forms__none_or_one_twice_is_refused(paper, names):
    forms = {"hybrid": rb.Hybrid(), "classic": rb.Classic()}
    with pytest.raises(rb.InputError, match="expected one or more, without repeats"):
        rb.compare(paper, [forms[name] for name in names], noise="iid")


def test_half_plane__on_its_own_rows_is_refused_before_any_sampling(paper, monkeypatch):
    monkeypatch.setattr("ridgebayes.request.weigh_pairs", lambda *_, **__: pytest.fail("sampled"))
    with pytest.raises(rb.InputError, match=r"41 calibration rows.*that would be circular"):
        rb.compare(paper, [rb.Modified(), rb.HalfPlane()], noise="iid")


def perfect_table():
    """Rows that Modified made without misfit: its sigma runs to zero."""
    rows = [
        {"a_over_R": a, "b_over_R": b, "Q": q, "p_over_E": float(rb.Modified().load(q, a, b))}
        for a, b in [(0.012, 0.01), (0.022, 0.02), (0.032, 0.03)]
        for q in (4, 6, 8)
    ]
    return rb.ContactTable.from_frame(pd.DataFrame(rows))


def test_failure__is_named_and_the_other_forms_are_kept():
    found = rb.compare(perfect_table(), [rb.Classic(), rb.Modified()], settings=QUICK, noise="iid")
    assert set(found.failures) == {"modified"}
    assert "sigma has no lower bound" in found.failures["modified"]
    assert list(found.fits) == ["classic"] == list(found.probabilities)
    assert not found.complete
    for frame in (found.evidence, found.loo, found.prior_sensitivity):
        assert set(frame["form"]) == {"classic"}


def test_failure__of_every_form_is_an_error_that_says_each_reason():
    with pytest.raises(
        rb.ComputationError, match=r"no form has an evidence.*: modified: .*; hybrid: "
    ):
        rb.compare(perfect_table(), [rb.Modified(), rb.Hybrid()], settings=QUICK, noise="iid")


def test_unconverged__is_kept_and_says_what_is_missing(paper):
    found = rb.compare(paper, [rb.Modified()], settings=QUICK, noise="iid")
    assert isinstance(found, rb.Comparison)
    assert not found.complete
    assert found.failures == {}
    assert found.fits["modified"].convergence_failures


def test_unconverged__posteriors_that_are_averaged_count_too(paper):
    models = [model_of(paper, rb.Hybrid(), noise) for noise in ("step", "texture+step")]
    weighed = weigh_pairs(models[0].data, [rb.Hybrid()], [model.noise for model in models])
    posteriors = weighed.posteriors(["hybrid"], "step", 1_000)["hybrid"]
    lacking = replace(posteriors["texture+step"], convergence_failures=("c1: R-hat 1.2",))
    fit = rb.Fit.of(
        posteriors["step"], weighed.weights("hybrid"), posteriors | {"texture+step": lacking}
    )
    whole = rb.compare(paper, [rb.Hybrid()], settings=QUICK, noise="iid")
    found = replace(whole, fits={"hybrid": fit})
    assert found.unconverged == {"hybrid": ("texture+step: c1: R-hat 1.2",)}
    assert not found.complete


def test_seed__same_numbers_again_and_others_for_another(paper):
    def numbers(seed, forms):
        found = rb.compare(paper, forms, rng=seed, settings=QUICK, noise="iid")
        return found.evidence.set_index(["form", "method"])["log_evidence"], found

    one, first = numbers(3, [rb.Modified(), rb.Classic()])
    alone, single = numbers(3, [rb.Modified()])
    other, _ = numbers(4, [rb.Modified()])
    # A form draws from a stream of its own name, whatever it is compared with.
    assert one.loc["modified"].to_dict() == alone.loc["modified"].to_dict()
    assert first.fits["modified"].draws.tolist() == single.fits["modified"].draws.tolist()
    for method in ("importance", "bridge"):
        assert other["modified", method] != alone["modified", method]


def test_comparison__is_a_table_of_its_forms_and_a_picture(comparison):
    frame = comparison.to_dataframe()
    assert frame["form"].iloc[0] == comparison.best
    assert frame["ln_bf"].iloc[0] == 0
    assert frame["ln_bf"].is_monotonic_decreasing
    shares = dict(zip(frame["form"], frame["model_probability"], strict=True))
    assert shares == comparison.probabilities
    expected = np.exp(frame["ln_bf"]) / np.exp(frame["ln_bf"]).sum()
    np.testing.assert_allclose(frame["model_probability"], expected, rtol=1e-9)  # equal priors
    weights = comparison.loo.set_index("form")["stacking_weight"]
    assert frame.set_index("form")["stacking_weight"].to_dict() == weights.to_dict()
    axes = comparison.plot()
    assert len(axes.patches) == len(frame)
    assert comparison._repr_html_().count("<tr") == 1 + len(frame)


def test_compare__refuses_what_is_no_form_and_takes_a_single_name(paper):
    for bad in (3, [3], None):
        with pytest.raises(rb.InputError, match="form: expected a form, such as Hybrid"):
            rb.compare(paper, bad)
    with pytest.raises(rb.InputError, match="form 'nope': unknown; expected one of classic"):
        rb.compare(paper, "nope")


@pytest.mark.parametrize(
    ("forms", "best", "c", "counts"),
    [
        # c1 + c2 pitch/a is the one number that loads of one a/pitch tell of; a prior is wider.
        ([rb.Modified(), rb.Hybrid()], "hybrid", 1.95, (4, 6, 8, 10)),
        ([rb.Modified(), rb.Classic()], "classic", 0.96, (4,)),
    ],
)
def test_verdict__of_forms_that_reach_the_same_loads_is_undecided(forms, best, c, counts):
    a, Q = np.meshgrid([0.012, 0.006, 0.009], counts, indexing="ij")
    errors = 0.02 * np.sin(7.0 + np.arange(a.size)).reshape(a.shape)
    load = rb.Modified().load(Q, a, 8 * a, [c]) * np.exp(errors)
    rows = {"a_over_R": a.ravel(), "b_over_R": 8 * a.ravel(), "Q": Q.ravel()}
    table = rb.read_table(pd.DataFrame(rows | {"p_over_E": load.ravel()}))
    found = rb.compare(table, forms, noise="iid", rng=1, accuracy="quick")
    assert found.best == best
    assert found.verdict.ln_bf > 3  # at which it would be `supports`
    assert found.verdict.grade == "undecided"
    assert found.verdict.why.endswith("the same loads at all fitted rows: only their priors differ")
