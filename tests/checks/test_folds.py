"""Folds leave out what they say; errors of sums over folds."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from ridgebayes.checks.cross_validation import joint_log_densities
from ridgebayes.checks.folds import Fold, clustered_se, folds_of, row_loads
from ridgebayes.distributions.distribution import HalfNormal, LogNormal
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.evidence import quadrature_evidence
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.power_law_exact import conditional_log_k
from ridgebayes.model.default_priors import slope_prior
from ridgebayes.model.forms import Hybrid, Modified, PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.prior_files import resolve_priors
from ridgebayes.predict.predict import predict_load
from ridgebayes.results import Fit

IID = Noise()
QUICK = {"n_round": 2, "n_per_round": 200, "n_draw": 128}


@pytest.fixture
def data(observed):
    texture = np.array([0, 0, 0, 1, 1, 2])
    load = [-6.3, -4.8, -4.1, -6.4, -5.1, -6.4]
    return observed(texture, [4, 6, 8, 4, 6, 4], load, rel_se=[0, 0, 0, 0.2, 0, 0])


@pytest.mark.parametrize(
    ("leave", "names", "sizes"),
    [
        ("texture", ["a0.012_b0.03", "a0.032_b0.01", "a0.022_b0.02"], [3, 2, 1]),
        ("step", ["Q = 4", "Q = 6", "Q = 8"], [3, 2, 1]),
        ("row", [f"row {i}" for i in range(1, 7)], [1] * 6),
    ],
)
def test_folds_of__leave_out_each_row_once(data, leave, names, sizes):
    folds = folds_of(data, Hybrid(), IID, leave=leave)
    assert [fold.name for fold in folds] == names
    assert [int(fold.left.sum()) for fold in folds] == sizes
    np.testing.assert_array_equal(sum(fold.left.astype(int) for fold in folds), np.ones(6))
    by = {"texture": data.texture, "step": data.Q, "row": np.arange(6)}[leave]
    assert all(len(set(by[fold.left])) == 1 for fold in folds)


def test_model__of_a_fold_keeps_the_prior_of_every_slope(data):
    priors = resolve_priors({"power-law": {"K": "lognormal(auto, 5 %)"}}, [PowerLaw()], [IID], data)
    fold = folds_of(data, PowerLaw(), IID, priors=priors)[0]
    model = fold.model(data.take(~fold.left))
    assert model.parameter_names[:-1] == ("K[a0.032_b0.01]", "K[a0.022_b0.02]")
    assert model.priors["K[a0.032_b0.01]"].log_sd == 0.05
    assert slope_prior(data.textures[0], model.prior_of_slopes).log_sd == 0.05


def test_folds_of__gives_each_a_seed_of_its_own_names(data, observed):
    folds = folds_of(data, Hybrid(), IID, seed=1)
    others = [
        *folds_of(data, Hybrid(), IID, seed=2),
        *folds_of(data, Modified(), IID, seed=1),
        *folds_of(data, Hybrid(), Noise("texture"), seed=1),
    ]
    assert len({fold.seed for fold in [*folds, *others]}) == 12
    fewer = folds_of(data.take(data.texture < 2), Hybrid(), IID, seed=1)
    assert [fold.seed for fold in fewer] == [fold.seed for fold in folds[:2]]


def test_folds_of__refuses_unknown_words_and_a_single_fold(data):
    with pytest.raises(InputError, match=r"leave: expected one of texture, step, row, got 'fold'"):
        folds_of(data, Hybrid(), IID, leave="fold")
    with pytest.raises(InputError, match="expected rows of at least two"):
        folds_of(data.take(data.texture == 0), Hybrid(), IID)


def test_folds_of__leaves_out_a_tenth_at_a_time_of_many_textures(observed):
    textures = [(0.01 + 0.0001 * i, 0.03) for i in range(51)]
    texture = np.repeat(np.arange(51), 2)
    many = observed(texture, np.tile([4, 6], 51), np.tile([-6.3, -4.8], 51), textures=textures)
    folds = folds_of(many, Hybrid(), IID)
    assert [fold.name for fold in folds] == [f"group {i} of 10" for i in range(1, 11)]
    np.testing.assert_array_equal(sum(fold.left.astype(int) for fold in folds), np.ones(102))
    n_left = [len(set(texture[fold.left])) for fold in folds]
    assert sum(n_left) == 51  # whole textures
    assert set(n_left) == {5, 6}
    # Not one stretch of the table each, and the same ones for each form.
    assert len(set(np.flatnonzero(folds[0].left[::2]) % 10)) > 1
    others = folds_of(many, Modified(), IID)
    assert all((a.left == b.left).all() for a, b in zip(folds, others, strict=True))
    for leave, keep, n_fold in (("texture", texture < 24, 24), ("row", np.arange(102) < 50, 50)):
        assert len(folds_of(many.take(keep), Hybrid(), IID, leave=leave)) == n_fold


def test_refit__draws_a_power_law_of_very_many_textures_exactly(observed):
    textures = [(0.01 + 0.0001 * i, 0.03) for i in range(51)]
    texture = np.repeat(np.arange(51), 2)
    load = np.random.default_rng(1).normal(-5, 0.3, 102)
    many = observed(texture, np.tile([4, 6], 51), load, textures=textures)
    fit, evidence = folds_of(many, PowerLaw(), IID)[0].refit()
    assert evidence.method == "quadrature"
    assert len(fit.model.data.textures) == 45
    expected, drawn = conditional_log_k(fit.model, fit.draws[:, -1])[0], np.log(fit.draws[:, :-1])
    # Monte Carlo: five standard errors of a mean, of independent draws.
    se = (drawn - expected).std(axis=0) / np.sqrt(len(drawn))
    assert (np.abs((drawn - expected).mean(axis=0)) < 5 * se).all()


def test_refit__is_the_fit_of_the_rows_that_stay(data):
    fold = folds_of(data, Modified(), IID, seed=3, effort=QUICK)[1]
    fit, evidence = pickle.loads(pickle.dumps(fold)).refit()
    rest = Model(data.take(data.texture != 1), Modified(), IID)
    expected, value = importance_posterior(rest, seed=fold.seed, **QUICK)
    assert fit.model.data.textures == (data.textures[0], data.textures[2])
    np.testing.assert_array_equal(fit.draws, expected.draws)
    assert evidence == value
    with pytest.raises(ComputationError, match="no row is left to fit"):
        Fold("all", data, np.ones(6, dtype=bool), Modified(), IID, 0).refit()


def test_refit__is_under_the_priors_that_are_given_of_what_its_rows_tell(data):
    data = replace(data, labels=("x", "y", "z"))
    wide, sigma = LogNormal(80.0, 0.5), HalfNormal(0.2)
    given = {"power-law": {f"K[{label}]": wide for label in "xyz"}, "noise": {"sigma": sigma}}
    fold = folds_of(data, PowerLaw(), IID, effort=QUICK, priors=given)[1]
    fit, _ = fold.refit()
    assert fit.model.priors == {"K[x]": wide, "K[z]": wide, "sigma": sigma}


@pytest.fixture(scope="module")
def rows(observed):
    """Modified's loads with errors of 3 %: no texture weighs much alone."""
    texture, Q = np.repeat(np.arange(4), 6), np.tile(np.arange(4, 16, 2), 4)
    flat = observed(texture, Q, np.zeros(24))
    a, b = flat.a_over_R[texture], flat.b_over_R[texture]
    error = 0.03 * np.random.default_rng(1).standard_normal(24)
    return observed(texture, Q, np.log(Modified().load(Q, a, b, [1.38])) + error)


