import numpy as np
import pytest
from scipy import stats

from ridgebayes import ComputationError, Hybrid, InputError, Modified, Noise, Normal
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.model.model import Model
from ridgebayes.model.replicated import form_log_loads, is_possible, prior_draws, simulate_log_loads
from tests import oracles
from tests.simulated import simulated

N = 40_000
# Rows 0 and 1 share a texture, 0 and 2 a step, 0 and 3 the ratio a/pitch and the step; 1 and 2 a
# series, 0 and 3 the other.
PLACES = {"texture": [0, 0, 1, 3], "Q": [4, 8, 4, 4]}
SERIES = [0, 1, 1, 0]
ETA = {
    "sigma": 0.02,
    "tau_texture": 0.03,
    "tau_step": 0.05,
    "tau_series": 0.04,
    "length_h": 0.8,
    "length_ratio": 0.3,
    "df": 6.0,
}


@pytest.fixture
def model(observed):
    def make(noise, rel_se=0.0, form=Modified):
        series = SERIES if "series" in noise else None
        data = observed(PLACES["texture"], PLACES["Q"], -6.0, rel_se=rel_se, series=series)
        return Model(data, form(), Noise.named(noise))

    return make


def theta_of(model, coefficient=1.4):
    return np.array([coefficient, *(ETA[name] for name in model.noise.parameter_names)])


def expected_covariance(model):
    """Return the covariance of the four rows, from the definitions in `Noise`."""
    own = ETA["sigma"] ** 2 + model.data.rel_se**2
    if model.noise.tail == "student":
        own *= ETA["df"] / (ETA["df"] - 2)
    return oracles.covariance(model, theta_of(model)[1:]) + np.diag(own)


@pytest.mark.parametrize("noise", [noise.name for noise in Noise.candidates(2)])
def test_loads__have_the_mean_and_covariance_of_the_error_model(model, noise):
    one = model(noise, rel_se=0.01)
    theta = theta_of(one)
    draws = simulate_log_loads(one, theta, np.random.default_rng(1), N)
    covariance = expected_covariance(one)
    centred = draws - form_log_loads(one, theta)
    sd = np.sqrt(np.diag(covariance))
    # Monte Carlo: 4.5 standard errors, four times 10 values; products of t with 6 df spread more.
    assert np.all(np.abs(centred.mean(axis=0)) < 4.5 * sd / np.sqrt(N))
    products = centred[:, :, None] * centred[:, None, :]
    error = products.std(axis=0) / np.sqrt(N)
    assert np.all(np.abs(products.mean(axis=0) - covariance) < 4.5 * error)


def test_own_errors__have_the_tail(model):
    one = model("texture:student")
    theta = theta_of(one)
    theta[2] = 1e-12  # offsets of no size: what is left is the rows' own
    draws = simulate_log_loads(one, theta, np.random.default_rng(2), N)
    z = (draws - form_log_loads(one, theta))[:, 0] / ETA["sigma"]
    assert stats.kstest(z, stats.t(ETA["df"]).cdf).pvalue > 1e-3  # Monte Carlo: 1 in 1,000
    assert stats.kstest(z, stats.norm.cdf).pvalue < 1e-6


@pytest.mark.slow
def test_loads__have_the_likelihood_of_the_model(model):
    """What is simulated is what is fitted: E exp(log p(y | other) - log p(y | truth)) = 1."""
    for noise in ("iid", "texture+step", "step-smooth", "iid:student"):
        template = model(noise, rel_se=0.01)
        theta = theta_of(template)
        other = theta * np.where(np.arange(len(theta)) == 1, 0.93, 1.005)
        ratios = []
        for row in simulate_log_loads(template, theta, np.random.default_rng(3), 400):
            one = Model(simulated(template.data, row), template.form, template.noise)
            u = one.to_scores(np.stack([theta, other]))
            values = LatentIntegral(one).estimated(u, np.random.default_rng(4), 4).log_density
            truth, wrong = values - one.log_outer_prior(u)
            ratios.append(np.exp(wrong - truth))
        # Monte Carlo: 4 standard errors.
        assert np.mean(ratios) == pytest.approx(1, abs=4 * np.std(ratios) / np.sqrt(len(ratios)))


def test_prior_draws__are_the_prior_where_rates_are_positive(observed):
    data = observed([0, 1], [4, 6], -6.0)
    wide = Model(data, Hybrid(), priors={"c2": Normal(0.0, 2.0)})
    draws = prior_draws(wide, np.random.default_rng(6), N)
    assert draws.shape == (N, 3)
    assert np.isfinite(wide.log_rates(draws)).all()
    # By hand: c1/(a + b) + c2/a > 0 for both textures.
    rng = np.random.default_rng(7)
    c1, c2 = wide.priors["c1"].rvs(rng, 4 * N), wide.priors["c2"].rvs(rng, 4 * N)
    kept = np.all([c1 / (a + b) + c2 / a > 0 for a, b in data.textures], axis=0)
    assert 0.5 < kept.mean() < 0.9
    for i, by_hand in enumerate((c1[kept], c2[kept])):
        assert stats.ks_2samp(draws[:, i], by_hand).pvalue > 1e-3  # Monte Carlo: 1 in 1,000
    assert is_possible(wide, np.array([1.4, -1.0, 0.03])).tolist() is False


def test_prior_draws__give_up_on_a_prior_without_positive_rates(observed):
    never = Model(observed([0], [4], -6.0), Hybrid(), priors={"c2": Normal(-50.0, 0.1)})
    with pytest.raises(ComputationError, match=r"0 of 2000 prior draws have positive rates"):
        prior_draws(never, np.random.default_rng(8), 2)


def test_wrong_shapes_are_refused(model):
    one = model("iid")
    with pytest.raises(
        InputError, match=r"theta: expected 2 parameters .*sigma\), got shape \(3,\)"
    ):
        simulate_log_loads(one, np.ones(3), np.random.default_rng(1))


@pytest.mark.parametrize("noise", ["texture+step", "step-smooth"])
def test_loads__of_many_parameters_each_have_their_own_offsets(model, noise):
    """Parameters keep their places on several axes, and each its own size of offsets."""
    weighed = model(noise)
    theta = np.tile(theta_of(weighed), (2, 3, 1))
    size = 10.0 ** np.arange(-3, 3).reshape(2, 3)
    for name in ("sigma", "tau_texture", "tau_step"):
        if name in weighed.noise.parameter_names:
            place = weighed.n_coefficient + weighed.noise.parameter_names.index(name)
            theta[..., place] = ETA[name] * size
    draws = simulate_log_loads(weighed, theta, np.random.default_rng(2), 2_000)
    assert draws.shape == (2_000, 2, 3, 4)
    spread = (draws - form_log_loads(weighed, theta)).std(axis=0)
    expected = size[..., None] * np.sqrt(np.diag(expected_covariance(weighed)))
    # Monte Carlo: a standard deviation of 2,000 draws to 1.6 %, the largest of 24.
    np.testing.assert_allclose(spread / expected, 1, atol=4 * 0.016)
