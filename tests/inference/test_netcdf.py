import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from ridgebayes import Fit, InputError, Modified, Noise, calibrate
from ridgebayes.inference import posterior as posterior_module
from ridgebayes.inference.arviz_groups import all_groups, attributes
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.inference.netcdf import read_netcdf, write_netcdf
from ridgebayes.runtime.quiet import import_arviz
from tests.drawn import drawn_posterior, model_of

DOCS = Path(__file__).parents[2] / "docs"
NAMES = ("classic", "power-law", "modified", "hybrid")
FEW = {"n_draw": 128, "n_round": 2}


@pytest.fixture(scope="module")
def files(fits, tmp_path_factory):
    folder = tmp_path_factory.mktemp("posteriors")
    for name in NAMES:
        write_netcdf(fits[name], folder / f"posterior-{name}.nc")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_read_netcdf__brings_back_what_was_written(fits, files, name):
    fit, back = fits[name], read_netcdf(files / f"posterior-{name}.nc")
    assert back.draws.tobytes() == fit.draws.tobytes()
    kept = fit.kept_chains
    assert back.chains.log_density.tobytes() == kept.log_density.tobytes()
    np.testing.assert_array_equal(back.chains.acceptance, kept.acceptance)
    np.testing.assert_array_equal(back.chains.tau, kept.tau)
    # Algebra: u is the logarithm of an exponential, and numbers pass through decimal text.
    np.testing.assert_allclose(back.chains.u, kept.u, rtol=1e-12, atol=1e-15)
    pd.testing.assert_frame_equal(back.summary, fit.summary, check_exact=False, rtol=1e-11)
    assert back.convergence_failures == fit.convergence_failures
    assert back.chains.convergence_failures == fit.chains.convergence_failures
    assert back.seed == fit.seed
    assert back.sampler == fit.sampler
    assert back.form == fit.form
    assert back.noise == fit.noise
    assert back.model.priors == fit.model.priors
    assert back.model.parameter_names == fit.model.parameter_names
    for field in ("textures", "labels"):
        assert getattr(back.model.data, field) == getattr(fit.model.data, field)
    for field in ("texture", "Q", "log_load", "rel_se"):
        before, after = (getattr(x.model.data, field) for x in (fit, back))
        assert before.tobytes() == after.tobytes()


