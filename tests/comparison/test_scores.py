"""Leave-one-out scores as a table: what is printed of fits whose scores are not to be trusted."""

import numpy as np
import pytest

from ridgebayes.comparison import scores
from ridgebayes.inference.diagnostics import Loo, stacking_weights


class FakeFit:
    """What the table asks of a fit; itself in place of its rows' likelihoods."""

    def __init__(self, loo):
        self.loo = loo
        self.noise = type("N", (), {"name": "iid"})

    def rows_log_likelihood(self):
        return self


def fit_of(seed, n_bad):
    pointwise = np.random.default_rng(seed).standard_normal(10)
    k = np.where(np.arange(10) < n_bad, 0.9, 0.1)
    return FakeFit(Loo(float(pointwise.sum()), 1.0, 2.0, pointwise, k))


@pytest.fixture
def table_of(monkeypatch):
    monkeypatch.setattr(scores, "_left_out", lambda fit, rows: fit.loo)
    return scores.loo_table


def test_loo_table__gives_no_score_where_rows_are_not_trusted(table_of):
    fits = {"a": fit_of(1, 0), "b": fit_of(2, 3), "c": fit_of(3, 0)}
    found = table_of(fits)
    assert list(found) == scores.LOO_COLUMNS
    assert found["form"].tolist() == ["a", "b", "c"]
    assert found["n_bad_k"].tolist() == [0, 3, 0]
    given = found[["elpd", "se", "p", "stacking_weight"]].notna()
    assert given.to_numpy().tolist() == [[True] * 4, [False] * 4, [True] * 4]
    sound = np.stack([fits[name].loo.pointwise for name in "ac"])
    assert found["stacking_weight"].dropna().tolist() == stacking_weights(sound).tolist()


def test_loo_table__of_no_trusted_score_has_rows_and_no_numbers(table_of):
    found = table_of({"a": fit_of(1, 10)})
    assert found["n_bad_k"].tolist() == [10]
    assert found[["elpd", "stacking_weight"]].isna().all(axis=None)
