"""Offsets integrated out, against dense covariances built from the definition of each structure."""

import math
import pickle
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from ridgebayes.model.forms import Modified
from ridgebayes.model.likelihood_marginal import IntegratedOffsets, IntegratedSmoothOffsets
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.rows import Rows
from ridgebayes.model.shared_offsets import offsets_of

STRUCTURES = tuple(
    noise.structure for noise in Noise.candidates(2) if noise.factors and noise.tail == "normal"
)
CROSSED = ("texture+step", "texture+series", "step+series", "texture+step+series")
PITCH = np.array([0.042, 0.042, 0.042, 0.063])
RATIO = np.array([0.012 / 0.042, 0.032 / 0.042, 0.022 / 0.042, 0.018 / 0.063])
NUGGET = 1e-8  # of a smooth offset's variance, its place's own
USUAL = {
    "sigma": 0.03,
    "tau_texture": 0.05,
    "tau_step": 0.04,
    "length_h": 0.8,
    "length_ratio": 0.3,
    "tau_series": 0.07,
}
NOTHING = np.empty((1, 0))


def eta_of(structure, **changed):
    names = Noise(structure).parameter_names
    return np.array([(USUAL | changed)[name] for name in names])


def covariance(structure, eta, here, there, one=float):
    """Shared part of Cov(log load, log load) at two (texture, Q, series): by the definition."""
    (texture, Q, series), (texture_2, Q_2, series_2) = here, there
    tau = dict(zip(Noise(structure).parameter_names, map(one, eta.tolist()), strict=True))
    same = {"texture": texture == texture_2, "step": Q == Q_2, "series": series == series_2}
    parts = structure.split("+")
    value = sum((tau[f"tau_{name}"] ** 2 for name in parts if same.get(name)), start=one(0))
    if "step-smooth" not in parts:
        return value
    apart = math.log(Q / 2 - 1) - math.log(Q_2 / 2 - 1), RATIO[texture] - RATIO[texture_2]
    lengths = float(tau["length_h"]), float(tau["length_ratio"])
    correlation = math.exp(-sum((d / s) ** 2 for d, s in zip(apart, lengths, strict=True)) / 2)
    own = NUGGET if max(map(abs, apart)) < 1e-12 else 0.0
    return value + tau["tau_step"] ** 2 * (one(correlation) + one(own))


def places(data):
    return list(zip(data.texture.tolist(), data.Q.tolist(), data.series.tolist(), strict=True))


def dense(structure, eta, data):
    """Covariance of all rows, shape (n_obs, n_obs)."""
    shared = [[covariance(structure, eta, p, q) for q in places(data)] for p in places(data)]
    return np.array(shared) + np.diag(eta[0] ** 2 + data.rel_se**2)