@pytest.mark.parametrize("name", ["power-law", "hybrid"])
def test_write_netcdf__opens_with_the_installed_arviz(fits, files, name):
    fit = fits[name]
    data = import_arviz().from_netcdf(files / f"posterior-{name}.nc")
    groups = {"posterior", "log_likelihood", "observed_data", "sample_stats"}
    found = set(data.groups() if callable(data.groups) else data.children)
    assert groups <= {group.strip("/") for group in found}
    first = data["posterior"]["K" if name == "power-law" else "c1"]
    assert first.dims[:2] == ("chain", "draw")
    sigma = data["posterior"]["sigma"].to_numpy()
    assert sigma.shape == (4, len(fit.draws) // 4)
    assert sigma.ravel().tolist() == fit.draws[:, -1].tolist()
    rows = data["log_likelihood"]["log_load"]
    assert rows.dims == ("chain", "draw", "row")
    # Rounding: groups for arviz alone are in single precision.
    np.testing.assert_allclose(
        rows.to_numpy().reshape(-1, 41), fit.rows_log_likelihood(), rtol=1e-6, atol=1e-6
    )
    assert data["observed_data"]["log_load"].shape == (41,)
    assert {"lp", "acceptance_rate", "tau"} <= set(data["sample_stats"].data_vars)


class Own(Modified):
    """A form of the user's own, known in no other process."""

    name = "own"


def test_read_netcdf__says_that_a_form_of_ones_own_cannot_be_read_back(paper, tmp_path):
    fit = calibrate(paper, Own(), noise="iid", rng=1)
    fit.to_netcdf(tmp_path / "own.nc")
    with pytest.raises(InputError, match=r"holds form 'own'.*a form of your own") as refused:
        Fit.from_netcdf(tmp_path / "own.nc")
    assert "damaged" not in str(refused.value)


def test_files__hold_what_their_contract_says(fits, observed, tmp_path):
    rng = np.random.default_rng(1)
    texture, Q = np.arange(24) % 4, 4 + 2 * (np.arange(24) // 8)
    load = 2 * np.log((Q / 2 - 1) * 0.03) + 0.05 * rng.standard_normal(24)
    data = observed(texture, Q, load, series=np.arange(24) // 4 % 2)
    data = replace(data, labels=("one", "two", "three", "four"))
    model = model_of(data, Modified(), Noise("step-smooth+series", nugget=1e-6))
    of_series = drawn_posterior(model, **FEW)
    documented = runpy.run_path(str(DOCS / "netcdf_content.py"))
    content = documented["CONTENT"]
    seen, attrs = set(), set()
    for one in (fits["hybrid"], fits["power-law"], of_series):
        write_netcdf(one, tmp_path / "one.nc")
        with xr.open_datatree(tmp_path / "one.nc", engine="h5netcdf") as tree:
            attrs |= set(tree.attrs) - set(attributes(one))
            for group, values in tree.children.items():
                for name, variable in values.data_vars.items():
                    entry = "PARAMETER" if name in one.model.parameter_names else name
                    assert variable.dims == content[group][entry][0], (group, name)
                    seen.add((group, entry))
    assert seen == {(group, name) for group, names in content.items() for name in names}
    assert attrs == set(documented["ATTRIBUTES"])


def test_all_groups__labels_each_K_with_its_texture(fits):
    fit = fits["power-law"]
    K = all_groups(fit)["posterior"]["K"]
    assert K.dims == ("chain", "draw", "texture")
    assert K["texture"].to_numpy().tolist() == list(fit.model.data.labels)
    place = fit.model.data.textures.index((0.012, 0.03))
    label = fit.model.data.labels[place]
    assert fit.model.parameter_names[place] == f"K[{label}]"
    assert K.sel(texture=label).to_numpy().ravel().tolist() == fit.draws[:, place].tolist()


def test_all_groups__leaves_out_a_log_likelihood_that_no_file_should_hold(fits, monkeypatch):
    fit = fits["modified"]
    assert "log_likelihood" in all_groups(fit)
    monkeypatch.setattr(posterior_module, "MAX_LOG_LIKELIHOOD_SIZE", len(fit.draws) * 41 - 1)
    assert "log_likelihood" not in all_groups(fit)


@pytest.mark.slow
def test_read_netcdf__brings_back_series_and_a_nugget_of_ones_own(observed, tmp_path):
    rng = np.random.default_rng(1)
    texture, Q = np.arange(24) % 4, 4 + 2 * (np.arange(24) // 8)
    load = 2 * np.log((Q / 2 - 1) * 0.03) + 0.05 * rng.standard_normal(24)
    data = observed(texture, Q, load, series=np.arange(24) // 4 % 2)
    data = replace(data, labels=("one", "two", "three", "four"), series_labels=("a b", "ü"))
    noise = Noise("step-smooth+series", nugget=1e-6)
    fit = drawn_posterior(model_of(data, Modified(), noise), **FEW)
    write_netcdf(fit, tmp_path / "a.nc")
    back = read_netcdf(tmp_path / "a.nc")
    assert back.noise == noise
    assert back.model.data.series_labels == ("a b", "ü")
    np.testing.assert_array_equal(back.model.data.series, data.series)
    u, rng = back.coordinates[:, back.model.outer], np.random.default_rng(1)
    lp = LatentIntegral(back.model).estimated(u, rng, 4).log_density
    # Rounding: densities worked out together or in parts; numbers pass through decimal text.
    np.testing.assert_allclose(lp, back.kept_chains.log_density.ravel(), rtol=1e-7)
    plain = drawn_posterior(model_of(data, Modified(), "series"), **FEW)
    write_netcdf(plain, tmp_path / "b.nc")
    with xr.open_datatree(tmp_path / "b.nc", engine="h5netcdf") as tree:
        assert "nugget" not in tree.attrs  # as files were before there was a choice
    assert read_netcdf(tmp_path / "b.nc").noise == Noise("series")


def test_read_netcdf__refuses_a_file_that_is_not_there(tmp_path):
    rule = r"none.nc: no such file; expected a posterior written by ridgebayes"
    with pytest.raises(InputError, match=rule):
        read_netcdf(tmp_path / "none.nc")


def test_read_netcdf__refuses_somebody_elses_file(tmp_path):
    path = tmp_path / "other.nc"
    xr.Dataset({"x": ("n", [1.0, 2.0])}).to_netcdf(path, engine="h5netcdf")
    rule = r"other.nc: not a ridgebayes file; expected a posterior that it wrote"
    with pytest.raises(InputError, match=rule):
        read_netcdf(path)
