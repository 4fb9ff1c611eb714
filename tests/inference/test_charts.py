"""Coordinates of coefficients given the error model, and the search for modes in them."""

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes import Noise
from ridgebayes.inference.modes import find_modes
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations

NOISES = ["iid", "texture", "step-smooth", "iid:student", "texture+step:student"]


def target_of(paper, form, noise):
    return ModelTarget(Model(Observations.from_table(paper), form, Noise.named(noise)))


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("form", [rb.Modified(), rb.Hybrid(), rb.PowerLaw()])
def test_charts__map_there_and_back_by_the_jacobian_that_they_say(paper, form, noise):
    target = target_of(paper, form, noise)
    q = np.random.default_rng(1).standard_normal((5, len(target.names)))
    integral, k = target.integral, target.n_centred

    def conditional(q):
        theta = target.model.outer_theta(np.concatenate([np.zeros((len(q), k)), q[:, k:]], axis=1))
        return chart.conditional(integral.prepared(theta[:, k:]))

    for chart in target.charts:  # noqa: B007, read by `conditional`
        one = conditional(q)
        u = one.to_scores(q)
        np.testing.assert_allclose(one.from_scores(u), q, rtol=0, atol=1e-9)  # rounding
        for i in range(len(q)):
            steps = 1e-5 * np.eye(q.shape[1])
            ahead, behind = q[i] + steps, q[i] - steps
            slopes = conditional(ahead).to_scores(ahead) - conditional(behind).to_scores(behind)
            log_volume = np.linalg.slogdet(slopes / 2e-5)[1]
            # Discretisation: h^2; rounding: 1e-15 / h.
            assert one.log_jacobian[i] == pytest.approx(log_volume, abs=1e-6)


@pytest.mark.parametrize("noise", ["iid", "texture+step", "step-smooth"])
def test_chart__of_modified_with_normal_rows_makes_the_coefficient_standard_normal(paper, noise):
    # log loads are linear in log c, whose prior is normal: nothing is left of the other parameters.
    target = target_of(paper, rb.Modified(), noise)
    rng = np.random.default_rng(2)
    for phi in rng.standard_normal((3, len(target.names) - 1)):
        z = np.linspace(-5, 5, 7)
        q = np.column_stack([z, np.tile(phi, (7, 1))])
        value = target.approximate(0, q)
        # Rounding: condition 1e8 by the nugget.
        np.testing.assert_allclose(value - value[3], -0.5 * z**2, rtol=0, atol=1e-5)


def test_charts__of_two_groups_are_about_each(observed):
    texture, Q = np.repeat(np.arange(3), 4), np.tile([4, 6, 8, 10], 3)
    c = np.array([1.3, 1.62, 1.3])[texture]
    pitch = np.array([0.042, 0.042, 0.042])[texture]
    rows = observed(texture, Q, 2 * np.log((Q / 2 - 1) * pitch / c) + 1e-3 * np.cos(Q))
    target = ModelTarget(Model(rows, rb.Modified(), Noise("iid", "student")))
    found = sorted(
        float(target.model.priors["c"].value_at(chart.reference[0])) for chart in target.charts
    )
    # The least squares of all rows lie between, at the mean of log c.
    expected = [1.3, 1.3 ** (2 / 3) * 1.62 ** (1 / 3), 1.62]
    np.testing.assert_allclose(found, expected, rtol=2e-3)  # the rows' errors
    normal = ModelTarget(Model(rows, rb.Modified()))
    assert len(normal.charts) == 1


def test_find_modes__finds_both_humps_of_a_known_density():
    weights = np.log([0.7, 0.3])
    centres, factor = np.array([[-2.0, 0.5], [2.5, -1.0]]), np.array([[0.5, 0.0], [0.2, 0.3]])

    def log_density(x):
        z = np.linalg.solve(factor, (x[None] - centres[:, None])[..., None])[..., 0]
        terms = weights[:, None] - 0.5 * (z**2).sum(axis=-1)
        volume = np.linalg.slogdet(factor)[1] + np.log(2 * np.pi)
        return np.logaddexp(*terms) - volume

    found = find_modes(log_density, 2 * np.random.default_rng(1).standard_normal((64, 2)))
    assert len(found) == 2
    for mode, centre, weight in zip(found, centres, weights, strict=True):
        # Discretisation: a gain of 1e-4 ends the search; differences of 0.02 for the curvature.
        np.testing.assert_allclose(mode.centre, centre, atol=0.02)
        np.testing.assert_allclose(mode.factor, factor, atol=0.02)
        assert mode.log_mass == pytest.approx(weight, abs=0.02)
    assert find_modes(lambda x: np.full(len(x), -np.inf), np.zeros((4, 2))) == []
