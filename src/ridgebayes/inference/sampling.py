"""The sampler that suits a model: a walk, importance sampling, or exact draws."""

from dataclasses import replace

from ridgebayes.inference.chains import ProgressCallback, SampleSettings, walkers_for
from ridgebayes.inference.checkpoint import Checkpoint
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import Laplace, fit_laplace, several_modes
from ridgebayes.inference.posterior import Posterior, drawn_exactly, posterior_of
from ridgebayes.inference.power_law_exact import sample_power_law
from ridgebayes.model.model import Model

# Of draws that are estimated at many points each; the proposals settle in four rounds.
_LATENT = {"n_round": 4, "n_per_round": 1_000}


def sample_posterior(
    model: Model,
    *,
    seed: int,
    settings: SampleSettings | None = None,
    laplace: Laplace | None = None,
    progress: ProgressCallback | None = None,
    checkpoint: Checkpoint | None = None,
) -> Posterior:
    """Sample the posterior of a model.

    Parameters
    ----------
    model : Model
        Posterior.
    seed : int
        Seed.
    settings : SampleSettings, optional
        Lengths and thresholds of a walk.
    laplace : Laplace, optional
        The normal approximation, where it is known.
    progress : callable, optional
        Called with a line of text now and then by a walk.
    checkpoint : Checkpoint, optional
        Where the chains of a walk are kept as they grow.

    Returns
    -------
    Posterior
        Draws, diagnostics, and what is missing if it did not converge.

    Raises
    ------
    ComputationError
        If the posterior has no interior mode.
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import Laplace, fit_laplace, several_modes
