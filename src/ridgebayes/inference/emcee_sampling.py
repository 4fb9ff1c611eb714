"""Sampling with emcee: independent ensembles and their stopping rule.

A walk checks importance sampling independently: only the proposal of its main move is shared.
Where densities are unbiased estimates, each walker keeps the estimate at its position, so that the
walk samples the exact posterior (Andrieu & Roberts 2009, doi:10.1214/07-AOS574).

Only this module imports emcee, and only when a walk starts.
"""

import math
import time
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from ridgebayes._types import BATCH_SIZE, FloatArray
from ridgebayes.errors import ComputationError
from ridgebayes.inference.chains import Chains, ProgressCallback, SampleSettings
from ridgebayes.inference.checkpoint import Checkpoint, Walk, packed, unpacked
from ridgebayes.inference.diagnostics import autocorrelation_time
from ridgebayes.inference.proposal import Mixture
from ridgebayes.inference.target import Evaluated, Target
from ridgebayes.runtime.randomness import stream

# A walk five times longer than `n_tau` requires would be long enough even if tau were five times
# larger, so tau need not be stable to `tau_change`. With ten parameters, one of them rarely is.
_LONG_WALK_FACTOR = 5
_MAX_STORED_NUMBERS = 256 * BATCH_SIZE  # half a GiB
_PROPOSAL_SHARE = 0.9  # share of moves that draw from the proposal
_N_FIRST_STEP = 100  # steps before the first check
_N_BATCH_STEP = 16  # steps whose independent draws are evaluated in one call


@dataclass(frozen=True, eq=False)
class Walked:
    """Draws of a walk.

    Parameters
    ----------
    chains : Chains
        Draws of the outer parameters' normal scores, with the unmet stopping rules.
    coordinates : ndarray of float, shape (n_ensemble, n_step, n_walker, d)
        The same draws in coordinates of the first chart.
    log_jacobian : ndarray of float, shape (n_ensemble, n_step, n_walker)
        log |du/dq| of the first chart.
    scores : ndarray of float, shape (n_ensemble, n_step, n_walker, n_level)
        Scores of the offsets if densities are estimates, else empty.
    """

    chains: Chains
    coordinates: FloatArray
    log_jacobian: FloatArray
    scores: FloatArray


