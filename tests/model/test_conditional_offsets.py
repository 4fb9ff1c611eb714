"""The linear-normal problem against dense algebra: every matrix with its zeros."""

import numpy as np
import pytest
from scipy import stats

from ridgebayes.model.cholesky import DenseFactor
from ridgebayes.model.conditional_offsets import (
    Design,
    DiagonalRoot,
    FullRoot,
    given_rows,
    square_sum,
)

BATCH, N_LEVEL, N_ROW = (2, 3), 5, 12
RNG = np.random.default_rng(1)
# One factor of five levels; two factors of two and three levels.
ONE = RNG.integers(0, 5, (1, N_ROW))
TWO = np.stack([RNG.integers(0, 2, N_ROW), RNG.integers(2, 5, N_ROW)])
SCALE = RNG.uniform(0.1, 2, (*BATCH, N_LEVEL))
FACTOR = np.tril(RNG.standard_normal((*BATCH, N_LEVEL, N_LEVEL))) + 2 * np.eye(N_LEVEL)
WEIGHT = RNG.uniform(0.5, 50, (*BATCH, N_ROW))
RESIDUAL = RNG.standard_normal((*BATCH, N_ROW))

CASES = {
    "one factor, independent": (ONE, DiagonalRoot(SCALE), SCALE[..., None] * np.eye(N_LEVEL)),
    "two factors, independent": (TWO, DiagonalRoot(SCALE), SCALE[..., None] * np.eye(N_LEVEL)),
    "one factor, varying together": (ONE, FullRoot(FACTOR), FACTOR),
    "two factors, varying together": (TWO, FullRoot(FACTOR), FACTOR),
}


@pytest.fixture(params=CASES)
def case(request):
    """Design, L, the dense Z, the dense L, and the scores given rows."""
    codes, root, dense = CASES[request.param]
    design = Design(codes, N_LEVEL)
    Z = np.zeros((N_ROW, N_LEVEL))
    for levels in codes:
        Z[np.arange(N_ROW), levels] += 1
    return design, root, Z, dense, given_rows(design, root, WEIGHT, RESIDUAL)


def t(matrix):
    return np.swapaxes(matrix, -1, -2)


def whole(blocks):
    """The matrix of a diagonal, a border and a corner, with its zeros."""
    first, border, corner = blocks
    top = [first[..., None] * np.eye(first.shape[-1]), t(border)]
    top, bottom = (np.concatenate(row, axis=-1) for row in (top, [border, corner]))
    return np.concatenate([top, bottom], axis=-2)


def dense(factor):
    """A lower factor with its zeros."""
    if isinstance(factor, DenseFactor):
        return factor.factor
    found = whole((factor.diagonal, factor.border, factor.corner))
    n = factor.diagonal.shape[-1]
    found[..., :n, n:] = 0
    return found


def times(matrix, vector):
    return np.einsum("...ij,...j->...i", matrix, vector)