def table(observed, rng, n=25, n_texture=4):
    """Replicates in some cells, several known errors, a texture of few rows."""
    texture = np.concatenate([np.arange(n_texture), rng.integers(0, n_texture, n - n_texture)])
    Q = 2 * rng.integers(2, 7, n)
    load = 2 * np.log((Q / 2 - 1) * PITCH[texture] / 1.38) + 0.1 * rng.standard_normal(n)
    rel_se = rng.choice([0.0, 0.01, 0.05], n)
    return observed(texture, Q, load, rel_se=rel_se, series=np.arange(n) // 3 % 3)


def likelihood_of(structure, data):
    kind = IntegratedSmoothOffsets if "step-smooth" in structure else IntegratedOffsets
    return kind(Rows.of(data, Modified()), offsets_of(Noise(structure), data))


def residual(data, log_rates):
    """log load less the modified form's 2 log((Q/2 - 1)(a + b) rate^-1), typed out."""
    shape = (data.Q / 2 - 1) * PITCH[data.texture]
    return data.log_load - 2 * np.log(shape) + 2 * log_rates[data.texture]


@pytest.mark.parametrize("structure", STRUCTURES)
def test_marginal__is_scipys_normal_with_the_dense_covariance(structure, observed):
    rng = np.random.default_rng(1)
    data = table(observed, rng)
    log_rates = np.log(1.38) + 0.05 * rng.standard_normal((2, 3, 4))
    eta = eta_of(structure) * np.exp(0.5 * rng.standard_normal((2, 3, len(eta_of(structure)))))
    found = likelihood_of(structure, data).marginal(log_rates, eta)
    assert found.shape == (2, 3)
    for at in np.ndindex(2, 3):
        matrix = dense(structure, eta[at], data)
        oracle = stats.multivariate_normal(np.zeros(len(data)), matrix)
        expected = oracle.logpdf(residual(data, log_rates[at]))
        assert found[at] == pytest.approx(expected, rel=1e-10)  # rounding: condition 1e3 or so


def test_marginal__of_many_coefficients_beside_one_error_model_is_that_of_each(observed):
    rng = np.random.default_rng(3)
    data, structure = table(observed, rng), "step-smooth"
    log_rates = np.log(1.38) + 0.05 * rng.standard_normal((3, 5, 4))
    eta = eta_of(structure) * np.exp(0.5 * rng.standard_normal((3, 1, 4)))
    likelihood, everywhere = likelihood_of(structure, data), np.broadcast_to(eta, (3, 5, 4))
    each = [
        [likelihood.marginal(r, e) for r in some]
        for some, e in zip(log_rates, eta[:, 0], strict=True)
    ]
    found = likelihood.marginal(log_rates, everywhere)
    np.testing.assert_allclose(found, each, rtol=1e-12)  # rounding
    # And not where the error models differ after all.
    apart = everywhere.copy()
    apart[1, 2, 0] *= 2
    assert likelihood.marginal(log_rates, apart)[1, 2] == pytest.approx(
        likelihood.marginal(log_rates[1, 2], apart[1, 2]), rel=1e-12
    )


@pytest.mark.parametrize("structure", STRUCTURES)
def test_likelihood__travels_light_and_gives_the_same_bits_elsewhere(structure, observed):
    rng = np.random.default_rng(4)
    data = table(observed, rng)
    log_rates = np.log(1.38) + 0.05 * rng.standard_normal((500, 4))
    eta = eta_of(structure) * np.exp(0.5 * rng.standard_normal((500, len(eta_of(structure)))))
    likelihood = likelihood_of(structure, data)
    fresh = len(pickle.dumps(likelihood))

    def answers(one):
        given = one.given(log_rates, eta, NOTHING)
        mean, variance = given.at((0.02, 0.03), np.array([4, 8, 30]))
        return one.marginal(log_rates, eta), one.products(eta, np.ones((25, 2))), mean, variance

    here = answers(likelihood)
    message = pickle.dumps(likelihood)
    assert len(message) < fresh + 2000  # not the factors of five hundred draws
    for one, other in zip(here, answers(pickle.loads(message)), strict=True):
        np.testing.assert_array_equal(one, other)


def test_design__has_the_same_strides_here_and_elsewhere(paper):
    # Sums depend on strides in their last digit, and the paper's rows are gathered by an index.
    data = Observations.from_table(paper)
    likelihood = likelihood_of("step-smooth", data)
    log_rates, eta = np.full((3, len(data.textures)), 0.3), np.tile(eta_of("step-smooth"), (3, 1))
    here = likelihood.pointwise(log_rates, eta, NOTHING)
    elsewhere = pickle.loads(pickle.dumps(likelihood))
    assert likelihood._design.codes.strides == elsewhere._design.codes.strides
    np.testing.assert_array_equal(here, elsewhere.pointwise(log_rates, eta, NOTHING))


SCALES = st.floats(-3, 0).map(lambda x: 10.0**x)


@pytest.mark.parametrize("structure", STRUCTURES)
@given(drawn=st.data())
@settings(max_examples=60)
def test_marginal__and_pointwise_are_dense_algebra_for_any_small_table(structure, drawn, observed):
    n = drawn.draw(st.integers(1, 8))

    def column(values):
        return np.array(drawn.draw(st.lists(values, min_size=n, max_size=n)))

    texture, Q = column(st.integers(0, 3)), column(st.sampled_from([4, 6, 8, 12]))
    rel_se, load = column(st.sampled_from([0.0, 0.01, 0.1])), column(st.floats(-1, 1))
    names = Noise(structure).parameter_names
    eta = np.array([drawn.draw(SCALES) for _ in names])
    series = np.append(np.arange(n - 1) % 2, 1)  # the number of series is known, not of rows
    data = observed(texture, Q, load - 6, rel_se=rel_se, series=series)
    likelihood, log_rates = likelihood_of(structure, data), np.full(len(data.textures), 0.3)
    matrix, left = dense(structure, eta, data), residual(data, log_rates)
    expected = stats.multivariate_normal(np.zeros(n), matrix, allow_singular=False).logpdf(left)
    # Rounding: the condition of the dense covariance, in the oracle.
    assert likelihood.marginal(log_rates, eta) == pytest.approx(expected, rel=1e-7, abs=1e-7)
    precision = np.linalg.inv(matrix)
    variance = 1 / np.diag(precision)
    conditional = stats.norm.logpdf(precision @ left * variance, scale=np.sqrt(variance))
    found = likelihood.pointwise(log_rates[None], eta[None], NOTHING)[0]
    np.testing.assert_allclose(found, conditional, rtol=1e-6, atol=1e-6)  # the same


@pytest.mark.parametrize("structure", STRUCTURES)
def test_pointwise__is_what_is_lost_by_leaving_each_row_out(structure, observed):
    # Not by the precision matrix: log p(all) - log p(all but one), each by scipy.
    rng = np.random.default_rng(2)
    data, eta = table(observed, rng, n=12), eta_of(structure)
    log_rates = np.full(4, np.log(1.38))
    left = residual(data, log_rates)
    matrix = dense(structure, eta, data)
    found = likelihood_of(structure, data).pointwise(log_rates[None], eta[None], NOTHING)[0]

    def log_density(keep):
        chosen = stats.multivariate_normal(np.zeros(keep.sum()), matrix[np.ix_(keep, keep)])
        return chosen.logpdf(left[keep])

    everything = np.ones(12, bool)
    for i in range(12):
        expected = log_density(everything) - log_density(np.arange(12) != i)
        assert found[i] == pytest.approx(expected, rel=1e-9, abs=1e-9)  # rounding: condition 1e2


def test_pointwise__in_chunks_is_the_same(observed, monkeypatch):
    rng = np.random.default_rng(3)
    data = table(observed, rng)
    likelihood = likelihood_of("texture+step", data)
    log_rates = np.log(1.38) + 0.05 * rng.standard_normal((7, 4))
    eta = eta_of("texture+step") * np.exp(0.3 * rng.standard_normal((7, 3)))
    whole = likelihood.pointwise(log_rates, eta, NOTHING)
    monkeypatch.setattr("ridgebayes.model.likelihood_marginal._CHUNK", 500)
    np.testing.assert_array_equal(likelihood.pointwise(log_rates, eta, NOTHING), whole)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_given__offsets_are_those_of_dense_gaussian_conditioning(structure, observed):
    # Known and new texture, known and new step; all steps inside the calibrated range.
    rng = np.random.default_rng(4)
    data = table(observed, rng, n_texture=3)
    data = observed(
        np.append(data.texture, 0),
        np.append(data.Q, 16),
        np.append(data.log_load, -6.5),
        series=np.append(data.series, 0),
    )
    log_rates, eta = np.full(3, np.log(1.38)), eta_of(structure)
    found = likelihood_of(structure, data).given(log_rates[None], eta[None], NOTHING)
    rows = places(data)
    inverse = np.linalg.inv(dense(structure, eta, data))
    left = residual(data, log_rates)
    assert 14 not in data.Q
    everything = [(0.012, 0.03), (0.032, 0.01), (0.022, 0.02), (0.018, 0.045)]
    for texture, widths in enumerate(everything):
        Q = np.array([4, 8, 14, 16])
        mean, variance = found.at(widths, Q)
        assert mean.shape == variance.shape == (1, 4)
        for i, q in enumerate(Q.tolist()):
            # What is predicted is a new series.
            new = (texture, q, -1)
            cross = np.array([covariance(structure, eta, row, new) for row in rows])
            prior = covariance(structure, eta, new, new)
            if "step-smooth" in structure:  # the nugget is of calibrated places, not asked for
                prior -= NUGGET * USUAL["tau_step"] ** 2
                cross = np.minimum(cross, USUAL["tau_step"] ** 2)
            # Rounding: condition 1e2 of the rows, 1e8 of a smooth covariance.
            assert mean[0, i] == pytest.approx(cross @ inverse @ left, rel=1e-7, abs=1e-9)
            expected = prior - cross @ inverse @ cross
            assert variance[0, i] == pytest.approx(expected, rel=1e-7, abs=1e-10)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_products__of_any_columns_one_after_the_other_are_those_of_dense_algebra(
    structure, observed
):
    rng = np.random.default_rng(9)
    data = table(observed, rng)
    likelihood = likelihood_of(structure, data)
    eta = np.stack([eta_of(structure), eta_of(structure, sigma=0.05, tau_step=0.01)])
    for _ in range(2):
        # Alike within a texture, as derivatives by coefficients are.
        columns = rng.standard_normal((4, 2))[data.texture]
        for draws in (eta, eta[::-1]):
            found = likelihood.products(draws, columns)
            for each, value in zip(found, draws, strict=True):
                Sigma = dense(structure, value, data)
                expected = columns.T @ np.linalg.solve(Sigma, columns)
                # Rounding: condition 1e8 at most, by the nugget.
                np.testing.assert_allclose(each, expected, rtol=1e-7)


def test_marginal__does_not_mind_the_order_of_rows(observed):
    rng = np.random.default_rng(5)
    data, order = table(observed, rng), rng.permutation(25)
    again = observed(
        data.texture[order],
        data.Q[order],
        data.log_load[order],
        rel_se=data.rel_se[order],
        series=data.series[order],
    )
    log_rates = np.log(1.38) + 0.05 * rng.standard_normal((3, 4))
    for structure in STRUCTURES:
        eta = eta_of(structure) * np.ones((3, 1))
        one, two = (likelihood_of(structure, rows) for rows in (data, again))
        # Rounding: another order of summation.
        np.testing.assert_allclose(
            two.marginal(log_rates, eta), one.marginal(log_rates, eta), rtol=1e-11
        )
        found = two.pointwise(log_rates, eta, NOTHING)
        expected = one.pointwise(log_rates, eta, NOTHING)[:, order]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_marginal__costs_by_cells_not_rows(structure, observed):
    rng = np.random.default_rng(6)
    n = 10_000
    texture, Q = rng.integers(0, 3, n), 2 * rng.integers(2, 6, n)
    log_load, rel_se = -8 + 0.1 * rng.standard_normal(n), rng.choice([0, 0.02], n)
    data = observed(texture, Q, log_load, rel_se=rel_se, series=np.arange(n) % 2)
    likelihood = likelihood_of(structure, data)
    n_group = (3 if "step" not in structure else 3 * 4) * 2
    n_group *= 2 if "series" in structure else 1
    assert len(likelihood._groups.n) == n_group
    assert likelihood._design.codes.shape[1] == n_group
    # The cells' means are sufficient: dense algebra of cells, and what is left within each.
    eta, log_rates = eta_of(structure), np.full(3, np.log(1.38))
    left = residual(data, log_rates)
    cells, cell, count = np.unique(
        np.stack([texture, Q, data.series, 100 * data.rel_se]),
        axis=1,
        return_inverse=True,
        return_counts=True,
    )
    cell = cell.reshape(-1)
    mean = np.bincount(cell, left) / count
    variance = eta[0] ** 2 + (cells[3] / 100) ** 2
    of_cells = observed(*cells[:2].astype(int), mean, series=cells[2].astype(int))
    matrix = dense(structure, eta, of_cells)
    matrix += np.diag(variance / count - eta[0] ** 2)
    between = stats.multivariate_normal(np.zeros(len(mean)), matrix).logpdf(mean)
    within = stats.norm.logpdf(left - mean[cell], scale=np.sqrt(variance)[cell]).sum()
    within -= stats.norm.logpdf(0, scale=np.sqrt(variance / count)).sum()
    found = likelihood.marginal(log_rates, eta)
    assert found == pytest.approx(between + within, rel=1e-10)  # rounding: 10^4 terms


def eliminated(matrix, right):
    """Solution and determinant in exact fractions."""
    matrix, right, determinant = [row[:] for row in matrix], right[:], Fraction(1)
    n = len(right)
    for i in range(n):
        determinant *= matrix[i][i]
        for j in range(i + 1, n):
            factor = matrix[j][i] / matrix[i][i]
            if factor:
                pairs = zip(matrix[j], matrix[i], strict=True)
                matrix[j] = [x - factor * y for x, y in pairs]
                right[j] -= factor * right[i]
    for i in reversed(range(n)):
        known = sum(matrix[i][k] * right[k] for k in range(i + 1, n))
        right[i] = (right[i] - known) / matrix[i][i]
    return right, determinant


def log(x):
    """Log of a fraction whose parts are beyond a float."""
    return math.log(x.numerator) - math.log(x.denominator)


def exactly(structure, eta, data, left):
    """Log-likelihood, and each row's given the others, without any rounding but of the logs."""
    rows = places(data)
    matrix = [[covariance(structure, eta, p, q, one=Fraction) for q in rows] for p in rows]
    for i in range(len(rows)):
        matrix[i][i] += Fraction(float(eta[0])) ** 2
    left = [Fraction(x) for x in left.tolist()]
    pull, determinant = eliminated(matrix, left)
    square = float(sum(x * y for x, y in zip(pull, left, strict=True)))
    whole = -0.5 * (square + log(determinant) + len(rows) * math.log(2 * math.pi))
    each = []
    for i in range(len(rows)):
        unit = [Fraction(int(i == j)) for j in range(len(rows))]
        precision = eliminated(matrix, unit)[0][i]
        each.append(
            0.5 * (log(precision) - math.log(2 * math.pi) - float(pull[i] ** 2 / precision))
        )
    return whole, each


def at_sigma(structure, sigma, observed):
    """Seven rows whose residuals are offsets and errors of that sigma; one is alone at its step."""
    rng = np.random.default_rng(7)
    texture, Q = np.array([0, 0, 1, 1, 2, 2, 2]), np.array([4, 6, 4, 8, 6, 10, 10])
    eta = eta_of(structure, sigma=sigma)
    series = np.array([0, 1, 1, 0, 2, 2, 2])
    matrix = dense(structure, eta, observed(texture, Q, 0.0, series=series)) - sigma**2 * np.eye(7)
    values, vectors = np.linalg.eigh(matrix)
    left = vectors @ (np.sqrt(np.maximum(values, 0)) * rng.standard_normal(7))
    left[6] = left[5]  # one place
    left = left + sigma * rng.standard_normal(7)
    return observed(texture, Q, left + 2 * np.log((Q / 2 - 1) * 0.042), series=series), eta


def rounding(sigma):
    """Tolerance: what rounding leaves of a precision that holds 1 beside (tau / sigma)^2."""
    return 1e-9 + 1e-15 * (USUAL["tau_texture"] / sigma) ** 2


def rounding_of_means(sigma, left):
    """Tolerance: what rounding of an offset leaves of residuals some ten sigmas long, squared."""
    return 1e-9 + 10 * np.finfo(float).eps * np.abs(left).max() / sigma


@pytest.mark.parametrize(
    ("structure", "sigma"),
    [
        (structure, 10.0**exponent)
        for structure in STRUCTURES
        for exponent in range(-7 if structure in CROSSED else -12, 2)
    ],
)
def test_marginal__is_right_from_tiny_sigmas_to_huge_ones(structure, sigma, observed):
    data, eta = at_sigma(structure, sigma, observed)
    left = Rows.of(data, Modified()).upper  # as it was rounded: what is asked of the algebra
    expected, _ = exactly(structure, eta, data, left)
    found = likelihood_of(structure, data).marginal(np.zeros(3), eta)
    # Only crossed factors add up to a precision that is not diagonal and nearly singular.
    atol = rounding(sigma) if structure in CROSSED else 1e-9
    assert found == pytest.approx(expected, rel=1e-12, abs=atol)


@pytest.mark.parametrize(
    ("structure", "sigma"),
    [
        (structure, 10.0**exponent)
        for structure in STRUCTURES
        for exponent in range(-6 if structure in CROSSED else -10, 2)
    ],
)
def test_pointwise__is_right_from_tiny_sigmas_to_huge_ones(structure, sigma, observed):
    data, eta = at_sigma(structure, sigma, observed)
    left = Rows.of(data, Modified()).upper
    _, expected = exactly(structure, eta, data, left)
    found = likelihood_of(structure, data).pointwise(np.zeros((1, 3)), eta[None], NOTHING)[0]
    atol = rounding(sigma) if structure in CROSSED else rounding_of_means(sigma, left)
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=atol)


