import numpy as np
import pytest

from ridgebayes.inference.funnel import Funnel
from ridgebayes.model.priors import HalfNormal

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
def test_unplace__inverts_place(known_variance):
    frame = made_up(known_variance).about(MODE)
    rng = np.random.default_rng(1)
    w, u_noise = rng.standard_normal((2, 5, 2)), rng.standard_normal((2, 5, 1))
    u, log_jacobian = frame.forward(w, u_noise)
    back, again = frame.inverse(u, u_noise)
    np.testing.assert_allclose(back, w, rtol=0, atol=1e-11)  # algebra
    np.testing.assert_array_equal(again, log_jacobian)


@pytest.mark.parametrize("known_variance", [0.0, 0.02**2])
def test_place__jacobian_is_the_determinant_by_finite_differences(known_variance):
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


def test_place__at_the_mode_is_the_identity_about_it():
    frame, w = made_up(0.02**2).about(MODE), np.random.default_rng(3).standard_normal((4, 2))
    u, log_jacobian = frame.forward(w, np.broadcast_to(MODE[2:], (4, 1)))
    np.testing.assert_allclose(u, MODE[:2] + w, rtol=0, atol=1e-14)  # rounding
    assert not log_jacobian.any()


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
