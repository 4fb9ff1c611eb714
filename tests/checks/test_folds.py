"""Folds leave out what they say; errors of sums over folds."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from ridgebayes.checks.folds import clustered_se, folds_of, row_loads
from ridgebayes.distributions.distribution import HalfNormal, LogNormal
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.inference.importance import Effort, importance_sample
from ridgebayes.inference.posterior import posterior_of
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.default_priors import slope_prior
from ridgebayes.model.forms import Hybrid, Modified, PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.prior_files import resolve_priors
from ridgebayes.predict.predict import predict_load
from ridgebayes.results import Fit

IID = Noise()
QUICK = Effort(n_round=2, n_per_round=256, n_draw=128)


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
    with pytest.raises(
        InputError, match=r"leave: expected one of texture, step, series, row, got 'fold'"
    ):
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


def test_folds_of__leaves_out_whole_series(observed):
    rows = observed([0, 0, 1, 1], [4, 6, 4, 6], -6.0, series=[0, 1, 0, 1])
    folds = folds_of(rows, Modified(), IID, leave="series", effort=QUICK)
    assert [fold.name for fold in folds] == ["a", "b"]
    assert folds[0].left.tolist() == [True, False, True, False]


def test_found__is_of_the_rows_that_stay_and_travels(data):
    fold = folds_of(data, Modified(), IID, seed=3, effort=QUICK)[1]
    found = pickle.loads(pickle.dumps(fold)).found()
    assert found.model.data.textures == (data.textures[0], data.textures[2])
    assert fold.rows.textures == (data.textures[1],)
    assert found.log_score == fold.found().log_score
    everything = replace(fold, left=np.ones(6, dtype=bool))
    with pytest.raises(ComputationError, match="no row is left to fit"):
        everything.found()


def test_folds_of__a_fit_take_its_draws_under_the_error_model_asked_for(data):
    drawn = folds_of(data, Modified(), IID, effort=QUICK)[0].known
    model = Model(data, Modified(), IID)
    fit = Fit.of(posterior_of(model, importance_sample(ModelTarget(model), QUICK, 7), 7))
    known = folds_of(data, fit, IID, effort=QUICK)[0].known
    assert known.evidence == fit.evidence != drawn.evidence
    other = folds_of(data, fit, Noise("texture"), effort=QUICK)[0].known
    assert other.model.noise.name == "texture"


def test_folds_of__are_under_the_priors_that_are_given(data):
    data = replace(data, labels=("x", "y", "z"))
    wide, sigma = LogNormal(80.0, 0.5), HalfNormal(0.2)
    given = {"power-law": {f"K[{label}]": wide for label in "xyz"}, "noise": {"sigma": sigma}}
    found = folds_of(data, PowerLaw(), IID, effort=QUICK, priors=given)[1].found()
    assert found.model.priors == {"K[x]": wide, "K[z]": wide, "sigma": sigma}


def test_folds_of__keep_the_prior_of_every_slope(data):
    priors = resolve_priors({"power-law": {"K": "lognormal(auto, 5 %)"}}, [PowerLaw()], [IID], data)
    model = folds_of(data, PowerLaw(), IID, effort=QUICK, priors=priors)[0].found().model
    assert model.parameter_names[:-1] == ("K[a0.032_b0.01]", "K[a0.022_b0.02]")
    assert model.priors["K[a0.032_b0.01]"].log_sd == 0.05
    assert slope_prior(data.textures[0], model.prior_of_slopes).log_sd == 0.05


def test_row_loads__adds_the_rows_known_error(data):
    fit = folds_of(data, Modified(), IID, effort=QUICK)[1].found().posterior(1)
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