def test_weighted__is_the_fit_of_the_rows_that_stay(rows):
    prior = {"c": LogNormal(1.38, 0.02)}
    full, _ = importance_posterior(Model(rows, Modified(), IID, prior), seed=1)
    for fold in folds_of(rows, Fit.of(full), IID, priors={"modified": prior}):
        found, (fit, _) = pickle.loads(pickle.dumps(fold)).weighted(), fold.refit()
        assert fit.model.priors == found.posterior.model.priors == full.model.priors
        density = np.exp(joint_log_densities(fit, rows))
        se = density.std() / density.mean() / np.sqrt(len(density))
        # Monte Carlo: four standard errors, and of means three of a hundred effective draws.
        off = found.log_score - np.log(density.mean())
        assert abs(off) < 4 * np.hypot(se, found.log_score_se)
        away = found.posterior.draws.mean(axis=0) - fit.draws.mean(axis=0)
        assert (np.abs(away) < 0.3 * fit.draws.std(axis=0)).all()


TWO = ((0.022, 0.02), (0.012, 0.09))
TEXTURE = Noise("texture")


@pytest.fixture(scope="module")
def few(observed):
    """Six loads of two textures: without those of a count the posterior is far wider."""
    rng = np.random.default_rng(11)
    texture, Q = np.repeat([0, 1], 3), np.tile([4, 6, 8], 2)
    a, b = np.array(TWO)[texture].T
    load = np.log(Modified().load(Q, a, b, [1.4]))
    load += 0.02 * rng.standard_normal(6) + 0.02 * rng.standard_normal(2)[texture]
    return observed(texture, Q, load, textures=TWO)


