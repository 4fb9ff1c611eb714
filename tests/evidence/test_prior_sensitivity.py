"""Evidences under other priors: weighted draws against evidences that are computed anew."""

import math

import numpy as np
import pytest
from scipy.special import logsumexp

import ridgebayes as rb
import ridgebayes.evidence.prior_sensitivity as prior_sensitivity_module
from ridgebayes.evidence import LogEvidence, quadrature_evidence
from ridgebayes.evidence.changed_prior import (
    NUGGET,
    Change,
    _change,
    _log_ratio,
    _of_rounds,
    prior_of,
    scale_factors,
)
from ridgebayes.evidence.prior_sensitivity import BOUNDS, SENSITIVITY_COLUMNS, prior_sensitivity
from ridgebayes.evidence.tables import evidence_table
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.pareto_smoothing import K_MAX, pareto_k
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise

TEXTURES = ((0.012, 0.03), (0.032, 0.01), (0.022, 0.02), (0.018, 0.045))


def rows(observed, *, own=0.01, offset=0.05, seed=4, smooth=False):
    """Loads of four textures that Modified made, with offsets, or a smooth misfit."""
    rng = np.random.default_rng(seed)
    texture, Q = np.repeat(np.arange(4), 4), np.tile([4, 6, 8, 10], 4)
    a, b = np.array(TEXTURES)[texture].T
    shared = offset * rng.standard_normal(4)[texture]
    if smooth:
        shared = offset * np.sin(1.5 * np.log(Q / 2 - 1) + 3 * a / (a + b))
    errors = shared + own * rng.standard_normal(16)
    return observed(texture, Q, 2 * np.log((Q / 2 - 1) * (a + b) / 1.4) + errors)


def drawn(data, noise):
    effort = {"n_draw": 1_024, "n_round": 3, "n_per_round": 512}
    return importance_posterior(Model(data, rb.Modified(), noise), seed=5, **effort)


def changes_of(posterior, value, prior):
    """Return the change of ln evidence by factor."""
    key = ("modified", posterior.noise.name)
    table = evidence_table({key: [LogEvidence("importance", value, 0.01)]})
    found = prior_sensitivity({key[0]: {key[1]: posterior}}, table)
    assert list(found) == SENSITIVITY_COLUMNS + BOUNDS
    part = found[found["prior"] == prior].set_index("factor")["log_evidence"]
    assert part[1.0] == pytest.approx(value, rel=1e-14)
    return part - value


def by_quadrature(model):
    return quadrature_evidence(model.log_density, fit_laplace(model), tol=1e-3).value


@pytest.mark.parametrize(
    ("noise", "prior", "factors"),
    [
        (Noise("texture"), "sigma", (3.0, 10.0)),
        (Noise("texture"), "c", (10.0,)),
        (Noise("iid", "student"), "df", (0.1,)),
        (Noise("iid", "student"), "sigma", (10.0,)),
    ],
)
def test_weighted_draws__give_the_change_that_quadrature_gives(observed, noise, prior, factors):
    data = rows(observed, offset=0.05 if noise.factors else 0.0)
    posterior, evidence = drawn(data, noise)
    told, model = changes_of(posterior, evidence.value, prior), posterior.model
    base = by_quadrature(model)
    x = posterior.draws[:, model.parameter_names.index(prior)]
    for factor in factors:
        wide = model.priors[prior].stretched(factor)
        truth = by_quadrature(model.with_priors({prior: wide})) - base
        ratio = wide.log_pdf(x) - model.priors[prior].log_pdf(x)
        assert pareto_k(ratio) < K_MAX  # else Laplace's approximation is used, see below
        weight = np.exp(ratio)
        # Monte Carlo: five standard errors, draws half as good as independent ones.
        error = weight.std() / weight.mean() / math.sqrt(len(x) / 2)
        assert abs(told[factor] - truth) < 5 * error + 2e-3, factor
        assert abs(truth) > 0.02  # there is something to be seen


def test_heavy_weights__are_sampled_anew(observed):
    data = rows(observed, offset=0.2)
    posterior, evidence = drawn(data, Noise("texture"))
    told, model = changes_of(posterior, evidence.value, "tau_texture"), posterior.model
    narrow = model.priors["tau_texture"].stretched(0.1)
    x = posterior.draws[:, model.parameter_names.index("tau_texture")]
    assert pareto_k(narrow.log_pdf(x) - model.priors["tau_texture"].log_pdf(x)) > K_MAX
    other = model.with_priors({"tau_texture": narrow})
    truth = by_quadrature(other) - by_quadrature(model)
    assert truth < -10
    assert abs(told[0.1] - truth) < 5 * 0.1  # Monte Carlo: standard error of 0.1


