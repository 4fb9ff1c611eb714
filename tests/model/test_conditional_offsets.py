"""The linear-normal problem against dense algebra: every matrix with its zeros."""

import numpy as np
import pytest
from scipy import linalg, stats

from ridgebayes.model.conditional_offsets import (
    Design,
    DiagonalRoot,
    FullRoot,
    cholesky_or_nan,
    given_rows,
    precision_root,
    solve_lower,
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


def times(matrix, vector):
    return np.einsum("...ij,...j->...i", matrix, vector)


def test_design__and_roots_are_the_products_with_dense_matrices(case):
    rng = np.random.default_rng(2)
    design, root, Z, L, _ = case
    b, x = rng.standard_normal((*BATCH, N_LEVEL)), rng.standard_normal((*BATCH, N_ROW))
    np.testing.assert_array_equal(design.transposed, Z.T)
    np.testing.assert_allclose(design.spread(b), b @ Z.T, rtol=1e-13)  # rounding, and below
    np.testing.assert_allclose(design.gather(x), x @ Z, rtol=1e-12, atol=1e-14)
    gram, dense = design.gram(WEIGHT), t(Z) @ (WEIGHT[..., None] * Z)
    as_dense = gram[..., None] * np.eye(N_LEVEL) if design.diagonal else gram
    np.testing.assert_allclose(as_dense, dense, rtol=1e-13)
    np.testing.assert_allclose(root.times(b), times(L, b), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(root.transposed_times(b), times(t(L), b), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(root.loading(design), t(Z @ L), rtol=1e-13)
    precision = root.precision(design, WEIGHT)
    diagonal = precision.ndim == b.ndim
    found = precision[..., None] * np.eye(N_LEVEL) if diagonal else precision
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
    np.testing.assert_allclose(given.variance(loading), expected, rtol=1e-10)
    np.testing.assert_allclose(given.inverted().variance(loading), expected, rtol=1e-10)


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
    is_diagonal = given.root.ndim == given.mean.ndim
    back = off * given.root if is_diagonal else (t(given.root) @ off[..., None])[..., 0]
    np.testing.assert_allclose(back, normal, rtol=1e-10, atol=1e-12)
    design = Z @ L
    M = np.eye(N_LEVEL) + t(design) @ (WEIGHT[..., None] * design)
    columns = [given.at(np.broadcast_to(e, normal.shape)) - given.mean for e in np.eye(N_LEVEL)]
    spread = np.stack(columns, axis=-1)
    # Rounding: M^-1 through its factor.
    np.testing.assert_allclose(spread @ t(spread), np.linalg.inv(M), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("most", [0, 64])
def test_full_root__solve_is_the_inverse_of_times(monkeypatch, most):
    monkeypatch.setattr("ridgebayes.model.conditional_offsets._INVERTED", most)
    rng = np.random.default_rng(2)
    x = rng.standard_normal((*BATCH, N_LEVEL, 2))
    found = FullRoot(FACTOR).inverted().solve(x)
    np.testing.assert_allclose(FACTOR @ found, x, rtol=1e-11, atol=1e-12)  # rounding


def test_precision_root__of_very_many_levels_of_a_factor_is_the_dense_factor():
    rng, n_first, n_second = np.random.default_rng(3), 40, 5
    codes = np.stack([np.repeat(np.arange(n_first), 4), n_first + rng.integers(0, n_second, 160)])
    design = Design(codes, n_first + n_second)
    root = DiagonalRoot(rng.uniform(0.5, 2.0, (3, n_first + n_second)))
    weight = rng.uniform(0.5, 2.0, (3, 160))
    dense = root.precision(design, weight) + np.eye(n_first + n_second)
    found = precision_root(design, root, weight)
    np.testing.assert_allclose(found, np.linalg.cholesky(dense), rtol=0, atol=1e-13)  # rounding
    assert design.n_first >= n_first > 32  # the threshold of what is factorised apart


def test_cholesky_or_nan__marks_what_is_not_definite_and_keeps_the_rest():
    good = FACTOR @ t(FACTOR)
    matrices = good.copy()
    matrices[0, 1] -= 100 * np.eye(N_LEVEL)
    matrices[1, 2, 0, 0] = np.nan
    found = cholesky_or_nan(matrices)
    bad = np.zeros(BATCH, bool)
    bad[0, 1] = bad[1, 2] = True
    assert np.isnan(found[bad]).any(axis=(-2, -1)).all()
    np.testing.assert_allclose(found[~bad] @ t(found[~bad]), good[~bad], rtol=1e-11, atol=1e-12)
    np.testing.assert_array_equal(cholesky_or_nan(good)[~bad], found[~bad])


@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize(("n", "n_batch"), [(1, 50), (5, 50), (5, 3), (30, 4)])
def test_solve_lower__is_scipys_system_by_system_however_many_there_are(n, n_batch, transposed):
    rng = np.random.default_rng(n)
    factor = np.tril(rng.standard_normal((2, n_batch, n, n))) + 3 * np.eye(n)
    right = rng.standard_normal((n_batch, n, 2))
    found = solve_lower(factor, right, transposed=transposed)
    for i, j in np.ndindex(2, n_batch):
        expected = linalg.solve_triangular(
            factor[i, j], right[j], trans=int(transposed), lower=True
        )
        scale = np.abs(expected).max()
        np.testing.assert_allclose(found[i, j], expected, rtol=0, atol=1e-11 * scale)  # rounding