def test_weighted__is_none_where_the_rest_tells_far_less(few):
    effort = {"n_draw": 512, "n_round": 3, "n_per_round": 512}
    full, _ = importance_posterior(Model(few, Modified(), TEXTURE), seed=1, **effort)
    by_draws = []
    for fold in folds_of(few, Fit.of(full), TEXTURE, leave="step", effort=effort):
        found, truth = (
            fold.weighted(),
            by_quadrature(full.model) - by_quadrature(fold.model(few.take(~fold.left))),
        )
        if found is None:
            density = np.exp(joint_log_densities(fold.refit()[0], few))
            value = np.log(density.mean())
            se = density.std() / density.mean() / np.sqrt(len(density))
        else:
            value, se = found.log_score, found.log_score_se
        by_draws.append(found is None)
        # Monte Carlo: four standard errors, of independent draws.
        assert abs(value - truth) < 4 * se + 0.02, fold.name
    assert by_draws[0]


def test_refit__searches_where_few_draws_given_all_rows_count(few, monkeypatch):
    full, _ = importance_posterior(Model(few, Modified(), TEXTURE), seed=1, **QUICK)
    fold = folds_of(few, Fit.of(full), TEXTURE, leave="step", effort=QUICK)[1]
    told = fold.told
    for share, is_search in [(0.19, True), (0.21, False)]:
        monkeypatch.setattr(Fold, "told", replace(told, share=share))
        found, anew = (replace(fold, known=one).refit()[0] for one in (fold.known, None))
        assert np.array_equal(found.draws, anew.draws) == is_search


def by_quadrature(model):
    return quadrature_evidence(model.log_density, fit_laplace(model), tol=1e-3).value


@pytest.fixture(scope="module")
def brackets(rows, observed):
    """The same loads, each known to 2 %: shared offsets have no closed form."""
    return observed(rows.texture, rows.Q, rows.log_load, log_lower=rows.log_load - 0.02)


@pytest.mark.parametrize(("noise", "by_weights"), [("step", True), ("texture+step", False)])
def test_folds__of_sampled_offsets_need_no_search_and_agree_with_one(
    brackets, noise, by_weights, monkeypatch
):
    noise, effort = Noise.named(noise), QUICK | {"n_draw": 384, "n_point": 16}
    model, enough = Model(brackets, Modified(), noise), effort | {"n_draw": 768}
    full, _ = importance_posterior(model, seed=1, **enough)
    assert full.converged
    fold = folds_of(brackets, Fit.of(full), noise, effort=effort)[1]
    anew, evidence = replace(fold, known=None).refit()
    with monkeypatch.context() as patch:
        patch.setattr("ridgebayes.inference.importance_sampling.fit_laplace", None)
        found, near = fold.refit()
        weighted = fold.weighted()
    # Monte Carlo: four standard errors, and of means three of a hundred effective draws.
    assert abs(near.value - evidence.value) < 4 * np.hypot(near.se, evidence.se)
    assert (weighted is not None) == by_weights
    for fit in [found] + ([weighted.posterior] if by_weights else []):
        away = fit.draws.mean(axis=0) - anew.draws.mean(axis=0)
        assert (np.abs(away) < 0.3 * anew.draws.std(axis=0)).all()
        loads = [row_loads(one, brackets).interval(0.5)[0] for one in (fit, anew)]
        np.testing.assert_allclose(*loads, rtol=0.01)  # Monte Carlo: a third of a load's sd
    if by_weights:
        density = np.exp(joint_log_densities(anew, brackets))
        se = density.std() / density.mean() / np.sqrt(len(density))
        off = weighted.log_score - np.log(density.mean())
        assert abs(off) < 4 * np.hypot(se, weighted.log_score_se)


