from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from ridgebayes.distributions.bounded import Uniform
from ridgebayes.distributions.distribution import HalfNormal, LogNormal
from ridgebayes.errors import ComputationError
from ridgebayes.evidence import laplace_evidence
from ridgebayes.inference.coordinates import Funnel
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import Laplace, fit_laplace, several_modes
from ridgebayes.model.forms import Hybrid, Modified, PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.table.table import ContactTable
from tests.model.forms.even import Even

FACTOR = np.array([[0.3, 0, 0], [-0.04, 0.02, 0], [0.1, 0.2, 0.15]])
MODE = np.array([0.3, 0.02, -0.5])
SIGMA = HalfNormal(0.05)
TURN = np.array([[0.8, -0.6], [0.6, 0.8]])


def error_variance(known):
    """What a model with sigma alone says of the rows' variance, at its normal score."""
    return lambda u_noise: SIGMA.value_at(u_noise[..., 0]) ** 2 + known


def made_up(known_variance, information=(2e-3, 50.0)):
    funnel = Funnel(TURN, np.array(information), error_variance(known_variance))
    return Laplace(MODE, FACTOR, 1.5, funnel.about(MODE), 1)


@pytest.mark.parametrize("known_variance", [0.0, 0.02**2])
def test_whiten__inverts_unwhiten(known_variance):
    laplace = made_up(known_variance)
    z = np.random.default_rng(1).standard_normal((2, 5, 3))
    u, log_jacobian = laplace.unwhiten(z)
    back, again = laplace.whiten(u)
    # Algebra: rounding times the condition of the factor (about 100).
    np.testing.assert_allclose(back, z, rtol=0, atol=1e-11)
    np.testing.assert_allclose(again, log_jacobian, rtol=0, atol=1e-11)


@pytest.mark.parametrize("known_variance", [0.0, 0.02**2])
def test_unwhiten__jacobian_and_volume_are_the_determinant_by_finite_differences(known_variance):
    laplace, h = made_up(known_variance), 1e-5
    for z in np.random.default_rng(2).standard_normal((5, 3)):
        columns = [laplace.unwhiten(z + d)[0] - laplace.unwhiten(z - d)[0] for d in h * np.eye(3)]
        log_determinant = np.linalg.slogdet(np.array(columns) / (2 * h))[1]
        total = laplace.unwhiten(z)[1] + laplace.log_volume
        assert total == pytest.approx(log_determinant, abs=1e-8)  # discretisation: h^2


def test_unwhiten__of_several_error_parameters_and_offsets_has_the_determinant_of_differences():
    # Two coefficients, two error parameters that widen them, an offset's coordinate that does not.
    factor = np.eye(5) + 0.1 * np.tril(np.random.default_rng(3).standard_normal((5, 5)), -1)
    funnel = Funnel(TURN, np.array([2e-3, 50.0]), lambda u: 0.01 * np.exp(u).sum(axis=-1))
    mode, h = np.array([0.3, 0.02, -0.5, 0.2, 0.0]), 1e-5
    laplace = Laplace(mode, factor, 0.0, funnel.about(mode[:4]), 2)
    assert laplace.n_curved == 4
    for z in np.random.default_rng(4).standard_normal((5, 5)):
        columns = [laplace.unwhiten(z + d)[0] - laplace.unwhiten(z - d)[0] for d in h * np.eye(5)]
        log_determinant = np.linalg.slogdet(np.array(columns) / (2 * h))[1]
        u, log_jacobian = laplace.unwhiten(z)
        total = log_jacobian + laplace.log_volume
        assert total == pytest.approx(log_determinant, abs=1e-8)  # discretisation: h^2
        # Both error parameters widen the coefficients.
        wider = funnel.log_scales(u[2:4]) - funnel.log_scales(laplace.mode[2:4])
        assert log_jacobian == pytest.approx(wider.sum(), abs=1e-11)  # algebra
        back, again = laplace.whiten(u)
        np.testing.assert_allclose(back, z, rtol=0, atol=1e-11)  # algebra
        assert again == pytest.approx(log_jacobian, abs=1e-11)


