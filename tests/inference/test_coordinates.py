"""Coefficients given the error model's parameters, against dense matrices of all rows."""

import math

import numpy as np
import pytest

from ridgebayes.distributions.distribution import HalfNormal
from ridgebayes.inference.coordinates import Conditional, Funnel
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.power_law_exact import conditional_log_k
from ridgebayes.model.forms import HalfPlane, Hybrid, Modified, PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.noise import NUGGET, Noise
from ridgebayes.model.observations import Observations

STRUCTURES = Noise.structures
WIDTHS = np.array([(0.012, 0.03), (0.032, 0.01), (0.022, 0.02), (0.018, 0.045)])
TEXTURE = np.array([0, 1, 2, 3, 0, 1, 2, 3, 0, 0, 1, 1])  # two rows are there twice
Q = np.array([4, 4, 6, 6, 8, 12, 12, 4, 4, 6, 12, 14])
REL_SE = np.where(np.arange(12) % 3 == 1, 0.02, 0.0)


@pytest.fixture
def make(observed):
    """A model of rows near eq. (7)'s; `bracket` is the width of every second row."""

    def model(form, noise, bracket=0.0):
        rng = np.random.default_rng(1)
        a, b = WIDTHS[TEXTURE].T
        log_load = np.log(Hybrid().load(Q, a, b, [1.35, 0.01])) + 0.05 * rng.standard_normal(12)
        lower = np.where(np.arange(12) % 2, log_load - bracket, np.nan) if bracket else np.nan
        return Model(observed(TEXTURE, Q, log_load, rel_se=REL_SE, log_lower=lower), form, noise)

    return model


def covariance(model, u_noise, bracket=0.0):
    """Covariance of the rows, pair by pair, from the error model's definition."""
    u = np.append(np.zeros(model.n_coefficient), u_noise)
    eta = dict(zip(model.parameter_names, model.to_theta(u), strict=True))
    own = eta["sigma"] ** 2 + REL_SE**2 + bracket**2 / 12 * (np.arange(12) % 2)
    total, ratio = np.diag(own), WIDTHS[:, 0] / WIDTHS.sum(axis=1)
    for i in range(12):
        for j in range(12):
            if model.noise.structure == "step-smooth":
                far = math.log((Q[i] / 2 - 1) / (Q[j] / 2 - 1)) / eta["length_h"]
                wide = (ratio[TEXTURE[i]] - ratio[TEXTURE[j]]) / eta["length_ratio"]
                same = abs(far) < 1e-9 and abs(wide) < 1e-9
                correlation = math.exp(-0.5 * far**2 - 0.5 * wide**2) + NUGGET * same
                total[i, j] += eta["tau_step"] ** 2 * correlation
            else:
                total[i, j] += eta.get("tau_texture", 0.0) ** 2 * (TEXTURE[i] == TEXTURE[j])
                total[i, j] += eta.get("tau_step", 0.0) ** 2 * (Q[i] == Q[j])
    return total


def log_loads(model, u_coefficient):
    """Log loads of the rows by the form alone."""
    u = np.append(u_coefficient, np.zeros(model.n_parameter - model.n_coefficient))
    coefficients = model.to_theta(u)[: model.n_coefficient]
    a, b = WIDTHS[TEXTURE].T
    return np.log(model.form.load(Q, a, b, coefficients))


def derivatives(model, u_coefficient, h):
    """Derivatives of residuals: minus those of the log loads."""
    steps = h * np.eye(model.n_coefficient)
    each = [
        log_loads(model, u_coefficient - s) - log_loads(model, u_coefficient + s) for s in steps
    ]
    return np.transpose(each) / (2 * h)


def noises(model, n, seed=2):
    n_noise = model.n_parameter - model.n_coefficient
    return 0.7 * np.random.default_rng(seed).standard_normal((n, n_noise))


