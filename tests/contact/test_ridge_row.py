import math

import numpy as np

from ridgebayes.contact.logkernel import cross_blocks, self_energies
from ridgebayes.contact.ridge_row import RidgeRow
from ridgebayes.contact.rigid_profile import Profile


def test_matrix_is_that_of_both_sides_folded():
    """Against the full matrix of 2n strips, assembled without symmetry and folded by parity."""
    n, m, gap_ratio = 3, 4, 0.5
    row = RidgeRow.of(Profile(2.0, gap_ratio), n, m, 1.0)
    blocks = cross_blocks(gap_ratio, 2 * n - 1, m)
    shift = -(math.pi**2) * math.log(1.0 / row.unit)
    full = np.zeros((2 * n, m, 2 * n, m))
    for i in range(2 * n):
        for j in range(2 * n):
            block = np.diag(self_energies(m)) if i == j else blocks[abs(i - j) - 1].copy()
            block[0, 0] += shift
            full[i, :, j] = block if i >= j else block.T
    fold = np.zeros((2 * n, m, n, m))
    for j in range(n):
        fold[n + j, range(m), j, range(m)] = 1.0
        fold[n - 1 - j, range(m), j, range(m)] = (-1.0) ** np.arange(m)
    full = full.reshape(2 * n * m, 2 * n * m)
    fold = fold.reshape(2 * n * m, n * m)
    expected = 0.5 * fold.T @ full @ fold
    ours = row._matrix(m) + np.diag(np.tile(row.energies, n))
    # Algebra: sums of a few terms of order 10.
    np.testing.assert_allclose(ours, expected, atol=1e-12)
