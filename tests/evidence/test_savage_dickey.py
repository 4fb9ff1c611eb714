import numpy as np
import pytest
from scipy.special import logsumexp

from ridgebayes.distributions.distribution import LogNormal, Normal
from ridgebayes.errors import InputError
from ridgebayes.evidence import quadrature_evidence, savage_dickey
from ridgebayes.evidence.savage_dickey import _sigma_grid, _zero
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.model.forms import Hybrid, Modified
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations


def test_savage_dickey__of_the_sweep_is_the_reference_value(fits):
    found = savage_dickey(fits["hybrid"])
    # Reference: ln BF of Hybrid over Modified of the 41 rows, independent code, printed to 1e-4.
    assert found.value == pytest.approx(4.5241, abs=0.02)
    assert found.ok
    assert found.method == "savage-dickey"
    assert 0 < found.se < 0.02
    assert abs(found.value - 4.5241) < 4 * found.se  # Monte Carlo


def test_savage_dickey__is_the_difference_of_evidences_on_other_rows(
    fe_fits, fe_models, fe_laplaces
):
    # Here zero is inside the posterior of c2 and Modified is the better form.
    found = savage_dickey(fe_fits["hybrid"])
    hybrid, modified = (
        quadrature_evidence(fe_models[name].log_density, fe_laplaces[name]).value
        for name in ("hybrid", "modified")
    )
    # Monte Carlo: four standard errors, and the grid's own discretisation.
    assert found.value == pytest.approx(hybrid - modified, abs=4 * found.se + 2e-3)
    assert np.sign(found.value) == -1


def test_savage_dickey__allows_a_prior_of_c2_that_is_not_centred_on_zero(paper):
    model = Model(Observations.from_table(paper), Hybrid(), priors={"c2": Normal(0.015, 0.02)})
    found = savage_dickey(importance_posterior(model, seed=1)[0])
    hybrid = quadrature_evidence(model.log_density, fit_laplace(model)).value
    # Reference: Modified's log evidence of the 41 rows, printed to 1e-4.
    assert found.value == pytest.approx(hybrid - 78.8628, abs=4 * found.se + 2e-3)


def test_savage_dickey__refuses_another_prior_of_c1(paper):
    model = Model(Observations.from_table(paper), Hybrid(), priors={"c1": LogNormal(1.5, 0.1)})
    fit, _ = importance_posterior(model, seed=1, n_draw=128, n_round=2, n_per_round=200)
    found = savage_dickey(fit)
    assert not found.ok
    assert found.status == (
        "prior of c1: log-normal, median 1.5, log-sd 0.1, "
        "of Modified: log-normal, median 1.382, log-sd 0.1"
    )
    assert savage_dickey(fit, LogNormal(1.5, 0.1)).status != found.status


def test_savage_dickey__refuses_other_forms(fits):
    with pytest.raises(InputError, match="form: expected hybrid, got 'modified'"):
        savage_dickey(fits["modified"])


def test_savage_dickey__given_an_error_model_is_the_ratio_of_evidences(paper):
    data, noise = Observations.from_table(paper), Noise.named("texture")
    fit, hybrid = importance_posterior(Model(data, Hybrid(), noise), seed=1, n_draw=20_480)
    _, modified = importance_posterior(Model(data, Modified(), noise), seed=2)
    found = savage_dickey(fit)
    assert found.ok
    se = np.sqrt(found.se**2 + hybrid.se**2 + modified.se**2)
    assert se < 0.1
    assert abs(found.value - (hybrid.value - modified.value)) < 4 * se  # Monte Carlo


@pytest.mark.parametrize("noise", ["step", "step-smooth"])
def test_savage_dickey__says_where_no_draw_suits_the_nested_form(paper, noise):
    # Without c2 the offsets would be wider: the ratio comes out 10 to 50 too high.
    model = Model(Observations.from_table(paper), Hybrid(), Noise.named(noise))
    fit, _ = importance_posterior(model, seed=1, n_draw=1_280, n_round=4, n_per_round=500)
    found = savage_dickey(fit)
    assert not found.ok
    assert "Pareto k" in found.status


@pytest.mark.parametrize("error", [0.004, 0.02])
def test_sigma_grid__reaches_what_sigma_is_without_c2(error, observed):
    # Rows of c2 = 0.03, which lies many sds from 0: without it sigma is far above its posterior.
    texture, Q = np.repeat(np.arange(4), 5), np.tile([4, 6, 8, 10, 12], 4)
    rates = Model(observed(texture, Q, 0.0), Hybrid()).log_rates(np.array([1.4, 0.03, 0.1]))
    own = error * np.random.default_rng(1).standard_normal(20)
    load = 2 * np.log(Q / 2 - 1) - 2 * rates[texture] + own
    model = Model(observed(texture, Q, load), Hybrid())
    fit, _ = importance_posterior(model, seed=1, n_draw=128, n_round=2, n_per_round=200)
    u = fit.chains.u.reshape(-1, 3)
    zero = _zero(fit)
    covariance = np.cov(u.T)
    beta = -covariance[0, 1] / covariance[1, 1]
    w = float(np.median(u[:, 0] + beta * u[:, 1]))
    grid = _sigma_grid(fit, w, beta)
    # Where the density at c2 = 0 lies, on a grid that takes no notice of the posterior's sigma.
    sigma = np.linspace(-8, 8, 20_001)
    points = np.stack([np.full_like(sigma, w - beta * zero), np.full_like(sigma, zero), sigma])
    density = model.log_density(points.T)
    outside = (sigma < grid[0]) | (sigma > grid[-1])
    assert logsumexp(density[outside]) - logsumexp(density) < -20
