"""Posteriors as mixtures: against the draws, in files, and as priors in other programs."""

import json
import math
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes.distributions.bounded import Truncated, Uniform
from ridgebayes.distributions.distribution import Gamma, HalfNormal, LogNormal, Normal
from ridgebayes.errors import InputError
from ridgebayes.inference.mixture import PosteriorMixture
from ridgebayes.model.joint_prior import JointPrior

PROGRAMS = ("pymc", "numpyro", "stan")
TRANSFORMS = (
    Normal(0.0, 0.05),
    LogNormal(1.382, 0.1),
    HalfNormal(0.05),
    Uniform(0.5, 2.0),
    Truncated(Normal(1.0, 0.1), 0.9, math.inf),
    Truncated(LogNormal(1.0, 0.3), 0.0, 1.2),
    Truncated(Normal(0.0, 1.0), -0.5, 2.0),
)


@pytest.fixture(scope="module")
def mixtures(fits):
    return {name: fits[name].to_mixture() for name in ("hybrid", "power-law")}


@pytest.fixture(scope="module")
def every_transform():
    """Two components over transforms of all kinds."""
    d = len(TRANSFORMS)
    weights, means = np.array([0.3, 0.7]), np.stack([np.full(d, -0.5), np.full(d, 0.4)])
    correlated = 0.09 * (0.5 * np.eye(d) + 0.5)
    distance = {"sd_ratio": {}, "mean_shift_in_sd": {}, "largest_correlation_difference": 0.0}
    about = {
        "form": "hybrid", "noise": "iid", "converged": False, "validity": {}, "fitted_rows": 1,
        "fitted_rows_digest": "0", "ridgebayes_version": "0", "distance": distance,
    }  # fmt: skip
    names = tuple(f"K[t{i}]" for i in range(d))
    about["distance"] = distance | {k: dict.fromkeys(names, 1.0) for k in list(distance)[:2]}
    return PosteriorMixture(
        names, TRANSFORMS, weights, means, np.stack([correlated, 2 * correlated]), about
    )


def assert_like(found, draws):
    """Means within 2 % of an sd, sds within 2 %, correlations within 0.02."""
    sd = draws.std(axis=0)
    np.testing.assert_allclose((found.mean(axis=0) - draws.mean(axis=0)) / sd, 0, atol=0.02)
    np.testing.assert_allclose(found.std(axis=0) / sd, 1, atol=0.02)
    np.testing.assert_allclose(np.corrcoef(found.T), np.corrcoef(draws.T), atol=0.02)


@pytest.mark.parametrize("name", ["hybrid", "power-law"])
def test_to_mixture__has_the_draws_moments(fits, mixtures, name):
    drawn = mixtures[name].rvs(200_000, rng=3)
    assert_like(drawn, fits[name].draws)
    distance = mixtures[name].about["distance"]
    assert max(distance["kolmogorov_smirnov"].values()) < 0.02  # Monte Carlo: 0.016 at n = 10,240
    sd_ratio = drawn.std(axis=0) / fits[name].draws.std(axis=0)
    told = np.array(list(distance["sd_ratio"].values()))
    np.testing.assert_allclose(told, sd_ratio, atol=0.01)


def test_to_mixture__tells_what_it_stands_for(fits, mixtures):
    fit, about = fits["hybrid"], mixtures["hybrid"].about
    assert (about["form"], about["noise"], about["converged"]) == ("hybrid", "iid", True)
    assert about["priors"]["c2"] == {"kind": "normal", "mean": 0.0, "sd": 0.05}
    assert about["validity"]["a_over_R"] == [0.012, 0.032]
    assert about["validity"]["Q_max"] == fit.model.data.Q.max()
    assert about["fitted_rows_digest"] == fit.model.data.digest()
    moved = replace(fit.model.data, log_load=fit.model.data.log_load + 1e-15)
    assert moved.digest() != about["fitted_rows_digest"]
    scores = about["held_out_log_density"]
    best = max(scores.values())
    assert scores[str(len(mixtures["hybrid"].weights))] > best - 0.01


def test_to_mixture__more_components_are_no_worse(fits):
    """Hybrid's errors are skewed: one normal misses that, two find most of it."""
    draws = fits["hybrid"].draws
    one, two = (fits["hybrid"].to_mixture(k).log_pdf(draws).mean() for k in (1, 2))
    assert two > one + 0.02


