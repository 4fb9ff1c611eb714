"""Transition loads of ridged textures on an elastic half-plane, to a requested accuracy.

The loads of all textures with the same ratio of groove to ridge width are a table F_k times
(pitch/R)^2 / (1 - nu^2) (exact scaling law). The table is solved in cached batches, so that F_k
does not depend on the number of requested transitions. At transition k the strips 0 ... k-1 are in
full contact and no others: an event of a `RidgeRow`, solved with one Cholesky factorisation.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import BoolArray, FloatArray
from ridgebayes.contact.contact_solution import DEFAULT_REL_TOL
from ridgebayes.contact.logkernel import log_ellipse, self_energies
from ridgebayes.contact.ridge_row import RidgeRow
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import InputError

# 7,000 unknowns take 400 MB and a few seconds; larger problems get a status instead.
MAX_UNKNOWNS = 7000
_NOT_CONVERGED = "not converged: estimated relative error {:.1e}"


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
    rel_error : ndarray of float, shape (n_transition,), dimensionless
        Estimated relative error of F: change from the solution with an eighth fewer coefficients,
        plus rounding. NaN if not computed.

    Notes
    -----
    The arrays are read-only, because the cache returns the same arrays to every caller.
    """

    F: FloatArray
    status: tuple[str, ...]
    rel_error: FloatArray

    def __post_init__(self) -> None:
        self.F.flags.writeable = self.rel_error.flags.writeable = False

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

    def part(self, part: slice) -> "HalfPlaneLoads":
        """Return a slice of the transitions, as views."""
        return HalfPlaneLoads(self.F[part], self.status[part], self.rel_error[part])

    def joined(self, other: "HalfPlaneLoads") -> "HalfPlaneLoads":
        """Return these transitions followed by those of another record."""
        F = np.concatenate((self.F, other.F))
        rel_error = np.concatenate((self.rel_error, other.rel_error))
        return HalfPlaneLoads(F, self.status + other.status, rel_error)

    @classmethod
    def not_computed(cls, n_transitions: int, reason: str) -> "HalfPlaneLoads":
        """Return a record without numbers, with a reason."""
        F, status = np.full(n_transitions, np.nan), f"not computed: {reason}"
        return cls(F, (status,) * n_transitions, F.copy())


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
    if not 0.0 < rel_tol <= 0.1:
        raise InputError(f"rel_tol = {rel_tol!r}: must be in (0, 0.1]")
    n_table = 1 << (int(n_transitions) - 1).bit_length()
    table = _table(2.0 * groove_width / ridge_width, n_table, float(rel_tol))
    return table.part(slice(0, n_transitions))


def smooth_load(half_width_over_R: ArrayLike, *, nu: float = 0.5) -> FloatArray:
    """Compute the load of a smooth flat by the strip method, the limit of vanishing grooves.

    One strip [-w, w] replaces all ridges. The condition at the next corner, at a distance b -> 0
    from its edge, becomes zero pressure at the edge.

    Parameters
    ----------
    half_width_over_R : array_like of float, shape (...), dimensionless
        Contact half-width over radius.
    nu : float, scalar, dimensionless
        Poisson's ratio.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        p/E.

    Notes
    -----
    *Accuracy.* Rounding error: three coefficients give the exact solution, which equals
    `hertz.load_of_half_width`.

    Examples
    --------
    >>> round(float(smooth_load(0.1, nu=0.0)) / (math.pi / 800.0), 12)
    1.0
    """
    half_width = 0.5  # of the length unit: capacity 1/4
    energies = self_energies(3)
    energies[0] -= math.pi**2 * math.log(half_width)
    load = np.array([math.pi, 0.0, 0.0])
    parabola = half_width**2 * math.pi * np.array([0.25, 0.0, 0.125])
    # Pressure at s = 1 is the sum of the coefficients over sqrt(1-s^2); a zero sum determines d.
    approach = np.sum(parabola / energies) / np.sum(load / energies)
    coefficients = (approach * load - parabola) / energies
    F = 0.25 * math.pi * math.pi * coefficients[0] / half_width**2
    value: FloatArray = np.asarray(half_width_over_R, dtype=np.float64) ** 2 * F / (1.0 - nu**2)
    return value


