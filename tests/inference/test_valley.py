import numpy as np
import pandas as pd
import pytest
from scipy.integrate import trapezoid

import ridgebayes as rb
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations

A, B, COUNTS = 0.005, 0.005, np.arange(4, 64, 2)


@pytest.fixture(scope="module")
def model():
    """Rows of one texture tell the rate to 0.05 %, and nothing of how coefficients share it."""
    errors = 0.003 * np.random.default_rng(3).standard_normal(len(COUNTS))
    load = rb.Hybrid().load(COUNTS, A, B, np.array([1.348, 0.01583])) * np.exp(errors)
    frame = pd.DataFrame({"a_over_R": A, "b_over_R": B, "Q": COUNTS, "p_over_E": load})
    return Model(Observations.from_table(rb.ContactTable.from_frame(frame)), rb.Hybrid())


@pytest.fixture(scope="module")
def laplace(model):
    return fit_laplace(model)


def evidence_by_rate(model):
    """Integrate over rate, c1 and sigma on grids: nothing of the package but priors and rows."""
    u = np.linspace(-7, 7, 1401)
    c1, _, sigma = model.to_theta(np.column_stack([u, u, u])).T
    share = (c1 / (A + B))[:, None]
    data = model.data
    z = data.log_load - 2 * np.log(COUNTS / 2 - 1)  # -2 log rate and the errors
    mean = z.mean()
    log_rate = -mean / 2 + np.linspace(-0.006, 0.006, 1201)
    # The prior's density of the log rate: c2 = a (rate - c1 / (a + b)), summed over c1.
    rate = np.exp(log_rate)[None]
    c2 = A * (rate - share)
    weight = np.exp(-(u**2) / 2) / np.sqrt(2 * np.pi)
    density = trapezoid(weight[:, None] * _normal(c2, 0.05) * A * rate, u, axis=0)
    sd = sigma[:, None]
    misfit = ((z[:, None] + 2 * log_rate) ** 2).sum(axis=0)
    log_likelihood = -misfit / (2 * sd**2) - len(z) * np.log(sd * np.sqrt(2 * np.pi))
    top = log_likelihood.max()
    inner = trapezoid(np.exp(log_likelihood - top) * density, log_rate, axis=1)
    return top + np.log(trapezoid(inner * weight, u))


def _normal(x, sd):
    return np.exp(-0.5 * (x / sd) ** 2) / (sd * np.sqrt(2 * np.pi))


def test_evidence__of_one_texture_is_that_of_grids_over_rate_and_sigma(model, laplace):
    _, evidence = importance_posterior(model, laplace, seed=1, n_draw=1024, n_round=3)
    assert evidence.ok
    assert evidence.se < 0.01
    assert abs(evidence.value - evidence_by_rate(model)) < 4 * evidence.se  # Monte Carlo


def test_valley__is_of_constant_rate_and_its_way_back_is_the_inverse(model, laplace):
    valley, z = laplace.valley, np.random.default_rng(1).standard_normal((200, 3))
    u, _ = laplace.unwhiten(z)
    np.testing.assert_allclose(laplace.whiten(u)[0], z, atol=1e-9)  # rounding over 1/2000
    s = np.linspace(-2, 2, 9)
    on_curve = valley.bent(valley.origin + s[:, None] * valley.basis[:, 0])
    theta = model.to_theta(np.column_stack([on_curve, np.zeros(9)]))
    rates = model.log_rates(theta)[:, 0]
    np.testing.assert_allclose(rates, rates[4], atol=1e-6)  # between the spline's nodes


def test_valley__there_is_none_where_rows_know_both_coefficients(laplaces):
    assert laplaces["hybrid"].valley is None
    assert laplaces["modified"].valley is None