@pytest.mark.parametrize("form", [Hybrid(), Modified(), PowerLaw(), HalfPlane()])
@pytest.mark.parametrize("bracket", [0.0, 0.3])
def test_linearised__is_the_difference_of_log_loads_and_the_residual_of_middles(
    form, bracket, make
):
    model = make(form, Noise("texture"), bracket)
    at = 0.3 * np.random.default_rng(3).standard_normal(model.n_coefficient)
    columns = model.linearised(at)
    # Discretisation: h^2; rounding: eps / h.
    np.testing.assert_allclose(columns[:, :-1], derivatives(model, at, 1e-5), atol=1e-9)
    middle = model.data.log_load - 0.5 * bracket * (np.arange(12) % 2)
    np.testing.assert_allclose(columns[:, -1], middle - log_loads(model, at), atol=1e-13)  # algebra


def test_linearised__where_a_coefficient_vanishes_is_not_finite_and_warns_of_nothing(make):
    columns = make(Modified(), Noise(), 0.0).linearised(np.array([-1e5]))
    assert not np.isfinite(columns).any()


@pytest.mark.parametrize("bracket", [0.0, 1e-6])
@pytest.mark.parametrize("structure", STRUCTURES)
def test_products__are_those_with_the_dense_covariance(structure, bracket, make):
    model = make(Hybrid(), Noise(structure), bracket)
    columns = model.linearised(np.array([0.2, -0.3]))
    u_noise = noises(model, 6).reshape(2, 3, -1)
    found = model.products(u_noise, columns)
    assert found.shape == (2, 3, 3, 3)
    for forward in np.ndindex(2, 3):
        dense = columns.T @ np.linalg.solve(covariance(model, u_noise[forward], bracket), columns)
        # Of residuals with themselves only means of equal rows may count: not looked at.
        # Rounding: sums of 1e4 and a condition of 1e5, relative to the largest.
        scale = np.sqrt(np.outer(np.diag(dense), np.diag(dense)))[:2]
        np.testing.assert_allclose((found[forward][:2] - dense[:2]) / scale, 0, atol=1e-9)
        np.testing.assert_allclose(
            found[forward], found[forward].T, rtol=1e-9, atol=1e-9
        )  # rounding


@pytest.mark.parametrize("structure", STRUCTURES)
def test_products__of_wide_brackets_are_between_those_of_no_and_of_uniform_errors(structure, make):
    model = make(Hybrid(), Noise(structure), 0.3)
    columns = model.linearised(np.array([0.2, -0.3]))
    u_noise = noises(model, 5)
    found = model.products(u_noise, columns)[:, :2, :2]
    dense = np.stack(
        [columns.T @ np.linalg.solve(covariance(model, u, 0.3), columns) for u in u_noise]
    )
    assert np.all(np.linalg.eigvalsh(found) > 0)
    gain = np.linalg.eigvalsh(dense[:, :2, :2] - found)
    assert np.all(gain > -1e-9 * np.abs(dense).max())  # rounding


@pytest.mark.parametrize("structure", STRUCTURES)
def test_products__of_student_rows_are_between_those_of_no_and_of_normal_information(
    structure, make
):
    student, normal = (make(Hybrid(), Noise(structure, tail)) for tail in ("student", "normal"))
    columns = normal.linearised(np.zeros(2))
    u_noise = noises(student, 5)
    found = student.products(u_noise, columns)[:, :2, :2]
    upper = normal.products(u_noise[:, :-1], columns)[:, :2, :2]
    # Errors of the same scale and longer tails tell less in every direction.
    assert np.all(np.linalg.eigvalsh(found) > 0)
    assert np.all(np.linalg.eigvalsh(upper - found) > -1e-9 * np.abs(upper).max())  # rounding