def test_pointwise__of_smooth_offsets_interpolated_by_tiny_sigmas_is_longdoubles(paper):
    # The default run's case: Classic's residual is a smooth function to eight digits.
    data = Observations.from_table(paper)
    ratio = data.a_over_R / (data.a_over_R + data.b_over_R)
    h, r = np.log(data.Q / 2 - 1), ratio[data.texture]
    log_rates = np.full(9, math.log(1.382))
    left = Rows.of(data, Modified()).upper + 2 * log_rates[0]
    for sigma in (3e-10, 1e-6, 1e-2):
        eta = eta_of("step-smooth", sigma=sigma)
        apart = ((h[:, None] - h) / eta[2]) ** 2 + ((r[:, None] - r) / eta[3]) ** 2
        same = (np.abs(h[:, None] - h) < 1e-9) & (np.abs(r[:, None] - r) < 1e-9)
        matrix = eta[1] ** 2 * (np.exp(-0.5 * apart.astype(np.longdouble)) + NUGGET * same)
        inverse = inverted(matrix + eta[0].astype(np.longdouble) ** 2 * np.eye(41))
        variance = 1 / np.diag(inverse)
        expected = -0.5 * np.log(2 * np.pi * variance) - 0.5 * variance * (inverse @ left) ** 2
        found = likelihood_of("step-smooth", data).pointwise(log_rates[None], eta[None], NOTHING)[0]
        # Rounding: of covariances in double precision, times their condition of up to 1e9; the
        # misfit of rates not fitted is up to 1e7 of these.
        np.testing.assert_allclose(found, expected.astype(float), rtol=1e-7, atol=1e-7)


def inverted(matrix):
    """Inverse in long doubles, by Gauss and Jordan; fit for positive definite matrices."""
    n = len(matrix)
    work = np.hstack([matrix, np.eye(n, dtype=np.longdouble)])
    for i in range(n):
        work[i] /= work[i, i]
        others = np.arange(n) != i
        work[others] -= work[others, i][:, None] * work[i]
    return work[:, n:]
