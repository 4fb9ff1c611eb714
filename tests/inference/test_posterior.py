import pickle

import numpy as np
import pandas as pd
import pytest

from ridgebayes.evidence.tables import evidences
from ridgebayes.inference.chains import N_KEPT, Chains
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms import Modified
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations


def test_repr__tells_form_numbers_and_state(fits):
    text = repr(fits["hybrid"])
    assert text.startswith("Fit(hybrid, iid: c1 = 1.337")
    assert text.endswith("; converged)")


@pytest.mark.parametrize("name", ["power-law", "hybrid"])
def test_kept_chains__are_whole_steps_evenly_thinned(fits, name):
    fit = fits[name]
    kept, n_walker = fit.kept_chains, fit.chains.u.shape[2]
    assert kept.u.shape == (4, N_KEPT // (4 * n_walker), n_walker, fit.model.n_parameter)
    assert len(fit.draws) == kept.u[..., 0].size <= N_KEPT
    everything = fit.chains.u[0, :, 0, 0]
    places = [int(np.flatnonzero(everything == x)[0]) for x in kept.u[0, :, 0, 0]]
    assert places[0] == 0
    # A walker that did not move shows at its first step.
    assert kept.u[0, -1, 0, 0] == everything[-1]
    # Evenly, up to rounding.
    assert np.all(np.diff(places) < 3 * fit.chains.n_step / len(places))
    first = fit.model.to_theta(kept.u[0, 0, 0])
    assert fit.draws[0].tolist() == first.tolist()


@pytest.mark.parametrize("noise", ["iid", "step"])
def test_posterior__hands_its_approximation_on_and_leaves_what_follows_from_it_behind(paper, noise):
    model = Model(Observations.from_table(paper), Modified(), Noise.named(noise))
    posterior, _ = importance_posterior(model, seed=1, n_draw=256, n_round=2, n_per_round=500)
    assert posterior.laplace is posterior.approximation
    stride, offsets = posterior.offsets_given(2)
    assert posterior.offsets_given(1) == (stride, offsets) == (2, offsets)
    back = pickle.loads(pickle.dumps(posterior))
    assert "_derived" in vars(posterior)
    assert "_derived" not in vars(back)
    assert back.laplace is back.approximation
    z = np.random.default_rng(2).standard_normal((5, model.n_coordinate))
    for one, other in zip(back.laplace.unwhiten(z), posterior.laplace.unwhiten(z), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)  # rounding


@pytest.mark.parametrize("noise", ["step", "texture+step", "step-smooth", "step-smooth:student"])
def test_offsets_given__in_parts_are_those_of_all_draws(paper, noise, monkeypatch):
    monkeypatch.setattr("ridgebayes.inference.posterior._AT_ONCE", 8)
    model = Model(Observations.from_table(paper), Modified(), Noise.named(noise))
    u = 0.3 * np.random.default_rng(1).standard_normal((1, 5, 4, model.n_coordinate))
    chains = Chains(u, np.zeros((1, 5, 4)), np.ones(1), np.ones(model.n_coordinate + 1), ())
    posterior = Posterior(model, chains, pd.DataFrame(), (), 0)
    _, given = posterior.offsets_given(1)
    texture, Q = model.data.textures[2], np.array([4, 8, 30])
    expected = model.offsets_given(posterior.coordinates).at(texture, Q)
    for one, other in zip(given.at(texture, Q), expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-12)  # rounding: the nugget


@pytest.mark.slow
def test_evidences__look_for_no_mode_that_sampling_has_found(fits, monkeypatch):
    def search(*_, **__):
        raise AssertionError("searched again")

    monkeypatch.setattr("ridgebayes.inference.posterior.fit_laplace", search)
    monkeypatch.setattr("ridgebayes.inference.laplace.several_modes", search)
    assert [one.method for one in evidences(fits["hybrid"])] == ["bridge", "quadrature", "laplace"]
