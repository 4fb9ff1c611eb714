"""Half-plane loads of very many textures, from a table of F_k against the ratio of groove to ridge.

F_k depends on one number, beta = b/a: textures by the hundred thousand are one function of it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray
from ridgebayes.contact.halfplane import transition_loads
from ridgebayes.errors import ComputationError, InputError

_DEGREE = 15  # of the polynomials in log beta: log F_k is smooth there
_CHECKED = (-0.97, -0.55, 0.03, 0.52, 0.96)  # places between its nodes, in a piece of -1 to 1
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
    rel_error : float
        Largest relative error at places between the nodes of all pieces.
    given : tuple of float, shape (4,)
        What `load_function` made it from: both ratios, transitions, tolerance.
    """

    ends: FloatArray
    coefficients: FloatArray
    rel_error: float
    given: tuple[float, float, int, float]

    @property
    def n_transitions(self) -> int:
        """How many transitions there are."""
        return int(self.coefficients.shape[2])

    def __call__(self, ridge_width: ArrayLike, groove_width: ArrayLike) -> FloatArray:
        """Return F_k of textures, shape (n_texture, n_transition).

        Raises
        ------
        InputError
            If a ratio lies outside the function's range.
        """
        a, b = np.broadcast_arrays(*np.atleast_1d(ridge_width, groove_width))
        x = np.log(b) - np.log(a)
        outside = ~((x >= self.ends[0]) & (x <= self.ends[-1]))
        if outside.any():
            i = int(np.argmax(outside))
            raise InputError(
                f"texture {i + 1}: groove over ridge {float(b[i] / a[i])!r}; expected from "
                f"{np.exp(self.ends[0]):.6g} to {np.exp(self.ends[-1]):.6g}"
            )
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
    InputError
        If the ratios are not positive, finite and in order, or the tolerance is not in (0, 0.1].
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
    if not (0 < ratio_min <= ratio_max < np.inf):
        raise InputError(
            f"ratios {ratio_min!r} to {ratio_max!r}: expected positive, finite, in order"
        )
    if not 0.0 < rel_tol <= 0.1:
        raise InputError(f"rel_tol = {rel_tol!r}: must be in (0, 0.1]")
    nodes = chebyshev.chebpts1(_DEGREE + 1)
    at_nodes = np.linalg.inv(chebyshev.chebvander(nodes, _DEGREE))

    def solved(x: float) -> FloatArray:
        loads = transition_loads(1.0, float(np.exp(x)), n_transitions, rel_tol=rel_tol / 10)
        for text in loads.status:
            if text != "ok":
                raise ComputationError(f"groove over ridge {np.exp(x):.6g}: {text}")
        return np.log(loads.F)

    def pieces(low: float, high: float) -> list[tuple[float, FloatArray, float]]:
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        values = np.stack([solved(middle + half * t) for t in nodes])
        coefficients = np.asarray(at_nodes @ values, dtype=np.float64)
        there = np.stack([solved(middle + half * t) for t in _CHECKED])
        error = float(np.abs(chebyshev.chebval(_CHECKED, coefficients).T - there).max())
        if error <= rel_tol / 2:
            return [(high, coefficients, error)]
        if half < _LEAST:
            raise ComputationError(
                f"groove over ridge {np.exp(middle):.6g}: the table misses {rel_tol:g} by "
                f"{error:.1g}; expected a looser tolerance"
            )
        return pieces(low, middle) + pieces(middle, high)

    low, high = np.log(ratio_min), np.log(ratio_max)
    margin = _ABOVE * (1 + max(abs(low), abs(high)))
    found = pieces(float(low - margin), float(high + margin))
    stops, coefficients, errors = zip(*found, strict=True)
    ends, given = np.array([low - margin, *stops]), (ratio_min, ratio_max, n_transitions, rel_tol)
    return LoadFunction(ends, np.stack(coefficients), max(errors), given)
