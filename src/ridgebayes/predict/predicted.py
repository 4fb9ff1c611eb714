"""Base class of the distributions of Q and of loads: quantiles, random draws and tables."""

import functools
import sys
from abc import abstractmethod
from collections.abc import Callable, Mapping
from math import prod
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray, IntArray, Rng, Tabular
from ridgebayes.errors import InputError
from ridgebayes.model.forms.arguments import common_shape, draw_shape, numbers
from ridgebayes.runtime.randomness import seeded

if TYPE_CHECKING:  # heavy
    import xarray as xr

_Method = TypeVar("_Method", bound=Callable[..., Any])


def align_arrays(**arguments: ArrayLike) -> "tuple[list[Any], xr.DataArray | None]":
    """Broadcast DataArrays by dimension name; return the arrays and their common labels.

    Arguments without a DataArray are returned unchanged, with None for the labels.

    Raises
    ------
    InputError
        If DataArrays are mixed with unnamed arrays, or their coordinates differ.
    """
    values, xarray = list(arguments.values()), sys.modules.get("xarray")
    if xarray is None or not any(isinstance(x, xarray.DataArray) for x in values):
        return values, None
    for name, value in arguments.items():
        if not isinstance(value, xarray.DataArray) and np.ndim(value):
            raise InputError(f"{name}: expected a number or a DataArray beside DataArrays")
    arrays = [xarray.DataArray(value).reset_coords(drop=True) for value in values]
    try:
        arrays = xarray.broadcast(*xarray.align(*arrays, join="exact"))
    except ValueError as error:
        raise InputError(f"expected DataArrays with equal coordinates: {error}") from None
    return [array.values for array in arrays], arrays[0].rename(None)


def keep_labels(method: _Method) -> _Method:
    """Decorate a method so that a result of shape `shape` is returned with the labels."""

    @functools.wraps(method)
    def with_labels(self: "Predicted", *args: Any, **kwargs: Any) -> Any:
        value = method(self, *args, **kwargs)
        if self.labels is None or np.shape(value) != self.shape:
            return value
        return self.labels.copy(data=np.asarray(value))

    return with_labels  # type: ignore[return-value]


class Predicted(Tabular):
    """Distributions of one quantity at an array of places, with the method names of scipy.stats."""

    labels: "xr.DataArray | None"  # dimensions and coordinates, if the arguments were DataArrays
    _MIN_TAIL = 0.0  # smallest tail probability for which quantiles are computed

    @property
    @abstractmethod
    def shape(self) -> tuple[int, ...]:
        """Broadcast shape of the textures and the loads or counts."""

    @abstractmethod
    def _quantile(self, prob: FloatArray) -> np.ndarray:
        """Return quantiles at probabilities that broadcast with `shape`."""

    @abstractmethod
    def _draw(self, generator: np.random.Generator, n: int) -> np.ndarray:
        """Return draws, shape (n, ...)."""

    @abstractmethod
    def _columns(self, prob: float) -> dict[str, np.ndarray]:
        """Return the table columns of places and predictions, which broadcast to `shape`."""

    @abstractmethod
    def _first(self, n: int) -> "Predicted":
        """Return the first n distributions of the flattened array."""

    @keep_labels
    def quantile(self, prob: ArrayLike) -> np.ndarray:
        """Return the smallest value whose cumulative probability is at least `prob`.

        ``ppf`` is an alias.

        Parameters
        ----------
        prob : array_like of float, broadcastable, dimensionless
            Probability.

        Returns
        -------
        ndarray, broadcast shape, dimensionless
            Even counts, or loads p/E. Loads too large for a float are infinite.

        Raises
        ------
        InputError
            If `prob` is outside 0 to 1, or the shapes do not broadcast. For loads also if `prob`
            is 0 or within 1e-12 of 1, where rounding of sums over draws hides the quantile.
        """
        probability = self._checked_probability(prob, 1)
        common_shape(prob=probability, distribution=self._place_ids)
        return self._quantile(probability)

    ppf = quantile

    def median(self) -> np.ndarray:
        """Return the median, shape (...)."""
        return self.quantile(0.5)

    def interval(self, prob: ArrayLike = 0.9) -> tuple[np.ndarray, np.ndarray]:
        """Return the equal-tailed interval with a probability of at least `prob`.

        Parameters
        ----------
        prob : array_like of float, broadcastable, dimensionless
            Probability.

        Returns
        -------
        lower, upper : ndarray, broadcast shape, dimensionless
            Even counts, or loads p/E.

        Raises
        ------
        InputError
            If `prob` is outside 0 to 1, or the shapes do not broadcast. For loads also if `prob`
            is within 2e-12 of 1.
        """
        half = self._checked_probability(prob, 2) / 2
        return self.quantile(0.5 - half), self.quantile(0.5 + half)

    def rvs(
        self,
        size: int | tuple[int, ...] | None = None,
        rng: Rng | None = None,
        *,
        random_state: Rng | None = None,
    ) -> np.ndarray:
        """Draw random values.

        Parameters
        ----------
        size : int or tuple of int, optional
            Shape of the draws from each distribution; a single draw if not given.
        rng : int or numpy.random.Generator, optional
            Seed or generator; if not given, every call draws different values.
        random_state : int or numpy.random.Generator, optional
            Alias of `rng`, as in SciPy.

        Returns
        -------
        ndarray, shape size + (...), dimensionless
            Even counts, or loads p/E.

        Raises
        ------
        InputError
            If `size` is not made of whole numbers >= 0, the seed is invalid, or both `rng` and
            `random_state` are given.
        """
        if rng is not None and random_state is not None:
            raise InputError("rvs: expected rng or random_state, got both")
        generator = seeded(random_state if rng is None else rng)
        before = draw_shape(size)
        return self._draw(generator, prod(before)).reshape(*before, *self.shape)

    def to_dataframe(self, prob: float = 0.9) -> pd.DataFrame:
        """Return the distributions as a table.

        Parameters
        ----------
        prob : float, optional
            Probability of the interval.

        Returns
        -------
        pandas.DataFrame
            One row for each distribution, with the columns of the run folder's bands.csv or
            loads.csv.

        Raises
        ------
        InputError
            If `prob` is outside 0 to 1.
        """
        return pd.DataFrame(self._heads(self._columns(prob)))

    def _first_rows(self, n: int) -> pd.DataFrame:
        return self._first(n).to_dataframe()

    @property
    def _place_ids(self) -> IntArray:
        return np.arange(prod(self.shape)).reshape(self.shape)

    def _heads(self, columns: Mapping[str, Any], n: int | None = None) -> dict[str, Any]:
        """Return the first n values of flattened arrays that broadcast to `shape`, by name."""
        return {k: np.broadcast_to(x, self.shape).ravel()[:n] for k, x in columns.items()}

    def _checked_probability(self, prob: ArrayLike, n_tail: int) -> FloatArray:
        """Return probabilities; raise InputError if one of `n_tail` tails is below `_MIN_TAIL`."""
        values = numbers("prob", prob)
        is_open = self._MIN_TAIL > 0 and n_tail == 1
        within = (values > 0 if is_open else values >= 0) & (values <= 1 - n_tail * self._MIN_TAIL)
        if not np.all(within):
            rule = "0 <= prob <= 1"
            if self._MIN_TAIL:
                rule = f"0 {'<' if is_open else '<='} prob < 1, at most 1 - {n_tail}e-12"
            raise InputError(f"prob: expected {rule}, got {prob!r}")
        return values
