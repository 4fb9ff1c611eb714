"""Exact draws from the power law's posterior, for tables of many textures.

With a K per texture a walk in as many dimensions gets slow, and there is no need for one: given
sigma every log K is normal and independent of the others, and sigma's own density is known.
"""

import numpy as np

from ridgebayes.inference.emcee_sampling import Chains
from ridgebayes.inference.laplace import no_mode
from ridgebayes.inference.power_law_exact import (
    conditional_log_k,
    log_evidence_given_sigma,
    rounding,
)
from ridgebayes.model.model import Model
from ridgebayes.runtime.randomness import stream

_SHAPE = (4, 20, 128)  # ensembles, steps and walkers of the chains that the draws are laid out as


def sample_power_law(model: Model, *, seed: int) -> Chains:
    """Draw independently from the power law's posterior.

    Parameters
    ----------
    model : Model
        With form PowerLaw and log-normal priors of K.
    seed : int
        Seed.

    Returns
    -------
    Chains
        Independent draws laid out as chains: acceptance 1, autocorrelation time 1.

    Raises
    ------
    ComputationError
        If the form reproduces all rows to rounding.

    Notes
    -----
    *Validity.* Rows with misfit beyond rounding, or with known errors.
    *Accuracy.* sigma by inversion of its distribution function on a grid of 0.001 in log sigma;
    log K exactly.
    *Cost.* O(draws x textures).
    """
    log_sigma = np.concatenate([np.arange(-60.0, -20.0, 0.25), np.arange(-20.0, 20.0, 0.05)])
    coarse = _sigma_log_density(model, log_sigma)
    if np.exp(log_sigma[np.argmax(coarse)]) < rounding(model):
        raise no_mode(model)
    near = log_sigma[coarse > coarse.max() - 40]
    beyond = 0.05 if near[0] > -20 else 0.25
    log_sigma = np.arange(near[0] - beyond, near[-1] + beyond, 0.001)
    density = np.exp((fine := _sigma_log_density(model, log_sigma)) - fine.max())
    cdf = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])

    u = np.empty((*_SHAPE, model.n_parameter))
    for ensemble in range(_SHAPE[0]):
        rng = stream(seed, f"ensemble {ensemble}")
        drawn = np.interp(rng.random(_SHAPE[1:]) * cdf[-1], cdf, log_sigma)
        for step in range(_SHAPE[1]):  # a step at a time bounds the memory
            mean, sd = conditional_log_k(model, np.exp(drawn[step]))
            log_k = mean + sd * rng.standard_normal(mean.shape)
            theta = np.concatenate([np.exp(log_k), np.exp(drawn[step])[:, None]], axis=1)
            u[ensemble, step] = model.to_unconstrained(theta)
    log_density = np.stack([[model.log_density(step) for step in ensemble] for ensemble in u])
    tau = np.ones(model.n_parameter + 1)
    return Chains(u, log_density, np.ones(_SHAPE[0]), tau, ())


def _sigma_log_density(model: Model, log_sigma: np.ndarray) -> np.ndarray:
    sigma = np.exp(log_sigma)
    return log_evidence_given_sigma(model, sigma) + model.priors["sigma"].log_pdf(sigma) + log_sigma
