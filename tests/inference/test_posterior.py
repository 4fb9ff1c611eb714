import pickle

import numpy as np
import pytest

from ridgebayes import Modified, PowerLaw
from ridgebayes.inference.chains import N_KEPT
from ridgebayes.inference.latent import LatentIntegral
from tests.drawn import drawn_posterior, model_of


@pytest.fixture(scope="module")
def drawn(paper):
    def make(form, noise):
        return drawn_posterior(model_of(paper, form, noise), n_draw=128, n_round=2)

    return make


@pytest.mark.slow
@pytest.mark.parametrize("name", ["power-law", "hybrid"])
def test_kept_chains__are_whole_steps_evenly_thinned(fits, name):
    fit = fits[name]
    kept = fit.kept_chains
    assert kept.u.shape[0] == 4
    assert len(fit.draws) == kept.u[..., 0].size <= N_KEPT
    few = fit.thinned(2_048)
    assert len(few.draws) == few.chains.log_density.size == 2_048
    np.testing.assert_array_equal(few.chains.u[:, 0], fit.chains.u[:, 0])
    np.testing.assert_array_equal(few.chains.u[:, -1], fit.chains.u[:, -1])
    assert few.summary is fit.summary
    assert repr(fit).startswith(f"Fit({name}, iid: ")
    assert repr(fit).endswith("; converged)")


@pytest.mark.slow
@pytest.mark.parametrize("form", [Modified(), PowerLaw()])
@pytest.mark.parametrize("noise", ["iid", "texture", "step-smooth", "step:student"])
def test_posterior__has_scores_of_all_parameters_then_of_the_error_models_offsets(
    drawn, form, noise
):
    posterior = drawn(form, noise)
    model, own = posterior.model, posterior.model.offsets.own()
    n_draw = len(posterior.draws)
    assert posterior.coordinates.shape == (n_draw, model.n_parameter + own.n_level)
    theta = model.to_theta(posterior.coordinates[:, : model.n_parameter])
    np.testing.assert_array_equal(theta, posterior.draws)
    u = posterior.coordinates[:, model.outer]
    integral, rng = LatentIntegral(model), np.random.default_rng(1)
    if integral.is_exact:
        value = integral.estimated(u, rng, 4).log_density - model.log_outer_prior(u)
        np.testing.assert_allclose(posterior.log_likelihood_of_rows, value, rtol=1e-7)
    assert posterior.rows_log_likelihood().shape == (n_draw, 41)
    offsets = posterior.shared_offsets(2)
    if noise == "iid":
        assert offsets is None
        return
    assert posterior.shared_offsets(2) is offsets
    mean, variance = offsets.at(model.data.textures[2], np.array([4, 8, 30]))
    assert mean.shape == variance.shape == (-(-n_draw // 2), 3)
    back = pickle.loads(pickle.dumps(posterior))
    assert "_derived" in vars(posterior)
    assert "_derived" not in vars(back)  # what can be worked out again
    for one, other in zip(
        back.shared_offsets(2).at((0.02, 0.02), np.array([6])),
        offsets.at((0.02, 0.02), np.array([6])),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("noise", ["texture", "texture:student"])
def test_power_laws__rows_are_as_near_to_their_draws_as_errors_allow(drawn, noise):
    """K and the texture's own offset stand in the sum that the rows have told of."""
    posterior = drawn(PowerLaw(), noise)
    model, k = posterior.model, posterior.model.n_parameter
    rates = model.log_rates(posterior.draws)
    tau = posterior.draws[:, [model.parameter_names.index("tau_texture")]]
    offset = (tau * posterior.coordinates[:, k:])[:, model.data.texture]
    left = model.rows.upper + 2 * rates[:, model.data.texture] - offset
    sigma = posterior.draws[:, [model.parameter_names.index("sigma")]]
    z = left / sigma
    # Monte Carlo: 41 rows less nine textures' offsets, in sds.
    if noise == "texture":
        assert np.sqrt((z**2).mean()) == pytest.approx(1, abs=0.05)
    assert np.median(np.abs(z)) == pytest.approx(0.6745, abs=0.15)
