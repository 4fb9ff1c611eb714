"""Elimination in the body's sparse stiffness, in an order that is found once for a mesh.

Contact changes which nodes of the rim are coupled, but hardly the fill-in. One order, of all nodes
that may touch, serves every state. A new order would take a quarter of each factorisation.
"""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import SuperLU, splu

from ridgebayes._types import IntArray

_RELAX, _PANEL = 1, 2  # columns; SuperLU's larger defaults pay off for denser factors


def elimination_order(groups: Sequence[IntArray], n: int) -> IntArray:
    """Return the order in which to eliminate nodes, by least degree.

    Parameters
    ----------
    groups : sequence of ndarray of int, shape (n_group, n_member)
        Nodes that are coupled with each other, in arrays for each size of group.
    n : int
        Number of nodes.

    Returns
    -------
    ndarray of int, shape (n,)
        All nodes, the first to be eliminated first.

    Examples
    --------
    >>> import numpy as np
    >>> star = np.array([[0, 1], [0, 2], [0, 3], [0, 4]])
    >>> 0 in elimination_order([star], 5)[:3]  # the hub waits until one arm is left
    False
    """
    member = np.concatenate([group.ravel() for group in groups])
    sizes = np.concatenate([np.full(len(group), group.shape[1]) for group in groups])
    pointers = np.concatenate([[0], np.cumsum(sizes)])
    incidence = sparse.csr_array((np.ones(len(member)), member, pointers), shape=(len(sizes), n))
    graph = sparse.csc_array(incidence.T @ incidence + sparse.eye_array(n))
    factor = splu(graph, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0)
    return np.argsort(factor.perm_c)


def factorise(matrix: sparse.csr_array, order: IntArray, *, pivoting: bool) -> SuperLU:
    """Return the factors of a part of a matrix.

    Parameters
    ----------
    matrix : scipy.sparse.csr_array, shape (n, n)
        The stiffness.
    order : ndarray of int, shape (n_part,)
        Rows and columns of the part, the first to be eliminated first.
    pivoting : bool
        Whether rows may change places, as they must where the matrix is not symmetric.

    Raises
    ------
    RuntimeError
        If a pivot is exactly zero.
    """
    return splu(
        sparse.csc_array(matrix)[order][:, order],
        permc_spec="NATURAL",
        diag_pivot_thresh=1e-3 if pivoting else 0.0,
        relax=_RELAX,
        panel_size=_PANEL,
    )