def test_unwhiten__puts_the_error_model_before_many_coefficients():
    funnel = Funnel(np.eye(5), np.full(5, 50.0), lambda u: 0.01 * np.exp(u).sum(axis=-1))
    mode = np.linspace(-0.4, 0.4, 8)  # five coefficients, two error parameters, an offset
    laplace = Laplace(mode, np.diag(np.arange(1.0, 9.0)), 0.0, funnel.about(mode[:7]), 2)
    assert laplace.n_curved == 2
    u = np.array([laplace.unwhiten(z)[0] for z in np.eye(8)])
    np.testing.assert_allclose(u[:2, 5:7] - mode[5:7], np.diag([6.0, 7.0]), rtol=1e-12)  # algebra
    assert np.array_equal(u[2:, 5:7], np.tile(mode[5:7], (6, 1)))
    assert np.array_equal(np.argmax(np.abs(u[2:] - mode), axis=1), [0, 1, 2, 3, 4, 7])
    back = laplace.whiten(u)[0]
    np.testing.assert_allclose(back, np.eye(8), rtol=0, atol=1e-12)  # rounding


def test_unwhiten__of_the_origin_is_the_mode():
    laplace = made_up(0.02**2)
    u, log_jacobian = laplace.unwhiten(np.zeros(3))
    assert u.tolist() == laplace.mode.tolist()
    assert log_jacobian == 0


@pytest.mark.parametrize("known", [0.0, 0.02])
def test_unwhiten__widens_each_direction_as_rows_of_that_sigma_and_the_prior_would(known):
    # A direction's spread is (information/variance + 1)^(-1/2); the mode has u_sigma = 0.
    information = np.array([1e-4, 3.0])
    funnel = Funnel(TURN, information, error_variance(known**2))
    frame = funnel.about(np.zeros(3))
    laplace = Laplace(np.zeros(3), np.diag([0.1, 0.1, 1.0]), 0.0, frame, 1)
    for u_sigma in (-3.0, 0.7):
        sigma = stats.halfnorm(scale=0.05).ppf(stats.norm.cdf([0.0, u_sigma]))
        spread = 1 / np.sqrt(information / (sigma[:, None] ** 2 + known**2) + 1)
        for i in (0, 1):
            u, _ = laplace.unwhiten(np.append(TURN[:, i], u_sigma))
            expected = 0.1 * TURN[:, i] * spread[1, i] / spread[0, i]
            np.testing.assert_allclose(u[:2], expected, rtol=1e-10)  # algebra


@pytest.mark.slow
@pytest.mark.parametrize("name", ["classic", "modified", "hybrid", "power-law"])
def test_fit_laplace__has_its_mode_and_curvature_where_finite_differences_do(fits, laplaces, name):
    model, laplace = fits[name].model, laplaces[name]

    def in_z(z):
        u, log_jacobian = laplace.unwhiten(z)
        return float(model.log_density(u) + log_jacobian)

    n, h = len(laplace.mode), 1e-3
    unit = np.eye(n)
    slope = [(in_z(h * e) - in_z(-h * e)) / (2 * h) for e in unit]
    # The search stops within 1e-4 posterior sds of the mode; discretisation h^2 = 1e-6.
    assert np.abs(slope).max() < 2e-4
    h = 0.02
    hessian = [
        [
            (in_z(h * (e + f)) - in_z(h * (e - f)) - in_z(h * (f - e)) + in_z(-h * (e + f)))
            / (4 * h * h)
            for f in unit
        ]
        for e in unit
    ]
    # In whitened coordinates the curvature is minus one; discretisation h^2 = 4e-4.
    np.testing.assert_allclose(hessian, -np.eye(n), atol=2e-3)
    assert laplace.log_density == pytest.approx(float(model.log_density(laplace.mode)), rel=1e-14)


def test_log_evidence__is_exact_for_a_normal():
    covariance = FACTOR @ FACTOR.T
    peak = 7.0 + stats.multivariate_normal(MODE, covariance).logpdf(MODE)
    laplace = Laplace(MODE, FACTOR, float(peak), made_up(0.0).frame, 1)
    assert laplace.log_evidence == pytest.approx(7.0, abs=1e-11)  # algebra
    record = laplace_evidence(laplace)
    assert record.value == laplace.log_evidence
    assert np.isnan(record.se)
    assert (record.method, record.ok) == ("laplace", True)


def test_log_evidence__of_the_sweep_is_a_good_first_look(laplaces):
    # Reference: the log evidences of the 41 rows. The error is the approximation's own, O(1/n).
    assert laplaces["hybrid"].log_evidence == pytest.approx(83.3869, abs=0.1)
    assert laplaces["modified"].log_evidence == pytest.approx(78.8628, abs=0.1)