@pytest.mark.parametrize("noise", Noise.every(), ids=lambda noise: noise.name)
def test_conditional__inverse_inverts_forward(noise, make):
    model = make(Hybrid(), noise)
    frame = Conditional.of(model, np.array([0.2, -0.3]))
    assert frame.n_coefficient == 2
    u_noise = noises(model, 6).reshape(2, 3, -1)
    w = np.random.default_rng(4).standard_normal((2, 3, 2))
    u, log_jacobian = frame.forward(w, u_noise)
    back, again = frame.inverse(u, u_noise)
    # Rounding: coordinates of order 1 in units of widths of 1e-2.
    np.testing.assert_allclose(back, w, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(again, log_jacobian)
    # Draws are served one by one: a single one has what it has among many.
    one, its = frame.forward(w[1, 2], u_noise[1, 2])
    np.testing.assert_allclose(one, u[1, 2], rtol=1e-11)  # rounding
    assert float(its) == pytest.approx(log_jacobian[1, 2], rel=1e-11)


@pytest.mark.parametrize("noise", Noise.every(), ids=lambda noise: noise.name)
def test_conditional__jacobian_is_the_determinant_by_finite_differences(noise, make):
    model, h = make(Hybrid(), noise), 1e-5
    frame = Conditional.of(model, np.array([0.2, -0.3]))
    n = model.n_parameter

    def mapped(x):
        return np.concatenate([frame.forward(x[:2], x[2:])[0], x[2:]])

    # The error model's parameters move the coefficients too: the determinant is of the whole map.
    rng = np.random.default_rng(5)
    for u_noise, w in zip(noises(model, 3), rng.standard_normal((3, 2)), strict=True):
        x = np.concatenate([w, u_noise])
        columns = [(mapped(x + d) - mapped(x - d)) / (2 * h) for d in h * np.eye(n)]
        expected = np.linalg.slogdet(np.array(columns))[1]
        _, log_jacobian = frame.forward(w, u_noise)
        assert float(log_jacobian) == pytest.approx(expected, abs=1e-7)  # rounding: eps / h / width


@pytest.mark.parametrize("form", [Modified(), PowerLaw()], ids=lambda form: form.name)
@pytest.mark.parametrize("structure", STRUCTURES)
def test_conditional__of_a_linear_form_is_the_dense_normal_conditional(form, structure, make):
    # Log loads are linear in the normal scores of log-normal coefficients: nothing is approximate.
    model = make(form, Noise(structure))
    k = model.n_coefficient
    slope = derivatives(model, np.zeros(k), 1.0)
    residual = model.data.log_load - log_loads(model, np.zeros(k))
    u_noise = noises(model, 4)
    # Wherever it is linearised.
    frame = Conditional.of(model, 0.5 * np.random.default_rng(6).standard_normal(k))
    centre, log_jacobian = frame.forward(np.zeros((4, k)), u_noise)
    for i in range(4):
        # By the rows' own covariance, not by the precision: c is normal(0, 1) a priori.
        gain = np.linalg.solve(slope @ slope.T + covariance(model, u_noise[i]), slope).T
        mean, spread = -gain @ residual, np.eye(k) - gain @ slope
        np.testing.assert_allclose(centre[i], mean, rtol=0, atol=1e-8)  # rounding: condition 1e6
        axes = [frame.forward(e, u_noise[i])[0] - centre[i] for e in np.eye(k)]
        # Rounding: a difference from 1, of widths down to 1e-3.
        np.testing.assert_allclose(np.transpose(axes) @ axes, spread, rtol=0, atol=1e-9)
        half = 0.5 * np.linalg.slogdet(spread)[1]
        assert log_jacobian[i] == pytest.approx(half, abs=1e-5)  # rounding: the same, relative


@pytest.mark.parametrize("structure", STRUCTURES)
def test_conditional__of_a_linear_form_leaves_standard_normals_of_the_density(structure, make):
    model = make(PowerLaw(), Noise(structure))
    k = model.n_coefficient
    frame = Conditional.of(model, np.full(k, 0.4))
    u_noise = np.broadcast_to(noises(model, 1), (7, model.n_parameter - k))
    w = 2 * np.random.default_rng(7).standard_normal((7, k))
    u, log_jacobian = frame.forward(w, u_noise)
    density = model.log_density(np.concatenate([u, u_noise], axis=1)) + log_jacobian
    flat = density + 0.5 * (w * w).sum(axis=1)
    np.testing.assert_allclose(flat, flat[0], rtol=0, atol=1e-8)  # rounding: condition 1e5


@pytest.mark.parametrize("noise", Noise.every(), ids=lambda noise: noise.name)
def test_conditional__where_nothing_can_be_factorised_has_no_volume_rather_than_none_known(
    noise, make
):
    model = make(Hybrid(), noise)
    frame = Conditional.of(model, np.zeros(2))
    far = np.array([-60.0, 0.0, 60.0])[:, None] * np.ones(model.n_parameter - 2)
    _, log_jacobian = frame.forward(np.zeros((3, 2)), far)
    assert not np.isnan(log_jacobian).any()
    assert np.isfinite(log_jacobian[1])


MODE = np.array([0.3, 0.02, -0.5])
SIGMA = HalfNormal(0.05)
TURN = np.array([[0.8, -0.6], [0.6, 0.8]])


def made_up(known_variance):
    """A funnel of two coefficients and sigma alone, at its normal score."""

    def error_variance(u_noise):
        return SIGMA.value_at(u_noise[..., 0]) ** 2 + known_variance

    return Funnel(TURN, np.array([2e-3, 50.0]), error_variance)


def test_slope__of_the_log_scales_is_the_central_difference():
    funnel, h = made_up(0.01**2), 1e-5
    for u in (-4.0, 0.0, 2.0):
        up, down = (float(funnel.log_scales(np.array([u + d])).sum()) for d in (h, -h))
        # Discretisation h^2, rounding eps/h.
        slope = funnel.slope(np.array([u]))
        assert slope.shape == (1,)
        assert slope[0] == pytest.approx((up - down) / (2 * h), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("known_variance", [0.0, 0.02**2])
def test_funnel__inverse_inverts_forward(known_variance):
    frame = made_up(known_variance).about(MODE)
    rng = np.random.default_rng(1)
    w, u_noise = rng.standard_normal((2, 5, 2)), rng.standard_normal((2, 5, 1))
    u, log_jacobian = frame.forward(w, u_noise)
    back, again = frame.inverse(u, u_noise)
    np.testing.assert_allclose(back, w, rtol=0, atol=1e-11)  # algebra
    np.testing.assert_array_equal(again, log_jacobian)


@pytest.mark.parametrize("known_variance", [0.0, 0.02**2])
def test_funnel__jacobian_is_the_determinant_by_finite_differences(known_variance):
    frame, h = made_up(known_variance).about(MODE), 1e-4
    rng = np.random.default_rng(2)
    for w, u_noise in zip(rng.standard_normal((5, 2)), rng.standard_normal((5, 1)), strict=True):
        _, log_jacobian = frame.forward(w, u_noise)
        columns = [
            frame.forward(w + d, u_noise)[0] - frame.forward(w - d, u_noise)[0]
            for d in h * np.eye(2)
        ]
        expected = np.linalg.slogdet(np.array(columns) / (2 * h))[1]
        assert log_jacobian == pytest.approx(expected, abs=1e-9)  # rounding: eps / h; linear in w


def test_funnel__at_the_mode_is_the_identity_about_it():
    frame, w = made_up(0.02**2).about(MODE), np.random.default_rng(3).standard_normal((4, 2))
    u, log_jacobian = frame.forward(w, np.broadcast_to(MODE[2:], (4, 1)))
    np.testing.assert_allclose(u, MODE[:2] + w, rtol=0, atol=1e-14)  # rounding
    assert not log_jacobian.any()


@pytest.mark.parametrize("information", [(2e-3, 50.0), (0.0, 50.0)])
def test_funnel__far_out_is_where_rows_say_nothing_or_all(information):
    sizes = {-1.0: 0.0, 0.0: 0.04, 1.0: np.inf, 2.0: 1e-310}

    def error_variance(u_noise):
        return np.vectorize(sizes.__getitem__)(u_noise[..., 0])

    funnel, known = Funnel(TURN, np.array(information), error_variance), np.array(information) > 0
    mode = np.array([*(TURN @ np.where(known, [0.3, 0.02], 0.0)), 0.0])
    frame = funnel.about(mode)
    # No information: the prior's width, about its centre. Exact loads: no width at all.
    np.testing.assert_array_equal(funnel.log_scales(np.array([1.0])), [0.0, 0.0])
    np.testing.assert_array_equal(funnel.log_scales(np.array([-1.0])), np.where(known, -np.inf, 0))
    widest, log_jacobian = frame.forward(np.zeros(2), np.array([1.0]))
    np.testing.assert_allclose(widest, 0.0, rtol=0, atol=1e-15)  # rounding
    assert log_jacobian == pytest.approx(-frame.log_scale.sum(), rel=1e-14)
    # Of an error variance of 0 the centre is what the rows alone say: (1 + variance/information).
    grown = np.where(known, 1 + 0.04 / np.where(known, information, 1.0), 0.0)
    for score in (-1.0, 2.0):
        exact, _ = frame.forward(np.zeros(2), np.array([score]))
        expected = TURN @ (grown * (mode[:2] @ TURN))
        np.testing.assert_allclose(exact, expected, rtol=0, atol=1e-13)  # rounding


@pytest.mark.slow
def test_funnel__information_is_the_curvature_of_the_likelihood(fits, laplaces):
    # At the expected residuals (zero) minus the likelihood's second derivative, times variance.
    model, laplace = fits["hybrid"].model, laplaces["hybrid"]
    funnel = laplace.frame.funnel
    information = funnel.basis * funnel.information @ funnel.basis.T
    np.testing.assert_allclose(information, model.information(laplace.mode), rtol=1e-3)
    theta, h = model.to_theta(laplace.mode), 1e-3
    a, b = model.data.a_over_R[model.data.texture], model.data.b_over_R[model.data.texture]

    def log_load(step):
        coefficients = model.to_theta(laplace.mode + np.append(step, 0.0))[:2]
        return np.log(model.form.load(model.data.Q, a, b, coefficients))

    jacobian = [(log_load(e) - log_load(-e)) / (2 * h) for e in h * np.eye(2)]
    expected = np.array(jacobian) @ np.transpose(jacobian)
    np.testing.assert_allclose(model.information(laplace.mode), expected, rtol=1e-5)
    assert theta[0] == pytest.approx(1.34, abs=0.05)


def test_funnel__centre_follows_the_exact_conditional_mean_down_to_tiny_sigmas(paper):
    # One row of each of five textures: sigma may be next to zero, and K is then told by its row.
    data = Observations.from_table(paper)
    first = [np.flatnonzero(data.texture == j)[0] for j in range(5)]
    model = Model(data.take(np.isin(np.arange(len(data)), first)), PowerLaw())
    frame = fit_laplace(model).frame
    sigma = 10.0 ** np.arange(-6.0, 0.0)
    u_noise = np.array([model.priors["sigma"].score(s) for s in sigma])[:, None]
    mean, sd = conditional_log_k(model, sigma)
    theta = np.concatenate([np.exp(mean), sigma[:, None]], axis=1)
    u, width = model.to_unconstrained(theta)[:, :5], sd / 0.3  # normal scores of log K: over log_sd
    found, _ = frame.forward(np.zeros((6, 5)), u_noise)
    # The mode is found to 1e-9 of its width or so; a width here is down to 1e-5 of that.
    np.testing.assert_allclose((found - u) / width, 0, atol=1e-2)
    assert np.abs(frame.centre - u[0]).max() > 100 * width[0, 0]  # about one centre: far out
