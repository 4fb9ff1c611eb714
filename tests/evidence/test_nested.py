import sys

import numpy as np
import pytest
from scipy import stats

from ridgebayes.distributions.distribution import HalfNormal, LogNormal
from ridgebayes.errors import InputError
from ridgebayes.evidence import quadrature_evidence
from ridgebayes.evidence.nested import nested_evidence
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.model.forms import Hybrid, Modified
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise

TEXTURE = np.array([0, 0, 0, 1, 1, 1])
Q = np.array([4, 6, 8, 4, 6, 8])
WIDTH = 0.004  # of a bracket in log load: narrow beside the errors of 0.05 and more
# Offsets that the evidence depends on: a prior as wide as they are.
WIDE = {"tau_texture": HalfNormal(0.5), "tau_step": HalfNormal(0.5)}
SHARED = {
    "iid": np.zeros(6),
    "texture": np.repeat([0.8, -0.6], 3),
    "step": np.tile([1.0, -0.6, 0.2], 2),
}


def narrow(observed, structure="iid"):
    """Rows as narrow brackets, and as their middles; no load is known to better than 5 %."""
    own = np.array([0.05, 0.02, 0.04, -0.08, -0.02, -0.06])
    middle = 2 * np.log((Q / 2 - 1) * 0.042 / 1.38) + own + SHARED[structure]
    brackets = observed(TEXTURE, Q, middle + WIDTH / 2, rel_se=0.05, log_lower=middle - WIDTH / 2)
    return brackets, observed(TEXTURE, Q, middle, rel_se=0.05)


def sharing(data, structure, tail="normal"):
    noise = Noise(structure, tail)
    priors = {name: WIDE[name] for name in WIDE if name in noise.parameter_names}
    return Model(data, Modified(), noise, priors)


def quadrature(model):
    found = quadrature_evidence(model.log_density, fit_laplace(model), tol=1e-4)
    assert found.ok
    return found.value


def nested(model, seed=1, n_live=100, **options):
    return nested_evidence(model, rng=np.random.default_rng(seed), n_live=n_live, **options)


@pytest.mark.parametrize("form", [Modified(), Hybrid()], ids=lambda form: form.name)
def test_nested_evidence__of_plain_rows_is_the_quadrature(form, observed):
    model = Model(narrow(observed)[1], form)
    found = nested(model)
    assert found.ok
    assert found.method == "dynesty"
    assert 0.02 < found.se < 0.3
    assert found.value == pytest.approx(quadrature(model), abs=3 * found.se)  # Monte Carlo


def test_nested_evidence__of_offsets_integrated_out_is_the_quadrature(observed):
    model = sharing(narrow(observed, "texture")[1], "texture")
    assert not model.is_latent
    found = nested(model)
    assert found.value == pytest.approx(quadrature(model), abs=3 * found.se)  # Monte Carlo


@pytest.mark.long
@pytest.mark.parametrize("structure", ["texture", "step"])
def test_nested_evidence__of_sampled_offsets_is_the_quadrature_of_narrow_brackets(
    structure, observed
):
    # The probability of a narrow bracket is the density at its middle times the width; and with
    # exact rows the offsets have a closed form.
    brackets, middles = narrow(observed, structure)
    model = sharing(brackets, structure)
    assert model.is_latent
    exact = quadrature(sharing(middles, structure))
    found = nested(model)
    # Monte Carlo; the bracket's curvature, (width / 0.05)^2 / 24 a row, is 2e-3 in all.
    assert found.value == pytest.approx(exact + len(Q) * np.log(WIDTH), abs=3 * found.se)


@pytest.mark.long
def test_nested_evidence__of_student_errors_with_offsets_is_that_in_whitened_coordinates(observed):
    model = sharing(narrow(observed, "texture")[1], "texture", "student")
    assert model.is_latent
    found, importance = nested(model), importance_posterior(model, seed=1)[1]
    assert importance.ok
    se = np.hypot(found.se, importance.se)
    assert found.value == pytest.approx(importance.value, abs=3 * se)  # Monte Carlo


