"""The joint prior of several parameters, with conversion to and from normal scores."""

from collections.abc import Callable, Iterable
from dataclasses import astuple

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.distributions.distribution import Distribution


class JointPrior:
    """Product of independent priors, evaluated at once for all priors of the same type.

    Parameters
    ----------
    priors : iterable of Distribution
        One per parameter, in the order of the last axis of `theta`.
    """

    def __init__(self, priors: Iterable[Distribution]) -> None:
        self._priors = tuple(priors)
        self._groups: list[tuple[list[int], Distribution]] = []
        single = [([i], prior) for i, prior in enumerate(self._priors) if not prior.is_stackable]
        self._groups += single
        for kind in dict.fromkeys(type(prior) for prior in self._priors if prior.is_stackable):
            columns = [i for i, prior in enumerate(self._priors) if type(prior) is kind]
            fields = zip(*(astuple(self._priors[i]) for i in columns), strict=True)
            stacked: Callable[..., Distribution] = kind
            self._groups.append((columns, stacked(*map(np.array, fields))))

    def log_pdf(self, theta: FloatArray) -> FloatArray:
        """Return the joint log density, shape ``theta.shape[:-1]``."""
        total = np.zeros(theta.shape[:-1])
        for columns, priors in self._groups:
            total += priors.log_pdf(theta[..., columns]).sum(axis=-1)
        return total

    def at_scores(self, u: FloatArray) -> FloatArray:
        """Convert normal scores `u` to parameters of the same shape."""
        theta = np.empty(u.shape)
        for columns, priors in self._groups:
            theta[..., columns] = priors.value_at(u[..., columns])
        return theta

    def scores(self, theta: FloatArray) -> FloatArray:
        """Convert parameters to normal scores of the same shape."""
        u = np.empty(theta.shape)
        for columns, priors in self._groups:
            u[..., columns] = priors.score(theta[..., columns])
        return u

    def at_scores_slope(self, u: FloatArray, theta: FloatArray) -> FloatArray:
        """Return d theta / du of each parameter, shape of `u`."""
        slope = np.empty(u.shape)
        for columns, priors in self._groups:
            slope[..., columns] = priors.slope_at(u[..., columns], theta[..., columns])
        return slope

    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        """Draw all parameters, shape (size, n_parameter)."""
        return np.stack([prior.rvs(rng, size) for prior in self._priors], axis=-1)
