"""Transition loads of ridged textures on an elastic half-plane, to a requested accuracy.

The loads of all textures with the same ratio of groove to ridge width are a table F_k times
(pitch/R)^2 / (1 - nu^2) (exact scaling law). The table is solved in cached batches, so that F_k
does not depend on the number of requested transitions. At transition k the strips 0 ... k-1 are in
full contact and no others: an event of a `RidgeRow`, solved with one Cholesky factorisation.
"""

import functools
import math
from dataclasses import dataclass
from numbers import Real

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.contact.contact_solution import DEFAULT_REL_TOL
from ridgebayes.contact.logkernel import log_ellipse
from ridgebayes.contact.ridge_row import RidgeRow
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import InputError, expect

# 7,000 unknowns take 400 MB and a few seconds; larger problems get a status instead.
MAX_UNKNOWNS = 7000


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

    Notes
    -----
    F is read-only, because the cache returns the same array to every caller.
    """

    F: FloatArray
    status: tuple[str, ...]

    def __post_init__(self) -> None:
        self.F.flags.writeable = False

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
        >>> loads = transition_loads(0.012, 0.01, 2)
        >>> [round(p, 10) for p in loads.p_over_E(0.022).tolist()]
        [0.0002716017, 0.0010336853]
        """
        return pitch_over_R**2 * self.F / (1.0 - nu**2)


def transition_loads(
    ridge_width: float, groove_width: float, n_transitions: int, *, rel_tol: float = DEFAULT_REL_TOL
) -> HalfPlaneLoads:
    """Compute the loads at which contact reaches ridges 1 ... n.

    F_k = p_k/E (1 - nu^2) (R/pitch)^2, from one linear solve per batch of transitions.

    Parameters
    ----------
    ridge_width, groove_width : float, scalar, any one unit of length
        Widths, of which only the ratio matters.
    n_transitions : int, scalar, count
        Number of transitions, k = 1 ... n_transitions (Q = 2 + 2k).
    rel_tol : float, scalar, dimensionless
        Requested relative error of each load.

    Returns
    -------
    HalfPlaneLoads
        Loads, each with a status, in read-only arrays.

    Raises
    ------
    InputError
        If a width is not finite and positive, n_transitions is not an integer of at least 1, or
        rel_tol is not in (0, 0.1].

    Notes
    -----
    *Validity.* Small strain, no friction, sharp corners, grooves too deep to be touched.

    *Accuracy.* ``status`` is ``"ok"`` only if the estimated error is within rel_tol, the
    coefficients have decayed, every pressure is positive and the loads rise. Rounding limits the
    error to about 1e-13. Loads that need more unknowns than `MAX_UNKNOWNS` are not computed.

    *Cost.* About 7 coefficients per strip at a = b, and 144 at a = 1000 b (growing as sqrt(a/b)). A
    usual texture up to Q = 20 takes a millisecond; repeated calls use the cache.

    References
    ----------
    The study this package reproduces: doi:10.1016/j.ijssolstr.2019.06.026, which computed these
    loads by finite elements. Method: `docs/derivations/half-plane.md`.

    Examples
    --------
    Without grooves Hertz's contact has half-width k pitches at F_k = (pi/8) k^2:

    >>> loads = transition_loads(1000.0, 1.0, 3)
    >>> loads.status
    ('ok', 'ok', 'ok')
    >>> np.round(loads.F * 8.0 / np.pi, 2)
    array([1., 4., 9.])
    """
    for name, width in (("ridge_width", ridge_width), ("groove_width", groove_width)):
        if not (math.isfinite(width) and width > 0.0):
            raise InputError(f"{name} = {width!r}: must be finite and > 0")
    if not (n_transitions >= 1 and n_transitions % 1 == 0):
        raise InputError(f"n_transitions = {n_transitions!r}: must be an integer of at least 1")
    check_tolerance(rel_tol)
    n_table = 1 << (int(n_transitions) - 1).bit_length()
    table = _table(2.0 * groove_width / ridge_width, n_table, float(rel_tol))
    return HalfPlaneLoads(table.F[:n_transitions], table.status[:n_transitions])


def check_tolerance(rel_tol: float) -> None:
    """Raise InputError for a relative tolerance that is not above 0 and at most 0.1."""
    expect(Real, rel_tol=rel_tol)
    if not 0.0 < rel_tol <= 0.1:
        raise InputError(f"rel_tol = {rel_tol!r}: must be in (0, 0.1]")


def forget_loads() -> None:
    """Clear the cache of loads, for measurements of time."""
    _table.cache_clear()


@functools.lru_cache(maxsize=1024)
def _table(gap_ratio: float, n: int, rel_tol: float) -> HalfPlaneLoads:
    """Return F_1 ... F_n; the first half is that of the table of half the length."""
    profile = Profile(2.0, gap_ratio)
    # Loads are quadratic in the coefficients' error, so their error is C rho^(-2 m). C is 1e-2 in
    # measurements, 1e-1 here, and an eighth more coefficients are a margin.
    m = math.ceil(max(3.0, math.log(0.1 / rel_tol) / (2.0 * float(log_ellipse(gap_ratio)))))
    m += max(2, math.ceil(m / 8.0))
    n_known, n_solved = n // 2, min(n, MAX_UNKNOWNS // m)
    over = f"{m} coefficients a strip are over the cap of {MAX_UNKNOWNS} unknowns"
    F, status = np.full(n, np.nan), [f"not computed: {over}"] * n
    if n_solved > n_known:
        F[:n_solved], status[:n_solved] = _solved(profile, n_solved, m, rel_tol)
    if n_known:
        below = _table(gap_ratio, n_known, rel_tol)
        F[:n_known], status[:n_known] = below.F, below.status
    return HalfPlaneLoads(F, tuple(status))


def _solved(profile: Profile, n: int, m: int, rel_tol: float) -> tuple[FloatArray, list[str]]:
    """Return F_1 ... F_n and their statuses, from m Chebyshev coefficients a strip.

    -int q ln|x - xi| dxi = d - x^2/2 on the strips in contact, gap 0 at the next proximal corner.
    """
    try:
        row = RidgeRow.of(profile, n, m, 1.0)
    except np.linalg.LinAlgError as failure:
        return np.full(n, np.nan), [f"not computed: {failure}"] * n
    moments, _, lift = row.events_of_covered()
    mean = moments[:, 0].sum(axis=0) / np.arange(1, n + 1)
    tail = np.abs(moments[:, -2:]).max(axis=(0, 1)) / mean
    F = 0.25 * math.pi * row.load(moments) / profile.pitch**2
    # The load's error is below 0.01 tail^2. Rounding errors are magnified in the approach; 16 is
    # the measured ratio of the scatter under a change of length unit to this magnification.
    error = 0.01 * tail**2 + 16.0 * np.finfo(np.float64).eps / (1.0 - lift)
    waves = np.cos(np.arange(m) * (np.arange(2 * m + 1) * (math.pi / (2 * m)))[:, None])
    pressure = np.tensordot(waves, moments, axes=(1, 1)).min(axis=0)
    sound = np.where(row.within, pressure, np.inf).min(axis=0) > 0.0
    sound &= np.diff(F, prepend=0.0) > 0.0
    why = [f"not converged: estimated relative error {size:.1e}" for size in error.tolist()]
    status = np.where(sound, "ok", "not converged: a pressure is not positive, or a load falls")
    return F, np.where(error <= rel_tol, status, why).tolist()