def forget_loads() -> None:
    """Clear the cache of loads, for measurements of time."""
    _table.cache_clear()


@functools.lru_cache(maxsize=1024)
def _table(gap_ratio: float, n_table: int, rel_tol: float) -> HalfPlaneLoads:
    """Return F_1 ... F_n_table: the table of half the length, joined with a new batch."""
    if n_table == 1:
        return _solve_batch(gap_ratio, 0, n_table, rel_tol)
    below = _table(gap_ratio, n_table // 2, rel_tol)
    return below.joined(_solve_batch(gap_ratio, n_table // 2, n_table, rel_tol))


def _solve_batch(gap_ratio: float, n_known: int, n_last: int, rel_tol: float) -> HalfPlaneLoads:
    """Solve for F_(n_known + 1) ... F_n_last with more coefficients until all checks hold."""
    # Loads are quadratic in the coefficients' error, so their error is C rho^(-2 M). C is 1e-2 in
    # measurements, 1e-1 here. The solution with n_check coefficients checks the final one.
    n_check = math.ceil(max(3.0, math.log(0.1 / rel_tol) / (2.0 * float(log_ellipse(gap_ratio)))))
    best, worst = None, math.inf
    while True:
        # An eighth more coefficients reduce the error by at least e^2 at the usual tolerances, so
        # the change bounds the error of the finer solution.
        n_coefficients = n_check + max(2, math.ceil(n_check / 8.0))
        n_solved = min(n_last, MAX_UNKNOWNS // n_coefficients)
        if n_solved <= n_known:
            break
        solved = _solve_checked(gap_ratio, n_solved, n_coefficients, n_check, rel_tol)
        largest = float(np.max(solved.rel_error))
        # If the error is not halved, rounding dominates, and more coefficients cannot help.
        if best is not None and not largest < 0.5 * worst:
            break
        best, worst = solved, largest
        if all(status == "ok" for status in solved.status):
            break
        n_check = math.ceil(1.4 * n_check)
    n_best = 0 if best is None else best.F.size
    over = f"are over the cap of {MAX_UNKNOWNS} unknowns"
    reason = f"{n_coefficients:.6g} coefficients a strip {over}"
    rest = HalfPlaneLoads.not_computed(n_last - max(n_best, n_known), reason)
    return rest if best is None else best.part(slice(n_known, n_best)).joined(rest)


def _solve_checked(
    gap_ratio: float, n_transitions: int, n_coefficients: int, n_check: int, rel_tol: float
) -> HalfPlaneLoads:
    """Solve with two numbers of coefficients, and return the finer solution with checks."""
    try:
        fine = solve_strips(gap_ratio, n_transitions, n_coefficients)
        coarse = solve_strips(gap_ratio, n_transitions, n_check)
    except np.linalg.LinAlgError as failure:
        return HalfPlaneLoads.not_computed(n_transitions, str(failure))
    # 16: measured ratio of the scatter under a change of length unit to eps x amplification.
    rounding = 16.0 * np.finfo(np.float64).eps * fine.amplification
    rel_error = np.abs(coarse.F / fine.F - 1.0) + rounding
    steps = np.diff(fine.F, prepend=0.0)
    status = []
    for k in range(n_transitions):
        if not rel_error[k] <= rel_tol:
            status.append(_NOT_CONVERGED.format(rel_error[k]))
        elif not 0.01 * fine.tail[k] ** 2 <= rel_tol:  # the load's error is below 0.01 tail^2
            status.append(f"not converged: coefficient tail {fine.tail[k]:.1e}")
        elif not fine.smallest_pressure[k] > 0.0:
            status.append(f"pressure not positive: {fine.smallest_pressure[k]:.1e} of its mean")
        elif not steps[k] > 0.0:
            status.append("load does not rise above the one before")
        else:
            status.append("ok")
    return HalfPlaneLoads(fine.F, tuple(status), rel_error)


@dataclass(frozen=True)
class StripSolution:
    """Transitions 1 ... n of a texture, solved with a fixed number of coefficients.

    Attributes
    ----------
    F : ndarray of float, shape (n_transition,), dimensionless
        Load times (1 - nu^2) over (pitch/R)^2.
    tail : ndarray of float, shape (n_transition,), dimensionless
        Largest of the last two coefficients on any strip, over the mean of the first.
    smallest_pressure : ndarray of float, shape (n_transition,), dimensionless
        Smallest p(s) sqrt(1-s^2) at Chebyshev points, ends included, over its mean.
    amplification : ndarray of float, shape (n_transition,), dimensionless
        Magnification of rounding errors in the approach.
    """

    F: FloatArray
    tail: FloatArray
    smallest_pressure: FloatArray
    amplification: FloatArray


def solve_strips(gap_ratio: float, n_transitions: int, n_coefficients: int) -> StripSolution:
    """Solve the frictionless parabola on flat strips at every transition.

    -int q ln|x - xi| dxi = d - x^2/2 on the strips in contact, gap 0 at the next proximal corner.

    Parameters
    ----------
    gap_ratio : float, scalar, strip half-widths
        Groove width over half the ridge width, 2 b/a.
    n_transitions : int, scalar, count
        Transitions 1 ... n_transitions; transition k has k strips on each side.
    n_coefficients : int, scalar, count
        Chebyshev coefficients per strip, at least 3 for the parabola.

    Returns
    -------
    StripSolution
        Arrays over transitions.

    Raises
    ------
    numpy.linalg.LinAlgError
        If rounding errors make the matrix indefinite.

    Notes
    -----
    *Accuracy.* The error of F falls as rho^(-2 n_coefficients), `logkernel.log_ellipse`.

    *Cost.* One factorisation of size n_transitions x n_coefficients.

    References
    ----------
    Johnson, *Contact Mechanics* (1985), chapter 2, line loading of an elastic half-space,
    doi:10.1017/CBO9781139171731. `docs/derivations/half-plane.md` for the method.

    Examples
    --------
    Very narrow grooves have no effect: F_1 -> pi/8.

    >>> round(float(solve_strips(1e-6, 1, 300).F[0]) * 8.0 / math.pi, 4)
    1.0
    """
    row = RidgeRow.of(Profile(2.0, gap_ratio), n_transitions, n_coefficients, 1.0)
    moments, _, lift = row.events_of_covered()
    k = np.arange(1, n_transitions + 1)
    mean = moments[:, 0].sum(axis=0) / k
    tail = np.abs(moments[:, -2:]).max(axis=(0, 1)) / mean
    smallest = _smallest_pressure(moments, row.within) / mean
    F = 0.25 * math.pi * row.load(moments) / row.profile.pitch**2
    return StripSolution(F, tail, smallest, 1.0 / (1.0 - lift))


def _smallest_pressure(coefficients: FloatArray, in_contact: BoolArray) -> FloatArray:
    """Return the minimum of p(s) sqrt(1-s^2) over Chebyshev-Lobatto points and strips.

    At s = +-1 this is the strength of the edge singularity, which turns negative before the
    pressure does at any interior point.
    """
    m = coefficients.shape[1]
    points = np.arange(2 * m + 1) * (math.pi / (2 * m))
    values = np.tensordot(np.cos(points[:, None] * np.arange(m)), coefficients, axes=(1, 1))
    value: FloatArray = np.where(in_contact, values.min(axis=0), np.inf).min(axis=0)
    return value