@pytest.mark.parametrize("tail", ["normal", "student"])
def test_latent__likelihood_is_that_of_rows_moved_by_the_sum_of_their_offsets(tail, observed):
    is_count = np.array([False, False, True, True, False, True])
    load = narrow(observed)[1].log_load
    rows = observed(TEXTURE, Q, load, rel_se=0.05, is_count=is_count)
    model = sharing(rows, "texture+step", tail)
    assert model.is_latent
    c, sigma, tau_texture, tau_step, df = 1.41, 0.07, 0.3, 0.2, 3.5
    scores = np.array([0.4, -1.1, 0.9, -0.3, 1.7, 0.6])  # of two textures; of Q = 4, 6, 8, 10
    assert model.n_coordinate == model.n_parameter + len(scores)
    theta = np.array([c, sigma, tau_texture, tau_step, *([df] if tail == "student" else [])])
    u = np.concatenate([model.to_unconstrained(theta), scores])
    found = float(model.log_density(u) - stats.norm.logpdf(u).sum())

    error = stats.t(df) if tail == "student" else stats.norm()
    scale = np.hypot(sigma, 0.05)

    def misfit(texture, Q, load):
        offset = tau_texture * scores[texture] + tau_step * scores[2 + Q // 2 - 2]
        return (load - 2 * np.log((Q / 2 - 1) * 0.042 / c) - offset) / scale

    expected = 0.0
    for texture, number, x, counted in zip(TEXTURE, Q, load, is_count, strict=True):
        if counted:  # Q is reached at this load, and Q + 2 is not
            high, low = misfit(texture, number, x), misfit(texture, number + 2, x)
            expected += np.log(error.cdf(high) - error.cdf(min(low, high)))
        else:
            expected += error.logpdf(misfit(texture, number, x)) - np.log(scale)
    assert found == pytest.approx(expected, rel=1e-9)  # rounding, of differences of probabilities


def test_nested_evidence__of_counts_with_offsets_is_the_mean_likelihood_of_prior_draws(observed):
    # Q = 4 at a load where 6 is due, and at one where 4 is not: 4 comes early, and 6 late.
    at = np.array([4, 4, 8, 8])
    load = 2 * np.log((at / 2 - 1) * 0.042 / 1.38) + [1.9, -0.5, 0.3, 0.2]
    rows = observed(np.array([0, 1, 0, 1]), at, load, rel_se=0.05, is_count=True)
    found = nested(sharing(rows, "step"), n_live=60)

    rng, n = np.random.default_rng(2), 200_000
    c = 1.382 * np.exp(0.1 * rng.standard_normal(n))
    scale = np.hypot(0.05 * rng.standard_normal(n), 0.05)
    offset = 0.5 * rng.standard_normal(n) * rng.standard_normal((4, n))  # of Q = 4, 6, 8, 10
    reached = 2 * np.log(np.arange(1, 5)[:, None] * 0.042 / c) + offset
    likelihood = np.ones(n)
    for x, step in zip(load, at // 2 - 2, strict=True):
        high = (x - reached[step]) / scale
        low = np.minimum((x - reached[step + 1]) / scale, high)
        likelihood *= stats.norm.cdf(high) - stats.norm.cdf(low)
    se = likelihood.std() / likelihood.mean() / np.sqrt(n)
    assert se < 0.05
    # Monte Carlo
    assert found.value == pytest.approx(np.log(likelihood.mean()), abs=3 * np.hypot(found.se, se))


def test_nested_evidence__follows_replaced_priors(observed):
    priors = {"c": LogNormal(2.0, 0.05), "sigma": HalfNormal(0.2)}
    model = Model(narrow(observed)[1], Modified(), priors=priors)
    default = Model(narrow(observed)[1], Modified())
    found, expected = nested(model), quadrature(model)
    assert found.value == pytest.approx(expected, abs=3 * found.se)  # Monte Carlo
    assert abs(expected - quadrature(default)) > 10 * found.se


def test_nested_evidence__says_so_where_the_calls_were_not_enough(observed):
    found = nested(Model(narrow(observed)[1], Modified()), n_call_max=300)
    assert not found.ok
    assert np.isnan(found.value)
    assert np.isnan(found.se)
    assert found.status == "not finished after 300 likelihood calls"


def test_nested_evidence__is_the_same_for_the_same_seed(observed):
    model = Model(narrow(observed)[1], Modified())
    first, again, other = (nested(model, seed, n_live=50) for seed in (1, 1, 2))
    assert first == again
    assert first.value != other.value


def test_nested_evidence__names_the_extra_where_dynesty_is_missing(observed, monkeypatch):
    monkeypatch.setitem(sys.modules, "dynesty", None)
    with pytest.raises(InputError, match=r"needs dynesty: pip install 'ridgebayes\[dynesty\]'"):
        nested(Model(narrow(observed)[1], Modified()))
