"""Factorisation of the body's sparse stiffness, with one elimination order for a mesh.

Contact changes which nodes of the rim are coupled, but hardly the fill-in. The order is computed
once for all nodes that may touch; a new order would take a quarter of each factorisation.
"""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import SuperLU, splu

from ridgebayes._types import IntArray

_RELAX_COLUMNS, _PANEL_COLUMNS = 1, 2  # SuperLU's larger defaults suit denser factors


def elimination_order(groups: Sequence[IntArray], n: int) -> IntArray:
    """Return the elimination order of nodes by minimum degree.

    Parameters
    ----------
    groups : sequence of ndarray of int, shape (n_group, n_member)
        Nodes that are coupled with each other, one array for each size of group.
    n : int
        Number of nodes.

    Returns
    -------
    ndarray of int, shape (n,)
        All nodes in the order of elimination.

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
    """Return the LU factors of a part of a matrix.

    Parameters
    ----------
    matrix : scipy.sparse.csr_array, shape (n, n)
        Stiffness.
    order : ndarray of int, shape (n_part,)
        Rows and columns of the part in the order of elimination.
    pivoting : bool
        Whether rows may be exchanged, which an unsymmetric matrix needs.

    Raises
    ------
    RuntimeError
        If a pivot is exactly zero.
    """
    return splu(
        sparse.csc_array(matrix)[order][:, order],
        permc_spec="NATURAL",
        diag_pivot_thresh=1e-3 if pivoting else 0.0,
        relax=_RELAX_COLUMNS,
        panel_size=_PANEL_COLUMNS,
    )
