import pickle
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import integrate, stats

import ridgebayes as rb
from ridgebayes import Noise
from ridgebayes.inference.diagnostics import effective_sample_size, summarise
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations, refuse_circular
from tests.drawn import drawn_posterior

SHORT = rb.SampleSettings(n_walker=32, n_burn=20, n_step_max=100)


@pytest.mark.parametrize("name", ["classic", "power-law", "modified", "hybrid"])
def test_calibrate__of_the_sweep_converges_and_says_so(fits, name):
    fit = fits[name]
    assert fit.converged
    assert fit.convergence_failures == ()
    assert np.all(fit.summary["r_hat"] < 1.01)
    assert np.all(fit.summary[["ess_bulk", "ess_tail"]] >= 400)
    assert fit.form.name == name


def test_calibrate__posterior_means_are_near_least_squares_on_log_load(fits, paper):
    # With weak priors the posterior sits where ordinary least squares on log load does.
    rows = paper.calibration.frame
    a, b, Q, p = (rows[name].to_numpy(float) for name in ("a_over_R", "b_over_R", "Q", "p_over_E"))
    residual = np.log(p) - 2 * np.log((Q / 2 - 1) * (a + b))
    c = np.exp(-residual.mean() / 2)
    se = residual.std(ddof=1) / np.sqrt(len(rows)) / 2
    summary = fits["modified"].summary.set_index("parameter")
    # The prior, log-sd 0.1 about 1.382, pulls by (se/0.1)^2 of a distance of 0.01: nothing here.
    assert summary.loc["c", "mean"] == pytest.approx(c, rel=0.1 * se)
    assert summary.loc["c", "sd"] == pytest.approx(c * se, rel=0.1)
    assert summary.loc["sigma", "mean"] == pytest.approx(residual.std(ddof=1), rel=0.05)


def test_calibrate__summary_is_of_all_draws_in_the_parameters_themselves(fits):
    fit = fits["hybrid"]
    assert fit.summary["parameter"].tolist() == ["c1", "c2", "sigma"]
    expected = fit.model.to_theta(fit.chains.u.reshape(-1, 3)).mean(axis=0)
    np.testing.assert_allclose(fit.summary["mean"], expected, rtol=1e-12)  # algebra


def test_calibrate__same_seed_same_draws_other_seed_others(paper):
    def draws(rng):
        return rb.calibrate(paper, rb.Modified(), rng=rng, accuracy="quick", noise="iid").draws

    assert draws(3).tobytes() == draws(3).tobytes()
    assert not np.any(draws(3) == draws(4))
    generators = [draws(np.random.default_rng(5)) for _ in range(2)]
    assert generators[0].tobytes() == generators[1].tobytes()


def test_calibrate__takes_priors_noise_and_progress(paper):
    lines = []
    fit = rb.calibrate(
        paper,
        rb.Modified(),
        noise=Noise(),
        priors={"modified": {"c": rb.LogNormal(1.0, 1e-4)}},
        rng=1,
        settings=SHORT,
        progress=lines.append,
    )
    assert fit.noise.name == "iid"
    assert fit.summary["mean"][0] == pytest.approx(1.0, abs=1e-3)  # the prior leaves no choice
    assert lines


def test_calibrate__tells_in_the_record_that_it_did_not_converge(paper):
    settings = rb.SampleSettings(n_walker=32, n_burn=20, n_step_max=100, n_tau=500)
    fit = rb.calibrate(paper, rb.Modified(), rng=1, settings=settings, noise="iid")
    assert not fit.converged
    assert fit.convergence_failures[0].startswith("c: 100 steps are not 500 tau")
    assert "NOT converged: c: 100 steps" in repr(fit)
    for draws in (fit.draws, pickle.loads(pickle.dumps(fit)).draws):
        with pytest.raises(ValueError, match="read-only"):
            draws[0, 0] = 1.0


def test_calibrate__refuses_the_half_plane_on_rows_that_it_made(paper, fe_fits):
    rule = (
        "41 calibration rows have solver 'half-plane'. The half-plane form is not compared on "
        "rows that its own equation generated: that would be circular"
    )
    with pytest.raises(rb.InputError, match=rule):
        rb.calibrate(paper, rb.HalfPlane(), noise="iid")
    assert fe_fits["half-plane"].converged
    refuse_circular(paper, rb.Hybrid())  # other forms may


