"""Rows that share nothing, against scipy's densities row by row."""

import numpy as np
import pytest
from scipy import stats

from ridgebayes.model.forms import Modified
from ridgebayes.model.likelihood_independent import IndependentNormalRows, IndependentRows
from ridgebayes.model.rows import Rows
from ridgebayes.model.tails import NormalTail, StudentTail

NORMAL, STUDENT = NormalTail(), StudentTail()
RATES = np.log([[1.4, 1.35, 1.45], [1.3, 1.38, 1.36]])
SIGMA = np.array([0.03, 0.2])
NOTHING = np.empty((2, 0))


@pytest.fixture(params=[(0.0, 0.02, 0.05), (0.0, 0.02), (0.02,)], ids=len)
def data(observed, request):
    rng = np.random.default_rng(1)
    texture = np.array([0, 0, 1, 1, 1, 2, 2, 2, 2])
    Q = np.array([4, 6, 4, 4, 8, 6, 6, 10, 12])
    load = 2 * np.log((Q / 2 - 1) * 0.042 / 1.38) + 0.05 * rng.standard_normal(9)
    return observed(texture, Q, load, rel_se=rng.choice(request.param, 9))


def residuals(data):
    """log load less the modified form's 2 log((Q/2 - 1)(a + b) / c), typed out; and its scale."""
    pitch = (data.a_over_R + data.b_over_R)[data.texture]
    left = data.log_load - 2 * np.log((data.Q / 2 - 1) * pitch) + 2 * RATES[:, data.texture]
    return left, np.hypot(SIGMA[:, None], data.rel_se)


def both(data):
    """Likelihood, error parameters and scipy's density of each, at two draws."""
    left, scale = residuals(data)
    rows, df = Rows.of(data, Modified()), np.array([[2.5], [40.0]])
    normal = stats.norm.logpdf(left, scale=scale)
    student = stats.t(df).logpdf(left / scale) - np.log(scale)
    return (
        (IndependentNormalRows(rows, NORMAL), SIGMA[:, None], normal),
        (IndependentRows(rows, NORMAL), SIGMA[:, None], normal),
        (IndependentRows(rows, STUDENT), np.column_stack([SIGMA, df]), student),
    )


def test_pointwise__and_marginal_are_scipys_densities_and_their_sum(data):
    for likelihood, eta, expected in both(data):
        # Rounding: residuals of 0.05 beside 10, in scales of 0.03, squared.
        found = likelihood.pointwise(RATES, eta, NOTHING)
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12)
        found = likelihood.marginal(RATES, eta)
        np.testing.assert_allclose(found, expected.sum(axis=-1), rtol=1e-11)
        assert likelihood.n_latent == 0


def test_marginal__of_a_repeated_table_is_the_double(data, observed):
    twice = np.tile(np.arange(9), 2)
    again = observed(
        data.texture[twice], data.Q[twice], data.log_load[twice], rel_se=data.rel_se[twice]
    )
    for (one, eta, _), (two, _, _) in zip(both(data), both(again), strict=True):
        # Rounding: another order of summation.
        np.testing.assert_allclose(
            two.marginal(RATES, eta), 2 * one.marginal(RATES, eta), rtol=1e-12
        )


def test_marginal__of_repeated_brackets_and_counts_is_the_double(data, observed):
    columns = {
        "log_lower": np.where(np.arange(9) % 3 == 0, data.log_load - 0.1, np.nan),
        "is_count": np.arange(9) % 3 == 1,
    }
    found = []
    for rows in (np.arange(9), np.tile(np.arange(9), 2)):
        repeated = {name: column[rows] for name, column in columns.items()}
        mine = observed(data.texture[rows], data.Q[rows], data.log_load[rows] + 0.1, **repeated)
        likelihood = IndependentRows(Rows.of(mine, Modified()), STUDENT)
        found.append(likelihood.marginal(RATES, np.column_stack([SIGMA, [3.0, 9.0]])))
    np.testing.assert_allclose(found[1], 2 * found[0], rtol=1e-12)  # rounding: order of summation


def test_gradient__is_the_central_difference(data):
    likelihood, h = IndependentNormalRows(Rows.of(data, Modified()), NORMAL), 1e-5
    by_rate, by_sigma = likelihood.gradient(RATES, SIGMA[:, None])

    def slope(step_rates, step_sigma):
        up, down = (
            likelihood.marginal(RATES + s * step_rates, (SIGMA + s * step_sigma)[:, None])
            for s in (h, -h)
        )
        return (up - down) / (2 * h)

    for texture in range(3):
        mine = likelihood.groups.texture == texture
        expected = slope(np.eye(3)[texture], 0.0)
        # Discretisation: h^2 over the square of a scale of 0.03; rounding: 1e-15 x 1e3 / h.
        np.testing.assert_allclose(by_rate[:, mine].sum(axis=-1), expected, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(by_sigma, slope(0.0, 1.0), rtol=1e-6)  # the same


def test_products__are_those_with_the_rows_variances(data):
    columns = np.random.default_rng(4).standard_normal((9, 3))
    _, scale = residuals(data)
    for likelihood, eta, _ in both(data)[:2]:
        found = likelihood.products(eta, columns)
        expected = [columns.T @ np.diag(each**-2) @ columns for each in scale]
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-9)  # rounding of sums


def test_marginal__of_many_replicates_stays_with_a_few_groups(observed):
    n = 10_000
    rng = np.random.default_rng(2)
    texture = rng.integers(0, 3, n)
    data = observed(texture, 2 * rng.integers(2, 9, n), -8 + rng.standard_normal(n))
    rows = Rows.of(data, Modified())
    likelihood = IndependentNormalRows(rows, NORMAL)
    assert len(likelihood.groups.n) == 3
    slow = IndependentRows(rows, NORMAL).marginal(RATES, SIGMA[:, None])
    # Rounding: 10^4 terms.
    np.testing.assert_allclose(likelihood.marginal(RATES, SIGMA[:, None]), slow, rtol=1e-11)
