"""Sampling with emcee: independent ensembles, whitened coordinates, the rule that stops them.

This is the only module that imports emcee, when something is sampled.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import ComputationError
from ridgebayes.inference.chains import N_WALKER, Chains, ProgressCallback, SampleSettings
from ridgebayes.inference.checkpoint import Checkpoint, Walk
from ridgebayes.inference.diagnostics import autocorrelation_time
from ridgebayes.inference.laplace import Laplace
from ridgebayes.inference.moves import MOVES, Independence, Weighted, adapted
from ridgebayes.runtime.randomness import stream

# A walk so many times longer than asked is long enough were tau that many times larger: of ten
# parameters one always changes by more than a per cent.
_AMPLE = 5
_KEPT_MAX = 2**26  # numbers of a walk, half a GiB
_FIRST = 100  # steps before the first check


def _ensemble(
    log_density: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    n_walker: int,
    n_coordinate: int,
    proposal: Independence,
    moves: str,
) -> Any:
    """Return emcee's ensemble, moving by the three kinds in the shares of `MOVES[moves]`.

    What `log_density` returns beside the densities is kept of each step as its blobs.
    """
    import emcee  # loads scipy.stats

    def compute_log_prob(z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what emcee's own does, which takes densities one walker at a time, in Python."""
        if not np.isfinite(z).all():
            raise ValueError("a walker's coordinate is not finite")
        value, kept = log_density(z)
        if np.isnan(value).any():
            raise ValueError("the log density is NaN")
        return value, kept

    kinds = (emcee.moves.MHMove(proposal), emcee.moves.DEMove(), emcee.moves.StretchMove())
    shares = [one for one in zip(kinds, MOVES[moves], strict=True) if one[1] > 0]
    ensemble = emcee.EnsembleSampler(
        n_walker, n_coordinate, log_density, vectorize=True, moves=shares
    )
    ensemble.compute_log_prob = compute_log_prob
    ensemble.log_prob_fn = log_density  # emcee's own wrapper prints a traceback on Ctrl-C
    return ensemble


def _state_at(
    z: FloatArray,
    random_state: Any,
    log_density: FloatArray | None = None,
    kept: FloatArray | None = None,
) -> Any:
    """Return walkers at `z`, (n_walker, n_coordinate), with the state of a `RandomState`."""
    import emcee

    # emcee takes the state of a RandomState; such an object it would silently ignore.
    return emcee.State(z, log_prob=log_density, blobs=kept, random_state=random_state)


