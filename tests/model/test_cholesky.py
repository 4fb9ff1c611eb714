"""Factors of many matrices at once against dense algebra, matrix by matrix."""

import numpy as np
import pytest
from scipy import linalg

from ridgebayes.model.cholesky import (
    BorderedFactor,
    DenseFactor,
    cholesky_or_nan,
    solve_lower,
)

BATCH, N = (2, 3), 5
FACTOR = np.tril(np.random.default_rng(1).standard_normal((*BATCH, N, N))) + 2 * np.eye(N)


def t(matrix):
    return np.swapaxes(matrix, -1, -2)


def bordered(n_first):
    """A bordered factor of five rows, and the same with its zeros."""
    dense = FACTOR.copy()
    rows = np.arange(n_first)
    diagonal = dense[..., rows, rows]
    dense[..., :n_first, :] = 0
    dense[..., rows, rows] = diagonal
    corner = dense[..., n_first:, n_first:]
    return BorderedFactor(diagonal, dense[..., n_first:, :n_first], corner), dense


CASES = {"dense": (DenseFactor(FACTOR), FACTOR), "bordered": bordered(3), "diagonal": bordered(N)}


@pytest.mark.parametrize("name", CASES)
def test_factors__solve_and_tell_their_diagonal_as_with_their_zeros(name):
    factor, dense = CASES[name]
    x = np.random.default_rng(2).standard_normal((*BATCH, N, 2))
    np.testing.assert_allclose(dense @ factor.solve(x), x, rtol=0, atol=1e-12)  # rounding
    np.testing.assert_allclose(dense @ factor.inverted().solve(x), x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(t(dense) @ factor.solve_transposed(x), x, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(factor.pivots, np.diagonal(dense, axis1=-2, axis2=-1))
    assert factor.nbytes <= dense.nbytes


def test_factors__of_some_unknowns_give_their_covariance():
    factor, dense = bordered(3)
    levels = np.array([1, 3, 4])  # one of the first, and all others
    x = np.random.default_rng(3).standard_normal((*BATCH, 3, 2))
    everywhere = np.zeros((*BATCH, N, 2))
    everywhere[..., levels, :] = x
    expected = t(x) @ np.linalg.inv(dense @ t(dense))[..., levels[:, None], levels] @ x
    for one in (factor, DenseFactor(dense), DenseFactor(dense).inverted()):
        half = one.of(levels).solve(x)
        np.testing.assert_allclose(t(half) @ half, expected, rtol=1e-10, atol=1e-13)  # rounding


@pytest.mark.parametrize("most", [0, 64])
def test_inverted__is_an_inverse_where_it_is_quicker(monkeypatch, most):
    monkeypatch.setattr("ridgebayes.model.cholesky._INVERTED", most)
    x = np.random.default_rng(2).standard_normal((*BATCH, N, 2))
    found = DenseFactor(FACTOR).inverted()
    assert isinstance(found, DenseFactor) == (most == 0)
    np.testing.assert_allclose(FACTOR @ found.solve(x), x, rtol=1e-11, atol=1e-12)  # rounding


def test_cholesky_or_nan__marks_what_is_not_definite_and_keeps_the_rest():
    good = FACTOR @ t(FACTOR)
    matrices = good.copy()
    matrices[0, 1] -= 100 * np.eye(N)
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