def test_log_pdf__integrates_to_one(mixtures):
    """Monte Carlo: the mean of 1/density over draws is the volume that they are in."""
    mixture = mixtures["hybrid"]
    drawn = mixture.rvs(20_000, rng=5)
    prior = JointPrior(mixture.transforms)
    u = np.random.default_rng(1).multivariate_normal(
        prior.scores(drawn).mean(axis=0), 2 * np.cov(prior.scores(drawn).T), size=20_000
    )
    normal = stats.multivariate_normal(
        prior.scores(drawn).mean(axis=0), 2 * np.cov(prior.scores(drawn).T)
    )
    theta = prior.at_scores(u)
    log_slope = np.log(prior.at_scores_slope(u, theta)).sum(axis=1)
    weight = np.exp(mixture.log_pdf(theta) + log_slope - normal.logpdf(u))
    assert abs(weight.mean() - 1) < 5 * weight.std() / math.sqrt(len(weight))
    assert mixture.log_pdf(np.array([1.3, 0.0, -0.1])) == -math.inf


def test_json__comes_back(mixtures, tmp_path):
    mixture = mixtures["hybrid"]
    mixture.to_json(tmp_path / "x.json")
    back = PosteriorMixture.from_json(tmp_path / "x.json")
    assert back.to_dict() == mixture.to_dict()
    assert back.rvs(5, rng=1).tobytes() == mixture.rvs(5, rng=1).tobytes()
    given = json.loads((tmp_path / "x.json").read_text())
    for damage in (
        {"format": "another"}, {"weights": [1.0]}, {"means": [[math.nan] * 3]},
        {"covariances": []}, {"names": ["c1"]}, {"transforms": [{"kind": "none"}] * 3},
    ):  # fmt: skip
        (tmp_path / "y.json").write_text(json.dumps(given | damage))
        with pytest.raises(InputError, match=r"y\.json: expected a file of PosteriorMixture"):
            PosteriorMixture.from_json(tmp_path / "y.json")
    with pytest.raises(InputError, match="no such file"):
        PosteriorMixture.from_json(tmp_path / "z.json")


def test_to_mixture__refuses(fits, mixtures, monkeypatch):
    with pytest.raises(InputError, match="n_component: expected 1 to 8, got 9"):
        fits["hybrid"].to_mixture(9)
    with pytest.raises(InputError, match="code: expected one of pymc, numpyro, stan, got 'bugs'"):
        mixtures["hybrid"].code("bugs")
    monkeypatch.setattr("ridgebayes.inference.mixture._MOST_PARAMETERS", 2)
    with pytest.raises(InputError, match="hybrid: 3 parameters; expected at most 2"):
        fits["hybrid"].to_mixture()


@pytest.mark.slow
def test_transforms__stand_in_for_priors_without_a_closed_form(paper):
    settings = rb.SampleSettings(n_walker=64, tau_change=0.05)
    priors = {"c": Gamma(30.0, 22.0)}
    fit = rb.calibrate(paper, rb.Modified(), noise="iid", priors=priors, settings=settings, rng=1)
    mixture = fit.to_mixture(2)
    assert isinstance(mixture.transforms[0], LogNormal)
    assert_like(mixture.rvs(100_000, rng=1), fit.draws)


@pytest.mark.parametrize("program", PROGRAMS)
def test_code__names_are_identifiers_and_python_compiles(mixtures, every_transform, program):
    for mixture in (*mixtures.values(), every_transform):
        text = mixture.code(program)
        if program != "stan":
            compile(text, program, "exec")
    assert "K_t0" in text
    assert "NOT converged" in text


def test_code__of_stan_is_balanced(every_transform):
    text = every_transform.code("stan")
    for pair in ("{}", "[]", "()"):
        assert text.count(pair[0]) == text.count(pair[1])
    assert text.count("real K_t") == len(TRANSFORMS)