def test_heavy_weights__of_outliers_with_a_smooth_offset_are_sampled_anew(observed):
    data = rows(observed, offset=0.2, smooth=True)
    noise = Noise("step-smooth", "student")
    posterior, evidence = drawn(data, noise)
    told, model = changes_of(posterior, evidence.value, "tau_step"), posterior.model
    narrow = model.priors["tau_step"].stretched(0.1)
    x = posterior.draws[:, model.parameter_names.index("tau_step")]
    assert pareto_k(narrow.log_pdf(x) - model.priors["tau_step"].log_pdf(x)) > K_MAX
    effort = {"n_draw": 1_024, "n_round": 6, "n_per_round": 1_024}
    other = model.with_priors({"tau_step": narrow})
    _, truth = importance_posterior(other, seed=5, **effort)
    assert truth.ok
    # Monte Carlo: standard error of the change at most 0.1.
    error = math.hypot(0.1, truth.se, evidence.se)
    assert abs(told[0.1] - (truth.value - evidence.value)) < 4 * error


def test_heavy_weights__of_a_form_that_is_far_behind_are_sampled_all_the_same(observed):
    data = rows(observed, offset=0.2)
    posterior, evidence = drawn(data, Noise("texture"))
    table = evidence_table(
        {
            (form, noise): [LogEvidence("importance", evidence.value + ahead, 0.0)]
            for form, noise, ahead in (("modified", "texture", 0), ("hybrid", "texture", 50))
        }
    )
    found = prior_sensitivity({"modified": {"texture": posterior}}, table)
    key = ["form", "prior", "factor"]
    told = found.set_index(key)["log_evidence"]["modified", "tau_texture", 0.1]
    model = posterior.model
    other = model.with_priors({"tau_texture": model.priors["tau_texture"].stretched(0.1)})
    truth = by_quadrature(other) - by_quadrature(model)
    assert abs(told - evidence.value - truth) < 5 * 0.1  # Monte Carlo: standard error of 0.1


@pytest.mark.parametrize(
    ("k", "se", "share", "is_anew"),
    [
        (0.2, 0.09, 0.05, False),  # light tails, as those of a narrower half-normal
        (0.2, 0.11, 0.05, True),
        (0.4, 0.02, 0.45, True),
        (0.6, 0.01, 0.55, False),
        (0.9, 0.01, 0.55, False),
        (1.1, 0.01, 0.55, True),
        (math.inf, 0.01, 0.55, True),
    ],
)
def test_heavy_weights__are_enough_where_many_draws_count(
    observed, monkeypatch, k, se, share, is_anew
):
    posterior, evidence = drawn(rows(observed), Noise("texture"))
    look = {("c", 1.0): Change(0.0, -math.inf, 0.0, 1.0), ("c", 3.0): Change(-0.2, k, se, share)}
    monkeypatch.setattr(prior_sensitivity_module, "weighted_draws", lambda task: look)
    monkeypatch.setattr(prior_sensitivity_module, "found_anew", lambda changed: -9.0)
    told = changes_of(posterior, evidence.value, "c")
    # The error that is borne is 0.1.
    assert told[3.0] == pytest.approx(-9.0 if is_anew else -0.2, rel=1e-12)


def test_widened_prior__beyond_what_draws_reach_is_sampled_anew(observed):
    rng = np.random.default_rng(26)
    texture, Q = np.repeat([0, 1], 2), np.tile([4, 6], 2)
    a, b = np.array(TEXTURES)[texture].T
    load = 2 * np.log((Q / 2 - 1) * (a + b) / 1.4) + 0.02 * rng.standard_normal(4)
    posterior, evidence = drawn(observed(texture, Q, load), Noise("texture"))
    told, model = changes_of(posterior, evidence.value, "tau_texture"), posterior.model
    prior, base = model.priors["tau_texture"], by_quadrature(model)
    x = posterior.draws[:, model.parameter_names.index("tau_texture")]
    for factor in (3.0, 10.0):
        wide = prior.stretched(factor)
        assert pareto_k(wide.log_pdf(x) - prior.log_pdf(x)) < K_MAX  # which shows nothing
        truth = by_quadrature(model.with_priors({"tau_texture": wide})) - base
        assert abs(told[factor] - truth) < 3 * 0.1, factor  # Monte Carlo: standard error of 0.1


def test_change__tells_the_spread_of_weights():
    weights = np.array([1.0, 2.0, 3.0] * 20)
    # By hand: mean 2, sd sqrt(2/3).
    change = _change(np.log(weights))
    assert change.value == pytest.approx(math.log(2), rel=1e-14)
    assert change.se == pytest.approx(math.sqrt(2 / 3) / 2 / math.sqrt(60), rel=1e-13)
    assert change.share == pytest.approx(4 / (14 / 3), rel=1e-14)  # mean squared over mean square
    assert _change(np.zeros(60)) == (0.0, -math.inf, 0.0, 1.0)


def test_log_ratio__where_the_old_prior_is_zero_no_draw_counts(observed):
    model = Model(rows(observed), rb.Modified(), Noise("texture"))
    wider = model.priors["tau_texture"].stretched(3.0)
    other = model.with_priors({"tau_texture": wider})
    theta = np.array([[1.4, 0.02, 0.03], [np.inf, 0.02, 0.03], [1.4, np.inf, 0.03]])
    ratio = _log_ratio(other, model, theta)
    # Half-normals of sds 0.09 and 0.03: algebra.
    expected = -math.log(3) + 0.5 * (1 - 1 / 9)
    np.testing.assert_allclose(ratio, [expected, -np.inf, -np.inf], rtol=1e-12)


