"""Posteriors as the engine draws them or as points, and loads of typed draws, for tests on them."""

import numpy as np
import pandas as pd

from ridgebayes import Fit, LoadDistribution, Noise
from ridgebayes.inference.chains import Chains
from ridgebayes.inference.importance import Effort, importance_sample
from ridgebayes.inference.posterior import posterior_of
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations


def model_of(rows, form, noise="iid", priors=None):
    """Return the model of a table or of observations; the error model or its name."""
    data = rows if isinstance(rows, Observations) else Observations.from_table(rows)
    return Model(data, form, noise if isinstance(noise, Noise) else Noise.named(noise), priors)


def points_of(model, theta=None, u=None):
    """Return a fit whose draws are some parameters, shape (n_draw, n), or scores of the prior."""
    u = model.to_scores(np.asarray(theta, float)) if u is None else u
    chains = Chains(
        u[None, None], np.zeros((1, 1, len(u))), np.ones(1), np.ones(u.shape[1] + 1), ()
    )
    return Fit(model, chains, pd.DataFrame(), (), 0)


def importance_draws(model, *, seed=1, **effort):
    """Return importance draws of a model, with their evidence; fields of `Effort` as keywords."""
    return importance_sample(ModelTarget(model, seed), Effort(**effort), seed)


def drawn_posterior(model, *, seed=1, **effort):
    """Return the fit of importance draws of a model; fields of `Effort` as keywords."""
    return Fit.of(posterior_of(model, importance_draws(model, seed=seed, **effort), seed))


def loads_of(log_mean, sd, weight, flags=None):
    """Return the distribution of loads of draws, log_mean (n_draw, ...) and sd as it or (n_draw,).

    Each place has a column of its own.
    """
    n, shape = len(log_mean), log_mean.shape[1:]
    sd = np.broadcast_to(
        sd.reshape(n, *[1] * (log_mean.ndim - sd.ndim), *sd.shape[1:]), log_mean.shape
    )
    columns = log_mean.reshape(n, -1), sd.reshape(n, -1)
    place = np.arange(log_mean[0].size).reshape(shape)
    flags = np.zeros(shape, np.uint8) if flags is None else flags
    return LoadDistribution(
        weight, lambda ids: tuple(x[:, ids] for x in columns), place, flags, np.full(shape, np.inf)
    )
