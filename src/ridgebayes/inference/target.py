"""Posterior densities in the form that importance sampling and walks use."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.inference.charts import Chart, charts_of
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.model.model import Model
from ridgebayes.runtime.randomness import stream


class Evaluated(NamedTuple):
    """Draws of outer parameters, with their densities and coordinates.

    Parameters
    ----------
    u : ndarray of float, shape (n, d)
        Normal scores.
    log_density, from_half : ndarray of float, shape (n,)
        Log posterior density in `u`, not normalised, estimated from all and from half of the
        points.
    scores : ndarray of float, shape (n, n_level)
        Scores of the offsets if the density is an estimate, else empty.
    coordinates : ndarray of float, shape (n_chart, n, d)
        Coordinates in every chart.
    log_jacobian : ndarray of float, shape (n_chart, n)
        log |du/dq| of every chart.
    """

    u: FloatArray
    log_density: FloatArray
    from_half: FloatArray
    scores: FloatArray
    coordinates: FloatArray
    log_jacobian: FloatArray


def joined(parts: Sequence[Evaluated]) -> Evaluated:
    """Concatenate sets of draws."""
    axes = (0, 0, 0, 0, 1, 1)
    columns = zip(zip(*parts, strict=True), axes, strict=True)
    return Evaluated(*(np.concatenate(arrays, axis=axis) for arrays, axis in columns))


class Target(Protocol):
    """A posterior density in charts: maps from coordinates q to normal scores u."""

    name: str
    names: tuple[str, ...]  # names of the d coordinates of u
    n_centred: int  # number of leading coordinates that charts centre at 0
    is_exact: bool  # False if densities are estimates

    @property
    def n_chart(self) -> int:
        """Number of charts, at least one."""
        ...

    def evaluate(
        self, charts: IntArray | None, q: FloatArray, rng: np.random.Generator, n_point: int
    ) -> Evaluated:
        """Evaluate draws at coordinates q (n, d) of charts (n,); if None, q are normal scores."""
        ...

    def approximate(self, chart: int, q: FloatArray) -> FloatArray:
        """Return a smooth log density in a chart's coordinates, shape (n,)."""
        ...


class ModelTarget:
    """A model's posterior of the outer parameters.

    Parameters
    ----------
    model : Model
        Latent Gaussian model.
    seed : int, optional
        Seed of the search for charts.
    """

    def __init__(self, model: Model, seed: int = 0) -> None:
        self.model, self._seed = model, seed
        self.integral = LatentIntegral(model)
        self.name = f"{model.form.name}, {model.noise.name}"
        self.names = model.outer_names
        self.n_centred = model.n_outer_coefficient
        self.is_exact = self.integral.is_exact

    @cached_property
    def charts(self) -> list[Chart]:
        """Charts about the modes of the coefficients."""
        return charts_of(self.integral, stream(self._seed, "charts"))

    @property
    def n_chart(self) -> int:
        """Number of charts."""
        return len(self.charts)

    def evaluate(
        self, charts: IntArray | None, q: FloatArray, rng: np.random.Generator, n_point: int
    ) -> Evaluated:
        """Evaluate draws at coordinates q of charts; if `charts` is None, q are normal scores."""
        n = self.integral.n_at_once(n_point)
        slices = [slice(i, i + n) for i in range(0, len(q), n)]
        chart_parts = [None if charts is None else charts[part] for part in slices]
        parts = zip(chart_parts, (q[part] for part in slices), strict=True)
        return joined([self._evaluate(*part, rng, n_point) for part in parts])

    def _evaluate(
        self, charts: IntArray | None, q: FloatArray, rng: np.random.Generator, n_point: int
    ) -> Evaluated:
        k = self.n_centred
        prepared = self.integral.prepared(self._error_parameters(q))
        with np.errstate(all="ignore"):
            conditionals = [chart.conditional(prepared) for chart in self.charts]
            u = q
            if charts is not None and k:
                u = np.choose(charts[:, None], [normal.to_scores(q) for normal in conditionals])
            coordinates = np.stack([normal.from_scores(u) for normal in conditionals])
            log_jacobian = np.stack([normal.log_jacobian for normal in conditionals])
            usable = np.asarray(np.isfinite(u).all(axis=1))
            finite_u = np.where(usable[:, None], u, 0.0)
            estimate = self.integral.estimated(finite_u, rng, n_point, prepared)
        log_density, from_half = (
            np.where(usable, value, -np.inf) for value in (estimate.log_density, estimate.from_half)
        )
        return Evaluated(u, log_density, from_half, estimate.scores, coordinates, log_jacobian)

    def approximate(self, chart: int, q: FloatArray) -> FloatArray:
        """Return the log density in a chart's coordinates, by Laplace's method if not exact."""
        n = self.integral.n_at_once(4)
        starts = range(0, len(q), n)
        return np.concatenate([self._approximate(chart, q[i : i + n]) for i in starts])

    def _approximate(self, chart: int, q: FloatArray) -> FloatArray:
        prepared = self.integral.prepared(self._error_parameters(q))
        with np.errstate(all="ignore"):
            conditional = self.charts[chart].conditional(prepared)
            u = conditional.to_scores(q)
            usable = np.asarray(np.isfinite(u).all(axis=1))
            value = self.integral.approximate(np.where(usable[:, None], u, 0.0), prepared)
            value = value + conditional.log_jacobian
        return np.where(usable & np.isfinite(value), value, -np.inf)

    def _error_parameters(self, q: FloatArray) -> FloatArray:
        """Return error model parameters; their scores are the last coordinates of every chart."""
        k = self.n_centred
        u = np.concatenate([np.zeros((len(q), k)), q[:, k:]], axis=1)
        return self.model.outer_theta(u)[:, k:]


class PlainTarget:
    """A density with one chart, whose coordinates are the normal scores.

    Parameters
    ----------
    name : str
        Name in messages.
    names : tuple of str, length d
        Names of the coordinates.
    log_density : callable
        Function from normal scores (n, d) to log densities (n,).
    """

    n_chart, n_centred, is_exact = 1, 0, True

    def __init__(
        self,
        name: str,
        names: tuple[str, ...],
        log_density: Callable[[FloatArray], FloatArray],
    ) -> None:
        self.name, self.names, self._log_density = name, names, log_density

    def evaluate(
        self, charts: IntArray | None, q: FloatArray, rng: np.random.Generator, n_point: int
    ) -> Evaluated:
        """Evaluate draws at normal scores q."""
        value = self._log_density(q)
        return Evaluated(q, value, value, np.empty((len(q), 0)), q[None], np.zeros((1, len(q))))

    def approximate(self, chart: int, q: FloatArray) -> FloatArray:
        """Return the log density."""
        return self._log_density(q)