def test_refit__searches_where_draws_lie_elsewhere(rows, observed):
    astray = observed(rows.texture, rows.Q, rows.log_load + 0.05)
    full, _ = importance_posterior(Model(astray, Modified(), IID), seed=1)
    fold = folds_of(rows, Fit.of(full), IID, effort=QUICK)[0]
    found, evidence = fold.refit()
    anew, expected = replace(fold, known=None).refit()
    assert evidence == expected
    np.testing.assert_array_equal(found.draws, anew.draws)


def test_refit__needs_no_rounds_where_a_coefficient_is_of_the_rows_left_out(rows, monkeypatch):
    full, _ = importance_posterior(Model(rows, PowerLaw(), IID), seed=1)
    fold = folds_of(rows, Fit.of(full), IID)[1]
    anew, expected = replace(fold, known=None).refit()
    with monkeypatch.context() as patch:
        patch.setattr("ridgebayes.inference.importance_sampling.adapted", None)
        found, evidence = fold.refit()
    assert found.model.parameter_names == anew.model.parameter_names
    # Monte Carlo: four standard errors, and of means three of a hundred effective draws.
    assert abs(evidence.value - expected.value) < 4 * np.hypot(evidence.se, expected.se)
    away = found.draws.mean(axis=0) - anew.draws.mean(axis=0)
    assert (np.abs(away) < 0.3 * anew.draws.std(axis=0)).all()


def test_weighted__is_none_where_draws_cannot_tell(rows, observed):
    loads = rows.log_load + np.where(rows.texture == 0, 0.5, 0.0)  # which c goes for
    astray = observed(rows.texture, rows.Q, loads)
    for data, form, noise in [
        (astray, Modified(), IID),
        (rows, PowerLaw(), IID),  # a K of the left-out texture alone
    ]:
        full, _ = importance_posterior(Model(data, form, noise), seed=1)
        assert folds_of(data, Fit.of(full), noise)[0].weighted() is None
    assert folds_of(rows, Modified(), IID)[0].weighted() is None


def test_row_loads__adds_the_rows_known_error(data):
    fit = folds_of(data, Modified(), IID, effort=QUICK)[1].refit()[0]
    left = data.take(data.texture == 1)
    load, bare = row_loads(fit, left), predict_load(fit, 0.032, 0.01, np.array([4, 6]))
    np.testing.assert_array_equal(load.log_mean, bare.log_mean)
    np.testing.assert_allclose(load.sd**2 - bare.sd**2, [[0.04, 0]] * len(load.sd), atol=1e-12)
    further = row_loads(fit, left, left.Q + 2)
    np.testing.assert_array_equal(further.log_mean[:, 0], bare.log_mean[:, 1])


def test_clustered_se__is_of_whole_folds():
    total, n = np.array([3.0, 1.0, 8.0, 2.0]), np.full(4, 2.0)
    # Folds of one size: the textbook's standard error of a sum. Rounding.
    assert clustered_se(total, n) == pytest.approx(np.sqrt(4 * total.var(ddof=1)), rel=1e-12)
    # Folds that differ in size alone do not stray.
    assert clustered_se(np.array([1.5, 4.5]), np.array([1.0, 3.0])) == pytest.approx(0, abs=1e-12)
    assert np.isnan(clustered_se(total[:1], n[:1]))
