"""Predictions from some draws at a time, where what rows tell of offsets is held for few."""

import numpy as np

import ridgebayes as rb
from ridgebayes.predict import posterior_loads
from tests.drawn import drawn_posterior, model_of

A, B = np.array([0.022, 0.02]), np.array([0.02, 0.016])
P = np.geomspace(1e-3, 0.02, 7)[:, None]


def test_predictions__from_some_draws_at_a_time_are_those_of_all(paper, monkeypatch):
    model = model_of(paper, rb.Hybrid(), "step-smooth:student")
    fit = drawn_posterior(model, n_draw=128)
    whole = fit.predict(A, B, P), fit.predict_load(A, B, 6)
    monkeypatch.setattr(posterior_loads, "MAX_DRAWS_TIMES_ROWS", 96 * model.offsets.n_smooth**2)
    assert max(len(part) for part in posterior_loads.PosteriorLoads(fit).parts()) <= 100
    q, load = fit.predict(A, B, P), fit.predict_load(A, B, 6)
    # Algebra: the same mean; what falls with a further count is cut part by part, under 1e-6.
    n = min(q.survival.shape[-1], whole[0].survival.shape[-1])
    np.testing.assert_allclose(q.survival[..., :n], whole[0].survival[..., :n], rtol=0, atol=2e-6)
    np.testing.assert_allclose(load.quantile(0.3), whole[1].quantile(0.3), rtol=1e-9)
    assert (q.kind, q.q_calibrated_max) == (whole[0].kind, whole[0].q_calibrated_max)
    np.testing.assert_array_equal(q.extrapolation(), whole[0].extrapolation())
    assert len(list(posterior_loads.PosteriorLoads(fit, "curve").parts())) == 1
