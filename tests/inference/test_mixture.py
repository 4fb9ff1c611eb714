"""Posteriors as mixtures: against the draws, in files, and as priors in other programs."""

import json
import math
import re
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest
from scipy import special, stats

import ridgebayes as rb
from ridgebayes import (
    Gamma,
    HalfNormal,
    InputError,
    LogNormal,
    Normal,
    PosteriorMixture,
    Truncated,
    Uniform,
)
from ridgebayes.model.joint_prior import JointPrior
from tests.test_pages import DOCS, blocks_of

PAGE = DOCS / "reuse.md"
PROGRAMS = ("pymc", "numpyro", "stan")
EXAMPLES = {
    "pymc": next(block.code for block in blocks_of(PAGE, "python") if block.what == "pymc"),
    "numpyro": (DOCS / "reuse" / "with_numpyro.py").read_text(encoding="utf-8"),
    "stan": (DOCS / "reuse" / "with_stan.py").read_text(encoding="utf-8"),
}
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
    about = {"form": "hybrid", "noise": "iid"}
    names = tuple(f"K[t{i}]" for i in range(d))
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


def test_json__of_the_first_version_is_read(tmp_path):
    """A standard normal of the scores: the transforms' own densities."""
    given = {
        "format": "ridgebayes posterior mixture 1", "names": ["c", "sigma"],
        "transforms": [
            {"kind": "log-normal", "median": 1.382, "log_sd": 0.1},
            {"kind": "half-normal", "sd": 0.05},
        ],
        "weights": [1.0], "means": [[0.0, 0.0]], "covariances": [[[1.0, 0.0], [0.0, 1.0]]],
        "form": "modified", "noise": "iid", "converged": True, "distance": {"n_compared": 100000},
    }  # fmt: skip
    (tmp_path / "x.json").write_text(json.dumps(given))
    mixture = PosteriorMixture.from_json(tmp_path / "x.json")
    expected = stats.lognorm(0.1, scale=1.382).logpdf(1.3) + stats.halfnorm(scale=0.05).logpdf(0.02)
    assert mixture.log_pdf(np.array([1.3, 0.02])) == pytest.approx(expected, rel=1e-12)
    assert mixture.about["distance"] == {"n_compared": 100000}
    assert mixture.to_dict() == given


def test_to_mixture__refuses(fits, monkeypatch):
    with pytest.raises(InputError, match="n_component: expected 1 to 8, got 9"):
        fits["hybrid"].to_mixture(9)
    monkeypatch.setattr("ridgebayes.inference.mixture._MAX_PARAMETERS", 2)
    with pytest.raises(InputError, match="hybrid: 3 parameters; expected at most 2"):
        fits["hybrid"].to_mixture()


@pytest.mark.slow
def test_transforms__stand_in_for_priors_without_a_closed_form(paper):
    settings = rb.SampleSettings(n_walker=64, tau_change=0.05)
    priors = {"modified": {"c": Gamma(30.0, 22.0)}}
    fit = rb.calibrate(paper, rb.Modified(), noise="iid", priors=priors, settings=settings, rng=1)
    mixture = fit.to_mixture(2)
    assert isinstance(mixture.transforms[0], LogNormal)
    assert_like(mixture.rvs(100_000, rng=1), fit.draws)


@pytest.fixture
def run_example(tmp_path, monkeypatch):
    """Run an example of the page on the file of a mixture; return its names."""

    def run(program, mixture, modules=()):
        monkeypatch.chdir(tmp_path)
        mixture.to_json("hybrid.json")
        space = {}
        with monkeypatch.context() as patch:
            for name, module in dict(modules).items():
                patch.setitem(sys.modules, name, module)
            exec(compile(EXAMPLES[program], program, "exec"), space)
        return space

    return run


class StandIn:
    """NumPy in place of PyMC, NumPyro or PyStan: it gives coordinates and keeps what is made."""

    def __init__(self):
        self.x, self.values = None, []
        pymc, numpyro, jax = MagicMock(), MagicMock(), MagicMock(numpy=np)
        pymc.math.exp, pymc.math.dot = np.exp, np.dot
        pymc.math.invprobit, pymc.math.probit = special.ndtr, special.ndtri
        pymc.MvNormal.dist = lambda mu, chol: (mu, chol)
        pymc.Mixture = lambda name, w, comp_dists: self.sample(name, (w, *comp_dists))
        pymc.Deterministic = numpyro.deterministic = self.deterministic
        numpyro.distributions.Categorical = lambda probs: probs
        numpyro.distributions.MultivariateNormal = lambda loc, scale_tril: (loc, scale_tril)
        numpyro.distributions.MixtureSameFamily = lambda w, parts: (w, *parts)
        numpyro.sample = self.sample
        self.modules = {
            "pymc": pymc, "stan": MagicMock(), "numpyro": numpyro, "numpyro.infer": numpyro.infer,
            "numpyro.distributions": numpyro.distributions, "jax": jax, "jax.numpy": np,
            "jax.scipy": jax.scipy, "jax.scipy.special": special,
        }  # fmt: skip

    def sample(self, name, mixture):
        self.mixture, self.values = mixture, []
        return self.x

    def deterministic(self, name, value):
        self.values.append(value)
        return value

    def log_density(self):
        """Return the log density of the coordinates."""
        logs = [
            math.log(weight) + stats.multivariate_normal.logpdf(self.x, mean, factor @ factor.T)
            for weight, mean, factor in zip(*self.mixture, strict=True)
        ]
        return special.logsumexp(logs)

    def parameters(self, program, run, x):
        """Return the parameters that an example makes of the coordinates."""
        self.x = x
        space = run()
        if program == "numpyro":
            space["model"]()
        if program == "stan":
            data, (text,) = space["data"], re.findall(r"found = (\[.*\])';", space["program"])
            self.mixture = data["w"], data["means"], data["factors"]
            z = [None, *(data["origin"] + data["S"] @ x)]
            names = {"z": z, "exp": np.exp, "Phi": special.ndtr, "inv_Phi": special.ndtri}
            self.values = eval(text, names)
        return np.array(self.values)


@pytest.mark.parametrize("program", PROGRAMS)
def test_examples__have_the_density_of_the_mixture(every_transform, run_example, program):
    """By the formula: the density of coordinates over the volume that derivatives tell."""
    stand_in, step = StandIn(), 1e-5
    run = partial(run_example, program, every_transform, stand_in.modules)
    for x in np.random.default_rng(1).normal(0, 1.5, size=(4, len(TRANSFORMS))):
        theta = stand_in.parameters(program, run, x)
        log_density = stand_in.log_density()
        slopes = [
            stand_in.parameters(program, run, x + h) - stand_in.parameters(program, run, x - h)
            for h in step * np.eye(len(x))
        ]
        log_volume = np.linalg.slogdet(np.array(slopes) / (2 * step))[1]
        assert log_density - log_volume == pytest.approx(every_transform.log_pdf(theta), abs=1e-6)


def test_example_of_stan__is_translated_by_its_compiler(every_transform, run_example, tmp_path):
    httpstan = pytest.importorskip("httpstan", reason="of the extra samplers")
    text = run_example("stan", every_transform, StandIn().modules)["program"]
    stanc, program = Path(httpstan.__file__).parent / "stanc", tmp_path / "x.stan"
    command = [stanc, f"--o={tmp_path / 'x.hpp'}", program]
    program.write_text(text)
    assert subprocess.run(command, check=False).returncode == 0
    program.write_text(text.replace("inv_Phi", "quantile"))
    assert subprocess.run(command, check=False).returncode != 0
