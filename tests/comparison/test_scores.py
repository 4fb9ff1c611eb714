"""Leave-one-out scores as a table: against brute force, and what is not printed."""

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.comparison.scores import LOO_COLUMNS, loo_table
from ridgebayes.inference import diagnostics
from ridgebayes.inference.diagnostics import leave_one_out
from ridgebayes.inference.left_out import AllRows
from tests.exact_evidence import power_law_evidence


@pytest.fixture(scope="module")
def fit():
    """The power law on 13 rows: 1 % errors, one of 20 %, and a texture that has a single row."""
    a = np.repeat([0.03, 0.02, 0.015, 0.05], [4, 4, 4, 1])
    b = np.repeat([0.02, 0.04, 0.015, 0.03], [4, 4, 4, 1])
    Q = np.array([*np.tile([4, 6, 8, 10], 3), 6])
    error = 0.01 * np.random.default_rng(5).standard_normal(13) + 0.2 * (np.arange(13) == 1)
    load = np.exp(np.log(rb.Modified().load(Q, a, b, [1.382])) + error)
    table = rb.ContactTable.from_frame(
        pd.DataFrame({"a_over_R": a, "b_over_R": b, "Q": Q, "p_over_E": load})
    )
    return rb.calibrate(table, rb.PowerLaw(), noise="iid", rng=1)


def test_loo_table__is_exact_leave_one_out_where_weights_are_not(fit):
    data, exact = fit.model.data, []
    medians = [fit.model.priors[name].median for name in fit.model.form.parameter_names]
    everything = power_law_evidence(data, medians)
    for row in range(13):
        rest = data.take(np.arange(13) != row)
        kept = [
            m for m, texture in zip(medians, data.textures, strict=True) if texture in rest.textures
        ]
        exact.append(everything - power_law_evidence(rest, kept))
    alone = leave_one_out(fit.rows_log_likelihood(), 1.0)
    bad = alone.pareto_k > 0.7
    assert bad.sum() >= 1
    assert abs(alone.elpd - sum(exact)) > 0.1
    (found,) = loo_table({"power-law": fit}).to_dict("records")
    assert found["n_bad_k"] == 0
    # Monte Carlo: weights of four thousand draws, and two evidences to 0.005: 0.02 a row at most.
    assert found["elpd"] == pytest.approx(sum(exact), abs=4 * 0.02)
    assert found["se"] == pytest.approx(np.sqrt(13 * np.var(exact, ddof=1)), rel=0.05)


def test_loo_table__gives_no_score_where_too_many_rows_are_not_trusted(fit, fits, monkeypatch):
    monkeypatch.setattr(diagnostics, "MAX_REFITTED_ROWS", 0)
    found = loo_table({"power-law": fit, "hybrid": fits["hybrid"]})
    assert list(found) == LOO_COLUMNS
    assert found["n_bad_k"].tolist() == [1, 0]
    given = found[["elpd", "se", "p", "stacking_weight"]].notna()
    assert given.to_numpy().tolist() == [[False] * 4, [True] * 4]
    assert found["stacking_weight"].iloc[1] == 1


def test_loo_table__gives_no_score_where_the_rest_has_no_posterior(fit, monkeypatch):
    def failing(self, left, seed):
        raise rb.ComputationError("no draws")

    monkeypatch.setattr(AllRows, "without", failing)
    found = loo_table({"power-law": fit})
    assert found["n_bad_k"].tolist() == [1]
    assert found[["elpd", "stacking_weight"]].isna().all(axis=None)


def test_loo_table__of_fits_without_rows_is_empty():
    assert loo_table({}).columns.tolist() == LOO_COLUMNS
