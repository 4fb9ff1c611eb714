"""Scores of left-out rows: closed forms, what each fold tells, and who computes."""

import pickle
from concurrent.futures import Executor, Future

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes.checks import cross_validation
from ridgebayes.checks.cross_validation import (
    CrossValidation,
    cross_validate,
    row_crps,
    stacked,
)
from ridgebayes.checks.folds import Fold, crps_of_draws
from ridgebayes.distributions.distribution import HalfNormal, LogNormal
from ridgebayes.errors import ComputationError
from ridgebayes.inference import left_out
from ridgebayes.inference.chains import Chains
from ridgebayes.inference.importance import Effort, importance_sample
from ridgebayes.inference.posterior import posterior_of
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.forms import Hybrid, Modified, PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.results import Fit

QUICK = Effort(n_round=3, n_per_round=384, n_draw=128)


def fit_at(data, form, noise, theta):
    """A posterior that is a few given points."""
    model = Model(data, form, Noise.named(noise))
    u = model.to_scores(np.asarray(theta, float))[None, None]
    chains = Chains(u, np.zeros(u.shape[:-1]), np.ones(1), np.ones(u.shape[-1]), ())
    return Fit(model, chains, pd.DataFrame(), (), 0)


def middle(data, c1, c2):
    """The hybrid's log load of each row, typed out."""
    a, b = data.a_over_R[data.texture], data.b_over_R[data.texture]
    return 2 * np.log((data.Q / 2 - 1) / (c1 / (a + b) + c2 / a))


@pytest.fixture
def data(observed):
    rng = np.random.default_rng(4)
    texture = np.repeat([0, 1, 2], [4, 3, 4])
    Q = np.array([4, 6, 8, 10, 4, 6, 8, 4, 6, 8, 12])
    rows = observed(texture, Q, np.zeros(11), rel_se=rng.choice([0.0, 0.03], 11))
    load = middle(rows, 1.35, 0.02) + 0.04 * rng.standard_normal(11)
    return observed(texture, Q, load, rel_se=rows.rel_se)


@pytest.fixture(scope="module")
def three(paper):
    """Three textures of the paper's sweep."""
    frame = paper.calibration.frame
    kept = frame["texture"].isin(["a0.012_b0.03", "a0.022_b0.02", "a0.032_b0.01"])
    return rb.ContactTable.from_frame(frame[kept])


@pytest.fixture(scope="module")
def done(three):
    return cross_validate(three, Modified(), rng=1, effort=QUICK)


THETA = np.array([[1.34, 0.018, 0.03, 0.02], [1.30, 0.030, 0.05, 0.06]])


def test_row_crps__of_exact_rows_is_that_of_the_dense_marginal(data):
    left = data.texture == 1
    fit = fit_at(data.take(~left), Hybrid(), "texture", THETA)
    own = data.take(left)
    crps = row_crps(fit, own, np.random.default_rng(1))
    mean = np.stack([middle(own, c1, c2) for c1, c2 in THETA[:, :2]])
    sd = np.sqrt((THETA[:, 2] ** 2 + THETA[:, 3] ** 2)[:, None] + own.rel_se**2)
    # CRPS of a mixture of normals in closed form (Grimit et al. 2006), pair by pair.
    pairs, spread = mean[:, None] - mean[None], np.sqrt(sd[:, None] ** 2 + sd[None] ** 2)
    expected = _gap(own.log_load - mean, sd).mean(axis=0)
    expected -= 0.5 * _gap(pairs, spread).mean(axis=(0, 1))
    # Monte Carlo: five standard errors, sd / sqrt(10,240) at most each.
    np.testing.assert_allclose(crps, expected, atol=5 * sd.max() / 100)


def _gap(mean, sd):
    """E |N(mean, sd^2)|."""
    z = mean / sd
    return mean * (2 * stats.norm.cdf(z) - 1) + 2 * sd * stats.norm.pdf(z)


def test_row_crps__of_brackets_and_counts_is_none(observed):
    texture, Q = np.repeat([0, 1], [2, 4]), np.array([4, 6, 6, 6, 2, 8])
    plain = observed(texture, Q, np.zeros(6))
    load = np.where(Q == 2, -7.0, middle(observed(texture, np.maximum(Q, 4), 0.0), 1.34, 0.018))
    bracket, count = np.arange(6) == 2, np.isin(np.arange(6), [3, 4, 5])
    low = np.where(bracket, load - 0.05, np.nan)
    data = observed(plain.texture, Q, load + 0.01, log_lower=low, is_count=count)
    fit = fit_at(data.take(data.texture == 0), Hybrid(), "iid", [[1.34, 0.018, 0.03]])
    crps = row_crps(fit, data.take(data.texture == 1), np.random.default_rng(1))
    assert np.isnan(crps).all()