def test_fit_laplace__finds_the_mode_with_known_errors_too():
    rng = np.random.default_rng(5)
    Q = np.arange(4, 24, 2)
    load = Modified().load(Q, 0.02, 0.02) * np.exp(0.03 * rng.standard_normal(Q.size))
    frame = pd.DataFrame(
        {"a_over_R": 0.02, "b_over_R": 0.02, "Q": Q, "p_over_E": load, "rel_se": 0.01}
    )
    model = Model(Observations.from_table(ContactTable.from_frame(frame)), Modified())
    laplace = fit_laplace(model)
    sigma = model.to_theta(laplace.mode)[-1]
    # Algebra: sigma's square and a mean of equals.
    found = float(laplace.frame.funnel.error_variance(laplace.mode[1:]))
    assert found == pytest.approx(sigma**2 + 1e-4, rel=1e-12)

    def in_z(z):
        u, log_jacobian = laplace.unwhiten(z)
        return float(model.log_density(u) + log_jacobian)

    around = [in_z(0.05 * e) for e in np.concatenate([np.eye(2), -np.eye(2)])]
    # Curvature one: 0.05 sds away the density has fallen by 0.05^2/2; third derivatives add 2e-4.
    np.testing.assert_allclose(in_z(np.zeros(2)) - np.array(around), 0.00125, atol=2e-4)


@pytest.mark.parametrize("structure", Noise.structures[1:])
def test_fit_laplace__has_the_mode_and_curvature_of_the_error_models_parameters(
    structure, observed
):
    texture, Q = (x.ravel() for x in np.meshgrid([0, 1, 2, 3], [4, 6, 8, 12]))
    a, b = np.array([(0.012, 0.03), (0.032, 0.01), (0.022, 0.02), (0.018, 0.045)])[texture].T
    rng = np.random.default_rng(6)
    log_load = np.log(Hybrid().load(Q, a, b, [1.35, 0.01])) + 0.03 * rng.standard_normal(16)
    log_load += 0.05 * rng.standard_normal(4)[texture]
    model = Model(observed(texture, Q, log_load), Hybrid(), Noise(structure))
    laplace = fit_laplace(model)
    assert laplace.is_mode
    assert laplace.log_density == pytest.approx(float(model.log_density(laplace.mode)), rel=1e-14)
    np.testing.assert_allclose(laplace.unwhiten(np.zeros(len(laplace.mode)))[0], laplace.mode)

    def in_z(z_noise):
        u, log_jacobian = laplace.unwhiten(np.append(np.zeros(2), z_noise))
        return float(model.log_density(u) + log_jacobian)

    n = model.n_parameter - 2
    h, unit = 0.02, np.eye(n)
    slope = [(in_z(h * e) - in_z(-h * e)) / (2 * h) for e in unit]
    # Search: 1e-5 in prior sds, and where it is linearised about; discretisation h^2 = 4e-4.
    assert np.abs(slope).max() < 2e-3
    hessian = [
        [
            (in_z(h * (e + f)) - in_z(h * (e - f)) - in_z(h * (f - e)) + in_z(-h * (e + f)))
            / (4 * h * h)
            for f in unit
        ]
        for e in unit
    ]
    # Discretisation: steps of 0.1 prior sds there, of h here.
    np.testing.assert_allclose(hessian, -unit, atol=2e-2)


def table_of(load, n_count=2, **columns):
    """Two textures with as many counts each, and what loads they have by Hybrid, times `load`."""
    frame = pd.DataFrame({"a_over_R": [0.02] * n_count + [0.01] * n_count, **columns})
    frame["b_over_R"] = 2e-4 / frame["a_over_R"]
    frame["Q"] = np.tile(4 + 2 * np.arange(n_count), 2)
    known = frame["Q"].to_numpy(), frame["a_over_R"].to_numpy(), frame["b_over_R"].to_numpy()
    frame["p_over_E"] = Hybrid().load(*known, [1.09, 0.06]) * load
    return Observations.from_table(ContactTable.from_frame(frame))


@pytest.mark.parametrize("sigma", [LogNormal(0.03, 0.3), Uniform(0.005, 0.1)])
def test_fit_laplace__takes_data_without_misfit_where_the_prior_keeps_sigma_from_zero(sigma):
    model = Model(table_of(1.0, 5), Hybrid(), priors={"sigma": sigma})
    found = fit_laplace(model)
    assert found.is_mode
    assert model.to_theta(found.mode)[-1] > 0.004