def test_code__of_stan_is_translated_by_its_compiler(every_transform, tmp_path):
    httpstan = pytest.importorskip("httpstan", reason="of the extra samplers")
    stanc, program = Path(httpstan.__file__).parent / "stanc", tmp_path / "x.stan"
    command = [stanc, f"--o={tmp_path / 'x.hpp'}", program]
    program.write_text(every_transform.code("stan"))
    assert subprocess.run(command, check=False).returncode == 0
    program.write_text(every_transform.code("stan").replace("inv_Phi", "quantile"))
    assert subprocess.run(command, check=False).returncode != 0


class Functions:
    """The functions that the generated expressions call, by SciPy."""

    exp = staticmethod(np.exp)
    erfc = staticmethod(lambda x: 2 * stats.norm.cdf(-math.sqrt(2) * x))
    erfcinv = staticmethod(lambda p: -stats.norm.ppf(p / 2) / math.sqrt(2))


@pytest.mark.parametrize("program", PROGRAMS)
def test_code__values_are_those_of_the_transforms(every_transform, program):
    """Algebra: closed forms of the quantile functions, at scores up to 3."""
    text = every_transform.code(program)
    z = np.random.default_rng(1).uniform(-3, 3, size=(50, len(TRANSFORMS)))
    names = {
        "np": np, "pt": Functions, "jnp": Functions, "exp": np.exp, "found": {},
        "ndtr": stats.norm.cdf, "ndtri": stats.norm.ppf,
        "Phi": stats.norm.cdf, "inv_Phi": stats.norm.ppf,
        "_cdf": stats.norm.cdf, "_quantile": stats.norm.ppf,
    }  # fmt: skip
    start = "  real " if program == "stan" else "    found["
    lines = [line for line in text.splitlines() if line.startswith(start)]
    found = np.empty_like(z)
    for i, line in enumerate(lines):
        expression = line.split(" = ", 1)[1].rstrip(";")
        at = {"z": [None, *z.T]} if program == "stan" else {"z": z}
        found[:, i] = eval(expression, names | at)
    np.testing.assert_allclose(found, JointPrior(TRANSFORMS).at_scores(z), rtol=1e-9, atol=1e-12)


@pytest.fixture(scope="module", params=["hybrid", "texture"])
def fit(request, fits, paper):
    """A plain one, and one whose error scales reach to zero: no normal, not even of logarithms."""
    if request.param == "hybrid":
        return fits["hybrid"]
    return rb.calibrate(paper, rb.Hybrid(), noise="texture", rng=1)


@pytest.mark.long
@pytest.mark.filterwarnings("default")
def test_code__samples_the_posterior_in_pymc(fit):
    pymc = pytest.importorskip("pymc", reason="of the extra samplers")
    space = {}
    exec(fit.to_mixture().code("pymc"), space)
    with pymc.Model():
        found = space["ridgebayes_prior"]()
        drawn = pymc.sample(
            10_000, tune=1_000, chains=4, cores=1, random_seed=1, progressbar=False
        ).posterior
    assert_like(np.stack([drawn[key].values.ravel() for key in found], axis=1), fit.draws)


@pytest.mark.long
@pytest.mark.filterwarnings("default")
def test_code__samples_the_posterior_in_numpyro(fit):
    numpyro = pytest.importorskip("numpyro", reason="of the extra samplers")
    from jax import random
    from numpyro.infer import MCMC, NUTS

    space = {}
    exec(fit.to_mixture().code("numpyro"), space)
    walk = MCMC(
        NUTS(space["ridgebayes_prior"]), num_warmup=1_000, num_samples=10_000, num_chains=4,
        chain_method="sequential", progress_bar=False,
    )  # fmt: skip
    walk.run(random.PRNGKey(1))
    drawn = walk.get_samples()
    assert numpyro
    names = [key for key in drawn if key != "ridgebayes_x"]
    order = [name for name in fit.model.parameter_names if name in names]
    assert_like(np.stack([np.asarray(drawn[key]) for key in order], axis=1), fit.draws)


@pytest.mark.long
@pytest.mark.filterwarnings("default")
def test_code__compiles_and_samples_the_posterior_in_stan(fit):
    stan = pytest.importorskip("stan", reason="of the extra samplers")
    found = stan.build(fit.to_mixture().code("stan"), random_seed=1)
    drawn = found.sample(num_chains=4, num_warmup=1_000, num_samples=10_000)
    names = fit.model.parameter_names
    assert_like(np.stack([drawn[key].ravel() for key in names], axis=1), fit.draws)
