"""Power-law coefficients given the error model, against one-dimensional integrals."""

import math

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.special import logsumexp
from scipy.stats import norm
from scipy.stats import t as student_t

from ridgebayes.distributions.bounded import Uniform
from ridgebayes.distributions.distribution import Gamma, HalfNormal, LogNormal
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.tabulated_conditional import TabulatedConditional
from ridgebayes.model.forms import Hybrid, PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise

TEXTURE, Q = np.array([0, 0, 0, 1, 1, 1, 2]), np.array([4, 6, 8, 4, 6, 10, 4])
# Rows of a texture disagree by tens of their errors: the first has two humps, the second three.
OFF = np.array([0.0, 0.02, 0.9, -0.5, 0.1, 1.2, 0.3])
LOG_LOAD = 2 * np.log((Q - 2) / 40.0) + OFF
STUDENT = Noise.named("iid:student")


@pytest.fixture
def make(observed):
    def model(noise=STUDENT, lower=np.nan, form=None, **priors):
        data = observed(TEXTURE, Q, LOG_LOAD, log_lower=np.broadcast_to(lower, 7))
        return Model(data, form or PowerLaw(), noise, priors or None)

    return model


def log_texture_integral(model, j, sigma, df):
    """Log of the integral over K of one texture of prior times likelihood, by a fine rule."""
    prior = list(model.priors.values())[j]
    mine = np.flatnonzero(j == TEXTURE)
    own = np.log((Q[mine] - 2.0) ** 2)
    upper, lower = LOG_LOAD[mine] - own, model.data.log_lower[mine] - own
    # Dense about the ends of each row, and to three and a half in log K about them all.
    humps = -0.5 * np.concatenate([upper, lower[np.isfinite(lower)], [-2 * math.log(prior.median)]])
    x = humps[:, None] + 0.1 * sigma * np.sinh(np.linspace(-12.0, 12.0, 1201))
    x = np.unique(np.clip(x, humps.min() - 3.5, humps.max() + 3.5))
    tail = norm if df is None else student_t(df)
    value = norm.logpdf((x - math.log(prior.median)) / prior.log_sd) - math.log(prior.log_sd)
    for high, low in zip(upper, lower, strict=True):
        z = (high + 2 * x) / sigma
        if np.isnan(low):
            value += tail.logpdf(z) - math.log(sigma)
        elif np.isinf(low):
            value += tail.logcdf(z)
        else:
            after = (low + 2 * x) / sigma
            below, above = tail.cdf(z) - tail.cdf(after), tail.sf(after) - tail.sf(z)
            value += np.log(np.maximum(np.where(z > 0, above, below), 1e-300))
    top = value.max()
    return top + math.log(trapezoid(np.exp(value - top), x))


def noise_scores(model, sigma, df):
    theta = np.append(np.ones(3), [sigma] if df is None else [sigma, df])
    return model.to_unconstrained(theta)[3:]


@pytest.mark.parametrize("lower", [np.nan, -np.inf], ids=["exact", "from zero"])
@pytest.mark.parametrize(("sigma", "df"), [(0.01, 1.2), (0.05, 4.0), (0.3, 0.7), (0.05, None)])
def test_forward__leaves_standard_normals_of_the_density(sigma, df, lower, make):
    noise = STUDENT if df else Noise()
    model = make(noise, lower=lower if df else LOG_LOAD - 0.05)
    frame = TabulatedConditional.of(model)
    u_noise = np.broadcast_to(noise_scores(model, sigma, df), (4000, 2 if df else 1))
    w = np.random.default_rng(1).standard_normal((4000, 3))
    u, log_jacobian = frame.forward(w, u_noise)
    log_weight = model.log_density(np.concatenate([u, u_noise], axis=1)) + log_jacobian
    log_weight += (0.5 * (w * w) + 0.5 * math.log(2 * math.pi)).sum(axis=1)
    weight = np.exp(log_weight - log_weight.max())
    # The table is rough, its Jacobian is not: more than a third of the draws count, and the mean
    # of their weights is the integral.
    assert weight.sum() ** 2 / (weight**2).sum() > len(w) / 3
    exact = sum(log_texture_integral(model, j, sigma, df) for j in range(3))
    exact += norm.logpdf(u_noise[0]).sum()
    se = weight.std() / weight.mean() / math.sqrt(len(w))
    found = logsumexp(log_weight) - math.log(len(w))
    assert found == pytest.approx(exact, abs=4 * se + 1e-6)  # Monte Carlo