class _Density:
    """Log density of a target, as a callable for emcee that also returns the extras of a walk.

    The extras are the proposal's log density, log |du/dq| of the first chart, the coordinates in
    that chart, and the scores of the offsets.
    """

    def __init__(self, target: Target, proposal: Mixture, n_point: int) -> None:
        self.target, self.proposal, self.n_point = target, proposal, n_point

    def __call__(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        # The random points depend on the positions only, so that a resumed walk takes the same
        # steps.
        rng = np.random.default_rng(zlib.crc32(np.ascontiguousarray(u).tobytes()))
        return self.values(self.target.evaluate(None, u, rng, self.n_point))

    def values(self, draws: Evaluated) -> tuple[FloatArray, FloatArray]:
        """Return log densities and extras of draws."""
        with np.errstate(all="ignore"):
            log_q = self.proposal.log_density(draws.coordinates, draws.log_jacobian)
        usable = np.isfinite(log_q) & np.isfinite(draws.coordinates[0]).all(axis=1)
        extras = np.column_stack([log_q, draws.log_jacobian[0], draws.coordinates[0], draws.scores])
        return np.where(usable, draws.log_density, -np.inf), np.nan_to_num(extras)


def _independence(density: _Density) -> Any:
    """Return a move that draws from the proposal, independently of the walkers' positions."""
    import emcee

    class Independence(emcee.moves.Move):  # type: ignore[misc]
        def __init__(self) -> None:
            self.batch: list[Any] = []

        def propose(self, model: Any, state: Any) -> tuple[Any, Any]:
            n = len(state.coords)
            if not self.batch:
                self.batch = self.evaluated(model.random.randint(2**31, size=4), n)
            new = self.batch.pop()
            ratio = new.log_prob - new.blobs[:, 0] - state.log_prob + state.blobs[:, 0]
            accepted = np.log(model.random.rand(n)) < ratio
            return self.update(state, new, accepted), accepted

        def evaluated(self, seed: Any, n: int) -> list[Any]:
            """Return the draws of several steps, which take less time in one call."""
            rng = np.random.default_rng(seed)
            charts, q = density.proposal.draw(rng, _N_BATCH_STEP * n)
            draws = density.target.evaluate(charts, q, rng, density.n_point)
            arrays = (np.split(x, _N_BATCH_STEP) for x in (draws.u, *density.values(draws)))
            return [emcee.State(u, log_prob=p, blobs=x) for u, p, x in zip(*arrays, strict=True)]

    return Independence()


def _ensemble(density: _Density, n_walker: int) -> Any:
    """Return an emcee sampler.

    Nine of ten moves draw from the fitted proposal. Differential evolution moves the walkers in
    regions where the proposal fits badly.
    """
    import emcee  # loads scipy.stats

    def compute_log_prob(u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Replace emcee's method, which loops over walkers in Python."""
        return density(u)

    moves = [
        (_independence(density), _PROPOSAL_SHARE),
        (emcee.moves.DEMove(), 1 - _PROPOSAL_SHARE),
    ]
    d = len(density.target.names)
    ensemble = emcee.EnsembleSampler(n_walker, d, density, vectorize=True, moves=moves)
    ensemble.compute_log_prob = compute_log_prob
    ensemble.log_prob_fn = density  # emcee's wrapper prints a traceback on Ctrl-C
    return ensemble


def walk(
    target: Target,
    proposal: Mixture,
    *,
    seed: int,
    settings: SampleSettings | None = None,
    n_point: int = 32,
    progress: ProgressCallback | None = None,
    checkpoint: Checkpoint | None = None,
) -> Walked:
    """Sample a density with independently started emcee ensembles until the stopping rule is met.

    Parameters
    ----------
    target : Target
        Posterior density.
    proposal : Mixture
        Proposal fitted to the target, for starting points and moves.
    seed : int
        Seed of the ensembles' random streams.
    settings : SampleSettings, optional
        Lengths and thresholds.
    n_point : int, optional
        Number of points for densities that are estimates.
    progress : callable, optional
        Called with a line of text at each check.
    checkpoint : Checkpoint, optional
        File in which the walk is saved at each check. An existing file is resumed.

    Returns
    -------
    Walked
        All draws after burn-in; `chains.convergence_failures` lists the unmet stopping rules.

    Raises
    ------
    ComputationError
        If too few starting points have a positive density.

    References
    ----------
    Foreman-Mackey et al. (2013), doi:10.1086/670067; ter Braak & Vrugt (2008),
    doi:10.1007/s11222-008-9104-9, for differential evolution.
    """
    settings = settings or SampleSettings()
    d = len(target.names)
    n_walker = max(settings.n_walker, 4 * d)
    began, limit = time.monotonic(), settings.time_limit or math.inf
    density = _Density(target, proposal, n_point)
    now = checkpoint.load() if checkpoint is not None else None
    if now is None:
        now = _burnt_in(density, seed, settings, n_walker)
    # All steps stay in memory: a walk that mixes badly must stop before it fills it.
    n_per_step = settings.n_ensemble * n_walker * (d + 1 + now.extras.shape[-1])
    n_step_max = min(settings.n_step_max, max(_MAX_STORED_NUMBERS // n_per_step, _N_FIRST_STEP))
    while True:
        before, tau = now.tau, _mean_tau(now.u[:, 1:], now.log_density[:, 1:])
        unmet = _unmet_rules(now.n_step, tau, before, (*target.names, "log posterior"), settings)
        if progress is not None and now.n_step:
            progress(f"{now.n_step} steps x {settings.n_ensemble} ensembles, tau {np.max(tau):.2f}")
        if not unmet or now.n_step >= n_step_max:
            break
        if now.n_step and time.monotonic() > began + limit:
            unmet = [f"time limit of {limit:g} s: stopped after {now.n_step} steps; {unmet[0]}"]
            break
        # The next length depends on the walk only, so that a resumed walk takes the same steps. A
        # check costs as much as many steps, so that a walk that is much too short grows by half.
        needed = float(np.nan_to_num(settings.n_tau * tau.max(), posinf=0.0))
        goal = max(int(1.05 * now.n_step) + 20, _N_FIRST_STEP, int(min(needed, 1.5 * now.n_step)))
        now = _extended(now, density, min(goal, n_step_max) - now.n_step, tau)
        if checkpoint is not None:
            checkpoint.save(now)
    acceptance = now.accepted / (now.n_step * n_walker)
    chains = Chains(now.u[:, 1:], now.log_density[:, 1:], acceptance, tau, tuple(unmet))
    extras = now.extras[:, 1:]
    return Walked(chains, extras[..., 2 : 2 + d], extras[..., 1], extras[..., 2 + d :])


def _burnt_in(density: _Density, seed: int, settings: SampleSettings, n_walker: int) -> Walk:
    """Start each ensemble's walkers from the proposal, and burn them in."""
    import emcee

    ends = []
    for i in range(settings.n_ensemble):
        rng = stream(seed, f"ensemble {i}")
        u = _start(density, rng, n_walker)
        random_state = np.random.RandomState(rng.integers(2**32)).get_state()
        # emcee silently ignores a RandomState object; it expects the object's state.
        start = emcee.State(u, random_state=random_state)
        ends.append(_ensemble(density, n_walker).run_mcmc(start, settings.n_burn))
    return Walk(
        u=np.stack([end.coords for end in ends])[:, None],
        log_density=np.stack([end.log_prob for end in ends])[:, None],
        extras=np.stack([end.blobs for end in ends])[:, None],
        accepted=np.zeros(len(ends)),
        tau=np.full(len(density.target.names) + 1, np.inf),
        **packed([end.random_state for end in ends]),
    )


def _extended(now: Walk, density: _Density, n_step: int, tau: FloatArray) -> Walk:
    """Return the walk with `n_step` more steps of every ensemble.

    The ensembles are new, so that a resumed walk takes the same steps.
    """
    import emcee

    ends, samplers = [], []
    for i, random_state in enumerate(unpacked(now)):
        last = emcee.State(
            now.u[i, -1],
            log_prob=now.log_density[i, -1],
            blobs=now.extras[i, -1],
            random_state=random_state,
        )
        samplers.append(_ensemble(density, now.u.shape[2]))
        ends.append(samplers[-1].run_mcmc(last, n_step))
    parts = {
        "u": np.stack([sampler.get_chain() for sampler in samplers]),
        "log_density": np.stack([sampler.get_log_prob() for sampler in samplers]),
        "extras": np.stack([sampler.get_blobs() for sampler in samplers]),
    }
    accepted = np.array([sampler.backend.accepted.sum() for sampler in samplers])
    return Walk(
        **{name: np.concatenate([getattr(now, name), new], axis=1) for name, new in parts.items()},
        accepted=now.accepted + accepted,
        tau=tau,
        **packed([end.random_state for end in ends]),
    )


def _start(density: _Density, rng: np.random.Generator, n_walker: int) -> FloatArray:
    """Return distinct points of positive density, drawn from the proposal."""
    for _ in range(5):
        charts, q = density.proposal.draw(rng, 2 * n_walker)
        draws = density.target.evaluate(charts, q, rng, density.n_point)
        feasible = np.flatnonzero(np.isfinite(density.values(draws)[0]))
        if len(feasible) >= n_walker:
            return draws.u[feasible[:n_walker]]
    raise ComputationError(
        f"{density.target.name}: expected starting points of positive density, got too few"
    )


def _mean_tau(u: FloatArray, log_density: FloatArray) -> FloatArray:
    """Return autocorrelation times of coordinates and log density, averaged over the ensembles."""
    if not log_density.shape[1]:
        return np.full(u.shape[-1] + 1, np.inf)
    everything = np.concatenate([u, log_density[..., None]], axis=-1)
    value: FloatArray = np.mean([autocorrelation_time(ensemble) for ensemble in everything], axis=0)
    return value


def _unmet_rules(
    n_step: int,
    tau: FloatArray,
    before: FloatArray,
    names: tuple[str, ...],
    settings: SampleSettings,
) -> list[str]:
    """Return the unmet stopping rules; `before` has the autocorrelation times of the last check."""
    unmet, ample = [], _LONG_WALK_FACTOR * settings.n_tau
    for name, now, last in zip(names, tau, before, strict=True):
        if not n_step > settings.n_tau * now:
            unmet.append(f"{name}: {n_step} steps are not {settings.n_tau:g} tau ({now:.3g} each)")
        elif not np.isfinite(last):
            unmet.append(f"{name}: tau was checked only once ({now:.4g})")
        elif not (abs(now - last) <= settings.tau_change * now or n_step > ample * now):
            unmet.append(f"{name}: tau still changes ({last:.4g} to {now:.4g})")
    return unmet
