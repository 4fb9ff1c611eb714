import numpy as np
import pytest

from ridgebayes.distributions.distribution import LogNormal, Normal
from ridgebayes.errors import InputError
from ridgebayes.evidence import quadrature_evidence, savage_dickey
from ridgebayes.evidence.savage_dickey import (
    _averaged,
    _log_density_at_zero,
    _regression,
)
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
def test_savage_dickey__says_where_sigma_would_be_far_larger_without_c2(error, observed):
    # Rows of c2 = 0.03, which lies many sds from 0: without it sigma is far above its posterior.
    texture, Q = np.repeat(np.arange(4), 5), np.tile([4, 6, 8, 10, 12], 4)
    rates = Model(observed(texture, Q, 0.0), Hybrid()).log_rates(np.array([1.4, 0.03, 0.1]))
    own = error * np.random.default_rng(1).standard_normal(20)
    load = 2 * np.log(Q / 2 - 1) - 2 * rates[texture] + own
    model = Model(observed(texture, Q, load), Hybrid())
    fit, _ = importance_posterior(model, seed=1, n_draw=128, n_round=2, n_per_round=200)
    found = savage_dickey(fit)
    assert not found.ok
    assert "Pareto k" in found.status


@pytest.fixture
def precise(observed):
    """Return a function that makes precise rows of Modified: c2 = 0 is right."""
    textures = ((0.022, 0.02), (0.012, 0.09), (0.02, 0.03))

    def rows(counts, n_texture, error, seed):
        texture, Q = np.repeat(np.arange(n_texture), len(counts)), np.tile(counts, n_texture)
        own = error * np.random.default_rng(seed).standard_normal(len(Q))
        load = 2 * np.log((Q / 2 - 1) * np.sum(textures, axis=1)[texture] / 1.38) + own
        return observed(texture, Q, load, textures=textures[:n_texture])

    return rows


@pytest.mark.parametrize("seed", [4, 5])
def test_savage_dickey__of_few_precise_rows_is_the_difference_of_evidences(precise, seed):
    # Two textures and two coefficients: sigma reaches down to 0, and c2 is then known ever better.
    data = precise([4, 6], 2, 1e-3, seed)
    hybrid, modified = (Model(data, form) for form in (Hybrid(), Modified()))
    fit, _ = importance_posterior(hybrid, seed=1)
    found = savage_dickey(fit)
    by_quadrature = [
        quadrature_evidence(each.log_density, fit_laplace(each)).value
        for each in (hybrid, modified)
    ]
    assert found.ok
    assert found.se < 0.02
    assert abs(found.value + np.diff(by_quadrature)[0]) < 4 * found.se  # Monte Carlo


@pytest.mark.parametrize(
    ("counts", "error", "seed"), [([4, 6, 8], 1e-3, 3), ([4, 6], 1e-4, 1), ([4, 6], 1e-4, 4)]
)
def test_savage_dickey__of_precise_rows_that_share_offsets_is_the_ratio_of_evidences(
    precise, counts, error, seed
):
    # Offsets may explain all: c2 is known far better given them and sigma than it is without.
    data, noise = precise(counts, 3, error, seed), Noise.named("texture")
    fit, hybrid = importance_posterior(Model(data, Hybrid(), noise), seed=1)
    _, modified = importance_posterior(Model(data, Modified(), noise), seed=1)
    found = savage_dickey(fit)
    se = np.sqrt(found.se**2 + hybrid.se**2 + modified.se**2)
    assert found.ok
    assert se < 0.05
    assert abs(found.value - (hybrid.value - modified.value)) < 4 * se  # Monte Carlo


class _Normal:
    """A density of u1 and u2 that is normal in both, and in u2 given the line."""

    n_at_once = 1_000

    def __init__(self, slope, sd):
        self.slope, self.sd = slope, sd

    def log_density(self, u):
        across = u[..., 0] - self.slope * u[..., 1]
        return 7.0 - 0.5 * across**2 - 0.5 * ((u[..., 1] - 0.1 * across) / self.sd) ** 2


@pytest.mark.parametrize("sd", [1e-6, 1e-3, 1.0])
@pytest.mark.parametrize("wide", [0.0, 1.0])
def test_log_density_at_zero__of_a_normal_conditional_of_any_width_is_the_closed_form(sd, wide):
    rng = np.random.default_rng(3)
    across = 1e-3 * rng.standard_normal((2, 100, 1))
    mean = 0.1 * across
    u2 = mean + sd * rng.uniform(-3, 3, mean.shape)
    # One draw lies far out, so that the conditional is far narrower than all draws are.
    u2[0, 0], across[0, 0] = (1.0, 10.0) if wide else (u2[0, 0], across[0, 0])
    u = np.stack([across + 3 * u2, u2], axis=-1)
    found = _log_density_at_zero(_Normal(3.0, sd), u, np.array([3.0, 1.0]), zero=2 * sd)
    expected = -0.5 * ((2 * sd - 0.1 * across) / sd) ** 2 - 0.5 * np.log(2 * np.pi * sd**2)
    # Discretisation: steps of a third of the distance, 8e-4 at three sds and less within; rounding.
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=8e-4)
    assert abs((found - expected).mean()) < 1e-4  # discretisation: it cancels between draws


def test_savage_dickey__lines_that_lead_to_zero_cut_the_error(fits):
    fit = fits["hybrid"]
    u = fit.kept_chains.u
    plain = _averaged(_log_density_at_zero(fit.model, u, _regression(u), 0.0), 0.0)
    found = savage_dickey(fit)
    assert found.se < plain.se / 4
    assert abs(found.value - plain.value) < 4 * plain.se  # Monte Carlo


def test_averaged__takes_the_scatter_of_ensembles_where_draws_are_alike():
    # Each ensemble stays where it began: four draws, not four thousand.
    log_density = np.log(np.array([0.8, 0.9, 1.1, 1.2]))[:, None, None] + np.zeros((4, 10, 100))
    assert _averaged(log_density, 0.0).se == pytest.approx(np.std([0.8, 0.9, 1.1, 1.2]) / 3**0.5)


def test_averaged__says_where_no_draw_has_a_density():
    found = _averaged(np.full((4, 10, 1), -np.inf), 0.0)
    assert found.status == "densities at c2 = 0: no finite standard error"


def test_averaged__of_one_density_is_prior_over_posterior():
    # Data that tell nothing of c2: all draws say the same, but for errors of heavy tail.
    error = 1e-5 / np.arange(1, 401).reshape(4, 100, 1)
    found = _averaged(error - 0.5 * np.log(2 * np.pi), 0.0)
    assert found.ok
    assert found.value == pytest.approx(0, abs=1e-5)  # their largest
