"""Proposal of importance sampling: a mixture of multivariate Student t distributions in charts."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from ridgebayes._types import FloatArray, IntArray

DF = 5.0  # degrees of freedom; posteriors in normal scores have lighter tails
_N_EM_STEP = 8  # steps of expectation maximisation; a proposal need not be fully converged
_COMMON_SHAPE_DRAWS = 8.0  # weight of the common shape in each component's shape, in draws
MIN_RELATIVE_VARIANCE = 1e-6  # smallest variance of a component, relative to that of all draws


@dataclass(frozen=True, eq=False)
class Mixture:
    """Mixture of Student t components, each in the coordinates of a chart.

    Parameters
    ----------
    weights : ndarray of float, shape (n_component,)
        Weights with sum 1.
    charts : ndarray of int, shape (n_component,)
        Index of each component's chart.
    centres : ndarray of float, shape (n_component, d)
        Centres.
    factors : ndarray of float, shape (n_component, d, d)
        Lower Cholesky factors of the shapes.
    """

    weights: FloatArray
    charts: IntArray
    centres: FloatArray
    factors: FloatArray

    @classmethod
    def prior(cls, d: int) -> "Mixture":
        """Return one component of unit shape at the origin of the first chart."""
        return cls(np.ones(1), np.zeros(1, np.int64), np.zeros((1, d)), np.eye(d)[None])

    def beside(self, other: "Mixture", share: float) -> "Mixture":
        """Return a mixture of this mixture and a share of another mixture."""
        return Mixture(
            np.concatenate([(1 - share) * self.weights, share * other.weights]),
            np.concatenate([self.charts, other.charts]),
            np.concatenate([self.centres, other.centres]),
            np.concatenate([self.factors, other.factors]),
        )

    def draw(self, rng: np.random.Generator, n: int) -> tuple[IntArray, FloatArray]:
        """Return each draw's chart, shape (n,), and its coordinates in the chart, shape (n, d).

        The components of the draws are selected by systematic sampling, in random order.
        """
        cumulative = np.cumsum(self.weights)
        places = (np.arange(n) + rng.random()) / n * cumulative[-1]
        component = np.minimum(np.searchsorted(cumulative, places), len(cumulative) - 1)
        component = rng.permutation(component)
        d = self.centres.shape[1]
        steps = rng.standard_normal((n, d)) * np.sqrt(DF / rng.chisquare(DF, size=(n, 1)))
        moved = np.einsum("nij,nj->ni", self.factors[component], steps)
        return self.charts[component], self.centres[component] + moved

    def log_density(self, coordinates: FloatArray, log_jacobian: FloatArray) -> FloatArray:
        """Return the log density in normal scores, shape (n,).

        Parameters
        ----------
        coordinates : ndarray of float, shape (n_chart, n, d)
            Coordinates of the draws in every chart.
        log_jacobian : ndarray of float, shape (n_chart, n)
            log |du/dq| of each chart.
        """
        terms, _ = self._terms(coordinates, log_jacobian)
        return log_sum(terms)

    def _terms(
        self, coordinates: FloatArray, log_jacobian: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return log (weight times density) of components, and squared distances, both (c, n)."""
        d = self.centres.shape[1]
        peak = gammaln(0.5 * (DF + d)) - gammaln(0.5 * DF) - 0.5 * d * math.log(DF * math.pi)
        inverse = np.linalg.inv(self.factors)
        log_volumes = np.log(np.diagonal(self.factors, axis1=1, axis2=2)).sum(axis=1)
        deviation = coordinates[self.charts] - self.centres[:, None]
        squares = ((deviation @ np.swapaxes(inverse, 1, 2)) ** 2).sum(axis=-1)
        with np.errstate(divide="ignore"):
            constant = np.log(self.weights) + peak - log_volumes
        value = constant[:, None] - 0.5 * (DF + d) * np.log1p(squares / DF)
        return value - log_jacobian[self.charts], squares

    def fitted(
        self, coordinates: FloatArray, log_jacobian: FloatArray, weights: FloatArray
    ) -> "Mixture":
        """Return the mixture after a few steps of expectation maximisation on weighted draws.

        Parameters
        ----------
        coordinates, log_jacobian
            As for `log_density`.
        weights : ndarray of float, shape (n,)
            Normalised weights of the draws.

        References
        ----------
        Cappe et al. (2008), doi:10.1007/s11222-008-9059-x, section 3.
        """
        positive = weights > 0
        coordinates, log_jacobian = coordinates[:, positive], log_jacobian[:, positive]
        weights = weights[positive]
        d, n_effective = self.centres.shape[1], 1 / (weights**2).sum()
        points = coordinates[self.charts]
        mixture, shapes = self, self._common_shapes(coordinates, log_jacobian, weights)
        for _ in range(_N_EM_STEP):
            terms, squares = mixture._terms(coordinates, log_jacobian)
            share = np.exp(terms - log_sum(terms)) * weights
            mass = share.sum(axis=1)
            narrow = share * (DF + d) / (DF + squares)
            total = np.maximum(narrow.sum(axis=1), 1e-300)
            centres = (narrow[:, None] @ points)[:, 0] / total[:, None]
            centres = np.where(mass[:, None] > 1e-12, centres, mixture.centres)
            deviation = points - centres[:, None]
            scatter = np.swapaxes(narrow[..., None] * deviation, 1, 2) @ deviation
            prior = _COMMON_SHAPE_DRAWS / n_effective
            scatter = (scatter + prior * shapes) / (mass + prior)[:, None, None]
            mixture = Mixture(mass / mass.sum(), self.charts, centres, np.linalg.cholesky(scatter))
        kept = mixture.weights > 1e-4
        return Mixture(
            mixture.weights[kept] / mixture.weights[kept].sum(),
            self.charts[kept],
            mixture.centres[kept],
            mixture.factors[kept],
        )

    def _common_shapes(
        self, coordinates: FloatArray, log_jacobian: FloatArray, weights: FloatArray
    ) -> FloatArray:
        """Return for each component the covariance of the draws assigned to its chart."""
        terms, _ = self._terms(coordinates, log_jacobian)
        share = np.exp(terms - log_sum(terms)) * weights
        d, shapes = self.centres.shape[1], np.empty_like(self.factors)
        for chart in np.unique(self.charts).tolist():
            here = self.charts == chart
            weight = share[here].sum(axis=0)
            weight = weight / max(weight.sum(), 1e-300)
            deviation = coordinates[chart] - weight @ coordinates[chart]
            shape = (weight[:, None] * deviation).T @ deviation
            shapes[here] = shape + MIN_RELATIVE_VARIANCE * (np.trace(shape) / d + 1e-12) * np.eye(d)
        return shapes


def log_sum(terms: FloatArray) -> FloatArray:
    """Return log sum exp over the first axis; for small arrays it is faster than SciPy's."""
    top = terms.max(axis=0)
    value: FloatArray = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(value + np.log(np.exp(terms - value).sum(axis=0)))


def log_mean(terms: FloatArray) -> FloatArray:
    """Return the log of the mean of exponentials over the first axis."""
    return log_sum(terms) - math.log(len(terms))
