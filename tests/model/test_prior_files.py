from dataclasses import replace

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes import InputError, Noise
from ridgebayes.inference.netcdf import read_netcdf, write_netcdf
from ridgebayes.model.default_priors import slope_prior
from ridgebayes.model.prior_files import resolve_priors
from tests import oracles
from tests.drawn import drawn_posterior, model_of

ALL = [rb.Classic(), rb.PowerLaw(), rb.Modified(), rb.Hybrid()]
TEXTURES = ((0.012, 0.03), (0.032, 0.01), (0.022, 0.02))


@pytest.fixture(scope="module")
def data(observed):
    texture, Q = (column.ravel() for column in np.indices((3, 4)))
    Q = 4 + 2 * Q
    a, b = np.array(TEXTURES)[texture].T
    noise = 0.02 * np.random.default_rng(4).standard_normal(12)
    data = observed(texture, Q, np.log(rb.Hybrid().load(Q, a, b)) + noise, textures=TEXTURES)
    return replace(data, labels=("x", "y", "z"))


def resolved(data, text, folder):
    path = folder / "p.toml"
    path.write_text(text, encoding="utf-8")
    return resolve_priors(path, ALL, [Noise()], data)


def test_resolve__is_by_form_and_parameter_and_k_is_of_every_texture(data, tmp_path):
    (tmp_path / "s.csv").write_text(
        "c\n" + "\n".join(f"{x}" for x in np.linspace(1.2, 1.5, 30)), encoding="utf-8"
    )
    found = resolved(
        data,
        """
        [hybrid]
        c1 = "truncated(normal(1.5, 10 %), 0, 2)"
        c2 = "uniform(-0.1, 0.1)"
        [modified]
        c = "empirical(s.csv, c)"
        [power-law]
        K = "lognormal(auto, 50 %)"
        [noise]
        sigma = "uniform(0, 0.2)"
        """,
        tmp_path,
    )
    assert found["hybrid"]["c1"] == rb.Truncated(rb.Normal(1.5, 0.15), 0.0, 2.0)
    assert found["modified"]["c"].source == "c of s.csv"
    a, b = np.array(TEXTURES).T
    slopes = [found["power-law"][f"K[{label}]"] for label in data.labels]
    for prior, median in zip(slopes, 2 * 1.382 / (a + b), strict=True):
        assert prior.median == pytest.approx(median, rel=1e-14)
        assert prior.log_sd == 0.5
    assert resolve_priors(found, ALL, [Noise()], data) == found  # a second time is no change


@pytest.mark.parametrize("order", [["K", "K[y]"], ["K[y]", "K"]])
def test_resolve__k_of_every_texture_is_kept_for_new_ones_beside_that_of_one(data, order):
    texts = {"K": "lognormal(auto, 5 %)", "K[y]": "lognormal(60, 1 %)"}
    given = {"power-law": {name: texts[name] for name in order}}
    found = resolve_priors(given, ALL, [Noise()], data)
    own = found["power-law"]
    assert own["K[y]"] == rb.LogNormal(60.0, 0.01)
    assert own["K[x]"] == rb.LogNormal(2 * 1.382 / (0.012 + 0.03), 0.05)
    assert resolve_priors(found, ALL, [Noise()], data) == found  # a second time is no change
    model = model_of(data, rb.PowerLaw(), priors=own)
    assert model.parameter_names == ("K[x]", "K[y]", "K[z]", "sigma")
    assert [model.priors[f"K[{label}]"] for label in "xyz"] == [own[f"K[{x}]"] for x in "xyz"]
    priors = {**model.given_priors, "sigma": rb.HalfNormal(0.1)}
    again = model_of(data, rb.PowerLaw(), priors=priors)
    new = slope_prior((0.02, 0.02), again.prior_of_slopes)
    assert new == rb.LogNormal(2 * 1.382 / 0.04, 0.05)
    assert slope_prior((0.02, 0.02), model_of(data, rb.PowerLaw()).prior_of_slopes).log_sd == 0.3


BAD = {
    "hybrid = 1": ": hybrid: expected priors by parameter, got 1",
    "[cubic]": ": expected one of classic, hybrid, modified, noise, power-law, got 'cubic'",
    "[hybrid]\nc3 = 'normal(0, 1)'": ": [hybrid]: expected one of c1, c2, got 'c3'",
    "[classic]\nsigma = 'halfnormal(1)'": ": [classic]: expected one of c, got 'sigma'",
    "[power-law]\nk = 'normal(1, 1)'": ": [power-law]: expected one of K, got 'k'",
    "[noise]\ndf = 'gamma(2, 1)'": ": [noise]: expected one of sigma, got 'df'",
    "[noise]\nsigma = 'normal(0, 1)'": ": [noise] sigma: expected a distribution above 0",
    "[hybrid]\nc1 = 'uniform(-1, 1)'": ": [hybrid] c1: expected a distribution above 0, got",
    "[hybrid]\nc1 = 1.4": ": [hybrid] c1: expected one of normal(mean, sd), ",
    "[hybrid]\nc1 = 'lognormal(auto)'": ": [hybrid] c1 = 'lognormal(auto)': expected logn",
    "[hybrid]\nc1 = {a = 1}": ": [hybrid] c1: expected one of normal(mean, sd), ",
    "[hybrid]\nc1 = 'empirical(no.csv, c)'": "no.csv: no such file",
    "[hybrid\n": ": not TOML: ",
    "a = 1\na = 2": ": not TOML: ",
    "[hybrid]\nc1 = " + "[" * 5_000: ": not TOML: ",
    "\0": "p.toml, line 1: a zero byte",
}


@pytest.mark.parametrize("text", BAD)
def test_resolve__one_line_names_file_table_and_key(data, tmp_path, text):
    with pytest.raises(InputError) as refused:
        resolved(data, text, tmp_path)
    message = str(refused.value)
    assert BAD[text] in message
    assert message.startswith(str(tmp_path))
    assert "\n" not in message
    assert len(message) < 500


def test_resolve__c2_may_be_of_any_sign_and_k_of_any_kind_above_0(data, tmp_path):
    found = resolved(
        data, "[hybrid]\nc2 = 'halfnormal(0.1)'\n[power-law]\nK = 'uniform(10, 200)'\n", tmp_path
    )
    assert found["hybrid"]["c2"] == rb.HalfNormal(0.1)
    assert set(found["power-law"].values()) == {rb.Uniform(10.0, 200.0)}


PRIORS = {
    "uniform": {"c": rb.Uniform(1.2, 1.6), "sigma": rb.Uniform(0.0, 0.2)},
    "truncated": {"c": rb.Truncated(rb.LogNormal(1.382, 0.1), 1.36, 2.0)},
    "empirical": {"c": rb.Empirical.of(np.linspace(1.2, 1.6, 200), "c of draws.csv")},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PRIORS)
def test_model__is_sampled_integrated_written_and_read_back_under_it(data, tmp_path, name):
    model = model_of(data, rb.Modified(), priors=PRIORS[name])
    posterior = drawn_posterior(model, seed=2)
    grids = [np.linspace(1.15, 1.75, 1_201), np.linspace(1e-3, 0.2, 1_000)]
    value, _ = oracles.iid_posterior(model, grids)
    # Monte Carlo; discretisation: of a density that ends abruptly, a cell over its width.
    assert abs(posterior.evidence.value - value) < 4 * posterior.evidence.se + 0.02
    write_netcdf(posterior, tmp_path / "p.nc")
    again = read_netcdf(tmp_path / "p.nc")
    assert again.model.priors == model.priors
