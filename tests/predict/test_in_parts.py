"""Predictions from some draws at a time, where what rows tell of offsets is held for few."""

import numpy as np
import pytest

from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms import Hybrid
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.predict import predict
from ridgebayes.predict.predict import predict_load, predict_q

A, B = np.array([0.022, 0.02]), np.array([0.02, 0.016])
P = np.geomspace(1e-3, 0.02, 7)[:, None]
EFFORT = {"n_draw": 128, "n_round": 1, "n_per_round": 200, "n_point": 4}


@pytest.mark.parametrize("tabulated", [True, False])
@pytest.mark.parametrize("noise", ["step-smooth", "texture+step"])
def test_predictions__from_some_draws_at_a_time_are_those_of_all(
    paper, monkeypatch, noise, tabulated
):
    model = Model(Observations.from_table(paper), Hybrid(), Noise.named(noise))
    fit = importance_posterior(model, seed=1, **EFFORT)[0]
    whole = predict_q(fit, A, B, P), predict_load(fit, A, B, 6)
    held, worked_out = 100 * model.offsets.n_held, []
    monkeypatch.setattr(predict, "_HELD", held)
    kept = Model.offsets_given

    def noted(self, u):
        worked_out.append(len(u))
        return kept(self, u)

    monkeypatch.setattr(Model, "offsets_given", noted)
    # By a table of all textures, or part by part where that would be too large.
    monkeypatch.setattr(predict, "_TABULATED", 2**23 if tabulated else 0)
    q, load = predict_q(fit, A, B, P), predict_load(fit, A, B, 6)
    assert max(worked_out) <= 100 < len(fit.draws)
    # Algebra: the same mean; what falls with a further count is cut part by part, under 1e-6.
    n = min(q.survival.shape[-1], whole[0].survival.shape[-1])
    np.testing.assert_allclose(q.survival[..., :n], whole[0].survival[..., :n], rtol=0, atol=2e-6)
    np.testing.assert_allclose(load.quantile(0.3), whole[1].quantile(0.3), rtol=1e-9)
    assert (q.kind, q.q_calibrated_max) == (whole[0].kind, whole[0].q_calibrated_max)
    np.testing.assert_array_equal(q.extrapolation(), whole[0].extrapolation())


def test_predictions__of_a_forms_own_curve_are_made_at_once(paper, monkeypatch):
    model = Model(Observations.from_table(paper), Hybrid(), Noise.named("step-smooth"))
    fit = importance_posterior(model, seed=1, **EFFORT)[0]
    monkeypatch.setattr(predict, "_HELD", model.offsets.n_held)
    monkeypatch.delattr(Posterior, "at_draws")
    assert predict_q(fit, A, B, P, kind="curve").shape == (7, 2)
