"""The targets as PyMC models, for the peers that need gradients."""

import numpy as np
import pymc as pm
import pytensor.tensor as pt
from target import Target


def pymc_model(target: Target) -> pm.Model:
    """Return the model, written as one would in PyMC; parameters have the target's names."""
    make = {
        "log-normal": lambda name, median, sd: pm.LogNormal(name, np.log(median), sd),
        "normal": lambda name, mean, sd: pm.Normal(name, mean, sd),
        "half-normal": lambda name, sd: pm.HalfNormal(name, sd),
    }
    with pm.Model() as model:
        at = {
            name: make[kind](name, *fields)
            for name, (kind, *fields) in zip(target.names, target.priors, strict=True)
        }
        if target.form == "modified":
            rate = at["c"] / target.pitch
        else:
            rate = at["c1"] / target.pitch + at["c2"] / target.ridge
        log_load = 2 * pt.log(target.pairs / rate)
        if target.has_offsets:
            covariance = (
                at["sigma"] ** 2 * np.eye(len(target.pairs))
                + at["tau_texture"] ** 2 * target.same_texture
                + at["tau_step"] ** 2 * target.same_step
            )
            pm.MvNormal("log_load", log_load, cov=covariance, observed=target.log_load)
        else:
            pm.Normal("log_load", log_load, at["sigma"], observed=target.log_load)
    return model


def draws_of(found, names: tuple[str, ...]) -> np.ndarray:
    """Return draws, shape (n_chain, n_draw, n_parameter), of what PyMC and nutpie return."""
    return np.stack([found.posterior[name].to_numpy() for name in names], axis=-1)
