import numpy as np
import pandas as pd
import pytest
from scipy.special import logsumexp

import ridgebayes as rb
from ridgebayes.distributions.distribution import LogNormal
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.model.forms import Classic, Modified
from ridgebayes.model.observations import Observations
from studies.model_calibration_check import model_sbc
from tests.drawn import drawn_posterior

LOG_SIGMA = np.linspace(-14.0, 0.0, 3_000)
FORMS = (Classic(), Modified())
# At default priors every one of 41 rows tells the two apart: with wide errors they may not.
PRIORS = {"sigma": LogNormal(0.4, 0.5)}


@pytest.fixture(scope="module")
def data():
    return Observations.from_table(rb.paper_sweep())


def exact_evidence(model, *, seed, bonus=0.0):
    """Integrate over log c in closed form and over log sigma on a grid: normal independent rows."""
    data, prior = model.data, model.priors["c"]
    a, b = data.a_over_R[data.texture], data.b_over_R[data.texture]
    r = data.log_load - np.log(model.form.load(data.Q, a, b, [prior.median]))
    n, shared = len(r), 4 * prior.log_sd**2
    variance = np.exp(2 * LOG_SIGMA)
    misfit = (r @ r - shared * r.sum() ** 2 / (variance + n * shared)) / variance
    log_det = (n - 1) * np.log(variance) + np.log(variance + n * shared)
    log_likelihood = -0.5 * (misfit + log_det + n * np.log(2 * np.pi))
    log_prior = model.priors["sigma"].log_pdf(np.exp(LOG_SIGMA)) + LOG_SIGMA
    step = LOG_SIGMA[1] - LOG_SIGMA[0]
    value = float(logsumexp(log_likelihood + log_prior) + np.log(step))
    return LogEvidence("grid", value + bonus * (model.form.name == "classic"), 0.0)


def light(model, *, seed):
    """Importance sampling with fewer draws: quicker."""
    return drawn_posterior(model, seed=seed, n_draw=128).evidence


def test_probabilities_of_exact_evidences_are_calibrated(data):
    found = model_sbc(data, FORMS, n_replicate=400, rng=3, priors=PRIORS, weigh=exact_evidence)
    table = found.averages()
    assert table["prior"].tolist() == [0.5, 0.5]
    # Monte Carlo: 3 standard errors.
    assert np.all(np.abs(table["average"] - 0.5) < 3 * table["se"])
    assert np.all(np.abs(table["z"]) < 3)
    assert 0.02 < table["se"].max() * 20 < 0.6  # neither all sure nor all undecided
    bins = found.calibration(5)
    assert bins["n"].sum() == 2 * 400
    assert (bins["p_value"] > 0.01 / len(bins)).all()  # Monte Carlo: one seed in 100


def test_a_wrong_evidence_is_caught(data):
    def wrong(model, *, seed):
        return exact_evidence(model, seed=seed, bonus=1.0)

    found = model_sbc(data, FORMS, n_replicate=400, rng=3, priors=PRIORS, weigh=wrong)
    table = found.averages()
    assert np.all(np.abs(table["z"]) > 4)
    assert np.all(np.abs(table["average"] - 0.5) > 3 * table["se"])
    assert found.calibration(5)["p_value"].min() < 1e-3


def test_importance_sampling_gives_the_exact_probabilities(data):
    few = {"rng": 4, "n_replicate": 2, "priors": PRIORS}
    by_importance = model_sbc(data, FORMS, weigh=light, **few).probabilities
    exact = model_sbc(data, FORMS, weigh=exact_evidence, **few).probabilities
    pd.testing.assert_frame_equal(by_importance[["form", "true"]], exact[["form", "true"]])
    # Monte Carlo: log evidences are good to 0.01, 0.05 is five times that.
    np.testing.assert_allclose(by_importance["probability"], exact["probability"], atol=0.05)
