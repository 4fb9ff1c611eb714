"""Settings of the ensemble sampler, and its draws."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from numbers import Integral, Real

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError, expect

ProgressCallback = Callable[[str], None]  # takes a line of text
N_WALKER = 64  # a step with fewer walkers is no faster, and autocorrelation times converge later
N_KEPT = 10_240  # draws in files and predictions: whole steps, evenly thinned


@dataclass(frozen=True)
class SampleSettings:
    """Number of walkers, number of steps and stopping rule of a walk.

    Parameters
    ----------
    n_ensemble : int
        Independently started ensembles; at least four, so that they can disagree.
    n_walker : int
        Walkers per ensemble; raised to four per coordinate if that is more.
    n_burn : int
        Steps discarded at the start.
    n_step_max : int
        Steps after which an ensemble stops as not converged; fewer if its draws would take more
        than half a GiB.
    n_tau : float
        Minimum number of steps, in autocorrelation times.
    tau_change : float
        Largest relative change of each autocorrelation time since the last check; not required of
        chains longer than five times `n_tau`.
    time_limit : float or None
        Seconds of wall time after which a walk stops and returns the steps it has taken. The clock
        is read after blocks of steps: the first block has 100 steps, each later block adds 5 to
        50 % to the steps taken so far.

    Raises
    ------
    InputError
        If there are fewer than four ensembles, fewer than four walkers or an odd number, a number
        of steps under 1, or a threshold or time limit that is not finite and above 0.

    Examples
    --------
    >>> SampleSettings(n_tau=100).n_ensemble
    4
    """

    n_ensemble: int = 4
    n_walker: int = N_WALKER
    n_burn: int = 60
    n_step_max: int = 20_000
    n_tau: float = 50.0
    tau_change: float = 0.01
    # Not in `repr`, which a checkpoint compares: a walk may be resumed under another time limit.
    time_limit: float | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        n_step, limit = {"n_burn": self.n_burn, "n_step_max": self.n_step_max}, self.time_limit
        expect(Integral, n_ensemble=self.n_ensemble, n_walker=self.n_walker, **n_step)
        expect(Real, n_tau=self.n_tau, tau_change=self.tau_change)
        expect(Real, None, time_limit=limit)
        if self.n_ensemble < 4:
            raise InputError(f"n_ensemble: expected at least 4, got {self.n_ensemble}")
        for name, n in n_step.items():
            if n < 1:
                raise InputError(f"{name}: expected at least 1, got {n}")
        for name in ("n_tau", "tau_change", "time_limit"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                raise InputError(f"{name}: expected finite and > 0, got {value}")
        if self.n_walker < 4 or self.n_walker % 2:
            raise InputError(f"n_walker: expected even and at least 4, got {self.n_walker}")


@dataclass(frozen=True, eq=False)
class Chains:
    """Draws of several ensembles.

    Parameters
    ----------
    u : ndarray of float, shape (n_ensemble, n_step, n_walker, n_coordinate)
        Unconstrained coordinates.
    log_density : ndarray of float, shape (n_ensemble, n_step, n_walker)
        Log posterior density in these coordinates, not normalised.
    acceptance : ndarray of float, shape (n_ensemble,)
        Accepted fraction.
    tau : ndarray of float, shape (n_coordinate + 1,), steps
        Autocorrelation times of the coordinates and, last, of the log density.
    convergence_failures : tuple of str
        Conditions of the stopping rule that were not met; empty if all were.
    """

    u: FloatArray
    log_density: FloatArray
    acceptance: FloatArray
    tau: FloatArray
    convergence_failures: tuple[str, ...]

    @property
    def n_step(self) -> int:
        """Number of steps of each ensemble."""
        return int(self.u.shape[1])

    def kept_steps(self, n: int) -> IntArray:
        """Return the indices of evenly spaced steps that hold about `n` draws at most."""
        n_ensemble, n_step, n_walker, _ = self.u.shape
        n_keep = max(n // (n_ensemble * n_walker), 1)
        return np.unique(np.linspace(0, n_step - 1, min(n_keep, n_step)).astype(np.int64))

    def thinned(self, n: int) -> "Chains":
        """Return the chains with evenly spaced steps only, about `n` draws at most."""
        steps = self.kept_steps(n)
        return replace(self, u=self.u[:, steps], log_density=self.log_density[:, steps])
