"""The sampler that suits a model: a walk, importance sampling, or exact draws."""

from dataclasses import replace

from ridgebayes.inference.chains import ProgressCallback, SampleSettings, walkers_for
from ridgebayes.inference.checkpoint import Checkpoint
from ridgebayes.inference.emcee_sampling import sample
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import Laplace, fit_laplace, several_modes
from ridgebayes.inference.posterior import Posterior, drawn_exactly, posterior_of
from ridgebayes.inference.power_law_exact import sample_power_law
from ridgebayes.model.model import Model
from ridgebayes.runtime.progress import tell

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

    Notes
    -----
    Offsets that have no closed-form integral are not walked over: importance sampling of the
    parameters draws them by the way. A power law of very many textures is drawn from exactly.
    """
    if drawn_exactly(model):
        chains = sample_power_law(model, seed=seed)
        return posterior_of(model, chains, laplace, seed=seed, sampler="exact")
    laplace = laplace.bound_to(model) if laplace else fit_laplace(model)
    laplace = replace(laplace, other_modes=several_modes(model, laplace))
    if model.is_latent:
        return importance_posterior(model, laplace, seed=seed, **_LATENT)[0]
    settings = settings or SampleSettings()
    if settings.n_walker is None:
        n_walker = walkers_for(len(model.data.textures), model.is_iid_gaussian)
        settings = replace(settings, n_walker=n_walker)
    chains = sample(
        model.log_density,
        laplace,
        seed=seed,
        names=model.parameter_names,
        settings=settings,
        progress=progress or (lambda text: tell(f"{model.form.name}, {model.noise.name}: {text}")),
        checkpoint=checkpoint,
    )
    failures = chains.convergence_failures + laplace.other_modes
    chains = replace(chains, convergence_failures=failures)
    return posterior_of(model, chains, laplace, seed=seed, sampler="emcee")
