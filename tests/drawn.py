"""A model's posterior as the engine draws it, for tests of what rests on one."""

from ridgebayes.inference.importance import Effort, importance_sample
from ridgebayes.inference.posterior import posterior_of
from ridgebayes.inference.target import ModelTarget


def drawn_posterior(model, *, seed=1, **effort):
    """Return importance draws of a model; fields of `Effort` as keywords."""
    drawn = importance_sample(ModelTarget(model, seed), Effort(**effort), seed)
    return posterior_of(model, drawn, seed)