@pytest.mark.parametrize("noise", [Noise(), STUDENT], ids=lambda noise: noise.name)
def test_inverse__inverts_forward(noise, make):
    model = make(noise, lower=LOG_LOAD - 0.05)
    frame = TabulatedConditional.of(model)
    rng = np.random.default_rng(2)
    u_noise = rng.standard_normal((2, 50, model.n_parameter - 3)) * 2
    w = 3 * rng.standard_normal((2, 50, 3))  # some beyond the last quantile
    u, log_jacobian = frame.forward(w, u_noise)
    back, again = frame.inverse(u, u_noise)
    np.testing.assert_allclose(back, w, rtol=0, atol=1e-6)  # rounding: widths down to 1e-8
    np.testing.assert_allclose(again, log_jacobian, rtol=0, atol=1e-6)
    one, its = frame.forward(w[1, 7], u_noise[1, 7])
    np.testing.assert_array_equal(one, u[1, 7])
    assert float(its) == log_jacobian[1, 7]


def test_forward__jacobian_is_the_slope_by_finite_differences(make):
    model, h = make(), 1e-4
    frame = TabulatedConditional.of(model)
    u_noise, w = np.array([0.3, -1.0]), np.array([0.41, -1.3, 7.1])  # between the nodes
    slopes = [
        (frame.forward(w + d, u_noise)[0] - frame.forward(w - d, u_noise)[0]) / (2 * h)
        for d in h * np.eye(3)
    ]
    expected = np.linalg.slogdet(np.array(slopes))[1]
    assert float(frame.forward(w, u_noise)[1]) == pytest.approx(expected, abs=1e-8)  # rounding


def test_of__noise_beyond_the_table_is_served_by_its_edge(make):
    frame = TabulatedConditional.of(make())
    far = np.array([[-37.0, 30.0], [37.0, -30.0]])
    u, log_jacobian = frame.forward(np.ones((2, 3)), far)
    assert np.isfinite(u).all()
    assert np.isfinite(log_jacobian).all()


def test_serves__the_power_law_of_independent_rows_without_a_closed_form(make):
    assert TabulatedConditional.serves(make())
    assert TabulatedConditional.serves(make(Noise(), lower=LOG_LOAD - 0.1))
    assert not TabulatedConditional.serves(make(Noise()))
    assert not TabulatedConditional.serves(make(Noise("texture", "student")))
    assert not TabulatedConditional.serves(make(form=Hybrid()))


def test_importance_posterior__of_rows_that_disagree_has_the_evidence_of_quadrature(make):
    priors = {"sigma": HalfNormal(0.05), "df": Gamma(2.0, 0.1)}
    model = make(**priors)
    axes = np.geomspace(0.003, 1.0, 40), np.geomspace(0.15, 120.0, 30)
    values = [
        [
            sum(log_texture_integral(model, j, sigma, df) for j in range(3))
            + float(priors["sigma"].log_pdf(sigma) + priors["df"].log_pdf(df))
            + math.log(sigma * df)
            for df in axes[1]
        ]
        for sigma in axes[0]
    ]
    steps = [math.log(axis[1] / axis[0]) for axis in axes]
    exact = float(logsumexp(values)) + sum(map(math.log, steps))
    posterior, evidence = importance_posterior(model, fit_laplace(model), seed=1)
    assert evidence.ok
    assert posterior.converged
    assert evidence.se < 0.01
    assert evidence.value == pytest.approx(exact, abs=4 * evidence.se + 0.002)  # the rule's step


@pytest.mark.parametrize("prior", [Uniform(10.0, 90.0), LogNormal(30.0, 3.0)], ids=str)
def test_importance_posterior__other_priors_of_k(prior, make):
    model = make(**{"K[" + label + "]": prior for label in make().data.labels})
    posterior, evidence = importance_posterior(model, fit_laplace(model), seed=2)
    assert evidence.ok
    assert evidence.se < 0.02
    assert np.all(posterior.draws[:, :3] > 0)