def test_crps_of_draws__is_the_closed_form_of_a_normal_and_the_double_sum():
    rng = np.random.default_rng(2)
    y = np.array([-2.0, 0.1, 1.5])
    draws = rng.standard_normal((40_000, 3))
    expected = _gap(y, 1.0) - 1 / np.sqrt(np.pi)
    # Monte Carlo: five standard errors of at most 1 / sqrt(40,000).
    np.testing.assert_allclose(crps_of_draws(draws, y), expected, atol=5 / 200)
    few = draws[:7]
    pairs = np.abs(few[:, None] - few[None]).sum(axis=(0, 1)) / (2 * 7 * 6)
    np.testing.assert_allclose(
        crps_of_draws(few, y), np.abs(few - y).mean(axis=0) - pairs, rtol=1e-12
    )  # rounding


def test_cross_validate__tells_each_fold(three, done):
    frame = three.frame
    assert list(done.folds.columns) == cross_validation.FOLD_COLUMNS
    assert done.folds["fold"].tolist() == list(three.labels)
    assert done.folds["n_row"].tolist() == frame.groupby("texture", sort=False).size().tolist()
    assert set(done.folds["method"]) <= {"weights", "evidences"}
    scores, sizes = done.folds["log_score"], done.folds["n_row"]
    assert done.elpd == pytest.approx(scores.sum(), rel=1e-12)  # rounding, and below
    astray = scores - sizes * scores.sum() / sizes.sum()
    assert done.elpd_se == pytest.approx(np.sqrt(1.5 * (astray**2).sum()), rel=1e-12)
    assert done.crps.shape == (len(frame),)
    assert done.mean_crps == pytest.approx(done.crps.mean(), rel=1e-12)
    assert done.failures == {}


class Own(Modified):
    """Modified, whose coefficient has a name without a default prior."""

    @property
    def parameter_names(self):
        return ("d",)


@pytest.mark.parametrize("leave", ["texture", "step"])
def test_cross_validate__takes_an_own_form_under_its_given_priors(data, leave):
    table, own = table_of(data), {"modified": {"d": LogNormal(1.382, 0.1)}}
    known = {"modified": {"c": LogNormal(1.382, 0.1)}}
    for form, other in [
        (Own(), Modified()),
        (fit_to(data, Own(), own), fit_to(data, Modified(), known)),
    ]:
        found = cross_validate(table, form, leave=leave, rng=1, effort=QUICK, priors=own)
        expected = cross_validate(table, other, leave=leave, rng=1, effort=QUICK, priors=known)
        assert found.failures == {}
        # The same formula, draws and priors: rounding.
        np.testing.assert_allclose(found.folds["log_score"], expected.folds["log_score"], rtol=1e-9)


class PerTexture(Modified):
    """Modified with a coefficient of its own for each texture, which a fold may lose."""

    def __init__(self, textures=()):
        self.textures = textures

    @property
    def parameter_names(self):
        return tuple(f"c{a:g}" for a, _ in self.textures)

    def bind(self, textures, labels=()):
        return PerTexture(textures)

    def rate(self, theta, a_over_R, b_over_R):
        known = [a for a, _ in self.textures]  # a new texture takes the first one's
        places = [known.index(a) if a in known else 0 for a in np.ravel(a_over_R)]
        return theta[..., places]

    def log_rate_gradient(self, theta, a_over_R, b_over_R):
        return np.diag(1 / theta)