def sample(
    log_density: Callable[[FloatArray], FloatArray],
    laplace: Laplace,
    *,
    seed: int,
    names: tuple[str, ...],
    settings: SampleSettings | None = None,
    progress: ProgressCallback | None = None,
    checkpoint: Checkpoint | None = None,
) -> Chains:
    """Sample a density with independently started emcee ensembles until the stopping rule is met.

    Parameters
    ----------
    log_density : callable
        (n, n_coordinate) to (n,): log density in unconstrained coordinates.
    laplace : Laplace
        Normal approximation: its whitened coordinates are sampled in, and started in.
    seed : int
        Each ensemble gets a stream of its own from it.
    names : tuple of str
        Names of the coordinates, for messages.
    settings : SampleSettings, optional
        Lengths and thresholds.
    progress : callable, optional
        Called with a line of text now and then.
    checkpoint : Checkpoint, optional
        Where the walk is kept as it grows, and picked up from if it is there already.

    Returns
    -------
    Chains
        All draws after burn-in; `convergence_failures` tells what the stopping rule lacked.

    Notes
    -----
    *Accuracy.* Moves: an independence move from a mixture of Student t, fitted by each ensemble on
    its own (90 %), and differential evolution (10 %). emcee's `DESnookerMove` is not used:
    in 3.1.6 its draws are too narrow.

    References
    ----------
    Foreman-Mackey et al. (2013), doi:10.1086/670067; ter Braak & Vrugt (2008),
    doi:10.1007/s11222-008-9104-9, for differential evolution.
    """
    settings = settings or SampleSettings()
    n_coordinate = len(laplace.mode)
    n_walker = max(settings.n_walker or N_WALKER, 4 * n_coordinate)

    def in_z(z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the log density of z, and u and its own, which a walk keeps."""
        u, log_jacobian = laplace.unwhiten(z)
        value = log_density(u)
        return value + log_jacobian, np.column_stack([u, value])

    begun, limit = time.monotonic(), settings.time_limit or math.inf
    walk = checkpoint.load() if checkpoint is not None else None
    if walk is None:
        walk = _burnt_in(in_z, n_walker, n_coordinate, laplace.n_curved, seed, settings)
    samplers = [
        _ensemble(in_z, n_walker, n_coordinate, Independence(*proposal), settings.moves)
        for proposal in zip(walk.weights, walk.centres, walk.factors, walk.rest, strict=True)
    ]
    # The whole walk is kept: one that mixes badly has to end before it fills the memory.
    n_kept = settings.n_ensemble * n_walker * (n_coordinate + 1)
    n_step_max = min(settings.n_step_max, max(_KEPT_MAX // n_kept, _FIRST))
    while True:
        before, tau = walk.tau, _mean_tau(walk.u, walk.log_density)
        unmet = _unmet_rules(walk.n_step, tau, before, (*names, "log posterior"), settings)
        if progress is not None and walk.n_step:
            progress(
                f"{walk.n_step} steps x {settings.n_ensemble} ensembles, tau {np.max(tau):.2f}"
            )
        if not unmet or walk.n_step >= n_step_max:
            break
        if walk.n_step and time.monotonic() > begun + limit:
            unmet = [f"time limit of {limit:g} s: stopped after {walk.n_step} steps; {unmet[0]}"]
            break
        # A function of the walk alone, so that one that is resumed takes the same steps. Each check
        # costs as much as many steps: a walk far too short takes half as many again.
        needed = float(np.nan_to_num(settings.n_tau * tau.max(), posinf=0.0))
        target = max(int(1.05 * walk.n_step) + 20, _FIRST, int(min(needed, 1.5 * walk.n_step)))
        target = min(target, n_step_max)
        walk = _walked_on(walk, samplers, target - walk.n_step, tau)
        if checkpoint is not None:
            checkpoint.save(walk)
    acceptance = walk.accepted / (walk.n_step * n_walker)
    return Chains(walk.u, walk.log_density, acceptance, tau, tuple(unmet))


def _burnt_in(
    in_z: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    n_walker: int,
    n_coordinate: int,
    n_curved: int,
    seed: int,
    settings: SampleSettings,
) -> Walk:
    """Fit each ensemble's own proposal, start its walkers from it, and burn them in."""
    states, proposals = [], []
    for i in range(settings.n_ensemble):
        rng = stream(seed, f"ensemble {i}")
        rest = n_coordinate - n_curved
        n = max(1_000, 3 * n_walker // 2)  # walkers start from different ones of them
        proposal, draws = adapted(lambda z: in_z(z)[0], n_curved, rest, rng, n_round=4, n=n)
        z = _start(draws, rng, n_walker)
        start = _state_at(z, np.random.RandomState(rng.integers(2**32)).get_state())
        sampler = _ensemble(in_z, n_walker, n_coordinate, proposal, settings.moves)
        states.append(sampler.run_mcmc(start, settings.n_burn))
        proposals.append(proposal)
    return Walk(
        u=np.empty((settings.n_ensemble, 0, n_walker, n_coordinate)),
        log_density=np.empty((settings.n_ensemble, 0, n_walker)),
        accepted=np.zeros(settings.n_ensemble),
        coordinates=np.stack([state.coords for state in states]),
        last_log_density=np.stack([state.log_prob for state in states]),
        tau=np.full(n_coordinate + 1, np.inf),
        **{
            name: np.stack([getattr(proposal, name) for proposal in proposals])
            for name in ("weights", "centres", "factors", "rest")
        },
        random_states=tuple(state.random_state for state in states),
    )


def _walked_on(walk: Walk, samplers: Sequence[Any], n_step: int, tau: FloatArray) -> Walk:
    """Let every ensemble take `n_step` more steps from where it is."""
    ends = []
    for i, sampler in enumerate(samplers):
        sampler.reset()
        known: tuple[FloatArray, ...] = ()  # at first all is worked out anew
        if walk.n_step:
            last = np.column_stack([walk.u[i, -1], walk.log_density[i, -1]])
            known = walk.last_log_density[i], last
        here = _state_at(walk.coordinates[i], walk.random_states[i], *known)
        ends.append(sampler.run_mcmc(here, n_step))
    kept = np.stack([sampler.get_blobs() for sampler in samplers])
    accepted = np.array([sampler.backend.accepted.sum() for sampler in samplers])
    return replace(
        walk,
        u=np.concatenate([walk.u, kept[..., :-1]], axis=1),
        log_density=np.concatenate([walk.log_density, kept[..., -1]], axis=1),
        accepted=walk.accepted + accepted,
        coordinates=np.stack([end.coords for end in ends]),
        last_log_density=np.stack([end.log_prob for end in ends]),
        tau=tau,
        random_states=tuple(end.random_state for end in ends),
    )


def _start(draws: Weighted, rng: np.random.Generator, n_walker: int) -> FloatArray:
    """Pick different points of positive density, half by weight and half as proposed: wider."""
    feasible = np.flatnonzero(np.isfinite(draws.log_density))
    by_weight = np.unique(draws.resampled(rng, n_walker))[: n_walker // 2]
    rest = np.setdiff1d(feasible, by_weight)
    if len(by_weight) + len(rest) < n_walker:
        raise ComputationError("sample: expected starting points of positive density, got too few")
    others = rng.permutation(rest)[: n_walker - len(by_weight)]
    value: FloatArray = draws.z[np.concatenate([by_weight, others])]
    return value


def _mean_tau(u: FloatArray, log_density: FloatArray) -> FloatArray:
    """Return autocorrelation times averaged over the ensembles, the log density's last."""
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
    unmet, ample = [], _AMPLE * settings.n_tau
    for name, now, last in zip(names, tau, before, strict=True):
        if not n_step > settings.n_tau * now:
            unmet.append(f"{name}: {n_step} steps are not {settings.n_tau:g} tau ({now:.3g} each)")
        elif not np.isfinite(last):
            unmet.append(f"{name}: tau was checked only once ({now:.4g})")
        elif not (abs(now - last) <= settings.tau_change * now or n_step > ample * now):
            unmet.append(f"{name}: tau still changes ({last:.4g} to {now:.4g})")
    return unmet