def test_calibrate__half_plane_on_finite_elements_needs_no_coefficient(fe_fits):
    summary = fe_fits["half-plane"].summary.set_index("parameter")
    # Known: finite-strain loads lie within 1 % of the equation up to p/E = 0.015; c is a root.
    assert summary.loc["c", "mean"] == pytest.approx(1, abs=0.005)


@pytest.mark.slow
def test_calibrate__noiseless_loads_of_textures_alike_converge():
    # Two textures with a = b: their loads differ by a factor, equal but for rounding.
    widths = [(0.0125, 0.0125), (0.01875, 0.025), (0.03125, 0.0125), (0.03125, 0.03125)]
    table = rb.generate(rb.Scene.of(widths, p_over_E=0.015))
    fit = rb.calibrate(table, rb.Hybrid(), rng=1)
    assert fit.converged
    assert set(fit.error_model_weights) == {"step-smooth", "step-smooth:student"}


def test_calibrate__rows_without_misfit_give_their_coefficients_where_offsets_are_shared(paper):
    frame = paper.calibration.frame
    frame["p_over_E"] = rb.Modified().load(
        frame["Q"], frame["a_over_R"], frame["b_over_R"], np.array([1.39])
    )
    fit = rb.calibrate(rb.ContactTable.from_frame(frame), rb.Modified(), noise="texture", rng=1)
    mean = fit.summary.set_index("parameter")["mean"]
    assert fit.converged
    assert mean["c"] == pytest.approx(1.39, abs=1e-7)  # loads are known to 1e-8
    assert mean["sigma"] < 1e-8


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"noise": "cauchy"}, "noise 'cauchy': not an error model"),
        ({"noise": None}, "noise None: not an error model"),
        ({"settings": 5}, "settings: expected SampleSettings or None, got 5"),
        ({"progress": "x"}, "progress: expected Callable or None, got 'x'"),
        ({"accuracy": np.zeros(2)}, "accuracy: expected one of quick, standard, reference, got"),
        ({"rng": -3}, "rng: expected a non-negative integer or a numpy Generator, got -3"),
        ({"priors": [1]}, r"priors: expected a mapping by form or a path, got \[1\]"),
    ],
)
def test_calibrate__refuses_what_is_no_noise_seed_or_prior(paper, options, words):
    with pytest.raises(rb.InputError, match=words):
        rb.calibrate(paper, rb.Modified(), **{"noise": "iid"} | options)


def many_textures(n=45, seed=1):
    """Rows of more textures than a walk is for, 3 % noise."""
    rng = np.random.default_rng(seed)
    rows = []
    for i in range(n):
        a, b = 0.01 + 0.0005 * i, 0.02
        for Q in (4, 6, 8):
            load = ((Q / 2 - 1) * (a + b) / 1.4) ** 2 * np.exp(0.03 * rng.standard_normal())
            rows.append({"a_over_R": a, "b_over_R": b, "Q": Q, "p_over_E": load})
    return rb.ContactTable.from_frame(pd.DataFrame(rows))


def test_calibrate__power_law_of_many_textures_has_the_moments_of_quadrature():
    fit = rb.calibrate(many_textures(), rb.PowerLaw(), rng=2, noise="iid")
    assert fit.converged
    assert fit.model.n_parameter == 46
    rows, prior = fit.model.data, stats.halfnorm(scale=0.05)
    # Of each texture three rows: log loads less 2 ln shape are normal about -2 ln K.
    y = (rows.log_load - 2 * np.log(rows.Q - 2)).reshape(45, 3)
    centre = np.array([-2 * np.log(2 * 1.382 / (a + b)) for a, b in rows.textures])[:, None]

    def log_likelihood(sigma):
        covariance = sigma**2 * np.eye(3) + 0.6**2
        return stats.multivariate_normal(np.zeros(3), covariance).logpdf(y - centre).sum()

    top = log_likelihood(0.03)

    def moment(power):
        def density(s):
            return s**power * prior.pdf(s) * np.exp(log_likelihood(s) - top)

        return integrate.quad(density, 0.01, 0.1, epsrel=1e-8)[0]

    sigma = fit.model.to_theta(fit.chains.u)[..., -1]
    mean = moment(1) / moment(0)
    n = float(effective_sample_size(sigma))
    assert abs(sigma.mean() - mean) < 4 * sigma.std() / np.sqrt(n)  # Monte Carlo
    sd = np.sqrt(moment(2) / moment(0) - mean**2)
    assert sigma.std() == pytest.approx(sd, rel=4 / np.sqrt(2 * n))  # Monte Carlo
    exact = np.log(moment(0)) + top
    assert abs(fit.evidence.value - exact) < 4 * fit.evidence.se
    again = rb.calibrate(many_textures(), rb.PowerLaw(), rng=2, noise="iid")
    assert again.draws.tobytes() == fit.draws.tobytes()


