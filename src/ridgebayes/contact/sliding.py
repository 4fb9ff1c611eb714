"""What a body sees that slides over ridges: counts averaged over where its centre may lie."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray
from ridgebayes.contact.contact_solution import solve_contact
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import ComputationError, InputError


def sliding_counts(
    profile: Profile, W: ArrayLike, *, n_offset: int = 32, rel_tol: float = 1e-5
) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard deviation of Q over a uniformly distributed offset.

    Parameters
    ----------
    profile : Profile
        The rigid side; its own offset does not matter.
    W : array_like of float, shape (...)
        Loads, 4 (1 - nu^2)/pi times p/E.
    n_offset : int, optional
        Offsets between 0 and half a pitch, evenly spaced; the other half is their mirror image.
    rel_tol : float, optional
        Tolerance of the loads at which counts change.

    Returns
    -------
    mean, sd : ndarray of float, shape (...)
        Of the number of ridges in contact.

    Raises
    ------
    InputError
        If a load is not finite and positive, or `n_offset` is under 1.
    ComputationError
        If the loads of an offset could not be found.

    Notes
    -----
    *Accuracy.* Each change of a count is misplaced by at most one of the `n_offset` steps: the mean
    errs by the number of changes over `n_offset` at worst, by far less on average.
    *Cost.* About a tenth of a second per offset for Q up to 10.

    Examples
    --------
    >>> mean, sd = sliding_counts(Profile(0.012, 0.03), [1e-3], n_offset=8)
    >>> mean.round(1).tolist(), bool(sd[0] > 0)
    ([3.1], True)
    """
    loads = np.asarray(W, dtype=np.float64)
    if n_offset < 1:
        raise InputError(f"n_offset: expected at least 1, got {n_offset}")
    if loads.size == 0 or not np.all((loads > 0) & np.isfinite(loads)):
        raise InputError(
            "W: a load is missing, or not finite and > 0; expected each finite and > 0"
        )
    counts = np.empty((n_offset, loads.size))
    for i in range(n_offset):
        here = replace(profile, offset=(i + 0.5) / (2 * n_offset))
        found = reaching_loads(here, W_max=float(loads.max()), rel_tol=rel_tol)
        if not all(status == "ok" for status in found.status):
            raise ComputationError(f"offset {here.offset:g}: {found.status[-1]}")
        reached = np.searchsorted(found.W, loads.ravel(), side="right")
        # Each event is one ridge more; below the first a floor may be touched, and no ridge.
        if found.Q.size:
            lowest = int(found.Q[0]) - 1
        else:
            at_least = solve_contact(here, float(loads.min()), rel_tol=rel_tol)
            if at_least.status != "ok":
                raise ComputationError(f"offset {here.offset:g}: {at_least.status}")
            lowest = at_least.Q
        counts[i] = np.concatenate([[lowest], found.Q])[reached]
    shape = loads.shape
    return counts.mean(axis=0).reshape(shape), counts.std(axis=0).reshape(shape)
