"""Rows left out: folds, closed forms of scores, failures, and who computes."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes import Noise
from ridgebayes.checks.left_out import (
    LEFT_OUT_COLUMNS,
    Fold,
    clustered_se,
    crps_of_draws,
    folds_of,
    left_out_scores,
    row_crps,
)
from ridgebayes.inference.importance import Effort
from ridgebayes.model.prior_files import resolve_priors
from tests.drawn import drawn_posterior, model_of, points_of

IID = Noise()
QUICK = Effort(n_round=3, n_per_round=384, n_draw=128)
SIGMA = {"sigma": rb.HalfNormal(0.1)}


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


@pytest.fixture
def few(observed):
    """Six rows of three textures."""
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
def test_folds_of__leave_out_each_row_once(few, leave, names, sizes):
    folds = folds_of(few, (rb.Hybrid(), IID), leave=leave)
    assert [fold.name for fold in folds] == names
    assert [int(fold.left.sum()) for fold in folds] == sizes
    np.testing.assert_array_equal(sum(fold.left.astype(int) for fold in folds), np.ones(6))
    by = {"texture": few.texture, "step": few.Q, "row": np.arange(6)}[leave]
    assert all(len(set(by[fold.left])) == 1 for fold in folds)


def test_folds_of__refuses_unknown_words_and_a_single_fold(few):
    with pytest.raises(
        rb.InputError, match=r"leave: expected one of texture, step, series, row, got 'fold'"
    ):
        folds_of(few, (rb.Hybrid(), IID), leave="fold")
    with pytest.raises(rb.InputError, match="leaving out each texture: expected rows of two"):
        folds_of(few.take(few.texture == 0), (rb.Hybrid(), IID))


def test_folds_of__leaves_out_a_tenth_at_a_time_of_many_textures(observed):
    textures = [(0.01 + 0.0001 * i, 0.03) for i in range(51)]
    texture = np.repeat(np.arange(51), 2)
    many = observed(texture, np.tile([4, 6], 51), np.tile([-6.3, -4.8], 51), textures=textures)
    folds = folds_of(many, (rb.Hybrid(), IID))
    assert [fold.name for fold in folds] == [f"group {i} of 10" for i in range(1, 11)]
    np.testing.assert_array_equal(sum(fold.left.astype(int) for fold in folds), np.ones(102))
    n_left = [len(set(texture[fold.left])) for fold in folds]
    assert sum(n_left) == 51  # whole textures
    assert set(n_left) == {5, 6}
    # Not one stretch of the table each, and the same ones for each form.
    assert len(set(np.flatnonzero(folds[0].left[::2]) % 10)) > 1
    others = folds_of(many, (rb.Modified(), IID))
    assert all((a.left == b.left).all() for a, b in zip(folds, others, strict=True))
    for leave, keep, n_fold in (("texture", texture < 24, 24), ("row", np.arange(102) < 50, 50)):
        assert len(folds_of(many.take(keep), (rb.Hybrid(), IID), leave=leave)) == n_fold


def test_folds_of__leaves_out_whole_series(observed):
    rows = observed([0, 0, 1, 1], [4, 6, 4, 6], -6.0, series=[0, 1, 0, 1])
    folds = folds_of(rows, (rb.Modified(), IID), leave="series", effort=QUICK)
    assert [fold.name for fold in folds] == ["a", "b"]
    assert folds[0].left.tolist() == [True, False, True, False]


def test_left_out__is_of_the_rows_that_stay_and_travels(few):
    fold = folds_of(few, (rb.Modified(), IID), seed=3, effort=QUICK)[1]
    rest = pickle.loads(pickle.dumps(fold)).left_out()
    assert rest.model.data.textures == (few.textures[0], few.textures[2])
    assert fold.rows.textures == (few.textures[1],)
    assert rest.log_score == fold.left_out().log_score
    everything = replace(fold, left=np.ones(6, dtype=bool))
    with pytest.raises(rb.ComputationError, match="no row is left to fit"):
        everything.left_out()


def test_folds_of__a_fit_take_its_draws_under_the_error_model_asked_for(few):
    fit = fit_to(few, rb.Modified(), {}, 7)
    assert folds_of(few, (fit, IID), effort=QUICK)[0].all_rows.evidence == fit.evidence
    other = folds_of(few, (fit, Noise("texture")), effort=QUICK)[0].all_rows
    assert other.model.noise.name == "texture"


def test_folds_of__keep_the_prior_of_every_slope(few):
    priors = resolve_priors(
        {"power-law": {"K": "lognormal(auto, 5 %)"}}, [rb.PowerLaw()], [IID], few
    )
    priors |= {"noise": SIGMA}
    model = folds_of(few, (rb.PowerLaw(), IID), effort=QUICK, priors=priors)[0].left_out().model
    assert model.parameter_names == ("K[a0.032_b0.01]", "K[a0.022_b0.02]", "sigma")
    assert model.priors["K[a0.032_b0.01]"].log_sd == 0.05
    assert model.priors["sigma"] == SIGMA["sigma"]


def test_clustered_se__is_of_whole_folds():
    total, n = np.array([3.0, 1.0, 8.0, 2.0]), np.full(4, 2.0)
    # Folds of one size: the textbook's standard error of a sum. Rounding.
    assert clustered_se(total, n) == pytest.approx(np.sqrt(4 * total.var(ddof=1)), rel=1e-12)
    # Folds that differ in size alone do not stray.
    assert clustered_se(np.array([1.5, 4.5]), np.array([1.0, 3.0])) == pytest.approx(0, abs=1e-12)
    assert np.isnan(clustered_se(total[:1], n[:1]))


THETA = np.array([[1.34, 0.018, 0.03, 0.02], [1.30, 0.030, 0.05, 0.06]])


def test_row_crps__of_exact_rows_is_that_of_the_dense_marginal(data):
    left = data.texture == 1
    fit = points_of(model_of(data.take(~left), rb.Hybrid(), "texture"), THETA)
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


def table_of(data):
    """The rows as a table."""
    a, b = data.a_over_R[data.texture], data.b_over_R[data.texture]
    load = np.exp(data.log_load)
    columns = {"a_over_R": a, "b_over_R": b, "Q": data.Q, "p_over_E": load, "rel_se": data.rel_se}
    return rb.ContactTable.from_frame(pd.DataFrame(columns))


def fit_to(data, form, priors, seed=1):
    """The fit to some rows."""
    model = model_of(data, form, priors=priors)
    return rb.Fit.of(drawn_posterior(model, seed=seed, n_round=3, n_per_round=384, n_draw=128))


class Own(rb.Modified):
    """Modified, whose coefficient has a name without a default prior."""

    @property
    def parameter_names(self):
        return ("d",)


def test_left_out_scores__take_an_own_form_under_its_given_priors(data):
    table, prior = table_of(data), rb.LogNormal(1.382, 0.1)
    rows, how = table, {"rng": 1, "effort": QUICK}
    own, same = {"modified": {"d": prior}}, {"modified": {"c": prior}}
    fits = fit_to(rows, Own(), own["modified"]), fit_to(rows, rb.Modified(), same["modified"])
    scores, expected = (
        left_out_scores(table, [fit], priors=priors, **how)
        for fit, priors in zip(fits, (own, same), strict=True)
    )
    # The same formula, draws and priors: rounding.
    np.testing.assert_allclose(scores["log_score"], expected["log_score"], rtol=1e-9)
    assert (scores["failed"] == "").all()


@pytest.fixture(scope="module")
def forms():
    return rb.Modified(), rb.Hybrid()


@pytest.fixture(scope="module")
def scores(fe_table, forms):
    return left_out_scores(fe_table, forms, rng=3, effort=QUICK)


def test_left_out_scores__are_sums_over_folds(scores, fe_table, forms):
    assert scores.columns.tolist() == LEFT_OUT_COLUMNS
    assert scores["form"].tolist() == ["modified", "hybrid"] * 2
    assert scores["leave"].tolist() == ["texture"] * 2 + ["step"] * 2
    for _, part in scores.groupby("leave"):
        assert part["stacking_weight"].sum() == pytest.approx(1, abs=1e-9)  # algebra
    data = model_of(fe_table, rb.Modified()).data
    for row, form in zip(scores.to_dict("records")[2:], forms, strict=True):
        folds = folds_of(data, (form, IID), leave="step", seed=3, effort=QUICK)
        total = np.array([fold.left_out().log_score for fold in folds])
        sizes = np.array([fold.left.sum() for fold in folds])
        assert row["log_score"] == pytest.approx(total.sum(), rel=1e-12)  # rounding
        assert row["log_score_se"] == pytest.approx(clustered_se(total, sizes), rel=1e-12)
        assert (row["n_fold"], row["failed"]) == (len(folds), "")


def test_left_out_scores__do_not_depend_on_who_computes(scores, fe_table):
    with ThreadPoolExecutor(2) as executor:
        again = left_out_scores(
            fe_table, [rb.Modified()], leaves=["step"], rng=3, effort=QUICK, executor=executor
        )
    same = [name for name in LEFT_OUT_COLUMNS if name != "stacking_weight"]
    pd.testing.assert_frame_equal(again[same], scores[same].iloc[2:3].reset_index(drop=True))


def test_left_out_scores__leave_out_what_there_is_one_of(fe_table):
    frame = fe_table.calibration.frame
    first = rb.ContactTable.from_frame(frame[frame["a_over_R"] == frame["a_over_R"].iloc[0]])
    scores = left_out_scores(first, [rb.Modified()], rng=3, effort=QUICK)
    assert scores["leave"].tolist() == ["step"]
    assert scores["stacking_weight"].tolist() == [1]


@pytest.mark.parametrize("failing", [["modified"], ["modified", "hybrid"]])
def test_left_out_scores__name_folds_that_failed_and_give_their_form_no_score(
    failing, fe_table, forms, monkeypatch
):
    left_out_of, first = Fold.left_out, fe_table.calibration.labels[0]

    def sometimes(fold):
        if fold.name == first and fold.all_rows.model.form.name in failing:
            raise rb.ComputationError("no draws")
        return left_out_of(fold)

    monkeypatch.setattr(Fold, "left_out", sometimes)
    scores = left_out_scores(fe_table, forms, leaves=["texture"], effort=QUICK).set_index("form")
    for name, row in scores.iterrows():
        totals = row[["log_score", "log_score_se", "mean_crps"]].isna()
        assert totals.tolist() == [name in failing] * 3
        assert row["failed"] == (f"{first}: no draws" if name in failing else "")
    weights = scores["stacking_weight"]
    assert weights.isna().all() if len(failing) == 2 else weights.tolist() == [0, 1]