def test_cross_validate__of_a_form_with_a_coefficient_a_texture_is_by_evidences(data, monkeypatch):
    monkeypatch.setattr(left_out, "_MAX_PARETO_K", np.inf)  # other parameters alone decide
    monkeypatch.setattr(left_out, "_MIN_EFFECTIVE_SHARE", 0)
    monkeypatch.setattr(left_out, "_MIN_EFFECTIVE_DRAWS", 0)
    names = [f"c{a:g}" for a, _ in data.textures]
    priors = {"modified": dict.fromkeys(names, LogNormal(1.382, 0.1)), "noise": SIGMA}
    found = cross_validate(table_of(data), PerTexture(), rng=1, effort=QUICK, priors=priors)
    assert set(found.folds["method"]) == {"evidences"}
    assert found.failures == {}
    # The power law under the prior that this gives each K, whose slopes are integrated out.
    slopes = {
        name: LogNormal(2 * 1.382 / (a + b), 0.1)
        for name, (a, b) in zip(
            Model(data_of(data), PowerLaw()).form.parameter_names, data.textures, strict=True
        )
    }
    same = {"power-law": slopes, "noise": SIGMA}
    monkeypatch.undo()
    expected = cross_validate(table_of(data), PowerLaw(), rng=1, effort=QUICK, priors=same)
    error = np.hypot(found.folds["log_score_se"], expected.folds["log_score_se"])
    # Monte Carlo: four standard errors.
    assert (abs(found.folds["log_score"] - expected.folds["log_score"]) < 4 * error).all()


def data_of(data):
    return Observations.from_table(table_of(data))


SIGMA = {"sigma": HalfNormal(0.1)}


def table_of(data):
    """The rows as a table."""
    a, b = data.a_over_R[data.texture], data.b_over_R[data.texture]
    load = np.exp(data.log_load)
    columns = {"a_over_R": a, "b_over_R": b, "Q": data.Q, "p_over_E": load, "rel_se": data.rel_se}
    return rb.ContactTable.from_frame(pd.DataFrame(columns))


def fit_to(data, form, priors):
    """The fit to all rows of a table of theirs."""
    model = Model(Observations.from_table(table_of(data)), form, Noise(), priors["modified"])
    return Fit.of(posterior_of(model, importance_sample(ModelTarget(model), QUICK, 1), 1))


class Backwards(Executor):
    """An executor that pickles its tasks, and computes the last one first."""

    n_worker = 10  # all tasks at once

    def __init__(self, n_task):
        self.tasks, self.n_task = [], n_task

    def submit(self, function, task):
        future = Future()
        self.tasks.append((future, pickle.dumps((function, task))))
        if len(self.tasks) == self.n_task:
            for waiting, message in reversed(self.tasks):
                function, task = pickle.loads(message)
                waiting.set_result(pickle.loads(pickle.dumps(function(task))))
        return future


def test_cross_validate__does_not_depend_on_who_computes(three, done):
    other = cross_validate(three, Modified(), rng=1, effort=QUICK, executor=Backwards(3))
    np.testing.assert_array_equal(done.crps, other.crps)
    pd.testing.assert_frame_equal(done.folds, other.folds)


def test_cross_validate__counts_a_failed_fold_and_gives_no_total(three, done, monkeypatch):
    own_found = Fold.found

    def failing(fold):
        if fold.name == "a0.022_b0.02":
            raise ComputationError("no draws")
        return own_found(fold)

    monkeypatch.setattr(Fold, "found", failing)
    other = cross_validate(three, Modified(), rng=1, effort=QUICK)
    assert other.failures == {"a0.022_b0.02": "no draws"}
    own = (three.frame["texture"] == "a0.022_b0.02").to_numpy()
    assert np.isnan(other.crps[own]).all()
    np.testing.assert_array_equal(other.crps[~own], done.crps[~own])
    totals = [other.elpd, other.elpd_se, other.mean_crps]
    assert np.isnan(totals).all()
    assert stacked({"one": done, "other": other}) == {"one": 1.0, "other": 0.0}
    assert np.isnan(stacked({"other": other})["other"])


def scored(scores, folds="abc"):
    frame = pd.DataFrame({"fold": list(folds), "n_row": 2, "log_score": scores})
    return CrossValidation("hybrid", Noise(), frame, np.zeros(6), {})


def test_stacked__weighs_by_joint_scores_of_folds():
    # Two models, each right by a factor of e^5 in its own folds: the weights maximise
    # 2 log(w + (1 - w) e^-5) + log(w e^-5 + 1 - w).
    weights = stacked({"x": scored([0.0, 0.0, -5.0]), "y": scored([-5.0, -5.0, 0.0])})
    w = np.linspace(0, 1, 100_001)
    value = 2 * np.log(w + (1 - w) * np.exp(-5)) + np.log(w * np.exp(-5) + 1 - w)
    assert weights["x"] == pytest.approx(w[value.argmax()], abs=1e-4)  # the grid's step, tenfold
    assert sum(weights.values()) == pytest.approx(1, rel=1e-12)
