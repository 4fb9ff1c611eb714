from dataclasses import replace
from importlib.metadata import version

import matplotlib
import numpy as np
import pytest
from scipy import stats

from ridgebayes import Hybrid, InputError
from ridgebayes.inference.arviz_groups import all_groups
from ridgebayes.inference.diagnostics import arviz_object, leave_one_out
from ridgebayes.inference.netcdf import read_netcdf, write_netcdf
from ridgebayes.runtime.quiet import import_arviz
from tests import oracles
from tests.drawn import drawn_posterior, model_of

GROUPS = {
    "posterior",
    "prior",
    "posterior_predictive",
    "prior_predictive",
    "log_likelihood",
    "log_prior",
    "observed_data",
    "constant_data",
    "sample_stats",
}
IS_NEW = not version("arviz").startswith("0.")


@pytest.fixture(scope="module")
def drawn(paper):
    return drawn_posterior(model_of(paper, Hybrid()), n_draw=640)


@pytest.fixture(scope="module")
def opened(drawn, tmp_path_factory):
    path = tmp_path_factory.mktemp("arviz") / "hybrid.nc"
    write_netcdf(drawn, path)
    return import_arviz().from_netcdf(path)


def test_all_groups__of_a_file_have_arvizs_attributes(drawn, opened):
    found = opened.children if IS_NEW else opened.groups()
    assert set(found) == GROUPS
    for name in GROUPS:
        attributes = opened[name].attrs
        assert attributes["creation_library"] == "ridgebayes"
        assert attributes["inference_library"] == "ridgebayes"
        assert attributes["created_at"].startswith("1970-01-01T00:00:00")
    walked = all_groups(replace(drawn, sampler="emcee"))["prior"].attrs
    assert walked["inference_library"] == "emcee"
    assert walked["inference_library_version"] == version("emcee")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of arviz 0.x's drawing by matplotlib
def test_arviz__summarises_scores_and_draws_a_file(drawn, opened):
    matplotlib.use("Agg")
    az = import_arviz()
    summary = az.summary(opened, var_names=["c1", "sigma"])
    assert list(summary.index) == ["c1", "sigma"]
    loo = az.loo(opened)
    elpd = loo.elpd if IS_NEW else loo.elpd_loo
    rows = all_groups(drawn)["log_likelihood"]["log_load"].to_numpy()
    own = leave_one_out(rows, 1.0)
    assert elpd == pytest.approx(own.elpd, abs=0.1)
    exact = az.loo(opened, reff=1.0, pointwise=True)
    p = exact.p if IS_NEW else exact.p_loo
    # Algebra; the 0.x line smooths a tail of one more draw.
    assert p == pytest.approx(own.p, abs=1e-6 if IS_NEW else 1e-4)
    if IS_NEW:
        az.plot_ppc_dist(opened)
        az.plot_ppc_dist(opened, group="prior_predictive")
        az.plot_prior_posterior(opened)
        sense = az.psense_summary(opened)
        prior, likelihood = sense["prior"].astype(float), sense["likelihood"].astype(float)
    else:
        az.plot_ppc(opened)
        az.plot_ppc(opened, group="prior")
        az.plot_dist_comparison(opened)
        prior, likelihood = (az.psens(opened, component=c) for c in ("prior", "likelihood"))
    for name in ("c1", "c2", "sigma"):  # forty rows against vague priors, at arviz's own limit
        assert float(prior[name]) < 0.05 < float(likelihood[name])


def test_prior_from_idata_of_pymc_extras__reads_a_file(opened):
    reason = "of the extra samplers"
    extras = pytest.importorskip("pymc_extras.utils.prior", reason=reason)
    import pymc

    with pymc.Model():
        found = extras.prior_from_idata(
            opened, var_names=["c1", "c2"], sigma=pymc.distributions.transforms.log
        )
    assert set(found) == {"c1", "c2", "sigma"}


def test_log_prior__is_that_of_each_parameter(fits):
    fit = fits["hybrid"]
    groups = all_groups(fit)
    of_sigma = groups["log_prior"]["sigma"].to_numpy().ravel()
    expected = stats.halfnorm(scale=0.05).logpdf(fit.draws[:, -1])
    np.testing.assert_allclose(of_sigma, expected, rtol=1e-12)
    total = sum(value.to_numpy() for value in groups["log_prior"].data_vars.values())
    np.testing.assert_allclose(total.ravel(), fit.model.log_prior(fit.draws), rtol=1e-11)
    K = all_groups(fits["power-law"])["log_prior"]
    assert K["K"].dims == ("chain", "draw")
    power_law = fits["power-law"]
    total = (K["K"] + K["sigma"]).to_numpy().ravel()
    np.testing.assert_allclose(total, power_law.model.log_prior(power_law.draws), rtol=1e-11)


@pytest.mark.slow
def test_predictive_groups__are_of_the_prior_and_of_the_rows(fits):
    fit = fits["hybrid"]
    groups = all_groups(fit)
    prior = groups["prior"]["sigma"].to_numpy().ravel()
    assert stats.kstest(prior, stats.halfnorm(scale=0.05).cdf).pvalue > 1e-4  # Monte Carlo
    replicated = groups["posterior_predictive"]["log_load"]
    assert replicated.shape == (4, 125, 41)
    # Monte Carlo: each row's load is a log-normal about the form's, of sd sigma.
    centre = replicated.mean(("chain", "draw")).to_numpy()
    z = (centre - fit.model.data.log_load) / fit.summary["mean"].iloc[-1]
    assert np.sqrt((z**2).mean()) == pytest.approx(1, abs=0.2)
    spread = replicated.std(("chain", "draw")).to_numpy() / fit.summary["mean"].iloc[-1]
    np.testing.assert_allclose(spread, 1.0, atol=0.2)
    wide = groups["prior_predictive"]["log_load"].std(("chain", "draw")).to_numpy()
    assert np.all(wide > 0.1)
    kept = groups["posterior"]["sigma"].sel(draw=replicated["draw"])
    assert kept.shape == (4, 125)


@pytest.mark.slow
def test_joint_log_likelihood__is_that_of_all_rows(paper):
    smooth = drawn_posterior(model_of(paper, Hybrid(), "step-smooth"), n_draw=256)
    groups = all_groups(smooth)
    joint = groups["sample_stats"]["log_likelihood_joint"].to_numpy().ravel()
    np.testing.assert_allclose(joint, smooth.log_likelihood_of_rows, rtol=1e-12)
    for u, value in zip(smooth.coordinates[:5, smooth.model.outer], joint, strict=False):
        dense = oracles.normal_log_density(smooth.model, u) - oracles.log_prior(u)
        assert value == pytest.approx(dense, rel=1e-6)  # rounding: condition 1e8
    assert set(groups) >= GROUPS


def test_date__is_that_of_the_environment_and_the_bytes_are_the_same(fits, tmp_path, monkeypatch):
    fit = fits["modified"]
    write_netcdf(fit, tmp_path / "a.nc")
    write_netcdf(fit, tmp_path / "b.nc")
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    assert all_groups(fit)["prior"].attrs["created_at"] == "2023-11-14T22:13:20+00:00"
    write_netcdf(fit, tmp_path / "c.nc")
    assert read_netcdf(tmp_path / "c.nc").draws.tobytes() == fit.draws.tobytes()
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "today")
    with pytest.raises(InputError, match="SOURCE_DATE_EPOCH: expected whole seconds since 1970"):
        arviz_object(all_groups(fit))
