"""Calibration of friction: its density against a dense covariance, a known truth, files."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes.friction.density import FrictionDensity, FrictionRows
from ridgebayes.friction.terms import coefficients, terms


def made(n_subject=6, seed=1):
    """A smooth surface at two loads, on two days of each subject; tau0 = 0.09 E, effects known."""
    rng, rows = np.random.default_rng(seed), []
    for i in range(n_subject):
        subject = 0.2 * rng.standard_normal()
        for day in "12":
            session = subject + 0.1 * rng.standard_normal()
            for p in (0.004, 0.01):
                mu = (
                    0.09 * 0.8 * 1.382 / np.sqrt(p) * np.exp(session + 0.05 * rng.standard_normal())
                )
                rows.append((None, None, p, mu, 0.02 * mu, f"S{i}", day))
    names = ["a_over_R", "b_over_R", "p_over_E", "mu", "mu_se", "subject", "session"]
    return pd.DataFrame(rows, columns=names)


@pytest.fixture(scope="module")
def fitted():
    frame = made().assign(role=["calibration"] * 22 + ["held-out"] * 2)
    model = rb.FrictionModel(kappa=0, area_factor=0.8, beta=0.24)
    return rb.calibrate_friction(frame, None, model, rng=1)


def test_log_likelihood__is_that_of_the_dense_covariance():
    rng, n = np.random.default_rng(3), 12
    contact = rng.uniform(0.1, 5, (n, 3))
    spread = 0.05 * contact[..., None] * rng.standard_normal((n, 3, 2))
    groups = np.arange(n) // 6, np.arange(n) // 3, np.arange(n) % 2
    mu = rng.uniform(0.3, 1, n)
    rows = FrictionRows(mu, 0.1 * rng.uniform(0, 1, n) * mu, contact, spread, groups)
    theta = np.array([[0.1, 0.05, 0.8, 0.3, 0.2, 0.3, 0.2, 0.1, 0.15]] * 2)
    theta[1] *= 1.3
    found = FrictionDensity(rb.FrictionModel(), rows).log_likelihood(theta)
    for one, value in zip(theta, found, strict=True):
        mean = terms(contact, np.broadcast_to(one, (n, 9))).sum(axis=1)
        slope = np.einsum("j,njk->nk", coefficients(one)[:3], spread) / mean[:, None]
        covariance = np.diag(one[8] ** 2 + (rows.se / mu) ** 2) + slope @ slope.T
        for codes, scale in zip(groups, one[5:8], strict=True):
            covariance += scale**2 * (codes[:, None] == codes)
        exact = stats.multivariate_normal(np.log(mean), covariance).logpdf(np.log(mu))
        assert value == pytest.approx(exact, abs=1e-9)


@pytest.mark.slow
def test_calibrate__finds_a_known_truth(fitted):
    assert fitted.converged
    found = fitted.summary.set_index("parameter")
    assert list(found.index) == ["tau0", "tau_subject", "tau_session", "tau_rig", "sigma"]
    truth = {"tau0": 0.09, "tau_subject": 0.2, "tau_session": 0.1, "sigma": 0.05}
    for name, value in truth.items():
        assert abs(found.loc[name, "mean"] - value) < 3 * found.loc[name, "sd"], name
    assert found.loc["sigma", "sd"] < 0.02  # a fifth of the prior's
    assert fitted.evidence.ok
    assert len(fitted.rows) == 24
    assert (fitted.rows["mu_lower"] < fitted.rows["mu_upper"]).all()
    assert fitted.theta[:, [1, 2, 3, 4]].tolist()[0] == [0.0, 0.8, 0.24, 0.0]


@pytest.mark.slow
def test_calibrate__evidence_is_that_of_quadrature():
    """One unknown parameter: the integral over its score on a grid."""
    model = rb.FrictionModel(0.09, 0, 0.8, 0.24, 0, 0.2, 0.1, 0.0, "halfnormal(0.1)")
    frame = made()
    fit = rb.calibrate_friction(frame, None, model, rng=2)
    width = 1.381976597885342 * np.sqrt(frame["p_over_E"].to_numpy())
    contact = np.stack([width / frame["p_over_E"], width, 0 * width], axis=1)
    table = rb.read_friction_table(frame).frame
    density = FrictionDensity(model, FrictionRows.of(table, contact, np.zeros((24, 3, 0))))
    u = np.linspace(-6, 4, 2_001)
    exact = np.log(np.exp(density.log_density(u[:, None])).sum() * (u[1] - u[0]))
    assert fit.evidence.method == "importance"
    assert fit.converged
    assert abs(fit.evidence.value - exact) < max(3 * fit.evidence.se, 1e-3)
    mean = np.average(
        0.1 * stats.halfnorm.ppf(stats.norm.cdf(u)), weights=np.exp(density.log_density(u[:, None]))
    )
    row = fit.summary.iloc[0]
    assert abs(row["mean"] - mean) < 4 * row["mcse_mean"]


def test_fit__comes_back_from_its_file(fitted, tmp_path):
    fitted.to_netcdf(tmp_path / "f.nc")
    again = rb.FrictionFit.from_netcdf(tmp_path / "f.nc")
    np.testing.assert_array_equal(again.theta, fitted.theta)
    pd.testing.assert_frame_equal(again.rows, fitted.rows, check_dtype=False)
    pd.testing.assert_frame_equal(again.summary, fitted.summary)
    assert again.model == fitted.model
    assert again.evidence == fitted.evidence
    assert again.table_digest == fitted.table_digest
    assert repr(again) == repr(fitted)
    posterior = again.to_arviz()["posterior"]
    assert set(posterior.data_vars) == set(fitted.model.unknown)
    with pytest.raises(rb.InputError, match="no such file"):
        rb.FrictionFit.from_netcdf(tmp_path / "g.nc")


@pytest.mark.long
def test_calibrate__on_ridges_draws_their_contact_and_predicts_a_scene(fits):
    """Two textures from a posterior of counts; the band of a scene narrows."""
    frame = made(4).assign(a_over_R=0.022, b_over_R=0.02)
    frame.loc[::2, ["a_over_R", "b_over_R"]] = 0.012, 0.03
    fit = rb.calibrate_friction(frame, fits["hybrid"], rng=1)
    scene = rb.Scene.of([(0.022, 0.02)])
    drawn = rb.friction_inputs(fits["hybrid"], scene, [0.006], n=400, rng=1, edges=True)
    before, after = rb.FrictionModel().predict(drawn), fit.predict(drawn)
    width = [(each.bands["mu_upper"] / each.bands["mu_lower"]).iloc[0] for each in (before, after)]
    assert width[1] < 0.5 * width[0]
    inputs = after.shares[after.shares["kind"] == "input"]["name"]
    assert list(inputs) == ["contact", "parameters", "subject", "session", "rig", "repeat"]


def test_calibrate__refuses_what_cannot_be_fitted():
    frame = made(2)
    model = rb.FrictionModel(kappa=0)
    with pytest.raises(rb.InputError, match="expected a row of role calibration, got none"):
        rb.calibrate_friction(frame.assign(role="held-out"), None, model)
    with pytest.raises(rb.InputError, match="expected a Fit or a Comparison for rows on ridges"):
        rb.calibrate_friction(frame.assign(a_over_R=0.02, b_over_R=0.02), None, model)
    known = rb.FrictionModel(0.07, 0, 0.8, 0.24, 0, 0.1, 0.1, 0.1, 0.1)
    with pytest.raises(rb.InputError, match="expected a parameter with a distribution"):
        rb.calibrate_friction(frame, None, known)