@pytest.mark.parametrize("n_count", [2, 5])
@pytest.mark.parametrize("noise", ["iid", "iid:student"])
def test_fit_laplace__refuses_data_without_misfit(n_count, noise):
    rule = r"hybrid: the posterior has no interior mode.* sigma has no lower bound"
    with pytest.raises(ComputationError, match=rule):
        fit_laplace(Model(table_of(1.0, n_count), Hybrid(), Noise.named(noise)))


@pytest.mark.parametrize(
    ("load", "columns"),
    [
        ([1.0, 1.0, 1.0, 1 + 1e-9], {}),  # a load with ten digits
        (1.0, {"rel_se": 0.01}),  # loads whose errors are known bound sigma's likelihood
    ],
)
def test_fit_laplace__takes_rows_that_agree_nearly_or_have_errors_of_their_own(load, columns):
    found = fit_laplace(Model(table_of(np.array(load), **columns), Hybrid(), Noise.named("iid")))
    assert found.is_mode


def test_several_modes__of_plain_rows_finds_the_mirror_image(observed):
    texture, Q = np.repeat([0, 1], 3), np.tile([4, 6, 8], 2)
    own = np.array([0.05, 0.02, 0.04, -0.08, -0.02, -0.06])
    model = Model(observed(texture, Q, 2 * np.log((Q / 2 - 1) * 0.042 / 1.4) + own), Even())
    assert model.is_iid_gaussian
    laplace = fit_laplace(model)
    (said,) = several_modes(model, laplace)
    c2, sigma = model.to_theta(laplace.mode)
    assert "whose ln evidence is +0.0 " in said.replace("-0.0", "+0.0")
    told = said.split(" at ")[1].split(", whose ")[0]
    place = dict(part.split(" = ") for part in told.split(", "))
    # Tolerance: searches end within a hundredth of a posterior sd, which is a few per cent.
    assert float(place["c2"]) == pytest.approx(-c2, rel=1e-3)
    assert float(place["sigma"]) == pytest.approx(sigma, rel=1e-2)


def test_fit_laplace__of_rows_without_relation_to_the_form_ends_on_the_hump_that_counts(paper):
    # From the prior's centre a search ended 54 lower, at errors a hundred times too narrow.
    data, rng = Observations.from_table(paper), np.random.default_rng(1)
    load = rng.uniform(np.log(1e-4), np.log(2e-2), len(data))
    load = load[np.lexsort((load, data.texture))]
    model = Model(replace(data, log_load=load), Modified(), Noise("texture+step", "student"))
    found = fit_laplace(model)
    evidence = importance_posterior(model, found, seed=1)[1]
    assert evidence.ok
    # Laplace's method, of a posterior with several humps.
    assert found.log_evidence == pytest.approx(evidence.value, abs=10)


@pytest.mark.parametrize("noise", ["step:student", "step-smooth:student", "texture+step:student"])
def test_fit_laplace__of_a_k_for_each_row_is_no_denser_than_its_prior(noise):
    """From the prior's centre all rows are outliers, where sigma is small by any factor."""
    n, rng = 100, np.random.default_rng(5)
    share, pitch = rng.uniform(0.2, 0.8, n), rng.uniform(0.01, 0.05, n)
    Q = 4 + 2 * (np.arange(n) % 6)
    frame = pd.DataFrame({"a_over_R": share * pitch, "b_over_R": (1 - share) * pitch, "Q": Q})
    error = 0.01 * rng.standard_t(2, n) + 0.03 * rng.standard_normal(6)[np.arange(n) % 6]
    exact = Hybrid().load(Q, *frame[["a_over_R", "b_over_R"]].to_numpy().T, [1.348, 0.01583])
    frame["p_over_E"] = exact * np.exp(error)
    data = Observations.from_table(ContactTable.from_frame(frame))
    model = Model(data, PowerLaw(), Noise.named(noise))
    # Whatever errors and offsets are, each row's log load has its K's prior among its causes.
    sd_log_k = np.array([model.priors[name].log_sd for name in model.parameter_names[:n]])
    bound = -np.log(2 * sd_log_k * np.sqrt(2 * np.pi)).sum()
    # Tolerance: Laplace's own error, of a Student row seen through its K.
    assert fit_laplace(model).log_evidence < bound + 0.1 * n
