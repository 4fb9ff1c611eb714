"""Methods that distributions of Q and of loads share: quantiles, draws, a table and a picture."""

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


def by_name(**arguments: ArrayLike) -> "tuple[list[Any], xr.DataArray | None]":
    """Return arguments in one shape and their labels, if some are DataArrays: by dimension.

    Raises
    ------
    InputError
        If there are arrays without names among them, or coordinates differ.
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


def labelled(method: _Method) -> _Method:
    """Return a method whose arrays of the shape of all places have the labels of these."""

    @functools.wraps(method)
    def with_labels(self: "Predicted", *args: Any, **kwargs: Any) -> Any:
        value = method(self, *args, **kwargs)
        if self.labels is None or np.shape(value) != self.shape:
            return value
        return self.labels.copy(data=np.asarray(value))

    return with_labels  # type: ignore[return-value]


class Predicted(Tabular):
    """Distributions of one quantity at places of shape (...), with the names of scipy.stats."""

    labels: "xr.DataArray | None"  # dimensions and coordinates of places that had some
    _margin = 0.0  # of a probability to 0 and 1, within which there is no quantile

    @property
    @abstractmethod
    def shape(self) -> tuple[int, ...]:
        """The shape of textures and loads or counts."""

    @property
    @abstractmethod
    def _where(self) -> Mapping[str, Any]:
        """Columns of tables for each place: arrays that broadcast to `shape`, by name."""

    @abstractmethod
    def _quantile(self, prob: FloatArray) -> np.ndarray:
        """Return quantiles of probabilities that broadcast with `shape`."""

    @abstractmethod
    def _draw(self, generator: np.random.Generator, n: int) -> np.ndarray:
        """Return draws, shape (n, ...)."""

    @abstractmethod
    def _columns(self, prob: float) -> dict[str, np.ndarray]:
        """Return the columns of a table, each of `shape` or one number."""

    @abstractmethod
    def _first(self, n: int) -> "Predicted":
        """Return the first distributions of the flat array."""

    @labelled
    def quantile(self, prob: ArrayLike) -> np.ndarray:
        """Return the least value up to which lies a probability of `prob`; ``ppf`` is the same.

        Parameters
        ----------
        prob : array_like of float, broadcastable, dimensionless
            Probability.

        Returns
        -------
        ndarray, broadcast shape, dimensionless
            Even counts, or loads p/E, infinite beyond floats.

        Raises
        ------
        InputError
            If `prob` is outside 0 to 1; of loads also if it is 0, or nearer to 1 than 1e-12, where
            sums over draws can no longer tell quantiles apart; if the shapes do not broadcast.
        """
        wanted = self._probability(prob, 1)
        common_shape(prob=wanted, distribution=self._numbers)
        return self._quantile(wanted)

    ppf = quantile

    def median(self) -> np.ndarray:
        """Return the median, shape (...)."""
        return self.quantile(0.5)

    def interval(self, prob: ArrayLike = 0.9) -> tuple[np.ndarray, np.ndarray]:
        """Return the equal-tailed interval that holds at least `prob`.

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
            If `prob` is outside 0 to 1, of loads nearer to 1 than 2e-12; if the shapes do not
            broadcast.
        """
        half = self._probability(prob, 2) / 2
        return self.quantile(0.5 - half), self.quantile(0.5 + half)

    def rvs(
        self,
        size: int | tuple[int, ...] | None = None,
        rng: Rng | None = None,
        *,
        random_state: Rng | None = None,
    ) -> np.ndarray:
        """Draw values.

        Parameters
        ----------
        size : int or tuple of int, optional
            Draws of each distribution; one if not given.
        rng : int or numpy.random.Generator, optional
            Seed; other draws each time if not given.
        random_state : int or numpy.random.Generator, optional
            The same by SciPy's name.

        Returns
        -------
        ndarray, shape size + (...), dimensionless
            Even counts, or loads p/E.

        Raises
        ------
        InputError
            If `size` holds no whole numbers from 0, the seed is none, or there are two.
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
            A row a distribution. Columns are those of the run folder's bands.csv, or of its
            loads.csv.

        Raises
        ------
        InputError
            If `prob` is outside 0 to 1.
        """
        columns = {**self._where, **self._columns(prob)}
        return pd.DataFrame(
            {name: np.broadcast_to(x, self.shape).ravel() for name, x in columns.items()}
        )

    def _first_rows(self, n: int) -> pd.DataFrame:
        return self._first(n).to_dataframe()

    @property
    def _numbers(self) -> IntArray:
        return np.arange(prod(self.shape)).reshape(self.shape)

    def _first_places(self, n: int) -> dict[str, np.ndarray]:
        """Return what tables show of the first distributions."""
        return {k: np.broadcast_to(v, self.shape).ravel()[:n] for k, v in self._where.items()}

    def _probability(self, prob: ArrayLike, n_tail: int) -> FloatArray:
        """Return probabilities, or raise InputError if `n_tail` tails leave none beside them."""
        values = numbers("prob", prob)
        is_open = self._margin > 0 and n_tail == 1
        within = (values > 0 if is_open else values >= 0) & (values <= 1 - n_tail * self._margin)
        if not np.all(within):
            rule = "0 <= prob <= 1"
            if self._margin:
                rule = f"0 {'<' if is_open else '<='} prob < 1, at most 1 - {n_tail}e-12"
            raise InputError(f"prob: expected {rule}, got {prob!r}")
        return values