@pytest.mark.parametrize("form", ["modified", "power-law"])
def test_calibrate__importance_draws_agree_with_a_walk(fits, paper, form):
    settings = rb.SampleSettings(n_walker=64, tau_change=0.2)
    drawn, walked = fits[form], rb.calibrate(paper, form, rng=3, noise="iid", settings=settings)
    assert (drawn.sampler, walked.sampler) == ("importance", "emcee")
    difference = drawn.summary["mean"] - walked.summary["mean"]
    se = np.hypot(drawn.summary["mcse_mean"], walked.summary["mcse_mean"])
    assert np.all(np.abs(difference) < 4 * se)  # Monte Carlo: the largest of ten
    ratio = drawn.summary["sd"] / walked.summary["sd"]
    model, chains = drawn.model, drawn.chains
    sizes = summarise(model.to_theta(chains.u), model.parameter_names)["ess_bulk"]
    expected = chains.acceptance.mean() * sizes  # algebra: repeated draws count once
    np.testing.assert_allclose(drawn.summary["ess_bulk"], expected, rtol=1e-12)
    least = min(drawn.summary["ess_bulk"].min(), walked.summary["ess_bulk"].min())
    assert np.all(np.abs(ratio - 1) < 4 / np.sqrt(least))  # Monte Carlo: of both sds


def test_from_netcdf__brings_a_fit_back(fits, tmp_path):
    fit, path = fits["hybrid"], tmp_path / "posterior-hybrid.nc"
    fit.to_netcdf(path)
    back = rb.Fit.from_netcdf(path)
    assert back.draws.tobytes() == fit.draws.tobytes()
    assert list(tmp_path.iterdir()) == [path]


def test_fit__is_a_table_and_a_picture_of_its_errors(fits):
    fit = fits["modified"]
    pd.testing.assert_frame_equal(fit.to_dataframe(), fit.summary)
    assert fit.to_dataframe() is not fit.summary
    axes = fit.plot()
    assert axes.get_title() == "Modified"
    observed = np.asarray(axes.lines[0].get_xdata(), float)
    np.testing.assert_allclose(observed, np.exp(fit.model.data.log_load))
    assert len(repr(fit)) < 200
    assert fit._repr_html_().count("<tr") == 1 + len(fit.summary)


@pytest.mark.parametrize("kind", ["bracket", "count"])
def test_fit__of_brackets_has_a_picture_of_nearest_loads_and_counts_have_none(paper, kind):
    data = Observations.from_table(paper)
    if kind == "bracket":
        data = replace(data, log_lower=data.log_load - 0.02)
    else:
        data = replace(data, is_count=np.ones(41, bool))
    fit = drawn_posterior(Model(data, rb.Modified()), n_draw=128)
    if kind == "count":
        with pytest.raises(rb.InputError, match="modified: expected a row with a load to plot"):
            rb.Fit.of(fit).plot()
    else:
        line = rb.Fit.of(fit).plot().lines[0]
        observed = np.asarray(line.get_xdata(), float)
        median = np.log(observed * (1 + np.asarray(line.get_ydata(), float) / 100))
        nearest = np.clip(median, data.log_load - 0.02, data.log_load)
        np.testing.assert_allclose(np.log(observed), nearest)
        assert 0 < np.sum(np.abs(nearest - median) < 1e-9) < 41  # some brackets have the median
