"""An order for all states: the same answer, and as little fill as an order of its own."""

import numpy as np
import pytest
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from ridgebayes.contact.cylinder.elimination import elimination_order, factorise

N = 12  # nodes a side


def grid():
    """Return the elements of a square of quadratic elements, shape (n_element, 9)."""
    at = np.arange((2 * N + 1) ** 2).reshape(2 * N + 1, -1)
    corners = [(2 * i, 2 * j) for i in range(N) for j in range(N)]
    return np.array([at[i : i + 3, j : j + 3].ravel() for i, j in corners])


def stiffness(groups, n, seed=1):
    """Return a positive definite matrix of elements, with an entry for each pair of a group."""
    rng = np.random.default_rng(seed)
    matrix = sparse.lil_array((n, n))
    for group in groups:
        part = rng.normal(size=(len(group), len(group)))
        matrix[np.ix_(group, group)] += part @ part.T
    return sparse.csr_array(matrix)


def test_order__fills_as_little_as_one_that_is_found_anew():
    elements = grid()
    n = elements.max() + 1
    order = elimination_order([elements], n)
    assert sorted(order) == list(range(n))
    matrix = stiffness(elements, n)
    here = factorise(matrix, order, pivoting=False).L.nnz
    own = splu(sparse.csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0).L.nnz
    natural = splu(sparse.csc_array(matrix), permc_spec="NATURAL", diag_pivot_thresh=0.0).L.nnz
    # Ties of the least degree are broken otherwise; rows as they come fill more than twice as much.
    assert here < 1.1 * own < 0.6 * natural


@pytest.mark.parametrize("pivoting", [False, True])
def test_factors__solve_the_part_in_its_order(pivoting):
    elements = grid()
    n = elements.max() + 1
    matrix = stiffness(elements, n)
    order = elimination_order([elements], n)
    order = order[order % 7 > 0]  # some are held
    right = np.random.default_rng(2).normal(size=len(order))
    found = factorise(matrix, order, pivoting=pivoting).solve(right)
    part = matrix.toarray()[np.ix_(order, order)]
    expected = np.linalg.solve(part, right)
    rounding = 1e-15 * np.linalg.cond(part) * np.linalg.norm(expected)
    assert np.linalg.norm(found - expected) < rounding


def test_pivots__are_negative_as_often_as_eigenvalues():
    """Sylvester's law: without pivoting the signs of pivots are those of eigenvalues."""
    elements = grid()
    n = elements.max() + 1
    matrix = stiffness(elements, n) - 3.0 * sparse.eye_array(n)
    order = elimination_order([elements], n)
    negative = int((factorise(matrix, order, pivoting=False).U.diagonal() < 0).sum())
    assert negative == int((np.linalg.eigvalsh(matrix.toarray()) < 0).sum()) > 0


def test_zero_pivot__is_an_error():
    with pytest.raises(RuntimeError, match="singular"):
        factorise(sparse.csr_array((3, 3)), np.arange(3), pivoting=False)