def test_design__and_roots_are_the_products_with_dense_matrices(case):
    rng = np.random.default_rng(2)
    design, root, Z, L, _ = case
    b, x = rng.standard_normal((*BATCH, N_LEVEL)), rng.standard_normal((*BATCH, N_ROW))
    np.testing.assert_array_equal(design.transposed, Z.T)
    np.testing.assert_allclose(design.spread(b), b @ Z.T, rtol=1e-13)  # rounding, and below
    np.testing.assert_allclose(design.gather(x), x @ Z, rtol=1e-12, atol=1e-14)
    dense = t(Z) @ (WEIGHT[..., None] * Z)
    np.testing.assert_allclose(whole(design.gram(WEIGHT)), dense, rtol=1e-13)
    np.testing.assert_allclose(root.times(b), times(L, b), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(root.transposed_times(b), times(t(L), b), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(root.loading(design), t(Z @ L), rtol=1e-13)
    precision = root.precision(design, WEIGHT)
    found = precision if isinstance(root, FullRoot) else whole(precision)
    np.testing.assert_allclose(found, t(L) @ dense @ L, rtol=1e-11, atol=1e-12)


def test_given_rows__has_mean_precision_and_variances_of_dense_algebra(case):
    rng = np.random.default_rng(2)
    _, _, Z, L, given = case
    design = Z @ L
    M = np.eye(N_LEVEL) + t(design) @ (WEIGHT[..., None] * design)
    mean = np.linalg.solve(M, times(t(design), WEIGHT * RESIDUAL)[..., None])[..., 0]
    # Rounding: the condition of M is some 1e3.
    np.testing.assert_allclose(given.mean, mean, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(given.log_det, np.linalg.slogdet(M)[1], rtol=1e-12)
    loading = rng.standard_normal((*BATCH, N_LEVEL, 4))
    covariance = t(loading) @ np.linalg.inv(M) @ loading
    expected = np.diagonal(covariance, axis1=-2, axis2=-1)
    for factor in (given.factor, given.factor.inverted()):
        np.testing.assert_allclose(square_sum(factor.solve(loading)), expected, rtol=1e-10)


def test_given_rows__covariances_of_rows_offsets_are_those_of_dense_algebra(case):
    design, root, Z, L, given = case
    loading = Z @ L
    M = np.eye(N_LEVEL) + t(loading) @ (WEIGHT[..., None] * loading)
    expected = loading @ np.linalg.inv(M) @ t(loading)
    half = given.half(root.loading(design))
    # Rounding: the condition of M is some 1e3.
    np.testing.assert_allclose(t(half) @ half, expected, rtol=1e-9, atol=1e-13)


def test_given_rows__integrates_the_scores_out_as_the_module_says(case):
    _, _, Z, L, given = case
    for place in np.ndindex(BATCH):
        sigma = Z @ L[place] @ L[place].T @ Z.T + np.diag(1 / WEIGHT[place])
        r, mean = RESIDUAL[place], given.mean[place]
        left = r - Z @ L[place] @ mean
        misfit = (WEIGHT[place] * left**2).sum() + mean @ mean
        log_det = given.log_det[place] - np.log(WEIGHT[place]).sum()
        found = -0.5 * (misfit + log_det + N_ROW * np.log(2 * np.pi))
        expected = stats.multivariate_normal(np.zeros(N_ROW), sigma).logpdf(r)
        assert found == pytest.approx(expected, rel=1e-10)  # rounding: condition of sigma


def test_scores_given__at_is_the_inverse_of_normals_and_has_the_covariance(case):
    rng = np.random.default_rng(2)
    _, _, Z, L, given = case
    normal = rng.standard_normal((*BATCH, N_LEVEL))
    scores = given.at(normal)
    # The normals that scores stand for, by the factor of their precision.
    off = scores - given.mean
    back = times(t(dense(given.factor)), off)
    np.testing.assert_allclose(back, normal, rtol=1e-10, atol=1e-12)
    design = Z @ L
    M = np.eye(N_LEVEL) + t(design) @ (WEIGHT[..., None] * design)
    columns = [given.at(np.broadcast_to(e, normal.shape)) - given.mean for e in np.eye(N_LEVEL)]
    spread = np.stack(columns, axis=-1)
    # Rounding: M^-1 through its factor.
    np.testing.assert_allclose(spread @ t(spread), np.linalg.inv(M), rtol=1e-9, atol=1e-12)


def test_row_variance__is_that_of_each_rows_loading(case):
    design, root, Z, L, given = case
    expected = square_sum(given.half(t(Z @ L)))
    np.testing.assert_allclose(given.row_variance(root, design), expected, rtol=1e-11)  # rounding
    # Rows of which only one is asked for have fewer levels of their own.
    one = Design(design.codes[:, [3]], N_LEVEL)
    np.testing.assert_allclose(given.row_variance(root, one)[..., 0], expected[..., 3], rtol=1e-11)
