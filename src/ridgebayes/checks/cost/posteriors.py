"""Settings of posteriors and their evidences, for a table and one form."""

from functools import partial

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.checks.cost.measured import Setting, Way, settings, turned
from ridgebayes.evidence.bridge import bridge_evidence
from ridgebayes.inference.chains import SampleSettings
from ridgebayes.inference.emcee_sampling import walk
from ridgebayes.inference.importance import Effort, importance_sample
from ridgebayes.inference.presets import PRESETS, QUICK
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.runtime.randomness import stream
from ridgebayes.table.table import ContactTable

_LONG = Effort(n_per_round=2_048, n_draw=16_384)  # of the reference
_WALKERS = {
    "stretch": (32,),
    "differential evolution": (32,),
    "independence": (32, 128),
    "mixture": (32, 128, 512),
}
_Found = tuple[FloatArray, float]  # normal scores of the parameters, and ln evidence


def posterior_settings(table: ContactTable, form: Form, *, seed: int = 0) -> list[Setting]:
    """List ways to a posterior and its evidence: each preset, and emcee by each kind of move.

    Parameters
    ----------
    table : ContactTable
        Its calibration rows, taken as independent.
    form : Form
        Contact form.
    seed : int, optional
        Seed of all draws.

    Returns
    -------
    list of Setting
        Errors of mean, sd and 5 % quantile are the worst parameter's, over its posterior sd; those
        of ln Z are absolute, as a relative error of the evidence. A walk's seconds include the
        quick preset's draws, which its moves are fitted to, and its evidence by bridge sampling.
    """
    model = Model(Observations.from_table(table), form, Noise())
    long = importance_sample(ModelTarget(model, seed), _LONG, seed + 1)
    best = _moments(model, long.u)

    def sampled(preset: str) -> _Found:
        drawn = importance_sample(ModelTarget(model, seed), PRESETS[preset].effort, seed)
        return drawn.u, drawn.evidence.value

    def walked(moves: str, n_walker: int) -> _Found:
        target = ModelTarget(model, seed)
        proposal = importance_sample(target, QUICK.effort, seed).proposal
        how = SampleSettings(n_walker=n_walker, tau_change=0.1, moves=moves)
        found = walk(target, proposal, seed=seed, settings=how)
        evidence = bridge_evidence(target, found, rng=stream(seed, "bridge"))
        return found.chains.u, evidence.value

    def off(found: _Found) -> dict[str, float]:
        own = _moments(model, found[0])
        worst = {name: np.abs((own[name] - best[name]) / best["sd"]).max() for name in best}
        return worst | {"ln Z": found[1] - long.evidence.value}

    ways: list[Way[_Found]] = turned("importance sampling", "preset {}", sampled, PRESETS)
    for moves, numbers in _WALKERS.items():
        ways += turned(f"emcee, {moves}", "4 x {} walkers", partial(walked, moves), numbers)
    return settings("posterior", f"importance sampling, {long.log_density.size} draws", off, ways)


def _moments(model: Model, u: FloatArray) -> dict[str, FloatArray]:
    theta = model.outer_theta(u.reshape(-1, u.shape[-1]))
    tail = np.quantile(theta, 0.05, axis=0)
    return {"mean": theta.mean(axis=0), "sd": theta.std(axis=0), "5 % quantile": tail}
