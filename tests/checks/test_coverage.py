"""Coverage: counted right at known parameters, near nominal on rows of the model itself."""

from contextlib import contextmanager

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes.checks.coverage import COVERAGE_COLUMNS
from ridgebayes.checks.left_out import Fold
from ridgebayes.drawing import PROBS
from studies.coverage import coverage_of
from tests.drawn import model_of, points_of

C, SIGMA, TAU = 1.38, 0.03, 0.05


def simulated(n_texture, n_step, *, seed, tau=0.0, first=0):
    """Rows of the modified form, each texture with an offset, each row with a normal error."""
    rng = np.random.default_rng(seed)
    a = np.repeat(0.01 + 1e-5 * np.arange(first, first + n_texture), n_step)
    b, Q = 0.03, np.tile(4 + 2 * np.arange(n_step), n_texture)
    load = 2 * np.log((Q / 2 - 1) * (a + b) / C) + np.repeat(
        tau * rng.standard_normal(n_texture), n_step
    )
    load += SIGMA * rng.standard_normal(len(Q))
    frame = pd.DataFrame({"a_over_R": a, "b_over_R": b, "Q": Q, "p_over_E": np.exp(load)})
    # Loads have to rise within a curve: each row is a repeat of its own.
    return rb.ContactTable.from_frame(frame.assign(series=[f"s{i}" for i in range(len(frame))]))


def fit_at(table, noise, theta):
    """A posterior that is one point."""
    return points_of(model_of(table, rb.Modified(), noise), [theta] * 8)


@pytest.fixture(scope="module")
def table():
    return simulated(6, 8, seed=5)


@pytest.fixture(scope="module")
def found(table):
    return rb.coverage(table.frame, ["modified"], ["iid"], rng=1)


def test_coverage_of__counts_rows_within_the_normals_own_quantiles():
    fit, unseen = (
        fit_at(simulated(3, 4, seed=1), "iid", [C, SIGMA]),
        simulated(20, 3, seed=2, tau=0.03, first=50),
    )
    shown = coverage_of(fit, unseen, probs=[0.5, 0.9])
    frame = unseen.frame
    mean = 2 * np.log((frame["Q"] / 2 - 1) * (frame["a_over_R"] + frame["b_over_R"]) / C)
    z = abs(np.log(frame["p_over_E"]) - mean) / SIGMA
    assert list(shown.columns) == COVERAGE_COLUMNS
    for prob, row in zip([0.5, 0.9], shown.to_dict("records"), strict=True):
        edge = stats.norm.ppf(0.5 + prob / 2)
        inside = (z < edge).astype(float)
        assert (row["n"], row["n_texture"], row["covered"]) == (60, 20, inside.sum())
        assert row["share"] == pytest.approx(inside.mean(), rel=1e-12)  # rounding
        # Textures of one size: the textbook's error of a mean of means.
        means = inside.groupby(frame["a_over_R"]).mean()
        assert row["share_se"] == pytest.approx(means.std(ddof=1) / np.sqrt(20), rel=1e-10)
        # Convergence: quantiles are solved for to 1e-10.
        assert row["mean_width"] == pytest.approx(2 * edge * SIGMA, rel=1e-7)
        assert row["share_extrapolated"] == np.mean(frame["a_over_R"] > 0.01002)
        assert (row["n_failed"], row["failed"], row["n_unconverged"]) == (0, "", 0)


def test_coverage_of__is_nominal_on_rows_of_the_model_itself():
    fit = fit_at(simulated(3, 4, seed=1, tau=TAU), "texture", [C, SIGMA, TAU])
    unseen = simulated(250, 3, seed=3, tau=TAU, first=50)
    shown = coverage_of(fit, unseen)
    # Monte Carlo: four of the clustered standard errors, which rows alone would not give.
    assert (abs(shown["share"] - shown["prob"]) < 4 * shown["share_se"]).all()
    alone = np.sqrt(shown["prob"] * (1 - shown["prob"]) / shown["n"])
    assert (shown["share_se"] > 1.2 * alone)[:3].all()
    # Without the offset between textures bands are too narrow, and seen to be.
    bare = coverage_of(fit_at(simulated(3, 4, seed=1), "iid", [C, SIGMA]), unseen)
    assert (bare["prob"] - bare["share"] > 4 * bare["share_se"]).all()


def test_coverage__of_textures_left_out_is_nominal_on_rows_of_the_model_itself(table, found):
    assert found["prob"].tolist() == list(PROBS)
    assert (found["n"] == 48).all()
    assert (found["n_texture"] == 6).all()
    # Monte Carlo: four standard errors of 48 independent rows.
    error = 4 * np.sqrt(found["prob"] * (1 - found["prob"]) / 48)
    assert (abs(found["share"] - found["prob"]) < error).all()
    width = 2 * stats.norm.ppf(0.5 + found["prob"] / 2) * SIGMA
    # Monte Carlo: sigma is known to 11 % by 40 rows.
    np.testing.assert_allclose(found["mean_width"], width, rtol=0.35)
    assert (found["share"].diff().dropna() >= 0).all()
    assert found["share_extrapolated"].iloc[0] == pytest.approx(2 / 6)  # the two ends of a/pitch


def test_coverage__names_failed_textures_and_counts_the_rest(monkeypatch):
    own, few, stages = Fold.left_out, simulated(3, 4, seed=1), []

    def failing(fold):
        if fold.name.startswith("a0.01_"):
            raise rb.ComputationError("no draws")
        return own(fold)

    monkeypatch.setattr(Fold, "left_out", failing)

    @contextmanager
    def stage(name):
        stages.append(name)
        yield

    shown = rb.coverage(few, [rb.Modified(), rb.PowerLaw()], ["iid"], probs=[0.9], progress=stage)
    assert stages == ["modified, iid", "power-law, iid"]
    assert shown["form"].tolist() == ["modified", "power-law"]
    assert shown["n_failed"].tolist() == [1, 1]
    assert shown["failed"].iloc[0] == "a0.01_b0.03: no draws"
    assert shown[["n", "n_texture"]].iloc[0].tolist() == [8, 2]


def test_coverage__has_no_row_where_only_brackets_could_be_predicted():
    frame = simulated(2, 2, seed=1).frame
    none = rb.ContactTable.from_frame(frame.assign(p_over_E_lower=frame["p_over_E"] / 2))
    shown = rb.coverage(none, [rb.Modified()], ["iid"], probs=[0.9])
    assert shown.columns.tolist() == COVERAGE_COLUMNS
    assert shown.empty


def test_bad_input_is_refused(table):
    fit = fit_at(table, "iid", [C, SIGMA])
    with pytest.raises(rb.InputError, match=r"texture a/R = 0\.01\d*, b/R = 0\.03 was fitted"):
        coverage_of(fit, table)
    with pytest.raises(rb.InputError, match="leaving out each texture"):
        rb.coverage(simulated(1, 2, seed=1), [rb.Modified()], ["iid"])