def test_of_rounds__is_the_mean_of_those_that_leave_the_least_variance():
    value, variance = _of_rounds([(9.0, 5.0), (1.0, 0.1), (2.0, 0.1)])
    # By hand: the first would bring 5 / 9 of its own.
    assert math.isclose(value, math.log((math.e + math.e**2) / 2), rel_tol=1e-14)
    assert math.isclose(variance, 0.05, rel_tol=1e-14)
    assert _of_rounds([(1.0, 0.1), (3.0, 0.01)]) == pytest.approx((3.0, 0.01), rel=1e-14)


def test_nugget__changes_the_evidence_as_two_evidences_say(observed):
    data = rows(observed, own=2e-6, smooth=True)
    posterior, evidence = drawn(data, Noise("step-smooth", nugget=1e-5))
    told = changes_of(posterior, evidence.value, NUGGET)
    assert told.index.tolist() == [0.1, 1.0, 10.0]
    for factor in (0.1, 10.0):
        noise = Noise("step-smooth", nugget=factor * 1e-5)
        _, other = drawn(data, noise)
        truth = other.value - evidence.value
        # Monte Carlo of both evidences and of the weights.
        assert abs(told[factor] - truth) < 5 * math.hypot(other.se, evidence.se) + 0.05, factor
    assert abs(told[10.0]) > 0.3


def test_error_models__are_summed_out_and_one_without_draws_keeps_its_evidence(observed):
    data = rows(observed)
    posterior, evidence = drawn(data, Noise("texture"))
    alone = changes_of(posterior, evidence.value, "tau_texture")
    iid = evidence.value - 0.5
    table = evidence_table(
        {
            ("modified", "iid"): [LogEvidence("quadrature", iid, 0.0)],
            ("modified", "texture"): [LogEvidence("importance", evidence.value, 0.0)],
        }
    )
    found = prior_sensitivity({"modified": {"texture": posterior}}, table)
    found = found[found["factor"].isin(alone[alone > -1].index)]  # where it is sampled as surely
    assert found["factor"].nunique() > 2
    for row in found[found["prior"] == "tau_texture"].itertuples():
        both = [iid, evidence.value + alone[row.factor]]
        assert row.log_evidence == pytest.approx(logsumexp(both) - math.log(2), rel=1e-13)


def test_student__without_draws_changes_as_its_normal_twin_does(observed):
    posterior, evidence = drawn(rows(observed), Noise("texture"))
    alone = changes_of(posterior, evidence.value, "tau_texture")
    names = ("texture", "texture:student")
    table = evidence_table(
        {("modified", name): [LogEvidence("importance", evidence.value, 0.0)] for name in names}
    )
    found = prior_sensitivity({"modified": {"texture": posterior}}, table)
    for row in found[found["prior"] == "tau_texture"].itertuples():
        assert row.log_evidence == pytest.approx(evidence.value + alone[row.factor], rel=1e-13)


def test_bounds__are_of_what_was_not_drawn(observed):
    posterior, evidence = drawn(rows(observed), Noise("texture"))
    fall = changes_of(posterior, evidence.value, "sigma")[0.1]
    assert fall < -0.5  # which is seen
    names = ("texture", "texture:student", "iid")
    table = evidence_table(
        {("modified", name): [LogEvidence("importance", evidence.value, 0.0)] for name in names}
    )
    found = prior_sensitivity({"modified": {"texture": posterior}}, table)
    row = found.set_index(["prior", "factor"]).loc["sigma", 0.1]
    # By hand, of three error models: iid is without a change, Student tails have that of normal
    # ones; left out; and nothing but what is drawn is changed.
    by_hand = {"log_evidence": [fall, fall, 0], "lower": [fall, fall], "upper": [fall, 0, 0]}
    for name, changes in by_hand.items():
        expected = evidence.value + logsumexp(changes) - math.log(3)
        assert row[name] == pytest.approx(expected, rel=1e-13), name


def test_prior_of__c1_is_c_and_all_factors_of_a_power_law_are_one():
    names = ["c", "c1", "c2", "K[a b]", "K[x[1]]", "sigma", "tau_texture", "length_ratio", "df"]
    assert [prior_of(name) for name in names] == [
        "c",
        "c",
        "c2",
        "K",
        "K",
        "sigma",
        "tau_texture",
        "length_ratio",
        "df",
    ]


@pytest.mark.parametrize(
    ("prior", "ends", "n"),
    [
        ("c", (0.3, 10.0), 4),
        ("c2", (0.3, 10.0), 4),
        ("K", (0.1, 10.0), 5),
        ("sigma", (0.1, 10.0), 5),
        ("df", (0.1, 10.0), 5),
        ("nugget", (0.1, 10.0), 3),
    ],
)
def test_scale_factors__are_wide_and_hold_the_default(prior, ends, n):
    factors = scale_factors(prior)
    assert (min(factors), max(factors), len(factors)) == (*ends, n)
    assert 1.0 in factors
