"""Tables that strangers bring validate, and the Hybrid form finds the truth that made them."""

import numpy as np
import pytest

import ridgebayes as rb
from tests.tables_in_the_wild import tables

N_TABLE = 29  # made when the first test asks, not when tests are collected
SHORT = rb.SampleSettings(n_walker=16, n_step_max=100)


def named(name):
    return next(one for one in tables() if one.name == name)


def test_tables__are_of_what_their_notes_say():
    assert len({one.name for one in tables()}) == len(tables()) == N_TABLE
    assert len(named("millimetres").table) == 24
    assert named("millimetres").table.textures[0] == (0.03125, 0.03125)
    assert len(named("two-hundred-rows").table.textures) == 20
    assert len(named("sixty-textures").table.textures) == len(named("sixty-textures").table) == 60
    kinds = named("all-kinds").table.frame
    assert set(kinds["kind"]) == {"transition", "count"}
    assert 0 < kinds["p_over_E_lower"].notna().sum() < len(kinds)
    assert len(named("off-centre-held-out").table.held_out) == 6
    assert set(named("two-series").table.column("series")) == {"first", "second"}
    assert set(named("two-sources").table.column("series")) == {""}


# Every fourth table, one of each kind or nearly so, and all of them among the long tests.
@pytest.mark.slow
@pytest.mark.parametrize(
    "i", [pytest.param(i, marks=[pytest.mark.long] if i % 4 else []) for i in range(N_TABLE)]
)
def test_calibrate__finds_what_made_the_table(i):
    one = tables()[i]
    fit = rb.calibrate(one.table, rb.Hybrid(), noise="iid", rng=1, settings=SHORT)
    assert np.isfinite(fit.draws).all()
    if one.form == "hybrid":
        mean, sd = fit.summary[["mean", "sd"]].to_numpy().T
        # Monte Carlo: five posterior standard deviations, those of rows taken as independent.
        assert np.all(np.abs(mean[:2] - one.coefficients) < 5 * sd[:2])
        assert mean[2] > 0.5 * one.errors["sigma"]
