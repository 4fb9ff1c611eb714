"""Walk a pair's posterior: an independent check of its evidence."""

from dataclasses import replace

from ridgebayes.evidence.bridge import bridge_evidence
from ridgebayes.evidence.pairs import Pair
from ridgebayes.inference.chains import N_WALKER_CHEAP, ProgressCallback, SampleSettings
from ridgebayes.inference.checkpoint import Checkpoint
from ridgebayes.inference.emcee_sampling import Walked, walk
from ridgebayes.inference.importance import Drawn
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.runtime.randomness import stream


def walk_pair(
    pair: Pair,
    drawn: Drawn,
    settings: SampleSettings | None = None,
    *,
    progress: ProgressCallback | None = None,
    checkpoint: Checkpoint | None = None,
) -> tuple[Walked, LogEvidence]:
    """Walk a pair's posterior by emcee, and bridge the walk to its evidence.

    Parameters
    ----------
    pair : Pair
        Form and error model.
    drawn : Drawn
        Draws by importance sampling, whose proposal the walk moves by.
    settings : SampleSettings, optional
        Lengths and thresholds; with 512 walkers where these cost little and are not set.
    progress, checkpoint : optional
        As for `calibrate`.

    Returns
    -------
    walked : Walked
        Draws of the outer parameters.
    evidence : LogEvidence
        By bridge sampling.
    """
    target, settings = pair.target(), settings or SampleSettings()
    model, seed = target.model, pair.own_seed
    if settings.n_walker is None and model.is_normal and not model.offsets.n_level:
        settings = replace(settings, n_walker=N_WALKER_CHEAP)
    walked = walk(
        target,
        drawn.proposal,
        seed=seed,
        settings=settings,
        n_point=pair.effort.n_point,
        progress=progress,
        checkpoint=checkpoint,
    )
    evidence = bridge_evidence(
        target, walked, rng=stream(seed, "bridge"), n_point=pair.effort.n_point
    )
    return walked, evidence
