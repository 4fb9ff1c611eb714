"""Sampling of a pair's posterior with emcee, as an independent check of its evidence."""

from ridgebayes.evidence.bridge import bridge_evidence
from ridgebayes.evidence.pairs import Pair
from ridgebayes.inference.chains import ProgressCallback, SampleSettings
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
    """Sample a pair's posterior with emcee, and estimate its evidence by bridge sampling.

    Parameters
    ----------
    pair : Pair
        Form and error model.
    drawn : Drawn
        Draws from importance sampling, whose proposal the walk uses.
    settings : SampleSettings, optional
        Lengths and thresholds.
    progress, checkpoint : optional
        As for `ridgebayes.inference.emcee_sampling.walk`.

    Returns
    -------
    walked : Walked
        Draws of the outer parameters.
    evidence : LogEvidence
        Log evidence by bridge sampling.
    """
    target, seed = pair.target(), pair.own_seed
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
