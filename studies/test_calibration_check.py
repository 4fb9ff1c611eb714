import functools

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.errors import ComputationError
from ridgebayes.inference.chains import Chains
from ridgebayes.inference.diagnostics import summarise
from ridgebayes.model.forms import Hybrid, Modified
from ridgebayes.model.observations import Observations
from ridgebayes.model.replicated import simulate_log_loads
from ridgebayes.results import Fit
from studies import calibration_check
from studies.calibration_check import (
    LOG_LIKELIHOOD,
    RANK_COLUMNS,
    SBC,
    sbc,
)
from tests.drawn import drawn_posterior

LOG_SIGMA = np.linspace(-14.0, 0.0, 3_000)


@pytest.fixture(scope="module")
def data():
    return Observations.from_table(rb.paper_sweep())


def exact_fit(model, *, seed, spread=1.0):
    """Draw independently from the posterior of Modified and independent normal errors.

    Given sigma log c is normal, and the rows with c integrated out have one shared error: sigma is
    drawn by inversion on a grid.
    """
    rng = np.random.default_rng([seed, 5])
    data, prior = model.data, model.priors["c"]
    a, b = data.a_over_R[data.texture], data.b_over_R[data.texture]
    # x = log c + error/2 in every row, of standard deviation sigma/2.
    x = -0.5 * (data.log_load - np.log(model.form.load(data.Q, a, b, [1.0])))
    n, rest = len(x), x - x.mean()
    variance = np.exp(2 * LOG_SIGMA) / 4
    mean_variance = variance / n + prior.log_sd**2
    log_density = (
        -0.5 * (rest @ rest) / variance
        - 0.5 * (n - 1) * np.log(variance)
        - 0.5 * (x.mean() - np.log(prior.median)) ** 2 / mean_variance
        - 0.5 * np.log(mean_variance)
        + model.priors["sigma"].log_pdf(np.exp(LOG_SIGMA))
        + LOG_SIGMA
    )
    ladder = np.cumsum(np.exp(log_density - log_density.max()))
    log_sigma = np.interp(rng.random((4, 8, 16)) * ladder[-1], ladder, LOG_SIGMA)
    variance = np.exp(2 * log_sigma) / 4
    precision = n / variance + prior.log_sd**-2
    centre = (n * x.mean() / variance + np.log(prior.median) / prior.log_sd**2) / precision
    log_c = centre + spread * rng.standard_normal(centre.shape) / np.sqrt(precision)
    theta = np.exp(np.stack([log_c, log_sigma], axis=-1))
    u = model.to_scores(theta)
    chains = Chains(u, np.zeros(u.shape[:-1]), np.ones(4), np.ones(3) / 5, ())
    return Fit(model, chains, summarise(theta[:, :1], model.parameter_names), (), seed)


def light(model, *, seed):
    """Importance sampling with fewer draws: quicker, and exact all the same."""
    return Fit.of(drawn_posterior(model, seed=seed, n_draw=128))


def run(data, form=None, noise="iid", *, n=200, fit=exact_fit, n_draw=63, **options):
    return sbc(
        data, form or Modified(), noise, n_replicate=n, rng=11, fit=fit, n_draw=n_draw, **options
    )


def test_an_exact_posterior_is_calibrated(data):
    found = run(data)
    assert found.quantities == ("c", "sigma", LOG_LIKELIHOOD)
    assert found.ranks.columns.tolist() == RANK_COLUMNS
    assert len(found.ranks) == 3 * 200
    assert set(found.ranks["n_draw"]) == {63}
    verdict = found.verdict()  # Monte Carlo: one seed in 100 would be outside
    assert (verdict.calibrated, verdict.n_used, verdict.n_failed) == (True, 200, 0)
    # Bonferroni: a hundredth shared by three.
    assert {one.prob for one in found.uniformity(0.99).values()} == {1 - (1 - 0.99) / 3}
    each = {name: one.p_value for name, one in found.uniformity().items()}
    assert verdict.p_value == min(1, 3 * min(each.values()))
    assert verdict.quantity == min(each, key=each.get)


def twice_the_noise(model, theta, rng, n=1):
    wrong = theta.copy()
    wrong[..., model.n_coefficient] *= 2
    return simulate_log_loads(model, wrong, rng, n)


def test_data_of_twice_the_noise_are_caught(data, monkeypatch):
    monkeypatch.setattr(calibration_check, "simulate_log_loads", twice_the_noise)
    found = run(data, n=60)
    verdict = found.verdict()
    assert not verdict.calibrated
    assert verdict.p_value < 1e-6
    assert str(verdict).startswith("NOT calibrated: p = ")
    assert not found.uniformity()["sigma"].inside


def test_draws_too_narrow_by_half_are_caught(data):
    # The log-likelihood sees it too.
    found = run(data, fit=functools.partial(exact_fit, spread=0.5)).uniformity()
    assert not found["c"].inside
    assert not found[LOG_LIKELIHOOD].inside
    assert found["sigma"].inside


@pytest.mark.parametrize(("form", "noise"), [(Modified(), "iid"), (Hybrid(), "texture")])
def test_importance_sampling_is_calibrated(data, form, noise):
    found = run(data, form, noise, n=20, fit=light)
    assert found.verdict(unconverged=True).p_value > 0.01  # Monte Carlo: one seed in 100


def test_failed_fits_are_counted_and_listed(data):
    calls = []

    def fails_at_times(model, *, seed):
        calls.append(seed)
        if len(calls) % 5 == 0:
            raise ComputationError("no mode")
        fit = exact_fit(model, seed=seed)
        if len(calls) % 5 == 1:
            return Fit(model, fit.chains, fit.summary, ("c: R-hat 2",), seed)
        return fit

    found = run(data, n=20, fit=fails_at_times)
    assert found.failures["reason"].tolist() == ["c: R-hat 2", "no mode"] * 4
    assert found.failures["replicate"].tolist() == [0, 4, 5, 9, 10, 14, 15, 19]
    assert len(found.ranks) == 3 * 16
    verdict = found.verdict()
    assert (verdict.n_used, verdict.n_failed) == (12, 8)
    assert not verdict.calibrated  # 40 % failed, whatever the ranks of the others
    assert all(one.inside for one in found.uniformity().values())
    assert found.uniformity(unconverged=True)["c"].n == 16
    few = SBC("modified", "iid", "walk", 200, found.ranks, found.failures)
    assert few.verdict().calibrated  # 8 of 200 are 4 %
