"""Rows of two laboratories that differ as a whole: what the error models make of them."""

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations

EFFORT = {"n_draw": 512, "n_round": 3, "n_per_round": 500}


@pytest.fixture(scope="module")
def data(paper):
    """Hybrid's loads of the sweep from two series 8 % apart, each row with an error of 1 %."""
    rows = paper.calibration.frame[["a_over_R", "b_over_R", "Q"]]
    rng = np.random.default_rng(1)
    load = rb.Hybrid().load(rows["Q"], rows["a_over_R"], rows["b_over_R"], np.array([1.35, 0.01]))
    both = [
        rows.assign(series=name, p_over_E=load * factor * np.exp(0.01 * rng.standard_normal(41)))
        for name, factor in (("A", 1.0), ("B", 1.08))
    ]
    return Observations.from_table(rb.read_table(pd.concat(both, ignore_index=True)))


@pytest.fixture(scope="module")
def fitted(data):
    names = ("iid", "texture+step", "series", "texture+step+series", "step-smooth+series")
    return {
        name: importance_posterior(Model(data, rb.Hybrid(), Noise.named(name)), seed=0, **EFFORT)
        for name in names
    }


def test_evidence__of_two_series_apart_is_far_higher_with_series(fitted):
    without = max(fitted[name][1].value for name in ("iid", "texture+step"))
    for name in ("series", "texture+step+series", "step-smooth+series"):
        assert fitted[name][1].ok
        # Of 82 residuals of 1 % instead of 4 %: 82 ln 4 = 114, less what the offsets cost.
        assert fitted[name][1].value > without + 90


def test_posterior__of_two_series_apart_has_the_rows_own_error_and_the_series_spread(fitted):
    for name in ("series", "texture+step+series", "step-smooth+series"):
        summary = fitted[name][0].summary.set_index("parameter")
        # Monte Carlo: sigma of 82 rows is known to 8 %; three of these.
        assert summary.loc["sigma", "mean"] == pytest.approx(0.01, rel=0.24)
        lower, upper = summary.loc["tau_series", ["eti_lower", "eti_upper"]]
        assert lower < np.log(1.08) / 2 < upper  # the sd of two that are log 1.08 apart
    # Without series all of it is the rows' own.
    alone = fitted["iid"][0].summary.set_index("parameter").loc["sigma", "mean"]
    assert alone == pytest.approx(np.log(1.08) / 2, rel=0.2)


def test_prediction__is_of_a_new_series(fitted):
    # What two series tell of a third one: at least as uncertain as they are apart.
    posterior = fitted["series"][0]
    known = posterior.model.offsets_given(posterior.coordinates)
    mean, variance = known.at((0.022, 0.02), np.array([4, 6]))
    tau = posterior.draws[:, posterior.model.parameter_names.index("tau_series")]
    np.testing.assert_array_equal(mean, 0)
    np.testing.assert_allclose(variance, np.stack([tau**2] * 2, axis=1), rtol=1e-14)  # algebra
