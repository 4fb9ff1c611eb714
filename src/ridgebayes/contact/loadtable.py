"""Record of transition loads with their status and error."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ridgebayes._types import FloatArray, IntArray


@dataclass(frozen=True)
class HalfPlaneLoads:
    """Dimensionless transition loads F_1 ... F_n for a ratio of groove to ridge width.

    Attributes
    ----------
    F : ndarray of float, shape (n_transition,), dimensionless
        p/E (1 - nu^2) (R/pitch)^2 at which Q = 2 + 2k, k = 1 ... n. NaN if not computed; a number
        whose status is not ``"ok"`` violates the tolerance or a check.
    status : tuple of str, shape (n_transition,)
        ``"ok"``, or the failed check.
    n_coefficients : ndarray of int, shape (n_transition,), count
        Chebyshev coefficients per strip; 0 if not computed.
    rel_error : ndarray of float, shape (n_transition,), dimensionless
        Estimated relative error of F: change from the solution with an eighth fewer coefficients,
        plus rounding. NaN if not computed.

    Notes
    -----
    The arrays are read-only, because the cache returns the same arrays to every caller.
    """

    F: FloatArray
    status: tuple[str, ...]
    n_coefficients: IntArray
    rel_error: FloatArray

    def __post_init__(self) -> None:
        for column in fields(self):
            if column.name != "status":
                getattr(self, column.name).flags.writeable = False

    def p_over_E(self, pitch_over_R: float, *, nu: float = 0.5) -> FloatArray:
        """Scale the loads to a texture: p/E = (pitch/R)^2 F_k / (1 - nu^2).

        Parameters
        ----------
        pitch_over_R : float, scalar, dimensionless
            Ridge width plus groove width over the radius of the body.
        nu : float, scalar, dimensionless
            Poisson's ratio.

        Returns
        -------
        ndarray of float, shape (n_transition,), dimensionless
            Load per projected area over Young's modulus.

        Examples
        --------
        >>> from ridgebayes.contact.halfplane import transition_loads
        >>> loads = transition_loads(0.012, 0.01, 2)
        >>> [round(p, 10) for p in loads.p_over_E(0.022).tolist()]
        [0.0002716017, 0.0010336853]
        """
        return pitch_over_R**2 * self.F / (1.0 - nu**2)

    def part(self, part: slice) -> "HalfPlaneLoads":
        """Return a slice of the transitions, as views."""
        parts: list[Any] = [getattr(self, column.name)[part] for column in fields(self)]
        return HalfPlaneLoads(*parts)

    def joined(self, other: "HalfPlaneLoads") -> "HalfPlaneLoads":
        """Return these transitions followed by those of another record."""
        joined: list[Any] = []
        for name in (column.name for column in fields(self)):
            a, b = getattr(self, name), getattr(other, name)
            joined.append(a + b if isinstance(a, tuple) else np.concatenate((a, b)))
        return HalfPlaneLoads(*joined)

    @classmethod
    def not_computed(cls, n_transitions: int, reason: str) -> "HalfPlaneLoads":
        """Return a record without numbers, with a reason."""
        status = (f"not computed: {reason}",) * n_transitions
        F, n = np.full(n_transitions, np.nan), np.zeros(n_transitions, dtype=np.int64)
        return cls(F, status, n, F.copy())
