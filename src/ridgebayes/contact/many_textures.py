"""Half-plane loads of very many textures, from a table of F_k against the ratio of groove to ridge.

F_k depends on one number, beta = b/a: textures by the hundred thousand are one function of it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray
from ridgebayes.contact.halfplane import transition_loads
from ridgebayes.errors import ComputationError

_DEGREE = 15  # of the polynomials in log beta: log F_k is smooth there
_NODES = chebyshev.chebpts1(_DEGREE + 1)
# Places between its nodes, in a piece of -1 to 1.
_CHECKED = np.array([-0.97, -0.55, 0.03, 0.52, 0.96])
_LEAST = 1e-3  # of log beta: a piece that has to be narrower is no smooth function's
_ABOVE = 1e-12  # ends are widened by it, so that rounding leaves none outside


@dataclass(frozen=True, eq=False)
class LoadFunction:
    """F_1 ... F_n as a function of beta = b/a: polynomials on pieces of log beta.

    Parameters
    ----------
    ends : ndarray of float, shape (n_piece + 1,)
        log beta where pieces end.
    coefficients : ndarray of float, shape (n_piece, degree + 1, n_transition)
        Chebyshev coefficients of log F_k.
    given : tuple of float, shape (4,)
        What `load_function` made it from: both ratios, transitions, tolerance.
    """

    ends: FloatArray
    coefficients: FloatArray
    given: tuple[float, float, int, float]

    @property
    def n_transitions(self) -> int:
        """How many transitions there are."""
        return int(self.coefficients.shape[2])

    def __call__(self, ridge_width: ArrayLike, groove_width: ArrayLike) -> FloatArray:
        """Return F_k of textures whose ratios are within the range, (n_texture, n_transition)."""
        a, b = np.broadcast_arrays(*np.atleast_1d(ridge_width, groove_width))
        x = np.log(b) - np.log(a)
        piece = np.clip(np.searchsorted(self.ends, x) - 1, 0, len(self.ends) - 2)
        F = np.empty((len(x), self.n_transitions))
        for i in np.unique(piece):
            here = piece == i
            low, high = self.ends[i], self.ends[i + 1]
            t = (2 * x[here] - low - high) / (high - low)
            F[here] = np.exp(chebyshev.chebval(t, self.coefficients[i]).T)
        return F


def load_function(
    ratio_min: float, ratio_max: float, n_transitions: int, *, rel_tol: float = 1e-7
) -> LoadFunction:
    """Tabulate F_1 ... F_n between two ratios of groove to ridge.

    Parameters
    ----------
    ratio_min, ratio_max : float, scalar, dimensionless
        b/a.
    n_transitions : int, scalar, count
        Transitions.
    rel_tol : float, scalar, dimensionless
        Wanted relative error, of the table and of the loads that it is made from together.

    Returns
    -------
    LoadFunction
        Checked between the nodes of each piece; pieces that fail are halved.

    Raises
    ------
    ComputationError
        If a load cannot be computed, or no piece is short enough.

    Notes
    -----
    *Validity.* As `ridgebayes.contact.halfplane.transition_loads`.

    *Cost.* Some twenty solves a piece; two to four pieces from b/a = 0.1 to 10.

    Examples
    --------
    >>> loads = load_function(0.5, 2.0, 3)
    >>> bool(abs(loads(0.022, 0.02)[0, 2] / transition_loads(0.022, 0.02, 3).F[2] - 1) < 1e-7)
    True
    """

    def solved(places: FloatArray) -> FloatArray:
        found = []
        for ratio in np.exp(places).tolist():
            loads = transition_loads(1.0, ratio, n_transitions, rel_tol=rel_tol / 10)
            for text in loads.status:
                if text != "ok":
                    raise ComputationError(f"groove over ridge {ratio:.6g}: {text}")
            found.append(np.log(loads.F))
        return np.stack(found)

    def pieces(low: float, high: float) -> list[tuple[float, FloatArray]]:
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        found = solved(middle + half * _NODES)
        coefficients: FloatArray = np.asarray(chebyshev.chebfit(_NODES, found, _DEGREE), float)
        there = solved(middle + half * _CHECKED)
        error = float(np.abs(chebyshev.chebval(_CHECKED, coefficients).T - there).max())
        if error <= rel_tol / 2:
            return [(high, coefficients)]
        if half < _LEAST:
            raise ComputationError(
                f"groove over ridge {np.exp(middle):.6g}: the table misses {rel_tol:g} by "
                f"{error:.1g}; expected a looser tolerance"
            )
        return pieces(low, middle) + pieces(middle, high)

    low, high = np.log(ratio_min), np.log(ratio_max)
    margin = _ABOVE * (1 + max(abs(low), abs(high)))
    found = pieces(float(low - margin), float(high + margin))
    stops, coefficients = zip(*found, strict=True)
    ends, given = np.array([low - margin, *stops]), (ratio_min, ratio_max, n_transitions, rel_tol)
    return LoadFunction(ends, np.stack(coefficients), given)
