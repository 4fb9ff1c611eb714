import numpy as np
import pandas as pd
import pytest
from scipy import special

from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.qmc_nodes import compress
from ridgebayes.model.forms import Hybrid, Modified
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.predict.predict import predict_q
from ridgebayes.table.table import ContactTable

LOADS = np.geomspace(5e-4, 0.02, 60)


@pytest.fixture(scope="module")
def exact(paper):
    """Half a million draws of Hybrid's posterior: their own error is 7e-4 at most."""
    model = Model(Observations.from_table(paper), Hybrid(), Noise.named("iid"))
    fit, _ = importance_posterior(model, seed=11, n_draw=131_072)
    return fit.model.to_theta(fit.chains.u.reshape(-1, 3))


def test_nodes__of_two_rows_are_finite_although_some_would_overflow():
    """So little is known that nodes far out have a coefficient that no float holds."""
    frame = pd.DataFrame({"a_over_R": 0.02, "b_over_R": 0.02, "Q": [4, 6]})
    table = ContactTable.from_frame(frame.assign(p_over_E=[8.415e-4, 3.3438e-3]))
    model = Model(Observations.from_table(table), Hybrid())
    fit, _ = importance_posterior(model, seed=1, n_draw=512)
    found = compress(model, fit.laplace, fit.chains.u.reshape(-1, 3), 2048, seed=1)
    assert np.isfinite(found.theta).all()
    assert 1900 < len(found.u) < 2048


@pytest.mark.slow
@pytest.mark.parametrize("texture", [(0.022, 0.02), (0.012, 0.09), (0.04, 0.01)])
@pytest.mark.parametrize("kind", ["simulation", "curve"])
def test_nodes__know_probabilities_to_a_thousandth(fits, exact, texture, kind):
    q = predict_q(fits["hybrid"], *texture, LOADS, kind=kind, compressed=True)
    assert 0 < q.error < 1e-3
    for Q in (4, 6, 10):
        mean = np.log(Hybrid().load(Q, *texture, exact[:, :2]))
        if kind == "curve":
            expected = np.array([(mean <= y).mean() for y in np.log(LOADS)])
        else:
            some = slice(None, None, 8)
            z = (np.log(LOADS)[:, None] - mean[some]) / exact[some, 2]
            expected = special.ndtr(z).mean(axis=1)
        # Monte Carlo of half a million draws, four standard errors; of a simulation's far smaller.
        room = 4 * np.sqrt(expected * (1 - expected) / len(exact))
        assert np.all(np.abs(q.at_least(Q) - expected) <= q.error + room + 1e-4)


def test_nodes__are_more_accurate_than_draws(fits, exact):
    mean = np.log(Hybrid().load(6, 0.012, 0.09, exact[:, :2]))
    expected = np.array([(mean <= y).mean() for y in np.log(LOADS)])
    off = [
        np.abs(
            predict_q(fits["hybrid"], 0.012, 0.09, LOADS, kind="curve", compressed=way).at_least(6)
            - expected
        ).max()
        for way in (True, False)
    ]
    assert off[0] < 0.5 * off[1]


def test_nodes__are_two_sets_of_weights_that_hold_the_posteriors_moments(fits):
    fit = fits["hybrid"]
    nodes = fit.nodes(4_096)
    np.testing.assert_allclose(nodes.weight.sum(axis=0), 1, rtol=1e-12)  # rounding
    assert not np.any((nodes.weight[:, 0] > 0) & (nodes.weight[:, 1] > 0))
    mean, sd = fit.summary["mean"].to_numpy(), fit.summary["sd"].to_numpy()
    mcse = fit.summary["mcse_mean"].to_numpy()
    for weight in nodes.weight.T:
        # The walk's own Monte Carlo error, four times, and a hundredth of an sd of the nodes'.
        assert np.all(np.abs(weight @ nodes.theta - mean) < 4 * mcse + 0.01 * sd)
        spread = np.sqrt(weight @ (nodes.theta - weight @ nodes.theta) ** 2)
        np.testing.assert_allclose(spread, sd, rtol=0.03)
    assert fit.nodes(4_096) is nodes


def test_nodes__are_refused_where_offsets_are_sampled(paper):
    model = Model(Observations.from_table(paper), Modified(), Noise.named("step:student"))
    fit, _ = importance_posterior(model, seed=1, n_draw=256, n_round=2, n_per_round=500)
    assert fit.nodes(2_048) is None
    q = predict_q(fit, 0.022, 0.02, LOADS, compressed=True)  # draws serve
    assert np.isnan(q.error)
    np.testing.assert_array_equal(q.survival, predict_q(fit, 0.022, 0.02, LOADS).survival)


def test_nodes__leave_shared_offsets_to_draws(paper):
    model = Model(Observations.from_table(paper), Hybrid(), Noise.named("step"))
    fit, _ = importance_posterior(model, seed=1, n_draw=256, n_round=2, n_per_round=500)
    assert np.isnan(predict_q(fit, 0.022, 0.02, LOADS, compressed=True).error)


@pytest.mark.parametrize("name", ["classic", "modified"])
def test_nodes__serve_each_form_of_few_coefficients(fits, name):
    for kind in ("simulation", "curve"):
        nodes = predict_q(fits[name], 0.022, 0.02, LOADS, kind=kind, compressed=True)
        draws = predict_q(fits[name], 0.022, 0.02, LOADS, kind=kind)
        n = min(nodes.survival.shape[1], draws.survival.shape[1])
        assert nodes.error < 1e-3
        # Monte Carlo of 10,240 draws of a walk, which are worth some 7,000: five standard errors.
        room = 5 * np.sqrt(draws.survival[:, :n] * (1 - draws.survival[:, :n]) / 7_000) + 2e-3
        assert np.all(np.abs(nodes.survival[:, :n] - draws.survival[:, :n]) <= room)
