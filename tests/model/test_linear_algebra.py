"""Factors of many matrices at once against dense algebra, matrix by matrix."""

import numpy as np
import pytest
from scipy import linalg

from ridgebayes.model.linear_algebra import cholesky_or_nan, solve_lower

BATCH, N = (2, 3), 5
FACTOR = np.tril(np.random.default_rng(1).standard_normal((*BATCH, N, N))) + 2 * np.eye(N)


def test_cholesky_or_nan__marks_what_is_not_definite_and_keeps_the_rest():
    good = FACTOR @ np.swapaxes(FACTOR, -1, -2)
    matrices = good.copy()
    matrices[0, 1] -= 100 * np.eye(N)
    matrices[1, 2, 0, 0] = np.nan
    found = cholesky_or_nan(matrices)
    bad = np.zeros(BATCH, bool)
    bad[0, 1] = bad[1, 2] = True
    assert np.isnan(found[bad]).any(axis=(-2, -1)).all()
    np.testing.assert_allclose(
        found[~bad] @ np.swapaxes(found[~bad], -1, -2), good[~bad], rtol=1e-11, atol=1e-12
    )
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
